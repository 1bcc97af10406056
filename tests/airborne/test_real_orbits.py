"""The receiver on broadcast ephemerides as recorded, with a station and an aircraft made for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airborne_world import Flight, World, position_of
from gbas_airborne.params import AirborneParams
from gbas_core.gnss.ephemeris import Ephemeris, EphemerisStore
from gbas_core.gnss.gpstime import gps_from_calendar, seconds_between
from gbas_core.io.rinex import read_navigation
from gbas_core.satellites import SAT_IDS, SAT_INDEX
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs

PARAMS = AirborneParams(settle_s=5.0, inflate_unsettled=False)
DURATION_S = 12.0


def ephemeris_at(path: Path, week: int, tow_s: float) -> Ephemeris:
    """The ephemerides valid at a time, as a receiver that is on for hours has them."""
    store = EphemerisStore()
    for received in read_navigation([path]).received(week, tow_s):
        if seconds_between(received.gps_week, received.tow_s, week, tow_s) >= 0.0:
            store = store.add(received)
    return store.usable(week, tow_s, 0.0)


def flown(world: World) -> Flight:
    flight = Flight(world, PARAMS)
    flight.run(0.0, DURATION_S)
    return flight


def error_m(flight: Flight) -> float:
    t = DURATION_S - 0.5
    place = flight.world.path(t - flight.world.clock_m(t) / SPEED_OF_LIGHT_MPS)
    return float(np.linalg.norm(position_of(flight.solutions[-1]) - place))


def recorded_world(truth: Ephemeris, week: int, tow_s: float, **ends: Ephemeris) -> World:
    """A world of recorded satellites that have a CRC at either end."""
    world = World(truth=truth, week=week, start_s=tow_s, **ends)
    world.satellites = [s for s in world.satellites if np.isfinite(ephemeris_crcs(world.station)[s])]
    return world


@pytest.mark.parametrize("hour", [3, 12, 21])
def test_gps_and_galileo_of_2026(data_dir: Path, hour: int) -> None:
    """A day's merged navigation file: every satellite of both constellations."""
    week, tow_s = gps_from_calendar(2026, 3, 9, hour, 0, 0.0)
    (path,) = (data_dir / "nav_rinex4_2026").iterdir()
    world = recorded_world(ephemeris_at(path, week, tow_s), week, tow_s)
    assert {SAT_IDS[s][0] for s in world.satellites} == {"G", "E"}
    world.satellites = world.satellites[:9] + world.satellites[-8:]  # one message holds them
    flight = flown(world)
    assert flight.solutions[-1].n_sats == len(set(world.satellites))
    assert error_m(flight) < 1e-3
    assert flight.protections[-1].alert == 0.0


def test_recorded_ephemeris_fault_is_caught(data_dir: Path) -> None:
    """`brdc0770.10nERR`: Cuc of G17 at 20:00 changed, 2.4 km along track, the same issue of data.

    The changed value is larger than the message can carry, so that the aircraft's CRC does not even exist.
    """
    folder = data_dir / "static_pair_L1L2_1h_2010"
    week, tow_s = gps_from_calendar(2010, 3, 18, 19, 30, 0.0)
    right = ephemeris_at(folder / "brdc0770.10n.gz", week, tow_s)
    wrong = ephemeris_at(folder / "brdc0770.10nERR.gz", week, tow_s)
    victim = SAT_INDEX["G17"]
    assert right.iod[victim] == wrong.iod[victim]
    assert right.cuc_rad[victim] != wrong.cuc_rad[victim]
    received = replace(wrong, tow_s=tow_s - 600.0)
    world = recorded_world(right, week, tow_s, aircraft=received)
    if victim not in world.satellites:
        world.satellites.append(victim)
    flight = flown(world)
    assert all(not np.isfinite(solution.s_vert[victim]) for solution in flight.solutions)
    found = [e for e in flight.events if e.cause == "ephemeris_crc_mismatch"]
    assert [e.subject for e in found] == [f"G17/iod{right.iod[victim]:.0f}"]
    assert found[0].threshold == ephemeris_crcs(right)[victim]
    assert found[0].value != found[0].threshold
    assert error_m(flight) < 1e-3
