"""The plan of a flight: where it starts or which approach it ends on, and its manoeuvres in order."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight.dynamics.bounds import check_bounds
from gbas_sim.flight.dynamics.segments import Approach, Configuration, MissedApproach, Segment


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where a flight that has no approach begins, straight and level.

    Attributes
    ----------
    latitude_rad, longitude_rad, height_m : float
        Geodetic position [rad], height above the ellipsoid [m].
    heading_rad : float
        True heading [rad].
    """

    latitude_rad: float
    longitude_rad: float
    height_m: float
    heading_rad: float

    def __post_init__(self) -> None:
        bounds = {
            "latitude_rad": (math.radians(-85.0), math.radians(85.0)),
            "longitude_rad": (-math.pi, math.pi),
            "height_m": (-400.0, 20_000.0),
            "heading_rad": (-2.0 * math.pi, 2.0 * math.pi),
        }
        check_bounds("start", self, bounds)


@dataclass(frozen=True, kw_only=True)
class FlightPlan:
    """Manoeuvres in the order they are flown.

    A plan with an approach is laid out from the threshold, backwards to its start and onwards to its end; its start
    follows. One without begins at `start`.

    Attributes
    ----------
    segments : tuple of segments
        At most one approach; only a missed approach may follow it, and anything may follow that.
    speed_mps : float
        Airspeed at the start.
    configuration : str
        At the start.
    start : Start, optional
        Without an approach.
    approach : FinalApproach, optional
        With one.
    """

    segments: tuple[Segment, ...]
    speed_mps: float
    configuration: Configuration = "clean"
    start: Start | None = None
    approach: FinalApproach | None = None

    def __post_init__(self) -> None:
        check_bounds("plan", self, {"speed_mps": (5.0, 320.0)})
        if self.configuration not in ("clean", "landing"):
            raise ValueError(f"plan: configuration = {self.configuration!r} is not clean or landing")
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
            raise ValueError("plan: start is missing (without an approach the flight must begin somewhere)")

    @property
    def anchor(self) -> int | None:
        """Number of the approach among the segments, from 0; None without one."""
        return next((number for number, each in enumerate(self.segments) if isinstance(each, Approach)), None)
