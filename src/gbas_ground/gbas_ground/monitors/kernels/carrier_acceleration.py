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
def limit(variance, common, natural, k):
    """Threshold of a statistic: k sigma, with what the receivers share, over what is natural."""
    return k * np.sqrt(variance + common * common) + natural


@compiled
def _advance(before, residual_m, restarted, shift_m, dt_s, window_s, max_gap_s, after):
    """The newest epoch in front of the others; what does not belong to it is forgotten.

    ``before`` and ``after``: carriers (W, R, F, N), ages (W,), times since each was last there (R, F, N).
    """
    history_m, age_s, unseen_s = before
    history, age, unseen = after
    n_epochs, n_receivers, n_bands, n_sats = history_m.shape
    goes_on = 0.0 < dt_s <= max_gap_s
    age[:] = np.nan
    age[0], kept = 0.0, 1
    while goes_on and kept < n_epochs and age_s[kept - 1] + dt_s <= window_s:
        age[kept] = age_s[kept - 1] + dt_s
        kept += 1
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
                    earlier = history_m[epoch - 1, row, band, sat] + shift_m[row, sat]
                    history[epoch, row, band, sat] = np.nan if lost[sat] else earlier
    history[kept:] = np.nan


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
def _judge(history_m, age_s, sigmas_m, factor, terms, k, least_points, min_satellites, known):
    """Statistics, variances and thresholds with the receivers' clocks taken from satellites that do not fail.

    When one fails, all whose step, rate or acceleration is beyond the threshold from the receiver's median leave its
    clock's set: a minority does not move the median, and a healthy satellite must not be the first to fail through the
    mean. Then the worst satellite of each receiver and band leaves, and all is computed again, until nobody in a set
    fails: a bad satellite must not be seen on the others through the clock.

    ``known`` (3, R, F, S, N): statistic, variance, threshold.
    """
    n_epochs, n_receivers, n_bands, n_sats = history_m.shape
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
            return
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
def _count(known, due, band, beyond, there, wanted, number):
    """Channels of a band that are beyond a threshold, that judge, and that are wanted ``(R, N)``; how many ``(3, N)``.

    Channels that are not due judge no satellite that others are due for; alone, they show how it would do.
    """
    n_receivers, n_sats = due.shape
    number[:] = 0
    for row in range(n_receivers):
        statistic, threshold = known[0, row, band], known[2, row, band]
        for sat in range(n_sats):
            has = np.isfinite(statistic[0, sat])
            wanted[row, sat], there[row, sat], beyond[row, sat] = due[row, sat] and (band == 0 or has), has, False
            for each in range(_S):
                beyond[row, sat] |= has and np.abs(statistic[each, sat]) > threshold[each, sat]
            number[2, sat] += 1 if wanted[row, sat] else 0
    for row in range(n_receivers):
        for sat in range(n_sats):
            there[row, sat] &= wanted[row, sat] or number[2, sat] == 0
            beyond[row, sat] &= there[row, sat]
            number[0, sat] += 1 if beyond[row, sat] else 0
            number[1, sat] += 1 if there[row, sat] else 0


@compiled
def _conclude(known, due, terms, k, satellites, failed, failed_channels, failed_satellites):
    """Who is to blame: one channel of three or more that fails alone, or the satellite.

    ``satellites`` (2, S, F, N): sizes of the means over the receivers and thresholds; ``failed`` (S, F, N),
    ``failed_channels`` (R, N), ``failed_satellites`` (N,).
    """
    _, n_receivers, n_bands, _, n_sats = known.shape
    masks, number = np.empty((3, n_receivers, n_sats), dtype=np.bool_), np.empty((3, n_sats), dtype=np.int64)
    beyond, there, wanted = masks[0], masks[1], masks[2]
    failed_channels[:] = False
    failed_satellites[:] = False
    for band in range(n_bands):
        _count(known, due, band, beyond, there, wanted, number)
        for row in range(n_receivers):
            for sat in range(n_sats):
                lonely = beyond[row, sat] and number[0, sat] == 1 and number[1, sat] >= 3
                failed_channels[row, sat] |= wanted[row, sat] and (lonely or not there[row, sat])
                there[row, sat] &= not lonely
        for each in range(_S):
            for sat in range(n_sats):
                total, spread, count = 0.0, 0.0, 0
                for row in range(n_receivers):
                    if there[row, sat]:
                        total += known[0, row, band, each, sat]
                        spread += known[1, row, band, each, sat]
                        count += 1
                size = np.abs(total / count) if count > 0 else np.nan
                threshold = limit(spread / max(count * count, 1), terms[0, each], terms[1, each], k)
                alone = number[0, sat] == 1 and number[1, sat] >= 3
                fails = number[2, sat] > 0 and (not size <= threshold or (number[0, sat] > 0 and not alone))
                satellites[0, each, band, sat], satellites[1, each, band, sat] = size, threshold
                failed[each, band, sat] = fails
                failed_satellites[sat] |= fails


@compiled
def step(
    before, residual_m, restarted, due, sigmas_m, factor, shift_m, terms, dt_s, window_s, max_gap_s, k, least_points,
    min_satellites, after, known, satellites, failed, failed_channels, failed_satellites,
):  # fmt: skip
    """One epoch.

    Parameters
    ----------
    before, after : tuple of arrays
        Carriers (W, R, F, N), ages (W,), times since each was last there (R, F, N); `after` is filled in.
    residual_m, restarted : (R, F, N) arrays
    due : (R, N) bool array
    sigmas_m : (F, N) array
        Of a receiver of factor 1 [m].
    factor : (R,) array
    shift_m : (R, N) array
    terms : (2, S) array
        What the receivers share, and what is natural.
    dt_s, window_s, max_gap_s, k : float
    least_points, min_satellites : int
    known : (3, R, F, S, N) array
        Filled in: statistics of the channels, their variances and thresholds.
    satellites : (2, S, F, N) array
        Filled in: sizes of the means over the receivers, and thresholds.
    failed, failed_channels, failed_satellites : (S, F, N), (R, N), (N,) bool arrays
        Filled in.
    """
    _advance(before, residual_m, restarted, shift_m, dt_s, window_s, max_gap_s, after)
    _judge(after[0], after[1], sigmas_m, factor, terms, k, least_points, min_satellites, known)
    _conclude(known, due, terms, k, satellites, failed, failed_channels, failed_satellites)
