"""From raw observations and what the station told to ranges a position may be made of, and why the others may not.

Pure functions on the satellite axis. :func:`ranging_sources` applies every rule that does not need the position;
elevation, distance and the range test follow in :mod:`gbas_airborne.navigation.position`.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.2; RTCA DO-253 2.3.8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.own_ranges import Tracked
from gbas_airborne.reception.receive import Received
from gbas_airborne.reception.station_data import Corrections, EphemerisChecks
from gbas_core.gnss.ephemeris import FIELDS, Ephemeris
from gbas_core.gnss.orbits import transmit_place
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import missing, satellites_of
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import Rejection
from gbas_msgs_py.modes import Mode
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs

# The airborne sigma models are those of code smoothed over this time.
_MODEL_TAU_S: Final = 100.0
# A filter is never taken to be younger than one epoch of the VDB's rate.
_YOUNGEST_S: Final = 0.5


_Rule = tuple[Rejection, BoolArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnEphemerides:
    """Own ephemerides with the issue of data of a product's corrections.

    Attributes
    ----------
    ephemeris : Ephemeris
    fields : (n_fields, N_SATS) array
        All of them at once, to tell one from another.
    crc : (N_SATS,) array
        Their CRCs; NaN where there is none.
    """

    ephemeris: Ephemeris = field(default_factory=lambda: Ephemeris(gps_week=0, tow_s=0.0))
    fields: FloatArray = field(default_factory=lambda: missing(len(FIELDS)))
    crc: FloatArray = field(default_factory=missing)


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectState:
    """Own ephemerides last matched with corrections, by product."""

    matched: Mapping[str, OwnEphemerides] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class RangingSources:
    """Satellites an epoch offers to a mode, on the satellite axis; what needs no position.

    Attributes
    ----------
    mode : Mode
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

    mode: Mode
    reason: NDArray[np.int64]
    range_m: FloatArray
    satellite_m: FloatArray
    noise_factor: FloatArray
    settled_s: FloatArray
    age_s: float
    own_crc: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrected:
    """What was received, and the ranging sources of each mode."""

    received: Received
    sources: tuple[RangingSources, ...]


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


def correct(
    state: CorrectState, tracked: Tracked, modes: tuple[Mode, ...], params: AirborneParams
) -> tuple[CorrectState, Corrected]:
    """Third stage of an epoch: ranging sources of every mode.

    Ephemerides are those with the issue of data of the corrections; their CRCs are made once each.
    """
    received, matched = tracked.received, dict(state.matched)
    for product in {mode.product: None for mode in modes}:
        corrections = received.corrections.get(product)
        iod = corrections.iod if corrections is not None else missing()
        matched[product] = _match(matched.get(product, OwnEphemerides()), iod, received)
    sources = tuple(ranging_sources(mode, tracked, matched[mode.product], params) for mode in modes)
    return CorrectState(matched=matched), Corrected(received=received, sources=sources)


def _match(before: OwnEphemerides, iod: FloatArray, received: Received) -> OwnEphemerides:
    """Own ephemerides with an issue of data, and their CRCs; one that is as before has its CRC already."""
    ephemeris = received.ephemerides.matching(iod, received.gps_week, received.tow_s)
    fields = np.array([getattr(ephemeris, name) for name in FIELDS])
    found = np.isfinite(ephemeris.iod)
    fresh = found & ~((fields == before.fields) | (np.isnan(fields) & np.isnan(before.fields))).all(axis=0)
    crc = np.where(found, before.crc, np.nan)
    if fresh.any():
        crc = np.where(fresh, ephemeris_crcs(ephemeris), crc)
    return OwnEphemerides(ephemeris=ephemeris, fields=fields, crc=crc)


def ranging_sources(mode: Mode, tracked: Tracked, own: OwnEphemerides, params: AirborneParams) -> RangingSources:
    """Corrected ranges of a mode, and the reason where a satellite may not be used."""
    received, ranges = tracked.received, tracked.ranges(mode)
    station, corrections = received.station, received.corrections.get(mode.product)
    if station is None or corrections is None or not (station.healthy or params.use_unhealthy):
        tracking = np.isfinite(ranges.smoothed_m)
        return RangingSources(
            mode=mode,
            reason=np.where(tracking, int(Rejection.NO_STATION), int(Rejection.NOT_TRACKED)),
            range_m=missing(),
            satellite_m=missing(3),
            noise_factor=missing(),
            settled_s=ranges.settled_s,
            age_s=math.nan,
            own_crc=missing(),
        )
    age_s = received.since_s((corrections.gps_week, corrections.tow_s))
    satellite = transmit_place(own.ephemeris, received.gps_week, received.tow_s, ranges.code_m)
    factor = np.ones(ranges.smoothed_m.shape)
    if params.inflate_unsettled:
        factor = settling_factor(ranges.settled_s, mode.smoothing_s)
    return RangingSources(
        mode=mode,
        reason=first_reason(
            [
                (Rejection.NOT_TRACKED, ~np.isfinite(ranges.smoothed_m)),
                (Rejection.SYSTEM, ~_systems(params.systems)),
                *_correction_rules(corrections, age_s, station.n_receivers, params),
                *_ephemeris_rules(corrections, own, received.checks),
                (Rejection.NOT_SETTLED, ~(ranges.settled_s >= params.settle_s)),
            ]
        ),
        range_m=corrected_range_m(ranges.smoothed_m, corrections, age_s, satellite.clock_s),
        satellite_m=satellite.position_m,
        noise_factor=factor,
        settled_s=ranges.settled_s,
        age_s=age_s,
        own_crc=own.crc,
    )


# Each rule with the satellites it rejects. Comparisons are written so that NaN rejects.


def _correction_rules(
    corrections: Corrections, age_s: float, n_receivers: int, params: AirborneParams
) -> tuple[_Rule, ...]:
    too_old = not -params.correction_timeout_s <= age_s <= params.correction_timeout_s
    valid = np.isfinite(corrections.prc_m + corrections.rrc_mps + corrections.sigma_m)
    return (
        (Rejection.NO_CORRECTION, ~np.isfinite(corrections.listed)),
        (Rejection.CORRECTION_INVALID, ~valid),
        (Rejection.CORRECTION_AGE, np.full(valid.shape, too_old)),
        (Rejection.B_VALUES, ~usable_b_values(corrections.b_m, n_receivers, valid)),
    )


def _ephemeris_rules(corrections: Corrections, own: OwnEphemerides, checks: EphemerisChecks) -> tuple[_Rule, ...]:
    crc_known = (checks.iod == corrections.iod) & np.isfinite(checks.crc + checks.p)
    return (
        (Rejection.EPHEMERIS_IOD, ~np.isfinite(own.ephemeris.iod)),
        (Rejection.EPHEMERIS_CRC_MISSING, ~crc_known),
        (Rejection.EPHEMERIS_CRC_MISMATCH, ~(own.crc == checks.crc)),
    )


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


def first_reason(rules: Sequence[_Rule]) -> NDArray[np.int64]:
    """The first rule that rejects each satellite; NONE where none does."""
    rejected = np.array([mask for _, mask in rules])
    numbers = np.array([int(rejection) for rejection, _ in rules])
    return np.where(rejected.any(axis=0), numbers[rejected.argmax(axis=0)], int(Rejection.NONE))
