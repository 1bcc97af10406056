"""Satellite positions, velocities and clocks from broadcast ephemerides, on the satellite axis.

Every function takes an :class:`~gbas_core.ephemeris.Ephemeris` and arrays whose trailing axis is the satellite axis.
What an ephemeris does not hold is NaN in the result; nothing is assumed. Whether an ephemeris is healthy and in its
validity is the business of :class:`~gbas_core.ephemeris.EphemerisStore`.

Source: IS-GPS-200N 20.3.3.3.3 and table 20-IV; Galileo OS SIS ICD 2.1, 5.1.1 to 5.1.5. Velocity: the time derivative
of table 20-IV (also in its later rows).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.ephemeris import Ephemeris, NavigationMessage
from gbas_core.frames import EARTH_RATE_RADPS, GM_GALILEO_M3PS2, GM_GPS_M3PS2, los_and_range
from gbas_core.gpstime import SECONDS_PER_WEEK
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS
from gbas_core.signals import IONO_RATIO, L1, L2, SPEED_OF_LIGHT_MPS

GM_M3PS2: Final[FloatArray] = np.where(IS_GPS, GM_GPS_M3PS2, GM_GALILEO_M3PS2)
"""Gravitational constant each system's ephemerides are made with, on the satellite axis."""
RELATIVISTIC_F: Final[FloatArray] = -2.0 * np.sqrt(GM_M3PS2) / SPEED_OF_LIGHT_MPS**2
"""Factor of e sqrt(A) sin E in the clock's relativistic term [s/m^0.5]."""

_SQRT_GM: Final[FloatArray] = np.sqrt(GM_M3PS2)
# Newton from M + e sin M: four steps reach rounding for every eccentricity the messages can carry (below 0.5).
_KEPLER_STEPS: Final = 4
_MEAN_FLIGHT_S: Final = 0.077
# As floats: comparing arrays with members of an enumeration is slow.
_GPS_LNAV: Final = float(NavigationMessage.GPS_LNAV)
_GALILEO_INAV: Final = float(NavigationMessage.GALILEO_INAV)
_GALILEO_FNAV: Final = float(NavigationMessage.GALILEO_FNAV)


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


class _Anomaly(NamedTuple):
    """Eccentric anomaly and what follows from it, each (..., N_SATS)."""

    since_toe_s: FloatArray
    sin_e: FloatArray
    cos_e: FloatArray
    rate_radps: FloatArray


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
    if band is None:
        return np.where(np.isfinite(ephemeris.af0_s), 0.0, np.nan)
    first, e5b = ephemeris.group_delay_s, ephemeris.group_delay_e5b_s
    ratio = IONO_RATIO[band]
    fnav = ratio * first
    inav = e5b if band == L1 else e5b + (ratio - 1.0) * first
    gps = ratio * first if band == L2 else first
    message = ephemeris.message
    galileo = np.where(message == _GALILEO_INAV, inav, np.where(message == _GALILEO_FNAV, fnav, np.nan))
    return np.where(message == _GPS_LNAV, gps, galileo)


def _seconds_since(week: FloatArray, tow_s: FloatArray, gps_week: int, at_tow_s: ArrayLike) -> FloatArray:
    return (gps_week - week) * SECONDS_PER_WEEK + (np.asarray(at_tow_s, dtype=np.float64) - tow_s)


def _eccentric_anomaly(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike) -> _Anomaly:
    since_toe = _seconds_since(ephemeris.toe_week, ephemeris.toe_tow_s, gps_week, tow_tx_s)
    e = ephemeris.e
    motion = _SQRT_GM / ephemeris.sqrt_a**3 + ephemeris.delta_n_radps
    mean = ephemeris.m0_rad + motion * since_toe
    anomaly = mean + e * np.sin(mean)
    for _ in range(_KEPLER_STEPS):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1.0 - e * np.cos(anomaly))
    cos_e = np.cos(anomaly)
    return _Anomaly(since_toe, np.sin(anomaly), cos_e, motion / (1.0 - e * cos_e))


def _clock(
    ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, anomaly: _Anomaly, band: int | None
) -> tuple[FloatArray, FloatArray]:
    since_toc = _seconds_since(ephemeris.toc_week, ephemeris.toc_tow_s, gps_week, tow_tx_s)
    polynomial = ephemeris.af0_s + since_toc * (ephemeris.af1_sps + since_toc * ephemeris.af2_sps2)
    relativity = RELATIVISTIC_F * ephemeris.e * ephemeris.sqrt_a
    bias = polynomial + relativity * anomaly.sin_e - group_delay_s(ephemeris, band)
    drift = ephemeris.af1_sps + 2.0 * ephemeris.af2_sps2 * since_toc + relativity * anomaly.cos_e * anomaly.rate_radps
    return bias, drift


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
    return _clock(ephemeris, gps_week, tow_tx_s, _eccentric_anomaly(ephemeris, gps_week, tow_tx_s), band)[0]


