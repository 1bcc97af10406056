"""Doppler and higher motion of lines of sight.

Source: Sabatini, Moore, Hill, WASET 7 (2013), eq (36), whose scalar form is wrong: the motion along the line of sight
is the scalar product of the whole relative velocity with it, not a difference of speeds times a cosine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.frames import EARTH_RATE_RADPS
from gbas_core.gnss.orbits import SatelliteState, rotated_range
from gbas_core.record import FloatArray
from gbas_core.signals import FREQUENCY_HZ, SPEED_OF_LIGHT_MPS


def range_rate_mps(receiver_m: FloatArray, velocity_mps: FloatArray, satellites: SatelliteState) -> FloatArray:
    """Rate of the range at reception, positive when it grows, without clocks, (..., N_SATS) [m/s].

    Parameters
    ----------
    receiver_m, velocity_mps : (..., 3) arrays
        Position and velocity of the receiver at reception, ECEF [m], [m/s].
    satellites : SatelliteState
        At transmission.

    Notes
    -----
    By the derivative of the distance between the receiver and the satellite turned by the Earth during the flight, with
    the rate of the time of transmission in that of reception.
    """
    range_m, los = rotated_range(receiver_m, satellites.position_m)
    angle = EARTH_RATE_RADPS * range_m / SPEED_OF_LIGHT_MPS
    cosine, sine = np.cos(angle), np.sin(angle)
    vx, vy, vz = np.moveaxis(satellites.velocity_mps, -2, 0)
    x, y, _ = np.moveaxis(satellites.position_m, -2, 0)
    east, north, up = np.moveaxis(los, -2, 0)
    # The satellite's velocity, and what turning it with the flight time adds, along the line of sight.
    along_satellite = east * (cosine * vx + sine * vy) + north * (cosine * vy - sine * vx) + up * vz
    turned = east * (cosine * y - sine * x) - north * (cosine * x + sine * y)
    along_receiver = np.einsum("...xn,...x->...n", los, velocity_mps)
    per_flight = turned * EARTH_RATE_RADPS / SPEED_OF_LIGHT_MPS
    # With r' the rate wanted: r' = along_satellite (1 - r'/c) - along_receiver + per_flight r'.
    return np.asarray((along_satellite - along_receiver) / (1.0 + along_satellite / SPEED_OF_LIGHT_MPS - per_flight))


def doppler_hz(
    receiver_m: FloatArray, velocity_mps: FloatArray, satellites: SatelliteState, *, clock_drift: ArrayLike = 0.0
) -> FloatArray:
    """Doppler of each band, positive when approaching, as receivers report it, (..., N_BANDS, N_SATS) [Hz].

    Parameters
    ----------
    receiver_m, velocity_mps, satellites
        See :func:`range_rate_mps`.
    clock_drift : (...) array
        Of the receiver's clock [s/s].
    """
    rate = range_rate_mps(receiver_m, velocity_mps, satellites) / SPEED_OF_LIGHT_MPS
    drift = np.asarray(clock_drift, dtype=np.float64)[..., np.newaxis] - satellites.clock_drift
    return np.asarray(-FREQUENCY_HZ[:, np.newaxis] * (rate + drift)[..., np.newaxis, :])
