"""Geometry of signal paths through the shell, against the formulas of the standards and its own derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from atmosphere_scene import STATION, derivative, ecef_of, moving, paths, satellites_at, spiral
from gbas_core.gnss.frames import azimuth_elevation, geodetic_from_ecef, los_and_range, rot_enu_ecef
from gbas_core.models.error_models import IONO_EARTH_RADIUS_M, IONO_SHELL_HEIGHT_M, iono_obliquity
from gbas_sim.atmosphere.paths import SignalPaths, Station

AZIMUTH, ELEVATION = spiral()
AT_STATION = paths([[0.0, 0.0, 0.0]])


def test_obliquity_at_the_station_is_that_of_the_standard():
    """RTCA DO-253 2.3.12.3, at the elevation of the station; rounding of 6.7e6 m against 3e6 m of root."""
    np.testing.assert_allclose(AT_STATION.shell.obliquity[0], iono_obliquity(ELEVATION), rtol=1e-12)


def test_obliquity_of_others_follows_their_own_elevation():
    """The standard's factor has no height and no curvature of its own.

    At 5 degrees the obliquity changes by 2.1 a radian and by 2.6e-6 a metre of height above the sphere: receivers some
    hundred metres away, up to 5 m above it, and verticals that turn by 0.3 % of 80 microradians differently.
    """
    now = paths([[300.0, -400.0, 5.0], [-200.0, 100.0, -3.0]])
    for row, position in enumerate(now.position_m):
        latitude, longitude, _ = geodetic_from_ecef(position)
        los, _ = los_and_range(position, now.satellite_m)
        _, elevation = azimuth_elevation(rot_enu_ecef(latitude, longitude) @ los)
        np.testing.assert_allclose(now.shell.obliquity[row], iono_obliquity(elevation), rtol=2e-5)
        np.testing.assert_allclose(now.sin_elevation[row], np.sin(elevation), rtol=0, atol=1e-14)


def test_pierce_points_of_the_station():
    """Earth angle psi = pi/2 - E - asin(Re cos E / (Re + h)) (RTCA DO-229, appendix A 4.4.10.1), azimuth as seen."""
    psi = 0.5 * math.pi - ELEVATION
    psi = psi - np.arcsin(IONO_EARTH_RADIUS_M / (IONO_EARTH_RADIUS_M + IONO_SHELL_HEIGHT_M) * np.cos(ELEVATION))
    expected = np.stack([np.sin(psi) * np.sin(AZIMUTH), np.sin(psi) * np.cos(AZIMUTH), np.cos(psi)])
    enu = STATION.axes @ AT_STATION.shell.point_m[0] / STATION.shell_radius_m
    np.testing.assert_allclose(enu, expected, rtol=0, atol=1e-13)


def test_pierce_points_lie_on_the_shell_and_on_the_path():
    now = moving()
    radius = np.sqrt((now.shell.point_m**2).sum(axis=-2))
    np.testing.assert_allclose(radius, STATION.shell_radius_m, rtol=1e-14)
    ahead = now.pierce_ecef_m - now.position_m[..., np.newaxis]
    np.testing.assert_allclose(np.cross(ahead, now.los, axis=-2), 0.0, atol=1e-7)  # rounding of 6e6 m
    assert ((ahead * now.los).sum(axis=-2) > 0.0).all()


def test_nothing_above_for_satellites_below():
    now = paths([[0.0, 0.0, 0.0]], satellite_m=satellites_at(AZIMUTH, -ELEVATION))
    assert np.isnan(now.shell.obliquity).all()
    assert np.isnan(now.along(0.3, "ray")[0]).all()
    assert np.isnan(now.along(0.3, "earth")[0]).all()


@pytest.mark.parametrize("name", ["obliquity", "point"])
def test_rates_of_the_shell(name):
    """Steps of a quarter of a second at orbital speed: 1e-9 m of rounding, and a fifth derivative of nothing."""
    now = moving()
    suffix, rate, atol = ("", "_rate", 1e-13) if name == "obliquity" else ("_m", "_mps", 3e-8)
    expected = derivative(lambda p: getattr(p.shell, name + suffix), now)
    np.testing.assert_allclose(getattr(now.shell, name + rate), expected, rtol=1e-9, atol=atol)


def test_rates_of_verticals_and_longitudes():
    now = moving()
    np.testing.assert_allclose(now.climb_mps, derivative(lambda p: p.height_m, now), rtol=0, atol=2e-8)
    np.testing.assert_allclose(
        now.sin_elevation_rate, derivative(lambda p: p.sin_elevation, now), rtol=1e-9, atol=1e-14
    )
    longitude_rate = derivative(lambda p: p.pierce_longitude[0], now)
    np.testing.assert_allclose(now.pierce_longitude[1], longitude_rate, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("reference", ["baseline", "ray", "pierce", "earth"])
def test_rates_of_distances(reference):
    now = moving()
    expected = derivative(lambda p: p.along(1.1, reference)[0], now)
    np.testing.assert_allclose(now.along(1.1, reference)[1], expected, rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("reference", ["baseline", "ray"])
def test_distance_between_receivers_at_one_height_is_the_baseline(reference):
    enu = np.array([[300.0, -200.0, 0.0], [-5000.0, 12_000.0, 0.0]])
    direction = 0.7
    expected = enu @ [math.sin(direction), math.cos(direction), 0.0]
    distance, _ = paths(enu).along(direction, reference)
    # 1e-9 m of rounding of ECEF coordinates, eleven times as much along the ground at 5 degrees.
    np.testing.assert_allclose(distance, np.broadcast_to(expected[:, np.newaxis], distance.shape), rtol=0, atol=2e-8)


@pytest.mark.parametrize("reference", ["ray", "pierce", "earth"])
def test_receivers_on_one_path_are_at_one_distance(reference):
    """An aircraft between a ground receiver and the satellite has its pierce point."""
    ground = ecef_of([[200.0, 100.0, 0.0]])[0]
    satellite = satellites_at(AZIMUTH, ELEVATION, seen_from_m=ground)
    los, _ = los_and_range(ground, satellite)
    for index in (0, 20, 50):
        above = STATION.axes @ (ground + 8000.0 * los[:, index] - STATION.position_m)
        now = paths([[200.0, 100.0, 0.0], above], satellite_m=satellite)
        distance, _ = now.along(2.2, reference)
        assert distance[1, index] == pytest.approx(distance[0, index], abs=2e-7)  # rounding, over sin 5 degrees
        away = np.abs(distance[1] - distance[0])
        assert away.max() > 1000.0


def test_distances_over_the_shell():
    """In the plane of the path sin(E) / sin(E at the pierce point) of the baseline, across it all, but for parallax.

    Paths meet at the satellite, so that pierce points are closer together than receivers by their share of the way to
    it. What is left is of second order in the baseline: 5 km over the 350 km and more to the pierce points.
    """
    baseline = 5000.0
    for index in range(0, 68, 7):
        for across in (False, True):
            direction = AZIMUTH[index] + (0.5 * math.pi if across else 0.0)
            there = baseline * np.array([math.sin(direction), math.cos(direction), 0.0])
            now = paths([[0.0, 0.0, 0.0], there])
            distance, _ = now.along(direction, "pierce")
            assert distance[0, index] == pytest.approx(0.0, abs=1e-8)
            length = np.linalg.norm(now.pierce_ecef_m[0, :, index] - now.position_m[0])
            parallax = 1.0 - length / np.linalg.norm(now.satellite_m[:, index] - now.position_m[0])
            foreshortened = 1.0 if across else math.sin(ELEVATION[index]) * now.shell.obliquity[0, index]
            assert distance[1, index] == pytest.approx(baseline * foreshortened * parallax, rel=0.01)


def test_distance_over_the_shell_grows_by_a_metre_a_metre():
    """From the great circle across the direction: along it, the arc; beside it, the same arc further."""
    now = AT_STATION
    distance, _ = now.along(0.0, "earth")
    enu = STATION.axes @ now.shell.point_m[0] / STATION.shell_radius_m
    np.testing.assert_allclose(distance[0], STATION.shell_radius_m * np.arcsin(enu[1]), rtol=1e-12, atol=1e-6)
    opposite, _ = now.along(math.pi, "earth")
    np.testing.assert_allclose(opposite, -distance, atol=1e-8)


def test_satellites_of_each_receiver():
    """Satellites given for every receiver are used for it; instants are an axis in front."""
    now = moving()
    each = SignalPaths(
        gps_week=now.gps_week,
        tow_s=np.full(3, now.tow_s),
        since_start_s=np.arange(3.0),
        station=now.station,
        position_m=np.broadcast_to(now.position_m, (3, 5, 3)),
        velocity_mps=np.broadcast_to(now.velocity_mps, (3, 5, 3)),
        satellite_m=np.broadcast_to(now.satellite_m, (3, 5, *now.satellite_m.shape)),
        satellite_mps=np.broadcast_to(now.satellite_mps, (3, 5, *now.satellite_mps.shape)),
    )
    for reference in ("baseline", "ray", "pierce", "earth"):
        distance, rate = each.along(0.4, reference)
        expected, expected_rate = now.along(0.4, reference)
        for instant in range(3):
            np.testing.assert_allclose(distance[instant], expected, rtol=1e-12)
            np.testing.assert_allclose(rate[instant], expected_rate, rtol=1e-12)


def test_refusals():
    now = moving()
    with pytest.raises(ValueError, match="satellite_m is \\(5, 3\\)"):
        paths([[0.0, 0.0, 0.0]], satellite_m=np.zeros((5, 3)))
    with pytest.raises(ValueError, match="position_m"):
        SignalPaths(**{**vars_of(now), "velocity_mps": np.zeros(3)})
    with pytest.raises(ValueError, match="ecef_m"):
        Station(ecef_m=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="shell_height_m"):
        Station(ecef_m=STATION.ecef_m, shell_height_m=1.0)


def vars_of(now: SignalPaths) -> dict:
    return {name: getattr(now, name) for name in SignalPaths.__dataclass_fields__}
