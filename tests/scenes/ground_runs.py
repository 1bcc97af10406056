"""Runs of a ground station on made-up observations, shared by the ground tests."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import add_seconds
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.parameters import made_of
from gbas_core.record import FloatArray
from gbas_ground.params import GroundParams
from gbas_ground.station import GroundEpoch, GroundStation, StationState, initial_state
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import ChannelEpoch, IntegrityEpoch, MonitorEpoch
from gbas_vdb.transmission.burst import Burst
from synthetic_ranges import HEIGHT_M, LATITUDE_RAD, LONGITUDE_RAD, TOW_S, WEEK, Truth, receiver_positions_m

Observed = tuple[ObservationEpoch | None, ...]
Change = Callable[[float, Observed], Observed]
"""What a test does to the observations, given the seconds since the start."""


def receiver_values(positions_m: FloatArray) -> dict[str, Any]:
    """Antennas as parameters, by their names."""
    return {f"receivers.rr{row}_ecef_m": tuple(place) for row, place in enumerate(positions_m.tolist(), start=1)}


def params(receivers: int = 4, **changes: Any) -> GroundParams:
    """A healthy station with quick filters; `changes` are fields, ``section__name``, or sections."""
    chosen: dict[str, Any] = {
        "station.id": "TEST",
        "station.latitude_rad": float(LATITUDE_RAD),
        "station.longitude_rad": float(LONGITUDE_RAD),
        "station.height_m": HEIGHT_M,
        "station.gcid": 1,
        "station.systems": "GE",
        **receiver_values(receiver_positions_m(receivers)),
        "receivers.minimum": min(2, receivers),
        "vdb.slots": "AB",
        "smoothing.settle_time_s": 5.0,
        "monitors.readmission_time_s": 10.0,
    }
    return made_of(GroundParams, chosen | {name.replace("__", "."): value for name, value in changes.items()})


@dataclass
class Run:
    """What came out, epoch by epoch."""

    seconds: list[float]
    integrity: list[IntegrityEpoch]
    statistics: list[MonitorEpoch]
    channels: list[ChannelEpoch]
    bursts: list[tuple[Burst, ...]]
    events: list[Event]
    state: StationState

    def array(self, name: str) -> FloatArray:
        """A field of the integrity epochs, epochs first."""
        return np.array([getattr(each, name) for each in self.integrity])

    def told(self, cause: str) -> list[tuple[float, str, str]]:
        """Seconds since the start, kind and subject of the events of a cause."""
        return [(event.tow_s - TOW_S, str(event.kind), event.subject) for event in self.events if event.cause == cause]


def run(
    world: Truth,
    station: GroundParams,
    seconds: Iterable[float],
    *,
    code_error_m: Callable[[float], FloatArray | float] = lambda second: 0.0,
    carrier_error_m: Callable[[float], FloatArray | float] | None = None,
    change: Change = lambda second, observed: observed,
    ephemerides: dict[float, tuple[Ephemeris, ...]] | None = None,
    start: tuple[int, float] = (WEEK, TOW_S),
    state: StationState | None = None,
) -> Run:
    """Step a station through epochs at `seconds` since the start.

    The constellation counts as received long before the start, unless `ephemerides` says what is received when.
    """
    received = {0.0: (_earlier(world.ephemeris),)} if ephemerides is None else ephemerides
    result = Run([], [], [], [], [], [], initial_state(station) if state is None else state)
    for second in seconds:
        week, tow_s = add_seconds(*start, second)
        carrier = None if carrier_error_m is None else carrier_error_m(second)
        observed = world.observe(week, tow_s, code_error_m=code_error_m(second), carrier_error_m=carrier)
        epoch = GroundEpoch(
            gps_week=week,
            tow_s=tow_s,
            observations=change(second, observed),
            ephemerides=received.get(second, ()),
        )
        result.state, monitored, bursts = GroundStation.step(result.state, epoch, station)
        result.seconds.append(second)
        result.integrity.append(monitored.integrity)
        result.statistics.append(monitored.statistics)
        result.channels.append(monitored.channels)
        result.bursts.append(bursts)
        result.events.extend(monitored.events)
    return result


def _earlier(ephemeris: Ephemeris) -> Ephemeris:
    """The same, received 1000 s before."""
    week, tow_s = add_seconds(ephemeris.gps_week, ephemeris.tow_s, -1000.0)
    values = {name: getattr(ephemeris, name) for name in ephemeris.__dataclass_fields__}
    return Ephemeris(**(values | {"gps_week": week, "tow_s": tow_s}))


def half_seconds(count: int, first: float = 0.0) -> FloatArray:
    """`count` epochs at 2 Hz."""
    return first + 0.5 * np.arange(count)
