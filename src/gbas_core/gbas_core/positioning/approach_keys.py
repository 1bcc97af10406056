"""A final approach from the keys of a configuration file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.arinc424 import approach_values

_ANGLES: Final = {
    "ltp_latitude_deg": "ltp_lat_rad",
    "ltp_longitude_deg": "ltp_lon_rad",
    "delta_fpap_latitude_deg": "delta_fpap_lat_rad",
    "delta_fpap_longitude_deg": "delta_fpap_lon_rad",
    "course_deg": "course_rad",
    "gpa_deg": "gpa_rad",
}
_LENGTHS: Final = (
    "ltp_height_m", "fpap_distance_m", "tch_m", "course_width_m", "delta_length_offset_m", "fasval_m", "faslal_m",
)  # fmt: skip
_TEXTS: Final = ("airport_id", "runway", "route", "rpi")
_NUMBERS: Final = ("apd", "rpds")
_BY_COURSE: Final = {"course_deg", "fpap_distance_m"}
_BY_FPAP: Final = {"delta_fpap_latitude_deg", "delta_fpap_longitude_deg"}
RECORD_KEY: Final = "arinc424"
"""Key of a path point record, in place of the fields of an approach."""
_BESIDE_RECORD: Final = ("apd", "rpds", "rpi", "fasval_m", "faslal_m")
_REQUIRED: Final = ("ltp_latitude_deg", "ltp_longitude_deg", "ltp_height_m", "tch_m", "gpa_deg", "fasval_m", "faslal_m")


def approach_from_mapping(mapping: Mapping[str, Any]) -> FinalApproach:
    """Final approach from the keys of a configuration file.

    Parameters
    ----------
    mapping : mapping
        ``ltp_latitude_deg``, ``ltp_longitude_deg``, ``ltp_height_m``; the course as ``course_deg`` (true) with
        ``fpap_distance_m``, or as ``delta_fpap_latitude_deg`` with ``delta_fpap_longitude_deg``; ``tch_m``,
        ``gpa_deg``, ``fasval_m``, ``faslal_m``; and, when wanted, ``course_width_m``, ``delta_length_offset_m``,
        ``apd``, ``airport_id``, ``runway`` (``"26"``, ``"15R"``), ``route``, ``rpi``, ``rpds``.

        Or ``arinc424``: a path point record, of which ``apd``, ``rpds``, ``rpi``, ``fasval_m`` and ``faslal_m`` may be
        given otherwise (a record of an SBAS approach has no data selector, and no designator of type C). Its CRC is
        checked by who broadcasts it (:mod:`gbas_vdb.messages.path_point`).

    Raises
    ------
    ValueError
        Naming a key that is unknown, missing or out of bounds, or columns of a record.
    """
    if RECORD_KEY in mapping:
        return _of_record(mapping)
    known = {*_ANGLES, *_LENGTHS, *_TEXTS, *_NUMBERS, RECORD_KEY}
    if unknown := sorted(set(mapping) - known):
        raise ValueError(f"unknown key {unknown[0]!r}; known are {', '.join(sorted(known))}")
    ways = (_BY_COURSE & set(mapping), _BY_FPAP & set(mapping))
    if ways not in ((_BY_COURSE, set()), (set(), _BY_FPAP)):
        raise ValueError(f"the course needs {' and '.join(sorted(_BY_COURSE))}, or {' and '.join(sorted(_BY_FPAP))}")
    if missing := [key for key in _REQUIRED if key not in mapping]:
        raise ValueError(f"{missing[0]} is missing")
    arguments: dict[str, Any] = {
        name: math.radians(_number(mapping, key)) for key, name in _ANGLES.items() if key in mapping
    }
    arguments |= {key: _number(mapping, key) for key in _LENGTHS if key in mapping}
    arguments |= {key: _text(mapping, key) for key in _TEXTS if key in mapping}
    arguments |= {key: _whole(mapping, key) for key in _NUMBERS if key in mapping}
    return FinalApproach.from_course(**arguments) if ways[0] else FinalApproach(**arguments)


def _of_record(mapping: Mapping[str, Any]) -> FinalApproach:
    if fixed := sorted(set(mapping) - {RECORD_KEY} - set(_BESIDE_RECORD)):
        raise ValueError(f"{fixed[0]} is given beside {RECORD_KEY}, where only {', '.join(_BESIDE_RECORD)} may be")
    values: dict[str, Any] = approach_values(_text(mapping, RECORD_KEY))
    for key in set(mapping) - {RECORD_KEY}:
        read = _text if key in _TEXTS else _whole if key in _NUMBERS else _number
        values[key] = read(mapping, key)
    return FinalApproach(**values)


def _number(mapping: Mapping[str, Any], key: str) -> float:
    value = mapping[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{key} = {value!r} is not a number")
    return float(value)


def _whole(mapping: Mapping[str, Any], key: str) -> int:
    value = mapping[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{key} = {value!r} is not a whole number")
    return value


def _text(mapping: Mapping[str, Any], key: str) -> str:
    value = mapping[key]
    if not isinstance(value, str):
        raise ValueError(f"{key} = {value!r} is not a text (quote it)")
    return value
