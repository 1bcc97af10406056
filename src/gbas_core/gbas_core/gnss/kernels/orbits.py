# mypy: disable-error-code="no-untyped-call"
"""Satellites from broadcast ephemerides, on single numbers, and loops over receivers and satellites.

``values`` (fields, N) is :attr:`gbas_core.gnss.ephemeris.Ephemeris.values`, ``s`` a place on the satellite axis.

Source: IS-GPS-200N 20.3.3.3.3 and table 20-IV; Galileo OS SIS ICD 2.1, 5.1.1 to 5.1.5. Velocity: the time derivative
of table 20-IV (also in its later rows).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.gnss.ephemeris import FIELDS, NavigationMessage
from gbas_core.gnss.frames import EARTH_RATE_RADPS, GM_GALILEO_M3PS2, GM_GPS_M3PS2
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
from gbas_core.gnss.kernels.frames import azimuth_elevation
from gbas_core.satellites import IS_GPS
from gbas_core.signals import IONO_RATIO, L1, L2, SPEED_OF_LIGHT_MPS

GM_M3PS2: Final = np.where(IS_GPS, GM_GPS_M3PS2, GM_GALILEO_M3PS2)
"""Gravitational constant each system's ephemerides are made with, on the satellite axis."""
RELATIVISTIC_F: Final = -2.0 * np.sqrt(GM_M3PS2) / SPEED_OF_LIGHT_MPS**2
"""Factor of e sqrt(A) sin E in the clock's relativistic term [s/m^0.5]."""
CLOCK_AS_BROADCAST: Final = -1
"""Instead of a band: the clock of an ionosphere-free combination, without a group delay."""
MEAN_RANGE_M: Final = 23.0e6
"""Pseudorange assumed for the elevation of a satellite whose range is not known: it moves the satellite by less than
70 m, that is the elevation by less than 0.0002 degrees."""

_SQRT_GM: Final = np.sqrt(GM_M3PS2)
# Newton from M + e sin M: four steps reach rounding for every eccentricity the messages can carry (below 0.5).
_KEPLER_STEPS: Final = 4
_KEPLER_CONVERGED_RAD: Final = 1e-9  # the error after a step is below half its square
_GPS_LNAV, _GALILEO_INAV, _GALILEO_FNAV = (float(each) for each in NavigationMessage)
_MESSAGE, _TOE_WEEK, _TOE_TOW, _TOC_WEEK, _TOC_TOW = (
    FIELDS.index(name) for name in ("message", "toe_week", "toe_tow_s", "toc_week", "toc_tow_s")
)
_SQRT_A, _E, _M0, _DELTA_N, _OMEGA0, _I0, _OMEGA, _OMEGA_DOT, _IDOT = (
    FIELDS.index(name)
    for name in (
        "sqrt_a", "e", "m0_rad", "delta_n_radps", "omega0_rad", "i0_rad", "omega_rad", "omega_dot_radps", "idot_radps"
    )
)  # fmt: skip
_CUC, _CUS, _CRC, _CRS, _CIC, _CIS = (
    FIELDS.index(name) for name in ("cuc_rad", "cus_rad", "crc_m", "crs_m", "cic_rad", "cis_rad")
)
_AF0, _AF1, _AF2, _TGD, _BGD_E5B = (
    FIELDS.index(name) for name in ("af0_s", "af1_sps", "af2_sps2", "group_delay_s", "group_delay_e5b_s")
)


@compiled
def seconds_since(week, tow_s, gps_week, at_tow_s):  # type: ignore[no-untyped-def]
    """Time from an instant to another [s]."""
    return (gps_week - week) * SECONDS_PER_WEEK + (at_tow_s - tow_s)


@compiled
def mean_motion_radps(sqrt_gm, sqrt_a, delta_n_radps):  # type: ignore[no-untyped-def]
    """Corrected mean motion n (table 20-IV)."""
    return sqrt_gm / sqrt_a**3 + delta_n_radps


@compiled
def eccentric_anomaly(mean_rad, e):  # type: ignore[no-untyped-def]
    """Sine and cosine of the solution of Kepler's equation M = E - e sin E, by Newton's steps."""
    anomaly = mean_rad + e * np.sin(mean_rad)
    for _ in range(_KEPLER_STEPS):
        step = (anomaly - e * np.sin(anomaly) - mean_rad) / (1.0 - e * np.cos(anomaly))
        anomaly = anomaly - step
        if abs(step) < _KEPLER_CONVERGED_RAD:
            break
    return np.sin(anomaly), np.cos(anomaly)


