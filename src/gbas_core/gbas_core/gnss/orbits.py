# mypy: disable-error-code="no-untyped-call"
"""Satellite positions, velocities and clocks from broadcast ephemerides, on the satellite axis.

Every function takes an :class:`~gbas_core.gnss.ephemeris.Ephemeris` and arrays whose trailing axis is the satellite
axis. What an ephemeris does not hold is NaN in the result; nothing is assumed. Whether an ephemeris is healthy and in
its validity is the business of :class:`~gbas_core.gnss.ephemeris.EphemerisStore`.

Source: IS-GPS-200N 20.3.3.3.3 and table 20-IV; Galileo OS SIS ICD 2.1, 5.1.1 to 5.1.5. Velocity: the time derivative
of table 20-IV (also in its later rows).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.kernels import orbits as kernel
from gbas_core.gnss.kernels.orbits import GM_M3PS2, RELATIVISTIC_F
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS

__all__ = [
    "GM_M3PS2",
    "RELATIVISTIC_F",
    "SatelliteState",
    "group_delay_s",
    "predicted_state",
    "rotated_range",
    "satellite_clock_s",
    "satellite_state",
    "transmit_state",
]

_MEAN_FLIGHT_S: Final = 0.077


@dataclass(frozen=True, kw_only=True, eq=False)
class SatelliteState:
    """Satellites at their times of transmission, in the ECEF frame of that time.

    Attributes
    ----------
    position_m, velocity_mps : (..., 3, N_SATS) arrays
        Position and velocity of the antenna phase centre [m], [m/s].
    clock_s, clock_drift : (..., N_SATS) arrays
        Satellite clock less system time [s] and its rate [s/s], with relativity and, for a band, the group delay.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    clock_s: FloatArray
    clock_drift: FloatArray


def group_delay_s(ephemeris: Ephemeris, band: int | None = L1) -> FloatArray:
    """Group delay a single-frequency user of a band subtracts from the broadcast clock [s], ``(N_SATS,)``.

    Parameters
    ----------
    band : int or None
        Band index, or None for the clock as broadcast (an ionosphere-free combination of two bands): zero.

    Notes
    -----
    GPS: TGD on L1 and (f_L1/f_L2)^2 TGD on L2. The true delays of L2C and L5 need inter-signal corrections, which LNAV
    does not carry; every user of the same ephemeris makes the same error, so differential corrections remove it. On L5
    TGD is used, as if that correction were zero: on the satellites of 2026 this leaves 1.0 m rms, (f_L1/f_L5)^2 TGD
    would leave 2.4 m.
    Galileo: an F/NAV clock refers to (E1, E5a), an I/NAV clock to (E1, E5b). E5a with an I/NAV clock takes both
    group delays: BGD(E1,E5b) + ((f_E1/f_E5a)^2 - 1) BGD(E1,E5a).

    Source: IS-GPS-200N 20.3.3.3.3.2 and 30.3.3.3.1.1; Galileo OS SIS ICD 2.1, 5.1.5.
    """
    return np.asarray(kernel.group_delays_s(ephemeris.values, _number(band)))


def _number(band: int | None) -> int:
    return kernel.CLOCK_AS_BROADCAST if band is None else int(band)


def satellite_clock_s(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, band: int | None = L1) -> FloatArray:
    """Satellite clock less system time [s] at times of transmission, with relativity and group delay.

    Parameters
    ----------
    ephemeris : Ephemeris
    gps_week : int
        Week the times count from.
    tow_tx_s : (..., N_SATS) array or scalar
        Times of transmission [s]; may lie outside the week.
    band : int or None
        Band of the single-frequency user, see :func:`group_delay_s`.

    Returns
    -------
    (..., N_SATS) array
    """
    return satellite_state(ephemeris, gps_week, tow_tx_s, band).clock_s


def satellite_state(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, band: int | None = L1) -> SatelliteState:
    """Position, velocity and clock at times of transmission in system time; arguments as :func:`satellite_clock_s`."""
    times_s, shape = _rows(tow_tx_s)
    place_m, speed_mps, clock_s, drift = kernel.states(ephemeris.values, int(gps_week), times_s, _number(band))
    return SatelliteState(
        position_m=place_m.reshape(*shape[:-1], 3, shape[-1]),
        velocity_mps=speed_mps.reshape(*shape[:-1], 3, shape[-1]),
        clock_s=clock_s.reshape(shape),
        clock_drift=drift.reshape(shape),
    )


