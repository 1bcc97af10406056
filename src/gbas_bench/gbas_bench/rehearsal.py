"""A first run of everything an epoch takes, so that what it compiles is there when it counts: ``make setup``.

Station and aircraft are rehearsed side by side. The aircraft needs bursts to begin with: they are made without
compiling anything, which is slow, but sooner than a compiled station is ready.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from typing import Any, Final

from gbas_airborne.receiver import AirborneReceiver, PositionState
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_airborne.service import ServiceState
from gbas_bench.offline import Flight, make_flight
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.record import Record
from gbas_ground.ionosphere.position_errors import compile_ahead
from gbas_ground.station import GroundEpoch, GroundStation
from gbas_msgs_py import tables
from gbas_vdb.transmission.burst import Burst

N_EPOCHS: Final = 30
_SETTLE_S: Final = 3.0


def short_flight() -> Flight:
    """The benchmark's flight with filters that settle at once."""
    flight = make_flight(N_EPOCHS)
    ground = flight.ground
    return replace(
        flight,
        ground=replace(
            ground,
            smoothing=replace(ground.smoothing, settle_time_s=_SETTLE_S),
            ephemeris=replace(ground.ephemeris, settle_s=_SETTLE_S),
        ),
        airborne=replace(flight.airborne, settle_s=_SETTLE_S),
    )


def station(flight: Flight, *, messages: bool) -> list[tuple[Burst, ...]]:
    """Step the station; its bursts epoch by epoch."""
    ground = GroundStation(flight.ground)
    state, sent = ground.initial_state(), []
    for number, epoch in enumerate(flight.epochs):
        week, tow_s = from_epoch_key(epoch.key)
        ephemerides = () if number else (flight.ephemeris,)
        seen = GroundEpoch(gps_week=week, tow_s=tow_s, observations=epoch.ground, ephemerides=ephemerides)
        state, made, bursts = ground.step(state, seen)
        sent.append(bursts)
        if messages:
            _there_and_back(tables.OBSERVATIONS, epoch.ground[0])
            _there_and_back(tables.INTEGRITY, made.integrity)
            _there_and_back(tables.CHANNELS, made.channels)
            _there_and_back(tables.MONITORS, made.statistics)
            _there_and_back(tables.MONITOR_DETAILS, made.details)
            _there_and_back(tables.EPHEMERIS, flight.ephemeris)
    return sent


def aircraft(flight: Flight, sent: list[tuple[Burst, ...]]) -> int:
    """Step the aircraft; at how many epochs it had protection levels."""
    position, service, protected = PositionState(), ServiceState(), 0
    for number, (epoch, bursts) in enumerate(zip(flight.epochs, sent, strict=True)):
        week, tow_s = from_epoch_key(epoch.key)
        heard = AirborneEpoch(
            gps_week=week, tow_s=tow_s, observations=epoch.user, bursts=bursts,
            ephemerides=() if number else (flight.ephemeris,),
        )  # fmt: skip
        position, selected = AirborneReceiver.position(position, heard, flight.airborne)
        service, protection, _ = AirborneReceiver.protect(service, selected.solutions[0], flight.airborne)
        _there_and_back(tables.SOLUTION, selected.solutions[0])
        _there_and_back(tables.PROTECTION, protection)
        protected += protection.vpl_m < float("inf")
    return protected


def _there_and_back(schema: Any, record: Record | None) -> None:
    table = schema.encode(record)
    schema.decode(schema.label_of(table), table)


def _process(part: str, given: Any, **environment: str) -> subprocess.Popen[bytes]:
    """A process of this module that does one part with what it is given."""
    process = subprocess.Popen(
        [sys.executable, "-m", "gbas_bench.rehearsal", part], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, **environment},
    )  # fmt: skip
    assert process.stdin is not None
    with process.stdin as pipe:
        pickle.dump(given, pipe)
    return process


def _made(process: subprocess.Popen[bytes]) -> Any:
    """What a process made."""
    with process:
        assert process.stdout is not None
        made = process.stdout.read()
    if process.returncode:
        sys.exit(process.returncode)
    return pickle.loads(made)


def main(part: str = "") -> None:
    """Rehearse the station here and the aircraft in another process; exit code 1 when anything does not work."""
    if part:
        flight: Flight = pickle.load(sys.stdin.buffer)
        if part == "bursts":
            made: Any = station(flight, messages=False)
        else:
            made = aircraft(flight, _made(_process("bursts", flight, NUMBA_DISABLE_JIT="1")))
        sys.stdout.buffer.write(pickle.dumps(made))
        return
    flight = short_flight()
    other = _process("aircraft", flight)
    compile_ahead()
    station(flight, messages=True)
    if not _made(other):
        sys.exit("the rehearsal gave no protection level")


if __name__ == "__main__":
    main(*sys.argv[1:])
