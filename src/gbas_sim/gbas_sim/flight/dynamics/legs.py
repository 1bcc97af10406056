"""Manoeuvres laid out in time and space: where the plan is, and how fast, at every instant of one of them.

All but approaches are schedules of airspeed, heading and vertical speed, whose motion through the air and the wind give
the track. Approaches are tracks over the ground, flown at a given airspeed (:mod:`approach_legs`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Protocol

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp
from scipy.optimize import brentq

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.atmosphere import STANDARD_GRAVITY_MPS2
from gbas_sim.flight.dynamics.earth import radii_of_curvature_m
from gbas_sim.flight.dynamics.segments import Climb, Cruise, Descent, MissedApproach, Segment, Turn
from gbas_sim.flight.dynamics.smooth import STEEPEST, pulse, pulse_area, step, step_area
from gbas_sim.flight.dynamics.wind import Wind

# Of the track's integration: latitude and longitude from the anchor [rad], 1e-13 is less than a micrometre.
_TRACK_TOLERANCE: Final = 1e-13
_TRACK_STEP_S: Final = 5.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """Samples of a plan at instants (T,).

    Attributes
    ----------
    lat_rad, lon_rad, height_m : (T,) arrays
    ground_enu_mps : (T, 3) array
        Velocity over the ground, east, north, up [m/s].
    landing : (T,) array
        How far the landing configuration is out, 0 to 1.
    """

    lat_rad: FloatArray
    lon_rad: FloatArray
    height_m: FloatArray
    ground_enu_mps: FloatArray
    landing: FloatArray


class Leg(Protocol):
    """A manoeuvre laid out."""

    @property
    def duration_s(self) -> float:
        """How long it takes [s]."""

    def track(self, time_s: FloatArray) -> Track:
        """Samples at times (T,) since its start [s]."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """Where two legs meet.

    Attributes
    ----------
    lat_rad, lon_rad, height_m : float
    heading_rad : float
        Of the motion through the air [rad].
    vertical_mps : float
        Vertical speed [m/s].
    """

    lat_rad: float
    lon_rad: float
    height_m: float
    heading_rad: float
    vertical_mps: float = 0.0


def joint_of(track: Track, wind: Wind) -> Joint:
    """The last instant of a track as a joint."""
    wind_mps, _ = wind.at(track.height_m[-1])
    east, north = track.ground_enu_mps[-1, :2] - wind_mps
    return Joint(
        lat_rad=float(track.lat_rad[-1]),
        lon_rad=float(track.lon_rad[-1]),
        height_m=float(track.height_m[-1]),
        heading_rad=math.atan2(east, north),
        vertical_mps=float(track.ground_enu_mps[-1, 2]),
    )


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """What a manoeuvre does to speed, heading and height, whatever the place it starts from.

    Attributes
    ----------
    duration_s : float
    speeds_mps, landings : (float, float)
        Airspeed and configuration (0 to 1) at the start and at the end.
    heading_change_rad, turn_edge_s : float
        Change of heading, and how long the rate of turn takes to grow and to shrink.
    climb_mps, climb_edge_s : float
        Vertical speed between the edges, and how long these are.
    vertical_mps : float
        Vertical speed at the start; it ends with the first edge.
    """

    duration_s: float
    speeds_mps: tuple[float, float]
    landings: tuple[float, float]
    heading_change_rad: float = 0.0
    turn_edge_s: float = 1.0
    climb_mps: float = 0.0
    climb_edge_s: float = 1.0
    vertical_mps: float = 0.0

    @property
    def height_change_m(self) -> float:
        """From start to end."""
        return self.climb_mps * (self.duration_s - self.climb_edge_s) + 0.5 * self.vertical_mps * self.climb_edge_s

    def heading_rad(self, time_s: FloatArray) -> FloatArray:
        """Change of heading since the start [rad]."""
        turned = pulse_area(time_s, self.duration_s, self.turn_edge_s)
        return self.heading_change_rad * turned / (self.duration_s - self.turn_edge_s)

    def vertical(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of height since the start [m], and vertical speed [m/s]."""
        edge_s = self.climb_edge_s
        risen = self.climb_mps * pulse_area(time_s, self.duration_s, edge_s)
        risen += self.vertical_mps * (time_s - edge_s * step_area(time_s / edge_s))
        rate = self.climb_mps * pulse(time_s, self.duration_s, edge_s)
        return risen, rate + self.vertical_mps * (1.0 - step(time_s / edge_s))

    def blend(self, ends: tuple[float, float], time_s: FloatArray) -> FloatArray:
        """From the first to the second value over the whole duration."""
        return ends[0] + (ends[1] - ends[0]) * step(time_s / self.duration_s)


