"""Nominal GPS and Galileo constellations as broadcast ephemerides.

The orbits are the reference orbits the systems publish: circles, kept on their ground tracks. What is broadcast *is*
where the satellites are: every field is a multiple of its scale factor in the navigation message, and the rest of the
suite's orbit code gives the simulated positions. Clocks and group delays have sizes as in orbit and are drawn from the
seed.

Sources: GPS Standard Positioning Service Performance Standard (2001), tables 3-1 and A-2-1, unchanged in the 4th
edition (2008), table A.2-1; Galileo Open Service Definition Document and the European GNSS Service Centre's "Orbital
and technical parameters" (Walker 24/3/1, reference 2016-11-21 00:00:00 UTC). Scale factors: IS-GPS-200N tables 20-I
and 20-III; Galileo OS SIS ICD 2.1, 5.1.1, 5.1.3 and 5.1.5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.gnss.frames import EARTH_RATE_RADPS, GM_GALILEO_M3PS2, GM_GPS_M3PS2
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK, add_seconds, gps_from_calendar, seconds_between
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_GPS, N_SATS, missing

_DAY_S: Final = 86_400.0

# GPS: right ascension of the ascending node of planes A to F and argument of latitude of their slots 1 to 4 [deg], at
# 1993-07-01 00:00:00 UTC, when the Greenwich hour angle was 18 h 36 min 14.4 s. All known.
GPS_NODE_DEG: Final = (272.847, 332.847, 32.847, 92.847, 152.847, 212.847)
GPS_LATITUDE_ARGUMENT_DEG: Final = (
    (268.126, 161.786, 11.676, 41.806),
    (80.956, 173.336, 309.976, 204.376),
    (111.876, 11.796, 339.666, 241.556),
    (135.226, 265.446, 35.156, 167.356),
    (197.046, 302.596, 66.066, 333.686),
    (238.886, 345.226, 105.206, 135.346),
)
GPS_HOUR_ANGLE_DEG: Final = 15.0 * (18.0 + 36.0 / 60.0 + 14.4 / 3600.0)
GPS_EPOCH_UTC: Final = (1993, 7, 1)
GPS_EPOCH_LEAP_S: Final = 9.0
GPS_SEMI_MAJOR_M: Final = 26_559_700.0
GPS_INCLINATION_DEG: Final = 55.0
GPS_NODE_RATE_DEGPS: Final = -4.4874e-7

# Galileo: slot A01 at 2016-11-21 00:00:00 UTC, and the rates of the nominal slots. All known. (Slots listed by the
# service centre: A02 at 225.153, A05 at 0.153, C07 at 120.153 with its node at 197.632.)
GALILEO_NODE_DEG: Final = 317.632
GALILEO_LATITUDE_ARGUMENT_DEG: Final = 180.153
GALILEO_EPOCH_UTC: Final = (2016, 11, 21)
GALILEO_EPOCH_LEAP_S: Final = 17.0
GALILEO_SEMI_MAJOR_M: Final = 29_599_800.0
GALILEO_INCLINATION_DEG: Final = 56.0
GALILEO_NODE_RATE_DEGPS: Final = -0.02764398 / _DAY_S
GALILEO_MEAN_MOTION_DEGPS: Final = 613.72253566 / _DAY_S
GALILEO_PLANES: Final = 3
GALILEO_SLOTS: Final = 8
GALILEO_PHASING_DEG: Final = 15.0

# Times of ephemeris lie on a grid both messages can express: 16 s (GPS) and 60 s (Galileo).
_TOE_GRID_S: Final = 240.0
RECEIVED_BEFORE_S: Final = 3600.0
"""How long before the start of a simulation its ephemerides were received [s]."""

# Ours: bounds of the clocks and group delays drawn, as seen in broadcast ephemerides.
_CLOCK_BIAS_S: Final = 4.0e-4
_CLOCK_DRIFT_SPS: Final = 1.0e-11
_GROUP_DELAY_S: Final = 8.0e-9
_ACCURACY_M: Final = (2.0, 3.12)
_STREAM: Final = 1

# Scale factors (power of two, times pi for semicircles) of GPS LNAV and Galileo I/NAV.
_ORBIT_SCALES: Final[dict[str, float]] = {
    "sqrt_a": 2.0**-19,
    "e": 2.0**-33,
    "m0_rad": math.pi * 2.0**-31,
    "delta_n_radps": math.pi * 2.0**-43,
    "omega0_rad": math.pi * 2.0**-31,
    "i0_rad": math.pi * 2.0**-31,
    "omega_rad": math.pi * 2.0**-31,
    "omega_dot_radps": math.pi * 2.0**-43,
}
_CLOCK_SCALES: Final[dict[str, tuple[float, float]]] = {
    "af0_s": (2.0**-31, 2.0**-34),
    "af1_sps": (2.0**-43, 2.0**-46),
    "group_delay_s": (2.0**-31, 2.0**-32),
    "group_delay_e5b_s": (math.nan, 2.0**-32),
}
_ANGLES: Final = ("m0_rad", "omega0_rad", "omega_rad")
_ZERO_FIELDS: Final = ("idot_radps", "cuc_rad", "cus_rad", "crc_m", "crs_m", "cic_rad", "cis_rad", "af2_sps2")


class OrbitalSlots(NamedTuple):
    """Circular reference orbits at one time; arrays of one shape, in the end ``(N_SATS,)``.

    Attributes
    ----------
    semi_major_m, inclination_rad
        Size and inclination.
    node_longitude_rad
        Longitude of the ascending node from Greenwich.
    latitude_argument_rad
        Argument of latitude.
    node_rate_radps, mean_motion_radps
        Rate of the node against the stars, and of the argument of latitude.
    """

    semi_major_m: FloatArray
    inclination_rad: FloatArray
    node_longitude_rad: FloatArray
    latitude_argument_rad: FloatArray
    node_rate_radps: FloatArray
    mean_motion_radps: FloatArray


def greenwich_hour_angle_rad(days_since_j2000: float) -> float:
    """Greenwich mean sidereal time [rad] of a UT1 date, in days since 2000-01-01 12:00.

    Source: Aoki et al., The new definition of universal time, A&A 105 (1982), eq (13).
    """
    centuries = days_since_j2000 / 36_525.0
    seconds = 67_310.54841 + centuries * (
        876_600.0 * 3600.0 + 8_640_184.812866 + centuries * (0.093104 - 6.2e-6 * centuries)
    )
    return math.fmod(math.radians(seconds / 240.0), 2.0 * math.pi) % (2.0 * math.pi)


def nominal_slots(gps_week: int, tow_s: float) -> OrbitalSlots:
    """The 24 GPS and 24 Galileo reference slots at a time; GPS as PRN 1-24 (A1 to F4), Galileo as E01-E24 (A01 to C08).

    Notes
    -----
    GPS satellites are kept such that their ground tracks repeat every sidereal day: their mean motion here is twice the
    Earth's rate against their orbital planes, not the one that follows from the semi-major axis, which would let three
    decades of drift build up since the reference epoch.
    """
    gps = _advanced(_gps_reference(), _seconds_since(GPS_EPOCH_UTC, GPS_EPOCH_LEAP_S, gps_week, tow_s))
    galileo = _advanced(_galileo_reference(), _seconds_since(GALILEO_EPOCH_UTC, GALILEO_EPOCH_LEAP_S, gps_week, tow_s))
    on_axis = []
    for gps_values, galileo_values in zip(gps, galileo, strict=True):
        values = missing()
        values[: gps_values.size] = gps_values
        values[N_GPS : N_GPS + galileo_values.size] = galileo_values
        on_axis.append(values)
    return OrbitalSlots(*on_axis)


def _seconds_since(utc: tuple[int, int, int], leap_s: float, gps_week: int, tow_s: float) -> float:
    week, tow = gps_from_calendar(*utc)
    return seconds_between(week, tow + leap_s, gps_week, tow_s)


def _advanced(reference: OrbitalSlots, since_s: float) -> OrbitalSlots:
    node = reference.node_longitude_rad + (reference.node_rate_radps - EARTH_RATE_RADPS) * since_s
    argument = reference.latitude_argument_rad + reference.mean_motion_radps * since_s
    return reference._replace(
        node_longitude_rad=np.remainder(node, 2.0 * np.pi), latitude_argument_rad=np.remainder(argument, 2.0 * np.pi)
    )


def _gps_reference() -> OrbitalSlots:
    argument = np.radians(np.ravel(GPS_LATITUDE_ARGUMENT_DEG))
    node = np.radians(np.repeat(GPS_NODE_DEG, argument.size // len(GPS_NODE_DEG)) - GPS_HOUR_ANGLE_DEG)
    node_rate = math.radians(GPS_NODE_RATE_DEGPS)
    return OrbitalSlots(
        semi_major_m=np.full(argument.size, GPS_SEMI_MAJOR_M),
        inclination_rad=np.full(argument.size, math.radians(GPS_INCLINATION_DEG)),
        node_longitude_rad=node,
        latitude_argument_rad=argument,
        node_rate_radps=np.full(argument.size, node_rate),
        mean_motion_radps=np.full(argument.size, 2.0 * (EARTH_RATE_RADPS - node_rate)),
    )


def _galileo_reference() -> OrbitalSlots:
    plane, slot = np.divmod(np.arange(GALILEO_PLANES * GALILEO_SLOTS), GALILEO_SLOTS)
    noon, epoch = gps_from_calendar(2000, 1, 1, 12), gps_from_calendar(*GALILEO_EPOCH_UTC)
    hour_angle = greenwich_hour_angle_rad(seconds_between(*noon, *epoch) / _DAY_S)
    along = slot * (360.0 / GALILEO_SLOTS) + plane * GALILEO_PHASING_DEG
    return OrbitalSlots(
        semi_major_m=np.full(plane.size, GALILEO_SEMI_MAJOR_M),
        inclination_rad=np.full(plane.size, math.radians(GALILEO_INCLINATION_DEG)),
        node_longitude_rad=np.radians(GALILEO_NODE_DEG + plane * (360.0 / GALILEO_PLANES)) - hour_angle,
        latitude_argument_rad=np.radians(GALILEO_LATITUDE_ARGUMENT_DEG + along),
        node_rate_radps=np.full(plane.size, math.radians(GALILEO_NODE_RATE_DEGPS)),
        mean_motion_radps=np.full(plane.size, math.radians(GALILEO_MEAN_MOTION_DEGPS)),
    )


def nominal_ephemeris(gps_week: int, tow_s: float, *, seed: int, systems: NDArray[np.bool_]) -> Ephemeris:
    """Broadcast ephemerides of the nominal constellations for a simulation that starts at a time.

    Parameters
    ----------
    gps_week, tow_s
        Start; the times of ephemeris and clock are the nearest ones both messages can express.
    seed : int
        Of the clocks and group delays.
    systems : (N_SATS,) bool array
        Satellites wanted, see :func:`gbas_core.satellites.satellites_of`.

    Returns
    -------
    Ephemeris
        Received an hour before the start, healthy, every field a multiple of its scale factor.
    """
    toe_week, toe_tow_s = time_of_ephemeris(gps_week, tow_s)
    slots = nominal_slots(toe_week, toe_tow_s)
    present = np.isfinite(slots.semi_major_m) & systems
    fields = _orbit_fields(slots, toe_tow_s) | _clock_fields(seed)
    issue = issue_of(toe_week, toe_tow_s)
    fields |= {
        "message": np.where(IS_GPS, float(NavigationMessage.GPS_LNAV), float(NavigationMessage.GALILEO_INAV)),
        "iod": np.full(N_SATS, issue),
        "iodc": np.where(IS_GPS, issue, np.nan),
        "toe_week": np.full(N_SATS, float(toe_week)),
        "toe_tow_s": np.full(N_SATS, toe_tow_s),
        "toc_week": np.full(N_SATS, float(toe_week)),
        "toc_tow_s": np.full(N_SATS, toe_tow_s),
        "health": np.zeros(N_SATS),
        "accuracy_m": np.where(IS_GPS, *_ACCURACY_M),
    }
    week, tow = add_seconds(gps_week, tow_s, -RECEIVED_BEFORE_S)
    received = {name: np.where(present, values, np.nan) for name, values in fields.items()}
    return Ephemeris(gps_week=week, tow_s=tow, simulated=1.0, **received)


def time_of_ephemeris(gps_week: int, tow_s: float) -> tuple[int, float]:
    """The time nearest to a given one that both messages can express: week and time of week [s]."""
    return add_seconds(gps_week, 0.0, round(tow_s / _TOE_GRID_S) * _TOE_GRID_S)


def issue_of(toe_week: int, toe_tow_s: float) -> float:
    """Issue of data of an ephemeris; another for each within 13 hours."""
    return float((toe_week * round(SECONDS_PER_WEEK / _TOE_GRID_S) + int(toe_tow_s // _TOE_GRID_S)) % 200)


def group_delays_s(seed: int) -> dict[str, FloatArray]:
    """Group delays of all satellites, ``(N_SATS,)`` by field of the ephemeris [s]."""
    drawn = _clock_fields(seed)
    return {name: drawn[name] for name in ("group_delay_s", "group_delay_e5b_s")}


def quantised_fields(exact: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Fields of orbits and clocks as multiples of their scale factors, angles within half a turn of zero."""
    turned = {name: _half_turns(exact[name]) if name in _ANGLES else exact[name] for name in _ORBIT_SCALES}
    orbit = {name: _quantised(values, _ORBIT_SCALES[name]) for name, values in turned.items()}
    clock = {name: _quantised(exact[name], np.where(IS_GPS, *scales)) for name, scales in _CLOCK_SCALES.items()}
    return orbit | clock


