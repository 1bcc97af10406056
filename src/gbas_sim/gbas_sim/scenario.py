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

A flight with ``segments`` or ``profile`` is one by the equations of motion, see :mod:`gbas_sim.flight.params`. A
receiver with a ``preset`` is one of :mod:`gbas_sim.receivers.presets`. Sections are declared in
:mod:`gbas_sim.params`.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Final

from gbas_core.configuration import read_configuration
from gbas_core.gnss.almanac import AlmanacError
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.io.rinex import RinexError
from gbas_core.parameters import Parameter, ParameterError, from_mapping, nested, parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.approach_keys import approach_from_mapping
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox
from gbas_sim.faults.kinds import ReceiverFault, SatelliteFault
from gbas_sim.flight.params import flight_of
from gbas_sim.flight.straight_in import StraightInParams
from gbas_sim.params import SimParams
from gbas_sim.receivers.presets import preset_receiver
from gbas_sim.receivers.receiver import ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.receivers.site_scene import Building
from gbas_sim.world import World
from gbas_sim.world_params import FlightPath, RunParams, WorldParams

SECTION: Final = "sim"


class ScenarioError(ParameterError):
    """A scenario that cannot be simulated: names the file, the key, its value and the bound."""


@parameters
class _Place:
    """The station's place, as its file says."""

    latitude_rad: Annotated[float, Parameter("reference point", "deg", -90.0, 90.0)]
    longitude_rad: Annotated[float, Parameter("reference point", "deg", -180.0, 180.0)]
    height_m: Annotated[float, Parameter("reference point above the ellipsoid", "m", -1000.0, 20_000.0)]


_Antenna = Annotated[tuple[float, float, float] | None, Parameter("antenna of a reference receiver, ECEF", "m")]


@parameters
class _Antennas:
    """The reference receivers, as their station's file says."""

    rr1_ecef_m: Annotated[tuple[float, float, float], Parameter("antenna of a reference receiver, ECEF", "m")]
    rr2_ecef_m: _Antenna = None
    rr3_ecef_m: _Antenna = None
    rr4_ecef_m: _Antenna = None


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
        raise ScenarioError.at(f"{source}: ", error) from None


def read_sections(path: str | Path) -> dict[str, Any]:
    """Sections of a configuration file, see :mod:`gbas_core.configuration`.

    Raises
    ------
    ScenarioError
        When a file cannot be read, is not YAML, or holds no sections.
    """
    try:
        return read_configuration(path).sections()
    except ParameterError as error:
        raise ScenarioError(str(error)) from None


# --- sections


def sim_params(mapping: Mapping[str, Any], *, source: str = "parameters") -> SimParams:
    """The section ``sim`` of nested sections or dotted keys.

    Raises
    ------
    ScenarioError
        Naming source, key, value and bound.
    """
    try:
        return from_mapping(SimParams, _section(nested(mapping), SECTION), section=SECTION)
    except ParameterError as error:
        raise ScenarioError.at(f"{source}: ", error) from None


def scenario_from_mapping(mapping: Mapping[str, Any], *, source: str = "parameters") -> WorldParams:
    """World of nested sections or dotted keys; sections other than the site's and ``sim`` are not looked at.

    Raises
    ------
    ScenarioError
        For a key that does not exist or is missing, and values of the wrong kind or out of bounds.
    """
    sections = nested(mapping)
    sim = sim_params(sections, source=source)
    try:
        return _world(_section(sections, "ground"), sim)
    except ValueError as error:
        raise ScenarioError.at(f"{source}: ", error) from None


def _section(sections: Mapping[str, Any], name: str, path: str = "") -> dict[str, Any]:
    """A section without its keys that have no value; empty when it is not there."""
    found = sections.get(name)
    if found is None:
        return {}
    if not isinstance(found, Mapping):
        raise ParameterError(f"{path}{name} = {found!r} is not a section of keys")
    return {key: value for key, value in found.items() if value is not None}


