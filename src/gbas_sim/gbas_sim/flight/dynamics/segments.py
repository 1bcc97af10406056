"""Manoeuvres a flight is planned of.

Every manoeuvre but the end of an approach and the start of a missed approach begins and ends straight and level, so
that any may follow any. Speeds are through the air. A manoeuvre that names a speed or a configuration reaches it by its
end.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

from pydantic import Field

from gbas_core.parameters import Parameter, file_key, parameters

Configuration = Literal["clean", "landing"]

SPEED: Final = Parameter("airspeed at the start", "m/s", 5.0, 320.0)
_SPEED: Final = Parameter("airspeed at the end", "m/s", 5.0, 320.0)
_CONFIGURATION: Final = Parameter("flaps and gear at the end")
_DURATION: Final = Parameter("how long it takes", "s", 1.0, 36_000.0)
_SLOPE_DURATION: Final = Parameter("from level to level again", "s", 1.0, 36_000.0)
_VERTICAL: Final = Parameter("vertical speed that is held between", "m/s", 0.1, 150.0)
_HEIGHT: Final = (1.0, 20_000.0)
_BLEND: Final = Parameter("from level flight to the manoeuvre, and back", "s", 1.0, 60.0)
_ROLL: Final = Parameter("largest roll rate when rolling in and out", "deg/s", 1.0, 200.0)
_INTERCEPT: Final = Parameter(
    "where level flight would meet the path, along the track from the threshold", "m", 200.0, 100_000.0
)
_APPROACH_SPEED: Final = Parameter("airspeed down the path", "m/s", 5.0, 320.0)
_LEVEL: Final = Parameter("in level flight before the path, in which speed and configuration change", "s", 0.0, 3600.0)
_PUSHOVER: Final = Parameter("from level flight to the path's slope", "s", 1.0, 60.0)


def _one_of(owner: object, *keys: str) -> None:
    """Refuse a manoeuvre that has not exactly one of some keys."""
    given = [file_key(key) for key in keys if getattr(owner, key) is not None]
    if len(given) != 1:
        problem = f"{given[0]} and {given[1]} are" if given else "neither is"
        raise ValueError(f"{problem} given, exactly one of {' and '.join(file_key(key) for key in keys)} must be")


@parameters
class Cruise:
    """Straight and level."""

    kind: Annotated[Literal["cruise"], Parameter("kind of the manoeuvre")] = "cruise"
    duration_s: Annotated[float, _DURATION]
    speed_mps: Annotated[float | None, _SPEED] = None
    configuration: Annotated[Configuration | None, _CONFIGURATION] = None


@parameters
class Climb:
    """Straight climb, by its duration or its vertical speed."""

    kind: Annotated[Literal["climb"], Parameter("kind of the manoeuvre")] = "climb"
    height_gain_m: Annotated[float, Parameter("height gain", "m", *_HEIGHT)]
    duration_s: Annotated[float | None, _SLOPE_DURATION] = None
    vertical_speed_mps: Annotated[float | None, _VERTICAL] = None
    blend_s: Annotated[float, _BLEND] = 10.0
    speed_mps: Annotated[float | None, _SPEED] = None
    configuration: Annotated[Configuration | None, _CONFIGURATION] = None

    def __post_init__(self) -> None:
        _one_of(self, "duration_s", "vertical_speed_mps")


@parameters
class Descent:
    """Straight descent, by its duration or its vertical speed."""

    kind: Annotated[Literal["descent"], Parameter("kind of the manoeuvre")] = "descent"
    height_loss_m: Annotated[float, Parameter("height loss", "m", *_HEIGHT)]
    duration_s: Annotated[float | None, _SLOPE_DURATION] = None
    vertical_speed_mps: Annotated[float | None, _VERTICAL] = None
    blend_s: Annotated[float, _BLEND] = 10.0
    speed_mps: Annotated[float | None, _SPEED] = None
    configuration: Annotated[Configuration | None, _CONFIGURATION] = None

    def __post_init__(self) -> None:
        _one_of(self, "duration_s", "vertical_speed_mps")


@parameters
class Turn:
    """Turn through the air at a steady rate, level, climbing or descending, by its bank or its duration.

    The bank is that at the mean of the speeds before and after, in level flight.
    """

    kind: Annotated[Literal["turn"], Parameter("kind of the manoeuvre")] = "turn"
    heading_change_rad: Annotated[
        float, Parameter("to the right if positive; may be several turns", "deg", -7200.0, 7200.0)
    ]
    bank_rad: Annotated[float | None, Parameter("bank angle", "deg", 1.0, 80.0)] = None
    duration_s: Annotated[float | None, _DURATION] = None
    height_change_m: Annotated[float, Parameter("spread over the whole turn", "m", -20_000.0, 20_000.0)] = 0.0
    roll_rate_radps: Annotated[float, _ROLL] = math.radians(8.0)
    blend_s: Annotated[float, _BLEND] = 10.0
    speed_mps: Annotated[float | None, _SPEED] = None
    configuration: Annotated[Configuration | None, _CONFIGURATION] = None

    def __post_init__(self) -> None:
        _one_of(self, "bank_rad", "duration_s")
        if self.heading_change_rad == 0.0:
            raise ValueError("heading_change_deg is 0")


@parameters
class StraightInApproach:
    """Level on the extended course, then down the final approach path to the threshold.

    Laid out by the distance of its intercept or by its duration.
    """

    kind: Annotated[Literal["straight_in"], Parameter("kind of the manoeuvre")] = "straight_in"
    speed_mps: Annotated[float, _APPROACH_SPEED]
    intercept_distance_m: Annotated[float | None, _INTERCEPT] = None
    duration_s: Annotated[float | None, _DURATION] = None
    level_time_s: Annotated[float, _LEVEL] = 60.0
    pushover_time_s: Annotated[float, _PUSHOVER] = 10.0

    def __post_init__(self) -> None:
        _one_of(self, "intercept_distance_m", "duration_s")


@parameters
class CurvedApproach:
    """A turn over the ground with a fixed radius (as a radius-to-fix leg) that ends on the final approach.

    The curvature of the track grows and shrinks with the roll rate. The descent may begin in the turn or before it.
    """

    kind: Annotated[Literal["curved"], Parameter("kind of the manoeuvre")] = "curved"
    turn_rad: Annotated[
        float, Parameter("by how much the course changes, to the right if positive", "deg", -270.0, 270.0)
    ]
    radius_m: Annotated[float, Parameter("radius of the turn", "m", 50.0, 50_000.0)]
    join_distance_m: Annotated[float, Parameter("from the threshold to where the turn ends", "m", 0.0, 50_000.0)]
    roll_rate_radps: Annotated[float, _ROLL] = math.radians(5.0)
    speed_mps: Annotated[float, _APPROACH_SPEED]
    intercept_distance_m: Annotated[float | None, _INTERCEPT] = None
    duration_s: Annotated[float | None, _DURATION] = None
    level_time_s: Annotated[float, _LEVEL] = 60.0
    pushover_time_s: Annotated[float, _PUSHOVER] = 10.0

    def __post_init__(self) -> None:
        _one_of(self, "intercept_distance_m", "duration_s")
        if self.turn_rad == 0.0:
            raise ValueError("turn_deg is 0")


@parameters
class MissedApproach:
    """Go around from the final approach, straight ahead, to level flight."""

    kind: Annotated[Literal["missed_approach"], Parameter("kind of the manoeuvre")] = "missed_approach"
    from_height_m: Annotated[
        float, Parameter("height of the path above the threshold where the approach is given up", "m", 5.0, 1000.0)
    ]
    height_gain_m: Annotated[float, Parameter("from there to level flight", "m", 50.0, 5000.0)]
    vertical_speed_mps: Annotated[float, Parameter("of the climb", "m/s", 0.1, 150.0)]
    blend_s: Annotated[float, _BLEND] = 8.0
    speed_mps: Annotated[float | None, _SPEED] = None
    configuration: Annotated[Configuration | None, _CONFIGURATION] = "clean"


Approach = StraightInApproach | CurvedApproach
Segment = Annotated[
    Cruise | Climb | Descent | Turn | StraightInApproach | CurvedApproach | MissedApproach, Field(discriminator="kind")
]
