# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Corrected ranges of all modes of an epoch, and why the others are not used. Missing is NaN: it never passes a rule.

The first axis of arrays is the mode.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.2; RTCA DO-253 2.3.8.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_airborne.reception.columns import B_VALUES, IOD, LISTED, PRC, RRC, SIGMA
from gbas_core.compiled import compiled
from gbas_core.gnss.ephemeris import FIELDS
from gbas_core.gnss.kernels.orbits import transmit_place
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import Rejection

_YOUNGEST_S: Final = 0.5  # a filter is never taken to be younger than one epoch of the VDB's rate
_OWN_IOD: Final = FIELDS.index("iod")

_NONE, _NOT_TRACKED, _SYSTEM = int(Rejection.NONE), int(Rejection.NOT_TRACKED), int(Rejection.SYSTEM)
_NO_CORRECTION, _INVALID = int(Rejection.NO_CORRECTION), int(Rejection.CORRECTION_INVALID)
_AGE, _B_VALUES, _EPHEMERIS_IOD = (
    int(Rejection.CORRECTION_AGE),
    int(Rejection.B_VALUES),
    int(Rejection.EPHEMERIS_IOD),
)
_CRC_MISSING, _CRC_MISMATCH = int(Rejection.EPHEMERIS_CRC_MISSING), int(Rejection.EPHEMERIS_CRC_MISMATCH)
_NOT_SETTLED: Final = int(Rejection.NOT_SETTLED)


@compiled
def corrected_range_m(smoothed_m, prc_m, rrc_mps, age_s, satellite_clock_s):
    """Corrected range without troposphere: P + PRC + RRC (t - t_z) + c dt_sv [m].

    Source: ICAO Annex 10 vol. I, App. B 3.6.5.2.
    """
    return smoothed_m + prc_m + rrc_mps * age_s + SPEED_OF_LIGHT_MPS * satellite_clock_s


@compiled
def settling_factor(settled_s, tau_s, model_tau_s):
    """Noise left by a carrier smoothing filter over that of the settled filter of the sigma models [-].

    Time since the filter's start, time constant, and that of the models [s].

    Notes
    -----
    White code noise of variance v per second: the mean over t < tau leaves v/t; the settled filter v/(2 tau); between
    them the start decays with exp(-2 (t - tau)/tau). The factor is the root of the ratio to v/(2 model_tau), never
    below one. For both of 100 s it is 1.41 at t = tau and within 1 % of one after 2.96 tau.
    """
    if np.isnan(settled_s):
        return np.nan
    tau, since_start = max(tau_s, _YOUNGEST_S), max(settled_s, _YOUNGEST_S)
    if since_start < tau:
        variance = 1.0 / since_start
    else:
        variance = (1.0 + np.exp(-2.0 * (since_start - tau) / tau)) / (2.0 * tau)
    return np.sqrt(max(variance * 2.0 * model_tau_s, 1.0))


@compiled
def is_valid(corrections, s):
    """Whether a correction has all it needs."""
    return np.isfinite(corrections[PRC, s] + corrections[RRC, s] + corrections[SIGMA, s])


@compiled
def receivers_behind(corrections, s):
    """Number of reference receivers behind a correction, counted from its B values."""
    count = 0
    for row in range(B_VALUES, corrections.shape[0]):
        count += np.isfinite(corrections[row, s])
    return count


@compiled
def single_receiver(corrections, n_receivers):
    """Whether all corrections are of one receiver: the station says so, and no valid one has B values."""
    if n_receivers != 1:
        return False
    for s in range(corrections.shape[1]):
        if receivers_behind(corrections, s) >= 2 and is_valid(corrections, s):
            return False
    return True


@compiled
def usable_b_values(corrections, single, s):
    """Whether the B values of a satellite support a protection level.

    A correction needs the B values of two receivers or more. Without any it is the correction of a single receiver:
    that has a protection level only when the station says so (no number of receivers in its station data) and no other
    correction has B values, so that the multiplier of one receiver holds for all.

    Source: RTCA DO-253 (approach protection levels); the rule for stations of one receiver is ours.
    """
    count = receivers_behind(corrections, s)
    return count >= 2 or (count == 0 and single)


