"""Equations of motion, aircraft and attitude: identities, published performance, an independent simulator."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import root

from gbas_core.gnss.attitude import body_rates, euler_angles, rot_body_enu
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.atmosphere import standard_air
from gbas_sim.flight.dynamics.equations import (
    Forces,
    Place,
    Surroundings,
    air_velocity,
    along_path,
    forces,
    path_rates,
    place,
    position_rates,
)
from gbas_sim.flight.dynamics.fleet import AIRLINER, FIGHTER, FLEET, SMALL_UAV
from gbas_sim.flight.dynamics.wind import Wind

PUBLISHED = yaml.safe_load((Path(__file__).parents[2] / "tables" / "airliner_performance.yaml").read_text())
FOOT_M, KNOT_MPS = 0.3048, 1852.0 / 3600.0
PAPER = Surroundings(turning_earth=False)


def where(speed: float, climb: float = 0.0, heading: float = 0.5, height: float = 3000.0, surroundings=PAPER):
    velocity = air_velocity(np.array(speed), np.array(climb), np.array(heading))
    return place(surroundings, np.array(0.9), np.array(height), velocity)


@given(bank=st.floats(-1.2, 1.2), speed=st.floats(20.0, 300.0))
def test_level_turn_rate(bank: float, speed: float) -> None:
    """Lift that carries the weight in a bank turns at g tan(bank) / V."""
    here = where(speed)
    g = float(here.gravity_mps2)
    lift = g / math.cos(bank)
    specific = (np.array(0.0), np.array(lift * math.sin(bank)), np.array(lift * math.cos(bank)))
    rates = path_rates(np.array(speed), np.array(0.0), np.array(0.5), specific, here)
    assert rates[0] == pytest.approx(0.0, abs=1e-12)
    assert rates[1] == pytest.approx(0.0, abs=1e-13)
    assert rates[2] == pytest.approx(g * math.tan(bank) / speed, rel=1e-12)


@pytest.mark.parametrize("aircraft", FLEET.values(), ids=FLEET)
def test_steady_glide(aircraft: Aircraft) -> None:
    """Without thrust an aircraft settles where tan(gamma) = -D/L."""
    gliding = dataclasses.replace(aircraft, engine=dataclasses.replace(aircraft.engine, idle=0.0))
    alpha, zero = np.array(0.08), np.array(0.0)

    def made_at(speed: float) -> tuple[Place, Forces]:
        here = where(speed, height=1000.0)
        return here, forces(gliding, here.air, np.array(speed), alpha, zero, zero)

    def unsteady(motion: np.ndarray) -> list[float]:
        here, made = made_at(motion[0])
        specific = (made.along_n / gliding.mass_kg, zero, made.normal_n / gliding.mass_kg)
        rates = path_rates(motion[0], motion[1], zero, specific, here)
        return [float(rates[0]), float(rates[1] * motion[0])]

    air = standard_air(np.array(1000.0))
    lift = float(aircraft.lift_coefficient(alpha, zero))
    guess = math.sqrt(2.0 * aircraft.mass_kg * 9.8 / (air.density_kgpm3 * aircraft.wing_area_m2 * lift))
    steady = root(unsteady, [guess, -0.05], tol=1e-12)
    assert steady.success
    _, made = made_at(steady.x[0])
    assert math.tan(steady.x[1]) == pytest.approx(-float(made.drag_n / made.lift_n), rel=1e-9)


@given(
    climb=st.floats(-0.5, 0.5),
    heading=st.floats(-3.0, 3.0),
    bank=st.floats(-1.2, 1.2),
    alpha=st.floats(-0.1, 0.25),
    pull=st.floats(-2.0e4, 2.0e5),
    turning=st.booleans(),
)
def test_energy_rate(climb, heading, bank, alpha, pull, turning) -> None:
    """m V dV/dt + m g dh/dt = (T cos alpha - D) V, whatever the bank, and with the Earth turning too."""
    speed, mass = np.array(120.0), 60_000.0
    here = where(120.0, climb, heading, surroundings=Surroundings(turning_earth=turning))
    made = forces(AIRLINER, here.air, speed, np.array(alpha), np.array(pull), np.array(0.3))
    specific = (
        made.along_n / mass, made.normal_n * math.sin(bank) / mass, made.normal_n * math.cos(bank) / mass
    )  # fmt: skip
    rate = path_rates(speed, np.array(climb), np.array(heading), specific, here)[0]
    rise = position_rates(here, np.array(3000.0))[2]
    power = mass * speed * rate + mass * here.gravity_mps2 * rise
    drag_n = made.thrust_n * math.cos(alpha) - made.along_n
    assert drag_n == pytest.approx(float(made.drag_n), rel=1e-12, abs=1e-6)
    assert power == pytest.approx(float((made.thrust_n * math.cos(alpha) - made.drag_n) * speed), rel=1e-9, abs=1.0)


def test_air_brakes_are_the_part_of_the_pull_below_idling() -> None:
    air, speed, zero = standard_air(np.array(1000.0)), np.array(120.0), np.array(0.0)
    least, largest, idle = AIRLINER.pull_bounds_n(speed, air)
    assert least < idle < largest
    for pull in (least, idle, largest):
        made = forces(AIRLINER, air, speed, np.array(0.05), pull, zero)
        lift = AIRLINER.lift_coefficient(np.array(0.05), zero)
        clean = AIRLINER.dynamic_force_n(speed, air) * AIRLINER.drag_coefficient(lift, zero)
        assert made.thrust_n == max(pull, idle)
        assert made.drag_n - clean == pytest.approx(float(made.thrust_n - pull), abs=1e-6)


def test_wind_gradient_changes_airspeed_not_ground_speed() -> None:
    """Climbing into a growing headwind, the airspeed gains what the ground speed keeps."""
    wind = Wind(height_m=(0.0, 3000.0), speed_mps=(0.0, 60.0), from_rad=(0.0, 0.0))
    here = where(100.0, 0.1, 0.0, 1500.0, Surroundings(wind=wind, turning_earth=False))
    balance = (here.gravity_mps2 * np.sin(0.1), np.array(0.0), here.gravity_mps2 * np.cos(0.1))
    rates = path_rates(np.array(100.0), np.array(0.1), np.array(0.0), balance, here)
    # Nothing accelerates the aircraft; the air ahead comes at it faster by shear times rate of climb.
    shear = -wind.at(np.array(1500.0))[1][1]
    rise = 100.0 * math.sin(0.1)
    assert rates[0] == pytest.approx(shear * rise * math.cos(0.1), rel=1e-9)
    assert rates[1] == pytest.approx(-shear * rise * math.sin(0.1) / 100.0, rel=1e-9)


@pytest.mark.parametrize("row", PUBLISHED["drag"], ids=lambda row: f"{row['height_ft']:.0f} ft")
def test_airliner_drag(row) -> None:
    air = standard_air(np.array(row["height_ft"] * FOOT_M))
    speed, zero = np.array(row["airspeed_kt"] * KNOT_MPS), np.array(0.0)
    dynamic = AIRLINER.dynamic_force_n(speed, air)
    drag = dynamic * AIRLINER.drag_coefficient(row["mass_kg"] * 9.80665 / dynamic, zero)
    # The same polar; OpenAP takes its heights as geopotential, ours are geometric: 0.2 % of density at 35 000 ft.
    assert drag == pytest.approx(row["drag_n"], rel=3e-3)


@pytest.mark.parametrize("row", PUBLISHED["thrust"], ids=lambda row: f"{row['height_ft']:.0f} ft")
def test_airliner_thrust(row) -> None:
    air = standard_air(np.array(row["height_ft"] * FOOT_M))
    # Constants of the fit have four digits.
    assert AIRLINER.engine.largest_thrust_n(np.array(row["airspeed_mps"]), air) == pytest.approx(
        row["thrust_n"], rel=5e-3
    )


@pytest.mark.parametrize("row", PUBLISHED["consumption"], ids=lambda row: f"{row['height_ft']:.0f} ft")
def test_airliner_consumption(row) -> None:
    air = standard_air(np.array(row["height_ft"] * FOOT_M))
    assert AIRLINER.engine.consumption(np.array(row["airspeed_mps"]), air) == pytest.approx(row["kgpns"], rel=2e-3)


def test_fighter_engine_at_sea_level() -> None:
    air = standard_air(np.array(0.0))
    # Two engines of 40.5 kN; 0.9 lb/(lbf h) is 2.549e-5 kg/(N s).
    assert FIGHTER.engine.largest_thrust_n(np.array(0.0), air) == pytest.approx(81_000.0)
    assert FIGHTER.engine.consumption(np.array(0.0), air) == pytest.approx(2.549e-5, rel=1e-3)
    # Density to the power 1.235 is pressure, below the tropopause (ICAO: 54 019.9 Pa at 5000 m geopotential).
    high = standard_air(np.array(5003.94))
    assert FIGHTER.engine.largest_thrust_n(np.array(0.0), high) == pytest.approx(
        81_000.0 * 54_019.9 / 101_325.0, rel=1e-4
    )


def test_uav_lift_and_drag() -> None:
    # Beard and McLain: C_L = 0.23 + 5.61 alpha; C_L^2 / (pi e AR) with e = 0.9, b = 2.8956 m, S = 0.55 m2.
    zero = np.array(0.0)
    assert SMALL_UAV.lift_coefficient(np.array(0.1), zero) == pytest.approx(0.791)
    induced = 0.5**2 / (math.pi * 0.9 * 2.8956**2 / 0.55)
    assert SMALL_UAV.drag_coefficient(np.array(0.5), zero) == pytest.approx(0.043 + induced, rel=1e-3)
    assert SMALL_UAV.engine.largest_thrust_n(zero, standard_air(zero)) == pytest.approx(45.0)


@pytest.mark.parametrize("aircraft", FLEET.values(), ids=FLEET)
def test_alpha_and_lift_are_inverse(aircraft: Aircraft) -> None:
    alpha, landing = np.linspace(-0.1, 0.2, 7), np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(
        aircraft.alpha_rad(aircraft.lift_coefficient(alpha, landing), landing), alpha, atol=1e-15
    )


@pytest.mark.parametrize(
    ("part", "changes", "message"),
    [
        (None, {"mass_kg": 10.0, "empty_mass_kg": 20.0}, "mass_kg = 10.0 is less than empty_mass_kg = 20.0"),
        (None, {"wing_area_m2": 0.0}, "wing_area_m2 = 0 is not within 0.05 to 1000 m^2"),
        ("clean", {"drag_zero": float("nan")}, "drag_zero = nan"),
        ("clean", {"lift_max": 0.31, "lift_zero": 0.4}, "lift_max"),
        ("engine", {"thrust_n": -1.0}, "thrust_n = -1 is not within"),
        ("limits", {"bank_rad": 2.0}, "bank_deg = 114.591559 is not within 5 to 85 deg"),
        ("response", {"lateral_radps": 3.0}, "lateral_radps"),
    ],
)
def test_bad_aircraft(part, changes, message) -> None:
    with pytest.raises(ValueError) as error:
        dataclasses.replace(AIRLINER if part is None else getattr(AIRLINER, part), **changes)
    assert message in str(error.value)


@given(climb=st.floats(-1.0, 1.0), heading=st.floats(0.0, 6.2), bank=st.floats(-1.4, 1.4), alpha=st.floats(-0.2, 0.3))
def test_attitude_is_a_rotation_of_the_angles_it_returns(climb, heading, bank, alpha) -> None:
    rot = rot_body_enu(*(np.array(value) for value in (climb, heading, bank, alpha)))
    np.testing.assert_allclose(rot @ rot.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rot) == pytest.approx(-1.0 * -1.0)
    roll, pitch, yaw = (float(angle) for angle in euler_angles(rot))
    # Second formulation: the usual product of three turns from north, east, down.
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    from_ned = (
        np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
        @ np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
        @ np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    )
    np.testing.assert_allclose(from_ned @ np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), rot, atol=1e-12)


@given(climb=st.floats(-0.5, 0.5), alpha=st.floats(-0.1, 0.2), heading=st.floats(0.1, 6.2))
def test_wings_level_pitch_is_climb_plus_alpha(climb, alpha, heading) -> None:
    angles = euler_angles(rot_body_enu(np.array(climb), np.array(heading), np.array(0.0), np.array(alpha)))
    np.testing.assert_allclose(np.array(angles), [0.0, climb + alpha, heading], atol=1e-12)


def test_right_bank_is_right_wing_down() -> None:
    roll, _, _ = euler_angles(rot_body_enu(np.array(0.0), np.array(1.0), np.array(0.5), np.array(0.0)))
    assert roll == pytest.approx(0.5)


@given(st.lists(st.floats(-0.3, 0.3), min_size=8, max_size=8))
def test_body_rates_are_those_of_the_rotation(values) -> None:
    angles, rates = np.array(values[:4]), np.array(values[4:])
    step_s = 1e-5
    before, after = (rot_body_enu(*(angles + sign * step_s * rates)) for sign in (-1.0, 1.0))
    # d/dt R = -[w] R for a rotation into axes that turn with w.
    cross = -(after - before) / (2.0 * step_s) @ rot_body_enu(*angles).T
    expected = [cross[2, 1], cross[0, 2], cross[1, 0]]
    climb, _, bank, alpha = angles
    found = body_rates((climb, bank, alpha), (rates[0], rates[1], rates[2], rates[3]))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_along_path_is_a_rotation() -> None:
    vector = tuple(np.array(value) for value in (3.0, -4.0, 12.0))
    parts = along_path(vector, np.array(0.3), np.array(1.1))  # type: ignore[arg-type]
    assert math.hypot(*(float(part) for part in parts)) == pytest.approx(13.0)
    ahead = air_velocity(np.array(1.0), np.array(0.3), np.array(1.1))
    np.testing.assert_allclose(np.array(along_path(ahead, np.array(0.3), np.array(1.1))), [1.0, 0.0, 0.0], atol=1e-15)


def test_position_rates_move_along_the_ellipsoid() -> None:
    from gbas_core.gnss.frames import ecef_from_geodetic, rot_enu_ecef

    lat, lon, height = 0.9, 0.2, 3000.0
    here = where(200.0, 0.1, 2.0)
    rates = np.array(position_rates(here, np.array(height)))
    step_s = 1e-2
    there = ecef_from_geodetic(lat + step_s * rates[0], lon + step_s * rates[1], height + step_s * rates[2])
    moved = rot_enu_ecef(lat, lon) @ (there - ecef_from_geodetic(lat, lon, height)) / step_s
    # Curvature bends the step by v^2 t / 2r: 3e-5 m/s.
    np.testing.assert_allclose(moved, np.array(here.ground_mps), atol=1e-4)
    assert geodetic_from_ecef(there)[2] == pytest.approx(height + step_s * rates[2], abs=1e-6)
