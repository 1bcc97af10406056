"""Air, Earth and wind of the flight dynamics: published values, laws they obey, second formulations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import flight_newton
from gbas_core.gnss.frames import EARTH_RATE_RADPS, ecef_from_geodetic, rot_enu_ecef
from gbas_sim.flight.dynamics.atmosphere import (
    STANDARD_GRAVITY_MPS2,
    air_at_geopotential,
    geopotential_m,
    standard_air,
)
from gbas_sim.flight.dynamics.earth import gravity_mps2, radii_of_curvature_m, turning_acceleration
from gbas_sim.flight.dynamics.smooth import STEEPEST, SmoothTable, pulse, pulse_area, step, step_area
from gbas_sim.flight.dynamics.wind import Wind

TABLE = yaml.safe_load((Path(__file__).parents[2] / "tables" / "standard_atmosphere.yaml").read_text())["geopotential"]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row['height_m']:.0f} m")
def test_standard_atmosphere_table(row) -> None:
    air = air_at_geopotential(np.array(row["height_m"]))
    # Six digits are tabulated; the editions differ by one in the last.
    for name in ("temperature_k", "pressure_pa", "density_kgpm3", "sound_mps"):
        assert getattr(air, name) == pytest.approx(row[name], rel=1e-5), name


def test_air_is_in_hydrostatic_balance() -> None:
    heights = np.linspace(-400.0, 20_000.0, 2001)
    air = air_at_geopotential(heights)
    # Central differences over 10.2 m: the third derivative of pressure makes 1e-7 of it, the kink at 11 km more.
    slope = np.gradient(air.pressure_pa, heights)[1:-1]
    inner = np.abs(heights[1:-1] - 11_000.0) > 25.0
    np.testing.assert_allclose(slope[inner], -(air.density_kgpm3 * STANDARD_GRAVITY_MPS2)[1:-1][inner], rtol=1e-6)


def test_geopotential_height() -> None:
    # ICAO Doc 7488/3: 20 000 m geometric is 19 937 m geopotential.
    assert geopotential_m(np.array(20_000.0)) == pytest.approx(19_937.0, abs=0.5)
    below = standard_air(np.array(5000.0)).density_kgpm3
    assert below > air_at_geopotential(np.array(5000.0)).density_kgpm3


def test_radii_of_curvature() -> None:
    # NGA.STND.0036: a, a(1 - e^2) and the polar radius of curvature.
    meridian, transverse = radii_of_curvature_m(np.radians([0.0, 90.0]))
    np.testing.assert_allclose(meridian, [6_335_439.3273, 6_399_593.6258], atol=1e-3)
    np.testing.assert_allclose(transverse, [6_378_137.0, 6_399_593.6258], atol=1e-3)


def test_normal_gravity_published() -> None:
    # NGA.STND.0036: normal gravity at the equator and at the poles.
    gravity = gravity_mps2(np.radians([0.0, 90.0]), np.zeros(2))
    np.testing.assert_allclose(gravity, [9.7803253359, 9.8321849379], atol=2e-9)


@pytest.mark.parametrize(("latitude_deg", "height_m"), [(0.0, 0.0), (30.0, 3000.0), (52.0, 10_000.0), (70.0, 20_000.0)])
def test_gravity_is_the_gradient_of_the_normal_potential(latitude_deg, height_m) -> None:
    latitude = np.radians(latitude_deg)
    pull = flight_newton.gravity(ecef_from_geodetic(latitude, 0.3, height_m))
    # The series in height stops at the second power: 2e-6 m/s2 at 20 km.
    assert np.linalg.norm(pull) == pytest.approx(gravity_mps2(np.array(latitude), np.array(height_m)), abs=3e-6)


@given(
    latitude=st.floats(-1.3, 1.3),
    height=st.floats(0.0, 15_000.0),
    east=st.floats(-300.0, 300.0),
    north=st.floats(-300.0, 300.0),
    up=st.floats(-50.0, 50.0),
)
def test_turning_acceleration_is_that_of_a_body_nothing_acts_on(latitude, height, east, north, up) -> None:
    position = ecef_from_geodetic(latitude, 0.2, height)
    velocity = rot_enu_ecef(latitude, 0.2).T @ np.array([east, north, up])
    coriolis = -2.0 * np.cross([0.0, 0.0, EARTH_RATE_RADPS], velocity)
    step_s = 0.5

    def local(seconds: float) -> np.ndarray:
        """Velocity in the local axes of where the body is, a moment later."""
        lat, lon, _ = flight_newton.geodetic(position + velocity * seconds + 0.5 * coriolis * seconds**2)
        return rot_enu_ecef(lat, lon) @ (velocity + coriolis * seconds)

    expected = (local(step_s) - local(-step_s)) / (2.0 * step_s)
    found = turning_acceleration(*(np.array(value) for value in (latitude, height, east, north, up)))
    # Differences over 1 s: rounding of the rotation, 1e-13 relative of 300 m/s, and of the geodetic latitude.
    np.testing.assert_allclose(np.stack(found), expected, atol=1e-6)


def test_calm_and_constant_wind() -> None:
    velocity, gradient = Wind().at(np.linspace(0.0, 5000.0, 7))
    assert not velocity.any()
    assert not gradient.any()
    # From the west, that is towards the east.
    velocity, gradient = Wind.constant(speed_mps=10.0, from_rad=np.radians(270.0)).at(np.array([0.0, 3000.0]))
    np.testing.assert_allclose(velocity, [[10.0, 0.0], [10.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-15)


def test_wind_profile_meets_its_heights_and_does_not_overshoot() -> None:
    wind = Wind(height_m=(100.0, 1000.0, 3000.0), speed_mps=(5.0, 15.0, 30.0), from_rad=(0.0, 0.0, 0.0))
    heights = np.linspace(-500.0, 5000.0, 5501)
    velocity, gradient = wind.at(heights)
    np.testing.assert_allclose(wind.at(np.array([100.0, 1000.0, 3000.0]))[0][:, 1], [-5.0, -15.0, -30.0], atol=1e-3)
    assert np.all(np.diff(velocity[:, 1]) <= 1e-3)
    np.testing.assert_allclose(np.gradient(velocity[:, 1], heights)[1:-1], gradient[1:-1, 1], atol=2e-4)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"height_m": (0.0,), "speed_mps": (5.0, 6.0), "from_rad": (0.0,)}, "have 1, 2 and 1 values"),
        ({"height_m": (100.0, 0.0), "speed_mps": (5.0, 5.0), "from_rad": (0.0, 0.0)}, "does not grow"),
        ({"height_m": (0.0,), "speed_mps": (-1.0,), "from_rad": (0.0,)}, "speed_mps = -1 is not within 0 to 150"),
        ({"height_m": (0.0,), "speed_mps": (float("nan"),), "from_rad": (0.0,)}, "speed_mps"),
        ({"height_m": (0.0,), "speed_mps": (1.0,), "from_rad": (99.0,)}, "from_deg = 5672"),
        ({"height_m": (1e6,), "speed_mps": (1.0,), "from_rad": (0.0,)}, "height_m"),
    ],
)
def test_bad_winds(values, message) -> None:
    with pytest.raises(ValueError) as error:
        Wind(**values)
    assert message in str(error.value)


def test_smooth_steps() -> None:
    x = np.linspace(-0.5, 1.5, 4001)
    np.testing.assert_allclose(step(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0.0, 0.0, 0.5, 1.0, 1.0], atol=1e-15)
    rate = np.gradient(step(x), x)
    assert rate.max() == pytest.approx(STEEPEST, rel=1e-6)
    np.testing.assert_allclose(np.gradient(step_area(x), x)[1:-1], step(x)[1:-1], atol=1e-6)
    time = np.linspace(0.0, 20.0, 20_001)
    np.testing.assert_allclose(
        np.gradient(pulse_area(time, 20.0, 4.0), time)[1:-1], pulse(time, 20.0, 4.0)[1:-1], atol=1e-6
    )
    assert pulse_area(np.array(20.0), 20.0, 4.0) == pytest.approx(16.0)


def test_smooth_table_returns_exact_derivatives() -> None:
    arguments = np.linspace(0.0, 10.0, 101)
    table = SmoothTable.make(arguments, np.sin(arguments)[:, np.newaxis], np.cos(arguments)[:, np.newaxis])
    where = np.linspace(-1.0, 11.0, 12_001)
    value, rate, second = (part[:, 0] for part in table.derivatives(where))
    inside = (where > 0.0) & (where < 10.0)
    # The spline of the rates gives second derivatives to about 0.1^3 / 4 at its ends and far better between; a cell
    # carries a 64th of that times 0.1^2 into the value, and about a tenth times 0.1 into the rate.
    np.testing.assert_allclose(value[inside], np.sin(where[inside]), rtol=0, atol=1e-7)
    np.testing.assert_allclose(rate[inside], np.cos(where[inside]), rtol=0, atol=3e-6)
    np.testing.assert_allclose(second[inside], -np.sin(where[inside]), rtol=0, atol=3e-4)
    # The rate is the derivative of the value, beyond the ends too, where it is constant.
    away = (np.abs(where) > 0.0015) & (np.abs(where - 10.0) > 0.0015)
    away[[0, -1]] = False
    np.testing.assert_allclose(np.gradient(value, where)[away], rate[away], atol=1e-6)
    assert np.ptp(rate[where < -0.01]) == 0.0
    np.testing.assert_array_equal(second[~inside][:5], 0.0)
    np.testing.assert_allclose(table.value(3.21), table.derivatives(np.array(3.21))[0], rtol=0, atol=1e-15)
