"""Elevations of the ground from a GeoTIFF in geographic coordinates.

Source: OGC 19-008r4, GeoTIFF standard 1.1; cells without data as GDAL marks them (tag 42113).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gbas_core.record import BoolArray, FloatArray

_HIGHEST_M, _LOWEST_M = 9000.0, -500.0
_EDGE = 1e-6
"""Of a cell, for rounding."""


class ElevationError(ValueError):
    """A tile that cannot be used, or does not cover a place; one line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ElevationTile:
    """Heights on a grid of latitude and longitude.

    Attributes
    ----------
    name : str
        For messages.
    north_rad, west_rad : float
        Centre of the first cell.
    step_rad : (float, float)
        From one row to the next southwards, and from one column to the next eastwards.
    height_m : (rows, columns) array
        Above the ellipsoid [m].
    """

    name: str
    north_rad: float
    west_rad: float
    step_rad: tuple[float, float]
    height_m: FloatArray

    def __post_init__(self) -> None:
        if self.height_m.ndim != 2 or min(self.height_m.shape) < 2:
            raise ElevationError(f"{self.name}: not a grid of at least 2 x 2 heights")
        if not np.isfinite(self.height_m).all():
            raise ElevationError(f"{self.name}: a height is not a finite number")
        if not min(self.step_rad) > 0.0:
            raise ElevationError(f"{self.name}: its rows do not go south, or its columns not east")

    @cached_property
    def highest_m(self) -> float:
        """The highest cell [m]."""
        return float(self.height_m.max())

    def covers(self, lat_rad: FloatArray, lon_rad: FloatArray) -> BoolArray:
        """Whether places are between the centres of the tile's outer cells."""
        row, column = self._place(lat_rad, lon_rad)
        rows, columns = self.height_m.shape
        with np.errstate(invalid="ignore"):
            inside = (row >= -_EDGE) & (row <= rows - 1.0 + _EDGE) & (column >= -_EDGE)
            return np.asarray(inside & (column <= columns - 1.0 + _EDGE))

    def at(self, lat_rad: FloatArray, lon_rad: FloatArray) -> FloatArray:
        """Height of the ground, bilinear between cells [m]; NaN beyond the tile."""
        covered = self.covers(lat_rad, lon_rad)
        rows, columns = self.height_m.shape
        row, column = (np.where(covered, each, 0.0) for each in self._place(lat_rad, lon_rad))
        north, west = (
            np.clip(np.floor(each).astype(np.intp), 0, most - 2) for each, most in ((row, rows), (column, columns))
        )
        south, east = row - north, column - west
        above = self.height_m[north, west] * (1.0 - east) + self.height_m[north, west + 1] * east
        below = self.height_m[north + 1, west] * (1.0 - east) + self.height_m[north + 1, west + 1] * east
        return np.where(covered, above * (1.0 - south) + below * south, np.nan)

    def _place(self, lat_rad: FloatArray, lon_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row and column, with fractions."""
        east = np.mod(np.asarray(lon_rad) - self.west_rad + math.pi, 2.0 * math.pi) - math.pi
        return (self.north_rad - np.asarray(lat_rad)) / self.step_rad[0], east / self.step_rad[1]

    def refuse_path(self, lat_rad: FloatArray, lon_rad: FloatArray) -> None:
        """Complain of a path (n,) that leaves the tile."""
        outside = ~self.covers(lat_rad, lon_rad)
        if outside.any():
            first = int(np.argmax(outside))
            lat, lon = math.degrees(np.asarray(lat_rad)[first]), math.degrees(np.asarray(lon_rad)[first])
            south = self.north_rad - (self.height_m.shape[0] - 1) * self.step_rad[0]
            east = self.west_rad + (self.height_m.shape[1] - 1) * self.step_rad[1]
            raise ElevationError(
                f"{self.name}: does not cover the path: {int(outside.sum())} of {outside.size} places are outside, the "
                f"first at latitude {lat:.5f}, longitude {lon:.5f}; it covers {math.degrees(south):.5f} to "
                f"{math.degrees(self.north_rad):.5f} and {math.degrees(self.west_rad):.5f} to {math.degrees(east):.5f}"
            )


def read_elevation_tile(path: Path | str, *, geoid_m: float, missing_m: float | None = None) -> ElevationTile:
    """A tile from a GeoTIFF.

    Parameters
    ----------
    path : path
    geoid_m : float
        Height of the geoid, which elevations are above, over the ellipsoid [m]; 0 for heights over the ellipsoid.
    missing_m : float, optional
        Elevation of cells without data, 0 where they are sea [m]; unless given, that of the highest cell: what is not
        known hides most.

    Raises
    ------
    ElevationError
        For a file that is not a GeoTIFF in degrees, or without heights.
    """
    import tifffile

    path = Path(path)
    try:
        with tifffile.TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            tags = dict(page.geotiff_tags or {})
            marked = page.tags.get(42113)
            values = np.asarray(page.asarray(), dtype=np.float64)
    except FileNotFoundError:
        raise ElevationError(f"{path}: no such file") from None
    except Exception as error:  # whatever a damaged file makes the reader raise
        raise ElevationError(f"{path}: cannot be read as a GeoTIFF: {' '.join(str(error).split())}") from None
    north_deg, west_deg, step_deg = _grid_deg(path, tags)
    values = _without_gaps(path, values, None if marked is None else str(marked.value), missing_m)
    return ElevationTile(
        name=path.name,
        north_rad=math.radians(north_deg),
        west_rad=math.radians(west_deg),
        step_rad=(math.radians(step_deg[1]), math.radians(step_deg[0])),
        height_m=values + geoid_m,
    )


def _grid_deg(path: Path, tags: dict[str, Any]) -> tuple[float, float, tuple[float, float]]:
    """Latitude and longitude of the centre of the first cell, and steps east and south [deg]."""
    scale, tie = tags.get("ModelPixelScale"), tags.get("ModelTiepoint")
    if scale is None or tie is None or len(tie) != 6:
        raise ElevationError(f"{path}: not a GeoTIFF: it does not say where its cells are (scale and one tie point)")
    if int(tags.get("GTModelTypeGeoKey", 0)) != 2:
        raise ElevationError(f"{path}: not in geographic coordinates; make it so with: gdalwarp -t_srs EPSG:4326")
    # Of an area (1) the tie point is a corner of the cell, of a point (2) its centre.
    half = 0.0 if int(tags.get("GTRasterTypeGeoKey", 1)) == 2 else 0.5
    column, row, _, lon_deg, lat_deg, _ = (float(each) for each in tie)
    step = float(scale[0]), float(scale[1])
    return lat_deg - (half - row) * step[1], lon_deg + (half - column) * step[0], step


def _without_gaps(path: Path, values: FloatArray, marked: str | None, missing_m: float | None) -> FloatArray:
    """Elevations with cells without data filled."""
    missing = ~np.isfinite(values)
    try:
        missing |= values == (math.nan if marked is None else float(marked.strip("\0 ")))
    except ValueError:
        raise ElevationError(f"{path}: its mark of cells without data, {marked!r}, is not a number") from None
    if values.ndim != 2 or missing.all():
        raise ElevationError(f"{path}: has no heights of one band")
    known = values[~missing]
    if known.max() > _HIGHEST_M or known.min() < _LOWEST_M:
        raise ElevationError(
            f"{path}: elevations from {known.min():.6g} to {known.max():.6g} m: must be {_LOWEST_M:g} to {_HIGHEST_M:g}"
        )
    return np.where(missing, known.max() if missing_m is None else missing_m, values)
