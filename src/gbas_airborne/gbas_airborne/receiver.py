"""The airborne receiver: from VDB bursts, own observations and broadcast ephemerides to a protected position.

:meth:`AirborneReceiver.position` and :meth:`AirborneReceiver.protect` are what the two nodes run; :meth:`step` is both.
States are frozen and know no clock: the same inputs give the same outputs, bit for bit, wherever they come from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.navigation.guidance import approach_columns, guidance_columns
from gbas_airborne.navigation.position import Fix, PositionInputs, PositionResult, Speed, tested_position
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import (
    RangingSources,
    Rejection,
    SmoothedRanges,
    millisecond_step_m,
    ranging_sources,
)
from gbas_airborne.reception.vdb_messages import SOURCE, ReceptionState, reception_step
from gbas_airborne.service import ServiceState, service_step
from gbas_core.gnss.ephemeris import Ephemeris, EphemerisStore
from gbas_core.gnss.gpstime import epoch_key, seconds_between
from gbas_core.gnss.observations import LARGEST_OBSERVATION, ObservationEpoch
from gbas_core.ranging.slips import SlipParams, SlipState, initial_slips, slip_step
from gbas_core.ranging.smoothing import SmoothingParams, SmoothingState, initial_smoothing, smooth_step
from gbas_core.record import FloatArray
from gbas_core.satellites import SAT_IDS, missing
from gbas_core.signals import L1
from gbas_msgs_py.events import Event, EventKind
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs
from gbas_vdb.transmission.burst import Burst

# A time constant of zero means no smoothing; the filter wants a positive one.
_NO_SMOOTHING_S: Final = 1e-9
# Uncertain, ours: so many epochs refused in a row, each later than the one before, are the time now.
RESTART_AFTER_REFUSED: Final = 10
# A pseudorange is some 2e7 m, and a receiver clock is not three seconds off: anything larger is no measurement.
LARGEST_CODE_M: Final = 1e9
# Reasons that say nothing about a satellite itself: no event is made of them.
_SILENT: Final = (Rejection.NO_STATION, Rejection.SYSTEM)


@dataclass(frozen=True, kw_only=True, eq=False)
class AirborneEpoch:
    """What the receiver gets for one epoch.

    Attributes
    ----------
    gps_week, tow_s
        The epoch.
    observations : ObservationEpoch or None
        None when the receiver gave none: there is then no position.
    bursts : tuple of Burst
        VDB bursts that arrived since the last epoch.
    ephemerides : tuple of Ephemeris
        Broadcast ephemerides received since the last epoch.
    """

    gps_week: int
    tow_s: float
    observations: ObservationEpoch | None
    bursts: tuple[Burst, ...] = ()
    ephemerides: tuple[Ephemeris, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackingState:
    """Smoothing of the own ranges.

    Attributes
    ----------
    observed : (week, tow) or None
        Last epoch with observations.
    carrier_offset_m : float
        Whole milliseconds added to all carriers because the code stepped by them [m].
    """

    observed: tuple[int, float] | None = None
    carrier_offset_m: float = 0.0
    slips: SlipState = field(default_factory=initial_slips)
    smoothing: SmoothingState = field(default_factory=lambda: initial_smoothing(SmoothingParams(tau_s=(100.0,))))


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnEphemerides:
    """Broadcast ephemerides received, and CRCs of those last matched with corrections, per satellite."""

    store: EphemerisStore = field(default_factory=EphemerisStore)
    crc_toe_s: FloatArray = field(default_factory=missing)
    crc_iod: FloatArray = field(default_factory=missing)
    crc: FloatArray = field(default_factory=missing)


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionState:
    """What positioning remembers between epochs.

    Attributes
    ----------
    epoch : (week, tow) or None
        Last epoch processed.
    fix_epoch, fix_ecef_m
        Last position and when.
    reason : (N_SATS,) int array
        Why each satellite was not used in the last epoch with observations (Rejection).
    held_until_s : (N_SATS,) array
        GPS time until which the range test holds a satellite [s]; -inf when it does not.
    observations_missing : bool
        Whether the last epoch had none.
    refused, refused_key : int
        Epochs refused in a row because they were not later than the last one, and the last of them.
    """

    epoch: tuple[int, float] | None = None
    reception: ReceptionState = field(default_factory=ReceptionState)
    tracking: TrackingState = field(default_factory=TrackingState)
    ephemerides: OwnEphemerides = field(default_factory=OwnEphemerides)
    fix_epoch: tuple[int, float] | None = None
    fix_ecef_m: FloatArray | None = None
    reason: NDArray[np.int64] = field(default_factory=lambda: np.full(len(SAT_IDS), int(Rejection.NOT_TRACKED)))
    held_until_s: FloatArray = field(default_factory=lambda: np.full(len(SAT_IDS), -np.inf))
    observations_missing: bool = False
    refused: int = 0
    refused_key: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class AirborneState:
    """State of the whole receiver: positioning and service."""

    position: PositionState = field(default_factory=PositionState)
    service: ServiceState = field(default_factory=ServiceState)


class AirborneReceiver:
    """The two halves of the receiver and their composition; no state of its own."""

    @staticmethod
    def position(
        state: PositionState, epoch: AirborneEpoch, params: AirborneParams
    ) -> tuple[PositionState, SolutionEpoch, tuple[Event, ...]]:
        """Position of one epoch; without one, a solution whose scalars are NaN (but for what the station told).

        An epoch that is not later than the last one is refused: no position, and nothing changes but what was received.
        When time goes on from there, the receiver starts anew.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return _position(state, epoch, params)

    @staticmethod
    def protect(
        state: ServiceState, solution: SolutionEpoch, params: AirborneParams
    ) -> tuple[ServiceState, ProtectionEpoch, tuple[Event, ...]]:
        """Protection levels, alert limits and service of one solution."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return service_step(state, solution, params)

    @staticmethod
    def step(
        state: AirborneState, epoch: AirborneEpoch, params: AirborneParams
    ) -> tuple[AirborneState, SolutionEpoch, ProtectionEpoch, tuple[Event, ...]]:
        """Both: position, then protect."""
        position, solution, events = AirborneReceiver.position(state.position, epoch, params)
        service, protection, more = AirborneReceiver.protect(state.service, solution, params)
        return AirborneState(position=position, service=service), solution, protection, events + more


def _position(
    state: PositionState, epoch: AirborneEpoch, params: AirborneParams
) -> tuple[PositionState, SolutionEpoch, tuple[Event, ...]]:
    log = _Log(epoch)
    state, in_order = _in_order(state, epoch, log)
    ephemerides = _receive_ephemerides(state.ephemerides, epoch.ephemerides)
    reception, events = reception_step(state.reception, epoch.bursts, epoch.gps_week, epoch.tow_s, params)
    log.events.extend(events)
    state = replace(state, ephemerides=ephemerides, reception=reception)
    if not in_order:
        return state, _solution(epoch, reception, None), tuple(log.events)
    observations = _observations(epoch)
    if observations is None and not state.observations_missing:
        log.add(EventKind.INPUT, "observations", "missing")
    now = (epoch.gps_week, epoch.tow_s)
    state = replace(state, epoch=now, refused=0, observations_missing=observations is None)
    if observations is None:
        return state, _solution(epoch, reception, None), tuple(log.events)
    tracking, ranges = _track(state.tracking, observations, params)
    state = replace(state, tracking=tracking)
    state, fix = _navigate(state, epoch, ranges, params, log)
    return state, _solution(epoch, reception, fix), tuple(log.events)


class _Log:
    """Events of one epoch."""

    def __init__(self, epoch: AirborneEpoch) -> None:
        self.events: list[Event] = []
        self._epoch = epoch

    def add(
        self, kind: EventKind, subject: str, cause: str, value: float = math.nan, threshold: float = math.nan
    ) -> None:
        self.events.append(
            Event(
                gps_week=self._epoch.gps_week,
                tow_s=self._epoch.tow_s,
                kind=kind,
                subject=subject,
                cause=cause,
                value=float(value),
                threshold=float(threshold),
                source=SOURCE,
            )
        )


def _in_order(state: PositionState, epoch: AirborneEpoch, log: _Log) -> tuple[PositionState, bool]:
    """Whether the epoch comes after the last one; a state that starts anew when time goes on from an earlier one."""
    key = epoch_key(epoch.gps_week, epoch.tow_s)
    if state.epoch is None or key > epoch_key(*state.epoch):
        return state, True
    back_s = seconds_between(epoch.gps_week, epoch.tow_s, *state.epoch)
    refused = state.refused + 1 if state.refused and key > state.refused_key else 1
    if refused >= RESTART_AFTER_REFUSED:
        log.add(EventKind.INPUT, "observations", "time_restart", back_s)
        # what was received stays true; it is not sent again
        return PositionState(ephemerides=state.ephemerides), True
    log.add(EventKind.INPUT, "observations", "time_backwards", back_s, 0.0)
    return replace(state, refused=refused, refused_key=key), False


# --- inputs


def _receive_ephemerides(own: OwnEphemerides, received: tuple[Ephemeris, ...]) -> OwnEphemerides:
    for ephemeris in received:
        # A CRC belongs to the ephemeris it was made of: a new one of the same issue of data is checked anew.
        own = replace(
            own,
            store=own.store.add(ephemeris),
            crc_iod=np.where(np.isfinite(ephemeris.message), np.nan, own.crc_iod),
        )
    return own


def _match_ephemerides(own: OwnEphemerides, iod: FloatArray, epoch: AirborneEpoch) -> tuple[OwnEphemerides, Ephemeris]:
    """Own ephemerides with the issue of data of the corrections; CRCs are made only when that changes."""
    matched = own.store.matching(iod, epoch.gps_week, epoch.tow_s)
    found = np.isfinite(matched.iod)
    fresh = found & ~((own.crc_iod == matched.iod) & (own.crc_toe_s == matched.toe_tow_s))
    if fresh.any():
        crc = np.where(fresh, ephemeris_crcs(matched), own.crc)
        own = replace(
            own,
            crc=crc,
            crc_iod=np.where(fresh, matched.iod, own.crc_iod),
            crc_toe_s=np.where(fresh, matched.toe_tow_s, own.crc_toe_s),
        )
    return own, matched


def _observations(epoch: AirborneEpoch) -> ObservationEpoch | None:
    """The observations, if they are those of the epoch."""
    observations = epoch.observations
    return observations if observations is not None and observations.is_of(epoch.gps_week, epoch.tow_s) else None


def _track(
    state: TrackingState, observations: ObservationEpoch, params: AirborneParams
) -> tuple[TrackingState, SmoothedRanges]:
    """Smooth the L1 code; returns what a position can be made of."""
    slip_params, smoothing_params = _filter_params(params)
    now = (observations.gps_week, observations.tow_s)
    dt_s = seconds_between(*state.observed, *now) if state.observed is not None else math.nan
    code = _finite(observations.code_m)
    code = np.where(np.abs(code) < LARGEST_CODE_M, code, np.nan)
    carrier = _finite(observations.carrier_m) + state.carrier_offset_m
    step = millisecond_step_m(code[L1] - state.slips.code_m[0, L1], carrier[L1] - state.slips.carrier_m[0, L1])
    carrier = carrier + step
    slips, found = slip_step(
        state.slips,
        code[np.newaxis],
        carrier[np.newaxis],
        _finite(observations.doppler_hz)[np.newaxis],
        _finite(observations.lli)[np.newaxis],
        dt_s,
        slip_params,
    )
    smoothing, smoothed = smooth_step(
        state.smoothing,
        code[L1],
        carrier[L1],
        found.slipped[0, L1],
        dt_s,
        smoothing_params,
    )
    state = TrackingState(
        observed=now, carrier_offset_m=state.carrier_offset_m + step, slips=slips, smoothing=smoothing
    )
    return state, SmoothedRanges(code_m=code[L1], smoothed_m=smoothed[0], settled_s=smoothing.elapsed_s)


@lru_cache(maxsize=8)
def _filter_params(params: AirborneParams) -> tuple[SlipParams, SmoothingParams]:
    return (
        SlipParams(max_gap_s=params.max_gap_s, receiver_jerk_mps3=params.receiver_jerk_mps3),
        SmoothingParams(tau_s=(max(params.smoothing_tau_s, _NO_SMOOTHING_S),), max_gap_s=params.max_gap_s),
    )


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.abs(values) <= LARGEST_OBSERVATION, values, np.nan)


# --- position


def _navigate(
    state: PositionState, epoch: AirborneEpoch, ranges: SmoothedRanges, params: AirborneParams, log: _Log
) -> tuple[PositionState, Fix | None]:
    reception = state.reception
    station, corrections = reception.station, reception.corrections
    iod = corrections.iod if corrections is not None else missing()
    own, ephemeris = _match_ephemerides(state.ephemerides, iod, epoch)
    sources = ranging_sources(
        epoch.gps_week, epoch.tow_s, ranges, station, corrections, ephemeris, own.crc, reception.checks, params
    )
    now_s = seconds_between(0, 0.0, epoch.gps_week, epoch.tow_s)
    held = (sources.reason == int(Rejection.NONE)) & (state.held_until_s > now_s)
    if held.any():
        sources = replace(sources, reason=np.where(held, int(Rejection.RANGE_TEST), sources.reason))
    attempt = PositionResult(fix=None, reason=sources.reason)
    if station is not None and corrections is not None:
        inputs = PositionInputs(sources=sources, corrections=corrections, station=station, approach=reception.approach)
        start = state.fix_ecef_m if state.fix_ecef_m is not None else station.reference_ecef_m
        attempt = tested_position(inputs, start, _speed(state, epoch, params), params)
    _report(state.reason, attempt, sources, reception, params, log)
    tripped = np.isfinite(attempt.range_error_m)
    fix = attempt.fix
    state = replace(
        state,
        ephemerides=own,
        reason=attempt.reason,
        held_until_s=np.where(tripped, now_s + params.range_test_hold_s, state.held_until_s),
        fix_epoch=(epoch.gps_week, epoch.tow_s) if fix is not None else state.fix_epoch,
        fix_ecef_m=fix.position_m if fix is not None else state.fix_ecef_m,
    )
    return state, fix


def _speed(state: PositionState, epoch: AirborneEpoch, params: AirborneParams) -> Speed:
    """What the own speed is estimated from: the last position if it is recent enough."""
    if state.fix_epoch is not None:
        dt_s = seconds_between(*state.fix_epoch, epoch.gps_week, epoch.tow_s)
        if 0.0 < dt_s <= params.speed_history_s:
            return Speed(previous_ecef_m=state.fix_ecef_m, dt_s=dt_s, otherwise_mps=params.max_speed_mps)
    return Speed(previous_ecef_m=None, dt_s=math.nan, otherwise_mps=params.max_speed_mps)


# --- what is told


def _report(
    before: NDArray[np.int64],
    attempt: PositionResult,
    sources: RangingSources,
    reception: ReceptionState,
    params: AirborneParams,
    log: _Log,
) -> None:
    """An event for each satellite whose reason changed."""
    for index in np.flatnonzero(before != attempt.reason):
        old, new = Rejection(before[index]), Rejection(attempt.reason[index])
        if new is Rejection.NONE:
            log.add(EventKind.READMISSION, SAT_IDS[index], "used")
        elif new not in _SILENT and (new is not Rejection.NOT_TRACKED or old is Rejection.NONE):
            subject, value, threshold = _evidence(int(index), new, attempt, sources, reception, params)
            log.add(EventKind.EXCLUSION, subject, new.name.lower(), value, threshold)


def _evidence(
    index: int,
    reason: Rejection,
    attempt: PositionResult,
    sources: RangingSources,
    reception: ReceptionState,
    params: AirborneParams,
) -> tuple[str, float, float]:
    """Subject, value and threshold of an exclusion; an ephemeris is named by its satellite and issue of data."""
    satellite = SAT_IDS[index]
    station, corrections = reception.station, reception.corrections
    if station is None or corrections is None:
        return satellite, math.nan, math.nan
    iod = corrections.iod[index]
    numbers: dict[Rejection, tuple[float, float]] = {
        Rejection.CORRECTION_AGE: (sources.age_s, params.correction_timeout_s),
        Rejection.B_VALUES: (np.isfinite(corrections.b_m[:, index]).sum(), station.n_receivers),
        Rejection.EPHEMERIS_IOD: (math.nan, iod),
        Rejection.EPHEMERIS_CRC_MISSING: (sources.own_crc[index], math.nan),
        Rejection.EPHEMERIS_CRC_MISMATCH: (sources.own_crc[index], reception.checks.crc[index]),
        Rejection.NOT_SETTLED: (sources.settled_s[index], params.settle_s),
        Rejection.DISTANCE: (attempt.distance_m, station.d_max_m),
        Rejection.ELEVATION: (math.degrees(attempt.elevation_rad[index]), math.degrees(params.elevation_mask_rad)),
        Rejection.RANGE_TEST: (attempt.range_error_m[index], params.range_test_floor_m),
    }
    about_ephemeris = Rejection.EPHEMERIS_IOD <= reason <= Rejection.EPHEMERIS_CRC_MISMATCH
    subject = f"{satellite}/iod{iod:.0f}" if about_ephemeris and math.isfinite(iod) else satellite
    return subject, *numbers.get(reason, (math.nan, math.nan))


def _solution(epoch: AirborneEpoch, reception: ReceptionState, fix: Fix | None) -> SolutionEpoch:
    """The record of an epoch; without a fix what the station told and its age."""
    week, tow_s = epoch.gps_week, epoch.tow_s
    station, corrections = reception.station, reception.corrections
    z_time = (corrections.gps_week, corrections.tow_s) if corrections is not None else None
    told: dict[str, Any] = {
        "correction_age_s": _age_s(z_time, week, tow_s),
        "message_age_s": _age_s(reception.type1_received, week, tow_s),
        "gcid": float(station.gcid) if station is not None else math.nan,
        "k_md_e": station.k_md_e if station is not None else math.nan,
    } | approach_columns(reception.approach)
    if fix is None or corrections is None:
        return SolutionEpoch(gps_week=week, tow_s=tow_s, **told)
    used = fix.used
    b_m = np.where(used, corrections.b_m, np.nan)
    behind = np.isfinite(b_m).sum(axis=0).max()
    return SolutionEpoch(
        gps_week=week,
        tow_s=tow_s,
        x_m=float(fix.position_m[0]),
        y_m=float(fix.position_m[1]),
        z_m=float(fix.position_m[2]),
        clock_m=float(fix.clock_m[0]),
        n_sats=float(used.sum()),
        n_receivers=float(max(behind, 1)),
        d_vert_m=0.0,
        d_lat_m=0.0,
        elevation_rad=fix.elevation_rad,
        azimuth_rad=fix.azimuth_rad,
        s_vert=fix.s_vert,
        s_lat=fix.s_lat,
        sigma_gnd_m=fix.sigma_gnd_m,
        sigma_air_m=fix.sigma_air_m,
        sigma_tropo_m=fix.sigma_tropo_m,
        sigma_iono_m=fix.sigma_iono_m,
        b_m=b_m,
        ephemeris_error_m=np.where(used, fix.distance_m * reception.checks.p, np.nan),
        residual_m=fix.residual_m,
        **told,
        **guidance_columns(reception.approach, fix.position_m),
    )


def _age_s(instant: tuple[int, float] | None, week: int, tow_s: float) -> float:
    return math.nan if instant is None else seconds_between(*instant, week, tow_s)
