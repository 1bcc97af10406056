# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Step, rate and acceleration of carriers; axes and source as in :mod:`gbas_ground.monitors.carrier_acceleration`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.median import median

_S = 3


@compiled
def fitted(s, m):
    """Least squares over the epochs of a channel, from the sums s_k of t^k and m_k of t^k y.

    The newest epoch, at t = 0 with y = 0, is part of s_0 alone.

    Parameters
    ----------
    s : 5 float
    m : 3 float

    Returns
    -------
    step, rate, acceleration : float
        Newest value against the line through those before it, slope, and c of ``a + b t + c t^2 / 2``.
    step_variance, rate_variance, acceleration_variance : float
        For a variance of one of y.
    """
    s0, s1, s2, s3, s4 = s
    m0, m1, m2 = m
    slope = s0 * s2 - s1 * s1
    line = slope - s2  # the same without the newest
    # Cramer's rule for the coefficient of t^2, half the acceleration; the minors are those of its column.
    minor0 = s1 * s3 - s2 * s2
    minor1 = s0 * s3 - s1 * s2
    parabola = minor0 * s2 - minor1 * s3 + slope * s4
    step = (s1 * m1 - s2 * m0) / line
    rate = (s0 * m1 - s1 * m0) / slope
    acceleration = 2.0 * (minor0 * m0 - minor1 * m1 + slope * m2) / parabola
    return step, rate, acceleration, 1.0 + s2 / line, s0 / slope, 4.0 * slope / parabola


@compiled
def limit(variance: float, common: float, natural: float, k: float) -> float:
    """Threshold of a statistic: k sigma, with what the receivers share, over what is natural."""
    return k * np.sqrt(variance + common * common) + natural


@compiled
def advanced(history_m, age_s, unseen_s, residual_m, restarted, shift_m, dt_s, window_s, max_gap_s):
    """The newest epoch in front of the others; what does not belong to it is forgotten.

    Returns
    -------
    history_m : (W, R, F, N) array
    age_s : (W,) array
    unseen_s : (R, F, N) array
    """
    n_epochs, n_receivers, n_bands, n_sats = history_m.shape
    goes_on = 0.0 < dt_s <= max_gap_s
    age, kept = np.full(n_epochs, np.nan), 1
    age[0] = 0.0
    while goes_on and kept < n_epochs and age_s[kept - 1] + dt_s <= window_s:
        age[kept] = age_s[kept - 1] + dt_s
        kept += 1
    history, unseen = np.full(history_m.shape, np.nan), np.empty(unseen_s.shape)
    lost = np.empty(n_sats, dtype=np.bool_)
    for row in range(n_receivers):
        for band in range(n_bands):
            for sat in range(n_sats):
                away = unseen_s[row, band, sat] + dt_s
                lost[sat] = (restarted[row, band, sat] or away > max_gap_s) and np.isfinite(away)
                unseen[row, band, sat] = 0.0 if np.isfinite(residual_m[row, band, sat]) else away
                history[0, row, band, sat] = residual_m[row, band, sat]
            for epoch in range(1, kept):
                for sat in range(n_sats):
                    before = history_m[epoch - 1, row, band, sat] + shift_m[row, sat]
                    history[epoch, row, band, sat] = np.nan if lost[sat] else before
    return history, age, unseen


@compiled
def _changes(history_m, row, band, age_s, change, there):
    """Changes since the newest epoch ``(W, N)``, zero where there are none, and where they are; epochs in use."""
    used = 0
    for epoch in range(len(age_s)):
        if not np.isfinite(age_s[epoch]):
            break
        used += 1
        for sat in range(change.shape[1]):
            value = history_m[epoch, row, band, sat] - history_m[0, row, band, sat]
            there[epoch, sat] = 1.0 if np.isfinite(value) else 0.0
            change[epoch, sat] = value if np.isfinite(value) else 0.0
    return used


