"""Fourth stage of an epoch: a tested position of every mode, and what is told about the satellites it is made of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.modes import subject_prefix
from gbas_airborne.navigation.position import PositionInputs, PositionResult, Prior, find_positions
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import Corrected, RangingSources
from gbas_airborne.reception.columns import B_VALUES, IOD
from gbas_airborne.reception.receive import Received
from gbas_airborne.reception.station_data import StationData
from gbas_airborne.reception.vdb_messages import SOURCE
from gbas_core.record import FloatArray
from gbas_core.satellites import SAT_IDS
from gbas_msgs_py.codes import EventKind, Rejection
from gbas_msgs_py.events import Event, EventLog

# Reasons that say nothing about a satellite itself: no event is made of them.
_SILENT: Final = (Rejection.NO_STATION, Rejection.SYSTEM)


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
        Until when the range test holds a satellite [ms]; -inf when it does not.
    """

    fix_ms: int | None = None
    fix_m: FloatArray | None = None
    reason: NDArray[np.int64] = field(default_factory=lambda: np.full(len(SAT_IDS), int(Rejection.NOT_TRACKED)))
    held_until_ms: FloatArray = field(default_factory=lambda: np.full(len(SAT_IDS), -np.inf))


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
    before = {each.mode.number: states.get(each.mode.number) or ModePosition() for each in corrected.sources}
    inputs = [made for each in corrected.sources if (made := _inputs(before[each.mode.number], received, each, params))]
    found: dict[int, PositionResult] = {}
    if inputs and received.station is not None:
        positions = find_positions(inputs, received.station, received.approach, params)
        found = {result.sources.mode.number: result for result in positions}
    results: list[PositionResult] = []
    events: tuple[Event, ...] = ()
    for each in corrected.sources:
        number = each.mode.number
        result = found.get(number) or PositionResult(sources=each, reason=each.reason)
        events += _changes(before[number].reason, result, received, params)
        states[number] = _after(before[number], received, result, params)
        results.append(result)
    return LocateState(modes=states), Located(received=received, results=tuple(results), events=events)


def _inputs(
    before: ModePosition, received: Received, sources: RangingSources, params: AirborneParams
) -> PositionInputs | None:
    """What the position of a mode is made of, without the satellites that are held out; None without corrections."""
    station = received.station
    if station is None or not sources.corrected:
        return None
    held = (sources.reason == int(Rejection.NONE)) & (before.held_until_ms > received.epoch_ms)
    reason = np.where(held, int(Rejection.RANGE_TEST), sources.reason)
    return PositionInputs(sources, reason, _prior(before, received, station, params))


def _prior(before: ModePosition, received: Received, station: StationData, params: AirborneParams) -> Prior:
    """Where to start, and what the own speed is estimated from: the last position if it is recent enough."""
    if before.fix_m is None or before.fix_ms is None:
        return Prior(station.reference_ecef_m, recent=False, dt_s=math.nan)
    dt_s = (received.epoch_ms - before.fix_ms) / 1000.0
    return Prior(before.fix_m, recent=0.0 < dt_s <= params.speed_history_s, dt_s=dt_s)


def _after(before: ModePosition, received: Received, result: PositionResult, params: AirborneParams) -> ModePosition:
    held_until_ms, error_m = before.held_until_ms, result.range_error_m
    if error_m is not None and (tripped := np.isfinite(error_m)).any():
        held_until_ms = np.where(tripped, received.epoch_ms + 1000.0 * params.range_test_hold_s, held_until_ms)
    fix_ms, fix_m = before.fix_ms, before.fix_m
    if result.fix is not None:
        fix_ms, fix_m = received.epoch_ms, result.fix.position_m
    return ModePosition(fix_ms=fix_ms, fix_m=fix_m, reason=result.reason, held_until_ms=held_until_ms)


def _changes(
    before: NDArray[np.int64], result: PositionResult, received: Received, params: AirborneParams
) -> tuple[Event, ...]:
    """An event for each satellite whose reason changed."""
    changed = before != result.reason
    if not changed.any():
        return ()
    prefix = subject_prefix(result.sources.mode.number, params)
    events = EventLog(received.gps_week, received.tow_s, SOURCE)
    for index in np.flatnonzero(changed):
        old, new = Rejection(before[index]), Rejection(result.reason[index])
        if new is Rejection.NONE:
            events.add(EventKind.READMISSION, prefix + SAT_IDS[index], "used")
        elif new not in _SILENT and (new is not Rejection.NOT_TRACKED or old is Rejection.NONE):
            subject, value, threshold = _evidence(int(index), new, result, received, params)
            events.add(EventKind.EXCLUSION, prefix + subject, new.name.lower(), value, threshold)
    return events.all()


def _evidence(
    index: int, reason: Rejection, result: PositionResult, received: Received, params: AirborneParams
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
    }
    about_ephemeris = Rejection.EPHEMERIS_IOD <= reason <= Rejection.EPHEMERIS_CRC_MISMATCH
    subject = f"{satellite}/iod{iod:.0f}" if about_ephemeris and math.isfinite(iod) else satellite
    return subject, *numbers.get(reason, (math.nan, math.nan))


def _at(values: FloatArray | None, index: int) -> float:
    return math.nan if values is None else float(values[index])