def satellite_state(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, band: int | None = L1) -> SatelliteState:
    """Position, velocity and clock at times of transmission in system time; arguments as :func:`satellite_clock_s`."""
    anomaly = _eccentric_anomaly(ephemeris, gps_week, tow_tx_s)
    in_plane, in_plane_rate, inclination, inclination_rate = _orbital_plane(ephemeris, anomaly)
    node_rate = ephemeris.omega_dot_radps - EARTH_RATE_RADPS
    node = ephemeris.omega0_rad + node_rate * anomaly.since_toe_s - EARTH_RATE_RADPS * ephemeris.toe_tow_s
    sin_node, cos_node = np.sin(node), np.cos(node)
    sin_i, cos_i = np.sin(inclination), np.cos(inclination)
    (x, y), (x_rate, y_rate) = in_plane, in_plane_rate

    position = np.empty((*x.shape[:-1], 3, x.shape[-1]))
    position[..., 0, :] = x * cos_node - y * cos_i * sin_node
    position[..., 1, :] = x * sin_node + y * cos_i * cos_node
    position[..., 2, :] = y * sin_i
    across = y_rate * cos_i - y * sin_i * inclination_rate
    velocity = np.empty_like(position)
    velocity[..., 0, :] = x_rate * cos_node - across * sin_node - node_rate * position[..., 1, :]
    velocity[..., 1, :] = x_rate * sin_node + across * cos_node + node_rate * position[..., 0, :]
    velocity[..., 2, :] = y_rate * sin_i + y * cos_i * inclination_rate
    clock, drift = _clock(ephemeris, gps_week, tow_tx_s, anomaly, band)
    return SatelliteState(position_m=position, velocity_mps=velocity, clock_s=clock, clock_drift=drift)


_Pair = tuple[FloatArray, FloatArray]


def _orbital_plane(ephemeris: Ephemeris, anomaly: _Anomaly) -> tuple[_Pair, _Pair, FloatArray, FloatArray]:
    """Corrected position and velocity in the orbital plane, inclination and its rate (table 20-IV)."""
    eph, e = ephemeris, ephemeris.e
    root = np.sqrt(1.0 - e**2)
    denominator = 1.0 - e * anomaly.cos_e
    phase = np.arctan2(root * anomaly.sin_e, anomaly.cos_e - e) + eph.omega_rad
    phase_rate = root * anomaly.rate_radps / denominator
    sin_2, cos_2 = np.sin(2.0 * phase), np.cos(2.0 * phase)
    twice_rate = 2.0 * phase_rate

    latitude = phase + eph.cus_rad * sin_2 + eph.cuc_rad * cos_2
    latitude_rate = phase_rate + twice_rate * (eph.cus_rad * cos_2 - eph.cuc_rad * sin_2)
    semi_major = eph.sqrt_a**2
    radius = semi_major * denominator + eph.crs_m * sin_2 + eph.crc_m * cos_2
    radius_rate = semi_major * e * anomaly.sin_e * anomaly.rate_radps
    radius_rate = radius_rate + twice_rate * (eph.crs_m * cos_2 - eph.crc_m * sin_2)
    inclination = eph.i0_rad + eph.idot_radps * anomaly.since_toe_s + eph.cis_rad * sin_2 + eph.cic_rad * cos_2
    inclination_rate = eph.idot_radps + twice_rate * (eph.cis_rad * cos_2 - eph.cic_rad * sin_2)

    sin_u, cos_u = np.sin(latitude), np.cos(latitude)
    x, y = radius * cos_u, radius * sin_u
    x_rate, y_rate = radius_rate * cos_u - y * latitude_rate, radius_rate * sin_u + x * latitude_rate
    return (x, y), (x_rate, y_rate), inclination, inclination_rate


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
    tow_sv = np.asarray(tow_rx_s, dtype=np.float64) - pseudorange_m / SPEED_OF_LIGHT_MPS
    since_toc = _seconds_since(ephemeris.toc_week, ephemeris.toc_tow_s, gps_week, tow_sv)
    clock = ephemeris.af0_s + since_toc * (ephemeris.af1_sps + since_toc * ephemeris.af2_sps2)
    return satellite_state(ephemeris, gps_week, tow_sv - clock, band)


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
    receiver = np.asarray(receiver_xyz_m, dtype=np.float64)
    x, y = sat_xyz_m[..., 0, :], sat_xyz_m[..., 1, :]
    delta = sat_xyz_m - receiver[..., :, np.newaxis]
    straight = np.sqrt(delta[..., 0, :] ** 2 + delta[..., 1, :] ** 2 + delta[..., 2, :] ** 2)
    crossed = x * receiver[..., 1, np.newaxis] - y * receiver[..., 0, np.newaxis]
    flight_s = (straight + EARTH_RATE_RADPS / SPEED_OF_LIGHT_MPS * crossed) / SPEED_OF_LIGHT_MPS
    angle = EARTH_RATE_RADPS * flight_s
    sin_angle, cos_angle = np.sin(angle), np.cos(angle)
    rotated = np.empty_like(delta)
    rotated[..., 0, :] = cos_angle * x + sin_angle * y
    rotated[..., 1, :] = cos_angle * y - sin_angle * x
    rotated[..., 2, :] = sat_xyz_m[..., 2, :]
    los, range_m = los_and_range(receiver, rotated)
    return range_m, los


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