@compiled
def clock_polynomial_s(values, s, since_toc_s):  # type: ignore[no-untyped-def]
    """Satellite clock less system time, without relativity and group delay [s]."""
    return values[_AF0, s] + since_toc_s * (values[_AF1, s] + since_toc_s * values[_AF2, s])


@compiled
def group_delay_s(values, s, band):  # type: ignore[no-untyped-def]
    """Group delay of a band; see :func:`gbas_core.gnss.orbits.group_delay_s`."""
    if band == CLOCK_AS_BROADCAST:
        return 0.0 if np.isfinite(values[_AF0, s]) else np.nan
    message, first, e5b, ratio = values[_MESSAGE, s], values[_TGD, s], values[_BGD_E5B, s], IONO_RATIO[band]
    if message == _GPS_LNAV:
        return ratio * first if band == L2 else first
    if message == _GALILEO_INAV:
        return e5b if band == L1 else e5b + (ratio - 1.0) * first
    return ratio * first if message == _GALILEO_FNAV else np.nan


@compiled
def satellite_anomaly(values, s, gps_week, tow_s):  # type: ignore[no-untyped-def]
    """Time since toe [s], sine and cosine of the eccentric anomaly, and its rate [rad/s]."""
    since_toe_s = seconds_since(values[_TOE_WEEK, s], values[_TOE_TOW, s], gps_week, tow_s)
    motion_radps = mean_motion_radps(_SQRT_GM[s], values[_SQRT_A, s], values[_DELTA_N, s])
    sin_e, cos_e = eccentric_anomaly(values[_M0, s] + motion_radps * since_toe_s, values[_E, s])
    return since_toe_s, sin_e, cos_e, motion_radps / (1.0 - values[_E, s] * cos_e)


@compiled
def satellite_clock(values, s, gps_week, tow_s, sin_e, band):  # type: ignore[no-untyped-def]
    """Satellite clock less system time with relativity and group delay [s]."""
    since_toc_s = seconds_since(values[_TOC_WEEK, s], values[_TOC_TOW, s], gps_week, tow_s)
    relativity = RELATIVISTIC_F[s] * values[_E, s] * values[_SQRT_A, s]
    return clock_polynomial_s(values, s, since_toc_s) + relativity * sin_e - group_delay_s(values, s, band)


@compiled
def satellite_clock_drift(values, s, gps_week, tow_s, cos_e, rate_radps):  # type: ignore[no-untyped-def]
    """Rate of :func:`satellite_clock` [s/s]."""
    since_toc_s = seconds_since(values[_TOC_WEEK, s], values[_TOC_TOW, s], gps_week, tow_s)
    relativity = RELATIVISTIC_F[s] * values[_E, s] * values[_SQRT_A, s]
    return values[_AF1, s] + 2.0 * values[_AF2, s] * since_toc_s + relativity * cos_e * rate_radps


@compiled
def orbit(values, s, since_toe_s, sin_e, cos_e):  # type: ignore[no-untyped-def]
    """Sine and cosine of twice the argument of latitude, of its corrected value, the inclination and the node; the
    corrected radius [m] (table 20-IV).
    """
    e = values[_E, s]
    phase = np.arctan2(np.sqrt(1.0 - e**2) * sin_e, cos_e - e) + values[_OMEGA, s]
    sin_2, cos_2 = np.sin(2.0 * phase), np.cos(2.0 * phase)
    latitude = phase + values[_CUS, s] * sin_2 + values[_CUC, s] * cos_2
    radius_m = values[_SQRT_A, s] ** 2 * (1.0 - e * cos_e) + values[_CRS, s] * sin_2 + values[_CRC, s] * cos_2
    inclination = values[_I0, s] + values[_IDOT, s] * since_toe_s + values[_CIS, s] * sin_2 + values[_CIC, s] * cos_2
    node = values[_OMEGA0, s] + (values[_OMEGA_DOT, s] - EARTH_RATE_RADPS) * since_toe_s
    node = node - EARTH_RATE_RADPS * values[_TOE_TOW, s]
    return (
        sin_2, cos_2, np.sin(latitude), np.cos(latitude), np.sin(inclination), np.cos(inclination),
        np.sin(node), np.cos(node), radius_m,
    )  # fmt: skip