@compiled
def _powers(values, age_s, used, sums):
    """Sums of t^k times the values, ``(K, N)``; times count back from the newest, at zero."""
    sums[:] = 0.0
    for epoch in range(used):
        power = 1.0
        for k in range(len(sums)):
            for sat in range(values.shape[1]):
                sums[k, sat] += power * values[epoch, sat]
            power *= -age_s[epoch]


@compiled
def _clock_free(change, there, used, share, free):
    """Changes less the mean of the others: with weights w_i in the clock, (phi_i - clock) / (1 - w_i)."""
    for epoch in range(used):
        clock = 0.0
        for sat in range(len(share)):
            clock += change[epoch, sat] * share[sat]
        for sat in range(len(share)):
            free[epoch, sat] = (change[epoch, sat] - clock) * there[epoch, sat] / (1.0 - share[sat])


@compiled
def _members(s, there, used, sigma_m, in_set):
    """The clock's set: satellites with every epoch that their receiver has on the band."""
    epochs = 0.0
    for epoch in range(used):
        for sat in range(len(sigma_m)):
            if there[epoch, sat] > 0.0:
                epochs += 1.0
                break
    for sat in range(len(sigma_m)):
        in_set[sat] = s[0, sat] == epochs and there[0, sat] > 0.0 and sigma_m[sat] > 0.0


@compiled
def _statistics(s, m, sigma_m, in_set, terms, k, least_points, min_satellites, statistic, variance, threshold):
    """Of the channels of one receiver and band ``(S, N)``; what has no variance has no statistic."""
    total, members = 0.0, 0
    for sat in range(len(sigma_m)):
        if in_set[sat]:
            total += 1.0 / (sigma_m[sat] * sigma_m[sat])
            members += 1
    statistic[:] = np.nan
    variance[:] = np.nan
    threshold[:] = np.nan
    for sat in range(len(sigma_m)):
        weight = 1.0 / (sigma_m[sat] * sigma_m[sat]) if in_set[sat] else 0.0
        others = members - 1 if in_set[sat] else members
        if s[0, sat] < least_points or others < min_satellites:
            continue
        own = sigma_m[sat] * sigma_m[sat] + 1.0 / (total - weight)
        found = fitted((s[0, sat], s[1, sat], s[2, sat], s[3, sat], s[4, sat]), (m[0, sat], m[1, sat], m[2, sat]))
        for each in range(_S):
            spread = found[_S + each] * own
            variance[each, sat] = spread
            statistic[each, sat] = np.nan if np.isnan(spread) else found[each]
            threshold[each, sat] = limit(spread, terms[0, each], terms[1, each], k)


@compiled
def _shares(in_set, sigma_m, share):
    """Weights of the set's satellites in the clock."""
    total = 0.0
    for sat in range(len(share)):
        share[sat] = 1.0 / (sigma_m[sat] * sigma_m[sat]) if in_set[sat] else 0.0
        total += share[sat]
    if total > 0.0:
        for sat in range(len(share)):
            share[sat] /= total


@compiled
def _apart(s, m, in_set, threshold, least_points):
    """Satellites of the set whose statistics, clock and all, are beyond the threshold from the set's median leave it.

    Returns whether any did.
    """
    n_sats = len(in_set)
    found = np.full((_S, n_sats), np.nan)
    for sat in range(n_sats):
        if in_set[sat] and s[0, sat] >= least_points:
            each = fitted((s[0, sat], s[1, sat], s[2, sat], s[3, sat], s[4, sat]), (m[0, sat], m[1, sat], m[2, sat]))
            if np.isfinite(each[0]) and np.isfinite(each[1]) and np.isfinite(each[2]):
                found[0, sat], found[1, sat], found[2, sat] = each[0], each[1], each[2]
    middle = (median(found[0]), median(found[1]), median(found[2]))
    left = False
    for sat in range(n_sats):
        for each in range(_S):
            if np.abs(found[each, sat] - middle[each]) > threshold[each, sat]:
                in_set[sat], left = False, True
    return left


