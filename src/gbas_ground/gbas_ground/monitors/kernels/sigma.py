# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""B values over time; axes and sources as in :mod:`gbas_ground.monitors.sigma_monitor`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def normalise(b_m, sigma_m, used, normalised):
    """B values over their sigmas, into ``(T, R, N)``; NaN where there is none. A sigma is one of a receiver's
    correction over sqrt(M (M - 1)).
    """
    n_constants, n_receivers, n_sats = b_m.shape
    for sat in range(n_sats):
        count = 0
        for row in range(n_receivers):
            count += 1 if used[row, sat] else 0
        root = np.sqrt(1.0 * count * (count - 1)) if count >= 2 else np.nan
        for constant in range(n_constants):
            for row in range(n_receivers):
                value = b_m[constant, row, sat] / (sigma_m[constant, sat] / root)
                normalised[constant, row, sat] = value if used[row, sat] else np.nan


@compiled
def _sample(before, counted, normalised, dt_s, sample_s, forget_s, steady, after, counts):
    """Take the samples that are due: estimates ``(2, W, T, R, N)``, number and age of the last ``(2, R, N)``."""
    _, n_windows, n_constants, n_receivers, n_sats = before.shape
    after[:] = before
    for row in range(n_receivers):
        for sat in range(n_sats):
            since = counted[1, row, sat] + (dt_s if dt_s > 0.0 else 0.0)
            count = 0.0 if since > forget_s else counted[0, row, sat]
            taken = count == 0.0 or since >= sample_s
            for constant in range(n_constants):
                taken = taken and np.isfinite(normalised[constant, row, sat])
            counts[0, row, sat], counts[1, row, sat] = (count + 1.0, 0.0) if taken else (count, since)
            for window in range(n_windows if taken else 0):
                weight = max(1.0 / (count + 1.0), steady[window])
                for constant in range(n_constants):
                    value = normalised[constant, row, sat]
                    mean, square = before[0, window, constant, row, sat], before[1, window, constant, row, sat]
                    after[0, window, constant, row, sat] = mean + weight * (value - mean)
                    after[1, window, constant, row, sat] = square + weight * (value * value - square)


@compiled
def step(
    before, counted, normalised, due, dt_s, sample_s, forget_s, steady, full, numbers, limits, receiver_limits,
    after, counts, found, failed, pooled, pooled_failed,
):  # fmt: skip
    """Take samples of one epoch and test.

    Parameters
    ----------
    before, after : (2, W, T, R, N) arrays
        Means of the normalised B values, and of their squares; `after` is filled in.
    counted, counts : (2, R, N) arrays
        Samples taken, and time since the last one; `counts` is filled in.
    normalised : (T, R, N) array
    due : (R, N) bool array
    dt_s, sample_s, forget_s : float
    steady, full : (W,) arrays
        Weight of a sample, and number of samples, once a window is full.
    numbers, limits, receiver_limits : (G,), (2, W, T, G), (W, T, N + 1) arrays
        Thresholds from so many samples on, of mean and mean square; of those of a receiver by number of satellites.
    found : (2, 2, W, T, R, N) array
        Filled in: statistics and thresholds of both tests.
    failed : (2, W, T, R, N) bool array
        Filled in.
    pooled : (2, W, T, R) array
        Filled in: mean square over the satellites that have filled the window, NaN without one, and its threshold.
    pooled_failed : (W, T, R) bool array
        Filled in.
    """
    _, n_windows, n_constants, n_receivers, n_sats = before.shape
    _sample(before, counted, normalised, dt_s, sample_s, forget_s, steady, after, counts)
    place = np.empty(n_sats, dtype=np.int64)
    for row in range(n_receivers):
        for sat in range(n_sats):
            place[sat] = 0
            while place[sat] + 1 < len(numbers) and numbers[place[sat] + 1] <= counts[0, row, sat]:
                place[sat] += 1
        for window in range(n_windows):
            for constant in range(n_constants):
                at = window, constant, row
                total, number = 0.0, 0
                for sat in range(n_sats):
                    known = counts[0, row, sat] > 0.0
                    for each in range(2):
                        size = np.abs(after[each, window, constant, row, sat]) if known else np.nan
                        threshold = limits[each, window, constant, place[sat]]
                        found[0, each, window, constant, row, sat] = size
                        found[1, each, window, constant, row, sat] = threshold
                        failed[each, window, constant, row, sat] = due[row, sat] and not size <= threshold
                    if due[row, sat] and counts[0, row, sat] >= full[window]:
                        total += after[1, window, constant, row, sat]
                        number += 1
                mean = total / number if number > 0 else np.nan
                threshold = receiver_limits[window, constant, number]
                pooled[0, window, constant, row], pooled[1, window, constant, row] = mean, threshold
                pooled_failed[at] = number > 0 and not mean <= threshold
