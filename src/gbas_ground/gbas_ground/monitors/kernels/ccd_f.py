# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Divergence on two frequencies; axes and source as in :mod:`gbas_ground.monitors.ccd_f`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_ground.monitors.kernels.divergence_filter import (
    AGE,
    F1,
    F2,
    N_MEMORY,
    SINCE,
    VALUE,
    filter_rate,
    filter_value,
)
from gbas_ground.monitors.kernels.double_difference import obliquity
from gbas_ground.monitors.kernels.interpolation import interpolated


@compiled
def divergence_free_cmc(code_m, carrier_m, other_m, gain):
    """Code minus divergence-free carrier, ``rho - (phi + 2 / (gamma - 1) (phi - phi_other))``; eq (8) and (9)."""
    return code_m - (carrier_m + gain * (carrier_m - other_m))


@compiled
def ionosphere_free(value_m, other_m, near, far):
    """Combination without ionosphere, ``gamma / (gamma - 1) phi - 1 / (gamma - 1) phi_other``; eq (10), (11)."""
    return near * value_m + far * other_m


@compiled
def _compensate(carrier_m, range_m, clock_s, elevation_rad, zenith_delay_m, bands, near, far, residual):
    """IF carriers less geometry, satellite clock and troposphere, ``(R, N)`` [m]."""
    for sat in range(len(elevation_rad)):
        troposphere = zenith_delay_m * obliquity(np.sin(elevation_rad[sat]))
        for row in range(len(range_m)):
            free = ionosphere_free(carrier_m[row, bands[0], sat], carrier_m[row, bands[1], sat], near, far)
            residual[row, sat] = free - range_m[row, sat] + SPEED_OF_LIGHT_MPS * clock_s[row, sat] - troposphere


@compiled
def _mean_of_all(change_m, since_s, clock_used):
    """Mean change of one receiver's satellites that were measured at the last epoch, too; NaN without any.

    What they have in common is the clock of this one interval.
    """
    total, count = 0.0, 0
    for sat in range(len(change_m)):
        if np.isfinite(change_m[sat]) and since_s[sat] == 0.0 and clock_used[sat]:
            total += change_m[sat]
            count += 1
    return total / count if count > 0 else np.nan


@compiled
def _filter_codes(filters, new, rates, code_m, carrier_m, lost, bands, gains, dt_s, tau_s, max_gap_s):
    """DF of both bands of one receiver: ``filters``, ``new`` (3, 5, N), ``rates`` (3, N)."""
    for each in range(2):
        own, other = bands[each], bands[1 - each]
        for sat in range(len(lost)):
            free = divergence_free_cmc(code_m[own, sat], carrier_m[own, sat], carrier_m[other, sat], gains[each])
            memory = filters[each, :, sat]
            made = filter_value(
                memory[VALUE], memory[F1], memory[F2], memory[SINCE], memory[AGE],
                free, lost[sat], dt_s, tau_s, max_gap_s,
            )  # fmt: skip
            for place in range(N_MEMORY):
                new[each, place, sat] = made[place]
            rates[each, sat] = made[N_MEMORY + 1]


@compiled
def _filter_carrier(memory, new, rate_mps, change_m, clock_m, away_s, coasting, lost, dt_s, tau_s, max_gap_s):
    """The IF carrier of one receiver: ``memory``, ``new`` (5, N), ``rate_mps`` (N,)."""
    for sat in range(len(lost)):
        # The one epoch at which the expected range jumps tells nothing: the filter goes on with the rate it has.
        rate = memory[F1, sat] if coasting[sat] else (change_m[sat] - clock_m[sat]) / away_s[sat]
        made = filter_rate(
            memory[F1, sat], memory[F2, sat], memory[SINCE, sat], memory[AGE, sat],
            rate, away_s[sat], lost[sat], dt_s, tau_s, max_gap_s,
        )  # fmt: skip
        new[F1, sat], new[F2, sat], new[SINCE, sat], new[AGE, sat], rate_mps[sat] = made


