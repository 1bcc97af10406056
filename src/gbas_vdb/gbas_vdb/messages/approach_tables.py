"""Field tables of an approach: the FAS data block of message type 4 and the alert limits sent with it.

Source: as :mod:`gbas_vdb.messages.tables`.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Final

from gbas_vdb.messages.fields import Choice, Letter, Number, Spare, Switch, Text
from gbas_vdb.messages.layout import Layout, Part
from gbas_vdb.messages.tables import ANGLE, COUNTS_PER_DEGREE, latitude, longitude
from gbas_vdb.messages.types import FasBlock, FasDataSet


def _fpap_offset(name: str) -> Number:
    return Number(
        name=name,
        bits=24,
        signed=True,
        minimum=-COUNTS_PER_DEGREE,
        maximum=COUNTS_PER_DEGREE,
        scale=ANGLE,
        unit="rad",
        doc="FPAP less LTP",
    )


FAS_BLOCK: Final = Layout(
    record=FasBlock,
    entries=(
        Number(name="operation_type", bits=4, doc="0 is straight-in"),
        Number(name="sbas_provider", bits=4, doc="14 GBAS only, 15 any"),
        Text(name="airport_id", characters=4, bits_per_character=8),
        Number(name="runway_number", bits=6, maximum=36, doc="0: point in space"),
        Choice(name="runway_letter", bits=2, values=("", "R", "C", "L")),
        Number(name="approach_performance_designator", bits=3, doc="0 GAST-A/B, 1 GAST-C, 2 GAST-C and D"),
        Letter(name="route_indicator", unused="IO"),
        Number(name="reference_path_data_selector", bits=8, maximum=48),
        Text(name="reference_path_identifier", characters=4, bits_per_character=8),
        latitude("ltp_latitude_rad"),
        longitude("ltp_longitude_rad"),
        Number(name="ltp_height_m", bits=16, scale=Fraction(1, 10), offset=-512, unit="m", doc="above the ellipsoid"),
        _fpap_offset("delta_fpap_latitude_rad"),
        _fpap_offset("delta_fpap_longitude_rad"),
        Switch(
            on="tch_in_feet",
            cases={True: Number(name="tch_m", bits=15, scale=Fraction(3048, 100_000), unit="m")},
            default=Number(name="tch_m", bits=15, scale=Fraction(1, 20), unit="m", doc="threshold crossing height"),
        ),
        Choice(name="tch_in_feet", bits=1, values=(True, False)),
        Number(name="gpa_rad", bits=16, scale=math.radians(0.01), maximum=9000, unit="rad", doc="glide path angle"),
        Number(
            name="course_width_m", bits=8, scale=Fraction(1, 4), offset=80, unit="m", doc="semi-width at the threshold"
        ),
        Number(
            name="delta_length_offset_m",
            bits=8,
            scale=Fraction(8),
            maximum=0xFE,
            codes={0xFF: math.nan},
            unit="m",
            doc="stop end of the runway to FPAP",
        ),
    ),
)


def _vertical_limit(counts_per_metre: int) -> Number:
    return Number(
        name="fasval_m",
        bits=8,
        scale=Fraction(1, counts_per_metre),
        maximum=0xFE,
        codes={0xFF: math.nan},
        rounding="down",
        unit="m",
        doc="vertical alert limit; missing: no vertical guidance",
    )


# Follows the FAS block and its CRC.
FAS_LIMITS: Final = (
    Switch(on="fas.approach_performance_designator", cases={0: _vertical_limit(5)}, default=_vertical_limit(10)),
    Number(
        name="faslal_m",
        bits=8,
        scale=Fraction(1, 5),
        maximum=0xFE,
        codes={0xFF: math.nan},
        rounding="down",
        unit="m",
        doc="lateral alert limit; missing: do not use",
    ),
)
FAS_DATA_SET: Final = Layout(
    record=FasDataSet, entries=(Part(name="fas", layout=FAS_BLOCK), Spare(bits=32), *FAS_LIMITS)
)
FAS_BLOCK_BYTES: Final = 34
FAS_DATA_SET_BYTES: Final = 41
