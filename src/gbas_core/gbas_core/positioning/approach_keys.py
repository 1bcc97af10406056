"""A final approach as it stands in a configuration file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, Final

from gbas_core.parameters import Parameter, ParameterError, file_key, from_mapping, parameters
from gbas_core.positioning.approach import POINT_IN_SPACE_COURSE_WIDTH_M, FinalApproach
from gbas_core.positioning.arinc424 import approach_values

RECORD_KEY: Final = "arinc424"
"""Key of a path point record, in place of the fields of an approach."""
_BY_COURSE: Final = ("course_rad", "fpap_distance_m")
_BY_FPAP: Final = ("delta_fpap_latitude_rad", "delta_fpap_longitude_rad")
_BESIDE_RECORD: Final = ("apd", "rpds", "rpi", "fasval_m", "faslal_m")
_REQUIRED: Final = ("ltp_latitude_rad", "ltp_longitude_rad", "ltp_height_m", "tch_m", "gpa_rad", "fasval_m", "faslal_m")
_OTHER_NAMES: Final = {
    "ltp_latitude_rad": "ltp_lat_rad",
    "ltp_longitude_rad": "ltp_lon_rad",
    "delta_fpap_latitude_rad": "delta_fpap_lat_rad",
    "delta_fpap_longitude_rad": "delta_fpap_lon_rad",
}


@parameters
class ApproachSection:
    """A final approach segment; the course by its bearing and length, by the FPAP, or all by a path point record."""

    arinc424: Annotated[str | None, Parameter("path point record of ARINC 424, in place of the fields")] = None
    ltp_latitude_rad: Annotated[float | None, Parameter("landing threshold point", "deg", -90.0, 90.0)] = None
    ltp_longitude_rad: Annotated[float | None, Parameter("landing threshold point", "deg", -180.0, 180.0)] = None
    ltp_height_m: Annotated[
        float | None, Parameter("landing threshold point above the ellipsoid", "m", -512.0, 6041.5)
    ] = None
    course_rad: Annotated[float | None, Parameter("true course at the threshold", "deg", -360.0, 360.0)] = None
    fpap_distance_m: Annotated[float | None, Parameter("from the threshold to the FPAP", "m", 1.0, 2e4)] = None
    delta_fpap_latitude_rad: Annotated[float | None, Parameter("of the FPAP from the LTP", "deg", -90.0, 90.0)] = None
    delta_fpap_longitude_rad: Annotated[float | None, Parameter("of the FPAP from the LTP", "deg", -180.0, 180.0)] = (
        None
    )
    tch_m: Annotated[float | None, Parameter("threshold crossing height", "m", 0.0, 1638.35)] = None
    gpa_rad: Annotated[float | None, Parameter("glide path angle", "deg", 0.01, 89.99)] = None
    course_width_m: Annotated[
        float | None, Parameter("half width of the course at the threshold", "m", POINT_IN_SPACE_COURSE_WIDTH_M, 143.75)
    ] = None
    delta_length_offset_m: Annotated[
        float | None, Parameter("from the stop end of the runway to the FPAP; left out: not given", "m", 0.0, 2032.0)
    ] = None
    fasval_m: Annotated[float | None, Parameter("vertical alert limit at the decision point", "m", 0.0, 50.8)] = None
    faslal_m: Annotated[float | None, Parameter("lateral alert limit at the decision point", "m", 0.0, 50.8)] = None
    apd: Annotated[int | None, Parameter("approach performance designator: 1 is type C", "-", 0, 7)] = None
    rpds: Annotated[int | None, Parameter("reference path data selector", "-", 0, 48)] = None
    airport_id: Annotated[str | None, Parameter("airport")] = None
    runway: Annotated[str | None, Parameter("runway, such as '26' or '15R'")] = None
    route: Annotated[str | None, Parameter("route letter")] = None
    rpi: Annotated[str | None, Parameter("reference path identifier, 4 characters")] = None

    def __post_init__(self) -> None:
        self.approach()  # what is none is refused here

    def approach(self) -> FinalApproach:
        """The approach.

        Raises
        ------
        ValueError
            Naming a key that is missing or given beside another, what is out of bounds, or columns of a record.
        """
        given = {item.name: getattr(self, item.name) for item in dataclasses.fields(self)}
        given = {name: value for name, value in given.items() if value is not None}
        record = given.pop(RECORD_KEY, None)
        if record is not None:
            if fixed := sorted(set(given) - set(_BESIDE_RECORD)):
                may = ", ".join(_BESIDE_RECORD)
                raise ParameterError(f"{file_key(fixed[0])} is given beside {RECORD_KEY}, where only {may} may be")
            values: dict[str, Any] = approach_values(record)
            return FinalApproach(**(values | given))
        by_course, by_fpap = ([name in given for name in names] for names in (_BY_COURSE, _BY_FPAP))
        if not (all(by_course) and not any(by_fpap)) and not (all(by_fpap) and not any(by_course)):
            ways = [" and ".join(sorted(map(file_key, names))) for names in (_BY_COURSE, _BY_FPAP)]
            raise ParameterError(f"the course needs {ways[0]}, or {ways[1]}")
        if missing := [name for name in _REQUIRED if name not in given]:
            raise ParameterError(f"{file_key(missing[0])} is missing")
        arguments: dict[str, Any] = {_OTHER_NAMES.get(name, name): value for name, value in given.items()}
        return FinalApproach.from_course(**arguments) if all(by_course) else FinalApproach(**arguments)


def approach_from_mapping(mapping: Mapping[str, Any]) -> FinalApproach:
    """Final approach from the keys of a configuration file (:class:`ApproachSection`).

    The CRC of a path point record is checked by who broadcasts it (:mod:`gbas_vdb.messages.path_point`).

    Raises
    ------
    ParameterError
        Naming a key that is unknown, missing or out of bounds, or columns of a record.
    """
    return from_mapping(ApproachSection, mapping).approach()