def _world(ground: dict[str, Any], sim: SimParams) -> WorldParams:
    if not ground:
        raise ParameterError("section 'ground' is missing: there is no site", missing=True)
    return WorldParams(
        **{item.name: getattr(sim, item.name) for item in fields(RunParams)},
        **vars(sim.constellation),
        receiver_ecef_m=_sites(ground),
        station_ecef_m=_station(ground),
        flight=_flight(sim, ground) if sim.aircraft else None,
        troposphere=_troposphere(ground, sim),
        ionosphere=sim.ionosphere,
        scintillation=sim.scintillation,
        scene=sim.scene,
        ground=_receiver("ground_receiver", sim),
        airborne=_receiver("airborne_receiver", sim),
        **_threats(sim),
    )


def _station(ground: Mapping[str, Any]) -> tuple[float, float, float] | None:
    section = _section(ground, "station", "ground.")
    keys = ("latitude_deg", "longitude_deg", "height_m")
    if any(key not in section for key in keys):
        return None
    place = from_mapping(_Place, {key: section[key] for key in keys}, section="ground.station")
    x, y, z = ecef_from_geodetic(place.latitude_rad, place.longitude_rad, place.height_m).tolist()
    return x, y, z


def _sites(ground: Mapping[str, Any]) -> tuple[tuple[float, float, float], ...]:
    section = _section(ground, "receivers", "ground.")
    given = {key: value for key, value in section.items() if key.endswith("_ecef_m")}
    antennas = from_mapping(_Antennas, given, section="ground.receivers")
    places = (antennas.rr1_ecef_m, antennas.rr2_ecef_m, antennas.rr3_ecef_m, antennas.rr4_ecef_m)
    return tuple(itertools.takewhile(lambda place: place is not None, places))  # type: ignore[arg-type]


def _approach(ground: Mapping[str, Any], name: str | None) -> FinalApproach:
    approaches = _section(ground, "approaches", "ground.")
    names = sorted(approaches)
    if not names:
        raise ParameterError("ground.approaches is missing: there is nothing to fly", missing=True)
    if name is None and len(names) > 1:
        raise ParameterError(f"sim.approach is missing; the station has {', '.join(names)}", missing=True)
    if name is not None and name not in names:
        raise ParameterError(f"sim.approach = {name!r} is not one of {', '.join(names)}")
    chosen = name or names[0]
    section = _section(approaches, chosen, "ground.approaches.")
    try:
        return approach_from_mapping(section)
    except ValueError as error:
        raise ParameterError.at(f"ground.approaches.{chosen}: ", error) from None


def _flight(sim: SimParams, ground: Mapping[str, Any]) -> FlightPath:
    flight = sim.flight
    needs = isinstance(flight, StraightInParams) or (bool(ground.get("approaches")) and flight.start is None)
    approach = _approach(ground, sim.approach) if needs else None
    try:
        return flight_of(flight, approach)
    except ValueError as error:
        raise ParameterError.at("sim.", error) from None


def _troposphere(ground: Mapping[str, Any], sim: SimParams) -> Troposphere:
    """What the section says, then what the station says."""
    atmosphere, station = _section(ground, "atmosphere", "ground."), _section(ground, "station", "ground.")
    site: dict[str, Any] = {key: atmosphere[key] for key in ("refractivity", "scale_height_m") if key in atmosphere}
    if "height_m" in station:
        site["reference_height_m"] = station["height_m"]
    own = {key: value for key, value in vars(sim.troposphere).items() if value is not None}
    return from_mapping(Troposphere, site | own, section="sim.troposphere")


def _receiver(name: str, sim: SimParams) -> ReceiverParams | ReceiverModel:
    receiver = getattr(sim, name)
    if isinstance(receiver, ReceiverParams):
        return receiver
    try:
        return preset_receiver(receiver, interval_s=sim.interval_s)
    except ValueError as error:
        raise ParameterError.at(f"sim.{name}: ", error) from None


def _threats(sim: SimParams) -> dict[str, Any]:
    """Threats by the field of the world they go to, in the order of their names."""
    places: dict[str, tuple[type[Any], ...]] = {
        "fronts": (WedgeFront, PlasmaBubble),
        "weather": (WeatherBox,),
        "buildings": (Building,),
        "faults": (SatelliteFault, ReceiverFault),
    }
    threats = [threat for _, threat in sorted(sim.threats.items())]
    return {field: tuple(each for each in threats if isinstance(each, kinds)) for field, kinds in places.items()}