@compiled
def first_reason(s, tracked, systems, corrections, fresh, single, own, own_crc, checks, settled):
    """The first rule that rejects a satellite; NONE when none does. Written so that NaN rejects."""
    if not tracked:
        return _NOT_TRACKED
    if not systems[s]:
        return _SYSTEM
    if not np.isfinite(corrections[LISTED, s]):
        return _NO_CORRECTION
    if not is_valid(corrections, s):
        return _INVALID
    if not fresh:
        return _AGE
    if not usable_b_values(corrections, single, s):
        return _B_VALUES
    if not np.isfinite(own[_OWN_IOD, s]):
        return _EPHEMERIS_IOD
    iod, crc, p = checks[0, s], checks[1, s], checks[2, s]
    if not (iod == corrections[IOD, s] and np.isfinite(crc + p)):
        return _CRC_MISSING
    if own_crc[s] != crc:
        return _CRC_MISMATCH
    return _NONE if settled else _NOT_SETTLED


@compiled
def combine(corrections, product, level_product, coefficient, s, applied):
    """Fill in the correction of a mode's range of a satellite, and return the sigma of its weight.

    Rows are those of a set of corrections; sigmas are independent between signals. B values are combined where the same
    receivers are behind both signals; elsewhere they are missing.

    Source: Circiu et al., eq (3) and (7).
    """
    first = product[0]
    if coefficient[1] == 0.0:
        for row in range(corrections.shape[1]):
            applied[row, s] = corrections[first, row, s]
        applied[SIGMA, s] = corrections[level_product[0], SIGMA, s]
        return corrections[first, SIGMA, s]
    applied[LISTED, s], applied[IOD, s] = corrections[first, LISTED, s], corrections[first, IOD, s]
    second = product[1]
    for row in range(PRC, corrections.shape[1]):
        if row != SIGMA:
            total = coefficient[0] * corrections[first, row, s] + coefficient[1] * corrections[second, row, s]
            applied[row, s] = total
    level = weight = 0.0
    for c in range(2):
        level += (coefficient[c] * corrections[level_product[c], SIGMA, s]) ** 2
        weight += (coefficient[c] * corrections[product[c], SIGMA, s]) ** 2
    applied[SIGMA, s] = np.sqrt(level)
    return np.sqrt(weight)


@compiled
def agree(corrections, first, second, s):
    """Whether the corrections of two signals are of one ephemeris and of the same receivers."""
    if corrections[first, IOD, s] != corrections[second, IOD, s]:
        return False
    for row in range(B_VALUES, corrections.shape[1]):
        if np.isfinite(corrections[first, row, s]) != np.isfinite(corrections[second, row, s]):
            return False
    return True


@compiled
def places(measured, product, own, gps_week, tow_s):
    """Satellite positions ``(P, 3, N)`` and clocks ``(P, N)`` for sets of corrections, by raw code of their signals.

    Arguments as of :func:`correct_ranges`; a product is of one signal, so any mode that applies it has its code.
    """
    n_products, n_sats = own.shape[0], own.shape[2]
    at_m, clock_s = np.full((n_products, 3, n_sats), np.nan), np.full((n_products, n_sats), np.nan)
    done = np.zeros(n_products, np.bool_)
    for m in range(product.shape[0]):
        for c in range(product.shape[1]):
            p = product[m, c]
            if done[p]:
                continue
            done[p] = True
            for s in range(n_sats):
                code_m = measured[m, c, 0, s]
                if np.isfinite(code_m + own[p, _OWN_IOD, s]):
                    x, y, z, clock_s[p, s] = transmit_place(own[p], s, gps_week, tow_s, code_m, L1)
                    at_m[p, 0, s], at_m[p, 1, s], at_m[p, 2, s] = x, y, z
    return at_m, clock_s