@compiled
def advanced(
    filters, carriers, was_rebased, code_m, carrier_m, restarted, range_m, clock_s, rebased, elevation_rad, clock_used,
    bands, weights, dt_s, tau_s, max_gap_s, settle_s, zenith_delay_m, new, after, rates, settled,
):  # fmt: skip
    """Filter the rates of both DF and of the IF carrier, that less the mean of all.

    Parameters
    ----------
    filters, new : (3, 5, R, N) arrays
        Memory of DF, DF of the other band and IF carrier; `new` is filled in.
    carriers, after : (3, R, N) arrays
        Last IF carrier without geometry, mean of all accumulated since, and time since; `after` is filled in.
    was_rebased : (N,) bool array
    code_m, carrier_m, restarted : (R, N_BANDS, N) arrays
    range_m, clock_s : (R, N) arrays
    rebased : (N,) bool array
    elevation_rad : (N,) array
    clock_used : (R, N) bool array
    bands : (2,) int array
    weights : (4,) array
        Gains of both DF, and coefficients of the IF combination.
    dt_s, tau_s, max_gap_s, settle_s, zenith_delay_m : float

    rates : (3, R, N) array
        Filled in: filtered [m/s].
    settled : (R, N) bool array
        Filled in: where all three count.
    """
    n_receivers, n_sats = range_m.shape
    residual_m, clock_m, since_s = carriers[0], carriers[1], carriers[2]
    residual, clock, since = after[0], after[1], after[2]
    _compensate(carrier_m, range_m, clock_s, elevation_rad, zenith_delay_m, bands, weights[2], weights[3], residual)
    lost, coasting, present = np.empty(n_sats, np.bool_), np.empty(n_sats, np.bool_), np.empty(n_sats, np.bool_)
    change = np.empty(n_sats)
    for row in range(n_receivers):
        for sat in range(n_sats):
            lost[sat] = restarted[row, bands[0], sat] or restarted[row, bands[1], sat]
            since[row, sat] = since_s[row, sat] + (dt_s if dt_s > 0.0 else np.inf)
            goes_on = np.isfinite(residual_m[row, sat]) and not lost[sat] and since[row, sat] <= max_gap_s
            present[sat], step = np.isfinite(residual[row, sat]), rebased[sat]
            change[sat] = residual[row, sat] - residual_m[row, sat] if goes_on and not step else np.nan
            coasting[sat] = step and not was_rebased[sat] and goes_on and present[sat]
            if not present[sat]:
                residual[row, sat] = residual_m[row, sat] if goes_on else np.nan
        mean = _mean_of_all(change, since_s[row], clock_used[row])
        for sat in range(n_sats):
            clock[row, sat] = clock_m[row, sat] + mean
        _filter_carrier(
            filters[2, :, row], new[2, :, row], rates[2, row], change, clock[row], since[row], coasting, lost,
            dt_s, tau_s, max_gap_s,
        )  # fmt: skip
        _filter_codes(
            filters[:, :, row], new[:, :, row], rates[:, row], code_m[row], carrier_m[row], lost, bands, weights,
            dt_s, tau_s, max_gap_s,
        )  # fmt: skip
        for sat in range(n_sats):
            settled[row, sat] = True
            for each in range(3):
                settled[row, sat] &= new[each, AGE, row, sat] >= settle_s and new[each, SINCE, row, sat] == 0.0
            if present[sat]:
                clock[row, sat], since[row, sat] = 0.0, 0.0


@compiled
def covariance_at(elevation_rad, receivers, clock_satellites, own, common, nodes, factor, covariance):
    """Covariance of the mean of three statistics, into ``(3, 3)``: ``s s^T (common + own / M)``, carrier ``1 + 1/n``.

    ``own``, ``common`` (3, 3); ``nodes`` (K,) and ``factor`` (K, 3) are the factors s by elevation, none: one.
    """
    for i in range(3):
        for j in range(3):
            covariance[i, j] = own[i, j] / np.maximum(receivers, 1.0) + common[i, j]
    for each in range(3):
        scale = 1.0 if np.isfinite(elevation_rad) else np.nan
        if len(nodes) > 0:
            scale *= interpolated(elevation_rad, nodes, factor[:, each])
        covariance[each, :] *= scale
        covariance[:, each] *= scale
    covariance[2, 2] *= 1.0 + 1.0 / np.maximum(clock_satellites, 1.0)


@compiled
def covariances(elevation_rad, receivers, clock_satellites, own, common, nodes, factor):
    """The same for many satellites, ``(N, 3, 3)``."""
    covariance = np.empty((len(elevation_rad), 3, 3))
    for sat in range(len(elevation_rad)):
        covariance_at(
            elevation_rad[sat], receivers[sat], clock_satellites[sat], own, common, nodes, factor, covariance[sat]
        )
    return covariance


@compiled
def chi_square(x, covariance):
    """``x^T Q^-1 x`` of three statistics; NaN where one of them or of Q is not finite.

    By the Cholesky factors of Q: the sum of the squares of the whitened statistics.
    """
    for i in range(3):
        if not np.isfinite(x[i]):
            return np.nan
        for j in range(3):
            if not np.isfinite(covariance[i, j]):
                return np.nan
    a = np.sqrt(covariance[0, 0])
    b, c = covariance[1, 0] / a, covariance[2, 0] / a
    d = np.sqrt(covariance[1, 1] - b * b)
    e = (covariance[2, 1] - c * b) / d
    f = np.sqrt(covariance[2, 2] - c * c - e * e)
    first = x[0] / a
    second = (x[1] - b * first) / d
    third = (x[2] - c * first - e * second) / f
    return first * first + second * second + third * third


@compiled
def chi_squares(x, covariance):
    """The same for ``(3, N)`` and ``(N, 3, 3)``."""
    found = np.empty(x.shape[1])
    for sat in range(x.shape[1]):
        found[sat] = chi_square(x[:, sat], covariance[sat])
    return found


