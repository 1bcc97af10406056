"""Fourth stage of an epoch: a tested position of every mode, and what is told about the satellites it is made of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.modes import subject_prefix
from gbas_airborne.navigation.position import PositionInputs, PositionResult, Prior, Withheld, find_positions
from gbas_airborne.navigation.service_d import monitored
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import Corrected, RangingSources
from gbas_airborne.reception.columns import B_VALUES, IOD
from gbas_airborne.reception.receive import Received
from gbas_airborne.reception.station_data import StationData
from gbas_airborne.reception.vdb_messages import SOURCE
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import SAT_IDS
from gbas_msgs_py.codes import EventKind, Rejection, ServiceCause, ServiceType
from gbas_msgs_py.events import Event, EventLog

# Reasons that say nothing about a satellite itself: no event is made of them.
_SILENT: Final = (Rejection.NO_STATION, Rejection.SYSTEM)
_LEFT_OUT: Final = (Rejection.DUAL_SOLUTION, Rejection.RECEIVER_FAULT)
STEP_IN: Final = "step_in"


@dataclass(frozen=True, kw_only=True, eq=False)
class ModePosition:
    """What a mode remembers of its positions.

    Attributes
    ----------
    fix_ms, fix_m
        When the last position was [ms since the start of GPS time], and where [m].
    reason : (N_SATS,) int array
        Why each satellite was not used in the last epoch with observations (Rejection).
    held_until_ms : (N_SATS,) array
        Until when a satellite is held out [ms]; -inf when it is not.
    held_reason : (N_SATS,) int array
        Why.
    usable_since_ms : (N_SATS,) array
        Since when it could be used without interruption [ms]; inf when it cannot.
    withheld : Withheld or None
        What stood against the position.
    """

    fix_ms: int | None = None
    fix_m: FloatArray | None = None
    reason: NDArray[np.int64] = field(default_factory=lambda: np.full(len(SAT_IDS), int(Rejection.NOT_TRACKED)))
    held_until_ms: FloatArray = field(default_factory=lambda: np.full(len(SAT_IDS), -np.inf))
    held_reason: NDArray[np.int64] = field(default_factory=lambda: np.full(len(SAT_IDS), int(Rejection.NONE)))
    usable_since_ms: FloatArray = field(default_factory=lambda: np.full(len(SAT_IDS), np.inf))
    withheld: Withheld | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LocateState:
    """What this stage remembers, by the number of the mode."""

    modes: Mapping[int, ModePosition] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Located:
    """What was received, and what became of the search for a position in each mode.

    Attributes
    ----------
    received : Received
    results : tuple of PositionResult
        One a mode.
    events : tuple of Event
        What happened in this stage.
    """

    received: Received
    results: tuple[PositionResult, ...]
    events: tuple[Event, ...]


def locate(state: LocateState, corrected: Corrected, params: AirborneParams) -> tuple[LocateState, Located]:
    """A position of every mode, of its ranging sources."""
    received, states = corrected.received, dict(state.modes)
    before = {
        each.mode.number: _with_usable(states.get(each.mode.number) or ModePosition(), each, received)
        for each in corrected.sources
    }
    inputs = [made for each in corrected.sources if (made := _inputs(before[each.mode.number], received, each, params))]
    found = _found(inputs, received, params)
    results: list[PositionResult] = []
    events: tuple[Event, ...] = ()
    for each in corrected.sources:
        number = each.mode.number
        result = found.get(number) or PositionResult(sources=each, reason=each.reason)
        events += _changes(before[number], result, received, params)
        states[number] = _after(before[number], received, result, params)
        results.append(result)
    return LocateState(modes=states), Located(received=received, results=tuple(results), events=events)


def _found(inputs: list[PositionInputs], received: Received, params: AirborneParams) -> dict[int, PositionResult]:
    """Positions of the modes that have corrections, as their monitors leave them."""
    station = received.station
    if not inputs or station is None:
        return {}
    solve = partial(find_positions, station=station, approach=received.approach, params=params)
    found: dict[int, PositionResult] = {}
    for each, result in zip(inputs, solve(inputs), strict=True):
        mode = each.sources.mode
        if mode.monitors:
            result = monitored(result, each, received.approach, solve, params)
        if mode.service is ServiceType.D and (missing_part := _not_for_service_d(station, params)):
            result = replace(result, fix=None, withheld=missing_part, failed=missing_part)
        found[mode.number] = result
    return found


def _not_for_service_d(station: StationData, params: AirborneParams) -> Withheld | None:
    """What a station lacks that GAST-D cannot do without."""
    if not math.isfinite(station.k_md_e_d + station.sigma_vig_d):
        return Withheld(ServiceCause.NO_SERVICE_D_DATA, math.nan, math.nan)
    if params.gast_d.require_authentication and not (params.authentication and station.slots):
        return Withheld(ServiceCause.NOT_AUTHENTICATED, math.nan, math.nan)
    return None


def _with_usable(before: ModePosition, sources: RangingSources, received: Received) -> ModePosition:
    """The memory with the time since which each satellite is usable, where the mode needs it."""
    if STEP_IN not in sources.mode.monitors:
        return before
    usable = sources.reason == int(Rejection.NONE)
    since_ms = np.where(usable, np.minimum(before.usable_since_ms, received.epoch_ms), np.inf)
    return replace(before, usable_since_ms=since_ms)


def _inputs(
    before: ModePosition, received: Received, sources: RangingSources, params: AirborneParams
) -> PositionInputs | None:
    """What the position of a mode is made of, without the satellites that are held out; None without corrections."""
    station = received.station
    if station is None or not sources.corrected:
        return None
    held = (sources.reason == int(Rejection.NONE)) & (before.held_until_ms > received.epoch_ms)
    reason = np.where(held, before.held_reason, sources.reason)
    if STEP_IN in sources.mode.monitors:
        early = received.epoch_ms - before.usable_since_ms < 1000.0 * params.gast_d.step_in_s
        reason = np.where((reason == int(Rejection.NONE)) & early, int(Rejection.STEP_IN), reason)
    return PositionInputs(sources, reason, _prior(before, received, station, params))


def _prior(before: ModePosition, received: Received, station: StationData, params: AirborneParams) -> Prior:
    """Where to start, and what the own speed is estimated from: the last position if it is recent enough."""
    if before.fix_m is None or before.fix_ms is None:
        return Prior(station.reference_ecef_m, recent=False, dt_s=math.nan)
    dt_s = (received.epoch_ms - before.fix_ms) / 1000.0
    return Prior(before.fix_m, recent=0.0 < dt_s <= params.speed_history_s, dt_s=dt_s)


def _after(before: ModePosition, received: Received, result: PositionResult, params: AirborneParams) -> ModePosition:
    until_ms, reason = before.held_until_ms, before.held_reason
    held: list[tuple[BoolArray, float]] = []
    if result.range_error_m is not None and (tripped := np.isfinite(result.range_error_m)).any():
        held.append((tripped, params.range_test_hold_s))
    if result.failed is not None:
        left_out = np.isin(result.reason, _LEFT_OUT) & (until_ms <= received.epoch_ms)
        held.append((left_out, params.gast_d.exclusion_hold_s))
    for which, hold_s in held:
        until_ms = np.where(which, received.epoch_ms + 1000.0 * hold_s, until_ms)
        reason = np.where(which, result.reason, reason)
    fix_ms, fix_m = before.fix_ms, before.fix_m
    if result.fix is not None:
        fix_ms, fix_m = received.epoch_ms, result.fix.position_m
    return replace(
        before,
        fix_ms=fix_ms,
        fix_m=fix_m,
        reason=result.reason,
        held_until_ms=until_ms,
        held_reason=reason,
        withheld=result.withheld,
    )


def _changes(
    before: ModePosition, result: PositionResult, received: Received, params: AirborneParams
) -> tuple[Event, ...]:
    """An event for each satellite whose reason changed, and one when another cause, or none, withholds the position."""
    changed = before.reason != result.reason
    old_cause, new_cause = (each.cause if each else None for each in (before.withheld, result.withheld))
    if not changed.any() and old_cause is new_cause:
        return ()
    prefix = subject_prefix(result.sources.mode.number, params)
    events = EventLog(received.gps_week, received.tow_s, SOURCE)
    for index in np.flatnonzero(changed):
        old, new = Rejection(before.reason[index]), Rejection(result.reason[index])
        if new is Rejection.NONE:
            events.add(EventKind.READMISSION, prefix + SAT_IDS[index], "used")
        elif new not in _SILENT and (new is not Rejection.NOT_TRACKED or old is Rejection.NONE):
            subject, value, threshold = _evidence(int(index), new, result, before, received, params)
            events.add(EventKind.EXCLUSION, prefix + subject, new.name.lower(), value, threshold)
    if old_cause is not new_cause:
        if result.withheld is None:
            events.add(EventKind.READMISSION, prefix + "position", "used")
        else:
            events.add(EventKind.EXCLUSION, prefix + "position", result.withheld.cause.word, *result.withheld[1:])
    return events.all()


def _evidence(
    index: int,
    reason: Rejection,
    result: PositionResult,
    before: ModePosition,
    received: Received,
    params: AirborneParams,
) -> tuple[str, float, float]:
    """Subject, value and threshold of an exclusion; an ephemeris is named by its satellite and issue of data."""
    satellite, sources = SAT_IDS[index], result.sources
    station, iod = received.station, float(sources.applied[IOD, index])
    if station is None or not sources.corrected:
        return satellite, math.nan, math.nan
    numbers: dict[Rejection, tuple[float, float]] = {
        Rejection.CORRECTION_AGE: (sources.age_s, params.correction_timeout_s),
        Rejection.B_VALUES: (np.isfinite(sources.applied[B_VALUES:, index]).sum(), station.n_receivers),
        Rejection.EPHEMERIS_IOD: (math.nan, iod),
        Rejection.EPHEMERIS_CRC_MISSING: (sources.own_crc[index], math.nan),
        Rejection.EPHEMERIS_CRC_MISMATCH: (sources.own_crc[index], received.checks.crc[index]),
        Rejection.NOT_SETTLED: (sources.settled_s[index], params.settle_s),
        Rejection.DISTANCE: (result.distance_m, station.d_max_m),
        Rejection.ELEVATION: (
            math.degrees(_at(result.elevation_rad, index)),
            math.degrees(params.elevation_mask_rad),
        ),
        Rejection.RANGE_TEST: (_at(result.range_error_m, index), params.range_test_floor_m),
        Rejection.DIVERGENCE: (abs(float(sources.divergence_mps[index])), params.gast_d.divergence_mps),
        Rejection.STEP_IN: (
            (received.epoch_ms - float(before.usable_since_ms[index])) / 1000.0,
            params.gast_d.step_in_s,
        ),
    }
    if reason in _LEFT_OUT and result.failed is not None:
        return satellite, *result.failed[1:]
    about_ephemeris = Rejection.EPHEMERIS_IOD <= reason <= Rejection.EPHEMERIS_CRC_MISMATCH
    subject = f"{satellite}/iod{iod:.0f}" if about_ephemeris and math.isfinite(iod) else satellite
    return subject, *numbers.get(reason, (math.nan, math.nan))


def _at(values: FloatArray | None, index: int) -> float:
    return math.nan if values is None else float(values[index])