@compiled
def correct_ranges(
    measured, coefficient, tau_s, level_tau_s, model_tau_s, product, level_product, corrections, age_s, own, own_crc,
    checks, systems, gps_week, tow_s, n_receivers, timeout_s, settle_s, inflate,
):  # fmt: skip
    """Reasons, corrected ranges and sigmas of weights ``(M, N)``, corrections as applied ``(M, rows, N)``, satellite
    positions ``(M, 3, N)``, and factors on airborne noise for levels and for weights ``(M, 2, C, N)``.

    A mode's range is a sum over at most C = 2 signals of the corrected ranges times a factor.

    Parameters
    ----------
    measured : (M, C, 3, N) array
        Raw and smoothed code [m], age of the filter [s].
    coefficient : (M, C) array
        Factors; 0 for a signal that is not there.
    tau_s, level_tau_s : (M,) arrays
        Time constant of the ranges, and the one the levels' sigmas are for [s].
    model_tau_s : (M, 2, C) array
        Time constant the airborne sigma models of levels and of weights are for [s].
    product, level_product : (M, C) arrays
        Which of the P sets of corrections is applied, and which has the sigma of the levels.
    corrections, age_s : (P, rows, N), (P,) arrays
        Sets of corrections and their ages [s].
    own, own_crc : (P, fields, N), (P, N) arrays
        Own ephemerides with the issue of data of the corrections, and their CRCs.
    checks : (3, N) array
        Issue of data, CRC and P as the station sent them.
    systems : (M, N) bool array

    Notes
    -----
    The satellite clock is that of L1 for every signal, with the group delay, as it is at the station: what is left on
    another signal is the same at both ends.
    """
    n_modes, n_signals, _, n_sats = measured.shape
    reason = np.empty((n_modes, n_sats), np.int64)
    ranges_m, weight_sigma_m = np.full((n_modes, n_sats), np.nan), np.full((n_modes, n_sats), np.nan)
    factor = np.ones((n_modes, 2, n_signals, n_sats))
    place_m = np.full((n_modes, 3, n_sats), np.nan)
    applied = np.full((n_modes, corrections.shape[1], n_sats), np.nan)
    single = np.zeros(corrections.shape[0], np.bool_)
    for p in range(corrections.shape[0]):
        single[p] = single_receiver(corrections[p], n_receivers)
    at_m, clock_s = places(measured, product, own, gps_week, tow_s)
    for m in range(n_modes):
        two = coefficient[m, 1] != 0.0
        for s in range(n_sats):
            reason[m, s] = _NONE
            total_m = 0.0
            for c in range(2 if two else 1):
                p, smoothed_m, since_s = product[m, c], measured[m, c, 1, s], measured[m, c, 2, s]
                fresh = -timeout_s <= age_s[p] <= timeout_s
                if reason[m, s] == _NONE:
                    reason[m, s] = first_reason(
                        s, np.isfinite(smoothed_m), systems[m], corrections[p], fresh, single[p], own[p], own_crc[p],
                        checks, since_s >= settle_s,
                    )  # fmt: skip
                if reason[m, s] == _NONE and not np.isfinite(corrections[level_product[m, c], SIGMA, s]):
                    reason[m, s] = _INVALID
                if inflate:
                    factor[m, 0, c, s] = settling_factor(since_s, level_tau_s[m], model_tau_s[m, 0, c])
                    factor[m, 1, c, s] = settling_factor(since_s, tau_s[m], model_tau_s[m, 1, c])
                range_m = corrected_range_m(
                    smoothed_m, corrections[p, PRC, s], corrections[p, RRC, s], age_s[p], clock_s[p, s]
                )
                total_m = total_m + coefficient[m, c] * range_m if two else range_m
            place_m[m, :, s] = at_m[product[m, 0], :, s]
            if two and reason[m, s] == _NONE and not agree(corrections, product[m, 0], product[m, 1], s):
                reason[m, s] = _B_VALUES
            ranges_m[m, s] = total_m
            weight_sigma_m[m, s] = combine(corrections, product[m], level_product[m], coefficient[m], s, applied[m])
    return reason, ranges_m, weight_sigma_m, applied, place_m, factor