def _rows(values: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Numbers on the satellite axis as rows of it, and their shape."""
    given = np.asarray(values, dtype=np.float64)
    shape = np.broadcast_shapes(given.shape, (N_SATS,))
    return np.array(np.broadcast_to(given, shape)).reshape(-1, N_SATS), shape


def transmit_state(
    ephemeris: Ephemeris, gps_week: int, tow_rx_s: ArrayLike, pseudorange_m: FloatArray, band: int | None = L1
) -> SatelliteState:
    """State at the time of transmission that belongs to a pseudorange.

    The satellite's clock read ``tow_rx - P/c`` at transmission, whatever the receiver's clock error is; system time is
    that less the satellite's clock error.

    Parameters
    ----------
    gps_week : int
    tow_rx_s : scalar or (..., N_SATS) array
        Receiver's time tag [s].
    pseudorange_m : (..., N_SATS) array
        Pseudoranges of `band` [m].
    """
    ranges_m, shape = _rows(pseudorange_m)
    received_s = np.broadcast_to(np.asarray(tow_rx_s, dtype=np.float64), shape)
    tow_tx_s = kernel.transmit_times_s(ephemeris.values, int(gps_week), _rows(received_s)[0], ranges_m)
    return satellite_state(ephemeris, gps_week, tow_tx_s.reshape(shape), band)


def rotated_range(receiver_xyz_m: FloatArray, sat_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Geometric range with the Earth's rotation during the flight, and lines of sight at reception.

    Parameters
    ----------
    receiver_xyz_m : (..., 3) array
        Receiver positions, ECEF at reception [m].
    sat_xyz_m : (..., 3, n_sats) array
        Satellite positions, ECEF at transmission [m].

    Returns
    -------
    range_m : (..., n_sats) array
    los : (..., 3, n_sats) array
        Unit vectors from receiver to satellite, ECEF at reception.

    Notes
    -----
    The flight time comes from the first-order Sagnac term, which is good to a millimetre, so that the rotation is good
    to well below a micrometre.
    """
    receiver, satellites = np.asarray(receiver_xyz_m, dtype=np.float64), np.asarray(sat_xyz_m, dtype=np.float64)
    lead = np.broadcast_shapes(receiver.shape[:-1], satellites.shape[:-2])
    n_sats = satellites.shape[-1]
    range_m, los = kernel.rotated_ranges(
        np.array(np.broadcast_to(receiver, (*lead, 3))).reshape(-1, 3),
        np.array(np.broadcast_to(satellites, (*lead, 3, n_sats))).reshape(-1, 3, n_sats),
    )
    return range_m.reshape(*lead, n_sats), los.reshape(*lead, 3, n_sats)


def predicted_state(
    ephemeris: Ephemeris, gps_week: int, tow_rx_s: ArrayLike, receiver_xyz_m: FloatArray, band: int | None = L1
) -> SatelliteState:
    """State at the time of transmission of a signal received at a known time and place, without a pseudorange.

    Parameters
    ----------
    gps_week : int
    tow_rx_s : scalar or (..., N_SATS) array
        System time of reception [s].
    receiver_xyz_m : (..., 3) array
        Receiver positions at reception [m].

    Notes
    -----
    A mean flight time is wrong by at most 0.02 s; moving the satellite linearly over that leaves 0.1 mm, so that the
    second evaluation is exact to well below a micrometre.
    """
    tow_rx = np.asarray(tow_rx_s, dtype=np.float64)
    first = satellite_state(ephemeris, gps_week, tow_rx - _MEAN_FLIGHT_S, None)
    range_m, _ = rotated_range(receiver_xyz_m, first.position_m)
    late_s = _MEAN_FLIGHT_S - range_m / SPEED_OF_LIGHT_MPS
    moved = first.position_m + first.velocity_mps * late_s[..., np.newaxis, :]
    range_m, _ = rotated_range(receiver_xyz_m, moved)
    return satellite_state(ephemeris, gps_week, tow_rx - range_m / SPEED_OF_LIGHT_MPS, band)
