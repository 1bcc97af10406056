"""A station, receivers around it and satellites at chosen places of its sky, for tests of the atmosphere."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.satellites import N_SATS
from gbas_sim.atmosphere.paths import SignalPaths, Station

STATION = Station(ecef_m=tuple(ecef_from_geodetic(math.radians(52.32), math.radians(10.56), 130.0).tolist()))
RADIUS_M = 26_560_000.0


def spiral() -> tuple[np.ndarray, np.ndarray]:
    """Azimuths and elevations [rad] of N_SATS satellites, from 5 degrees to the zenith and all around."""
    place = np.arange(N_SATS)
    return 2.399963 * place, np.radians(np.linspace(5.0, 90.0, N_SATS))


def ecef_of(enu_m: np.ndarray, station: Station = STATION) -> np.ndarray:
    """ECEF of places (..., 3) given east, north and up of the station's horizontal plane."""
    return station.position_m + np.asarray(enu_m, dtype=float) @ station.axes


def satellites_at(azimuth_rad, elevation_rad, station: Station = STATION, seen_from_m=None) -> np.ndarray:
    """Positions (3, N) at azimuths and elevations in the station's axes, on the sphere of GPS."""
    origin = station.position_m if seen_from_m is None else seen_from_m
    enu = np.stack(
        [
            np.cos(elevation_rad) * np.sin(azimuth_rad),
            np.cos(elevation_rad) * np.cos(azimuth_rad),
            np.sin(elevation_rad),
        ]
    )
    los = station.axes.T @ enu
    upward = origin @ los
    return origin[:, np.newaxis] + (np.sqrt(upward**2 + RADIUS_M**2 - origin @ origin) - upward) * los


def paths(
    enu_m,
    *,
    velocity_enu_mps=None,
    satellite_m=None,
    satellite_mps=None,
    since_start_s=0.0,
    tow_s=216_000.0,
    station: Station = STATION,
) -> SignalPaths:
    """Paths of receivers at (..., R, 3) of the station's horizontal plane; satellites that stand still by default."""
    position_m = ecef_of(enu_m, station)
    velocity = np.zeros_like(position_m) if velocity_enu_mps is None else np.asarray(velocity_enu_mps) @ station.axes
    satellite = satellites_at(*spiral(), station) if satellite_m is None else satellite_m
    still = np.zeros_like(satellite) if satellite_mps is None else satellite_mps
    leading = position_m.shape[:-2]
    return SignalPaths(
        gps_week=2400,
        tow_s=tow_s,
        since_start_s=since_start_s,
        station=station,
        position_m=position_m,
        velocity_mps=np.broadcast_to(velocity, position_m.shape),
        satellite_m=np.broadcast_to(satellite, (*leading, *satellite.shape[-2:])) if satellite.ndim == 2 else satellite,
        satellite_mps=np.broadcast_to(still, (*leading, *still.shape[-2:])) if still.ndim == 2 else still,
    )


def moving() -> SignalPaths:
    """Five receivers, two of them flying, and satellites at 4 km/s in all directions."""
    enu = [[0.0, 0.0, 0.0], [300.0, -200.0, 3.0], [-400.0, 100.0, -2.0], [9000.0, 4000.0, 700.0], [-20e3, 3e3, 1400.0]]
    velocity = [[0.0] * 3] * 3 + [[-64.0, -28.0, -3.7], [70.0, -12.0, 0.5]]
    satellite = satellites_at(*spiral())
    turning = np.cross(np.array([0.3, -0.5, 0.8]), satellite.T).T
    velocity_m = 4000.0 * turning / np.linalg.norm(turning, axis=0)
    return paths(enu, velocity_enu_mps=velocity, satellite_m=satellite, satellite_mps=velocity_m, since_start_s=100.0)


def later(now: SignalPaths, after_s: float) -> SignalPaths:
    """The same paths some time later, everything having gone on along its velocity."""
    return dataclasses.replace(
        now,
        tow_s=now.tow_s + after_s,
        since_start_s=now.since_start_s + after_s,
        position_m=now.position_m + after_s * now.velocity_mps,
        satellite_m=now.satellite_m + after_s * now.satellite_mps,
    )


def derivative(of, now: SignalPaths, step_s: float = 0.25) -> np.ndarray:
    """Derivative against time of a function of paths, of fourth order."""
    near = of(later(now, step_s)) - of(later(now, -step_s))
    far = of(later(now, 2.0 * step_s)) - of(later(now, -2.0 * step_s))
    return (8.0 * near - far) / (12.0 * step_s)
