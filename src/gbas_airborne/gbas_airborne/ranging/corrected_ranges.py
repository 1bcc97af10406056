"""From raw observations and what the station told to ranges a position may be made of, and why the others may not.

Pure functions on the satellite axis. :func:`ranging_sources` applies every rule that does not need the position;
elevation, distance and the range test follow in :mod:`gbas_airborne.navigation.position`.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.2; RTCA DO-253 2.3.8.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.vdb_messages import Corrections, EphemerisChecks, StationData
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import seconds_between
from gbas_core.gnss.orbits import transmit_place
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import missing, satellites_of
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import Rejection

MILLISECOND_M: Final = 1e-3 * SPEED_OF_LIGHT_MPS
# Uncertain, ours: a common step of code against carrier counts as whole milliseconds when it is this close to them.
_MILLISECOND_TOLERANCE_M: Final = 30.0
_MIN_SATELLITES_FOR_STEP: Final = 3
# The airborne sigma models are those of code smoothed over this time.
_MODEL_TAU_S: Final = 100.0
# A filter is never taken to be younger than one epoch of the VDB's rate.
_YOUNGEST_S: Final = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class RangingSources:
    """Satellites an epoch offers, on the satellite axis; what needs no position.

    Attributes
    ----------
    reason : (N_SATS,) int array
        :class:`Rejection`.
    range_m : (N_SATS,) array
        Smoothed range with corrections and satellite clock, without troposphere [m]; NaN where there is none.
    satellite_m : (3, N_SATS) array
        Satellite positions at transmission, ECEF of that time [m].
    noise_factor : (N_SATS,) array
        Factor on airborne noise and multipath, see :func:`settling_factor` [-].
    settled_s : (N_SATS,) array
        Time since the start of the smoothing filter [s].
    age_s : float
        Age of the corrections [s].
    own_crc : (N_SATS,) array
        CRC of the ephemeris the receiver has for the correction; NaN where it has none.
    """

    reason: NDArray[np.int64]
    range_m: FloatArray
    satellite_m: FloatArray
    noise_factor: FloatArray
    settled_s: FloatArray
    age_s: float
    own_crc: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothedRanges:
    """What the receiver measured: raw and smoothed L1 code and the age of the filters, (N_SATS,) arrays."""

    code_m: FloatArray
    smoothed_m: FloatArray
    settled_s: FloatArray


def corrected_range_m(
    smoothed_m: FloatArray, corrections: Corrections, age_s: float, satellite_clock_s: FloatArray
) -> FloatArray:
    """Corrected range without troposphere: P + PRC + RRC (t - t_z) + c dt_sv [m], (N_SATS,).

    Source: ICAO Annex 10 vol. I, App. B 3.6.5.2.
    """
    return smoothed_m + corrections.prc_m + corrections.rrc_mps * age_s + SPEED_OF_LIGHT_MPS * satellite_clock_s


def settling_factor(settled_s: FloatArray, tau_s: float) -> FloatArray:
    """Noise left by a carrier smoothing filter over that of the settled 100 s filter of the sigma models [-].

    Parameters
    ----------
    settled_s : (...) array
        Time since the filter's start [s].
    tau_s : float
        Time constant [s].

    Notes
    -----
    White code noise of variance v per second: the mean over t < tau leaves v/t; the settled filter v/(2 tau); between
    them the start decays with exp(-2 (t - tau)/tau). The factor is the root of the ratio to v/(2 100 s), never below
    one. For tau = 100 s it is 1.41 at t = tau and within 1 % of one after 2.96 tau.
    """
    tau = max(tau_s, _YOUNGEST_S)
    since_start = np.maximum(settled_s, _YOUNGEST_S)
    settling = (1.0 + np.exp(-2.0 * (since_start - tau) / tau)) / (2.0 * tau)
    variance = np.where(since_start < tau, 1.0 / since_start, settling)
    result: FloatArray = np.sqrt(np.maximum(variance * 2.0 * _MODEL_TAU_S, 1.0))
    return result


def millisecond_step_m(code_change_m: FloatArray, carrier_change_m: FloatArray) -> float:
    """Whole milliseconds by which the code of all satellites stepped against the carrier [m]; 0 if they did not.

    Parameters
    ----------
    code_change_m, carrier_change_m : (N_SATS,) arrays
        Changes since the last epoch [m], NaN where there is none.

    Notes
    -----
    Some receivers step their clock by whole milliseconds and apply it to the code alone. Left alone it would look like
    a slip on every satellite and restart every filter.
    """
    difference = code_change_m - carrier_change_m
    stepped = np.abs(difference) > 0.5 * MILLISECOND_M
    if np.count_nonzero(stepped) < _MIN_SATELLITES_FOR_STEP:
        return 0.0
    present = difference[np.isfinite(difference)]
    step = float(np.round(np.median(present) / MILLISECOND_M) * MILLISECOND_M)
    return step if (np.abs(present - step) < _MILLISECOND_TOLERANCE_M).all() else 0.0


def ranging_sources(
    gps_week: int,
    tow_s: float,
    ranges: SmoothedRanges,
    station: StationData | None,
    corrections: Corrections | None,
    ephemeris: Ephemeris,
    ephemeris_crc: FloatArray,
    checks: EphemerisChecks,
    params: AirborneParams,
) -> RangingSources:
    """Corrected ranges of an epoch, and the reason where a satellite may not be used.

    Parameters
    ----------
    gps_week, tow_s
        Epoch of the observations.
    ephemeris, ephemeris_crc
        The receiver's own ephemerides with the issue of data of the corrections, and their CRCs (N_SATS,).
    checks : EphemerisChecks
        What the station said about ephemerides.
    """
    tracked = np.isfinite(ranges.smoothed_m)
    if station is None or corrections is None or not (station.healthy or params.use_unhealthy):
        reason = np.where(tracked, int(Rejection.NO_STATION), int(Rejection.NOT_TRACKED))
        return RangingSources(
            reason=reason,
            range_m=missing(),
            satellite_m=missing(3),
            noise_factor=missing(),
            settled_s=ranges.settled_s,
            age_s=math.nan,
            own_crc=missing(),
        )
    age_s = seconds_between(corrections.gps_week, corrections.tow_s, gps_week, tow_s)
    rules = _rules(ranges, station, corrections, age_s, ephemeris, ephemeris_crc, checks, params)
    reason = first_reason(rules)
    satellite = transmit_place(ephemeris, gps_week, tow_s, ranges.code_m)
    factor = np.ones(tracked.shape)
    if params.inflate_unsettled:
        factor = settling_factor(ranges.settled_s, params.smoothing_tau_s)
    return RangingSources(
        reason=reason,
        range_m=corrected_range_m(ranges.smoothed_m, corrections, age_s, satellite.clock_s),
        satellite_m=satellite.position_m,
        noise_factor=factor,
        settled_s=ranges.settled_s,
        age_s=age_s,
        own_crc=np.where(np.isfinite(ephemeris.iod), ephemeris_crc, np.nan),
    )


def _rules(
    ranges: SmoothedRanges,
    station: StationData,
    corrections: Corrections,
    age_s: float,
    ephemeris: Ephemeris,
    ephemeris_crc: FloatArray,
    checks: EphemerisChecks,
    params: AirborneParams,
) -> list[tuple[Rejection, BoolArray]]:
    """Each rule with the satellites it rejects. Comparisons are written so that NaN rejects."""
    too_old = not -params.correction_timeout_s <= age_s <= params.correction_timeout_s
    crc_told = checks.iod == corrections.iod
    valid = np.isfinite(corrections.prc_m + corrections.rrc_mps + corrections.sigma_m)
    return [
        (Rejection.NOT_TRACKED, ~np.isfinite(ranges.smoothed_m)),
        (Rejection.SYSTEM, ~_systems(params.systems)),
        (Rejection.NO_CORRECTION, ~np.isfinite(corrections.listed)),
        (Rejection.CORRECTION_INVALID, ~valid),
        (Rejection.CORRECTION_AGE, np.full(valid.shape, too_old)),
        (Rejection.B_VALUES, ~usable_b_values(corrections.b_m, station.n_receivers, valid)),
        (Rejection.EPHEMERIS_IOD, ~np.isfinite(ephemeris.iod)),
        (Rejection.EPHEMERIS_CRC_MISSING, ~(crc_told & np.isfinite(checks.crc + checks.p))),
        (Rejection.EPHEMERIS_CRC_MISMATCH, ~(ephemeris_crc == checks.crc)),
        (Rejection.NOT_SETTLED, ~(ranges.settled_s >= params.settle_s)),
    ]


@lru_cache(maxsize=8)
def _systems(letters: str) -> BoolArray:
    return satellites_of(letters)


def usable_b_values(b_m: FloatArray, n_receivers: int, valid: BoolArray) -> BoolArray:
    """Satellites whose B values support a protection level, (N_SATS,) bool array.

    A correction needs the B values of two receivers or more. Without any it is the correction of a single receiver:
    that has a protection level only when the station says so (no number of receivers in its station data) and no other
    correction has B values, so that the multiplier of one receiver holds for all.

    Source: RTCA DO-253 (approach protection levels); the rule for stations of one receiver is ours.
    """
    count = np.isfinite(b_m).sum(axis=0)
    several = count >= 2
    single_station = n_receivers == 1 and not (several & valid).any()
    return np.asarray(several | ((count == 0) & single_station))


def first_reason(rules: list[tuple[Rejection, BoolArray]]) -> NDArray[np.int64]:
    """The first rule that rejects each satellite; NONE where none does."""
    rejected = np.array([mask for _, mask in rules])
    numbers = np.array([int(rejection) for rejection, _ in rules])
    return np.where(rejected.any(axis=0), numbers[rejected.argmax(axis=0)], int(Rejection.NONE))
