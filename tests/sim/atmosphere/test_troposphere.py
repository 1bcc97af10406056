"""The simulated troposphere: exact for the airborne correction, as other formulas have it, and weather as asked."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from atmosphere_scene import STATION, derivative, ecef_of, moving, paths, satellites_at, spiral
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.models.error_models import tropo_correction_m
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox, saastamoinen_zenith_m, saturation_hpa

AIR = Troposphere(refractivity=379.0, scale_height_m=7900.0, reference_height_m=130.0)
AZIMUTH, ELEVATION = spiral()


def above_and_below(height_m: float):
    """A receiver at the station and one straight above it, each with satellites at the same elevations."""
    above = ecef_of([[0.0, 0.0, height_m]])[0]
    satellite = np.stack([satellites_at(AZIMUTH, ELEVATION), satellites_at(AZIMUTH, ELEVATION, seen_from_m=above)])
    return paths([[0.0, 0.0, 0.0], [0.0, 0.0, height_m]], satellite_m=satellite)


@pytest.mark.parametrize("height_m", [-30.0, 0.0, 60.0, 1000.0, 12_000.0])
def test_airborne_correction_is_exact(height_m):
    """ICAO Annex 10 Vol. I, App. B 3.6.5.3, from the elevation both see; heights are rounded to 1e-9 m."""
    delay_m = AIR.delay(above_and_below(height_m)).delay_m
    correction_m = tropo_correction_m(AIR.refractivity, AIR.scale_height_m, ELEVATION, height_m, mask_rad=0.0)
    np.testing.assert_allclose(delay_m[0] - delay_m[1], correction_m, rtol=0, atol=1e-11)


def test_from_paths_as_from_heights_and_elevations():
    now = moving()
    height_m = geodetic_from_ecef(now.position_m)[2]
    expected = AIR.delay_m(height_m, np.arcsin(now.sin_elevation))
    np.testing.assert_allclose(AIR.delay(now).delay_m, expected, rtol=1e-13)


def test_vertical_delay_is_the_integral_of_refractivity():
    for height_m in (0.0, 130.0, 3000.0):
        integral, _ = quad(
            lambda h: 379e-6 * math.exp(-(h - 130.0) / 7900.0), height_m, 400_000.0, epsabs=1e-12, limit=200
        )
        assert AIR.vertical_m(np.array(height_m)) == pytest.approx(integral, rel=1e-9)


def test_rate():
    now = moving()
    expected = derivative(lambda p: AIR.delay(p).delay_m, now)
    # 1e-9 m of rounding in heights and positions over a step of a quarter of a second, times up to 100 at 5 degrees.
    np.testing.assert_allclose(AIR.delay(now).rate_mps, expected, rtol=0, atol=2e-10)


def test_nothing_for_satellites_below_and_no_troposphere():
    below = paths([[0.0, 0.0, 0.0]], satellite_m=satellites_at(AZIMUTH, -ELEVATION))
    assert np.isnan(AIR.delay(below).delay_m).all()
    assert not Troposphere().delay(moving()).delay_m.any()


# --- from weather


def test_zenith_delay_of_the_standard_atmosphere():
    """Dry delay as in RTCA DO-229 appendix A.4.2.4: 1e-6 k1 Rd P / gm with k1 77.604 K/hPa, Rd 287.054 J/(kg K), gm
    9.784 m/s2. Constants of the two differ by 0.03 %."""
    dry_m = saastamoinen_zenith_m(1013.25, 288.15, 0.0, 0.25 * math.pi, 0.0)
    assert dry_m == pytest.approx(1e-6 * 77.604 * 287.054 * 1013.25 / 9.784, rel=5e-4)
    # Saastamoinen's wet part, 0.002277 (1255 / T + 0.05) e, with 10 hPa of vapour: 0.1003 m.
    wet_m = saastamoinen_zenith_m(1013.25, 288.15, 10.0, 0.25 * math.pi, 0.0) - dry_m
    assert wet_m == pytest.approx(0.002277 * (1255.0 / 288.15 + 0.05) * 10.0, rel=1e-3)


@pytest.mark.parametrize(("celsius", "hpa"), [(0.0, 6.112), (20.0, 23.37), (30.0, 42.43)])
def test_saturated_vapour(celsius, hpa):
    """Smithsonian meteorological tables; Bolton gives his formula 0.1 %."""
    assert saturation_hpa(celsius + 273.15) == pytest.approx(hpa, rel=2e-3)


def test_troposphere_of_given_weather():
    """Refractivity at 1013.25 hPa, 15 degrees Celsius and 60 %: 272.9 dry and 45.8 wet (Smith and Weintraub, by hand,
    10.2 hPa of vapour); the zenith delay is Saastamoinen's."""
    air = Troposphere.from_weather(
        pressure_hpa=1013.25, temperature_k=288.15, relative_humidity=0.6, latitude_rad=0.9, reference_height_m=100.0
    )
    assert air.refractivity == pytest.approx(272.9 + 45.8, abs=0.5)
    vapour_hpa = 0.6 * saturation_hpa(288.15)
    zenith_m = saastamoinen_zenith_m(1013.25, 288.15, vapour_hpa, 0.9, 100.0)
    assert air.vertical_m(np.array(100.0)) == pytest.approx(zenith_m, rel=1e-12)
    assert 6000.0 < air.scale_height_m < 9000.0


