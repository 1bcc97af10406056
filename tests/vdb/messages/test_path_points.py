"""Published approaches with their published CRC: columns, units, packing and CRC of FAS blocks, all at once."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from gbas_core.positioning.approach_keys import approach_from_mapping
from gbas_core.positioning.arinc424 import is_path_point, path_point
from gbas_ground.approaches import fas_data_set
from gbas_ground.params import GroundParams
from gbas_vdb.coding.bits import BitReader, BitWriter
from gbas_vdb.messages import approach_tables, tables
from gbas_vdb.messages.fields import Choice, FieldError, Letter
from gbas_vdb.messages.layout import Layout, decode, encode
from gbas_vdb.messages.path_point import PathPointError, checked_path_point, trusted_path_point
from gbas_vdb.messages.types import FasBlock
from vdb_oracle import CRC32Q, crc_remainder_bits

PUBLISHED = yaml.safe_load((Path(__file__).parents[2] / "tables" / "path_points.yaml").read_text(encoding="utf-8"))
RECORD = PUBLISHED[1]["record"]


def angle_rad(degrees: int, minutes: int, seconds: float) -> float:
    return math.copysign(math.radians(abs(degrees) + minutes / 60.0 + seconds / 3600.0), degrees)


@pytest.mark.parametrize("published", PUBLISHED, ids=lambda each: each["crc"])
def test_columns_are_read_as_published(published: dict[str, Any]) -> None:
    point, values = path_point(published["record"]), published["values"]
    for name in ("airport", "runway", "route", "rpi", "rpds", "sbas_provider", "apd", "ltp_height_m", "course_width_m",
                 "delta_length_offset_m", "hal_m", "val_m"):  # fmt: skip
        assert getattr(point, name) == values[name], name
    expected = {
        **{f"{place}_{short}_rad": angle_rad(*values[f"{place}_{long}"])
           for place in ("ltp", "fpap") for short, long in (("lat", "latitude"), ("lon", "longitude"))},
        "gpa_rad": math.radians(values["gpa_deg"]),
        "tch_m": values["tch_ft"] * 0.3048,
    }  # fmt: skip
    for name, value in expected.items():
        assert getattr(point, name) == pytest.approx(value, rel=1e-15), name


@pytest.mark.parametrize("published", PUBLISHED, ids=lambda each: each["crc"])
def test_block_has_the_published_crc(published: dict[str, Any]) -> None:
    checked = checked_path_point(published["record"])
    assert checked.crc_ok
    assert checked.crc == published["crc"]
    assert checked.block[-4:].hex().upper() == published["crc"]
    assert len(checked.block) == 40
    # The same by long division, bit by bit: the register is printed with the bits of each byte reversed.
    bits = "".join(f"{byte:08b}"[::-1] for byte in checked.block[:-4])
    remainder = crc_remainder_bits(bits, CRC32Q)
    digits = "".join(f"{int(remainder[at : at + 8][::-1], 2):02X}" for at in range(0, 32, 8))
    assert digits == published["crc"]


@pytest.mark.parametrize("published", PUBLISHED, ids=lambda each: each["crc"])
def test_block_decodes_to_what_was_published(published: dict[str, Any]) -> None:
    values = published["values"]
    block = decode(approach_tables.FAS_BLOCK, BitReader(checked_path_point(published["record"]).block[:34]))
    assert isinstance(block, FasBlock)
    assert (block.airport_id, block.runway_number, block.route_indicator) == (
        values["airport"], int(values["runway"]), values["route"],
    )  # fmt: skip
    # Half a step of the message: 0.0005 seconds of arc; a quarter of it is enough for double precision.
    step_rad = math.radians(0.0005 / 3600.0)
    ltp, fpap = (angle_rad(*values[f"{place}_latitude"]) for place in ("ltp", "fpap"))
    assert block.ltp_latitude_rad == pytest.approx(ltp, abs=step_rad / 4.0)
    assert block.delta_fpap_latitude_rad == pytest.approx(fpap - ltp, abs=step_rad / 4.0)


def test_route_letters_are_ia5_codes() -> None:
    """I and O are never assigned; the place of a letter in a list without them is another code from J on."""
    letters = "ABCDEFGHJKLMNPQRSTUVWXYZ"
    route = next(
        entry for entry in approach_tables.FAS_BLOCK.entries if getattr(entry, "name", "") == "route_indicator"
    )
    assert [route.to_raw(letter) for letter in letters] == [ord(letter) - ord("@") for letter in letters]
    assert route.to_raw("") == 0
    for raw in (9, 15, 27, 31):
        with pytest.raises(FieldError, match="route_indicator"):
            route.from_raw(raw)
    for text in ("I", "O", "AB", "a", "1", None):
        with pytest.raises(FieldError, match="route_indicator"):
            route.to_raw(text)


def test_no_other_list_of_values_is_letters_in_a_row() -> None:
    """Lists coded by place are those the standard numbers so: designators and runway letters; letters have a class."""
    named = vars(tables) | vars(approach_tables)
    layouts = [value for value in named.values() if isinstance(value, Layout)]
    choices = {entry.name: entry.values for layout in layouts for entry in layout.entries if isinstance(entry, Choice)}
    assert choices == {
        "n_reference_receivers": (2, 3, 4, None),
        "ground_accuracy_designator": ("A", "B", "C", None),
        "runway_letter": ("", "R", "C", "L"),
        "tch_in_feet": (True, False),
        "becomes_available": (False, True),
    }  # fmt: skip  # Annex 10 vol. I, tables B-65 and D-1; type 5 source duration sense
    letters = {entry.name for layout in layouts for entry in layout.entries if isinstance(entry, Letter)}
    assert letters == {"route_indicator"}


@pytest.mark.parametrize(
    ("begin", "text", "message"),
    [
        (4, "D", "no path point record"),
        (19, "RW37 ", r"columns 20 to 24 \(runway\)"),
        (27, "I", r"columns 28 to 28 \(route\)"),
        (27, "O", r"columns 28 to 28 \(route\)"),
        (36, "x", r"columns 37 to 37 \(apd\)"),
        (37, "N9127599565", r"columns 38 to 48 \(ltp_latitude\).*up to 90"),
        (37, "N4461599565", r"columns 38 to 48 \(ltp_latitude\)"),
        (48, "W18107355625", r"columns 49 to 60 \(ltp_longitude\)"),
        (60, " 00730", r"columns 61 to 66 \(ltp_height\)"),
        (66, "٠٣٢٠", r"columns 67 to 70 \(gpa\)"),
        (93, "20000", "course_width_m"),
        (108, "M", r"columns 109 to 109 \(tch_unit\)"),
        (109, "401", r"columns 110 to 112 \(hal\).*multiple of 2"),
        (109, "998", "hal = 99.8 m, at most 51.0 m"),
        (115, "78F37CFG", r"columns 116 to 123 \(crc\)"),
    ],
)  # fmt: skip
def test_errors_name_the_columns(begin: int, text: str, message: str) -> None:
    with pytest.raises(PathPointError, match=message):
        checked_path_point(RECORD[:begin] + text + RECORD[begin + len(text) :])


def test_short_records_and_other_records() -> None:
    with pytest.raises(PathPointError, match="ends after 122 characters"):
        checked_path_point(RECORD[:122])
    assert is_path_point(RECORD)
    assert not is_path_point("")
    assert not is_path_point(RECORD[:26] + "2" + RECORD[27:])


@pytest.mark.parametrize("place", [25, 31, 47, 59, 65, 69, 80, 92, 97, 101, 107, 111, 114, 122])
def test_a_changed_digit_is_not_trusted(place: int) -> None:
    """The last digit of every number: under the CRC, or finer than the block's steps and refused for that."""
    changed = f"{(int(RECORD[place]) + 1) % 10}"
    with pytest.raises(PathPointError):
        trusted_path_point(RECORD[:place] + changed + RECORD[place + 1 :])


