# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Code-carrier divergence of single bands; axes as in :mod:`gbas_ground.monitors.ccd`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.divergence_filter import AGE, F1, F2, N_MEMORY, SINCE, VALUE, filter_value


@compiled
def _filter(memory, code_m, carrier_m, restarted, dt_s, tau_s, max_gap_s, settle_s, after, filtered, settled):
    for row in range(code_m.shape[0]):
        for band in range(code_m.shape[1]):
            for sat in range(code_m.shape[2]):
                at, own = (row, band, sat), memory[:, row, band, sat]
                made = filter_value(
                    own[VALUE], own[F1], own[F2], own[SINCE], own[AGE],
                    code_m[at] - carrier_m[at], restarted[at], dt_s, tau_s, max_gap_s,
                )  # fmt: skip
                for each in range(N_MEMORY):
                    after[each, row, band, sat] = made[each]
                filtered[at] = made[N_MEMORY + 1]
                settled[at] = made[AGE] >= settle_s and made[SINCE] == 0.0


@compiled
def step(
    memory, code_m, carrier_m, restarted, used, dt_s, tau_s, max_gap_s, settle_s, threshold_mps,
    after, filtered, settled, means, failed,
):  # fmt: skip
    """Filter code minus carrier of every channel, and test the means over the receivers.

    Parameters
    ----------
    memory, after : (5, R, F, N) arrays
        Of the filters; `after` is filled in.
    code_m, carrier_m, restarted : (R, F, N) arrays
    used : (R, N) bool array
    dt_s, tau_s, max_gap_s, settle_s, threshold_mps : float
    filtered, settled : (R, F, N) arrays
        Filled in: rates [m/s], and where they count.
    means : (3, F, N) array
        Filled in: mean of the settled channels in use, its size, NaN without one, and how many they are.
    failed : (F, N) bool array
        Filled in.
    """
    _filter(memory, code_m, carrier_m, restarted, dt_s, tau_s, max_gap_s, settle_s, after, filtered, settled)
    for band in range(code_m.shape[1]):
        for sat in range(code_m.shape[2]):
            total, count = 0.0, 0
            for row in range(code_m.shape[0]):
                if settled[row, band, sat] and used[row, sat]:
                    total += filtered[row, band, sat]
                    count += 1
            mean = total / count if count > 0 else np.nan
            means[0, band, sat], means[1, band, sat], means[2, band, sat] = mean, np.abs(mean), count
            failed[band, sat] = count > 0 and not np.abs(mean) <= threshold_mps
