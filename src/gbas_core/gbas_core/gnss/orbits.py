"""Satellite positions, velocities and clocks from broadcast ephemerides, on the satellite axis.

Every function takes an :class:`~gbas_core.gnss.ephemeris.Ephemeris` and arrays whose trailing axis is the satellite
axis. What an ephemeris does not hold is NaN in the result; nothing is assumed. Whether an ephemeris is healthy and in
its validity is the business of :class:`~gbas_core.gnss.ephemeris.EphemerisStore`.

Source: IS-GPS-200N 20.3.3.3.3 and table 20-IV; Galileo OS SIS ICD 2.1, 5.1.1 to 5.1.5. Velocity: the time derivative
of table 20-IV (also in its later rows).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.gnss.frames import EARTH_RATE_RADPS, GM_GALILEO_M3PS2, GM_GPS_M3PS2, los_and_range
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
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


class SatellitePlace(NamedTuple):
    """Position and clock of :class:`SatelliteState` alone: half the work."""

    position_m: FloatArray
    clock_s: FloatArray


class _Anomaly(NamedTuple):
    """Eccentric anomaly and what follows from it, each (..., N_SATS); the mean motion is (N_SATS,)."""

    since_toe_s: FloatArray
    sin_e: FloatArray
    cos_e: FloatArray
    distance: FloatArray
    """Distance over semi-major axis, ``1 - e cos E``."""
    motion_radps: FloatArray

    @property
    def rate_radps(self) -> FloatArray:
        """Rate of the eccentric anomaly."""
        return self.motion_radps / self.distance


class _Orbit(NamedTuple):
    """Position in the orbital plane and the plane's orientation, each (..., N_SATS) (table 20-IV)."""

    sin_2: FloatArray
    cos_2: FloatArray
    x: FloatArray
    y: FloatArray
    cos_u: FloatArray
    sin_u: FloatArray
    cos_i: FloatArray
    sin_i: FloatArray
    cos_node: FloatArray
    sin_node: FloatArray
    node_rate: FloatArray


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
    return _Anomaly(since_toe, np.sin(anomaly), cos_e, 1.0 - e * cos_e, motion)


def _clock_s(
    ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, anomaly: _Anomaly, band: int | None
) -> FloatArray:
    since_toc = _seconds_since(ephemeris.toc_week, ephemeris.toc_tow_s, gps_week, tow_tx_s)
    polynomial = ephemeris.af0_s + since_toc * (ephemeris.af1_sps + since_toc * ephemeris.af2_sps2)
    relativity = RELATIVISTIC_F * ephemeris.e * ephemeris.sqrt_a
    return polynomial + relativity * anomaly.sin_e - group_delay_s(ephemeris, band)


def _clock_drift(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, anomaly: _Anomaly) -> FloatArray:
    since_toc = _seconds_since(ephemeris.toc_week, ephemeris.toc_tow_s, gps_week, tow_tx_s)
    relativity = RELATIVISTIC_F * ephemeris.e * ephemeris.sqrt_a
    return ephemeris.af1_sps + 2.0 * ephemeris.af2_sps2 * since_toc + relativity * anomaly.cos_e * anomaly.rate_radps


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
    return _clock_s(ephemeris, gps_week, tow_tx_s, _eccentric_anomaly(ephemeris, gps_week, tow_tx_s), band)


def satellite_state(ephemeris: Ephemeris, gps_week: int, tow_tx_s: ArrayLike, band: int | None = L1) -> SatelliteState:
    """Position, velocity and clock at times of transmission in system time; arguments as :func:`satellite_clock_s`."""
    anomaly = _eccentric_anomaly(ephemeris, gps_week, tow_tx_s)
    orbit = _orbit(ephemeris, anomaly)
    position = _position_m(orbit)
    return SatelliteState(
        position_m=position,
        velocity_mps=_velocity_mps(ephemeris, anomaly, orbit, position),
        clock_s=_clock_s(ephemeris, gps_week, tow_tx_s, anomaly, band),
        clock_drift=_clock_drift(ephemeris, gps_week, tow_tx_s, anomaly),
    )