@compiled
def _worst_leaves(in_set, ratio):
    """The satellites of the set that are furthest beyond their threshold leave it."""
    largest = 1.0
    for sat in range(len(in_set)):
        if in_set[sat] and ratio[sat] > largest:
            largest = ratio[sat]
    for sat in range(len(in_set)):
        if in_set[sat] and ratio[sat] > 1.0 and ratio[sat] == largest:
            in_set[sat] = False


@compiled
def _ratios(statistic, threshold, in_set, ratio):
    """Largest statistic of each satellite over its threshold, NaN where one is missing; whether one of a set fails."""
    fails = False
    for sat in range(len(in_set)):
        ratio[sat] = 0.0
        for each in range(_S):
            value = np.abs(statistic[each, sat]) / threshold[each, sat]
            if np.isnan(value) or value > ratio[sat]:
                ratio[sat] = value
            if np.isnan(value):
                break
        fails = fails or (in_set[sat] and ratio[sat] > 1.0)
    return fails


@compiled
def judged(history_m, age_s, sigmas_m, factor, terms, k, least_points, min_satellites):
    """Statistics, variances and thresholds with the receivers' clocks taken from satellites that do not fail.

    When one fails, all whose step, rate or acceleration is beyond the threshold from the receiver's median leave its
    clock's set: a minority does not move the median, and a healthy satellite must not be the first to fail through the
    mean. Then the worst satellite of each receiver and band leaves, and all is computed again, until nobody in a set
    fails: a bad satellite must not be seen on the others through the clock.

    Returns
    -------
    (3, R, F, S, N) array
        Statistic, variance, threshold.
    """
    n_epochs, n_receivers, n_bands, n_sats = history_m.shape
    known = np.empty((3, n_receivers, n_bands, _S, n_sats))
    in_set = np.zeros((n_receivers, n_bands, n_sats), dtype=np.bool_)
    change, there, free = np.zeros((n_epochs, n_sats)), np.zeros((n_epochs, n_sats)), np.empty((n_epochs, n_sats))
    s, m, share, ratio = np.empty((5, n_sats)), np.empty((3, n_sats)), np.empty(n_sats), np.empty(n_sats)
    turn = 0
    while True:
        fails = False
        for row in range(n_receivers):
            for band in range(n_bands):
                sigma_m = factor[row] * sigmas_m[band]
                used = _changes(history_m, row, band, age_s, change, there)
                _powers(there, age_s, used, s)
                if turn == 0:
                    _members(s, there, used, sigma_m, in_set[row, band])
                _shares(in_set[row, band], sigma_m, share)
                _clock_free(change, there, used, share, free)
                _powers(free, age_s, used, m)
                statistic, variance, threshold = known[0, row, band], known[1, row, band], known[2, row, band]
                members = in_set[row, band]
                _statistics(
                    s, m, sigma_m, members, terms, k, least_points, min_satellites, statistic, variance, threshold
                )
                fails |= _ratios(statistic, threshold, in_set[row, band], ratio)
        if not fails:
            return known
        turn += 1
        left = False
        for row in range(n_receivers if turn == 1 else 0):
            for band in range(n_bands):
                used = _changes(history_m, row, band, age_s, change, there)
                _powers(there, age_s, used, s)
                _powers(change, age_s, used, m)
                left |= _apart(s, m, in_set[row, band], known[2, row, band], least_points)
        for row in range(0 if left else n_receivers):
            for band in range(n_bands):
                _ratios(known[0, row, band], known[2, row, band], in_set[row, band], ratio)
                _worst_leaves(in_set[row, band], ratio)


