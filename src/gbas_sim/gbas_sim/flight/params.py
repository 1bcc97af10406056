"""The section ``flight`` of a scenario: a straight-in approach, or a flight by the equations of motion::

    aircraft: airliner              # fighter, airliner or small_uav
    mass_kg: 62000.0                # at the start, when not the aircraft's own
    speed_mps: 95.0                 # at the start
    configuration: clean            # at the start: clean or landing
    turning_earth: true
    start: {latitude_deg: 52.0, longitude_deg: 10.5, height_m: 600.0, heading_deg: 90.0}    # without an approach only
    wind: {height_m: [0.0, 1500.0], speed_mps: [5.0, 15.0], from_deg: [240.0, 270.0]}       # left out: calm
    planned_wind: {height_m: [0.0], speed_mps: [8.0], from_deg: [250.0]}                    # left out: the wind
    segments:
      1: {kind: cruise, duration_s: 60.0}
      2: {kind: turn, heading_change_deg: -90.0, bank_deg: 25.0}
      3: {kind: curved, turn_deg: 90.0, radius_m: 3000.0, join_distance_m: 6000.0, speed_mps: 72.0,
          intercept_distance_m: 9000.0, level_time_s: 90.0}

or, for the flight of the paper, ``profile: five_phase`` in place of ``speed_mps``, ``configuration`` and ``segments``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from pydantic import Discriminator, Tag, model_validator

from gbas_core.parameters import Numbered, Parameter, parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight.dynamics.five_phase import five_phase_plan
from gbas_sim.flight.dynamics.fleet import FLEET
from gbas_sim.flight.dynamics.flight import Flight
from gbas_sim.flight.dynamics.plan import FlightPlan, Start
from gbas_sim.flight.dynamics.segments import SPEED, Approach, Configuration, Segment
from gbas_sim.flight.dynamics.wind import Wind
from gbas_sim.flight.straight_in import StraightIn, StraightInParams

_AIRCRAFT: Final = Parameter("name of the aircraft", choices=tuple(FLEET))


@parameters
class DynamicFlightParams:
    """What every flight by the equations of motion has."""

    aircraft: Annotated[str, _AIRCRAFT] = "airliner"
    mass_kg: Annotated[float | None, Parameter("at the start, when not the aircraft's own", "kg", 0.5, 6.0e5)] = None
    turning_earth: Annotated[bool, Parameter("false leaves out the Earth's turning and curvature")] = True
    start: Start | None = None
    wind: Wind = Wind()
    planned_wind: Wind | None = None


@parameters
class PlannedFlightParams(DynamicFlightParams):
    """A flight of given manoeuvres."""

    speed_mps: Annotated[float, SPEED]
    configuration: Annotated[Configuration, Parameter("flaps and gear at the start")] = "clean"
    segments: Annotated[tuple[Segment, ...], Numbered()]


@parameters
class FivePhaseFlightParams(DynamicFlightParams):
    """The flight of the paper."""

    profile: Annotated[Literal["five_phase"], Parameter("flight that is known by name")]
    aircraft: Annotated[str, _AIRCRAFT] = "fighter"

    @model_validator(mode="before")
    @classmethod
    def _all_is_in_the_profile(cls, section: Any) -> Any:
        for key in ("speed_mps", "configuration", "segments") if isinstance(section, Mapping) else ():
            if key in section:
                raise ValueError(f"{key} is given, but profile says what is flown")
        return section


def _kind(section: Any) -> str:
    """Class of a section by keys that only it has."""
    if not isinstance(section, Mapping):
        return type(section).__name__
    if "profile" in section:
        return FivePhaseFlightParams.__name__
    own = ("aircraft", "configuration", "mass_kg", "planned_wind", "segments", "start", "turning_earth", "wind")
    return (PlannedFlightParams if any(key in section for key in own) else StraightInParams).__name__


FlightParams = Annotated[
    Annotated[StraightInParams, Tag("StraightInParams")]
    | Annotated[PlannedFlightParams, Tag("PlannedFlightParams")]
    | Annotated[FivePhaseFlightParams, Tag("FivePhaseFlightParams")],
    Discriminator(_kind),
]


def flight_of(params: FlightParams, approach: FinalApproach | None) -> StraightIn | Flight:
    """A flight that can be flown.

    Parameters
    ----------
    params : StraightInParams, PlannedFlightParams or FivePhaseFlightParams
    approach : FinalApproach, optional
        What a flight with an approach ends on; one without does not look at it.

    Raises
    ------
    ValueError
        When there is nothing to fly on, or naming the manoeuvre that the aircraft cannot fly.
    """
    if isinstance(params, StraightInParams):
        if approach is None:
            raise ValueError("flight: there is no final approach to fly")
        return StraightIn(approach=approach, **vars(params))
    aircraft = FLEET[params.aircraft]
    flight = Flight(
        plan=_plan(params, approach),
        aircraft=aircraft if params.mass_kg is None else replace(aircraft, mass_kg=params.mass_kg),
        wind=params.wind,
        planned_wind=params.planned_wind,
        turning_earth=params.turning_earth,
    )
    flight.check()
    return flight


def _plan(params: PlannedFlightParams | FivePhaseFlightParams, approach: FinalApproach | None) -> FlightPlan:
    if isinstance(params, FivePhaseFlightParams):
        return five_phase_plan(start=params.start, approach=approach if params.start is None else None)
    return FlightPlan(
        segments=params.segments,
        speed_mps=params.speed_mps,
        configuration=params.configuration,
        start=params.start,
        approach=approach if any(isinstance(segment, Approach) for segment in params.segments) else None,
    )
