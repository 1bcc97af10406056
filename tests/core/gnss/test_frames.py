"""Frames against published coordinates, RTKLIB and identities."""

from __future__ import annotations

import numpy as np
import pyrtklib as rtk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss import frames

LATITUDES = st.floats(min_value=-90.0, max_value=90.0)
LONGITUDES = st.floats(min_value=-180.0, max_value=180.0)
HEIGHTS = st.floats(min_value=-10_000.0, max_value=25_000_000.0)


def _array(values: np.ndarray, length: int | None = None) -> rtk.Arr1Ddouble:
    out = rtk.Arr1Ddouble(length or len(values))
    for index, value in enumerate(values):
        out[index] = float(value)
    return out


def test_published_wgs84_derived_constants() -> None:
    # NGA.STND.0036 tables 3.1 and 3.5: b = 6356752.3142 m, e^2 = 6.694379990141e-3, to the digits printed.
    assert pytest.approx(6356752.3142, abs=5e-5) == frames.WGS84_B_M
    assert pytest.approx(6.694379990141e-3, abs=5e-16) == frames.WGS84_E2


def test_published_conversion() -> None:
    # Example of MATLAB's geodetic2ecef and of pymap3d: 42 N, 82 W, 200 m; printed to 0.1 mm or better.
    xyz = frames.ecef_from_geodetic(np.deg2rad(42.0), np.deg2rad(-82.0), 200.0)
    np.testing.assert_allclose(xyz, [660675.2518247, -4700948.68316, 4245737.66222], atol=1e-5)


@given(LATITUDES, LONGITUDES, HEIGHTS)
def test_ecef_agrees_with_rtklib_and_back(lat_deg: float, lon_deg: float, height_m: float) -> None:
    geodetic = np.array([np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m])
    xyz = frames.ecef_from_geodetic(*geodetic)
    theirs = rtk.Arr1Ddouble(3)
    rtk.pos2ecef(_array(geodetic), theirs)
    # The same formula in doubles: a few times the spacing at 3e7 m, 3.7e-9 m.
    np.testing.assert_allclose(xyz, [theirs[0], theirs[1], theirs[2]], atol=2e-8)
    lat, lon, height = frames.geodetic_from_ecef(xyz)
    # Rounding of 3e7 m, and of an angle times that radius.
    assert height == pytest.approx(height_m, abs=5e-8)
    assert lat == pytest.approx(geodetic[0], abs=5e-15)
    if abs(lat_deg) < 89.999:  # at a pole any longitude is right
        assert np.cos(lon - geodetic[1]) == pytest.approx(1.0, abs=1e-12)


@given(LATITUDES, LONGITUDES, st.floats(min_value=-100.0, max_value=15_000.0))
def test_geodetic_agrees_with_rtklib(lat_deg: float, lon_deg: float, height_m: float) -> None:
    xyz = frames.ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)
    theirs = rtk.Arr1Ddouble(3)
    rtk.ecef2pos(_array(xyz), theirs)
    lat, _, height = frames.geodetic_from_ecef(xyz)
    # RTKLIB iterates z until it moves less than 0.1 mm; the last step gains a factor of about 1/150.
    assert lat == pytest.approx(theirs[0], abs=1e-11)
    assert height == pytest.approx(theirs[2], abs=1e-4)


def test_geodetic_keeps_leading_axes_and_missing() -> None:
    xyz = np.full((2, 3, 3), np.nan)
    xyz[1, 2] = [4157177.0658, 671230.4766, 4774767.0311]
    lat, lon, height = frames.geodetic_from_ecef(xyz)
    assert lat.shape == lon.shape == height.shape == (2, 3)
    assert np.isfinite(height).sum() == np.isfinite(lat).sum() == 1


