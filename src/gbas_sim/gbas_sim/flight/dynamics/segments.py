"""Manoeuvres a flight is planned of.

Every manoeuvre but the end of an approach and the start of a missed approach begins and ends straight and level, so
that any may follow any. Speeds are through the air. A manoeuvre that names a speed or a configuration reaches it by its
end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from gbas_sim.flight.dynamics.bounds import Bounds, check_bounds, check_one_of

Configuration = Literal["clean", "landing"]

_SPEED: Final = (5.0, 320.0)
_DURATION: Final = (1.0, 36_000.0)
_VERTICAL: Final = (0.1, 150.0)
_BLEND: Final = (1.0, 60.0)
_ROLL: Final = (math.radians(1.0), math.radians(200.0))
_TURN: Final = (-40.0 * math.pi, 40.0 * math.pi)


def _check(segment: Segment, bounds: Bounds) -> None:
    check_bounds(segment.kind, segment, {"speed_mps": _SPEED, **bounds})
    configuration = getattr(segment, "configuration", None)
    if configuration not in (None, "clean", "landing"):
        raise ValueError(f"{segment.kind}: configuration = {configuration!r} is not clean or landing")


@dataclass(frozen=True, kw_only=True)
class Cruise:
    """Straight and level.

    Attributes
    ----------
    duration_s : float
    speed_mps : float, optional
        At the end.
    configuration : str, optional
        ``"clean"`` or ``"landing"``, at the end.
    """

    kind = "cruise"
    duration_s: float
    speed_mps: float | None = None
    configuration: Configuration | None = None

    def __post_init__(self) -> None:
        _check(self, {"duration_s": _DURATION})


@dataclass(frozen=True, kw_only=True)
class Climb:
    """Straight climb.

    Attributes
    ----------
    height_gain_m : float
    duration_s, vertical_speed_mps : float
        One of the two: from level to level again, or what is held between.
    blend_s : float
        From level to the climb, and back.
    speed_mps, configuration
        See :class:`Cruise`.
    """

    kind = "climb"
    height_gain_m: float
    duration_s: float | None = None
    vertical_speed_mps: float | None = None
    blend_s: float = 10.0
    speed_mps: float | None = None
    configuration: Configuration | None = None

    def __post_init__(self) -> None:
        bounds = {"height_gain_m": (1.0, 20_000.0), "duration_s": _DURATION, "blend_s": _BLEND}
        _check(self, bounds | {"vertical_speed_mps": _VERTICAL})
        check_one_of(self.kind, self, "duration_s", "vertical_speed_mps")


@dataclass(frozen=True, kw_only=True)
class Descent:
    """Straight descent by ``height_loss_m``; the rest as in :class:`Climb`."""

    kind = "descent"
    height_loss_m: float
    duration_s: float | None = None
    vertical_speed_mps: float | None = None
    blend_s: float = 10.0
    speed_mps: float | None = None
    configuration: Configuration | None = None

    def __post_init__(self) -> None:
        bounds = {"height_loss_m": (1.0, 20_000.0), "duration_s": _DURATION, "blend_s": _BLEND}
        _check(self, bounds | {"vertical_speed_mps": _VERTICAL})
        check_one_of(self.kind, self, "duration_s", "vertical_speed_mps")


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Turn through the air at a steady rate, level, climbing or descending.

    Attributes
    ----------
    heading_change_rad : float
        To the right if positive; may be several turns [rad].
    bank_rad, duration_s : float
        One of the two. The bank is that at the mean of the speeds before and after, in level flight.
    height_change_m : float
        Spread over the whole turn [m].
    roll_rate_radps : float
        Largest when rolling in and out [rad/s].
    blend_s, speed_mps, configuration
        See :class:`Climb`.
    """

    kind = "turn"
    heading_change_rad: float
    bank_rad: float | None = None
    duration_s: float | None = None
    height_change_m: float = 0.0
    roll_rate_radps: float = math.radians(8.0)
    blend_s: float = 10.0
    speed_mps: float | None = None
    configuration: Configuration | None = None

    def __post_init__(self) -> None:
        bounds = {
            "heading_change_rad": _TURN,
            "bank_rad": (math.radians(1.0), math.radians(80.0)),
            "duration_s": _DURATION,
            "height_change_m": (-20_000.0, 20_000.0),
            "roll_rate_radps": _ROLL,
            "blend_s": _BLEND,
        }
        _check(self, bounds)
        check_one_of(self.kind, self, "bank_rad", "duration_s")
        if self.heading_change_rad == 0.0:
            raise ValueError("turn: heading_change_rad is 0")