@compiled
def _averaged(known, taken, band, sat, each):
    """Mean of a statistic over the receivers taken, and its variance; NaN without one."""
    total, spread, count = 0.0, 0.0, 0
    for row in range(known.shape[1]):
        if taken[row]:
            total += known[0, row, band, each, sat]
            spread += known[1, row, band, each, sat]
            count += 1
    if count == 0:
        return np.nan, 0.0
    return total / count, spread / (count * count)


@compiled
def _blamed(known, due, band, sat, beyond, there, wanted):
    """Which receivers' channels are beyond a threshold, have statistics, and are wanted; how many of each."""
    number, judging, expected = 0, 0, 0
    for row in range(known.shape[1]):
        has = np.isfinite(known[0, row, band, 0, sat])
        wanted[row] = due[row, sat] and (band == 0 or has)
        there[row], beyond[row] = has, False
        for each in range(_S):
            beyond[row] |= has and np.abs(known[0, row, band, each, sat]) > known[2, row, band, each, sat]
        expected += 1 if wanted[row] else 0
    for row in range(known.shape[1]):
        # channels that are not due judge no satellite that others are due for; alone, they show how it would do
        there[row] = there[row] and (wanted[row] or expected == 0)
        beyond[row] = beyond[row] and there[row]
        number += 1 if beyond[row] else 0
        judging += 1 if there[row] else 0
    return number, judging, expected


@compiled
def concluded(known, due, terms, k):
    """Who is to blame: one channel of three or more that fails alone, or the satellite.

    Parameters
    ----------
    known : (3, R, F, S, N) array
        From :func:`judged`.
    due : (R, N) bool array
    terms : (2, S) array
        What the receivers share, and what is natural.
    k : float

    Returns
    -------
    channels : (2, S, R, F, N) array
        Sizes and thresholds.
    channels_failed : (S, R, F, N) bool array
    satellites : (2, S, F, N) array
        Sizes of the means over the receivers, and thresholds.
    satellites_failed : (S, F, N) bool array
    failed_channels : (R, N) bool array
    failed_satellites : (N,) bool array
    """
    _, n_receivers, n_bands, _, n_sats = known.shape
    channels = np.empty((2, _S, n_receivers, n_bands, n_sats))
    channels_failed = np.empty((_S, n_receivers, n_bands, n_sats), dtype=np.bool_)
    satellites = np.empty((2, _S, n_bands, n_sats))
    satellites_failed = np.empty((_S, n_bands, n_sats), dtype=np.bool_)
    failed_channels = np.zeros((n_receivers, n_sats), dtype=np.bool_)
    failed_satellites = np.zeros(n_sats, dtype=np.bool_)
    masks = np.empty((3, n_receivers), dtype=np.bool_)
    beyond, there, wanted = masks[0], masks[1], masks[2]
    for band in range(n_bands):
        for sat in range(n_sats):
            number, judging, expected = _blamed(known, due, band, sat, beyond, there, wanted)
            alone = number == 1 and judging >= 3
            for row in range(n_receivers):
                for each in range(_S):
                    size, threshold = np.abs(known[0, row, band, each, sat]), known[2, row, band, each, sat]
                    channels[0, each, row, band, sat], channels[1, each, row, band, sat] = size, threshold
                    channels_failed[each, row, band, sat] = wanted[row] and not size <= threshold
                lonely = beyond[row] and alone
                failed_channels[row, sat] |= wanted[row] and (lonely or not there[row])
                there[row] = there[row] and not lonely
            for each in range(_S):
                mean, spread = _averaged(known, there, band, sat, each)
                threshold = limit(spread, terms[0, each], terms[1, each], k)
                failed = expected > 0 and (not np.abs(mean) <= threshold or (number >= 1 and not alone))
                satellites[0, each, band, sat], satellites[1, each, band, sat] = np.abs(mean), threshold
                satellites_failed[each, band, sat] = failed
                failed_satellites[sat] |= failed
    return channels, channels_failed, satellites, satellites_failed, failed_channels, failed_satellites