# --- weather


def traced_m(box: WeatherBox, now, row: int, index: int, since_s: float) -> float:
    """Refractivity summed along a path in steps of 2 m."""
    axis = STATION.towards(box.direction_rad)
    length = np.arange(1.0, 200_000.0, 2.0)
    points = now.position_m[row] + length[:, np.newaxis] * now.los[row, :, index] - STATION.position_m
    front = box.start_m + box.speed_mps * (since_s - box.start_s)
    height, along = points @ STATION.axes[2], points @ axis
    inside = (height > box.base_m) & (height < box.top_m) & (along < front) & (along > front - box.thickness_m)
    return 2.0 * 1e-6 * box.excess_refractivity * inside.sum()


@pytest.mark.parametrize(
    "box",
    [
        WeatherBox(excess_refractivity=30.0, top_m=4000.0, direction_rad=1.0, start_m=-8000.0, speed_mps=15.0),
        WeatherBox(excess_refractivity=-12.0, base_m=300.0, top_m=500.0, direction_rad=2.0, start_m=5000.0),
        WeatherBox(top_m=6000.0, direction_rad=4.0, start_m=3000.0, thickness_m=9000.0, start_s=50.0, speed_mps=20.0),
    ],
)
def test_weather_as_summed_along_the_paths(box):
    now = moving()
    delay_m = box.delay(now).delay_m
    for row in range(5):
        for index in range(0, 67, 5):
            # At most a step too many or too few at each of four planes.
            assert delay_m[row, index] == pytest.approx(traced_m(box, now, row, index, 100.0), abs=4 * 2.0 * 30e-6)
    assert (delay_m != 0.0).any()


def test_rate_of_weather():
    box = WeatherBox(top_m=4000.0, direction_rad=1.0, start_m=2000.0, thickness_m=30_000.0, speed_mps=15.0)
    now = moving()
    expected = derivative(lambda p: box.delay(p).delay_m, now, step_s=0.01)
    rate = box.delay(now).rate_mps
    # Where a path goes through a corner within the steps there is no derivative.
    steady = np.abs(derivative(lambda p: box.delay(p).delay_m, now, step_s=0.02) - expected) < 1e-9
    assert steady.mean() > 0.99
    np.testing.assert_allclose(rate[steady], expected[steady], rtol=0, atol=5e-9)


def test_endless_layer():
    """A duct of 100 N units and 150 m: 15 mm at the zenith, over the sine of the elevation; below and above it."""
    duct = WeatherBox(excess_refractivity=100.0, base_m=200.0, top_m=350.0, start_m=1e6, thickness_m=2e6)
    now = paths([[0.0, 0.0, 0.0], [0.0, 0.0, 400.0]])
    expected = 0.015 / np.sin(ELEVATION)
    np.testing.assert_allclose(duct.delay(now).delay_m[0], expected, rtol=1e-9)
    assert not duct.delay(now).delay_m[1].any()


@given(
    excess=st.floats(-200.0, 200.0),
    base_m=st.floats(-100.0, 5000.0),
    depth_m=st.floats(1.0, 5000.0),
    direction_rad=st.floats(-6.2, 6.2),
    start_m=st.floats(-1e5, 1e5),
    thickness_m=st.floats(1.0, 1e6),
)
def test_weather_is_bounded(excess, base_m, depth_m, direction_rad, start_m, thickness_m):
    """No path is longer within the body than between its base and its top."""
    box = WeatherBox(
        excess_refractivity=excess,
        base_m=base_m,
        top_m=base_m + depth_m,
        direction_rad=direction_rad,
        start_m=start_m,
        thickness_m=thickness_m,
    )
    now = moving()
    rise = (STATION.axes[2][:, np.newaxis] * now.los).sum(axis=-2)
    share = box.delay(now).delay_m / (1e-6 * excess) if abs(excess) > 1e-3 else np.zeros_like(rise)
    assert (share >= 0.0).all()
    assert (share <= (box.top_m - box.base_m) / rise + 1e-3).all()


@pytest.mark.parametrize(
    ("key", "value"),
    [("excess_refractivity", 1e3), ("thickness_m", 0.0), ("speed_mps", -1.0), ("top_m", -5.0), ("base_m", math.nan)],
)
def test_weather_refuses(key, value):
    with pytest.raises(ValueError, match=f"^{key} = "):
        WeatherBox(**{key: value})


def test_heights_are_along_the_vertical():
    """What the scene calls straight above is so on the ellipsoid too."""
    now = above_and_below(1000.0)
    latitude, longitude, _ = geodetic_from_ecef(now.position_m)
    np.testing.assert_allclose(rot_enu_ecef(latitude, longitude)[:, 2], [STATION.axes[2]] * 2, atol=1e-12)
    np.testing.assert_allclose(now.height_m, [130.0, 1130.0], atol=1e-8)
