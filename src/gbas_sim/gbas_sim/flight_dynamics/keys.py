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
          intercept_distance_m: 9000.0}

or, for the flight of the paper, ``profile: five_phase`` in place of ``speed_mps``, ``configuration`` and ``segments``.
Manoeuvres have the fields of :mod:`gbas_sim.flight_dynamics.segments`, with ``_deg`` for ``_rad`` and ``_degps`` for
``_radps``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

from gbas_core.approach import FinalApproach
from gbas_sim.flight_dynamics.aircraft import Aircraft
from gbas_sim.flight_dynamics.five_phase import five_phase_plan
from gbas_sim.flight_dynamics.fleet import FLEET
from gbas_sim.flight_dynamics.flight import Flight
from gbas_sim.flight_dynamics.plan import FlightPlan, Start
from gbas_sim.flight_dynamics.segments import KINDS, Approach, Segment
from gbas_sim.flight_dynamics.wind import Wind

_KEYS: Final = ("aircraft", "mass_kg", "profile", "turning_earth", "start", "wind", "planned_wind")
_PLAN_KEYS: Final = ("speed_mps", "configuration", "segments")
_START_KEYS: Final = {
    "latitude_deg": "lat_rad",
    "longitude_deg": "lon_rad",
    "height_m": "height_m",
    "heading_deg": "heading_rad",
}
_WIND_KEYS: Final = {"height_m": "height_m", "speed_mps": "speed_mps", "from_deg": "from_rad"}


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
        Naming a key that is unknown, missing, of the wrong kind or out of bounds.
    """
    keys = _nested(mapping)
    _known(keys, (*_KEYS, *_PLAN_KEYS), "")
    winds = {name: _wind(name, keys[name]) for name in ("wind", "planned_wind") if name in keys}
    turning = keys.get("turning_earth", True)
    if type(turning) is not bool:
        raise ValueError(f"flight: turning_earth = {turning!r} is not true or false")
    return Flight(plan=_plan(keys, approach), aircraft=_aircraft(keys), turning_earth=turning, **winds)


def _plan(keys: Mapping[str, Any], approach: FinalApproach | None) -> FlightPlan:
    start = _start(keys["start"]) if "start" in keys else None
    if "profile" in keys:
        if keys["profile"] != "five_phase":
            raise ValueError(f"flight: profile = {keys['profile']!r} is not five_phase")
        if double := [key for key in _PLAN_KEYS if key in keys]:
            raise ValueError(f"flight: {double[0]} is given, but profile says what is flown")
        return five_phase_plan(start=start, approach=approach if start is None else None)
    if missing := [key for key in ("speed_mps", "segments") if key not in keys]:
        raise ValueError(f"flight: {missing[0]} is missing")
    segments = _segments(keys["segments"])
    try:
        return FlightPlan(
            segments=segments,
            speed_mps=_number("speed_mps", keys["speed_mps"]),
            configuration=keys.get("configuration", "clean"),
            start=start,
            approach=approach if any(isinstance(segment, Approach) for segment in segments) else None,
        )
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None


def _segments(value: Any) -> tuple[Segment, ...]:
    if isinstance(value, Mapping):
        numbers = {str(key): each for key, each in value.items()}
        expected = [str(number) for number in range(1, len(numbers) + 1)]
        if sorted(numbers) != sorted(expected):
            raise ValueError(f"flight: segments has the keys {', '.join(sorted(numbers))}, not 1 to {len(numbers)}")
        value = [numbers[number] for number in expected]
    if not isinstance(value, list | tuple):
        raise ValueError(f"flight: segments = {value!r} is not a list of manoeuvres")
    return tuple(_segment(f"segments.{number}", each) for number, each in enumerate(value, 1))


def _segment(path: str, value: Any) -> Segment:
    section = dict(_section(path, value))
    kind = section.pop("kind", None)
    if kind not in KINDS:
        raise ValueError(f"flight: {path}.kind = {kind!r} is not one of {', '.join(KINDS)}")
    chosen = KINDS[kind]
    names = {_in_files(item.name): item.name for item in fields(chosen)}
    _known(section, tuple(names), f"{path}.")
    arguments = {names[key]: _converted(f"{path}.{key}", key, each) for key, each in section.items()}
    try:
        return chosen(**arguments)
    except (TypeError, ValueError) as error:
        raise ValueError(f"flight: {path}: {_plain(error)}") from None


def _in_files(name: str) -> str:
    """A field's name in files."""
    return name.replace("_radps", "_degps").replace("_rad", "_deg") if "_rad" in name and "radius" not in name else name


def _converted(path: str, key: str, value: Any) -> Any:
    if key == "configuration":
        return value
    number = _number(path, value)
    return math.radians(number) if key.endswith(("_deg", "_degps")) else number


def _plain(error: Exception) -> str:
    """A missing argument as a missing key."""
    text = str(error)
    return f"{_in_files(text.split(chr(39))[1])} is missing" if "required keyword-only" in text else text


def _aircraft(keys: Mapping[str, Any]) -> Aircraft:
    name = keys.get("aircraft", "fighter" if "profile" in keys else "airliner")
    if name not in FLEET:
        raise ValueError(f"flight: aircraft = {name!r} is not one of {', '.join(FLEET)}")
    aircraft = FLEET[name]
    if "mass_kg" not in keys:
        return aircraft
    try:
        return replace(aircraft, mass_kg=_number("mass_kg", keys["mass_kg"]))
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None


def _start(value: Any) -> Start:
    section = _section("start", value)
    _known(section, tuple(_START_KEYS), "start.")
    if missing := [key for key in _START_KEYS if key not in section]:
        raise ValueError(f"flight: start.{missing[0]} is missing")
    values = {name: _converted(f"start.{key}", key, section[key]) for key, name in _START_KEYS.items()}
    try:
        return Start(**values)
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None


def _wind(name: str, value: Any) -> Wind:
    section = _section(name, value)
    _known(section, tuple(_WIND_KEYS), f"{name}.")
    values: dict[str, tuple[float, ...]] = {}
    for key, field in _WIND_KEYS.items():
        given = section.get(key, [])
        if not isinstance(given, list | tuple):
            raise ValueError(f"flight: {name}.{key} = {given!r} is not a list of numbers")
        values[field] = tuple(_converted(f"{name}.{key}", key, each) for each in given)
    try:
        return Wind(**values)
    except ValueError as error:
        raise ValueError(f"flight: {name}: {error}") from None


def _nested(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Sections of a mapping whose keys may be dotted."""
    nested: dict[str, Any] = {}
    for key, value in mapping.items():
        *outer, last = str(key).split(".")
        section = nested
        for part in outer:
            section = section.setdefault(part, {})
            if not isinstance(section, dict):
                raise ValueError(f"flight: {key} is given within {part}, which is not a section")
        section[last] = _nested(value) if isinstance(value, Mapping) else value
    return nested


def _section(path: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"flight: {path} = {value!r} is not a section")
    return value


def _known(section: Mapping[str, Any], known: tuple[str, ...], prefix: str) -> None:
    if unknown := sorted(str(key) for key in section if key not in known):
        raise ValueError(f"flight: {prefix}{unknown[0]} is unknown; known are {', '.join(sorted(known))}")


def _number(path: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"flight: {path} = {value!r} is not a number")
    return float(value)