@dataclass(frozen=True, kw_only=True)
class StraightInApproach:
    """Level on the extended course, then down the final approach path to the threshold.

    Attributes
    ----------
    speed_mps : float
        Through the air, down the path.
    intercept_distance_m, duration_s : float
        One of the two: where level flight would meet the path, along the ground from the threshold, or how long the
        manoeuvre takes.
    level_time_s : float
        In level flight before the path, in which speed and configuration change.
    pushover_time_s : float
        From level flight to the path's slope.
    """

    kind = "straight_in"
    speed_mps: float
    intercept_distance_m: float | None = None
    duration_s: float | None = None
    level_time_s: float = 60.0
    pushover_time_s: float = 10.0

    def __post_init__(self) -> None:
        _check(self, _APPROACH_BOUNDS)
        check_one_of(self.kind, self, "intercept_distance_m", "duration_s")


@dataclass(frozen=True, kw_only=True)
class CurvedApproach:
    """A turn over the ground with a fixed radius (as a radius-to-fix leg) that ends on the final approach.

    Attributes
    ----------
    turn_rad : float
        By how much the course changes, to the right if positive [rad].
    radius_m : float
    join_distance_m : float
        From the threshold to where the turn ends [m].
    roll_rate_radps : float
        Largest when rolling in and out; the curvature of the track grows and shrinks with it [rad/s].
    speed_mps, intercept_distance_m, duration_s, level_time_s, pushover_time_s
        See :class:`StraightInApproach`. Distances are along the track; the descent may begin in the turn or before it.
    """

    kind = "curved"
    turn_rad: float
    radius_m: float
    join_distance_m: float
    roll_rate_radps: float = math.radians(5.0)
    speed_mps: float
    intercept_distance_m: float | None = None
    duration_s: float | None = None
    level_time_s: float = 60.0
    pushover_time_s: float = 10.0

    def __post_init__(self) -> None:
        bounds = {
            "turn_rad": (-1.5 * math.pi, 1.5 * math.pi),
            "radius_m": (50.0, 50_000.0),
            "join_distance_m": (0.0, 50_000.0),
            "roll_rate_radps": _ROLL,
        }
        _check(self, {**_APPROACH_BOUNDS, **bounds})
        check_one_of(self.kind, self, "intercept_distance_m", "duration_s")
        if self.turn_rad == 0.0:
            raise ValueError("curved: turn_rad is 0")


@dataclass(frozen=True, kw_only=True)
class MissedApproach:
    """Go around from the final approach, straight ahead, to level flight.

    Attributes
    ----------
    from_height_m : float
        Height of the path above the threshold at which the approach is given up [m].
    height_gain_m : float
        From there to level flight [m].
    vertical_speed_mps : float
        Of the climb.
    blend_s, speed_mps, configuration
        See :class:`Climb`.
    """

    kind = "missed_approach"
    from_height_m: float
    height_gain_m: float
    vertical_speed_mps: float
    blend_s: float = 8.0
    speed_mps: float | None = None
    configuration: Configuration | None = "clean"

    def __post_init__(self) -> None:
        bounds = {
            "from_height_m": (5.0, 1000.0),
            "height_gain_m": (50.0, 5000.0),
            "vertical_speed_mps": _VERTICAL,
            "blend_s": _BLEND,
        }
        _check(self, bounds)


_APPROACH_BOUNDS: Final[Bounds] = {
    "intercept_distance_m": (200.0, 100_000.0),
    "duration_s": _DURATION,
    "level_time_s": (0.0, 3600.0),
    "pushover_time_s": (1.0, 60.0),
}

Approach = StraightInApproach | CurvedApproach
Segment = Cruise | Climb | Descent | Turn | StraightInApproach | CurvedApproach | MissedApproach
KINDS: Final[dict[str, type[Segment]]] = {
    segment.kind: segment
    for segment in (Cruise, Climb, Descent, Turn, StraightInApproach, CurvedApproach, MissedApproach)
}
"""Manoeuvres by the name files give them."""