def _orbit(ephemeris: Ephemeris, anomaly: _Anomaly) -> _Orbit:
    eph, e = ephemeris, ephemeris.e
    root = np.sqrt(1.0 - e**2)
    phase = np.arctan2(root * anomaly.sin_e, anomaly.cos_e - e) + eph.omega_rad
    sin_2, cos_2 = np.sin(2.0 * phase), np.cos(2.0 * phase)
    latitude = phase + eph.cus_rad * sin_2 + eph.cuc_rad * cos_2
    radius = eph.sqrt_a**2 * anomaly.distance + eph.crs_m * sin_2 + eph.crc_m * cos_2
    inclination = eph.i0_rad + eph.idot_radps * anomaly.since_toe_s + eph.cis_rad * sin_2 + eph.cic_rad * cos_2
    node_rate = eph.omega_dot_radps - EARTH_RATE_RADPS
    node = eph.omega0_rad + node_rate * anomaly.since_toe_s - EARTH_RATE_RADPS * eph.toe_tow_s
    sin_u, cos_u = np.sin(latitude), np.cos(latitude)
    return _Orbit(
        sin_2=sin_2,
        cos_2=cos_2,
        x=radius * cos_u,
        y=radius * sin_u,
        cos_u=cos_u,
        sin_u=sin_u,
        cos_i=np.cos(inclination),
        sin_i=np.sin(inclination),
        cos_node=np.cos(node),
        sin_node=np.sin(node),
        node_rate=node_rate,
    )


def _position_m(orbit: _Orbit) -> FloatArray:
    x, y = orbit.x, orbit.y
    position = np.empty((*x.shape[:-1], 3, x.shape[-1]))
    position[..., 0, :] = x * orbit.cos_node - y * orbit.cos_i * orbit.sin_node
    position[..., 1, :] = x * orbit.sin_node + y * orbit.cos_i * orbit.cos_node
    position[..., 2, :] = y * orbit.sin_i
    return position


def _velocity_mps(ephemeris: Ephemeris, anomaly: _Anomaly, orbit: _Orbit, position_m: FloatArray) -> FloatArray:
    """Time derivative of the position."""
    eph, e = ephemeris, ephemeris.e
    x, y, sin_2, cos_2 = orbit.x, orbit.y, orbit.sin_2, orbit.cos_2
    phase_rate = np.sqrt(1.0 - e**2) * anomaly.rate_radps / anomaly.distance
    twice_rate = 2.0 * phase_rate
    latitude_rate = phase_rate + twice_rate * (eph.cus_rad * cos_2 - eph.cuc_rad * sin_2)
    radius_rate = eph.sqrt_a**2 * e * anomaly.sin_e * anomaly.rate_radps
    radius_rate = radius_rate + twice_rate * (eph.crs_m * cos_2 - eph.crc_m * sin_2)
    inclination_rate = eph.idot_radps + twice_rate * (eph.cis_rad * cos_2 - eph.cic_rad * sin_2)
    x_rate = radius_rate * orbit.cos_u - y * latitude_rate
    y_rate = radius_rate * orbit.sin_u + x * latitude_rate

    across = y_rate * orbit.cos_i - y * orbit.sin_i * inclination_rate
    node_rate, sin_node, cos_node = orbit.node_rate, orbit.sin_node, orbit.cos_node
    velocity = np.empty_like(position_m)
    velocity[..., 0, :] = x_rate * cos_node - across * sin_node - node_rate * position_m[..., 1, :]
    velocity[..., 1, :] = x_rate * sin_node + across * cos_node + node_rate * position_m[..., 0, :]
    velocity[..., 2, :] = y_rate * orbit.sin_i + y * orbit.cos_i * inclination_rate
    return velocity


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
    return satellite_state(ephemeris, gps_week, _transmit_tow_s(ephemeris, gps_week, tow_rx_s, pseudorange_m), band)


def transmit_place(
    ephemeris: Ephemeris, gps_week: int, tow_rx_s: ArrayLike, pseudorange_m: FloatArray, band: int | None = L1
) -> SatellitePlace:
    """Position and clock of :func:`transmit_state`, to the same bits."""
    tow_tx = _transmit_tow_s(ephemeris, gps_week, tow_rx_s, pseudorange_m)
    anomaly = _eccentric_anomaly(ephemeris, gps_week, tow_tx)
    return SatellitePlace(
        position_m=_position_m(_orbit(ephemeris, anomaly)),
        clock_s=_clock_s(ephemeris, gps_week, tow_tx, anomaly, band),
    )


def _transmit_tow_s(ephemeris: Ephemeris, gps_week: int, tow_rx_s: ArrayLike, pseudorange_m: FloatArray) -> FloatArray:
    """System time of transmission."""
    tow_sv = np.asarray(tow_rx_s, dtype=np.float64) - pseudorange_m / SPEED_OF_LIGHT_MPS
    since_toc = _seconds_since(ephemeris.toc_week, ephemeris.toc_tow_s, gps_week, tow_sv)
    clock = ephemeris.af0_s + since_toc * (ephemeris.af1_sps + since_toc * ephemeris.af2_sps2)
    return np.asarray(tow_sv - clock)


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
