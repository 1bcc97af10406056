"""Path point records of ARINC 424 navigation data: the final approach segment of one approach as a line of text.

Columns are those of the records the FAA publishes with its coded instrument flight procedures, checked with the CRC
that they carry (:mod:`gbas_vdb.messages.path_point`).

Source: ARINC 424 section 4.1.28 (path point record) as published; columns and units known from records whose CRC comes
out, but for threshold crossing heights in metres, of which none has been seen and which are refused.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import radians, remainder, tau
from typing import Final

RECORD_LENGTH: Final = 123
"""Characters up to the end of the CRC; what follows (file record number, cycle) is not looked at."""
_SECTION: Final = (4, "P")
_SUBSECTION: Final = (12, "P")
_CONTINUATION: Final = 26
_FEET_M: Final = 0.3048

# Steps of the FAS data block in the last digits of the columns: what is finer is not under the CRC, and refused.
_STEPS: Final = {
    "ltp_latitude": 5,
    "ltp_longitude": 5,
    "fpap_latitude": 5,
    "fpap_longitude": 5,
    "course_width": 25,
    "delta_length_offset": 8,
    "hal": 2,
    "val": 2,
}

# name: (first column, end, pattern, what is expected); columns count from 0.
_COLUMNS: Final[dict[str, tuple[int, int, str, str]]] = {
    "airport": (6, 10, r"[A-Z0-9]{2,4} *", "2 to 4 letters or digits"),
    "runway": (19, 24, r"RW(?:0[1-9]|[12]\d|3[0-6])[LCR]? *", "RW01 to RW36 with or without L, C, R"),
    "operation": (24, 26, r"\d\d", "two digits"),
    "route": (27, 28, r"[A-HJ-NP-Z ]", "a letter but I and O, or a space"),
    "sbas_provider": (28, 30, r"\d\d", "two digits"),
    "rpds": (30, 32, r"\d\d", "two digits"),
    "rpi": (32, 36, r"[A-Z0-9 ]{4}", "4 letters, digits or spaces"),
    "apd": (36, 37, r"\d", "a digit"),
    "ltp_latitude": (37, 48, r"[NS]\d{10}", "N or S, degrees, minutes and seconds to 0.0001"),
    "ltp_longitude": (48, 60, r"[EW]\d{11}", "E or W, degrees, minutes and seconds to 0.0001"),
    "ltp_height": (60, 66, r"[+-]\d{5}", "a sign and 5 digits, in 0.1 m"),
    "gpa": (66, 70, r"\d{4}", "4 digits, in 0.01 degrees"),
    "fpap_latitude": (70, 81, r"[NS]\d{10}", "N or S, degrees, minutes and seconds to 0.0001"),
    "fpap_longitude": (81, 93, r"[EW]\d{11}", "E or W, degrees, minutes and seconds to 0.0001"),
    "course_width": (93, 98, r"\d{5}", "5 digits, in 0.01 m"),
    "delta_length_offset": (98, 102, r"\d{4}", "4 digits, in m"),
    "tch": (102, 108, r"\d{6}", "6 digits, in 0.1 ft"),
    "tch_unit": (108, 109, r"F", "F: the step of heights in metres is not known to us"),
    "hal": (109, 112, r"\d{3}", "3 digits, in 0.1 m"),
    "val": (112, 115, r"\d{3}", "3 digits, in 0.1 m"),
    "crc": (115, 123, r"[0-9A-F]{8}", "8 hexadecimal digits"),
}


@dataclass(frozen=True, kw_only=True)
class PathPoint:
    """A path point record; names and units as in :class:`gbas_core.positioning.approach.FinalApproach` where it has
    them.

    Attributes
    ----------
    operation_type, sbas_provider, apd, rpds : int
        As coded.
    fpap_lat_rad, fpap_lon_rad : float
        Flight path alignment point [rad].
    hal_m, val_m : float
        Horizontal and vertical alert limits [m].
    crc : str
        The 8 digits printed in the record.
    """

    airport: str
    runway: str
    operation_type: int
    route: str
    sbas_provider: int
    rpds: int
    rpi: str
    apd: int
    ltp_lat_rad: float
    ltp_lon_rad: float
    ltp_height_m: float
    gpa_rad: float
    fpap_lat_rad: float
    fpap_lon_rad: float
    course_width_m: float
    delta_length_offset_m: float
    tch_m: float
    hal_m: float
    val_m: float
    crc: str


def is_path_point(line: str) -> bool:
    """Whether a line of an ARINC 424 file is a path point record, and not the continuation of one."""
    return (
        len(line) > _CONTINUATION
        and line[0] in "ST"
        and all(line[place] == letter for place, letter in (_SECTION, _SUBSECTION))
        and line[_CONTINUATION] in "01"
    )


def path_point(line: str) -> PathPoint:
    """Read a path point record; its CRC is not checked here.

    Raises
    ------
    ValueError
        Naming the columns (counted from 1, as in the standard), what stands there, and what is expected.
    """
    if not is_path_point(line):
        raise ValueError(f"{line[:30]!r} is no path point record: S or T, then P in columns 5 and 13, 0 or 1 in 27")
    if len(line) < RECORD_LENGTH:
        raise ValueError(
            f"the record ends after {len(line)} characters; a path point has its CRC up to {RECORD_LENGTH}"
        )
    text = {}
    for name, (begin, end, pattern, expected) in _COLUMNS.items():
        text[name] = line[begin:end]
        if not re.fullmatch(pattern, text[name], re.ASCII):
            raise ValueError(f"columns {begin + 1} to {end} ({name}) are {text[name]!r}, expected {expected}")
        if name in _STEPS and int(text[name].lstrip("NSEW")) % _STEPS[name]:
            raise ValueError(
                f"columns {begin + 1} to {end} ({name}) are {text[name]!r}, expected a multiple of {_STEPS[name]} "
                "in the last digits: a FAS data block has no finer steps"
            )
    return PathPoint(
        airport=text["airport"].rstrip(),
        runway=text["runway"].removeprefix("RW").rstrip(),
        operation_type=int(text["operation"]),
        route=text["route"].strip(),
        sbas_provider=int(text["sbas_provider"]),
        rpds=int(text["rpds"]),
        rpi=text["rpi"].rstrip(),
        apd=int(text["apd"]),
        ltp_lat_rad=_angle_rad("ltp_latitude", text),
        ltp_lon_rad=_angle_rad("ltp_longitude", text),
        ltp_height_m=int(text["ltp_height"]) / 10.0,
        gpa_rad=radians(int(text["gpa"]) / 100.0),
        fpap_lat_rad=_angle_rad("fpap_latitude", text),
        fpap_lon_rad=_angle_rad("fpap_longitude", text),
        course_width_m=int(text["course_width"]) / 100.0,
        delta_length_offset_m=float(text["delta_length_offset"]),
        tch_m=int(text["tch"]) / 10.0 * _FEET_M,
        hal_m=int(text["hal"]) / 10.0,
        val_m=int(text["val"]) / 10.0,
        crc=text["crc"],
    )


def _angle_rad(name: str, text: dict[str, str]) -> float:
    """Hemisphere, degrees, minutes, seconds to 0.0001 as an angle [rad]."""
    value = text[name]
    limit, degrees_end = (90, 3) if value[0] in "NS" else (180, 4)
    degrees, minutes = int(value[1:degrees_end]), int(value[degrees_end : degrees_end + 2])
    seconds = int(value[degrees_end + 2 :]) / 10_000.0
    angle = degrees + minutes / 60.0 + seconds / 3600.0
    if minutes >= 60 or seconds >= 60.0 or angle > limit:
        begin, end, _, expected = _COLUMNS[name]
        raise ValueError(f"columns {begin + 1} to {end} ({name}) are {value!r}, expected {expected}, up to {limit}")
    return radians(-angle if value[0] in "SW" else angle)


def approach_values(record: str) -> dict[str, float | int | str]:
    """Arguments of :class:`gbas_core.positioning.approach.FinalApproach` of a record; HAL and VAL are its alert limits.

    Raises
    ------
    ValueError
        As :func:`path_point`.
    """
    point = path_point(record)
    return {
        "ltp_lat_rad": point.ltp_lat_rad,
        "ltp_lon_rad": point.ltp_lon_rad,
        "ltp_height_m": point.ltp_height_m,
        "delta_fpap_lat_rad": point.fpap_lat_rad - point.ltp_lat_rad,
        "delta_fpap_lon_rad": remainder(point.fpap_lon_rad - point.ltp_lon_rad, tau),
        "tch_m": point.tch_m,
        "gpa_rad": point.gpa_rad,
        "course_width_m": point.course_width_m,
        "delta_length_offset_m": point.delta_length_offset_m,
        "fasval_m": point.val_m,
        "faslal_m": point.hal_m,
        "apd": point.apd,
        "airport_id": point.airport,
        "runway": point.runway,
        "route": point.route,
        "rpi": point.rpi,
        "rpds": point.rpds,
    }
