"""A flight from the keys of a configuration file; angles are degrees in files only.

Sections may be nested or dotted; the manoeuvres are a list, or a section whose keys are their numbers, which is what
ROS parameter files can hold::

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
Manoeuvres have the fields of :mod:`gbas_sim.flight.dynamics.segments`, with ``_deg`` for ``_rad`` and ``_degps`` for
``_radps``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.five_phase import five_phase_plan
from gbas_sim.flight.dynamics.fleet import FLEET
from gbas_sim.flight.dynamics.flight import Flight
from gbas_sim.flight.dynamics.plan import FlightPlan, Start
from gbas_sim.flight.dynamics.segments import KINDS, Approach, Segment
from gbas_sim.flight.dynamics.wind import Wind
from gbas_sim.keys import record_from_keys

_WINDS: Final = ("wind", "planned_wind")
_PLAN_KEYS: Final = ("speed_mps", "configuration", "segments")
_KEYS: Final = ("aircraft", "mass_kg", "profile", "turning_earth", "start", *_WINDS, *_PLAN_KEYS)


def flight_from_mapping(mapping: Mapping[str, Any], *, approach: FinalApproach | None = None) -> Flight:
    """Flight from the keys of a configuration file.

    Parameters
    ----------
    mapping : mapping
        As in the module's description.
    approach : FinalApproach, optional
        What a plan with an approach ends on; a plan without one does not look at it.

    Raises
    ------
    ValueError
        Naming a key that is unknown, missing, of the wrong kind or out of bounds, or the manoeuvre that the aircraft
        cannot fly.
    """
    try:
        flight = _flight(_nested(mapping), approach)
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None
    flight.check()
    return flight


def _flight(keys: Mapping[str, Any], approach: FinalApproach | None) -> Flight:
    if unknown := sorted(str(key) for key in keys if key not in _KEYS):
        raise ValueError(f"{unknown[0]} is unknown; known are {', '.join(sorted(_KEYS))}")
    winds = {name: record_from_keys(Wind, _section(name, keys[name]), f"{name}.") for name in _WINDS if name in keys}
    turning = keys.get("turning_earth", True)
    if type(turning) is not bool:
        raise ValueError(f"turning_earth = {turning!r} is not true or false")
    return Flight(plan=_plan(keys, approach), aircraft=_aircraft(keys), turning_earth=turning, **winds)


def _plan(keys: Mapping[str, Any], approach: FinalApproach | None) -> FlightPlan:
    start = record_from_keys(Start, _section("start", keys["start"]), "start.") if "start" in keys else None
    if "profile" in keys:
        if keys["profile"] != "five_phase":
            raise ValueError(f"profile = {keys['profile']!r} is not five_phase")
        if double := [key for key in _PLAN_KEYS if key in keys]:
            raise ValueError(f"{double[0]} is given, but profile says what is flown")
        return five_phase_plan(start=start, approach=approach if start is None else None)
    if missing := [key for key in ("speed_mps", "segments") if key not in keys]:
        raise ValueError(f"{missing[0]} is missing")
    segments = _segments(keys["segments"])
    return FlightPlan(
        segments=segments,
        speed_mps=_number("speed_mps", keys["speed_mps"]),
        configuration=keys.get("configuration", "clean"),
        start=start,
        approach=approach if any(isinstance(segment, Approach) for segment in segments) else None,
    )


def _segments(value: Any) -> tuple[Segment, ...]:
    if isinstance(value, Mapping):
        numbers = {str(key): each for key, each in value.items()}
        expected = [str(number) for number in range(1, len(numbers) + 1)]
        if set(numbers) != set(expected):
            raise ValueError(f"segments has the keys {', '.join(sorted(numbers))}, not 1 to {len(numbers)}")
        value = [numbers[number] for number in expected]
    if not isinstance(value, list | tuple):
        raise ValueError(f"segments = {value!r} is not a list of manoeuvres")
    return tuple(_segment(f"segments.{number}", each) for number, each in enumerate(value, 1))


def _segment(path: str, value: Any) -> Segment:
    section = dict(_section(path, value))
    kind = section.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(f"{path}.kind = {kind!r} is not one of {', '.join(KINDS)}")
    return record_from_keys(KINDS[kind], section, f"{path}.")


def _aircraft(keys: Mapping[str, Any]) -> Aircraft:
    name = keys.get("aircraft", "fighter" if "profile" in keys else "airliner")
    if not isinstance(name, str) or name not in FLEET:
        raise ValueError(f"aircraft = {name!r} is not one of {', '.join(FLEET)}")
    aircraft = FLEET[name]
    return replace(aircraft, mass_kg=_number("mass_kg", keys["mass_kg"])) if "mass_kg" in keys else aircraft


def _nested(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Sections of a mapping whose keys may be dotted."""
    nested: dict[str, Any] = {}
    for key, value in mapping.items():
        *outer, last = str(key).split(".")
        section = nested
        for part in outer:
            section = section.setdefault(part, {})
            if not isinstance(section, dict):
                raise ValueError(f"{key} is given within {part}, which is not a section")
        section[last] = _nested(value) if isinstance(value, Mapping) else value
    return nested


def _section(path: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{path} = {value!r} is not a section")
    return value


def _number(path: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{path} = {value!r} is not a number")
    return float(value)
