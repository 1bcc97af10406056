"""Motion along lines of sight: circles flown in closed form, both ways of getting it, and paths with gaps."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_airborne.abia.tracking.line_of_sight import (
    UnevenPathError,
    doppler_of_path,
    motion_of_aircraft,
    motion_of_path,
)
from gbas_airborne.abia.visibility.satellites_in_view import Path
from gbas_core.gnss.almanac import ephemeris_from_almanac, read_almanac
from gbas_core.gnss.frames import ecef_from_geodetic, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.signal.loop_thresholds import LoopParams, phase_stress_rad
from gbas_core.signals import FREQUENCY_HZ, L1, SPEED_OF_LIGHT_MPS

LAT, LON = math.radians(48.0), math.radians(11.0)
RATE, RADIUS_M = math.radians(20.0), 500.0  # 175 m/s, 61 m/s^2 (6.2 g), 21 m/s^3


@pytest.fixture(scope="module")
def ephemeris(data_dir):
    return ephemeris_from_almanac(read_almanac(data_dir / "almanacs" / "test_input_yuma377.txt", near_week=1401))


def circle(ephemeris, count: int = 201) -> tuple[Path, list[np.ndarray]]:
    """A level circle at 20 Hz, and its velocity, acceleration and jerk, ECEF."""
    since_s = 0.05 * np.arange(count)
    turn = rot_enu_ecef(LAT, LON)

    def derivative(order: int) -> np.ndarray:
        phase = RATE * since_s + 0.5 * math.pi * order
        return RADIUS_M * RATE**order * np.stack([np.cos(phase), np.sin(phase), 0.0 * phase], axis=1) @ turn

    zero = np.zeros(count)
    path = Path(
        gps_week=int(ephemeris.gps_week),
        tow_s=float(ephemeris.tow_s) + since_s,
        position_m=ecef_from_geodetic(LAT, LON, 3000.0) + derivative(0),
        roll_rad=zero,
        pitch_rad=zero,
        heading_rad=zero,
    )
    return path, [derivative(order) for order in (1, 2, 3)]


def test_motion_of_a_circle(ephemeris):
    """Fitted to ranges against scalar products, which leave the satellites' 0.2 m/s^2 out."""
    path, (velocity, acceleration, jerk) = circle(ephemeris)
    fitted = motion_of_path(ephemeris, path, window_s=1.0)
    state = predicted_state(ephemeris, path.gps_week, path.tow_s[:, np.newaxis], path.position_m, None)
    _, los = rotated_range(path.position_m, state.position_m)
    direct = motion_of_aircraft(los, acceleration, jerk)
    known = np.isfinite(los[0, 0])
    inner = slice(20, -20)
    np.testing.assert_allclose(
        fitted.acceleration_mps2[inner, known], direct.acceleration_mps2[inner, known], atol=0.25
    )
    # A polynomial over a second takes a hundredth off a motion of 18 s.
    np.testing.assert_allclose(fitted.jerk_mps3[inner, known], direct.jerk_mps3[inner, known], atol=0.25)
    doppler = doppler_of_path(ephemeris, path, velocity)
    by_range = -fitted.velocity_mps * FREQUENCY_HZ[L1] / SPEED_OF_LIGHT_MPS
    offset = doppler[inner, L1, known] - by_range[inner, known]
    # What is left is the satellites' clock drift, the same at all times.
    np.testing.assert_allclose(offset - offset[0], 0.0, atol=0.02)


def test_circle_stresses_the_phase_loop(ephemeris):
    """21 m/s^3 at 18 Hz is 3.3 degrees at most, towards a satellite in the plane of the turn (eq (49))."""
    path, _ = circle(ephemeris)
    stress = np.degrees(phase_stress_rad(LoopParams(), motion_of_path(ephemeris, path, window_s=1.0)))
    most = 360.0 * 1575.42e6 / 299_792_458.0 * RADIUS_M * RATE**3 * 0.4828 / 18.0**3
    assert 0.6 * most < np.nanmax(stress[20:-20]) < 1.05 * most


def test_gaps_are_refused(ephemeris):
    path, _ = circle(ephemeris)
    late = path.tow_s + np.where(np.arange(201) >= 100, 5.0, 0.0)
    with pytest.raises(UnevenPathError, match=r"s are 5\.050 s apart, the others 0\.050: a gap"):
        motion_of_path(ephemeris, dataclasses.replace(path, tow_s=late))
    with pytest.raises(UnevenPathError, match="201 instants, but 241 are in a window"):
        motion_of_path(ephemeris, path, window_s=12.0)
    unknown = np.where(np.arange(201) == 7, math.nan, path.tow_s)
    with pytest.raises(UnevenPathError):
        motion_of_path(ephemeris, dataclasses.replace(path, tow_s=unknown))
