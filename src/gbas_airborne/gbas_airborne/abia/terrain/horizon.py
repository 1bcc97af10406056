"""The horizon of an aircraft: the Earth's limb, and the terrain of a tile above it.

The Earth is a sphere of the mean radius about the place. Rays are straight: refraction lifts satellites and terrain
alike, by less than a tenth of a degree above 5 degrees of elevation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_airborne.abia.terrain.elevation_tile import ElevationTile
from gbas_core.record import BoolArray, FloatArray

EARTH_RADIUS_M: Final = 6_371_000.0
_AZIMUTHS: Final = 720
_NEAREST_CELLS: Final = 0.5
_GROWTH: Final = 1.01
"""Of the way from one sample of the terrain to the next, beyond a hundred cells."""


def limb_rad(height_m: ArrayLike) -> FloatArray:
    """Elevation of the Earth's limb from a height above it [rad]: 0 at the ground and below, negative above."""
    above = np.maximum(np.asarray(height_m, dtype=np.float64), 0.0)
    return np.asarray(-np.arccos(EARTH_RADIUS_M / (EARTH_RADIUS_M + above)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon:
    """Elevation below which the sky is hidden, in directions evenly around the circle.

    Attributes
    ----------
    elevation_rad : (A,) array
        From north clockwise [rad].
    covered_m : (A,) array
        How far the tile knows the terrain [m]; beyond, up to where it could still be seen, the ground was taken to be
        as high everywhere as the tile is at most. 0 without a tile: then nothing but the limb is known.
    """

    elevation_rad: FloatArray
    covered_m: FloatArray

    def masked(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> BoolArray:
        """Whether directions, azimuth from north clockwise, are below the horizon; one that is not finite is."""
        azimuth, elevation = np.broadcast_arrays(
            np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
        )
        known = np.isfinite(azimuth) & np.isfinite(elevation)
        count = len(self.elevation_rad)
        place = np.floor(np.where(known, azimuth, 0.0) * (count / (2.0 * math.pi))).astype(np.intp)
        # The higher of the directions on both sides.
        bound = np.maximum(self.elevation_rad[place % count], self.elevation_rad[(place + 1) % count])
        return np.asarray(~known | (elevation < bound))


def open_horizon(height_m: float) -> Horizon:
    """No terrain: the Earth's limb from a height above the ellipsoid [m]."""
    return Horizon(elevation_rad=np.full(1, float(limb_rad(height_m))), covered_m=np.zeros(1))


def terrain_horizon(tile: ElevationTile, lat_rad: float, lon_rad: float, height_m: float) -> Horizon:
    """Horizon of a place over a tile.

    Parameters
    ----------
    tile : ElevationTile
    lat_rad, lon_rad, height_m : float
        Place of the antenna; height above the ellipsoid [m].

    Raises
    ------
    ElevationError
        For a place the tile does not cover.
    """
    tile.refuse_path(np.array([lat_rad]), np.array([lon_rad]))
    azimuth: FloatArray = np.arange(_AZIMUTHS, dtype=np.float64) * (2.0 * math.pi / _AZIMUTHS)
    distance = _distances_m(tile, lat_rad, height_m)
    lat, lon = _walk(lat_rad, lon_rad, azimuth[:, np.newaxis], distance)
    covered = np.logical_and.accumulate(tile.covers(lat, lon), axis=1)
    ground_m = np.where(covered, tile.at(lat, lon), tile.highest_m)
    angle = distance / EARTH_RADIUS_M
    rise = (EARTH_RADIUS_M + ground_m) * np.cos(angle) - (EARTH_RADIUS_M + height_m)
    seen = np.arctan2(rise, (EARTH_RADIUS_M + ground_m) * np.sin(angle))
    count = covered.sum(axis=1)
    covered_m = np.where(count > 0, distance[np.maximum(count - 1, 0)], 0.0)
    return Horizon(elevation_rad=np.maximum(seen.max(axis=1), limb_rad(height_m)), covered_m=covered_m)


def _distances_m(tile: ElevationTile, lat_rad: float, height_m: float) -> FloatArray:
    """Where the terrain is looked at, (D,): by cells near by, then farther apart, to where the highest sinks away."""
    cell_m = EARTH_RADIUS_M * min(tile.step_rad[0], tile.step_rad[1] * math.cos(lat_rad))
    farthest_m = sum(
        EARTH_RADIUS_M * math.acos(EARTH_RADIUS_M / (EARTH_RADIUS_M + max(each, 0.0)))
        for each in (height_m, tile.highest_m)
    )
    distances = [_NEAREST_CELLS * cell_m]
    while distances[-1] < farthest_m:
        distances.append(max(distances[-1] + _NEAREST_CELLS * cell_m, distances[-1] * _GROWTH))
    return np.array(distances)


def _walk(
    lat_rad: float, lon_rad: float, azimuth_rad: FloatArray, distance_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where one comes along great circles."""
    angle = distance_m / EARTH_RADIUS_M
    sine = math.sin(lat_rad) * np.cos(angle) + math.cos(lat_rad) * np.sin(angle) * np.cos(azimuth_rad)
    east = np.arctan2(np.sin(azimuth_rad) * np.sin(angle) * math.cos(lat_rad), np.cos(angle) - math.sin(lat_rad) * sine)
    return np.arcsin(np.clip(sine, -1.0, 1.0)), lon_rad + east
