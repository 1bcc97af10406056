"""What an antenna on a turning aircraft sees, vector by vector, with axes turned by Rodrigues' formula."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def turned(vector: Vector, axis: Vector, angle_rad: float) -> Vector:
    """A vector turned about an axis, right-handed."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    result: Vector = vector * cosine + np.cross(axis, vector) * sine + axis * (axis @ vector) * (1.0 - cosine)
    return result


def body_axes(bank_rad: float, pitch_rad: float, heading_rad: float) -> tuple[Vector, Vector, Vector]:
    """Forward, right, up of the aircraft in east, north, up: heading clockwise, then nose up, then right wing down."""
    forward, right, up = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    forward, right = (turned(each, up, -heading_rad) for each in (forward, right))
    forward, up = (turned(each, right, pitch_rad) for each in (forward, up))
    right, up = (turned(each, forward, bank_rad) for each in (right, up))
    return forward, right, up


def antenna_elevations_rad(attitude: tuple[float, float, float], los_enu: Vector) -> Vector:
    """Elevations (N,) above the plane of an antenna on top of the aircraft, of lines of sight (3, N)."""
    _, _, up = body_axes(*attitude)
    result: Vector = np.array([math.pi / 2.0 - math.acos(max(-1.0, min(1.0, float(up @ each)))) for each in los_enu.T])
    return result


def first_loss_s(
    bank_of: Callable[[float], float], heading_rad: float, speed_mps: float, los_enu: Vector, limits: tuple[float, int],
    horizon_s: float,
) -> float:  # fmt: skip
    """When fewer satellites than required are above the antenna's horizon first, in steps of a hundredth of a second.

    limits are the horizon [rad] and the number of satellites.
    """
    step_s = 0.01
    for k in range(round(horizon_s / step_s) + 1):
        elevations = antenna_elevations_rad((bank_of(k * step_s), 0.0, heading_rad), los_enu)
        if (elevations >= limits[0]).sum() < limits[1]:
            return k * step_s
        heading_rad += step_s * 9.80665 * math.tan(bank_of((k + 0.5) * step_s)) / speed_mps
    return math.inf
