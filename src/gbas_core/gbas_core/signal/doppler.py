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


def range_rate_mps(
    state: SatelliteState, range_m: FloatArray, los: FloatArray, position_m: FloatArray, velocity_mps: FloatArray
) -> FloatArray:
    """Rate of the light-time range against time at reception, ``(..., N_SATS)`` [m/s].

    Parameters
    ----------
    state : SatelliteState
        At transmission.
    range_m, los : (..., N_SATS), (..., 3, N_SATS) arrays
        From :func:`gbas_core.gnss.orbits.rotated_range`.
    position_m, velocity_mps : (..., 3) arrays
        Of the receiver at reception, ECEF [m], [m/s].

    Notes
    -----
    The satellite's position is turned by the Earth's rotation in flight: s = R(w tau) s(t - tau), c tau = |s - r|.
    Differentiating gives rate = e.(R v - v_r) / (1 + e.u / c), where u = R v + w x s is the satellite's velocity
    against the stars, in the axes at reception. The denominator is the change of the flight time: 1e-5, or
    millimetres per second.
    """
    seen = position_m[..., :, np.newaxis] + range_m[..., np.newaxis, :] * los
    angle = EARTH_RATE_RADPS / SPEED_OF_LIGHT_MPS * range_m
    sin_angle, cos_angle = np.sin(angle), np.cos(angle)
    vx, vy, vz = (state.velocity_mps[..., axis, :] for axis in range(3))
    turned_x, turned_y = cos_angle * vx + sin_angle * vy, cos_angle * vy - sin_angle * vx
    ex, ey, ez = (los[..., axis, :] for axis in range(3))
    own = velocity_mps[..., :, np.newaxis]
    opening = ex * (turned_x - own[..., 0, :]) + ey * (turned_y - own[..., 1, :]) + ez * (vz - own[..., 2, :])
    inertial_x = turned_x - EARTH_RATE_RADPS * seen[..., 1, :]
    inertial_y = turned_y + EARTH_RATE_RADPS * seen[..., 0, :]
    along = ex * inertial_x + ey * inertial_y + ez * vz
    return np.asarray(opening / (1.0 + along / SPEED_OF_LIGHT_MPS))


def doppler_hz(
    receiver_m: FloatArray, velocity_mps: FloatArray, satellites: SatelliteState, *, clock_drift: ArrayLike = 0.0
) -> FloatArray:
    """Doppler of each band, positive when approaching, as receivers report it, (..., N_BANDS, N_SATS) [Hz].

    Parameters
    ----------
    receiver_m, velocity_mps : (..., 3) arrays
        At reception, ECEF [m], [m/s].
    satellites : SatelliteState
        At transmission.
    clock_drift : (...) array
        Of the receiver's clock [s/s].
    """
    range_m, los = rotated_range(receiver_m, satellites.position_m)
    rate = range_rate_mps(satellites, range_m, los, receiver_m, velocity_mps) / SPEED_OF_LIGHT_MPS
    drift = np.asarray(clock_drift, dtype=np.float64)[..., np.newaxis] - satellites.clock_drift
    return np.asarray(-FREQUENCY_HZ[:, np.newaxis] * (rate + drift)[..., np.newaxis, :])
