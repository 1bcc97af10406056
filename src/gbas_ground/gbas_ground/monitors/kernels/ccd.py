# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Code-carrier divergence of single bands; axes as in :mod:`gbas_ground.monitors.ccd`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.divergence_filter import filter_value


@compiled
def filtered_rates(value_m, f1, f2, since_s, age_s, code_m, carrier_m, restarted, dt_s, tau_s, max_gap_s, settle_s):
    """Filter code minus carrier of every channel, arrays ``(R, F, N)``.

    Returns
    -------
    value_m, f1, f2, since_s, age_s : arrays
        Memory of the filters.
    filtered : array
        [m/s].
    settled : bool array
    """
    shape = code_m.shape
    value, first, second = np.empty(shape), np.empty(shape), np.empty(shape)
    since, age, filtered = np.empty(shape), np.empty(shape), np.empty(shape)
    settled = np.empty(shape, dtype=np.bool_)
    for row in range(shape[0]):
        for band in range(shape[1]):
            for sat in range(shape[2]):
                at = row, band, sat
                now = code_m[at] - carrier_m[at]
                value[at], first[at], second[at], since[at], age[at], _, filtered[at] = filter_value(
                    value_m[at], f1[at], f2[at], since_s[at], age_s[at], now, restarted[at], dt_s, tau_s, max_gap_s
                )
                settled[at] = age[at] >= settle_s and since[at] == 0.0
    return value, first, second, since, age, filtered, settled


@compiled
def tested(filtered, settled, used, threshold):
    """Mean of the settled channels in use ``(F, N)``, how many they are, its size, and whether that is too large.

    ``filtered`` (R, F, N), ``used`` (R, N). Where there is no channel the mean is NaN and nothing fails.
    """
    n_receivers, n_bands, n_sats = filtered.shape
    mean, size = np.full((n_bands, n_sats), np.nan), np.full((n_bands, n_sats), np.nan)
    receivers = np.zeros((n_bands, n_sats), dtype=np.int64)
    failed = np.zeros((n_bands, n_sats), dtype=np.bool_)
    for band in range(n_bands):
        for sat in range(n_sats):
            total, count = 0.0, 0
            for row in range(n_receivers):
                if settled[row, band, sat] and used[row, sat]:
                    total += filtered[row, band, sat]
                    count += 1
            if count > 0:
                mean[band, sat] = total / count
                size[band, sat] = np.abs(mean[band, sat])
                failed[band, sat] = not size[band, sat] <= threshold
            receivers[band, sat] = count
    return mean, receivers, size, failed
