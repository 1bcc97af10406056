"""Broadcast ephemerides on the satellite axis."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from gbas_core.record import FloatArray, Record, per_satellite, scalar


class NavigationMessage(IntEnum):
    """The navigation message an ephemeris came from."""

    GPS_LNAV = 0
    GALILEO_INAV = 1
    GALILEO_FNAV = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Ephemeris(Record):
    """At most one broadcast ephemeris per satellite; the record's epoch is when they were received.

    Source of the fields: IS-GPS-200N tables 20-I to 20-III; Galileo OS SIS ICD 2.1 tables 58, 60 and 71.
    """

    simulated: float = scalar("-", "1 if a simulator made these ephemerides, 0 if they were recorded")
    message: FloatArray = per_satellite("-", "NavigationMessage")
    iod: FloatArray = per_satellite("-", "issue of data: IODE or IODnav")
    iodc: FloatArray = per_satellite("-", "issue of data, clock; NaN for Galileo")
    toe_week: FloatArray = per_satellite("week", "GPS week of the time of ephemeris")
    toe_tow_s: FloatArray = per_satellite("s", "time of ephemeris")
    toc_week: FloatArray = per_satellite("week", "GPS week of the time of clock")
    toc_tow_s: FloatArray = per_satellite("s", "time of clock")
    sqrt_a: FloatArray = per_satellite("m^0.5", "square root of the semi-major axis")
    e: FloatArray = per_satellite("-", "eccentricity")
    m0_rad: FloatArray = per_satellite("rad", "mean anomaly at toe")
    delta_n_radps: FloatArray = per_satellite("rad/s", "mean motion difference")
    omega0_rad: FloatArray = per_satellite("rad", "longitude of the ascending node at weekly epoch")
    i0_rad: FloatArray = per_satellite("rad", "inclination at toe")
    omega_rad: FloatArray = per_satellite("rad", "argument of perigee")
    omega_dot_radps: FloatArray = per_satellite("rad/s", "rate of right ascension")
    idot_radps: FloatArray = per_satellite("rad/s", "rate of inclination")
    cuc_rad: FloatArray = per_satellite("rad", "argument of latitude, cosine")
    cus_rad: FloatArray = per_satellite("rad", "argument of latitude, sine")
    crc_m: FloatArray = per_satellite("m", "orbit radius, cosine")
    crs_m: FloatArray = per_satellite("m", "orbit radius, sine")
    cic_rad: FloatArray = per_satellite("rad", "inclination, cosine")
    cis_rad: FloatArray = per_satellite("rad", "inclination, sine")
    af0_s: FloatArray = per_satellite("s", "clock bias")
    af1_sps: FloatArray = per_satellite("s/s", "clock drift")
    af2_sps2: FloatArray = per_satellite("s/s^2", "clock drift rate")
    group_delay_s: FloatArray = per_satellite("s", "GPS TGD; Galileo BGD(E1,E5a)")
    group_delay_e5b_s: FloatArray = per_satellite("s", "Galileo BGD(E1,E5b); NaN for GPS")
    health: FloatArray = per_satellite("-", "signal health, 0 is healthy")
    accuracy_m: FloatArray = per_satellite("m", "URA or SISA")
