"""Terrain: GeoTIFF read and refused, heights between cells, horizons against closed forms, a recorded tile."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import tifffile

from gbas_airborne.abia.terrain.elevation_tile import ElevationError, ElevationTile, read_elevation_tile
from gbas_airborne.abia.terrain.horizon import EARTH_RADIUS_M, limb_rad, open_horizon, terrain_horizon

GEOGRAPHIC, PROJECTED = 2, 1
AREA, POINT = 1, 2


def write_tile(path: Path, heights: np.ndarray, *, model: int = GEOGRAPHIC, raster: int = AREA, nodata: str = "-9999"):
    """North-west corner at 50 degrees north, 8 east; cells of a thousandth of a degree."""
    keys = (1, 1, 0, 2, 1024, 0, 1, model, 1025, 0, 1, raster)
    tags = [
        (33550, "d", 3, (0.001, 0.001, 0.0), True),
        (33922, "d", 6, (0.0, 0.0, 0.0, 8.0, 50.0, 0.0), True),
        (34735, "H", len(keys), keys, True),
        (42113, "s", 0, nodata, True),
    ]
    tifffile.imwrite(path, heights.astype(np.float32), extratags=tags)


def tile_of(heights: np.ndarray, step_deg: float = 0.001) -> ElevationTile:
    """Centred on 50 degrees north, 8 east."""
    half = 0.5 * (len(heights) - 1) * step_deg
    return ElevationTile(
        name="made",
        north_rad=math.radians(50.0 + half),
        west_rad=math.radians(8.0 - half),
        step_rad=(math.radians(step_deg),) * 2,
        height_m=heights,
    )


def test_cells_and_what_is_between_them(tmp_path):
    heights = np.array([[100.0, 200.0, 300.0], [100.0, 200.0, 300.0], [400.0, 500.0, 600.0]])
    for raster, offset in ((AREA, 0.0005), (POINT, 0.0)):
        write_tile(tmp_path / "tile.tif", heights, raster=raster)
        tile = read_elevation_tile(tmp_path / "tile.tif", geoid_m=47.0)
        lat = np.radians(50.0 - offset - 0.001 * np.array([0.0, 1.5, 2.0, -0.1]))
        lon = np.radians(8.0 + offset + 0.001 * np.array([0.0, 0.25, 2.0, 1.0]))
        found = tile.at(lat, lon)
        # On the second and third row, a quarter of the way from the first column: 0.5 (125 + 425).
        np.testing.assert_allclose(found, [147.0, 275.0 + 47.0, 647.0, math.nan], atol=1e-3)
        np.testing.assert_allclose(tile.at(lat, lon + 2.0 * math.pi), found, atol=1e-3)


def test_cells_without_data_hide_most(tmp_path):
    heights = np.array([[100.0, -9999.0], [300.0, math.nan]])
    write_tile(tmp_path / "tile.tif", heights)
    np.testing.assert_allclose(
        read_elevation_tile(tmp_path / "tile.tif", geoid_m=0.0).height_m, [[100, 300], [300, 300]]
    )
    sea = read_elevation_tile(tmp_path / "tile.tif", geoid_m=10.0, missing_m=0.0)
    np.testing.assert_allclose(sea.height_m, [[110, 10], [310, 10]])


def test_bad_tiles_are_refused(tmp_path):
    def message(name: str) -> str:
        with pytest.raises(ElevationError) as error:
            read_elevation_tile(tmp_path / name, geoid_m=0.0)
        assert "\n" not in str(error.value)
        return str(error.value)

    tifffile.imwrite(tmp_path / "plain.tif", np.zeros((3, 3), dtype=np.float32))
    (tmp_path / "text.tif").write_text("no picture")
    write_tile(tmp_path / "metres.tif", np.zeros((3, 3)), model=PROJECTED)
    write_tile(tmp_path / "feet.tif", np.full((3, 3), 29_000.0))
    write_tile(tmp_path / "empty.tif", np.full((3, 3), -9999.0))
    assert "no such file" in message("none.tif")
    assert "does not say where its cells are" in message("plain.tif")
    assert "cannot be read as a GeoTIFF" in message("text.tif")
    assert "not in geographic coordinates" in message("metres.tif")
    assert "elevations from 29000 to 29000 m: must be -500 to 9000" in message("feet.tif")
    assert "has no heights" in message("empty.tif")


def test_a_path_that_leaves_the_tile_is_refused():
    tile = tile_of(np.zeros((101, 101)))
    lat, lon = np.radians([50.0, 50.02, 50.06]), np.radians([8.0, 8.0, 8.0])
    with pytest.raises(ElevationError, match=r"1 of 3 places are outside, the first at latitude 50.06000"):
        tile.refuse_path(lat, lon)
    with pytest.raises(ElevationError, match="does not cover the path"):
        terrain_horizon(tile, math.radians(50.06), lon[0], 1000.0)
    with pytest.raises(ElevationError, match="does not cover the path"):
        terrain_horizon(tile, math.nan, lon[0], 1000.0)


@pytest.mark.parametrize("height_m", [0.0, 100.0, 12_000.0])
def test_limb(height_m):
    """A tangent to the sphere: its length is known by Pythagoras."""
    tangent_m = math.sqrt((EARTH_RADIUS_M + height_m) ** 2 - EARTH_RADIUS_M**2)
    assert float(limb_rad(height_m)) == pytest.approx(-math.atan2(tangent_m, EARTH_RADIUS_M), abs=1e-9)
    horizon = open_horizon(height_m)
    assert horizon.masked([0.0, 3.0, 7.0], float(limb_rad(height_m)) - 1e-6).all()
    assert not horizon.masked(1.0, float(limb_rad(height_m)) + 1e-6)
    assert horizon.masked([math.nan, 0.0], [1.0, math.nan]).all()


def test_wall_to_the_north():
    """500 m high from 2.78 km north on: seen under atan(498 / 2.78 km) due north, as 1 / cos(azimuth) aside."""
    heights = np.zeros((201, 201))
    heights[:76] = 500.0  # from the 25th row north of the middle on
    horizon = terrain_horizon(tile_of(heights), math.radians(50.0), math.radians(8.0), 2.0)
    distance_m = math.radians(0.025) * EARTH_RADIUS_M
    for azimuth_deg in (0.0, 30.0, 330.0):
        way_m = distance_m / math.cos(math.radians(azimuth_deg))
        expected = math.atan2(498.0 - way_m**2 / (2.0 * EARTH_RADIUS_M), way_m)
        found = horizon.elevation_rad[round(2 * azimuth_deg) % 720]
        assert found == pytest.approx(expected, rel=0.03)  # samples half a cell apart, of 25
    # Southwards nothing but the ground of the tile, then what is assumed beyond: 500 m from 11 km on.
    beyond_m = math.radians(0.1) * EARTH_RADIUS_M
    assert horizon.elevation_rad[360] == pytest.approx(
        math.atan2(498.0 - beyond_m**2 / (2.0 * EARTH_RADIUS_M), beyond_m), rel=0.03
    )
    assert horizon.covered_m[360] == pytest.approx(beyond_m, rel=0.02)
    assert horizon.masked(0.0, math.radians(9.0))
    assert not horizon.masked(0.0, math.radians(11.0))


def test_high_above_flat_ground_the_limb_is_the_horizon():
    horizon = terrain_horizon(tile_of(np.zeros((101, 101))), math.radians(50.0), math.radians(8.0), 3000.0)
    np.testing.assert_allclose(horizon.elevation_rad, float(limb_rad(3000.0)), atol=1e-4)


def test_recorded_tile(data_dir):
    """GLO-90 at Sydney: water has no data; from a hill nearly everything is below 5 degrees."""
    tile = read_elevation_tile(data_dir / "terrain_mesh" / "GLO-90_se_sydney.tif", geoid_m=22.0, missing_m=0.0)
    assert tile.height_m.shape == (101, 101)
    assert tile.height_m.min() == pytest.approx(22.0 - 1.46, abs=0.01)
    assert tile.highest_m == pytest.approx(22.0 + 112.375, abs=0.01)
    row, column = np.unravel_index(tile.height_m.argmax(), tile.height_m.shape)
    lat = tile.north_rad - row * tile.step_rad[0]
    lon = tile.west_rad + column * tile.step_rad[1]
    horizon = terrain_horizon(tile, lat, lon, tile.highest_m + 2.0)
    assert (np.degrees(horizon.elevation_rad) < 1.0).all()
