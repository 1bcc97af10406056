"""The field tables of the VDB messages, in the order of transmission: this module is data. Those of an approach
are in :mod:`gbas_vdb.messages.approach_tables`.

Source: Annex 10 Volume I, Appendix B, tables B-62 to B-77 and RTCA DO-246E. Entries marked (uncertain) are
reconstructed; see docs/conventions.md.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Final

from gbas_vdb.messages.fields import Choice, Count, Number, Spare, Text, Vector
from gbas_vdb.messages.layout import Group, Layout
from gbas_vdb.messages.types import (
    PRIVATE_FORMAT,
    AdditionalBlock1,
    AdditionalBlock3,
    AdditionalBlock4,
    Correction30,
    Correction100,
    ObstructedApproach,
    PredictedSource,
    Type1,
    Type2,
    Type5,
    Type8,
    Type11,
)

MAX_MEASUREMENTS: Final = 18

# Angles are sent in units of 0.0005 seconds of arc.
ANGLE: Final = math.radians(0.0005 / 3600.0)
COUNTS_PER_DEGREE: Final = 7_200_000

_Z_COUNT: Final = Number(
    name="modified_z_count_s",
    bits=14,
    scale=Fraction(1, 10),
    maximum=11_999,
    unit="s",
    doc="time of the corrections in the current 20 minutes of GPS time",
)
_MESSAGE_FLAG: Final = Number(name="additional_message_flag", bits=2, doc="0 single, 1 first, 3 second of a pair")
_MEASUREMENT_TYPE: Final = Number(name="measurement_type", bits=3, doc="0 is L1 C/A")
_N_MEASUREMENTS: Final = Count(of="measurements", bits=5, maximum=MAX_MEASUREMENTS)
_SOURCE_ID: Final = Number(
    name="ranging_source_id", bits=8, doc="GPS PRN; SBAS PRN; GLONASS slot + 37; Galileo SVID + 70 (private)"
)


def _sigma(name: str, doc: str) -> Number:
    return Number(
        name=name, bits=8, scale=Fraction(1, 50), codes={0xFF: math.nan}, rounding="up", unit="m", doc=doc, maximum=0xFE
    )


def _correction(name: str, valid_if: str) -> Number:
    return Number(
        name=name,
        bits=16,
        signed=True,
        minimum=-32_767,
        scale=Fraction(1, 100),
        unit="m",
        doc="pseudorange correction, added by the user",
        valid_if=valid_if,
    )


def _correction_rate(name: str, valid_if: str) -> Number:
    return Number(
        name=name,
        bits=16,
        signed=True,
        minimum=-32_767,
        scale=Fraction(1, 1000),
        unit="m/s",
        doc="rate of the correction",
        valid_if=valid_if,
    )


def _decorrelation(name: str) -> Number:
    return Number(
        name=name,
        bits=8,
        scale=Fraction(1, 200_000),
        rounding="up",
        unit="m/m",
        doc="ephemeris decorrelation of the first source",
        valid_if="measurements",
    )


CORRECTION_100: Final = Layout(
    record=Correction100,
    entries=(
        _SOURCE_ID,
        Number(name="iod", bits=8, doc="issue of data of the ephemeris used"),
        _correction("prc_m", "sigma_pr_gnd_m"),
        _correction_rate("rrc_mps", "sigma_pr_gnd_m"),
        _sigma("sigma_pr_gnd_m", "ground error of the correction; missing: invalid"),
        Vector(
            name="b_values_m",
            length=4,
            item=Number(
                name="b_values_m",
                bits=8,
                signed=True,
                minimum=-127,
                scale=Fraction(1, 20),
                codes={-128: math.nan},
                unit="m",
                doc="B value of each reference receiver; missing: not used",
            ),
        ),
    ),
)

TYPE_1: Final = Layout(
    record=Type1,
    entries=(
        _Z_COUNT,
        _MESSAGE_FLAG,
        _N_MEASUREMENTS,
        _MEASUREMENT_TYPE,
        _decorrelation("ephemeris_decorrelation"),
        Number(
            name="ephemeris_crc", bits=16, doc="of the first source, first bit sent lowest", valid_if="measurements"
        ),
        Number(
            name="source_availability_s",
            bits=8,
            scale=Fraction(10),
            maximum=0xFE,
            codes={0xFF: None},
            saturates=True,
            rounding="down",
            unit="s",
            doc="of the first source; 2540 is 2540 or more, missing: not provided",
        ),
        Group(name="measurements", layout=CORRECTION_100),
    ),
)

CORRECTION_30: Final = Layout(
    record=Correction30,
    entries=(
        _SOURCE_ID,
        _correction("prc_30_m", "sigma_pr_gnd_30_m"),
        _correction_rate("rrc_30_mps", "sigma_pr_gnd_30_m"),
        _sigma("sigma_pr_gnd_d_m", "ground error of the 100 s correction without ionospheric inflation"),
        _sigma("sigma_pr_gnd_30_m", "ground error of the 30 s correction; missing: invalid"),
    ),
)

TYPE_11: Final = Layout(
    record=Type11,
    entries=(
        _Z_COUNT,
        _MESSAGE_FLAG,
        _N_MEASUREMENTS,
        _MEASUREMENT_TYPE,
        _decorrelation("ephemeris_decorrelation_d"),
        Group(name="measurements", layout=CORRECTION_30),
    ),
)


# Ours: test messages (type 8), which no receiver but our own looks into; see docs/conventions.md.
TYPE_8: Final = Layout(
    record=Type8,
    entries=(
        Number(
            name="private_format",
            bits=16,
            minimum=PRIVATE_FORMAT,
            maximum=PRIVATE_FORMAT,
            doc="the bytes G5: this layout",
        ),
        _Z_COUNT,
        _MESSAGE_FLAG,
        _N_MEASUREMENTS,
        Number(name="measurement_type", bits=3, doc="0 is L5/E5a smoothed over 100 s, 1 over 30 s"),
        Group(name="measurements", layout=CORRECTION_100),
    ),
)
PRIVATE_TYPE: Final = 8
PRIVATE_BEGIN: Final = PRIVATE_FORMAT.to_bytes(2, "little")


def latitude(name: str) -> Number:
    return Number(
        name=name,
        bits=32,
        signed=True,
        scale=ANGLE,
        minimum=-90 * COUNTS_PER_DEGREE,
        maximum=90 * COUNTS_PER_DEGREE,
        unit="rad",
        doc="geodetic latitude, WGS-84",
    )


def longitude(name: str) -> Number:
    return Number(
        name=name,
        bits=32,
        signed=True,
        scale=ANGLE,
        minimum=-180 * COUNTS_PER_DEGREE,
        maximum=180 * COUNTS_PER_DEGREE,
        unit="rad",
        doc="longitude, WGS-84, east positive",
    )


def _gradient(name: str) -> Number:
    return Number(
        name=name,
        bits=8,
        scale=Fraction(1, 10_000_000),
        rounding="up",
        unit="m/m",
        doc="standard deviation of the vertical ionospheric gradient",
    )


TYPE_2: Final = Layout(
    record=Type2,
    entries=(
        Choice(name="n_reference_receivers", bits=2, values=(2, 3, 4, None), doc="reference receivers installed"),
        Choice(name="ground_accuracy_designator", bits=2, values=("A", "B", "C", None)),
        Spare(bits=1),
        Number(name="gcid", bits=3, doc="continuity and integrity designator: 1-4 healthy, 7 unhealthy"),
        Number(
            name="magnetic_variation_rad",
            bits=11,
            signed=True,
            scale=math.radians(0.25),
            minimum=-720,
            maximum=720,
            unit="rad",
            doc="east positive",
        ),
        Spare(bits=5),
        _gradient("sigma_vert_iono_gradient"),
        Number(name="refractivity_index", bits=8, signed=True, scale=Fraction(3), offset=400, doc="N_r"),
        Number(name="scale_height_m", bits=8, scale=Fraction(100), unit="m", doc="troposphere scale height"),
        Number(
            name="refractivity_uncertainty", bits=8, scale=Fraction(1), rounding="up", doc="standard deviation of N_r"
        ),
        latitude("latitude_rad"),
        longitude("longitude_rad"),
        Number(
            name="ellipsoid_height_m",
            bits=24,
            signed=True,
            minimum=-8_388_607,
            scale=Fraction(1, 100),
            unit="m",
            doc="height of the reference point above the ellipsoid",
        ),
    ),
)


def _multiplier(name: str) -> Number:
    return Number(name=name, bits=8, scale=Fraction(1, 20), rounding="up", doc="ephemeris missed detection multiplier")


ADDITIONAL_BLOCK_1: Final = Layout(
    record=AdditionalBlock1,
    entries=(
        Number(
            name="reference_station_data_selector", bits=8, maximum=48, codes={255: None}, doc="missing: no service"
        ),
        Number(
            name="d_max_m",
            bits=8,
            scale=Fraction(2000),
            minimum=1,
            codes={0: math.inf},
            rounding="down",
            unit="m",
            doc="maximum distance of use",
        ),
        _multiplier("k_md_e_pos_gps"),
        _multiplier("k_md_e_c_gps"),
        _multiplier("k_md_e_pos_glonass"),
        _multiplier("k_md_e_c_glonass"),
    ),
)

# (uncertain) Order and widths of Y_EIG and M_EIG, and whether they have a "not provided" code.
ADDITIONAL_BLOCK_3: Final = Layout(
    record=AdditionalBlock3,
    entries=(
        _multiplier("k_md_e_d_gps"),
        _multiplier("k_md_e_d_glonass"),
        _gradient("sigma_vert_iono_gradient_d"),
        Number(name="y_eig_m", bits=5, scale=Fraction(1, 10), maximum=30, rounding="up", unit="m"),
        Number(name="m_eig", bits=3, scale=Fraction(1, 10_000), rounding="up", unit="m/m"),
    ),
)

ADDITIONAL_BLOCK_4: Final = Layout(
    record=AdditionalBlock4,
    entries=(Number(name="slot_group", bits=8, minimum=1, doc="assigned slots, A lowest"),),
)

# Additional data blocks with a length and a number, and the record's attribute each goes to.
ADDITIONAL_BLOCKS: Final[dict[int, tuple[str, Layout]]] = {
    3: ("adb3", ADDITIONAL_BLOCK_3),
    4: ("adb4", ADDITIONAL_BLOCK_4),
}

PREDICTED_SOURCE: Final = Layout(
    record=PredictedSource,
    entries=(
        _SOURCE_ID,
        Choice(name="becomes_available", bits=1, values=(False, True)),
        Number(name="duration_s", bits=7, scale=Fraction(10), saturates=True, rounding="down", unit="s"),
    ),
)
OBSTRUCTED_APPROACH: Final = Layout(
    record=ObstructedApproach,
    entries=(
        Number(name="reference_path_data_selector", bits=8, maximum=48),
        Count(of="sources", bits=8, maximum=255),
        Group(name="sources", layout=PREDICTED_SOURCE),
    ),
)
TYPE_5: Final = Layout(
    record=Type5,
    entries=(
        _Z_COUNT,
        Spare(bits=2),
        Count(of="sources", bits=8, maximum=255),
        Group(name="sources", layout=PREDICTED_SOURCE),
        Count(of="approaches", bits=8, maximum=255),
        Group(name="approaches", layout=OBSTRUCTED_APPROACH),
    ),
)

# Messages that one table describes; types 2 and 4 have tails with lengths of their own.
WHOLE_MESSAGES: Final[dict[int, Layout]] = {1: TYPE_1, 5: TYPE_5, 8: TYPE_8, 11: TYPE_11}

# Messages with corrections, and the layout of one ranging source in each.
CORRECTION_ENTRIES: Final[dict[int, Layout]] = {1: CORRECTION_100, 11: CORRECTION_30}
# The same of corrections in messages of ours, by measurement type.
PRIVATE_ENTRIES: Final[dict[int, Layout]] = {0: CORRECTION_100, 1: CORRECTION_100}

# Of the header; the message block identifier and the length are in block.py.
STATION_ID: Final = Text(name="station_id", characters=4, bits_per_character=6, doc="GBAS identification")
MESSAGE_TYPE: Final = Number(name="message_type", bits=8)
