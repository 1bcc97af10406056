"""Where the aircraft is: level on the extended final course, then down the final approach path to the threshold.

The horizontal speed is constant. Height follows from the distance to the threshold; between level flight and descent
the slope changes along half a cosine, so that acceleration and jerk stay small and continuous position, velocity and
acceleration leave no step in a carrier phase.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.parameters import Parameter, parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray


@parameters
class StraightInParams:
    """A straight-in approach on whichever final approach the station has."""

    speed_mps: Annotated[float, Parameter("along the path in descent", "m/s", 10.0, 200.0)] = 70.0
    intercept_distance_m: Annotated[
        float, Parameter("from the threshold to where level flight meets the path", "m", 500.0, 50_000.0)
    ] = 20_000.0
    level_time_s: Annotated[
        float, Parameter("in level flight before that: filters on the ground and on board settle", "s", 0.0, 1800.0)
    ] = 300.0
    pushover_time_s: Annotated[float, Parameter("duration of the change of slope, centred there", "s", 2.0, 60.0)] = (
        20.0
    )


@parameters
class StraightIn(StraightInParams):
    """A straight-in approach on a final approach."""

    approach: FinalApproach

    def __post_init__(self) -> None:
        if self._blend_m > 2.0 * self.intercept_distance_m:
            raise ValueError(
                f"flight: pushover_time_s = {self.pushover_time_s!r} is more than the descent from the intercept allows"
            )

    @cached_property
    def ground_speed_mps(self) -> float:
        """Horizontal speed in the approach frame [m/s]."""
        return self.speed_mps * math.cos(self.approach.gpa_rad)

    @cached_property
    def _blend_m(self) -> float:
        return self.ground_speed_mps * self.pushover_time_s

    @cached_property
    def duration_s(self) -> float:
        """From the start to the threshold [s]."""
        return self.level_time_s + self.intercept_distance_m / self.ground_speed_mps

    def state(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Position and velocity.

        Parameters
        ----------
        since_start_s : (...) array
            Time since the start of the flight [s].

        Returns
        -------
        position_m, velocity_mps : (..., 3) arrays
            ECEF [m], [m/s].
        """
        since = np.asarray(since_start_s, dtype=np.float64)
        x = self.ground_speed_mps * (since - self.duration_s)
        height, slope = self._profile(-x)
        zero = np.zeros_like(x)
        velocity = self.ground_speed_mps * np.stack([zero + 1.0, zero, -slope], axis=-1)
        ecef_velocity: FloatArray = velocity @ self.approach.rot_approach_ecef
        return self.approach.ecef_from_approach(np.stack([x, zero, height], axis=-1)), ecef_velocity

    def antenna_axis(self, since_start_s: ArrayLike) -> None:
        """None: the antenna always points straight up."""

    def attitude(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Roll, pitch, true heading (0 to 2 pi) [rad]: always level, along the ground track."""
        position_m, velocity_mps = self.state(since_start_s)
        latitude, longitude, _ = geodetic_from_ecef(position_m)
        moving = np.einsum("...ij,...j->...i", rot_enu_ecef(latitude, longitude), velocity_mps)
        level = np.zeros(moving.shape[:-1])
        return level, level, np.mod(np.arctan2(moving[..., 0], moving[..., 1]), 2.0 * np.pi)

    def _profile(self, distance_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Height [m] and slope over the distance to the threshold; half a cosine joins descent and level flight."""
        steepest = math.tan(self.approach.gpa_rad)
        phase = np.clip((distance_m - self.intercept_distance_m) / self._blend_m, -0.5, 0.5)
        slope = steepest * 0.5 * (1.0 - np.sin(np.pi * phase))
        lowest_m = self.intercept_distance_m - 0.5 * self._blend_m
        risen = 0.5 * (phase + 0.5) + np.cos(np.pi * phase) / (2.0 * np.pi)
        height = self.approach.path_height_m(np.minimum(distance_m, lowest_m)) + steepest * self._blend_m * risen
        return height, slope
