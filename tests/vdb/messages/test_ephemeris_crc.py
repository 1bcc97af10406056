"""The ephemeris CRC: bits placed as in the signal, masked and divided; recorded ephemerides."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_core.gnss.ephemeris import FIELDS, Ephemeris, NavigationMessage
from gbas_core.io.rinex import read_navigation
from gbas_core.satellites import N_SATS, SAT_INDEX, missing
from gbas_vdb.coding.crc import crc16
from gbas_vdb.messages.ephemeris_crc import (
    GALILEO_INAV_FIELDS,
    GPS_FIELDS,
    ephemeris_crcs,
    gps_masked_bytes,
)
from vdb_oracle import CRC16, GPS_PLACES, crc_remainder_bits, gps_crc_bits, gps_subframes

SEMICIRCLE = 3.1415926535898

# IS-GPS-200N tables 20-I to 20-III: bits, signed, scale factor (exponent of two), semicircles.
SCALES = {
    "iodc": (10, False, 0, False),
    "group_delay_s": (8, True, -31, False),
    "toc_tow_s": (16, False, 4, False),
    "af2_sps2": (8, True, -55, False),
    "af1_sps": (16, True, -43, False),
    "af0_s": (22, True, -31, False),
    "crs_m": (16, True, -5, False),
    "delta_n_radps": (16, True, -43, True),
    "m0_rad": (32, True, -31, True),
    "cuc_rad": (16, True, -29, False),
    "e": (32, False, -33, False),
    "cus_rad": (16, True, -29, False),
    "sqrt_a": (32, False, -19, False),
    "toe_tow_s": (16, False, 4, False),
    "cic_rad": (16, True, -29, False),
    "omega0_rad": (32, True, -31, True),
    "cis_rad": (16, True, -29, False),
    "i0_rad": (32, True, -31, True),
    "crc_m": (16, True, -5, False),
    "omega_rad": (32, True, -31, True),
    "omega_dot_radps": (24, True, -43, True),
    "idot_radps": (14, True, -43, True),
}


def value_of(name: str, raw: int) -> float:
    _, _, exponent, semicircles = SCALES[name]
    return raw * 2.0**exponent * (SEMICIRCLE if semicircles else 1.0)


def ephemeris_of(satellite: str, raw: dict[str, int], iode: int) -> Ephemeris:
    """One GPS satellite's ephemeris, its values with the twelve digits of a RINEX file."""
    values: dict[str, Any] = {"message": float(NavigationMessage.GPS_LNAV), "iod": float(iode)}
    values |= {name: float(f"{value_of(name, count):.12e}") for name, count in raw.items()}
    arrays = {}
    for name, value in values.items():
        arrays[name] = missing()
        arrays[name][SAT_INDEX[satellite]] = value
    return Ephemeris(gps_week=2300, tow_s=0.0, **arrays)


def raw_counts() -> st.SearchStrategy[dict[str, int]]:
    def bounds(bits: int, signed: bool) -> tuple[int, int]:
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)

    return st.fixed_dictionaries(
        {name: st.integers(*bounds(bits, signed)) for name, (bits, signed, _, _) in SCALES.items()}
    )


def test_every_field_of_the_signal_has_its_place() -> None:
    assert set(SCALES) == set(GPS_PLACES)
    assert {item.name for item in GPS_FIELDS} == {*SCALES, "iod"}
    for item in GPS_FIELDS:
        bits, signed, exponent, semicircles = SCALES.get(item.name, (8, False, 0, False))
        assert (item.bits, item.signed) == (bits, signed)
        assert item.lsb == pytest.approx(2.0**exponent * (math.pi if semicircles else 1.0), rel=1e-15)


@given(raw=raw_counts(), iode=st.integers(0, 255))
@settings(max_examples=60, deadline=None)
def test_crc_is_the_remainder_of_the_masked_signal(raw: dict[str, int], iode: int) -> None:
    # Everything outside the mask is set to ones: it must not matter.
    message = gps_crc_bits(gps_subframes(raw, iode, noise="1"))
    assert len(message) == 576
    ephemeris = ephemeris_of("G07", raw, iode)
    masked = gps_masked_bytes(ephemeris, SAT_INDEX["G07"])
    assert "".join(f"{byte:08b}"[::-1] for byte in masked) == message
    # r1, the highest power, is sent first: it is the lowest bit of the field.
    expected = int(crc_remainder_bits(message, CRC16)[::-1], 2)
    crcs = ephemeris_crcs(ephemeris)
    assert crcs[SAT_INDEX["G07"]] == expected
    assert np.isnan(np.delete(crcs, SAT_INDEX["G07"])).all()


SAMPLE = {name: 5 + index for index, name in enumerate(SCALES)}


