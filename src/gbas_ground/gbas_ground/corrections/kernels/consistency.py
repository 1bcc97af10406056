"""Corrections of one epoch, and what the monitors of corrections say of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.models.error_models import sigma_pr_gnd_of
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_ground.corrections.kernels import formation as form
from gbas_ground.corrections.kernels.limits import b_limit_m, unused_limit_m


class Settings(NamedTuple):
    """What corrections are formed and judged with; see the sections of a station's file.

    Attributes
    ----------
    constellation : (N,) int array
    curves : (2, 4) array
        Coefficients of the ground accuracy designator.
    """

    constellation: IntArray
    curves: FloatArray
    n_constellations: int
    min_common: int
    min_receivers: int
    plain: bool
    mask_rad: float
    inflation: float
    inflation_iono: float
    factor_30s: float
    k_b: float
    max_prc_m: float
    max_rrc_mps: float
    readmission_share: float


@compiled
def broadcast_sigmas_m(
    elevation_rad: FloatArray, count: FloatArray, measured_m: FloatArray, settings: Settings
) -> FloatArray:
    """Sigmas ``(3, N)`` in the order of :class:`~gbas_ground.corrections.sigma.Sigmas`.

    `measured_m` has no row: the designator's; one: a receiver's own of the 100 s correction; four: own and shared of
    each smoothing constant, which no inflation for anomalous ionosphere is put on here.
    """
    sigmas = np.full((3, len(count)), np.nan)
    for i in range(len(count)):
        base_30 = math.nan
        if len(measured_m) == 0:
            base = sigma_pr_gnd_of(settings.curves, elevation_rad[i], count[i], settings.mask_rad)
        elif not (count[i] > 0.0 and elevation_rad[i] >= settings.mask_rad):
            continue
        elif len(measured_m) == 1:
            base = measured_m[0, i] / math.sqrt(count[i])
        else:
            base = math.sqrt(measured_m[0, i] ** 2 / count[i] + measured_m[1, i] ** 2)
            base_30 = math.sqrt(measured_m[2, i] ** 2 / count[i] + measured_m[3, i] ** 2)
        gnd_d = settings.inflation * base
        sigmas[1, i] = gnd_d
        if len(measured_m) <= 1:
            sigmas[0, i] = settings.inflation_iono * gnd_d
            sigmas[2, i] = settings.factor_30s * gnd_d
        else:
            sigmas[0, i] = gnd_d
            sigmas[2, i] = settings.inflation * base_30
    return sigmas


@compiled
def usable_channels(
    ready: BoolArray, judged: BoolArray, channel_cause: IntArray, receiver_cause: IntArray
) -> BoolArray:
    """Channels ``(R, N)`` that are ready, of satellites that were judged, and that nothing excludes."""
    usable = np.zeros(ready.shape, dtype=np.bool_)
    for m in range(ready.shape[0]):
        for i in range(ready.shape[1]):
            usable[m, i] = ready[m, i] and judged[i] and channel_cause[m, i] == 0 and receiver_cause[m] == 0
    return usable


@compiled
def form_corrections(
    correction_m: FloatArray,
    previous_m: FloatArray,
    dt_s: float,
    usable: BoolArray,
    satellite_cause: IntArray,
    elevation_rad: FloatArray,
    measured_m: FloatArray,
    settings: Settings,
) -> tuple[
    BoolArray, BoolArray, FloatArray, BoolArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]:
    """Corrections from channels that are usable; the clocks from satellites that are not excluded.

    Returns
    -------
    in_use, common, weights, used, count, prc_m, rrc_mps, b_m, sigmas_m, channel_sigma_m
        As in :class:`gbas_ground.consistency.Corrections`.
    """
    n_tau, n_receivers, n_sats = correction_m.shape
    constellation = settings.constellation
    in_use, common = form.common_satellites(
        usable & (satellite_cause == 0), constellation, settings.n_constellations, settings.min_common,
        settings.min_receivers,
    )  # fmt: skip
    weights = form.clock_weights(common, elevation_rad, settings.plain)
    adjusted = np.empty(correction_m.shape)
    for t in range(n_tau):
        adjusted[t] = form.remove_clocks(correction_m[t], weights, constellation)
    used, count = np.zeros(usable.shape, dtype=np.bool_), np.zeros(n_sats)
    for m in range(n_receivers):
        for i in range(n_sats):
            used[m, i] = usable[m, i] and in_use[constellation[i], m] and all_finite(adjusted, m, i)
            count[i] += used[m, i]
    prc_m, rrc_mps, b_m = np.empty((n_tau, n_sats)), np.empty((n_tau, n_sats)), np.empty(correction_m.shape)
    sigmas_m = broadcast_sigmas_m(elevation_rad, count, measured_m, settings)
    channel_sigma_m = np.empty((n_tau, n_sats))
    both, of_rate = rate_channels(correction_m, previous_m, used, weights, elevation_rad, settings)
    for t in range(n_tau):
        prc_m[t] = form.average_m(adjusted[t], used)
        b_m[t] = form.b_values_m(adjusted[t], used)
        rrc_mps[t] = form.rate_mps(correction_m[t], previous_m[t], dt_s, of_rate, both, constellation)
        channel_sigma_m[t] = form.clock_removed_sigma_m(sigmas_m[1 + t] * np.sqrt(count), weights, constellation)
    return in_use, common, weights, used, count, prc_m, rrc_mps, b_m, sigmas_m, channel_sigma_m


@compiled
def all_finite(values: FloatArray, m: int, i: int) -> bool:
    """Whether a channel has a value with every smoothing constant."""
    for t in range(len(values)):
        if not math.isfinite(values[t, m, i]):
            return False
    return True


@compiled
def rate_channels(
    correction_m: FloatArray,
    previous_m: FloatArray,
    used: BoolArray,
    weights: FloatArray,
    elevation_rad: FloatArray,
    settings: Settings,
) -> tuple[BoolArray, FloatArray]:
    """Channels ``(R, N)`` for the rates, those that were there at the epoch before too, and their clock weights."""
    both, of_clock = np.zeros(used.shape, dtype=np.bool_), np.zeros(used.shape, dtype=np.bool_)
    alike = True
    for m in range(used.shape[0]):
        for i in range(used.shape[1]):
            both[m, i] = used[m, i] and all_finite(previous_m, m, i)
            of_clock[m, i] = both[m, i] and weights[settings.constellation[i], i] > 0.0
            alike = alike and both[m, i] == used[m, i]
    if alike:
        return both, weights
    constellation = settings.constellation
    _, common = form.common_satellites(of_clock, constellation, settings.n_constellations, settings.min_common, 1)
    weights = form.clock_weights(common, elevation_rad, settings.plain)
    for m in range(used.shape[0]):
        for k in range(settings.n_constellations):
            there = True
            for t in range(len(correction_m)):
                there = there and math.isfinite(form.receiver_clock_m(correction_m[t, m], weights[k]))
            for i in range(used.shape[1]):
                if constellation[i] == k and not there:
                    both[m, i] = False
    return both, weights


@compiled
def summarise_corrections(
    used: BoolArray,
    count: FloatArray,
    prc_m: FloatArray,
    rrc_mps: FloatArray,
    b_m: FloatArray,
    sigma_m: FloatArray,
    settings: Settings,
) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, int]:
    """What the monitors of corrections say: B values, PRC and RRC.

    Returns
    -------
    statistic, threshold : (3, N) arrays
        Of the comparison that is furthest over its threshold, or nearest to it.
    failed, due : (3, N) bool arrays
    n_failed : int
        Satellites and tests that fail.
    """
    n_sats = len(count)
    statistic, threshold = np.full((3, n_sats), np.nan), np.full((3, n_sats), np.nan)
    failed, due = np.zeros((3, n_sats), dtype=np.bool_), np.zeros((3, n_sats), dtype=np.bool_)
    for i in range(n_sats):
        due[1, i] = due[2, i] = count[i] > 0.0
        for t in range(len(rrc_mps)):
            due[2, i] = due[2, i] and math.isfinite(rrc_mps[t, i])
    n_failed = compare_b_values(used, count, b_m, sigma_m, settings.k_b, statistic[0], threshold[0], failed[0], due[0])
    n_failed += compare_sizes(prc_m, settings.max_prc_m, statistic[1], threshold[1], failed[1], due[1])
    n_failed += compare_sizes(rrc_mps, settings.max_rrc_mps, statistic[2], threshold[2], failed[2], due[2])
    return statistic, threshold, failed, due, n_failed


@compiled
def excess_of(value: float, limit: float) -> float:
    """How far a value is over its limit, as a part of it; minus infinity where either is missing."""
    excess = (value - limit) / abs(limit)
    return -math.inf if math.isnan(excess) else excess


@compiled
def compare_b_values(
    used: BoolArray,
    count: FloatArray,
    b_m: FloatArray,
    sigma_m: FloatArray,
    k_b: float,
    statistic: FloatArray,
    threshold: FloatArray,
    failed: BoolArray,
    due: BoolArray,
) -> int:
    """Fill in the worst B value of each satellite; one fails above its limit, and where either is missing."""
    n_failed = 0
    for i in range(len(count)):
        worst = -math.inf
        for t in range(b_m.shape[0]):
            limit = b_limit_m(sigma_m[t, i], count[i], k_b)
            for m in range(b_m.shape[1]):
                value, applies = abs(b_m[t, m, i]), used[m, i] and count[i] >= 2.0
                due[i] = due[i] or applies
                failed[i] = failed[i] or (applies and not value <= limit)
                if excess_of(value, limit) > worst or t == m == 0:
                    worst, statistic[i], threshold[i] = excess_of(value, limit), value, limit
        n_failed += failed[i]
    return n_failed


@compiled
def compare_sizes(
    values: FloatArray,
    limit: float,
    statistic: FloatArray,
    threshold: FloatArray,
    failed: BoolArray,
    due: BoolArray,
) -> int:
    """Fill in the largest of each satellite's ``(tau, N)`` values; one that is due fails above its limit or missing."""
    n_failed = 0
    for i in range(len(due)):
        worst, threshold[i] = -math.inf, limit
        for t in range(len(values)):
            value = abs(values[t, i])
            failed[i] = failed[i] or (due[i] and not value <= limit)
            if excess_of(value, limit) > worst or t == 0:
                worst, statistic[i] = excess_of(value, limit), value
        n_failed += failed[i]
    return n_failed


