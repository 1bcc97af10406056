"""Satellites in view: attitudes turned about axes by hand, a day level, turns, what hides, what is not known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_airborne.abia.airframe.aircraft import aircraft_of
from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.terrain.elevation_tile import ElevationError, ElevationTile
from gbas_airborne.abia.visibility.geometry import dilution
from gbas_airborne.abia.visibility.satellites_in_view import HiddenBy, Path, satellites_in_view
from gbas_core.gnss.almanac import ephemeris_from_almanac, read_almanac
from gbas_core.gnss.attitude import body_azimuth_elevation, euler_angles, rot_euler
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.satellites import N_SATS

LAT, LON = math.radians(48.0), math.radians(11.0)


def almanac(data_dir):
    return ephemeris_from_almanac(read_almanac(data_dir / "almanacs" / "test_input_yuma377.txt", near_week=1401))


def path(ephemeris, since_s, *, roll=0.0, heading=0.0, height_m=3000.0) -> Path:
    """Over one place: what is seen depends on time and attitude alone."""
    since_s = np.asarray(since_s, dtype=np.float64)
    return Path(
        gps_week=int(ephemeris.gps_week),
        tow_s=float(ephemeris.tow_s) + since_s,
        position_m=np.broadcast_to(ecef_from_geodetic(LAT, LON, height_m), (len(since_s), 3)),
        roll_rad=np.broadcast_to(np.asarray(roll, dtype=np.float64), since_s.shape),
        pitch_rad=np.zeros_like(since_s),
        heading_rad=np.broadcast_to(np.asarray(heading, dtype=np.float64), since_s.shape),
    )


def fighter_mask() -> MaskTable:
    aircraft = aircraft_of("fighter")
    return MaskTable.of_mesh(aircraft.airframe, aircraft.antenna("upper").place_m)


@pytest.mark.parametrize("seed", range(4))
def test_attitude_turns_about_down_right_and_forward(seed):
    """The other way: rotations about single axes, heading first."""
    roll, pitch, heading = np.random.default_rng(seed).uniform(-1.4, 1.4, 3)

    def about(axis: int, angle: float) -> np.ndarray:
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = math.cos(angle)
        turn[first, second], turn[second, first] = math.sin(angle), -math.sin(angle)
        return turn

    north_east_down = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    expected = about(0, roll) @ about(1, pitch) @ about(2, heading) @ north_east_down
    np.testing.assert_allclose(rot_euler(roll, pitch, heading), expected, atol=1e-12)
    found = euler_angles(rot_euler(roll, pitch, heading))
    np.testing.assert_allclose(found, [roll, pitch, heading % (2.0 * math.pi)], atol=1e-12)


def test_body_directions_by_hand():
    """Heading east: north is left, east ahead; banked to the right by 30 degrees the left wing is 30 above it."""
    los = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # north, east, up
    azimuth, elevation = body_azimuth_elevation(rot_euler(0.0, 0.0, 0.5 * math.pi), los)
    np.testing.assert_allclose(azimuth[:2], [-0.5 * math.pi, 0.0], atol=1e-12)
    np.testing.assert_allclose(elevation, [0.0, 0.0, 0.5 * math.pi], atol=1e-7)
    _, banked = body_azimuth_elevation(rot_euler(math.radians(30.0), 0.0, 0.5 * math.pi), los)
    np.testing.assert_allclose(banked, np.radians([-30.0, 0.0, 60.0]), atol=1e-12)


def test_level_flight_for_a_day_keeps_its_satellites(data_dir):
    """Full constellation, straight and level: never less than 4 in view, always a position."""
    ephemeris = almanac(data_dir)
    since_s = np.arange(0.0, 86_400.0, 300.0)
    seen = satellites_in_view(ephemeris, path(ephemeris, since_s, heading=since_s / 86_400.0 * 6.2), fighter_mask())
    count = seen.in_view.sum(axis=1)
    assert count.min() >= 4
    assert np.isfinite(dilution(seen.los_enu, seen.in_view).pdop).all()


def test_a_steady_turn_hides_a_satellite_once_a_turn(data_dir):
    """What goes out of sight, behind the antenna's horizon or the fin, does so again after 360 degrees of turn."""
    ephemeris = almanac(data_dir)
    since_s = np.arange(0.0, 300.0, 0.5)
    turning = path(ephemeris, since_s, roll=math.radians(45.0), heading=math.radians(4.0) * since_s)
    seen = satellites_in_view(ephemeris, turning, fighter_mask())
    checked = 0
    for number in range(N_SATS):
        onsets_s = since_s[np.flatnonzero(seen.in_view[:-1, number] & ~seen.in_view[1:, number])]
        for onset_s in onsets_s[onsets_s < 200.0]:
            assert np.abs(onsets_s - onset_s - 90.0).min() <= 2.0, number
            checked += 1
    assert checked >= 10


