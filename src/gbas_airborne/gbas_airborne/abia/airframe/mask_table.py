"""Masking table: which directions of the body frame an antenna does not see.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.D: a satellite is seen if nothing of the aircraft is in the
way and it is above the antenna's elevation mask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import BoolArray, FloatArray

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
        azimuth, elevation = np.broadcast_arrays(azimuth_rad, np.asarray(elevation_rad, dtype=np.float64))
        return np.array(elevation)
    along = body_direction(azimuth_rad, elevation_rad) @ np.asarray(axis)
    return np.asarray(np.arcsin(np.clip(along, -1.0, 1.0)))


def body_direction(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> FloatArray:
    """Unit vectors ``(..., 3)``, forward, right, down, of directions ``(...)`` in the body frame."""
    azimuth, elevation = np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    level = np.cos(elevation)
    return np.stack(np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)), axis=-1)
