"""What type 11 messages add to type 1 ones: the 30 s corrections of GAST-D, and sigmas without inflation.

A type 11 message has neither issues of data nor B values: those of the type 1 message of the same instant hold.

Source: ICAO Annex 10 vol. I, App. B 3.6.4.11 (known); RTCA DO-253D (B values of GAST-D).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gbas_airborne.reception.columns import LISTED, PRC, RRC, SIGMA
from gbas_airborne.reception.station_data import Corrections
from gbas_core.gnss.gpstime import resolve_modified_z_count
from gbas_core.record import FloatArray
from gbas_core.satellites import SOURCE_ID_INDEX, missing
from gbas_msgs_py.modes import WITHOUT_INFLATION
from gbas_vdb.messages.types import Type11

OF_TYPE1 = "l1_100"
OF_TYPE11 = "l1_30"


def joined(
    corrections: Mapping[str, Corrections], messages: tuple[Type11, ...], frame: tuple[int, float] | None
) -> Mapping[str, Corrections]:
    """Corrections with the sets that the type 11 messages of a frame make of the type 1 ones of the same instant.

    Half of a linked pair, and messages of another instant, add nothing: what was there before stays.
    """
    of_type1 = corrections.get(OF_TYPE1)
    if of_type1 is None or frame is None or not _complete(messages):
        return corrections
    try:
        instant = resolve_modified_z_count(messages[0].modified_z_count_s, *frame)
    except ValueError:
        return corrections
    known = corrections.get(OF_TYPE11)
    is_new = known is None or (known.gps_week, known.tow_s, known.received) != (*instant, frame)
    if instant != (of_type1.gps_week, of_type1.tow_s) or not is_new:
        return corrections
    of_type11, without_inflation = of_type1.columns.copy(), of_type1.columns.copy()
    of_type11[[PRC, RRC, SIGMA]], without_inflation[SIGMA] = np.nan, np.nan
    of_type11[LISTED], without_inflation[LISTED] = np.nan, np.nan
    for measurement in (each for message in messages for each in message.measurements):
        index = SOURCE_ID_INDEX.get(measurement.ranging_source_id)
        if index is not None and np.isfinite(of_type1.columns[LISTED, index]):
            twice = np.isfinite(of_type11[LISTED, index])  # contradicts itself
            of_type11[LISTED, index] = without_inflation[LISTED, index] = 1.0
            of_type11[PRC, index], of_type11[RRC, index] = measurement.prc_30_m, measurement.rrc_30_mps
            of_type11[SIGMA, index] = np.nan if twice else measurement.sigma_pr_gnd_30_m
            without_inflation[SIGMA, index] = np.nan if twice else measurement.sigma_pr_gnd_d_m
    return {
        **corrections,
        OF_TYPE11: replace(of_type1, received=frame, columns=of_type11),
        OF_TYPE1 + WITHOUT_INFLATION: replace(of_type1, received=frame, columns=without_inflation),
    }


def _complete(messages: tuple[Type11, ...]) -> bool:
    """Whether they are one message, or both of a linked pair."""
    return sorted(message.additional_message_flag for message in messages) in ([0], [1, 3])


def with_decorrelation(p_d: FloatArray | None, message: Type11) -> FloatArray | None:
    """P_D by satellite, with that of a message's first satellite; None before the first."""
    index = SOURCE_ID_INDEX.get(message.measurements[0].ranging_source_id) if message.measurements else None
    if index is None:
        return p_d
    found = missing() if p_d is None else p_d.copy()
    found[index] = message.ephemeris_decorrelation_d
    return found


def without_decorrelation(p_d: FloatArray | None, index: int) -> FloatArray | None:
    """P_D without that of a satellite with another issue of data: what was said was of another orbit."""
    if p_d is None or np.isnan(p_d[index]):
        return p_d
    left = p_d.copy()
    left[index] = np.nan
    return left
