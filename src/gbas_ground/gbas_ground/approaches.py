"""Approaches a station broadcasts: from a final approach to the FAS data block."""

from __future__ import annotations

import re

from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.approach_keys import approach_from_mapping
from gbas_vdb.messages.types import FasBlock, FasDataSet

__all__ = ["approach_from_mapping", "fas_data_set"]


def fas_data_set(approach: FinalApproach) -> FasDataSet:
    """FAS data block with its alert limits, as the type 4 message carries it.

    Raises
    ------
    ValueError
        For a runway that is not a number 1 to 36 with or without L, C, R (or empty for none).
    """
    match = re.fullmatch(r"(\d{1,2})([LCR]?)", approach.runway)
    number = int(match.group(1)) if match else 0
    if approach.runway and not 1 <= number <= 36:
        raise ValueError(f"runway = {approach.runway!r} is not 1 to 36 with or without L, C, R")
    block = FasBlock(
        airport_id=approach.airport_id,
        runway_number=number,
        runway_letter=match.group(2) if match else "",
        approach_performance_designator=approach.apd,
        route_indicator=approach.route,
        reference_path_data_selector=approach.rpds,
        reference_path_identifier=approach.rpi,
        ltp_latitude_rad=approach.ltp_lat_rad,
        ltp_longitude_rad=approach.ltp_lon_rad,
        ltp_height_m=approach.ltp_height_m,
        delta_fpap_latitude_rad=approach.delta_fpap_lat_rad,
        delta_fpap_longitude_rad=approach.delta_fpap_lon_rad,
        tch_m=approach.tch_m,
        gpa_rad=approach.gpa_rad,
        course_width_m=approach.course_width_m,
        delta_length_offset_m=approach.delta_length_offset_m,
    )
    return FasDataSet(fas=block, fasval_m=approach.fasval_m, faslal_m=approach.faslal_m)
