"""Satellites in view of an aircraft by its position and attitude, and what hides the others.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_airborne.abia.airframe.mask_table import AntennaMasks, MaskTable
from gbas_airborne.abia.terrain.elevation_tile import ElevationTile
from gbas_airborne.abia.terrain.horizon import Horizon, limb_rad, terrain_horizon
from gbas_core.gnss.attitude import body_azimuth_elevation, rot_euler
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import azimuth_elevation, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS

_NEW_HORIZON_M: Final = 50.0
"""An aircraft that has moved less than this sees the terrain as before."""
_USABLE_S: Final = 2.0 * 3600.0


class HiddenBy(IntEnum):
    """Why a satellite is not in view; the first that holds."""

    NOTHING = 0
    UNKNOWN = 1
    EARTH = 2
    TERRAIN = 3
    AIRCRAFT = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A flown or planned path, (T,) instants.

    Attributes
    ----------
    gps_week : int
    tow_s : (T,) array
        May go beyond the end of the week [s].
    position_m : (T, 3) array
        Of the antenna, ECEF [m].
    roll_rad, pitch_rad, heading_rad : (T,) arrays
        NaN is not known: then nothing is in view.
    """

    gps_week: int
    tow_s: FloatArray
    position_m: FloatArray
    roll_rad: FloatArray
    pitch_rad: FloatArray
    heading_rad: FloatArray

    def __post_init__(self) -> None:
        count = len(self.tow_s)
        if self.position_m.shape != (count, 3):
            raise ValueError(f"path: position_m has shape {self.position_m.shape} for {count} times")
        for name in ("roll_rad", "pitch_rad", "heading_rad"):
            if getattr(self, name).shape != (count,):
                raise ValueError(f"path: {name} has shape {getattr(self, name).shape} for {count} times")


@dataclass(frozen=True, kw_only=True, eq=False)
class Visibility:
    """Satellites along a path, ``(T, N_SATS)``; NaN where a satellite or the attitude is not known.

    Attributes
    ----------
    azimuth_rad, elevation_rad : array
        Local, from north clockwise, above the horizon [rad].
    body_azimuth_rad, body_elevation_rad : array
        In the body frame [rad].
    los_enu : (T, 3, N_SATS) array
    range_m : array
    hidden_by : int8 array
        :class:`HiddenBy`.
    terrain_covered_m : (T,) array
        How far the terrain was known in the direction where it is least [m]; 0 without a tile.
    """

    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    body_azimuth_rad: FloatArray
    body_elevation_rad: FloatArray
    los_enu: FloatArray
    range_m: FloatArray
    hidden_by: NDArray[np.int8]
    terrain_covered_m: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def in_view(self) -> BoolArray:
        """Satellites nothing hides, (T, N_SATS)."""
        return np.asarray(self.hidden_by == HiddenBy.NOTHING)


def satellites_in_view(
    ephemeris: Ephemeris,
    path: Path,
    masks: MaskTable | AntennaMasks,
    *,
    lowest_rad: float = math.radians(5.0),
    tile: ElevationTile | None = None,
) -> Visibility:
    """What is in view along a path.

    Parameters
    ----------
    ephemeris : Ephemeris
        Broadcast, or of an almanac (:func:`gbas_core.gnss.almanac.ephemeris_from_almanac`). Satellites that are not
        healthy are unknown; broadcast ephemerides more than two hours from their reference time are, too.
    path : Path
    masks : MaskTable or AntennaMasks
    lowest_rad : float
        Lowest elevation above the local horizon that a receiver uses [rad].
    tile : ElevationTile, optional
        Terrain; it must cover the path.

    Raises
    ------
    ElevationError
        For a tile that does not cover the path.
    """
    state = predicted_state(ephemeris, path.gps_week, path.tow_s[:, np.newaxis], path.position_m, None)
    range_m, los = rotated_range(path.position_m, state.position_m)
    lat, lon, height = geodetic_from_ecef(path.position_m)
    los_enu = rot_enu_ecef(lat, lon) @ los
    azimuth, elevation = azimuth_elevation(los_enu)
    rot = rot_euler(path.roll_rad, path.pitch_rad, path.heading_rad)
    body_azimuth, body_elevation = body_azimuth_elevation(rot, los_enu)
    low = elevation < np.maximum(lowest_rad, limb_rad(height))[:, np.newaxis]
    shadowed, covered_m = _by_terrain(tile, (lat, lon, height), azimuth, elevation)
    unknown = ~_usable(ephemeris, path) | ~np.isfinite(elevation) | ~np.isfinite(body_elevation)
    hidden = np.select(
        [unknown, low, shadowed, masks.masked(body_azimuth, body_elevation)],
        [HiddenBy.UNKNOWN, HiddenBy.EARTH, HiddenBy.TERRAIN, HiddenBy.AIRCRAFT],
        HiddenBy.NOTHING,
    )
    return Visibility(
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        body_azimuth_rad=body_azimuth,
        body_elevation_rad=body_elevation,
        los_enu=los_enu,
        range_m=range_m,
        hidden_by=hidden.astype(np.int8),
        terrain_covered_m=covered_m,
    )


def _usable(ephemeris: Ephemeris, path: Path) -> BoolArray:
    """Healthy satellites, and near enough to the reference time of what was broadcast, (T, N_SATS)."""
    usable = np.broadcast_to(ephemeris.health == 0.0, (len(path.tow_s), N_SATS))
    if ephemeris.simulated == 1.0:
        return usable
    since_s = path.tow_s[:, np.newaxis] - ephemeris.toe_tow_s + 604_800.0 * (path.gps_week - ephemeris.toe_week)
    with np.errstate(invalid="ignore"):
        return np.asarray(usable & (np.abs(since_s) <= _USABLE_S))


def _by_terrain(
    tile: ElevationTile | None,
    place: tuple[FloatArray, FloatArray, FloatArray],
    azimuth_rad: ArrayLike,
    elevation_rad: FloatArray,
) -> tuple[BoolArray, FloatArray]:
    """Satellites behind the terrain, and how far it is known; a horizon is made anew every few cells of the way."""
    lat, lon, height = place
    shadowed = np.zeros(elevation_rad.shape, dtype=bool)
    covered_m = np.zeros(len(lat))
    if tile is None:
        return shadowed, covered_m
    tile.refuse_path(lat, lon)
    azimuth, horizon, at = np.asarray(azimuth_rad), None, (math.inf, math.inf, math.inf)
    for number, here in enumerate(zip(lat.tolist(), lon.tolist(), height.tolist(), strict=True)):
        if horizon is None or _moved_m(at, here) > _NEW_HORIZON_M:
            horizon, at = terrain_horizon(tile, *here), here
        assert isinstance(horizon, Horizon)
        shadowed[number] = horizon.masked(azimuth[number], elevation_rad[number])
        covered_m[number] = horizon.covered_m.min()
    return shadowed, covered_m


def _moved_m(before: tuple[float, float, float], now: tuple[float, float, float]) -> float:
    north = 6.4e6 * (now[0] - before[0])
    east = 6.4e6 * (now[1] - before[1]) * math.cos(now[0])
    return math.hypot(north, east, now[2] - before[2])
