"""Receive: what arrived for the epoch, in the order of time; ephemerides in force, and what has been excluded long
enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, seconds_between
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import BoolArray
from gbas_ground.channels import ephemerides
from gbas_ground.channels.ephemerides import EphemerisState
from gbas_ground.channels.tracking import RawEpoch, stack
from gbas_ground.consistency import Exclusions
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.exclusion import released
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import EventLog

SOURCE: Final = "ground_station"


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundEpoch:
    """Everything that arrived for one epoch.

    Attributes
    ----------
    gps_week, tow_s
        The epoch.
    observations : tuple of ObservationEpoch or None
        One place a reference receiver; None where nothing arrived.
    ephemerides : tuple of Ephemeris
        Received since the epoch before.
    """

    gps_week: int
    tow_s: float
    observations: tuple[ObservationEpoch | None, ...]
    ephemerides: tuple[Ephemeris, ...] = ()


class Now(NamedTuple):
    """The epoch in work.

    Attributes
    ----------
    gps_week, tow_s
    epoch_ms : int
        The same [ms since the start of GPS time].
    dt_s : float
        Time since the epoch before; NaN at the first [s].
    events : EventLog
        What has happened in it so far.
    """

    gps_week: int
    tow_s: float
    epoch_ms: int
    dt_s: float
    events: EventLog


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceiveState:
    """Memory of this stage.

    Attributes
    ----------
    last_ms : int or None
        Epoch before [ms since the start of GPS time].
    ephemerides : EphemerisState
    present : (R,) bool array
        Receivers that delivered the epoch before.
    exclusions : Exclusions
        As they were left.
    """

    last_ms: int | None
    ephemerides: EphemerisState
    present: BoolArray
    exclusions: Exclusions


class Received(NamedTuple):
    """Record of this stage.

    Attributes
    ----------
    now : Now
    raw : RawEpoch
        Observations of all receivers.
    known : EphemerisState
        Ephemerides, and those in force.
    before : Ephemeris
        Those in force at the epoch before.
    changed : (N,) bool array
        Satellites whose ephemeris is another.
    exclusions : Exclusions
    """

    now: Now
    raw: RawEpoch
    known: EphemerisState
    before: Ephemeris
    changed: BoolArray
    exclusions: Exclusions


def receive(
    state: ReceiveState, epoch: GroundEpoch, events: EventLog, station: PreparedStation
) -> tuple[ReceiveState, Received]:
    """Ephemerides and observations of an epoch that is in order; `events` goes along with it."""
    epoch_ms = epoch_key(epoch.gps_week, epoch.tow_s)
    dt_s = float("nan") if state.last_ms is None else (epoch_ms - state.last_ms) / 1000.0
    now = Now(epoch.gps_week, epoch.tow_s, epoch_ms, dt_s, events)
    known, changed = _ephemerides(state.ephemerides, epoch, station, events)
    raw = stack(_of_this_epoch(epoch, events), station.satellites)
    for row in np.flatnonzero(raw.present != state.present):
        events.add(EventKind.INPUT, f"rr{row + 1}", "back" if raw.present[row] else "missing")
    exclusions = released(state.exclusions, station.params, events)
    received = Received(now, raw, known, state.ephemerides.current, changed, exclusions)
    return replace(state, last_ms=epoch_ms, ephemerides=known, present=raw.present), received


def _ephemerides(
    known: EphemerisState, epoch: GroundEpoch, station: PreparedStation, events: EventLog
) -> tuple[EphemerisState, BoolArray]:
    for received in epoch.ephemerides:
        known, refused = ephemerides.receive(known, received, epoch.gps_week, epoch.tow_s, station.params)
        events.extend(refused)
    known, changed, changes = ephemerides.choose(known, epoch.gps_week, epoch.tow_s, station.params)
    events.extend(changes)
    return known, changed


def _of_this_epoch(epoch: GroundEpoch, events: EventLog) -> tuple[ObservationEpoch | None, ...]:
    """The observations; one that carries another epoch does not count."""
    result: list[ObservationEpoch | None] = []
    for row, each in enumerate(epoch.observations):
        if each is not None and not each.is_of(epoch.gps_week, epoch.tow_s):
            late_s = seconds_between(epoch.gps_week, epoch.tow_s, each.gps_week, each.tow_s)
            events.add(EventKind.INPUT, f"rr{row + 1}", "wrong_epoch", late_s, 0.0)
            result.append(None)
        else:
            result.append(each)
    return tuple(result)