@compiled
def published(x, receivers, inverse):
    """The paper's test metric, ``M x^T pinv(Q) x`` of its four statistics; eq (15) and (18)."""
    total = 0.0
    for i in range(4):
        for j in range(4):
            total += x[i] * inverse[i, j] * x[j]
    return receivers * total


@compiled
def _others_mean(rate, member, groups, fewest, clock, others):
    """Mean over the other members of each satellite's group and their number; NaN below the fewest; eq (13)."""
    for group in range(len(groups)):
        total, count = 0.0, 0
        for sat in range(len(rate)):
            if groups[group, sat] and member[sat]:
                total += rate[sat]
                count += 1
        for sat in range(len(rate)):
            if groups[group, sat]:
                others[sat] = count - 1.0 if member[sat] else 1.0 * count
                own = rate[sat] if member[sat] else 0.0
                clock[sat] = (total - own) / max(others[sat], 1.0) if others[sat] >= fewest else np.nan


@compiled
def _clocks(rate, settled, clock_used, suspect, groups, everyone, fewest, clock, others):
    """Receiver clocks of each satellite and how many others they are of, ``(R, N)``, without those suspected.

    Where that leaves too few of a constellation, the clock is that of `everyone`.
    """
    n_receivers, n_sats = rate.shape
    member, of_all, all_others = np.empty(n_sats, np.bool_), np.empty(n_sats), np.empty(n_sats)
    any_suspect = suspect.any()
    for row in range(n_receivers):
        for sat in range(n_sats):
            member[sat] = settled[row, sat] and clock_used[row, sat] and not suspect[sat]
        _others_mean(rate[row], member, groups, fewest, clock[row], others[row])
        if any_suspect:
            _others_mean(rate[row], member, everyone, fewest, of_all, all_others)
            for sat in range(n_sats):
                if others[row, sat] < fewest:
                    clock[row, sat], others[row, sat] = of_all[sat], all_others[sat]


@compiled
def judge(
    rates, settled, used, clock_used, suspect, groups, everyone, fewest, elevation_rad, own, common, nodes, factor,
    inverse, weights, limits, receiver, counts, found, covariance, failed,
):  # fmt: skip
    """Means over the receivers, with clocks that do without those suspected, and both forms of the test.

    Parameters
    ----------
    rates : (3, R, N) array
        From :func:`advanced`.
    settled, used, clock_used : (R, N) bool arrays
    suspect : (N,) bool array
    groups, everyone : (k, N) and (1, N) bool arrays
    fewest : int
        Others a clock is averaged from.
    elevation_rad : (N,) array
    own, common, nodes, factor : arrays
        As of :func:`covariance_at`.
    inverse : (4, 4) array
        Of the published covariance; not a number where that form does not apply.
    weights : (4,) array
        As of :func:`advanced`.
    limits : (2, N) array
        Thresholds of the published form and of that of full rank.
    receiver : (3, R, N) array
        Filled in: rates, that of the carrier without the clock.
    counts : (R, N) bool array
        Filled in: where all three are.
    found : (8, N) array
        Filled in: four means, receivers, fewest satellites behind their clocks, and the statistics of both forms.
    covariance : (N, 3, 3) array
    failed : (2, N) bool array
    """
    n_receivers, n_sats = settled.shape
    clock, others, x = np.empty(settled.shape), np.empty(settled.shape), np.empty(3)
    _clocks(rates[2], settled, clock_used, suspect, groups, everyone, fewest, clock, others)
    for row in range(n_receivers):
        for sat in range(n_sats):
            receiver[0, row, sat], receiver[1, row, sat] = rates[0, row, sat], rates[1, row, sat]
            receiver[2, row, sat] = rates[2, row, sat] - clock[row, sat]
            counts[row, sat] = settled[row, sat] and np.isfinite(clock[row, sat])
    found[:] = np.nan
    failed[:] = False
    for sat in range(n_sats):
        x[:] = 0.0
        number, least = 0.0, np.inf
        for row in range(n_receivers):
            if counts[row, sat] and used[row, sat]:
                number += 1.0
                least = min(least, others[row, sat])
                for each in range(3):
                    x[each] += receiver[each, row, sat]
        found[4, sat] = number
        covariance_at(elevation_rad[sat], number, least, own, common, nodes, factor, covariance[sat])
        if number == 0.0:
            continue
        for each in range(3):
            x[each] /= number
        found[0, sat], found[1, sat], found[3, sat], found[5, sat] = x[0], x[1], x[2], least
        found[2, sat] = ionosphere_free(x[0], x[1], weights[2], weights[3])
        found[7, sat] = chi_square(x, covariance[sat])
        failed[1, sat] = not found[7, sat] <= limits[1, sat]
        if np.isfinite(inverse[0, 0]):
            found[6, sat] = published(found[:4, sat], number, inverse)
            failed[0, sat] = not found[6, sat] <= limits[0, sat]
