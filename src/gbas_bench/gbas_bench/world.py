"""The world of the benchmark: four reference receivers and an aircraft, all with the same thirty satellites in view.

The nominal constellations of GPS and Galileo show about twenty above a receiver's mask. So that the load is that of a
crowded sky, and the same at every epoch, the benchmark keeps fifteen satellites of each and turns their orbits (node
and place along the orbit) until all of them are high throughout the run.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from gbas_bringup.resources import config_path
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import satellite_state
from gbas_core.record import FloatArray
from gbas_core.satellites import N_GPS, N_SATS
from gbas_sim.satellites.broadcast import Orbits
from gbas_sim.satellites.sightlines import elevations_rad
from gbas_sim.scenario import scenario_from_yaml
from gbas_sim.world import World, open_orbits
from gbas_sim.world_params import WorldParams

CONFIG: Final = "bench.yaml"
SATELLITES_A_SYSTEM: Final = 15
_LOWEST_RAD: Final = np.radians(12.0)
_STEPS: Final = 32
# Spreads the satellites over the places that are high enough.
_GOLDEN: Final = 0.5 * (np.sqrt(5.0) - 1.0)
_ANGLES: Final = ("omega0_rad", "m0_rad")


def bench_config() -> Path:
    """The configuration the benchmark runs, an ordinary ROS parameter file."""
    return config_path(CONFIG)


def bench_world(satellites_a_system: int = SATELLITES_A_SYSTEM) -> World:
    """The world of the benchmark's configuration."""
    return crowded(scenario_from_yaml(bench_config()), satellites_a_system)


def crowded(params: WorldParams, satellites_a_system: int = SATELLITES_A_SYSTEM) -> World:
    """A world in which so many GPS and as many Galileo satellites are seen at every epoch."""
    turned = _turned(open_orbits(params).received[0], params, satellites_a_system)
    return World(params, orbits=Orbits(truth=(turned,), switch_s=(), received=(turned,)))


def _turned(nominal: Ephemeris, params: WorldParams, satellites_a_system: int) -> Ephemeris:
    """Ephemerides of the satellites kept, each turned to where it is high at all times of the run."""
    kept = np.zeros(N_SATS, dtype=bool)
    kept[:satellites_a_system] = kept[N_GPS : N_GPS + satellites_a_system] = True
    turns = np.arange(_STEPS) * (2.0 * np.pi / _STEPS)
    places_rad = [(node, along) for node in turns for along in turns]
    orbits = [
        _with(nominal, omega0_rad=nominal.omega0_rad + node, m0_rad=nominal.m0_rad + along)
        for node, along in places_rad
    ]
    high = np.array([(_elevations_rad(orbit, params) >= _LOWEST_RAD).all(axis=0) for orbit in orbits])
    choice = np.zeros(N_SATS, dtype=np.int64)
    for number, satellite in enumerate(np.flatnonzero(kept)):
        places = np.flatnonzero(high[:, satellite])
        choice[satellite] = places[int(len(places) * (number * _GOLDEN % 1.0))]
    turn_rad = dict(zip(_ANGLES, np.array(places_rad)[choice].T, strict=True))
    angles = {name: _half_turn(getattr(nominal, name) + turn_rad[name]) for name in _ANGLES}
    placed = _with(nominal, **angles)
    return _with(placed, **{name: np.where(kept, value, np.nan) for name, value in _arrays(placed).items()})


def _elevations_rad(ephemeris: Ephemeris, params: WorldParams) -> FloatArray:
    """Elevations (times, N_SATS) at the first receiver, at times spread over the run."""
    position_m = np.array(params.receiver_ecef_m[0])
    latitude, longitude, _ = geodetic_from_ecef(position_m)
    up = rot_enu_ecef(latitude, longitude)[2]
    times_s = params.start_tow_s + np.linspace(0.0, params.n_epochs * params.interval_s, 7)
    states = (satellite_state(ephemeris, params.start_week, float(each), None) for each in times_s)
    return np.array([elevations_rad(position_m, up, state.position_m) for state in states])


def _half_turn(angle_rad: FloatArray) -> FloatArray:
    """The same angles within half a turn of zero, as messages carry them."""
    return np.remainder(angle_rad + np.pi, 2.0 * np.pi) - np.pi


def _arrays(ephemeris: Ephemeris) -> dict[str, FloatArray]:
    values = {item.name: getattr(ephemeris, item.name) for item in fields(ephemeris)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _with(ephemeris: Ephemeris, **values: Any) -> Ephemeris:
    return replace(ephemeris, **values)