@compiled
def over_limit(value: float, limit: float) -> float:
    """Value over its limit where it fails, else 0; a missing one is infinitely bad."""
    if value <= limit:
        return 0.0
    ratio = value / limit
    return math.inf if math.isnan(ratio) else ratio


@compiled
def worst_b_value(
    used: BoolArray,
    count: FloatArray,
    b_m: FloatArray,
    sigma_m: FloatArray,
    satellite_cause: IntArray,
    settings: Settings,
) -> tuple[int, int, float, float]:
    """The B value furthest over its threshold: receiver, satellite, size and threshold [m]; -1 where none fails.

    Two receivers do not tell which is wrong: then it is the satellite, once.
    """
    worst, found = 0.0, (-1, -1, math.nan, math.nan)
    for t in range(len(b_m)):
        for m in range(b_m.shape[1]):
            for i in range(b_m.shape[2]):
                if used[m, i] and count[i] >= 2.0 and (count[i] >= 3.0 or satellite_cause[i] == 0):
                    limit = b_limit_m(sigma_m[t, i], count[i], settings.k_b)
                    ratio = over_limit(abs(b_m[t, m, i]), limit)
                    if ratio > worst:
                        worst, found = ratio, (m, i, abs(b_m[t, m, i]), limit)
    return found


@compiled
def worst_limit(
    count: FloatArray, prc_m: FloatArray, rrc_mps: FloatArray, satellite_cause: IntArray, settings: Settings
) -> tuple[int, int, float, float]:
    """The correction or rate furthest over its limit: 0 or 1, satellite, size and limit; -1 where none fails."""
    worst, found = 0.0, (-1, -1, math.nan, math.nan)
    for kind in range(2):
        limit = settings.max_rrc_mps if kind else settings.max_prc_m
        values = rrc_mps if kind else prc_m
        for t in range(len(values)):
            for i in range(len(count)):
                if count[i] > 0.0 and satellite_cause[i] == 0 and (kind == 0 or finite_rate(rrc_mps, i)):
                    ratio = over_limit(abs(values[t, i]), limit)
                    if ratio > worst:
                        worst, found = ratio, (kind, i, abs(values[t, i]), limit)
    return found