def test_an_approach_of_a_record_is_broadcast_as_the_record_says() -> None:
    approach = approach_from_mapping({"arinc424": RECORD})
    block = fas_data_set(approach).fas
    writer = BitWriter()
    encode(approach_tables.FAS_BLOCK, block, writer)
    sent = decode(approach_tables.FAS_BLOCK, BitReader(writer.to_bytes()))
    published = decode(approach_tables.FAS_BLOCK, BitReader(checked_path_point(RECORD).block[:34]))
    for name in ("airport_id", "runway_number", "route_indicator", "ltp_latitude_rad", "ltp_longitude_rad",
                 "ltp_height_m", "delta_fpap_latitude_rad", "delta_fpap_longitude_rad", "gpa_rad"):  # fmt: skip
        assert getattr(sent, name) == getattr(published, name), name
    assert (approach.fasval_m, approach.faslal_m) == (50.0, 40.0)


def test_station_files_take_records_and_check_them(station_mapping: dict[str, Any]) -> None:
    taken = GroundParams.from_mapping(
        {**station_mapping, "approaches": {"rwy33": {"arinc424": RECORD, "apd": 1, "rpds": 5, "fasval_m": 10.0}}},
        source="station.yaml",
    )
    (approach,) = taken.approaches
    assert (approach.route, approach.apd, approach.rpds, approach.fasval_m) == ("Z", 1, 5, 10.0)
    wrong = RECORD[:115] + "00000000" + RECORD[123:]
    with pytest.raises(ValueError, match=r"station.yaml: approaches.rwy33: columns 116 to 123 \(crc\)"):
        GroundParams.from_mapping(
            {**station_mapping, "approaches": {"rwy33": {"arinc424": wrong}}}, source="station.yaml"
        )
    with pytest.raises(ValueError, match="gpa_deg is given beside arinc424"):
        approach_from_mapping({"arinc424": RECORD, "gpa_deg": 3.0})


@pytest.fixture(name="station_mapping")
def _station_mapping() -> dict[str, Any]:
    from gbas_bringup.resources import config_path
    from gbas_core.configuration import read_configuration

    sections = read_configuration(config_path("nominal_station.yaml")).section("ground")
    place = {"latitude_deg": 44.47, "longitude_deg": -73.15, "height_m": 72.0}
    sections["station"] = {**sections.get("station", {}), **place}
    sections["receivers"] = {"rr1_ecef_m": [1_320_000.0, -4_365_000.0, 4_445_000.0], "minimum": 1}
    sections.pop("approaches", None)
    return sections