@given(LATITUDES, LONGITUDES)
def test_rotation_is_rtklibs_and_orthonormal(lat_deg: float, lon_deg: float) -> None:
    lat, lon = np.deg2rad(lat_deg), np.deg2rad(lon_deg)
    rot = frames.rot_enu_ecef(lat, lon)
    theirs = rtk.Arr1Ddouble(9)
    rtk.xyz2enu(_array(np.array([lat, lon, 0.0])), theirs)
    # The same nine products; RTKLIB keeps them by columns.
    np.testing.assert_allclose(rot, np.array([theirs[i] for i in range(9)]).reshape(3, 3).T, atol=1e-15)
    np.testing.assert_allclose(rot @ rot.T, np.eye(3), atol=4e-16)
    # Up is the gradient of height: a metre along it raises the ellipsoidal height by a metre.
    base = frames.ecef_from_geodetic(lat, lon, 100.0)
    assert frames.geodetic_from_ecef(base + rot[2])[2] == pytest.approx(101.0, abs=1e-8)  # rounding of 6.4e6 m


def test_rotations_of_several_places_at_once() -> None:
    lat, lon = np.array([0.1, -0.7]), np.array([2.0, -3.0])
    rot = frames.rot_enu_ecef(lat, lon)
    assert rot.shape == (2, 3, 3)
    np.testing.assert_array_equal(rot[1], frames.rot_enu_ecef(lat[1], lon[1]))


@pytest.mark.parametrize(
    ("enu", "azimuth_deg", "elevation_deg"),
    [((0, 1, 0), 0, 0), ((1, 0, 0), 90, 0), ((0, -1, 0), 180, 0), ((-1, 0, 0), -90, 0), ((1, 1, 2**0.5), 45, 45)],
)
def test_azimuth_and_elevation_by_definition(enu: tuple, azimuth_deg: float, elevation_deg: float) -> None:
    los = np.array(enu, dtype=float)[:, np.newaxis] / np.linalg.norm(enu)
    azimuth, elevation = frames.azimuth_elevation(los)
    np.testing.assert_allclose(np.rad2deg(azimuth), azimuth_deg, atol=1e-13)
    np.testing.assert_allclose(np.rad2deg(elevation), elevation_deg, atol=1e-13)


@given(LATITUDES, LONGITUDES, st.integers(min_value=0, max_value=2**32 - 1))
def test_line_of_sight_azimuth_and_elevation_agree_with_rtklib(lat_deg: float, lon_deg: float, seed: int) -> None:
    lat, lon = np.deg2rad(lat_deg), np.deg2rad(lon_deg)
    receiver = frames.ecef_from_geodetic(lat, lon, 50.0)
    satellites = np.random.default_rng(seed).normal(size=(3, 5))
    satellites *= 2.6e7 / np.linalg.norm(satellites, axis=0)
    los, range_m = frames.los_and_range(receiver, satellites)
    np.testing.assert_allclose(receiver[:, np.newaxis] + los * range_m, satellites, atol=2e-8)  # rounding of 3e7 m
    azimuth, elevation = frames.azimuth_elevation(np.einsum("ij,jn->in", frames.rot_enu_ecef(lat, lon), los))
    for index in range(5):
        azel = rtk.Arr1Ddouble(2)
        rtk.satazel(_array(np.array([lat, lon, 50.0])), _array(los[:, index]), azel)
        # asin, which RTKLIB uses for the elevation, loses half of the digits at the zenith.
        assert elevation[index] == pytest.approx(azel[1], abs=3e-8)
        if np.cos(elevation[index]) > 1e-3:
            assert np.cos(azimuth[index] - azel[0]) == pytest.approx(1.0, abs=1e-12)


def test_los_broadcasts_receivers() -> None:
    receivers = np.array([[6.4e6, 0.0, 0.0], [0.0, 6.4e6, 0.0]])
    satellites = np.full((2, 3, 4), np.nan)
    satellites[..., 0] = [2e7, 1e7, 0.0]
    los, range_m = frames.los_and_range(receivers, satellites)
    assert los.shape == (2, 3, 4)
    assert np.isfinite(range_m).tolist() == [[True, False, False, False]] * 2
    assert range_m[1, 0] == pytest.approx(np.hypot(2e7, 1e7 - 6.4e6), rel=1e-15)