@compiled
def finite_rate(rrc_mps: FloatArray, i: int) -> bool:
    """Whether a satellite has a rate with every smoothing constant."""
    for t in range(len(rrc_mps)):
        if not math.isfinite(rrc_mps[t, i]):
            return False
    return True


@compiled
def residual_m(
    correction_m: FloatArray,
    settled: BoolArray,
    common: BoolArray,
    prc_m: FloatArray,
    settings: Settings,
) -> FloatArray:
    """PR_sc less PRC, ``(tau, R, N)``, each receiver's clock estimated against the PRC of common satellites it has."""
    n_tau, n_receivers, n_sats = correction_m.shape
    residual = np.full(correction_m.shape, np.nan)
    for m in range(n_receivers):
        for k in range(settings.n_constellations):
            number, total = 0, np.zeros(n_tau)
            for i in range(n_sats):
                if settings.constellation[i] == k:
                    there = settled[m, i] and common[k, i]
                    for t in range(n_tau):
                        residual[t, m, i] = correction_m[t, m, i] - prc_m[t, i]
                        there = there and math.isfinite(residual[t, m, i])
                    if there:
                        number += 1
                        for t in range(n_tau):
                            total[t] += residual[t, m, i]
            for i in range(n_sats):
                if settings.constellation[i] == k:
                    for t in range(n_tau):
                        residual[t, m, i] -= total[t] / number if number >= settings.min_common else math.nan
    return residual


@compiled
def compare_unused(
    residual: FloatArray,
    settled: BoolArray,
    used: BoolArray,
    count: FloatArray,
    sigma_m: FloatArray,
    settings: Settings,
) -> tuple[BoolArray, BoolArray]:
    """Channels ``(R, N)`` that are not used: those that agree with the corrections they have no part in, and those
    that are seen to disagree."""
    agrees, disagrees = np.zeros(used.shape, dtype=np.bool_), np.zeros(used.shape, dtype=np.bool_)
    for m in range(used.shape[0]):
        for i in range(used.shape[1]):
            if not (settled[m, i] and not used[m, i] and count[i] > 0.0 and all_finite(residual, m, i)):
                continue
            agrees[m, i] = True
            for t in range(len(residual)):
                value, limit = abs(residual[t, m, i]), unused_limit_m(sigma_m[t, i], count[i], settings.k_b)
                agrees[m, i] = agrees[m, i] and value <= settings.readmission_share * limit
                disagrees[m, i] = disagrees[m, i] or not value <= limit
    return agrees, disagrees
