"""Which ephemeris the station corrects with, and how it changes from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris, EphemerisStore
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS, missing
from gbas_ground.monitors.ephemeris_change import check_ephemeris_change
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event, EventLog
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs

SOURCE = "ephemerides"


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisState:
    """Ephemerides received, the ones in use, and their CRCs ``(N,)``."""

    store: EphemerisStore
    current: Ephemeris
    crc: FloatArray


def initial_ephemerides() -> EphemerisState:
    """Nothing received."""
    return EphemerisState(store=EphemerisStore(), current=Ephemeris(gps_week=0, tow_s=0.0), crc=missing())


def _only(ephemeris: Ephemeris, satellites: BoolArray) -> Ephemeris:
    """The ephemerides of some satellites."""
    masked: dict[str, Any] = {
        item.name: np.where(satellites, value, np.nan)
        for item in fields(ephemeris)
        if isinstance(value := getattr(ephemeris, item.name), np.ndarray)
    }
    return replace(ephemeris, **masked)


def receive(
    state: EphemerisState, new: Ephemeris, gps_week: int, tow_s: float, params: GroundParams
) -> tuple[EphemerisState, tuple[Event, ...]]:
    """Store newly received ephemerides, but for those that do not continue the ones before."""
    old = state.store.usable(gps_week, tow_s, 0.0)
    check = check_ephemeris_change(new, old, gps_week, tow_s, params.ephemeris.max_change_m)
    events = EventLog(gps_week, tow_s, SOURCE)
    for satellite in map(int, np.flatnonzero(check.failed)):
        events.add(EventKind.INPUT, SAT_IDS[satellite], "ephemeris_change", *check.at(satellite))
    accepted = _only(new, ~check.failed) if check.failed.any() else new
    return replace(state, store=state.store.add(accepted)), events.all()


def choose(
    state: EphemerisState, gps_week: int, tow_s: float, params: GroundParams
) -> tuple[EphemerisState, BoolArray, tuple[Event, ...]]:
    """Ephemerides to use now.

    Returns
    -------
    state : EphemerisState
    changed : (N,) bool array
        Satellites whose ephemeris is another than at the epoch before.
    events : tuple of Event
        The changes from one ephemeris to the next, with the new issue of data as value.
    """
    current, before = state.store.usable(gps_week, tow_s, params.ephemeris.settle_s), state.current
    if current is before:
        return state, np.zeros(N_SATS, dtype=bool), ()
    # A record that differs anywhere is another one, under the same issue of data too: the CRC must tell the aircraft.
    present, was_present = np.isfinite(current.message), np.isfinite(before.message)
    changed = present & ~current.same_as(before)
    crc = np.where(present, state.crc, np.nan)
    events = EventLog(gps_week, tow_s, SOURCE)
    if changed.any():
        crc = np.where(changed, ephemeris_crcs(_only(current, changed)), crc)
        for satellite in map(int, np.flatnonzero(changed & was_present)):
            events.add(EventKind.STATION, SAT_IDS[satellite], "new_ephemeris", float(current.iod[satellite]))
    return EphemerisState(store=state.store, current=current, crc=crc), changed, events.all()
