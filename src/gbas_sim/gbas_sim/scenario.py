"""A simulated world from the keys of a configuration file: the site's own, and those under ``sim``.

The reference receivers' antennas, the station's place, the final approach and the troposphere are the site's
(``ground.receivers``, ``ground.station``, ``ground.approaches``, ``ground.atmosphere``): the world is as the station
says, unless it is told to differ. A file may say ``base: FILE`` beside its sections: it then holds only what differs
from that file, which is looked for beside it; a key without a value takes the file's away. Everything under ``sim`` may
be left out::

    sim:
      systems: "GE"
      start_week: 2400
      start_tow_s: 216000.0
      interval_s: 0.5
      seed: 1
      duration_s: 600.0             # when not that of the flight
      aircraft: true                # false: a station alone
      approach: "rwy26"             # when the station has several
      constellation: {navigation: [brdc.rnx]}     # or {almanac: current.alm}; left out: nominal constellations
      flight: {speed_mps: 70.0, intercept_distance_m: 20000.0, level_time_s: 300.0, pushover_time_s: 20.0}
      troposphere: {refractivity: 379.0, scale_height_m: 7900.0, reference_height_m: 130.0}
      ionosphere: {day_delay_m: 4.5, sigma_vig: 4.0e-6}             # left out: none
      scintillation: {equatorial_s4: 0.7, loss_rate_hz: 0.02}       # left out: none
      scene: {ground: wet_ground, antenna: mla, antenna_height_m: 3.0}      # reflections; left out: none
      ground_receiver: {elevation_mask_deg: 3.0, cn0_zenith_dbhz: [50.0, 52.0], noise_scale: 1.0}
      airborne_receiver: {preset: aad_b, rinex_steps: true}
      threats:                      # any number, each with a name of its own
        wedge: {kind: front, gradient: 300.0e-6, width_m: 50000.0, speed_mps: 100.0, direction_deg: 45.0}
        hangar: {kind: building, east_m: 90.0, north_m: 40.0, length_m: 60.0, width_m: 40.0, height_m: 15.0}

A flight with ``segments`` or ``profile`` is one by the equations of motion, see :mod:`gbas_sim.flight.dynamics.keys`.
Without a refractivity from either, there is no troposphere. A receiver with a ``preset`` is one of
:mod:`gbas_sim.receivers.presets`; then its other keys are :data:`PRESET_KEYS`, among them those of its loops
(``tracking: {spacing_chips: [0.1, 0.1, 1.0]}``, see :class:`~gbas_core.signal.tracking_loops.TrackingParams`), its
delays (``hardware``, :class:`~gbas_sim.receivers.oscillators.HardwareParams`) and its clock (``oscillator``, a name in
:data:`~gbas_sim.receivers.oscillators.OSCILLATORS`). Fields and bounds of sections are those of
:class:`~gbas_sim.world.WorldParams`, :class:`~gbas_sim.flight.straight_in.StraightIn`,
:class:`~gbas_sim.atmosphere.troposphere.Troposphere`, :class:`~gbas_sim.atmosphere.ionosphere.IonosphereParams`,
:class:`~gbas_sim.atmosphere.scintillation.ScintillationParams`, :class:`~gbas_sim.receivers.site_scene.SceneParams` and
:class:`~gbas_sim.receivers.receiver.ReceiverParams`; those of threats are of the classes in :data:`THREATS`, by their
``kind``. Angles are degrees in files only.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_core.bounds import one_of
from gbas_core.gnss.almanac import AlmanacError
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.io.rinex import RinexError
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.approach_keys import approach_from_mapping
from gbas_core.signal.antenna import LinkBudget
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.atmosphere.scintillation import ScintillationParams
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox
from gbas_sim.faults.kinds import RECEIVER_FAULTS, SATELLITE_FAULTS
from gbas_sim.flight.dynamics import flight_from_mapping
from gbas_sim.flight.straight_in import StraightIn
from gbas_sim.keys import keys_of, record_from_keys
from gbas_sim.receivers.oscillators import OSCILLATORS
from gbas_sim.receivers.presets import default_link, receiver_preset
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.receivers.site_scene import Building, SceneParams
from gbas_sim.world import FlightPath, World, WorldParams

_WORLD_KEYS: Final[dict[str, type]] = {
    "systems": str,
    "start_week": int,
    "start_tow_s": float,
    "interval_s": float,
    "seed": int,
    "duration_s": float,
}
_OTHER_KEYS: Final[dict[str, type]] = {"aircraft": bool, "approach": str}
_RECEIVERS: Final = {"ground_receiver": GROUND_RECEIVER, "airborne_receiver": AIRBORNE_RECEIVER}
_ATMOSPHERE: Final = ("troposphere", "ionosphere", "scintillation")
_SECTIONS: Final = ("constellation", "flight", *_ATMOSPHERE, "scene", "threats", *_RECEIVERS)
_SITE_TROPOSPHERE: Final = {
    "refractivity": "atmosphere.refractivity",
    "scale_height_m": "atmosphere.scale_height_m",
    "reference_height_m": "station.height_m",
}
_DYNAMIC: Final = ("aircraft", "configuration", "mass_kg", "planned_wind", "profile", "segments", "start", "wind")
PRESET_KEYS: Final = (
    "cn0", "cn0_sigma_db", "elevation_mask_deg", "hardware", "oscillator", "preset", "rinex_steps", "tracking",
)  # fmt: skip
THREATS: Final[dict[str, tuple[type[Any], str]]] = {
    "front": (WedgeFront, "fronts"),
    "bubble": (PlasmaBubble, "fronts"),
    "weather": (WeatherBox, "weather"),
    "building": (Building, "buildings"),
    **{kind: (made, "faults") for kind, made in (SATELLITE_FAULTS | RECEIVER_FAULTS).items()},
}
"""Class of each kind of threat, and the field of :class:`~gbas_sim.world.WorldParams` it goes to."""
_BASE: Final = "base"
_MOST_BASES: Final = 8


class ScenarioError(ValueError):
    """A scenario that cannot be simulated: names the file, the key, its value and the bound."""


# --- files


def scenario_from_yaml(path: str | Path) -> WorldParams:
    """World of a ROS parameter file or a plain one.

    Raises
    ------
    ScenarioError
        As :func:`read_sections` and :func:`scenario_from_mapping`.
    """
    return scenario_from_mapping(read_sections(path), source=str(path))


def world_from_yaml(path: str | Path) -> World:
    """The world of a file, opened.

    Raises
    ------
    ScenarioError
        As :func:`scenario_from_yaml` and :func:`open_world`.
    """
    return open_world(scenario_from_yaml(path), source=str(path))


def open_world(params: WorldParams, *, source: str = "parameters") -> World:
    """A world with its satellites.

    Raises
    ------
    ScenarioError
        When a file of orbits cannot be used, or something concerns a satellite that is not up.
    """
    try:
        return World(params)
    except (AlmanacError, RinexError, ValueError) as error:
        raise ScenarioError(f"{source}: {error}") from None


def read_document(path: str | Path) -> tuple[Any, tuple[Path, ...]]:
    """A YAML file, what it is based on included, and the files read, itself first.

    Raises
    ------
    ScenarioError
        When a file cannot be read or is not YAML, or files are based on each other.
    """
    read, layers, place = [], [], Path(path)
    while True:
        own = _load(place)
        read.append(place)
        base = own.get(_BASE) if isinstance(own, Mapping) else None
        layers.append(own if base is None else {key: value for key, value in own.items() if key != _BASE})
        if base is None:
            return functools.reduce(_merged, reversed(layers)), tuple(read)
        if not isinstance(base, str) or len(read) > _MOST_BASES:
            raise ScenarioError(f"{place}: {_BASE} = {base!r} is not a file, or files are based on each other")
        place = place.parent / base


def _load(path: Path) -> Any:
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}") from None
    except yaml.YAMLError as error:
        raise ScenarioError(f"{path}: is not YAML: {' '.join(str(error).split())}") from None


def _merged(below: Any, above: Any) -> Any:
    """Sections of two documents; where both have a value, that of the second, and nothing where it has none."""
    if not (isinstance(below, Mapping) and isinstance(above, Mapping)):
        return above
    both = dict(below)
    for key, value in above.items():
        both[key] = _merged(both[key], value) if key in both else value
    return {key: value for key, value in both.items() if value is not None}


def read_sections(path: str | Path) -> Mapping[str, Any]:
    """Sections of a ROS parameter file (``/**: ros__parameters:``) or of a plain one.

    Raises
    ------
    ScenarioError
        As :func:`read_document`, and when the file holds no sections.
    """
    document, _ = read_document(path)
    for key in ("/**", "ros__parameters"):
        if isinstance(document, Mapping) and key in document:
            document = document[key]
    if not isinstance(document, Mapping):
        raise ScenarioError(f"{path}: holds no parameters")
    return document


# --- keys


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


def scenario_values(world: WorldParams, mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Every key under ``sim`` with the value in use, in the file's units; `mapping` is what the world was made of."""
    values: dict[str, Any] = {f"sim.{key}": getattr(world, key) for key in _WORLD_KEYS}
    values["sim.duration_s"] = world.length_s
    values["sim.aircraft"] = world.flight is not None
    if isinstance(world.flight, StraightIn):
        values |= keys_of(world.flight, "sim.flight.")
    sections = {name: getattr(world, name) for name in (*_ATMOSPHERE, "scene")}
    sections |= {"ground_receiver": world.ground, "airborne_receiver": world.airborne}
    for name, record in sections.items():
        if record is not None:
            values |= keys_of(record, f"sim.{name}.")
    return values | {f"sim.{key}": value for key, value in _section(_flatten(mapping), "sim.").items()}


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
    if plain := [name for name in _SECTIONS if sim.get(name) is not None]:
        raise ValueError(f"sim.{plain[0]} = {sim[plain[0]]!r} is not a section")
    parts = {name: _section(sim, f"{name}.") for name in _SECTIONS}
    others = {key: value for key, value in sim.items() if key.partition(".")[0] not in parts}
    given = {key: _value(f"sim.{key}", value, _WORLD_KEYS | _OTHER_KEYS) for key, value in others.items()}
    aircraft, approach = given.pop("aircraft", True), given.pop("approach", None)
    receivers = {name: _receiver(name, parts[name], given.get("interval_s", 0.5)) for name in _RECEIVERS}
    optional = {
        "ionosphere": _optional(IonosphereParams, parts["ionosphere"], "sim.ionosphere."),
        "scintillation": _optional(ScintillationParams, parts["scintillation"], "sim.scintillation."),
        "scene": _optional(SceneParams, parts["scene"], "sim.scene."),
    }
    return WorldParams(
        receiver_ecef_m=_sites(ground),
        station_ecef_m=_station(ground),
        flight=_flight(parts["flight"], ground, approach) if aircraft else None,
        troposphere=_troposphere(ground, parts["troposphere"]),
        ground=receivers["ground_receiver"],
        airborne=receivers["airborne_receiver"],
        **optional,
        **_constellation(parts["constellation"]),
        **_threats(parts["threats"]),
        **given,
    )


def _optional(kind: type[Any], section: dict[str, Any], path: str) -> Any:
    return record_from_keys(kind, section, path) if section else None


def _station(ground: Mapping[str, Any]) -> tuple[float, float, float] | None:
    keys = ("station.latitude_deg", "station.longitude_deg", "station.height_m")
    if any(key not in ground for key in keys):
        return None
    for key in keys:
        if type(ground[key]) not in (int, float):
            raise ValueError(f"ground.{key} = {ground[key]!r} is not a number")
    latitude, longitude, height = (float(ground[key]) for key in keys)
    x, y, z = ecef_from_geodetic(math.radians(latitude), math.radians(longitude), height).tolist()
    return x, y, z


def _sites(ground: Mapping[str, Any]) -> tuple[tuple[float, float, float], ...]:
    sites: list[Any] = []
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
    return tuple(sites)  # the world checks that each has three


def _approach(ground: Mapping[str, Any], name: str | None) -> FinalApproach:
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


def _flight(section: dict[str, Any], ground: Mapping[str, Any], name: str | None) -> FlightPath:
    if not any(key.partition(".")[0] in _DYNAMIC for key in section):
        return record_from_keys(StraightIn, section, "sim.flight.", approach=_approach(ground, name))
    has_approach = any(key.startswith("approaches.") for key in ground) and "start.latitude_deg" not in section
    try:
        return flight_from_mapping(section, approach=_approach(ground, name) if has_approach else None)
    except ValueError as error:
        raise ValueError(f"sim.{error}") from None


def _troposphere(ground: Mapping[str, Any], section: dict[str, Any]) -> Troposphere:
    values = dict(section)
    for key, site_key in _SITE_TROPOSPHERE.items():
        if key not in values and site_key in ground:
            values[key] = _value(f"ground.{site_key}", ground[site_key], {site_key.rpartition(".")[2]: float})
    return record_from_keys(Troposphere, values, "sim.troposphere.")


def _constellation(section: dict[str, Any]) -> dict[str, Any]:
    if unknown := sorted(key for key in section if key not in ("almanac", "navigation")):
        raise ValueError(f"sim.constellation.{unknown[0]} is unknown; known are almanac, navigation")
    values = dict(section)
    if type(values.get("almanac", "")) is not str:
        raise ValueError(f"sim.constellation.almanac = {values['almanac']!r} is not a file")
    if "navigation" in values:
        files = values["navigation"]
        files = [files] if isinstance(files, str) else files
        if not isinstance(files, list | tuple) or not all(isinstance(each, str) for each in files):
            raise ValueError(f"sim.constellation.navigation = {files!r} is not a list of files")
        values["navigation"] = tuple(each for each in files if each)
    return values


def _receiver(name: str, section: dict[str, Any], interval_s: float) -> ReceiverParams | ReceiverModel:
    path = f"sim.{name}."
    if "preset" not in section:
        defaults = keys_of(_RECEIVERS[name], "")
        return record_from_keys(ReceiverParams, defaults | section, path)
    if unknown := sorted(key for key in section if key.partition(".")[0] not in PRESET_KEYS):
        raise ValueError(f"{path}{unknown[0]} is unknown with a preset; known are {', '.join(PRESET_KEYS)}")
    parts = {part: _section(section, f"{part}.") for part in ("cn0", "tracking", "hardware")}
    kinds: dict[str, type] = {"cn0_sigma_db": float, "elevation_mask_deg": float, "rinex_steps": bool}
    kinds |= {"oscillator": str, "preset": str}
    plain = {key: value for key, value in section.items() if key.partition(".")[0] not in parts}
    values = {key: _value(f"{path}{key}", value, kinds) for key, value in plain.items()}
    if "elevation_mask_deg" in values:
        values["elevation_mask_rad"] = math.radians(values.pop("elevation_mask_deg"))
    try:
        if "oscillator" in values:
            one_of("receiver", "oscillator", values["oscillator"], OSCILLATORS)
            values["oscillator"] = OSCILLATORS[values["oscillator"]]
        preset_name, link = values.pop("preset"), parts.pop("cn0")
        known = keys_of(default_link(preset_name), "")
        cn0 = record_from_keys(LinkBudget, known | link, f"{path}cn0.") if link else None
        preset = receiver_preset(preset_name, interval_s=interval_s, cn0=cn0)
        for part, keys in parts.items():
            inner = getattr(preset, part)
            values[part] = record_from_keys(type(inner), keys_of(inner, "") | keys, f"{path}{part}.")
        return replace(preset, **values)
    except ValueError as error:
        raise ValueError(f"sim.{name}: {error}") from None


def _threats(section: dict[str, Any]) -> dict[str, Any]:
    """Threats by the field of the world they go to, in the order of their names."""
    found: dict[str, Any] = {}
    for name in sorted({key.partition(".")[0] for key in section}):
        path = f"sim.threats.{name}."
        keys = _section(section, f"{name}.")
        kind = keys.pop("kind", None)
        if kind not in THREATS:
            raise ValueError(f"{path}kind = {kind!r} is not one of {', '.join(sorted(THREATS))}")
        made, field = THREATS[kind]
        found[field] = (*found.get(field, ()), record_from_keys(made, keys, path))
    return found


def _value(key: str, value: Any, kinds: Mapping[str, type]) -> Any:
    """The value of a key as the kind its last word should have."""
    last = key.rpartition(".")[2]
    if last not in kinds:
        raise ValueError(f"{key} is unknown; known are {', '.join(sorted(kinds))}")
    kind = kinds[last]
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise ValueError(f"{key} = {value!r} is not a {kind.__name__}")
    return value
