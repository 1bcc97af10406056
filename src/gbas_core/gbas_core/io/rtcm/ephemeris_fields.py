"""Ephemeris messages 1019, 1045 and 1046: the integers as they were sent, in units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from gbas_core.gnss.ephemeris import FIELDS, VALIDITY_S, NavigationMessage
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
from gbas_core.io.rinex.navigation import checked_iodc
from gbas_core.satellites import SAT_INDEX

LONGEST_VALIDITY_S: Final = float(VALIDITY_S.max())

_ICD_PI: Final = 3.1415926535898
_FIRST_MSM_WEEK: Final = 1725  # 2013-01-27; RTCM 10403.2, which brought the MSM, is of 2013-02-01
_GALILEO_WEEK_OFFSET: Final = 1024
_GPS_WEEK_MODULUS: Final = 1024
_GALILEO_WEEK_MODULUS: Final = 4096
# Field of Ephemeris: field of the parser, power of two, in semicircles or not. The same for GPS and Galileo.
_ORBIT: Final[Mapping[str, tuple[str, int, bool]]] = {
    "sqrt_a": ("sqrt_a", -19, False),
    "e": ("eccentricity", -33, False),
    "m0_rad": ("m0", -31, True),
    "delta_n_radps": ("delta_n", -43, True),
    "omega0_rad": ("omega0", -31, True),
    "i0_rad": ("i0", -31, True),
    "omega_rad": ("omega", -31, True),
    "omega_dot_radps": ("omega_dot", -43, True),
    "idot_radps": ("idot", -43, True),
    "cuc_rad": ("c_uc", -29, False),
    "cus_rad": ("c_us", -29, False),
    "crc_m": ("c_rc", -5, False),
    "crs_m": ("c_rs", -5, False),
    "cic_rad": ("c_ic", -29, False),
    "cis_rad": ("c_is", -29, False),
}
_GPS_CLOCK: Final = {"af0_s": ("a_f0", -31), "af1_sps": ("a_f1", -43), "af2_sps2": ("a_f2", -55)}
_GALILEO_CLOCK: Final = {"af0_s": ("a_f0", -34), "af1_sps": ("a_f1", -46), "af2_sps2": ("a_f2", -59)}
_GPS_TIME_STEP_S: Final = 16
_GALILEO_TIME_STEP_S: Final = 60
_TGD_POWER: Final = -31
_BGD_POWER: Final = -32


@dataclass(frozen=True, kw_only=True)
class RawEphemeris:
    """One ephemeris message.

    Attributes
    ----------
    message : NavigationMessage
    body : sidereon ephemeris
        Its fields as integers.

    Source: RTCM 10403.3, messages 1019, 1045 (F/NAV) and 1046 (I/NAV); the scales are those of IS-GPS-200N tables 20-I
    and 20-III and of the Galileo OS SIS ICD 2.1.
    """

    message: NavigationMessage
    body: Any

    @classmethod
    def of(cls, message: Any) -> RawEphemeris | None:
        """The ephemeris of a decoded message; None if it holds none."""
        for kind, body in (
            (NavigationMessage.GPS_LNAV, message.gps_ephemeris),
            (NavigationMessage.GALILEO_INAV, message.galileo_inav_ephemeris),
            (NavigationMessage.GALILEO_FNAV, message.galileo_fnav_ephemeris),
        ):
            if body is not None:
                return cls(message=kind, body=body)
        return None

    @property
    def satellite(self) -> int | None:
        """Place on the satellite axis; None if the satellite has none."""
        return SAT_INDEX.get(self.body.satellite() or "")

    @property
    def is_gps(self) -> bool:
        return self.message is NavigationMessage.GPS_LNAV

    @property
    def toe_tow_s(self) -> int:
        return int(self.body.t_oe) * self._time_step_s

    @property
    def week_modulus(self) -> int:
        """How many weeks it takes until the message's week number comes again."""
        return _GPS_WEEK_MODULUS if self.is_gps else _GALILEO_WEEK_MODULUS

    @property
    def gps_week(self) -> int:
        """The message's week as a GPS week: the first possible one since there are MSM (good until 2032 for GPS)."""
        number = int(self.body.week_number) + (0 if self.is_gps else _GALILEO_WEEK_OFFSET)
        return _FIRST_MSM_WEEK + (number - _FIRST_MSM_WEEK) % self.week_modulus

    def toe_after_s(self, time_s: float) -> float:
        """Time of ephemeris less a time, in the week that brings the two nearest [s]."""
        return (self.toe_tow_s - time_s + SECONDS_PER_WEEK / 2) % SECONDS_PER_WEEK - SECONDS_PER_WEEK / 2

    def is_of_week(self, toe_s: float) -> bool:
        """Whether the message's week goes with a time of ephemeris [s since the start of GPS time].

        It may be the week of the time of ephemeris or of the transmission, which is at most the validity away.
        """
        weeks = (
            int(time_s // SECONDS_PER_WEEK)
            for time_s in (toe_s - LONGEST_VALIDITY_S, toe_s, toe_s + LONGEST_VALIDITY_S)
        )
        return any((self.gps_week - week) % self.week_modulus == 0 for week in weeks)

    def values(self, toe_week: int) -> list[float]:
        """Fields of :class:`~gbas_core.gnss.ephemeris.Ephemeris`, in order, given the GPS week of the time of
        ephemeris.
        """
        toc_tow_s = int(self.body.t_oc) * self._time_step_s
        toc_week = toe_week + round((self.toe_tow_s - toc_tow_s) / SECONDS_PER_WEEK)
        clock = _GPS_CLOCK if self.is_gps else _GALILEO_CLOCK
        fields: dict[str, float] = {name: self._orbit(*scale) for name, scale in _ORBIT.items()}
        fields |= {name: math.ldexp(getattr(self.body, short), power) for name, (short, power) in clock.items()}
        fields |= {"message": self.message, "toe_week": toe_week, "toe_tow_s": self.toe_tow_s}
        fields |= {"toc_week": toc_week, "toc_tow_s": toc_tow_s}
        fields |= _gps_fields(self.body) if self.is_gps else _galileo_fields(self.message, self.body)
        return [float(fields[name]) for name in FIELDS]

    @property
    def _time_step_s(self) -> int:
        return _GPS_TIME_STEP_S if self.is_gps else _GALILEO_TIME_STEP_S

    def _orbit(self, short: str, power: int, semicircles: bool) -> float:
        return math.ldexp(getattr(self.body, short), power) * (_ICD_PI if semicircles else 1.0)


def _gps_fields(body: Any) -> dict[str, float]:
    iodc = checked_iodc(body.iodc, body.iode)
    return {
        "iod": body.iode,
        "iodc": math.nan if iodc is None else iodc,
        "group_delay_s": math.ldexp(body.t_gd, _TGD_POWER),
        "group_delay_e5b_s": math.nan,
        "health": body.sv_health,
        "accuracy_m": _ura_m(body.sv_accuracy),
    }


def _galileo_fields(message: NavigationMessage, body: Any) -> dict[str, float]:
    """Health as in RINEX: bits 0 to 2 are E1-B (invalid, status), 3 to 5 E5a, 6 to 8 E5b."""
    if message is NavigationMessage.GALILEO_FNAV:
        health = int(body.e5a_data_validity) << 3 | body.e5a_signal_health << 4
        bgd_e5b_s, index = math.nan, body.sisa
    else:
        health = int(body.e1b_data_validity) | body.e1b_signal_health << 1
        health |= int(body.e5b_data_validity) << 6 | body.e5b_signal_health << 7
        bgd_e5b_s, index = math.ldexp(body.bgd_e5b_e1, _BGD_POWER), body.sisa_index
    return {
        "iod": body.iod_nav,
        "iodc": math.nan,
        "group_delay_s": math.ldexp(body.bgd_e5a_e1, _BGD_POWER),
        "group_delay_e5b_s": bgd_e5b_s,
        "health": health,
        "accuracy_m": _sisa_m(index),
    }


def _ura_m(index: int) -> float:
    """Nominal URA [m], NaN for index 15. Source: IS-GPS-200N 20.3.3.3.1.3."""
    if index >= 15:
        return math.nan
    return round(2.0 ** (1.0 + index / 2.0), 1) if index <= 6 else 2.0 ** (index - 2)


def _sisa_m(index: int) -> float:
    """SISA [m]; NaN for spare values, no accuracy prediction, and 0. Source: Galileo OS SIS ICD 2.1, table 76."""
    steps = ((50, 0, 0.0, 0.01), (75, 50, 0.5, 0.02), (100, 75, 1.0, 0.04), (126, 100, 2.0, 0.16))
    found = next((base + (index - first) * step for end, first, base, step in steps if index < end), math.nan)
    return found or math.nan
