# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""C/N0 of channels and satellites; axes as in :mod:`gbas_ground.monitors.expected_power`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.interpolation import interpolated


@compiled
def averaged(mean_dbhz, unseen_s, cn0_dbhz, bands, dt_s, average_s, max_gap_s):
    """Exponential averages of the channels that have C/N0 now.

    Parameters
    ----------
    mean_dbhz, unseen_s : (R, F, N) arrays
        Averages, and time since C/N0 was last there.
    cn0_dbhz : (R, N_BANDS, N) array
    bands : (F,) int array
    dt_s, average_s, max_gap_s : float

    Returns
    -------
    now_dbhz : (R, F, N) array
        NaN where there is no C/N0 now.
    mean_dbhz, unseen_s : (R, F, N) arrays
        To remember.
    """
    now, mean, unseen = np.empty(mean_dbhz.shape), np.empty(mean_dbhz.shape), np.empty(mean_dbhz.shape)
    for row in range(mean_dbhz.shape[0]):
        for place in range(mean_dbhz.shape[1]):
            for sat in range(mean_dbhz.shape[2]):
                value, before = cn0_dbhz[row, bands[place], sat], mean_dbhz[row, place, sat]
                elapsed = unseen_s[row, place, sat] + dt_s
                if not np.isfinite(value):
                    now[row, place, sat], mean[row, place, sat], unseen[row, place, sat] = np.nan, before, elapsed
                    continue
                if 0.0 < elapsed <= max_gap_s:
                    value = before + min(elapsed / average_s, 1.0) * (value - before)
                now[row, place, sat], mean[row, place, sat], unseen[row, place, sat] = value, value, 0.0
    return now, mean, unseen


@compiled
def elevation_bin(elevation_rad, width_rad, count):
    """Bin of an elevation; the lowest for one that is not known or below the horizon."""
    if not np.isfinite(elevation_rad):
        return 0
    return min(max(int(elevation_rad / width_rad), 0), count - 1)


@compiled
def _learnt(learnt_dbhz, learnt_s, taken, band, place, after_s):
    """Mean of what the receivers taken have learnt in a bin; minus infinity unless all of them know it."""
    total, count = 0.0, 0
    for row in range(len(taken)):
        if taken[row]:
            if not learnt_s[row, band, place] >= after_s:
                return -np.inf
            total += learnt_dbhz[row, band, place]
            count += 1
    return total / max(count, 1)


@compiled
def tested(
    mean_dbhz, cn0_dbhz, bands, due, elevation_rad, nodes_rad, minimum_dbhz, margin_db, learn, drop_db, after_s,
    learnt_dbhz, learnt_s, width_rad,
):  # fmt: skip
    """Averages against the table, and against what was learnt where that is higher.

    Parameters
    ----------
    mean_dbhz : (R, F, N) array
        From :func:`averaged`.
    cn0_dbhz, bands
        As there.
    due : (R, N) bool array
    elevation_rad : (N,) array
    nodes_rad, minimum_dbhz : (K,) and (F, K) arrays
        The table.
    margin_db, drop_db, after_s, width_rad : float
    learn : bool
    learnt_dbhz, learnt_s : (R, F, E) arrays

    Returns
    -------
    channels : (2, R, F, N) array
        Minus C/N0 and minus its minimum.
    channels_failed, wanted : (R, F, N) bool arrays
    satellites : (2, F, N) array
        The same of the means over the receivers.
    satellites_failed : (F, N) bool array
    """
    n_receivers, n_bands, n_sats = mean_dbhz.shape
    channels = np.empty((2, n_receivers, n_bands, n_sats))
    channels_failed, wanted = np.empty(mean_dbhz.shape, dtype=np.bool_), np.empty(mean_dbhz.shape, dtype=np.bool_)
    satellites, satellites_failed = np.empty((2, n_bands, n_sats)), np.empty((n_bands, n_sats), dtype=np.bool_)
    taken = np.empty(n_receivers, dtype=np.bool_)
    for band in range(n_bands):
        for sat in range(n_sats):
            least = interpolated(elevation_rad[sat], nodes_rad, minimum_dbhz[band])
            total, count, expected = 0.0, 0, False
            for row in range(n_receivers):
                mean = mean_dbhz[row, band, sat]
                asked = due[row, sat] and (band == 0 or np.isfinite(cn0_dbhz[row, bands[band], sat]))
                wanted[row, band, sat], taken[row] = asked, asked and np.isfinite(mean)
                channels[0, row, band, sat], channels[1, row, band, sat] = -mean, -(least - margin_db)
                channels_failed[row, band, sat] = asked and not -mean <= -(least - margin_db)
                expected = expected or asked
                if taken[row]:
                    total += mean
                    count += 1
            if learn:
                place = elevation_bin(elevation_rad[sat], width_rad, learnt_s.shape[2])
                least = np.maximum(least, _learnt(learnt_dbhz, learnt_s, taken, band, place, after_s) - drop_db)
            average = total / count if count > 0 else np.nan
            satellites[0, band, sat], satellites[1, band, sat] = -average, -least
            satellites_failed[band, sat] = expected and not -average <= -least
    return channels, channels_failed, wanted, satellites, satellites_failed


@compiled
def taught(
    learnt_dbhz, learnt_s, cn0_dbhz, bands, wanted, channels_failed, satellites_failed, elevation_rad, dt_s, learn_s,
    width_rad,
):  # fmt: skip
    """What is known after this epoch ``(R, F, E)``: a mean at first, an exponential one later."""
    n_receivers, n_bands, n_bins = learnt_s.shape
    known, known_s = learnt_dbhz.copy(), learnt_s.copy()
    total, number = np.empty(n_bins), np.empty(n_bins)
    for row in range(n_receivers):
        for band in range(n_bands):
            total[:] = 0.0
            number[:] = 0.0
            for sat in range(len(elevation_rad)):
                value = cn0_dbhz[row, bands[band], sat]
                fails = channels_failed[row, band, sat] or satellites_failed[band, sat]
                if wanted[row, band, sat] and np.isfinite(value) and not fails:
                    place = elevation_bin(elevation_rad[sat], width_rad, n_bins)
                    total[place] += value
                    number[place] += 1.0
            for place in range(n_bins):
                if number[place] > 0.0:
                    known_s[row, band, place] += dt_s
                    weight = max(dt_s / max(known_s[row, band, place], dt_s), dt_s / learn_s)
                    mean = total[place] / number[place]
                    known[row, band, place] += weight * (mean - known[row, band, place])
    return known, known_s


@compiled
def too_weak(cn0_dbhz, tracked, minimum_dbhz, required):
    """Minus C/N0 of channels ``(R, N)``, and which are below the minimum, or without C/N0 where that is required."""
    statistic, failed = np.empty(cn0_dbhz.shape), np.empty(cn0_dbhz.shape, dtype=np.bool_)
    for row in range(cn0_dbhz.shape[0]):
        for sat in range(cn0_dbhz.shape[1]):
            value = cn0_dbhz[row, sat]
            statistic[row, sat] = -value
            failed[row, sat] = tracked[row, sat] and (required or not np.isnan(value)) and not -value <= -minimum_dbhz
    return statistic, failed
