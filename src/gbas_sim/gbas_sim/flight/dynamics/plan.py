"""The plan of a flight: where it starts or which approach it ends on, and its manoeuvres in order."""

from __future__ import annotations

from typing import Annotated

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight.dynamics.segments import SPEED, Approach, Configuration, MissedApproach, Segment


@parameters
class Start:
    """Where a flight that has no approach begins, straight and level."""

    latitude_rad: Annotated[float, Parameter("geodetic latitude", "deg", -85.0, 85.0)]
    longitude_rad: Annotated[float, Parameter("longitude", "deg", -180.0, 180.0)]
    height_m: Annotated[float, Parameter("height above the ellipsoid", "m", -400.0, 20_000.0)]
    heading_rad: Annotated[float, Parameter("true heading", "deg", -360.0, 360.0)]


@parameters
class FlightPlan:
    """Manoeuvres in the order they are flown.

    At most one is an approach; only a missed approach may follow it, and anything may follow that. A plan with an
    approach is laid out from the threshold, backwards to its start and onwards to its end; its start follows. One
    without begins at `start`.
    """

    segments: tuple[Segment, ...]
    speed_mps: Annotated[float, SPEED]
    configuration: Annotated[Configuration, Parameter("flaps and gear at the start")] = "clean"
    start: Start | None = None
    approach: FinalApproach | None = None

    def __post_init__(self) -> None:
        if not self.segments:
            raise ValueError("plan: segments is empty")
        approaches = [number for number, each in enumerate(self.segments) if isinstance(each, Approach)]
        if len(approaches) > 1:
            raise ValueError(f"plan: segments {approaches[0] + 1} and {approaches[1] + 1} are both approaches")
        self._check_anchor(bool(approaches))
        for number, segment in enumerate(self.segments):
            after_approach = number > 0 and isinstance(self.segments[number - 1], Approach)
            if isinstance(segment, MissedApproach) != after_approach:
                problem = "must be a missed approach, the one before is an approach"
                if isinstance(segment, MissedApproach):
                    problem = "is a missed approach, the one before is not an approach"
                raise ValueError(f"plan: segment {number + 1} {problem}")

    def _check_anchor(self, approaches: bool) -> None:
        if approaches and self.approach is None:
            raise ValueError("plan: there is an approach to fly but no final approach to fly it on")
        if approaches and self.start is not None:
            raise ValueError("plan: start is given, but the flight is laid out from its approach")
        if not approaches and self.start is None:
            raise ParameterError(
                "plan: start is missing (without an approach the flight must begin somewhere)", missing=True
            )

    @property
    def anchor(self) -> int | None:
        """Number of the approach among the segments, from 0; None without one."""
        return next((number for number, each in enumerate(self.segments) if isinstance(each, Approach)), None)
