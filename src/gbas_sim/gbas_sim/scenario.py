"""A simulated world from the keys of a configuration file: the site's own, and those under ``sim``.

The reference receivers' antennas, the final approach and the troposphere are the site's (``ground.receivers``,
``ground.approaches``, ``ground.atmosphere``): the world is as the station says, unless it is told to differ. Everything
under ``sim`` may be left out::

    sim:
      systems: "GE"
      start_week: 2400
      start_tow_s: 216000.0
      interval_s: 0.5
      seed: 1
      approach: "rwy26"             # when the station has several
      flight: {speed_mps: 70.0, intercept_distance_m: 20000.0, level_time_s: 300.0, pushover_time_s: 20.0}
      troposphere: {refractivity: 379.0, scale_height_m: 7900.0, reference_height_m: 130.0}
      ground_receiver: {elevation_mask_deg: 3.0, cn0_zenith_dbhz: [50.0, 52.0], noise_scale: 1.0}
      airborne_receiver: {elevation_mask_deg: 3.0}

Without a refractivity from either, there is no troposphere. Fields and bounds are those of
:class:`~gbas_sim.world.WorldParams`, :class:`~gbas_sim.flight.StraightIn`,
:class:`~gbas_sim.troposphere.Troposphere` and :class:`~gbas_sim.receivers.ReceiverParams`. Angles are degrees in
files only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_core.approach import FinalApproach
from gbas_core.approach_keys import approach_from_mapping
from gbas_sim.flight import StraightIn
from gbas_sim.receivers import AIRBORNE_RECEIVER, GROUND_RECEIVER, ReceiverParams
from gbas_sim.troposphere import Troposphere
from gbas_sim.world import WorldParams

_WORLD_KEYS: Final[dict[str, type]] = {
    "systems": str,
    "start_week": int,
    "start_tow_s": float,
    "interval_s": float,
    "seed": int,
}
_RECEIVERS: Final = {"ground_receiver": GROUND_RECEIVER, "airborne_receiver": AIRBORNE_RECEIVER}
_SITE_TROPOSPHERE: Final = {
    "refractivity": "atmosphere.refractivity",
    "scale_height_m": "atmosphere.scale_height_m",
    "reference_height_m": "station.height_m",
}


class ScenarioError(ValueError):
    """A scenario that cannot be simulated: names the file, the key, its value and the bound."""


def scenario_from_yaml(path: str | Path) -> WorldParams:
    """World of a ROS parameter file or a plain one.

    Raises
    ------
    ScenarioError
        As :func:`read_sections` and :func:`scenario_from_mapping`.
    """
    return scenario_from_mapping(read_sections(path), source=str(path))


def read_sections(path: str | Path) -> Mapping[str, Any]:
    """Sections of a ROS parameter file (``/**: ros__parameters:``) or of a plain one.

    Raises
    ------
    ScenarioError
        When the file cannot be read, is not YAML, or holds no sections.
    """
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}") from None
    except yaml.YAMLError as error:
        raise ScenarioError(f"{path}: is not YAML: {error}") from None
    for key in ("/**", "ros__parameters"):
        if isinstance(document, Mapping) and key in document:
            document = document[key]
    if not isinstance(document, Mapping):
        raise ScenarioError(f"{path}: holds no parameters")
    return document


def scenario_from_mapping(mapping: Mapping[str, Any], *, source: str = "parameters") -> WorldParams:
    """World of nested sections or dotted keys; sections other than the site's and ``sim`` are not looked at.

    Raises
    ------
    ScenarioError
        For a key that does not exist or is missing, and values of the wrong kind or out of bounds.
    """
    flat = _flatten(mapping)
    try:
        return _world(_section(flat, "ground."), _section(flat, "sim."))
    except ValueError as error:
        raise ScenarioError(f"{source}: {error}") from None


def scenario_values(world: WorldParams) -> dict[str, Any]:
    """Every key under ``sim`` but the approach's name, with the value in use, in the file's units."""
    values: dict[str, Any] = {f"sim.{key}": getattr(world, key) for key in _WORLD_KEYS}
    for item in fields(StraightIn):
        if item.name != "approach":
            values[f"sim.flight.{item.name}"] = getattr(world.flight, item.name)
    for item in fields(Troposphere):
        values[f"sim.troposphere.{item.name}"] = getattr(world.troposphere, item.name)
    for name, receiver in (("ground_receiver", world.ground), ("airborne_receiver", world.airborne)):
        for item in fields(receiver):
            values[f"sim.{name}.{item.name}"] = getattr(receiver, item.name)
        mask_rad = values.pop(f"sim.{name}.elevation_mask_rad")
        values[f"sim.{name}.elevation_mask_deg"] = math.degrees(mask_rad)
    return values


def _flatten(mapping: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            flat |= _flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def _section(flat: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    return {key.removeprefix(prefix): value for key, value in flat.items() if key.startswith(prefix)}


def _world(ground: dict[str, Any], sim: dict[str, Any]) -> WorldParams:
    if not ground:
        raise ValueError("section 'ground' is missing: there is no site")
    parts = {name: _section(sim, f"{name}.") for name in ("flight", "troposphere", *_RECEIVERS)}
    approach = _approach(ground, sim.get("approach"))
    plain = {key: value for key, value in sim.items() if key.partition(".")[0] not in parts and key != "approach"}
    values = {key: _value(f"sim.{key}", value, _WORLD_KEYS) for key, value in plain.items()}
    receivers = {name: _receiver(name, parts[name]) for name in _RECEIVERS}
    flight_kinds = {item.name: float for item in fields(StraightIn) if item.name != "approach"}
    flight = {key: _value(f"sim.flight.{key}", value, flight_kinds) for key, value in parts["flight"].items()}
    return WorldParams(
        receiver_ecef_m=_sites(ground),
        flight=StraightIn(approach=approach, **flight),
        troposphere=_troposphere(ground, parts["troposphere"]),
        ground=receivers["ground_receiver"],
        airborne=receivers["airborne_receiver"],
        **values,
    )


def _sites(ground: Mapping[str, Any]) -> tuple[tuple[float, float, float], ...]:
    sites = []
    for number in range(1, 5):
        key = f"receivers.rr{number}_ecef_m"
        if key not in ground:
            break
        value = ground[key]
        if not isinstance(value, list | tuple) or not all(type(each) in (int, float) for each in value):
            raise ValueError(f"ground.{key} = {value!r} is not three numbers")
        sites.append(tuple(float(each) for each in value))
    if not sites:
        raise ValueError("ground.receivers.rr1_ecef_m is missing (antenna of a reference receiver)")
    return tuple(sites)  # type: ignore[arg-type]  # the world checks that each has three


def _approach(ground: Mapping[str, Any], name: Any) -> FinalApproach:
    approaches = _section(ground, "approaches.")
    names = sorted({key.partition(".")[0] for key in approaches})
    if not names:
        raise ValueError("ground.approaches is missing: there is nothing to fly")
    if name is None and len(names) > 1:
        raise ValueError(f"sim.approach is missing; the station has {', '.join(names)}")
    if name is not None and name not in names:
        raise ValueError(f"sim.approach = {name!r} is not one of {', '.join(names)}")
    chosen = name or names[0]
    try:
        return approach_from_mapping(_section(approaches, f"{chosen}."))
    except ValueError as error:
        raise ValueError(f"ground.approaches.{chosen}: {error}") from None


def _troposphere(ground: Mapping[str, Any], section: Mapping[str, Any]) -> Troposphere:
    kinds = dict.fromkeys(_SITE_TROPOSPHERE, float)
    values = {key: _value(f"sim.troposphere.{key}", value, kinds) for key, value in section.items()}
    for key, site_key in _SITE_TROPOSPHERE.items():
        if key not in values and site_key in ground:
            values[key] = _value(f"ground.{site_key}", ground[site_key], {site_key.rpartition(".")[2]: float})
    return Troposphere(**values)


def _receiver(name: str, section: Mapping[str, Any]) -> ReceiverParams:
    defaults = {item.name: getattr(_RECEIVERS[name], item.name) for item in fields(ReceiverParams)}
    kinds = {key: type(value) for key, value in defaults.items() if key != "elevation_mask_rad"}
    values: dict[str, Any] = {}
    for key, value in section.items():
        if key == "elevation_mask_deg":
            degrees = _value(f"sim.{name}.{key}", value, {key: float})
            values["elevation_mask_rad"] = math.radians(degrees)
        else:
            values[key] = _value(f"sim.{name}.{key}", value, kinds)
    try:
        return ReceiverParams(**(defaults | values))
    except ValueError as error:
        raise ValueError(f"sim.{name}: {error}") from None


def _value(key: str, value: Any, kinds: Mapping[str, type]) -> Any:
    """The value of a key as the kind its last word should have."""
    last = key.rpartition(".")[2]
    if last not in kinds:
        raise ValueError(f"{key} is unknown; known are {', '.join(sorted(kinds))}")
    kind = kinds[last]
    if kind is tuple and isinstance(value, list | tuple) and all(type(each) in (int, float) for each in value):
        return tuple(float(each) for each in value)
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise ValueError(f"{key} = {value!r} is not a {kind.__name__}")
    return value