def test_what_hides(data_dir):
    ephemeris = almanac(data_dir)
    level = satellites_in_view(ephemeris, path(ephemeris, [0.0]), MaskTable.open_sky(0.0))
    known = np.isfinite(ephemeris.sqrt_a) & (ephemeris.health == 0.0)
    high = known & (level.elevation_rad[0] >= math.radians(5.0))
    assert (level.hidden_by[0][~known] == HiddenBy.UNKNOWN).all()
    assert (level.hidden_by[0][known & ~high] == HiddenBy.EARTH).all()
    assert (level.hidden_by[0][high] == HiddenBy.NOTHING).all()
    banked = satellites_in_view(ephemeris, path(ephemeris, [0.0], roll=1.0), MaskTable.open_sky(0.0))
    expected = banked.body_elevation_rad[0][high] < 0.0
    assert expected.any()
    np.testing.assert_array_equal(banked.hidden_by[0][high] == HiddenBy.AIRCRAFT, expected)
    # A basin whose rim stands 20 degrees high all around.
    rows = np.hypot(*np.meshgrid(np.arange(-100, 101), 0.669 * np.arange(-100, 101), indexing="ij"))
    tile = ElevationTile(
        name="basin",
        north_rad=LAT + math.radians(0.1),
        west_rad=LON - math.radians(0.1),
        step_rad=(math.radians(0.001),) * 2,
        height_m=np.where(rows > 50.0, 3000.0 + 50.0 * 111.2 * math.tan(math.radians(20.0)), 0.0),
    )
    valley = satellites_in_view(ephemeris, path(ephemeris, [0.0, 1.0]), MaskTable.open_sky(0.0), tile=tile)
    elevation = np.degrees(level.elevation_rad[0])
    assert (valley.hidden_by[0][high & (elevation < 19.0)] == HiddenBy.TERRAIN).all()
    assert (valley.hidden_by[0][high & (elevation > 21.0)] == HiddenBy.NOTHING).all()
    assert (valley.terrain_covered_m > 7000.0).all()
    away = path(ephemeris, [0.0])
    away = dataclasses.replace(away, position_m=ecef_from_geodetic(LAT + 0.1, LON, 3000.0)[np.newaxis])
    with pytest.raises(ElevationError, match="does not cover the path"):
        satellites_in_view(ephemeris, away, MaskTable.open_sky(0.0), tile=tile)


def test_what_is_not_known_is_not_in_view(data_dir):
    ephemeris = almanac(data_dir)
    blind = path(ephemeris, [0.0, 1.0, 2.0], roll=[0.0, math.nan, 0.0])
    seen = satellites_in_view(ephemeris, blind, MaskTable.open_sky(0.0))
    assert not seen.in_view[1].any()
    assert seen.in_view[0].any()
    # Broadcast ephemerides are not used for longer than two hours from their time.
    broadcast = dataclasses.replace(ephemeris, simulated=0.0)
    late = satellites_in_view(broadcast, path(ephemeris, [0.0, 7100.0, 7300.0]), MaskTable.open_sky(0.0))
    assert late.in_view.any(axis=1).tolist() == [True, True, False]
    with pytest.raises(ValueError, match="roll_rad has shape"):
        dataclasses.replace(blind, roll_rad=np.zeros(2))
