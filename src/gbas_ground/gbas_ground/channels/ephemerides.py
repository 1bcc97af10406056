"""Which ephemeris the station corrects with, and how it changes from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gbas_core.gnss.ephemeris import FIELDS, Ephemeris, EphemerisStore
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import SAT_IDS, missing
from gbas_ground.monitors.ephemeris_change import check_ephemeris_change
from gbas_ground.params import GroundParams
from gbas_msgs_py.events import Event, EventKind
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs

SOURCE = "ephemerides"


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisState:
    """Ephemerides received, the ones in use, what tells these from others, and their CRCs ``(N,)``."""

    store: EphemerisStore
    current: Ephemeris
    identity: FloatArray
    crc: FloatArray


def initial_ephemerides() -> EphemerisState:
    """Nothing received."""
    none = Ephemeris(gps_week=0, tow_s=0.0)
    return EphemerisState(store=EphemerisStore(), current=none, identity=_identity(none), crc=missing())


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
    events = tuple(
        Event(
            gps_week=gps_week, tow_s=tow_s, kind=EventKind.INPUT, subject=SAT_IDS[satellite],
            cause="ephemeris_change", value=check.at(satellite)[0], threshold=check.at(satellite)[1], source=SOURCE,
        )
        for satellite in map(int, np.flatnonzero(check.failed))
    )  # fmt: skip
    accepted = _only(new, ~check.failed) if events else new
    return replace(state, store=state.store.add(accepted)), events


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
    current = state.store.usable(gps_week, tow_s, params.ephemeris.settle_s)
    before, now = state.identity, _identity(current)
    present, was_present = np.isfinite(current.message), np.isfinite(state.current.message)
    # A record that differs anywhere is another one, under the same issue of data too: the CRC must tell the aircraft.
    same = ((before == now) | (np.isnan(before) & np.isnan(now))).all(axis=0)
    changed = present & ~same
    crc = np.where(present, state.crc, np.nan)
    events: tuple[Event, ...] = ()
    if changed.any():
        crc = np.where(changed, ephemeris_crcs(_only(current, changed)), crc)
        events = tuple(
            Event(
                gps_week=gps_week, tow_s=tow_s, kind=EventKind.STATION, subject=SAT_IDS[satellite],
                cause="new_ephemeris", value=float(current.iod[satellite]), source=SOURCE,
            )
            for satellite in map(int, np.flatnonzero(changed & was_present))
        )  # fmt: skip
    return EphemerisState(store=state.store, current=current, identity=now, crc=crc), changed, events


def _identity(ephemeris: Ephemeris) -> FloatArray:
    """All fields of all satellites, ``(n_fields, N)``."""
    return np.array([getattr(ephemeris, name) for name in FIELDS])