def _quantised(values: FloatArray, scale: FloatArray | float) -> FloatArray:
    return np.asarray(np.rint(values / scale) * scale)


def _half_turns(angle_rad: FloatArray) -> FloatArray:
    """The same angles from -pi up to, not including, pi: the range of a message's two's complement semicircles."""
    return np.asarray(np.remainder(angle_rad + np.pi, 2.0 * np.pi) - np.pi)


def _orbit_fields(slots: OrbitalSlots, toe_tow_s: float) -> dict[str, FloatArray]:
    kepler = np.sqrt(np.where(IS_GPS, GM_GPS_M3PS2, GM_GALILEO_M3PS2) / slots.semi_major_m**3)
    exact = {
        "sqrt_a": np.sqrt(slots.semi_major_m),
        "e": np.zeros(N_SATS),
        "m0_rad": _half_turns(slots.latitude_argument_rad),
        "delta_n_radps": slots.mean_motion_radps - kepler,
        "omega0_rad": _half_turns(slots.node_longitude_rad + EARTH_RATE_RADPS * toe_tow_s),
        "i0_rad": slots.inclination_rad,
        "omega_rad": np.zeros(N_SATS),
        "omega_dot_radps": slots.node_rate_radps,
    }
    fields = {name: _quantised(values, _ORBIT_SCALES[name]) for name, values in exact.items()}
    return fields | {name: np.zeros(N_SATS) for name in _ZERO_FIELDS}


def _clock_fields(seed: int) -> dict[str, FloatArray]:
    generator = np.random.Generator(np.random.Philox(key=[seed, _STREAM]))
    bounds = (_CLOCK_BIAS_S, _CLOCK_DRIFT_SPS, _GROUP_DELAY_S, _GROUP_DELAY_S)
    draws = generator.uniform(-1.0, 1.0, (len(bounds), N_SATS)) * np.array(bounds)[:, np.newaxis]
    return {
        name: _quantised(draw, np.where(IS_GPS, *scales))
        for (name, scales), draw in zip(_CLOCK_SCALES.items(), draws, strict=True)
    }