@compiled
def position_m(orbital):  # type: ignore[no-untyped-def]
    """Position of an :func:`orbit`, ECEF."""
    _, _, sin_u, cos_u, sin_i, cos_i, sin_node, cos_node, radius_m = orbital
    x, y = radius_m * cos_u, radius_m * sin_u
    return x * cos_node - y * cos_i * sin_node, x * sin_node + y * cos_i * cos_node, y * sin_i


@compiled
def velocity_mps(values, s, sin_e, cos_e, rate_radps, orbital, x_m, y_m):  # type: ignore[no-untyped-def]
    """Time derivative of the position, of which ``x_m`` and ``y_m`` are two coordinates."""
    sin_2, cos_2, sin_u, cos_u, sin_i, cos_i, sin_node, cos_node, radius_m = orbital
    e = values[_E, s]
    x, y = radius_m * cos_u, radius_m * sin_u
    phase_rate = np.sqrt(1.0 - e**2) * rate_radps / (1.0 - e * cos_e)
    twice_rate = 2.0 * phase_rate
    latitude_rate = phase_rate + twice_rate * (values[_CUS, s] * cos_2 - values[_CUC, s] * sin_2)
    radius_rate = values[_SQRT_A, s] ** 2 * e * sin_e * rate_radps
    radius_rate = radius_rate + twice_rate * (values[_CRS, s] * cos_2 - values[_CRC, s] * sin_2)
    inclination_rate = values[_IDOT, s] + twice_rate * (values[_CIS, s] * cos_2 - values[_CIC, s] * sin_2)
    x_rate, y_rate = radius_rate * cos_u - y * latitude_rate, radius_rate * sin_u + x * latitude_rate
    across = y_rate * cos_i - y * sin_i * inclination_rate
    node_rate = values[_OMEGA_DOT, s] - EARTH_RATE_RADPS
    return (
        x_rate * cos_node - across * sin_node - node_rate * y_m,
        x_rate * sin_node + across * cos_node + node_rate * x_m,
        y_rate * sin_i + y * cos_i * inclination_rate,
    )


@compiled
def transmit_tow_s(values, s, gps_week, tow_rx_s, pseudorange_m):  # type: ignore[no-untyped-def]
    """System time of transmission of what was received with a pseudorange [s]."""
    tow_sv = tow_rx_s - pseudorange_m / SPEED_OF_LIGHT_MPS
    since_toc_s = seconds_since(values[_TOC_WEEK, s], values[_TOC_TOW, s], gps_week, tow_sv)
    return tow_sv - clock_polynomial_s(values, s, since_toc_s)


@compiled
def rotated_range(receiver_m, x, y, z):  # type: ignore[no-untyped-def]
    """Range [m] and line of sight from a receiver (3,) to a satellite; see
    :func:`gbas_core.gnss.orbits.rotated_range`.
    """
    to_x, to_y, to_z = x - receiver_m[0], y - receiver_m[1], z - receiver_m[2]
    straight = np.sqrt(to_x**2 + to_y**2 + to_z**2)
    crossed = x * receiver_m[1] - y * receiver_m[0]
    flight_s = (straight + EARTH_RATE_RADPS / SPEED_OF_LIGHT_MPS * crossed) / SPEED_OF_LIGHT_MPS
    angle = EARTH_RATE_RADPS * flight_s
    sin_angle, cos_angle = np.sin(angle), np.cos(angle)
    to_x = cos_angle * x + sin_angle * y - receiver_m[0]
    to_y = cos_angle * y - sin_angle * x - receiver_m[1]
    range_m = np.sqrt(to_x**2 + to_y**2 + to_z**2)
    return range_m, to_x / range_m, to_y / range_m, to_z / range_m


# --- loops


@compiled
def group_delays_s(values, band):  # type: ignore[no-untyped-def]
    """:func:`group_delay_s` of all satellites."""
    delay_s = np.empty(values.shape[1])
    for s in range(values.shape[1]):
        delay_s[s] = group_delay_s(values, s, band)
    return delay_s


@compiled
def rotated_ranges(receiver_m, satellite_m):  # type: ignore[no-untyped-def]
    """Ranges ``(n, k)`` and lines of sight ``(n, 3, k)`` of receivers ``(n, 3)`` and satellites ``(n, 3, k)``."""
    n, _, k = satellite_m.shape
    range_m, los = np.empty((n, k)), np.empty((n, 3, k))
    for i in range(n):
        for s in range(k):
            range_m[i, s], los[i, 0, s], los[i, 1, s], los[i, 2, s] = rotated_range(
                receiver_m[i], satellite_m[i, 0, s], satellite_m[i, 1, s], satellite_m[i, 2, s]
            )
    return range_m, los