@dataclass(frozen=True, kw_only=True)
class ScheduledLeg:
    """A schedule flown from, or to, a joint.

    Attributes
    ----------
    schedule : Schedule
    joint : Joint
        Its start, or its end when `backward`.
    backward : bool
    wind : Wind
    """

    schedule: Schedule
    joint: Joint
    backward: bool
    wind: Wind

    @property
    def duration_s(self) -> float:
        """How long it takes [s]."""
        return self.schedule.duration_s

    def track(self, time_s: FloatArray) -> Track:
        """Samples at times (T,) since its start [s]."""
        height, velocity = self._motion(time_s)
        moved = self._solution(time_s)
        return Track(
            lat_rad=self.joint.lat_rad + moved[0],
            lon_rad=self.joint.lon_rad + moved[1],
            height_m=height,
            ground_enu_mps=velocity,
            landing=self.schedule.blend(self.schedule.landings, time_s),
        )

    def _motion(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Height (T,) [m] and velocity over the ground (T, 3) [m/s]."""
        plan, joint = self.schedule, self.joint
        risen, vertical = plan.vertical(time_s)
        heading = joint.heading_rad + plan.heading_rad(time_s)
        height = joint.height_m + risen
        if self.backward:
            heading = heading - plan.heading_change_rad
            height = height - plan.height_change_m
        speed = plan.blend(plan.speeds_mps, time_s)
        if np.any(np.abs(vertical) >= 0.9 * speed):
            raise ValueError(f"vertical speed {np.max(np.abs(vertical)):.1f} m/s is nearly the airspeed")
        level = np.sqrt(speed**2 - vertical**2)
        wind_mps, _ = self.wind.at(height)
        east, north = level * np.sin(heading) + wind_mps[..., 0], level * np.cos(heading) + wind_mps[..., 1]
        return height, np.stack([east, north, vertical], axis=-1)

    @cached_property
    def _solution(self) -> OdeSolution:
        """Latitude and longitude from the joint's [rad] over time."""

        def rates(time_s: float, moved: FloatArray) -> list[float]:
            height, velocity = self._motion(np.asarray(time_s))
            lat = self.joint.lat_rad + moved[0]
            meridian, transverse = radii_of_curvature_m(lat)
            return [velocity[1] / (meridian + height), velocity[0] / ((transverse + height) * np.cos(lat))]

        span = (self.duration_s, 0.0) if self.backward else (0.0, self.duration_s)
        solved = solve_ivp(
            rates, span, [0.0, 0.0], method="DOP853", dense_output=True,
            rtol=1e-10, atol=_TRACK_TOLERANCE, max_step=_TRACK_STEP_S,
        )  # fmt: skip
        assert solved.sol is not None
        return solved.sol


def schedule(
    segment: Segment, speeds_mps: tuple[float, float], landings: tuple[float, float], vertical_mps: float
) -> Schedule:
    """Schedule of any segment but an approach.

    Parameters
    ----------
    segment : Segment
    speeds_mps, landings : (float, float)
        Airspeed and configuration at its start and end.
    vertical_mps : float
        Vertical speed at its start; not 0 for a missed approach only.

    Raises
    ------
    ValueError
        When it is over before it has begun: its edges do not fit into its duration.
    """
    level = Schedule(duration_s=1.0, speeds_mps=speeds_mps, landings=landings, vertical_mps=vertical_mps)
    match segment:
        case Cruise():
            return replace(level, duration_s=segment.duration_s)
        case Climb():
            return _slope(segment.kind, segment.height_gain_m, segment, level)
        case Descent():
            return _slope(segment.kind, -segment.height_loss_m, segment, level)
        case Turn():
            return _turn(segment, level)
        case MissedApproach():
            climb, edge = segment.vertical_speed_mps, segment.blend_s
            duration = edge + (segment.height_gain_m - 0.5 * vertical_mps * edge) / climb
            _fits(segment.kind, "blend_s", edge, duration)
            return replace(level, duration_s=duration, climb_mps=climb, climb_edge_s=edge)
        case _:
            raise TypeError(f"{segment.kind} has no schedule")


def _slope(kind: str, height_change_m: float, segment: Climb | Descent, level: Schedule) -> Schedule:
    if segment.duration_s is not None:
        duration = segment.duration_s
    else:
        assert segment.vertical_speed_mps is not None
        duration = segment.blend_s + abs(height_change_m) / segment.vertical_speed_mps
    _fits(kind, "blend_s", segment.blend_s, duration)
    climb = height_change_m / (duration - segment.blend_s)
    return replace(level, duration_s=duration, climb_mps=climb, climb_edge_s=segment.blend_s)


def _turn(segment: Turn, level: Schedule) -> Schedule:
    rolling = _Rolling(
        change_rad=abs(segment.heading_change_rad),
        speed_mps=0.5 * sum(level.speeds_mps),
        roll_rate_radps=segment.roll_rate_radps,
    )
    if segment.duration_s is None:
        assert segment.bank_rad is not None
        bank = rolling.bank_reached_rad(segment.bank_rad)
        duration = rolling.duration_s(bank)
    else:
        duration = segment.duration_s
        bank = rolling.bank_for_rad(duration)
    _fits("turn", "roll_rate_radps", rolling.edge_s(bank), duration)
    if segment.height_change_m != 0.0:
        _fits("turn", "blend_s", segment.blend_s, duration)
    return replace(
        level,
        duration_s=duration,
        heading_change_rad=segment.heading_change_rad,
        turn_edge_s=rolling.edge_s(bank),
        climb_mps=segment.height_change_m / max(duration - segment.blend_s, 1.0),
        climb_edge_s=segment.blend_s if segment.height_change_m != 0.0 else 1.0,
    )


@dataclass(frozen=True, kw_only=True)
class _Rolling:
    """How long a turn takes with a given bank: rolling in, turning, rolling out."""

    change_rad: float
    speed_mps: float
    roll_rate_radps: float

    def edge_s(self, bank_rad: float) -> float:
        return STEEPEST * bank_rad / self.roll_rate_radps

    def duration_s(self, bank_rad: float) -> float:
        turning_s = self.change_rad * self.speed_mps / (STANDARD_GRAVITY_MPS2 * math.tan(bank_rad))
        return self.edge_s(bank_rad) + turning_s

    def bank_reached_rad(self, bank_rad: float) -> float:
        """The bank, or less when a small turn is over before it is reached."""

        def held_s(bank_rad: float) -> float:
            return self.duration_s(bank_rad) - 2.0 * self.edge_s(bank_rad)

        return bank_rad if held_s(bank_rad) >= 0.0 else float(brentq(held_s, 1e-5, bank_rad))

    def bank_for_rad(self, duration_s: float) -> float:
        """The least bank with which the turn takes a given time."""
        banks = np.linspace(0.002, 1.4, 700)
        shortest = min((self.duration_s(float(bank)), float(bank)) for bank in banks)
        if shortest[0] > duration_s:
            raise ValueError(f"turn: duration_s = {duration_s!r} is too short, it takes {shortest[0]:.1f} s at least")
        return float(brentq(lambda bank: self.duration_s(bank) - duration_s, 1e-6, shortest[1]))


def _fits(kind: str, key: str, edge_s: float, duration_s: float) -> None:
    if 2.0 * edge_s > duration_s * (1.0 + 1e-9):
        raise ValueError(
            f"{kind}: {key} makes its start and its end take {edge_s:.3g} s each, the whole takes {duration_s:.3g} s"
        )