@pytest.mark.parametrize("name", SCALES)
def test_one_count_of_any_field_changes_the_crc(name: str) -> None:
    index = SAT_INDEX["G01"]
    before = ephemeris_crcs(ephemeris_of("G01", SAMPLE, 3))[index]
    after = ephemeris_crcs(ephemeris_of("G01", {**SAMPLE, name: SAMPLE[name] + 1}, 3))[index]
    assert before != after


@pytest.mark.parametrize("field", [*SCALES, "iod"])
def test_without_a_field_there_is_no_crc(field: str) -> None:
    ephemeris = replace(ephemeris_of("G01", SAMPLE, 3), **{field: missing()})
    assert np.isnan(ephemeris_crcs(ephemeris)).all()


@pytest.mark.parametrize(
    ("field", "value"), [("e", -1e-9), ("e", 0.6), ("af0_s", 1e-3), ("iod", 256.0), ("crs_m", 1024.0)]
)
def test_a_value_that_does_not_fit_its_bits_has_no_crc(field: str, value: float) -> None:
    ephemeris = ephemeris_of("G01", SAMPLE, 3)
    changed = getattr(ephemeris, field).copy()
    changed[SAT_INDEX["G01"]] = value
    assert np.isnan(ephemeris_crcs(replace(ephemeris, **{field: changed}))).all()


def galileo(message: NavigationMessage) -> Ephemeris:
    arrays = {}
    for number, item in enumerate(GALILEO_INAV_FIELDS):
        arrays[item.name] = missing()
        arrays[item.name][SAT_INDEX["E11"]] = (3 + number) * item.lsb
    arrays["message"][SAT_INDEX["E11"]] = float(message)
    if message == NavigationMessage.GALILEO_FNAV:
        arrays["group_delay_e5b_s"] = missing()
    return Ephemeris(gps_week=2300, tow_s=0.0, **arrays)


def test_galileo_crc_is_that_of_its_fields_in_order() -> None:
    # The suite's own definition: fields most significant bit first, completed with zeros to bytes.
    bits = ""
    for number, item in enumerate(GALILEO_INAV_FIELDS):
        value = 1 if item.name == "message" else 3 + number
        bits += f"{value:0{item.bits}b}"
    bits += "0" * (-len(bits) % 8)
    data = bytes(int(bits[start : start + 8], 2) for start in range(0, len(bits), 8))
    assert ephemeris_crcs(galileo(NavigationMessage.GALILEO_INAV))[SAT_INDEX["E11"]] == crc16(data)


def test_galileo_messages_are_told_apart() -> None:
    index = SAT_INDEX["E11"]
    inav = ephemeris_crcs(galileo(NavigationMessage.GALILEO_INAV))[index]
    fnav = ephemeris_crcs(galileo(NavigationMessage.GALILEO_FNAV))[index]
    assert np.isfinite(inav)
    assert np.isfinite(fnav)
    assert inav != fnav


def test_no_ephemeris_no_crc() -> None:
    crcs = ephemeris_crcs(Ephemeris(gps_week=2300, tow_s=0.0))
    assert crcs.shape == (N_SATS,)
    assert np.isnan(crcs).all()


# ---- recorded ephemerides: every value is a multiple of its scale factor ----


@pytest.mark.parametrize(
    "path", ["static_pair_L1L2_1h_2010/brdc0770.10n.gz", "nav_rinex4_2026/BRD400DLR_S_20260680000_01D_MN.rnx.gz"]
)
def test_recorded_values_are_multiples_of_the_scale_factors(data_dir: Path, path: str) -> None:
    # Twelve digits of a value of up to 32 bits leave less than a hundredth of a count: no bit is lost.
    navigation = read_navigation([data_dir / path])
    for message, fields in (
        (NavigationMessage.GPS_LNAV, GPS_FIELDS),
        (NavigationMessage.GALILEO_INAV, GALILEO_INAV_FIELDS),
    ):
        records = navigation.values[navigation.values[:, FIELDS.index("message")] == message]
        for item in fields:
            counts = records[:, FIELDS.index(item.name)] / item.lsb
            assert np.abs(counts - np.rint(counts)).max(initial=0.0) < 0.01, item.name
    assert len(navigation.values) > 300


def test_every_recorded_ephemeris_has_a_crc(data_dir: Path) -> None:
    navigation = read_navigation([data_dir / "nav_rinex4_2026/BRD400DLR_S_20260680000_01D_MN.rnx.gz"])
    received = navigation.received(*navigation.first)
    seen: dict[tuple[int, float, float], float] = {}
    for ephemeris in received:
        crcs = ephemeris_crcs(ephemeris)
        there = np.isfinite(ephemeris.toe_tow_s)
        assert np.array_equal(np.isfinite(crcs), there)
        for index in np.flatnonzero(there):
            seen[(int(index), ephemeris.iod[index], ephemeris.toe_tow_s[index])] = crcs[index]
    # Different ephemerides have different CRCs, but for one chance in 65536 each.
    assert len(set(seen.values())) > 0.95 * len(seen)