@compiled
def transmit_times_s(values, gps_week, tow_rx_s, pseudorange_m):  # type: ignore[no-untyped-def]
    """:func:`transmit_tow_s` of ``(n, N)`` receptions."""
    tow_s = np.empty(pseudorange_m.shape)
    for i in range(tow_s.shape[0]):
        for s in range(tow_s.shape[1]):
            tow_s[i, s] = transmit_tow_s(values, s, gps_week, tow_rx_s[i, s], pseudorange_m[i, s])
    return tow_s


@compiled
def states(values, gps_week, tow_s, band):  # type: ignore[no-untyped-def]
    """Positions and velocities ``(n, 3, N)``, clocks and their rates ``(n, N)`` at times of transmission ``(n, N)``."""
    n, n_sats = tow_s.shape
    place_m, speed_mps = np.empty((n, 3, n_sats)), np.empty((n, 3, n_sats))
    clock_s, drift = np.empty((n, n_sats)), np.empty((n, n_sats))
    for i in range(n):
        for s in range(n_sats):
            at_s = tow_s[i, s]
            since_toe_s, sin_e, cos_e, rate_radps = satellite_anomaly(values, s, gps_week, at_s)
            orbital = orbit(values, s, since_toe_s, sin_e, cos_e)
            x, y, z = position_m(orbital)
            place_m[i, 0, s], place_m[i, 1, s], place_m[i, 2, s] = x, y, z
            speed_mps[i, 0, s], speed_mps[i, 1, s], speed_mps[i, 2, s] = velocity_mps(
                values, s, sin_e, cos_e, rate_radps, orbital, x, y
            )
            clock_s[i, s] = satellite_clock(values, s, gps_week, at_s, sin_e, band)
            drift[i, s] = satellite_clock_drift(values, s, gps_week, at_s, cos_e, rate_radps)
    return place_m, speed_mps, clock_s, drift


@compiled
def transmit_place(values, s, gps_week, tow_rx_s, pseudorange_m, band):  # type: ignore[no-untyped-def]
    """Position [m] and clock [s] of one satellite when it sent what was received with a pseudorange."""
    tow_s = transmit_tow_s(values, s, gps_week, tow_rx_s, pseudorange_m)
    since_toe_s, sin_e, cos_e, _ = satellite_anomaly(values, s, gps_week, tow_s)
    x, y, z = position_m(orbit(values, s, since_toe_s, sin_e, cos_e))
    return x, y, z, satellite_clock(values, s, gps_week, tow_s, sin_e, band)


@compiled
def predicted_ranges(values, gps_week, tow_s, code_m, positions_m, enu, band):  # type: ignore[no-untyped-def]
    """Ranges and clocks ``(2, R, N)`` at receivers, elevations and azimuths ``(2, N)`` at the last of the positions.

    Pseudoranges ``(R, N)``, positions ``(R + 1, 3)``, axes at the last ``(3, 3)``; see
    :func:`gbas_ground.channels.predicted_ranges.predict_ranges`.
    """
    n_receivers, n_sats = code_m.shape
    expected, directions = np.full((2, *code_m.shape), np.nan), np.full((2, n_sats), np.nan)
    range_m, clock_s, elevation, azimuth = expected[0], expected[1], directions[0], directions[1]
    for s in range(n_sats):
        if not np.isfinite(values[_MESSAGE, s]):
            continue
        x, y, z, mean_clock_s = transmit_place(values, s, gps_week, tow_s, MEAN_RANGE_M, band)
        _, to_x, to_y, to_z = rotated_range(positions_m[n_receivers], x, y, z)
        azimuth[s], elevation[s] = azimuth_elevation(enu, to_x, to_y, to_z)
        for r in range(n_receivers):
            at_x, at_y, at_z, clock_s[r, s] = x, y, z, mean_clock_s
            if np.isfinite(code_m[r, s]):
                at_x, at_y, at_z, clock_s[r, s] = transmit_place(values, s, gps_week, tow_s, code_m[r, s], band)
            range_m[r, s], _, _, _ = rotated_range(positions_m[r], at_x, at_y, at_z)
    return expected, directions
