"""The plan laid out in time: the path the aircraft is guided along.

Legs are put together from the anchor: the start, or the approach, whose legs before it are laid out backwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from itertools import accumulate
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.approach_legs import approach_leg
from gbas_sim.flight.dynamics.legs import Joint, Leg, ScheduledLeg, Track, joint_of, schedule
from gbas_sim.flight.dynamics.plan import FlightPlan
from gbas_sim.flight.dynamics.segments import Approach, Configuration, MissedApproach, Segment
from gbas_sim.flight.dynamics.wind import Wind

SPACING_S: Final = 0.1
"""Between samples of the plan, about [s]; a whole number of them makes the flight."""
_SLOWEST_MPS: Final = 3.0
LONGEST_S: Final = 4.0 * 3600.0
"""A flight's longest duration [s]: its tables stay below 200 MB."""


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A manoeuvre's time in the flight.

    Attributes
    ----------
    kind : str
        Of the manoeuvre, as :data:`gbas_sim.flight.dynamics.segments.KINDS` has it.
    start_s, end_s : float
        Since the start of the flight [s].
    """

    kind: str
    start_s: float
    end_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """The plan's path, sampled evenly.

    Attributes
    ----------
    time_s : (n,) array
        Since the start of the flight [s].
    path : Track
        At these times.
    ground_rate_mps2 : (n, 3) array
        Rates of the east, north and up components of the velocity over the ground [m/s2].
    phases : tuple of Phase
    """

    time_s: FloatArray
    path: Track
    ground_rate_mps2: FloatArray
    phases: tuple[Phase, ...]

    def phase_at(self, time_s: float) -> int:
        """Number of the phase at a time, from 0."""
        return next((number for number, each in enumerate(self.phases) if time_s < each.end_s), len(self.phases) - 1)


def lay_out(plan: FlightPlan, wind: Wind) -> Reference:
    """Lay out a plan in the wind that it expects.

    Raises
    ------
    ValueError
        Naming the manoeuvre that cannot be laid out, and why.
    """
    legs = _legs(plan, wind)
    ends = list(accumulate(leg.duration_s for leg in legs))
    if ends[-1] > LONGEST_S:
        raise ValueError(f"plan: it takes {ends[-1]:.0f} s, the longest is {LONGEST_S:.0f} s")
    starts = [0.0, *ends[:-1]]
    times = np.linspace(0.0, ends[-1], max(round(ends[-1] / SPACING_S), 10) + 1)
    cuts = np.searchsorted(times, ends[:-1])
    parts = [
        leg.track(part - start)
        for leg, part, start in zip(legs, np.split(times, cuts), starts, strict=True)
        if part.size
    ]
    columns = {item.name: np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(Track)}
    path = Track(**(columns | {"lon_rad": np.unwrap(columns["lon_rad"])}))
    phases = tuple(
        Phase(kind=segment.kind, start_s=start, end_s=end)
        for segment, start, end in zip(plan.segments, starts, ends, strict=True)
    )
    _check_ground_speed(path, times, phases)
    rates = CubicSpline(times, path.ground_enu_mps, axis=0)(times, 1)
    return Reference(time_s=times, path=path, ground_rate_mps2=rates, phases=phases)


def _check_ground_speed(path: Track, time_s: FloatArray, phases: tuple[Phase, ...]) -> None:
    """Raise ValueError when the wind stops the aircraft over the ground: then it has no track to be guided along."""
    speed = np.hypot(path.ground_enu_mps[:, 0], path.ground_enu_mps[:, 1])
    slowest = int(np.argmin(speed))
    if not speed[slowest] >= _SLOWEST_MPS:
        number = next((index for index, phase in enumerate(phases) if time_s[slowest] < phase.end_s), len(phases) - 1)
        raise ValueError(
            f"segment {number + 1} ({phases[number].kind}), {time_s[slowest]:.0f} s after the start: in this wind the"
            f" ground speed is {speed[slowest]:.1f} m/s, less than {_SLOWEST_MPS:g} m/s"
        )


def _legs(plan: FlightPlan, wind: Wind) -> list[Leg]:
    """Legs of all manoeuvres in their order, from the anchor on and then from it back."""
    ends = _Ends.of(plan)
    legs: dict[int, Leg] = {}
    if plan.anchor is None:
        assert plan.start is not None
        start = plan.start
        joint = Joint(
            lat_rad=start.latitude_rad,
            lon_rad=start.longitude_rad,
            height_m=start.height_m,
            heading_rad=start.heading_rad,
        )
        first = 0
    else:
        first = plan.anchor
        legs[first] = _named(plan, first, lambda: _approach(plan, first, ends, wind))
        joint = joint_of(legs[first].track(np.array([0.0])), wind)
    for number in range(first - 1, -1, -1):
        legs[number] = _scheduled(plan, number, ends, joint, True, wind)
        joint = joint_of(legs[number].track(np.array([0.0])), wind)
    if plan.anchor is not None:
        joint = joint_of(legs[first].track(np.array([legs[first].duration_s])), wind)
    for number in range(first + (plan.anchor is not None), len(plan.segments)):
        legs[number] = _scheduled(plan, number, ends, joint, False, wind)
        joint = joint_of(legs[number].track(np.array([legs[number].duration_s])), wind)
    return [legs[number] for number in range(len(plan.segments))]


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """Airspeed and configuration between manoeuvres: one more than there are manoeuvres."""

    speeds_mps: tuple[float, ...]
    landings: tuple[float, ...]

    @classmethod
    def of(cls, plan: FlightPlan) -> _Ends:
        speeds, landings = [plan.speed_mps], [_share(plan.configuration)]
        for segment in plan.segments:
            speeds.append(speeds[-1] if segment.speed_mps is None else segment.speed_mps)
            configuration = _configuration(segment)
            landings.append(landings[-1] if configuration is None else _share(configuration))
        return cls(speeds_mps=tuple(speeds), landings=tuple(landings))

    def around(self, number: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Airspeed and configuration at the start and at the end of a manoeuvre."""
        before, after = number, number + 1
        return (self.speeds_mps[before], self.speeds_mps[after]), (self.landings[before], self.landings[after])


