"""Ranges, range rates, elevations and clocks between satellites and receivers at one instant of each receiver."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from gbas_core.gnss.frames import geodetic_from_ecef, los_and_range
from gbas_core.gnss.orbits import SatelliteState, rotated_range
from gbas_core.record import FloatArray
from gbas_core.signal.doppler import range_rate_mps
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_sim.satellites.broadcast import Arc

_MEAN_FLIGHT_S: Final = 0.077


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightlines:
    """Geometry of signals as they arrive; arrays (R, N_SATS).

    Attributes
    ----------
    range_m, range_rate_mps
        Path of the signal, with the Earth's rotation in flight and all delays, and its rate against true time at
        reception.
    clock_s, clock_drift
        Satellite clock less system time at transmission, with relativity, without group delay, and its rate against
        true time at reception.
    """

    range_m: FloatArray
    range_rate_mps: FloatArray
    clock_s: FloatArray
    clock_drift: FloatArray

    def of(self, receivers: slice) -> Sightlines:
        """The sightlines of some of the receivers."""
        return Sightlines(**{item.name: getattr(self, item.name)[receivers] for item in fields(self)})

    def delayed(self, delay_m: FloatArray, rate_mps: FloatArray) -> Sightlines:
        """The sightlines through something that delays code and carrier alike, ``(R, N_SATS)`` [m], [m/s]."""
        return replace(self, range_m=self.range_m + delay_m, range_rate_mps=self.range_rate_mps + rate_mps)


def sky(arc: Arc, tow_s: FloatArray) -> SatelliteState:
    """Satellites as seen at times ``(...)``, all with one mean flight time; arrays (..., 3, N_SATS) and (..., N_SATS).

    Good for elevations (3 microradians) and as a first guess for :func:`sightlines`.
    """
    return arc(np.asarray(tow_s)[..., np.newaxis] - _MEAN_FLIGHT_S)


def sightlines(
    arc: Arc,
    tow_s: float,
    early_s: FloatArray,
    seen: SatelliteState,
    position_m: FloatArray,
    velocity_mps: FloatArray,
) -> Sightlines:
    """Geometry through empty space.

    Parameters
    ----------
    arc : Arc
        The satellites' orbits.
    tow_s : float
        Time tag [s].
    early_s : (R,) array
        How long before the time tag, in true (system) time, each receiver took its observations: its clock error [s].
    seen : SatelliteState
        :func:`sky` at the time tag, (3, N_SATS).
    position_m, velocity_mps : (R, 3) arrays
        Receivers at reception, ECEF.

    Notes
    -----
    Moving the satellites along their velocities from the mean flight time to each receiver's own leaves 0.1 mm, so that
    the flight times that follow are exact to well below a picosecond, and the second evaluation of the orbits too.
    """
    range_m, _ = rotated_range(position_m, seen.position_m)
    late_s = _MEAN_FLIGHT_S - range_m / SPEED_OF_LIGHT_MPS - early_s[:, np.newaxis]
    range_m, _ = rotated_range(position_m, seen.position_m + seen.velocity_mps * late_s[:, np.newaxis, :])
    transmitted_s = tow_s - (range_m / SPEED_OF_LIGHT_MPS + early_s[:, np.newaxis])
    state = arc(transmitted_s)
    range_m, los = rotated_range(position_m, state.position_m)
    rate = range_rate_mps(state, range_m, los, position_m, velocity_mps)
    slowed = 1.0 - rate / SPEED_OF_LIGHT_MPS
    return Sightlines(
        range_m=range_m, range_rate_mps=rate, clock_s=state.clock_s, clock_drift=state.clock_drift * slowed
    )


def verticals(position_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors up ``(..., 3)`` and heights above the ellipsoid ``(...)`` [m] at ECEF positions ``(..., 3)``."""
    latitude, longitude, height_m = geodetic_from_ecef(position_m)
    cos_latitude = np.cos(latitude)
    up = np.stack([cos_latitude * np.cos(longitude), cos_latitude * np.sin(longitude), np.sin(latitude)], axis=-1)
    return up, height_m


def elevations_rad(position_m: FloatArray, up: FloatArray, sat_position_m: FloatArray) -> FloatArray:
    """Elevations ``(..., N_SATS)`` of satellites ``(..., 3, N_SATS)`` at receivers ``(..., 3)``, all ECEF [rad]."""
    los, _ = los_and_range(position_m, sat_position_m)
    sine = sum(up[..., axis, np.newaxis] * los[..., axis, :] for axis in range(3))
    return np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)))
