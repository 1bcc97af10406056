"""Masking table: which directions of the body frame an antenna does not see.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.D: a satellite is seen if nothing of the aircraft is in the
way and it is above the antenna's elevation mask.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_airborne.abia.airframe.mesh import Airframe
from gbas_core.record import BoolArray, FloatArray

# Cells in azimuth and elevation of the first rays, half a degree, and how many finer each way where they disagree. What
# is smaller than the first cells and stands alone may be missed.
_COARSE: Final = (720, 360)
_FINER: Final = 4
BODY_UP: Final = (0.0, 0.0, -1.0)
"""Axis of an antenna on top of the fuselage, forward, right, down."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MaskTable:
    """Directions of the body frame that are masked for one antenna.

    Attributes
    ----------
    blocked : (A, E) bool array
        Whether the airframe is in the way, in cells of equal size: azimuth from 0 to 360 degrees, elevation from -90
        to 90. A direction has the value of the cell it is in.
    horizon_rad : float
        Elevation in the antenna's frame below which it hears nothing of use [rad].
    axis : (float, float, float)
        Unit vector the antenna looks along, forward, right, down; elevations in its frame are 90 degrees there.
    """

    blocked: BoolArray
    horizon_rad: float
    axis: tuple[float, float, float] = BODY_UP

    def __post_init__(self) -> None:
        if self.blocked.ndim != 2 or 0 in self.blocked.shape or self.blocked.dtype != np.bool_:
            raise ValueError("mask table: blocked is not a table of booleans, azimuth x elevation")
        if not -0.5 * math.pi <= self.horizon_rad < 0.5 * math.pi:
            raise ValueError(f"mask table: horizon_rad = {self.horizon_rad!r} is not from -pi/2 to below pi/2")
        if not abs(math.hypot(*self.axis) - 1.0) < 1e-9:
            raise ValueError(f"mask table: axis = {self.axis!r} is not a unit vector")

    @classmethod
    def open_sky(cls, horizon_rad: float, *, axis: tuple[float, float, float] = BODY_UP) -> MaskTable:
        """No airframe: masked below the antenna's horizon [rad] only."""
        return cls(blocked=np.zeros((1, 1), dtype=bool), horizon_rad=horizon_rad, axis=axis)

    @classmethod
    def of_mesh(
        cls,
        mesh: Airframe,
        antenna_m: Sequence[float],
        *,
        horizon_rad: float = math.radians(5.0),
        axis: tuple[float, float, float] = BODY_UP,
    ) -> MaskTable:
        """Table of an antenna on an airframe; the last ones made are kept.

        Parameters
        ----------
        mesh : Airframe
        antenna_m : (float, float, float)
            Phase centre, forward, right, down [m].
        horizon_rad, axis
            See the attributes.

        Raises
        ------
        AirframeError
            For an antenna inside the body, or off it.
        """
        forward, right, down = (float(each) for each in antenna_m)
        return cls(blocked=_blocked(mesh, (forward, right, down)), horizon_rad=horizon_rad, axis=axis)

    def blocked_share(self, lowest_rad: float = 0.0) -> float:
        """Share of the sky above an elevation in the antenna's frame that the airframe hides [-]."""
        azimuth, elevation = _centres(*self.blocked.shape)
        seen = antenna_elevation_rad(azimuth, elevation, self.axis) >= lowest_rad
        size = np.cos(np.broadcast_to(elevation, seen.shape))
        return float(size[seen & self.blocked].sum() / size[seen].sum())

    def masked(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> BoolArray:
        """Whether directions of the body frame, any shape, are masked; a direction that is not finite is.

        Parameters
        ----------
        azimuth_rad : array
            From the nose clockwise seen from above; any turn of the circle [rad].
        elevation_rad : array
            Up from the plane of nose and wings, -pi/2 to pi/2 [rad].
        """
        azimuth, elevation = np.broadcast_arrays(
            np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
        )
        known = np.isfinite(azimuth) & (np.abs(elevation) <= 0.5 * math.pi)
        azimuth, elevation = np.where(known, azimuth, 0.0), np.where(known, elevation, 0.0)
        columns, rows = self.blocked.shape
        column = np.floor(azimuth * (columns / (2.0 * math.pi))).astype(np.intp) % columns
        row = np.minimum(((elevation / math.pi + 0.5) * rows).astype(np.intp), rows - 1)
        below = antenna_elevation_rad(azimuth, elevation, self.axis) < self.horizon_rad
        return np.asarray(~known | below | self.blocked[column, row])


def antenna_elevation_rad(
    azimuth_rad: ArrayLike, elevation_rad: ArrayLike, axis: tuple[float, float, float] = BODY_UP
) -> FloatArray:
    """Elevation in the frame of an antenna with that axis (forward, right, down) of directions in the body frame [rad].

    Source: Sabatini et al., eq (11), the rotation from body to antenna; its eq (1) to (3) are the place on the body.
    """
    if axis == BODY_UP:
        shape = np.broadcast_shapes(np.shape(azimuth_rad), np.shape(elevation_rad))
        return np.array(np.broadcast_to(np.asarray(elevation_rad, dtype=np.float64), shape))
    along = body_direction(azimuth_rad, elevation_rad) @ np.asarray(axis)
    return np.asarray(np.arcsin(np.clip(along, -1.0, 1.0)))


def body_direction(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> FloatArray:
    """Unit vectors ``(..., 3)``, forward, right, down, of directions ``(...)`` in the body frame."""
    azimuth, elevation = np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    level = np.cos(elevation)
    return np.stack(np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)), axis=-1)


