# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""C/N0 of channels and satellites; axes as in :mod:`gbas_ground.monitors.expected_power`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.interpolation import interpolated


@compiled
def _average(before, cn0_dbhz, bands, dt_s, average_s, max_gap_s, after, now):
    """Exponential averages of the channels: ``before``, ``after`` (2, R, F, N), ``now`` (R, F, N) without the old."""
    for row in range(now.shape[0]):
        for place in range(now.shape[1]):
            for sat in range(now.shape[2]):
                value, mean = cn0_dbhz[row, bands[place], sat], before[0, row, place, sat]
                elapsed = before[1, row, place, sat] + dt_s
                now[row, place, sat] = np.nan
                if not np.isfinite(value):
                    after[0, row, place, sat], after[1, row, place, sat] = mean, elapsed
                    continue
                if 0.0 < elapsed <= max_gap_s:
                    value = mean + min(elapsed / average_s, 1.0) * (value - mean)
                now[row, place, sat], after[0, row, place, sat], after[1, row, place, sat] = value, value, 0.0


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
def step(
    before, learnt, cn0_dbhz, due, elevation_rad, bands, nodes_rad, minimum_dbhz, margin_db, learn, drop_db, after_s,
    width_rad, dt_s, average_s, max_gap_s, after, channels, channels_failed, satellites, satellites_failed,
):  # fmt: skip
    """Averages against the table, and against what was learnt where that is higher.

    Parameters
    ----------
    before, after : (2, R, F, N) arrays
        Averages, and time since C/N0 was last there; `after` is filled in.
    learnt : (2, R, F, E) array
        Mean of each bin of elevation, and time learnt.
    cn0_dbhz : (R, N_BANDS, N) array
    due : (R, N) bool array
    elevation_rad : (N,) array
    bands : (F,) int array
    nodes_rad, minimum_dbhz : (K,) and (F, K) arrays
        The table.
    margin_db, drop_db, after_s, width_rad, dt_s, average_s, max_gap_s : float
    learn : bool
    channels : (2, R, F, N) array
        Filled in: minus C/N0 and minus its minimum.
    channels_failed : (R, F, N) bool array
        Filled in.
    satellites : (2, F, N) array
        Filled in: the same of the means over the receivers.
    satellites_failed : (F, N) bool array
        Filled in.
    """
    _, n_receivers, n_bands, n_sats = channels.shape
    mean_dbhz = channels[0]
    _average(before, cn0_dbhz, bands, dt_s, average_s, max_gap_s, after, mean_dbhz)
    taken = np.empty(n_receivers, dtype=np.bool_)
    for band in range(n_bands):
        for sat in range(n_sats):
            least = interpolated(elevation_rad[sat], nodes_rad, minimum_dbhz[band])
            total, count, expected = 0.0, 0, False
            for row in range(n_receivers):
                mean = mean_dbhz[row, band, sat]
                asked = due[row, sat] and (band == 0 or np.isfinite(cn0_dbhz[row, bands[band], sat]))
                taken[row] = asked and np.isfinite(mean)
                channels[0, row, band, sat], channels[1, row, band, sat] = -mean, -(least - margin_db)
                channels_failed[row, band, sat] = asked and not -mean <= -(least - margin_db)
                expected = expected or asked
                if taken[row]:
                    total += mean
                    count += 1
            if learn:
                place = elevation_bin(elevation_rad[sat], width_rad, learnt.shape[3])
                least = np.maximum(least, _learnt(learnt[0], learnt[1], taken, band, place, after_s) - drop_db)
            average = total / count if count > 0 else np.nan
            satellites[0, band, sat], satellites[1, band, sat] = -average, -least
            satellites_failed[band, sat] = expected and not -average <= -least


@compiled
def teach(
    learnt, cn0_dbhz, bands, due, channels_failed, satellites_failed, elevation_rad, dt_s, learn_s, width_rad, after
):
    """What is known after this epoch, into ``(2, R, F, E)``: a mean at first, an exponential one later.

    Taught by channels that are due and do not fail, nor their satellite.
    """
    _, n_receivers, n_bands, n_bins = learnt.shape
    after[:] = learnt
    known, known_s = after[0], after[1]
    total, number = np.empty(n_bins), np.empty(n_bins)
    for row in range(n_receivers):
        for band in range(n_bands):
            total[:] = 0.0
            number[:] = 0.0
            for sat in range(len(elevation_rad)):
                value = cn0_dbhz[row, bands[band], sat]
                fails = channels_failed[row, band, sat] or satellites_failed[band, sat]
                if due[row, sat] and np.isfinite(value) and not fails:
                    place = elevation_bin(elevation_rad[sat], width_rad, n_bins)
                    total[place] += value
                    number[place] += 1.0
            for place in range(n_bins):
                if number[place] > 0.0:
                    known_s[row, band, place] += dt_s
                    weight = max(dt_s / max(known_s[row, band, place], dt_s), dt_s / learn_s)
                    mean = total[place] / number[place]
                    known[row, band, place] += weight * (mean - known[row, band, place])


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