def _named(plan: FlightPlan, number: int, make: Callable[[], Leg]) -> Leg:
    """What a function makes for a manoeuvre; its errors say which."""
    try:
        return make()
    except ValueError as error:
        raise ValueError(f"segment {number + 1}: {error}") from None


def _configuration(segment: Segment) -> Configuration | None:
    return "landing" if isinstance(segment, Approach) else segment.configuration


def _share(configuration: Configuration) -> float:
    return 1.0 if configuration == "landing" else 0.0


def _approach(plan: FlightPlan, number: int, ends: _Ends, wind: Wind) -> Leg:
    segment, approach = plan.segments[number], plan.approach
    assert isinstance(segment, Approach)
    assert approach is not None
    following = plan.segments[number + 1] if number + 1 < len(plan.segments) else None
    ends_at_m = 0.0
    if isinstance(following, MissedApproach):
        ends_at_m = (following.from_height_m - approach.tch_m) / math.tan(approach.gpa_rad)
        if ends_at_m < 0.0:
            raise ValueError(f"from_height_m = {following.from_height_m!r} is below the threshold crossing height")
    return approach_leg(segment, approach, *ends.around(number), wind, ends_at_m)


def _scheduled(plan: FlightPlan, number: int, ends: _Ends, joint: Joint, backward: bool, wind: Wind) -> Leg:
    def make() -> Leg:
        made = schedule(plan.segments[number], *ends.around(number), joint.vertical_mps)
        leg = ScheduledLeg(schedule=made, joint=joint, backward=backward, wind=wind)
        leg.track(np.array([0.0, 0.5, 1.0]) * leg.duration_s)
        return leg

    return _named(plan, number, make)
