"""An approach laid out: a track over the ground that ends on the final approach path, flown at a given airspeed.

The track is a curve in the approach frame, counted in horizontal distance to go from the threshold: the final course,
and for a curved approach an arc whose curvature grows and shrinks smoothly, and the tangent before it. Its height is
that of the final approach path, whose slope goes on around the arc, up to where level flight meets it; there the slope
changes smoothly. Level means a constant height above the ellipsoid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.atmosphere import STANDARD_GRAVITY_MPS2
from gbas_sim.flight.dynamics.legs import Track
from gbas_sim.flight.dynamics.segments import Approach, CurvedApproach
from gbas_sim.flight.dynamics.smooth import STEEPEST, pulse_area, step
from gbas_sim.flight.dynamics.wind import Wind

_SPACING_M: Final = 10.0
_HEIGHT_ITERATIONS: Final = 4
# The longest lead-in is 3600 s; the track is laid out for twice the distance flown in the air, wind included.
_MARGIN: Final = 2.0


@dataclass(frozen=True, kw_only=True)
class GroundTrack:
    """The track of an approach by distance to go.

    Attributes
    ----------
    approach : FinalApproach
    segment : StraightInApproach or CurvedApproach
    intercept_distance_m : float
        Where level flight would meet the path, along the track from the threshold [m].
    ends_at_m : float
        Distance to go where the approach ends: 0, or where it is given up.
    """

    approach: FinalApproach
    segment: Approach
    intercept_distance_m: float
    ends_at_m: float = 0.0

    @property
    def pushover_m(self) -> float:
        """Distance over which the slope changes."""
        return self.segment.speed_mps * self.segment.pushover_time_s

    @property
    def arc_m(self) -> tuple[float, float]:
        """Length of the arc, and how much of it the curvature takes to grow or to shrink [m]."""
        if not isinstance(self.segment, CurvedApproach):
            return 0.0, 1.0
        speed = self.segment.speed_mps
        bank = math.atan(speed**2 / (STANDARD_GRAVITY_MPS2 * self.segment.radius_m))
        edge = speed * STEEPEST * bank / self.segment.roll_rate_radps
        return self.segment.radius_m * abs(self.segment.turn_rad) + edge, edge

    @property
    def settled_m(self) -> float:
        """Distance to go from which on track and slope change: before it all is straight and level."""
        level = self.intercept_distance_m + 0.5 * self.pushover_m
        if not isinstance(self.segment, CurvedApproach):
            return level
        return max(level, self.segment.join_distance_m + self.arc_m[0])

    def check(self) -> None:
        """Raise ValueError when the parts of the approach do not fit together."""
        kind = self.segment.kind
        if self.intercept_distance_m - 0.5 * self.pushover_m <= self.ends_at_m:
            raise ValueError(
                f"{kind}: intercept_distance_m = {self.intercept_distance_m:.0f} leaves no room for the descent: the"
                f" pushover takes {self.pushover_m:.0f} m around it and the approach ends at {self.ends_at_m:.0f} m"
            )
        if isinstance(self.segment, CurvedApproach):
            if self.segment.join_distance_m < self.ends_at_m:
                raise ValueError(
                    f"{kind}: join_distance_m = {self.segment.join_distance_m!r} is behind where the approach ends"
                )
            length, edge = self.arc_m
            if length < 2.0 * edge:
                raise ValueError(f"{kind}: roll_rate_radps is too low to reach the bank in a turn this short")

    @cached_property
    def _curve(self) -> CubicSpline:
        """ECEF positions [m] over distance to go [m]."""
        flown_m = (self.segment.level_time_s + 10.0) * self.segment.speed_mps
        farthest = self.settled_m + _MARGIN * flown_m + 1000.0
        distance = np.arange(self.ends_at_m - 20.0 * _SPACING_M, farthest, _SPACING_M)
        flat = self._flat(distance)
        path = self.approach.path_height_m(distance)
        on_path = self.approach.ecef_from_approach(np.concatenate([flat, path[:, np.newaxis]], axis=-1))
        height = self._height(distance, geodetic_from_ecef(on_path)[2])
        z = path.copy()
        for _ in range(_HEIGHT_ITERATIONS):
            position = self.approach.ecef_from_approach(np.concatenate([flat, z[:, np.newaxis]], axis=-1))
            z += height - geodetic_from_ecef(position)[2]
        straight = distance <= self.intercept_distance_m - 0.5 * self.pushover_m
        z = np.where(straight, path, z)
        return CubicSpline(
            distance, self.approach.ecef_from_approach(np.concatenate([flat, z[:, np.newaxis]], axis=-1))
        )

    def _flat(self, distance_m: FloatArray) -> FloatArray:
        """x and y in the approach frame (n, 2) [m] at evenly spaced distances to go, the threshold among them."""
        if not isinstance(self.segment, CurvedApproach):
            return np.stack([-distance_m, np.zeros_like(distance_m)], axis=-1)
        length, edge = self.arc_m
        since_join = distance_m - self.segment.join_distance_m
        turned = pulse_area(since_join, length, edge) / (length - edge)
        direction = self.segment.turn_rad * turned
        steps = CubicSpline(distance_m, np.stack([-np.cos(direction), -np.sin(direction)], axis=-1))
        along = steps.antiderivative()
        result: FloatArray = along(distance_m) - along(0.0)
        # The final course is straight: no rounding on it.
        on_final = since_join <= 0.0
        result[on_final] = np.stack([-distance_m[on_final], np.zeros(int(on_final.sum()))], axis=-1)
        return result

    def _height(self, distance_m: FloatArray, path_m: FloatArray) -> FloatArray:
        """Height above the ellipsoid [m]: the path's slope, fading to none around the intercept."""
        first = self.intercept_distance_m - 0.5 * self.pushover_m
        slope = CubicSpline(distance_m, path_m).derivative()(distance_m)
        slope *= 1.0 - step((distance_m - first) / self.pushover_m)
        height = CubicSpline(distance_m, slope).antiderivative()(distance_m)
        result: FloatArray = height + np.interp(self.ends_at_m, distance_m, path_m - height)
        return result

    def at(self, distance_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """ECEF positions (..., 3) [m], and their derivatives by distance to go."""
        return self._curve(distance_m), self._curve(distance_m, 1)


@dataclass(frozen=True, kw_only=True)
class ApproachLeg:
    """An approach at its speeds, through the wind.

    Attributes
    ----------
    ground : GroundTrack
    speeds_mps, landings : (float, float)
        Airspeed and configuration (0 to 1) at the start, and down the path.
    wind : Wind
    """

    ground: GroundTrack
    speeds_mps: tuple[float, float]
    landings: tuple[float, float]
    wind: Wind

    def __post_init__(self) -> None:
        self.ground.check()
        segment = self.ground.segment
        if segment.level_time_s == 0.0 and (
            self.speeds_mps[0] != self.speeds_mps[1] or self.landings[0] != self.landings[1]
        ):
            raise ValueError(
                f"{segment.kind}: level_time_s = 0 leaves no time to change speed or configuration: the manoeuvre"
                f" before must end with speed_mps: {self.speeds_mps[1]:g} and configuration: landing"
            )

    @property
    def duration_s(self) -> float:
        """How long it takes [s]."""
        return self._descent_s + self.ground.segment.level_time_s

    def track(self, time_s: FloatArray) -> Track:
        """Samples at times (T,) since its start [s]."""
        before_end = self.duration_s - np.asarray(time_s, dtype=np.float64)
        distance = self._distance(before_end)
        position, by_distance = self.ground.at(distance)
        lat, lon, height = geodetic_from_ecef(position)
        rot = rot_enu_ecef(lat, lon)
        enu = np.einsum("...ij,...j->...i", rot, by_distance)
        speed = self._speed(before_end)
        velocity = -enu * self._closing_mps(enu, height, speed)[..., np.newaxis]
        out = self._share(before_end)
        return Track(
            lat_rad=lat,
            lon_rad=lon,
            height_m=height,
            ground_enu_mps=velocity,
            landing=self.landings[0] + (self.landings[1] - self.landings[0]) * out,
        )

    def _closing_mps(self, by_distance_enu: FloatArray, height_m: FloatArray, speed_mps: FloatArray) -> FloatArray:
        """How fast the distance to go shrinks when the airspeed is as given [m/s]."""
        wind_mps, _ = self.wind.at(height_m)
        length = np.linalg.norm(by_distance_enu, axis=-1)
        direction = -by_distance_enu / length[..., np.newaxis]
        tail = direction[..., 0] * wind_mps[..., 0] + direction[..., 1] * wind_mps[..., 1]
        square = speed_mps**2 - np.sum(wind_mps**2, axis=-1) + tail**2
        if np.any(square <= 0.0):
            raise ValueError(f"{self.ground.segment.kind}: the wind across the track is more than the airspeed")
        result: FloatArray = (tail + np.sqrt(square)) / length
        if np.any(result <= 1.0):
            raise ValueError(f"{self.ground.segment.kind}: the wind against the track is nearly the airspeed")
        return result

    def _share(self, before_end_s: FloatArray) -> FloatArray:
        """How much of the change of speed and configuration is made, over the lead-in [0 to 1]."""
        lead_s = self.ground.segment.level_time_s
        if lead_s == 0.0:
            return np.ones_like(before_end_s)
        return 1.0 - step((before_end_s - self._descent_s) / lead_s)

    def _speed(self, before_end_s: FloatArray) -> FloatArray:
        return self.speeds_mps[0] + (self.speeds_mps[1] - self.speeds_mps[0]) * self._share(before_end_s)

    @cached_property
    def _descent_s(self) -> float:
        """From where track and slope begin to change to the end [s], at a constant airspeed."""
        distance = np.linspace(self.ground.ends_at_m, self.ground.settled_m, 2000)
        position, by_distance = self.ground.at(distance)
        lat, lon, height = geodetic_from_ecef(position)
        enu = np.einsum("...ij,...j->...i", rot_enu_ecef(lat, lon), by_distance)
        closing = self._closing_mps(enu, height, np.full_like(distance, self.speeds_mps[1]))
        return float(CubicSpline(distance, 1.0 / closing).integrate(distance[0], distance[-1]))

    @cached_property
    def _distance(self) -> CubicSpline:
        """Distance to go [m] over time to go [s]."""

        def rate(before_end_s: float, distance_m: FloatArray) -> FloatArray:
            position, by_distance = self.ground.at(distance_m)
            lat, lon, height = geodetic_from_ecef(position)
            enu = np.einsum("...ij,...j->...i", rot_enu_ecef(lat, lon), by_distance)
            return self._closing_mps(enu, height, self._speed(np.full(1, before_end_s)))

        times = np.linspace(0.0, self.duration_s, max(int(self.duration_s / 0.1), 10))
        solved = solve_ivp(
            rate, (0.0, self.duration_s), [self.ground.ends_at_m], method="DOP853", t_eval=times,
            rtol=1e-11, atol=1e-7, max_step=5.0,
        )  # fmt: skip
        slopes = [rate(end, solved.y[:, index])[0] for end, index in ((0.0, 0), (self.duration_s, -1))]
        return CubicSpline(times, solved.y[0], bc_type=((1, np.array(slopes[0])), (1, np.array(slopes[1]))))


def approach_leg(
    segment: Approach,
    approach: FinalApproach,
    speeds_mps: tuple[float, float],
    landings: tuple[float, float],
    wind: Wind,
    ends_at_m: float,
) -> ApproachLeg:
    """Lay out an approach, looking for the intercept that makes it last as long as asked.

    Raises
    ------
    ValueError
        When its parts do not fit together, or it cannot last that long.
    """

    def leg(intercept_distance_m: float) -> ApproachLeg:
        ground = GroundTrack(
            approach=approach, segment=segment, intercept_distance_m=intercept_distance_m, ends_at_m=ends_at_m
        )
        return ApproachLeg(ground=ground, speeds_mps=speeds_mps, landings=landings, wind=wind)

    if segment.intercept_distance_m is not None:
        return leg(segment.intercept_distance_m)
    wanted = segment.duration_s
    assert wanted is not None
    shortest = ends_at_m + 0.51 * segment.speed_mps * segment.pushover_time_s + 10.0
    if leg(shortest).duration_s > wanted:
        raise ValueError(f"{segment.kind}: duration_s = {wanted!r} is too short for its turn and its pushover")
    longest = shortest + 3.0 * wanted * segment.speed_mps
    return leg(float(brentq(lambda distance: leg(distance).duration_s - wanted, shortest, longest, xtol=1e-6)))