@lru_cache(maxsize=16)
def _blocked(mesh: Airframe, place_m: tuple[float, float, float]) -> BoolArray:
    """Cells the airframe hides: half a degree wide, an eighth of one where neighbours differ."""
    mesh.refuse_place(place_m)
    azimuth, elevation = _centres(*_COARSE)
    coarse = mesh.stops(place_m, body_direction(azimuth, elevation).reshape(-1, 3)).reshape(_COARSE)
    blocked = np.repeat(np.repeat(coarse, _FINER, axis=0), _FINER, axis=1)
    edge = np.repeat(np.repeat(_at_edges(coarse), _FINER, axis=0), _FINER, axis=1)
    column, row = np.nonzero(edge)
    azimuth, elevation = _centres(*blocked.shape)
    blocked[edge] = mesh.stops(place_m, body_direction(azimuth[column, 0], elevation[0, row]))
    blocked.flags.writeable = False
    return blocked


def _at_edges(blocked: BoolArray) -> BoolArray:
    """Cells with a neighbour, the eight around, of another value."""
    columns = np.concatenate([blocked[-1:], blocked, blocked[:1]])
    around = np.pad(columns, ((0, 0), (1, 1)), mode="edge")
    edge = np.zeros_like(blocked)
    for right in range(3):
        for up in range(3):
            edge |= around[right : right + blocked.shape[0], up : up + blocked.shape[1]] != blocked
    return edge


def _centres(columns: int, rows: int) -> tuple[FloatArray, FloatArray]:
    """Azimuths (A, 1) and elevations (1, E) of the centres of cells [rad]."""
    azimuth: FloatArray = (np.arange(columns, dtype=np.float64) + 0.5) * (2.0 * math.pi / columns)
    elevation: FloatArray = (np.arange(rows, dtype=np.float64) + 0.5) * (math.pi / rows) - 0.5 * math.pi
    return azimuth[:, np.newaxis], elevation[np.newaxis, :]


def share_unlike_rays(
    table: MaskTable, mesh: Airframe, antenna_m: Sequence[float], *, rays: int = 65_536, seed: int = 1
) -> float:
    """Share of directions, evenly over the sphere, that the table has otherwise than a ray of their own [-]."""
    random = np.random.default_rng(seed)
    azimuth = random.uniform(0.0, 2.0 * math.pi, rays)
    elevation = np.arcsin(random.uniform(-1.0, 1.0, rays))
    whole = MaskTable(blocked=table.blocked, horizon_rad=-0.5 * math.pi)
    return float(np.mean(whole.masked(azimuth, elevation) != mesh.stops(antenna_m, body_direction(azimuth, elevation))))


@dataclass(frozen=True, kw_only=True, eq=False)
class AntennaMasks:
    """Several antennas on one receiver, which takes each satellite from the one that hears it best.

    Attributes
    ----------
    tables : tuple of MaskTable
    """

    tables: tuple[MaskTable, ...]

    def __post_init__(self) -> None:
        if not self.tables:
            raise ValueError("antennas: there is none")

    def masked(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> BoolArray:
        """Whether no antenna sees a direction; as :meth:`MaskTable.masked`."""
        masked = self.tables[0].masked(azimuth_rad, elevation_rad)
        for table in self.tables[1:]:
            masked = masked & table.masked(azimuth_rad, elevation_rad)
        return masked

    def elevation_rad(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> FloatArray:
        """Elevation in the frame of the antenna that sees a direction highest; NaN where none sees it [rad]."""
        seen = [
            np.where(
                table.masked(azimuth_rad, elevation_rad),
                np.nan,
                antenna_elevation_rad(azimuth_rad, elevation_rad, table.axis),
            )
            for table in self.tables
        ]
        return np.asarray(np.fmax.reduce(seen))
