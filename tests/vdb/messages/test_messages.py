"""Messages to bits and back: against the second formulation of the tables, at every extreme, and out of bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_vdb.coding.bits import BitReader, BitWriter
from gbas_vdb.errors import CrcError, FieldError, VdbError
from gbas_vdb.messages import approach_tables, tables
from gbas_vdb.messages import types as m
from gbas_vdb.messages.block import BlockError, decode_block, decode_blocks, decode_body, encode_block, encode_body
from gbas_vdb.messages.fields import Number
from gbas_vdb.messages.fixed_places import Items
from gbas_vdb.messages.layout import Layout, decode, encode
from vdb_fields import TABLES, drawn_record, raw_bounds, same, value_of
from vdb_oracle import CRC32Q, air_bits, bytes_of_air_bits, crc_remainder_bits, field_bits

RECORDS: dict[str, Any] = {
    "type1": m.Type1,
    "type2": m.Type2,
    "type5": m.Type5,
    "type11": m.Type11,
    "correction_100": m.Correction100,
    "correction_30": m.Correction30,
    "adb1": m.AdditionalBlock1,
    "adb3": m.AdditionalBlock3,
    "adb4": m.AdditionalBlock4,
    "fas": m.FasBlock,
    "predicted_source": m.PredictedSource,
    "obstructed_approach": m.ObstructedApproach,
}
LAYOUTS: dict[str, Layout] = {
    "type1": tables.TYPE_1,
    "type2": tables.TYPE_2,
    "type5": tables.TYPE_5,
    "type11": tables.TYPE_11,
    "correction_100": tables.CORRECTION_100,
    "correction_30": tables.CORRECTION_30,
    "adb1": tables.ADDITIONAL_BLOCK_1,
    "adb3": tables.ADDITIONAL_BLOCK_3,
    "adb4": tables.ADDITIONAL_BLOCK_4,
    "fas": approach_tables.FAS_BLOCK,
    "predicted_source": tables.PREDICTED_SOURCE,
    "obstructed_approach": tables.OBSTRUCTED_APPROACH,
}
NAN = math.nan


def bits_of(layout: Layout, record: Any) -> str:
    writer = BitWriter()
    encode(layout, record, writer)
    return f"{writer.value:0{writer.n_bits}b}"[::-1]


def reader_of(bits: str) -> BitReader:
    reader = BitReader(bytes_of_air_bits(bits + "0" * (-len(bits) % 8)))
    reader.n_bits = len(bits)
    return reader


# ---- all layouts against the second formulation ----


@pytest.mark.parametrize("name", LAYOUTS)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_bits_agree_with_the_second_formulation(name: str, data: st.DataObject) -> None:
    record, bits = drawn_record(data.draw, name, RECORDS)
    assert bits_of(LAYOUTS[name], record) == bits
    assert same(decode(LAYOUTS[name], reader_of(bits)), record)


@pytest.mark.parametrize("name", ["type1", "type11"])
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_measurements_as_a_table_have_the_same_bits(name: str, data: st.DataObject) -> None:
    record, bits = drawn_record(data.draw, name, RECORDS)
    group = LAYOUTS[name].group
    assert group is not None
    table = Items.of(group.layout, record.measurements)
    assert bits_of(LAYOUTS[name], replace(record, measurements=table)) == bits
    assert same(table, record.measurements)


def quantities() -> list[tuple[str, dict[str, Any]]]:
    return [
        (name, entry)
        for name, table in TABLES.items()
        for entry in table
        if "low" in entry and not entry.get("length") and "needs" not in entry
    ]


def base_record(name: str) -> Any:
    values: dict[str, Any] = {}
    for entry in TABLES[name]:
        if "group" in entry:
            values[entry["group"]] = ()
        elif "text" in entry:
            values[entry["name"]] = "ED V"
        elif "letters" in entry:
            values[entry["name"]] = entry["letters"][0]
        elif "values" in entry:
            values[entry["name"]] = entry["values"][1]
        elif "length" in entry:
            values[entry["name"]] = (value_of(entry, 1),) * entry["length"]
        elif "needs" in entry:
            values[entry["name"]] = None if entry.get("integer") else NAN
        elif "name" in entry:
            values[entry["name"]] = value_of(entry, raw_bounds(entry)[0] + 1)
    return RECORDS[name](**values)


@pytest.mark.parametrize(
    ("name", "entry"), quantities(), ids=lambda item: item if isinstance(item, str) else item["name"]
)
def test_extremes_and_codes_of_every_field(name: str, entry: dict[str, Any]) -> None:
    field, base = entry["name"], base_record(name)
    low, high = raw_bounds(entry)
    for raw in (low, low + 1, high - 1, high, *entry.get("codes", {})):
        value = value_of(entry, raw)
        record = replace(base, **{field: value})
        bits = bits_of(LAYOUTS[name], record)
        position = 0
        for other in TABLES[name]:
            if other is entry:
                break
            position += other.get("bits", 0) * other.get("length", 1)
        assert bits[position : position + entry["bits"]] == field_bits(raw, entry["bits"])
        assert same(getattr(decode(LAYOUTS[name], reader_of(bits)), field), value)


# Availability and duration have a code for "this much or more", which takes larger values.
SATURATING = {"source_availability_s", "duration_s"}


@pytest.mark.parametrize(
    ("name", "entry"), quantities(), ids=lambda item: item if isinstance(item, str) else item["name"]
)
def test_beyond_the_bounds_is_refused_with_names(name: str, entry: dict[str, Any]) -> None:
    field, base = entry["name"], base_record(name)
    low, high = raw_bounds(entry)
    for raw in (low - 1, high + 1):
        if field in SATURATING and raw > high:
            continue
        step = value_of({**entry, "codes": {}}, raw)
        with pytest.raises(FieldError, match=field) as refusal:
            bits_of(LAYOUTS[name], replace(base, **{field: step}))
        assert repr(step) in str(refusal.value)
    for strange in (math.inf, -math.inf, NAN, None, 1e300, -1e300):
        if strange in (math.inf, 1e300) and field in SATURATING:
            continue
        if any(same(value_of(entry, raw), strange) for raw in entry.get("codes", {})):
            continue
        if strange is not None and strange != strange and any("blanks" in other for other in TABLES[name]):
            continue  # a correction may be missing when its sigma is
        with pytest.raises(FieldError, match=field):
            bits_of(LAYOUTS[name], replace(base, **{field: strange}))


def test_more_than_the_last_availability_is_sent_as_or_more() -> None:
    source = m.PredictedSource(ranging_source_id=1, becomes_available=True, duration_s=5000.0)
    assert decode(tables.PREDICTED_SOURCE, reader_of(bits_of(tables.PREDICTED_SOURCE, source))).duration_s == 1270.0


# ---- rounding ----


def rounded(layout: Layout, record: Any, field: str) -> Any:
    return getattr(decode(layout, reader_of(bits_of(layout, record))), field)


@given(value=st.floats(0.0, 5.08))
def test_sigma_never_becomes_smaller(value: float) -> None:
    record = replace(base_record("correction_100"), sigma_pr_gnd_m=value)
    sent = rounded(tables.CORRECTION_100, record, "sigma_pr_gnd_m")
    # Slack of a millionth of a count lets decimal values of whole counts through unchanged.
    assert value - 0.02e-6 <= sent < value + 0.02


@given(value=st.floats(0.0, 1.275e-3))
def test_ephemeris_decorrelation_never_becomes_smaller(value: float) -> None:
    message = m.Type11(
        modified_z_count_s=0.0, ephemeris_decorrelation_d=value, measurements=(base_record("correction_30"),)
    )
    sent = rounded(tables.TYPE_11, message, "ephemeris_decorrelation_d")
    assert value - 5e-12 <= sent < value + 5e-6


@given(value=st.floats(-327.67, 327.67))
def test_correction_is_rounded_to_the_nearest_count(value: float) -> None:
    sent = rounded(tables.CORRECTION_100, replace(base_record("correction_100"), prc_m=value), "prc_m")
    assert abs(sent - value) <= 0.005 + 1e-9


@given(value=st.floats(0.0, 50.8))
def test_alert_limits_never_become_larger(value: float) -> None:
    fas = replace(base_record("fas"), approach_performance_designator=1)
    data_set = m.FasDataSet(fas=fas, fasval_m=min(value, 25.4), faslal_m=value)
    (block,), _ = decode_blocks(encode_block(m.Type4(data_sets=(data_set,)), "EDVE"))
    assert isinstance(block.message, m.Type4)
    (sent,) = block.message.data_sets
    assert isinstance(sent, m.FasDataSet)
    assert value - 0.2 < sent.faslal_m <= value + 0.2e-6
    assert min(value, 25.4) - 0.1 < sent.fasval_m <= min(value, 25.4) + 0.1e-6


def test_sigma_of_whole_counts_is_exact() -> None:
    # 0.02 * 3 is a little more than 0.06 in floating point: it must not become 0.08.
    for counts in range(255):
        record = replace(base_record("correction_100"), sigma_pr_gnd_m=counts * 0.02)
        assert rounded(tables.CORRECTION_100, record, "sigma_pr_gnd_m") == pytest.approx(counts * 0.02, abs=1e-12)


# ---- whole blocks ----


def crc_bits(data: bytes) -> str:
    return crc_remainder_bits(air_bits(data), CRC32Q)


@pytest.mark.parametrize(("name", "number"), [("type1", 1), ("type2", 2), ("type5", 5), ("type11", 11)])
@given(
    data=st.data(), station=st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", min_size=3, max_size=4), test=st.booleans()
)
@settings(max_examples=40, deadline=None)
def test_block_round_trip(name: str, number: int, data: st.DataObject, station: str, test: bool) -> None:
    counts = {"approaches": 1} if name == "type5" else None  # longer ones do not fit a burst
    message, bits = drawn_record(data.draw, name, RECORDS, counts=counts)
    block = encode_block(message, station, test=test)
    assert block[0] == (0xFF if test else 0xAA)
    assert air_bits(block[6:-4]) == bits
    # The CRC's highest power is sent first.
    assert air_bits(block[-4:]) == crc_bits(block[:-4])
    decoded = decode_block(block)
    assert same(decoded.message, message)
    assert (decoded.station_id, decoded.test, decoded.message_type) == (station, test, number)
    assert decoded.length == len(block) == block[5]


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_type2_with_additional_blocks_round_trip(data: st.DataObject) -> None:
    station, bits = drawn_record(data.draw, "type2", RECORDS)
    adb1, adb1_bits = drawn_record(data.draw, "adb1", RECORDS)
    bits += adb1_bits
    found = {"adb1": adb1}
    for number, name, length in ((3, "adb3", 6), (4, "adb4", 3)):
        if data.draw(st.booleans()):
            found[name], text = drawn_record(data.draw, name, RECORDS)
            bits += field_bits(length, 8) + field_bits(number, 8) + text
    unknown = data.draw(st.lists(st.tuples(st.sampled_from([2, 5, 255]), st.binary(max_size=20)), max_size=3))
    for number, content in unknown:
        bits += field_bits(len(content) + 2, 8) + field_bits(number, 8) + air_bits(content)
    blocks = tuple(m.UnknownAdditionalBlock(number=number, data=content) for number, content in unknown)
    message = replace(station, **found, unknown=blocks)
    assert air_bits(encode_body(message)) == bits
    decoded, notes = decode_body(2, bytes_of_air_bits(bits))
    assert same(decoded, message)
    assert len(notes) == len(unknown)
    assert all(f"block {number} is not known" in note for (number, _), note in zip(unknown, notes, strict=True))


@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_type4_round_trip(data: st.DataObject) -> None:
    sets, bits = [], ""
    for _ in range(data.draw(st.integers(0, 5))):
        fas, fas_bits = drawn_record(data.draw, "fas", RECORDS)
        per_metre = 5 if fas.approach_performance_designator == 0 else 10
        val, lal = data.draw(st.integers(0, 255)), data.draw(st.integers(0, 255))
        sets.append(
            m.FasDataSet(
                fas=fas, fasval_m=NAN if val == 255 else val / per_metre, faslal_m=NAN if lal == 255 else lal / 5
            )
        )
        crc = crc_remainder_bits(fas_bits, CRC32Q)
        bits += field_bits(41, 8) + fas_bits + crc + field_bits(val, 8) + field_bits(lal, 8)
    message = m.Type4(data_sets=tuple(sets))
    assert air_bits(encode_body(message)) == bits
    decoded, notes = decode_body(4, bytes_of_air_bits(bits))
    assert same(decoded, message)
    assert notes == ()


def test_unknown_data_set_is_skipped_by_its_length_and_kept() -> None:
    data_set = m.FasDataSet(fas=base_record("fas"), fasval_m=10.0, faslal_m=40.0)
    message = m.Type4(data_sets=(m.UnknownDataSet(data=b"\x01\x02\x03"), data_set))
    decoded, notes = decode_body(4, encode_body(message))
    assert isinstance(decoded, m.Type4)
    assert decoded.data_sets[0] == message.data_sets[0]
    assert notes == ("data set of 4 bytes is not a FAS",)


@pytest.mark.parametrize("n_fill_bytes", [0, 1, 212])
def test_type3_round_trip(n_fill_bytes: int) -> None:
    message = m.Type3(n_fill_bytes=n_fill_bytes)
    assert decode_block(encode_block(message, "EDVE")).message == message


def test_unknown_message_type_is_kept_and_noted() -> None:
    message = m.UnknownMessage(message_type=8, body=b"private")
    decoded = decode_block(encode_block(message, "EDVE"))
    assert decoded.message == message
    assert decoded.notes == ("message type 8 is not known",)


def test_lengths_of_the_standard() -> None:
    measurement = base_record("correction_100")
    message = m.Type1(
        modified_z_count_s=0.0, ephemeris_decorrelation=0.0, ephemeris_crc=0, measurements=(measurement,) * 18
    )
    type1 = encode_block(message, "EDVE")
    assert len(type1) == 215
    type2 = encode_block(base_record("type2"), "EDVE")
    assert len(type2) == 28
    assert len(type1) + len(type2) > 222
    type11 = m.Type11(
        modified_z_count_s=0.0, ephemeris_decorrelation_d=0.0, measurements=(base_record("correction_30"),) * 18
    )
    assert len(encode_block(type11, "EDVE")) == 6 + 4 + 7 * 18 + 4


def test_nineteen_measurements_are_refused() -> None:
    message = m.Type1(
        modified_z_count_s=0.0,
        ephemeris_decorrelation=0.0,
        ephemeris_crc=0,
        measurements=(base_record("correction_100"),) * 19,
    )
    with pytest.raises(FieldError, match="measurements: 19 items, at most 18"):
        encode_block(message, "EDVE")


def test_a_message_longer_than_a_burst_is_refused() -> None:
    data_set = m.FasDataSet(fas=base_record("fas"), fasval_m=10.0, faslal_m=40.0)
    with pytest.raises(FieldError, match="message type 4 of 256 bytes; at most 222"):
        encode_block(m.Type4(data_sets=(data_set,) * 6), "EDVE")


def test_measurement_errors_name_their_position() -> None:
    good = base_record("correction_100")
    message = m.Type1(
        modified_z_count_s=0.0,
        ephemeris_decorrelation=0.0,
        ephemeris_crc=0,
        measurements=(good, replace(good, prc_m=328.0)),
    )
    with pytest.raises(FieldError, match=r"measurements\[1\]: prc_m = 328.0 outside -327.67 to 327.67 m"):
        encode_block(message, "EDVE")


def test_missing_first_source_data_is_refused_when_there_are_measurements() -> None:
    with pytest.raises(FieldError, match="ephemeris_decorrelation"):
        encode_block(
            m.Type1(modified_z_count_s=0.0, ephemeris_crc=0, measurements=(base_record("correction_100"),)), "EDVE"
        )
    with pytest.raises(FieldError, match="ephemeris_crc"):
        encode_block(
            m.Type1(modified_z_count_s=0.0, ephemeris_decorrelation=0.0, measurements=(base_record("correction_100"),)),
            "EDVE",
        )


def test_a_correction_without_sigma_has_no_value() -> None:
    correction = replace(base_record("correction_100"), sigma_pr_gnd_m=NAN, prc_m=12.0, rrc_mps=1.0)
    decoded = decode(tables.CORRECTION_100, reader_of(bits_of(tables.CORRECTION_100, correction)))
    assert math.isnan(decoded.sigma_pr_gnd_m)
    assert math.isnan(decoded.prc_m)
    assert math.isnan(decoded.rrc_mps)


def test_a_usable_correction_must_have_a_value() -> None:
    with pytest.raises(FieldError, match="prc_m = nan"):
        bits_of(tables.CORRECTION_100, replace(base_record("correction_100"), prc_m=NAN))


@pytest.mark.parametrize("station", ["LONGER", "abcd", "A-B", "É"])
def test_station_that_cannot_be_sent_is_refused(station: str) -> None:
    with pytest.raises(FieldError, match="station_id"):
        encode_block(m.Type3(n_fill_bytes=0), station)


def test_three_letter_station_sends_its_space_first() -> None:
    block = encode_block(m.Type3(n_fill_bytes=0), "CMJ")
    assert block[1] & 0x3F == ord(" ")
    assert decode_block(block).station_id == "CMJ"


def test_additional_blocks_need_the_first() -> None:
    with pytest.raises(FieldError, match="adb1"):
        encode_block(replace(base_record("type2"), adb4=m.AdditionalBlock4(slot_group=1)), "EDVE")


def test_slots_of_a_slot_group() -> None:
    assert m.AdditionalBlock4(slot_group=0b10000101).slots == (0, 2, 7)


def test_semi_width_by_convention_without_a_runway() -> None:
    assert replace(base_record("fas"), runway_number=0).semi_width_m == 38.0
    assert replace(base_record("fas"), runway_number=1, course_width_m=105.0).semi_width_m == 105.0


# ---- what is wrong is discarded and named ----


def recoded(block: bytes) -> bytes:
    """The block with its CRC made right again."""
    return block[:-4] + bytes_of_air_bits(crc_bits(block[:-4]))


def type2_block() -> bytes:
    station = replace(base_record("type2"), adb1=base_record("adb1"), adb3=base_record("adb3"))
    return encode_block(station, "EDVE")


@pytest.mark.parametrize("bit", range(8 * 28))
def test_every_single_wrong_bit_is_found(bit: int) -> None:
    damaged = bytearray(encode_block(base_record("type2"), "EDVE"))
    damaged[bit // 8] ^= 1 << bit % 8
    blocks, errors = decode_blocks(bytes(damaged))
    assert blocks == ()
    assert errors


def test_bad_crc_is_named_and_the_next_block_is_read() -> None:
    first, second = bytearray(type2_block()), encode_block(m.Type3(n_fill_bytes=2), "EDVE")
    first[10] ^= 0x40
    blocks, errors = decode_blocks(bytes(first) + second + bytes(5))
    assert [block.message_type for block in blocks] == [3]
    (error,) = errors
    assert error.offset == 0
    assert "message CRC failed" in error.reason
    assert "message type 2" in error.reason


def test_padding_is_no_error() -> None:
    assert decode_blocks(bytes(100)) == ((), ())
    assert decode_blocks(b"") == ((), ())


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\xaa\x00", "message block of 2 bytes"),
        (b"\x5a" + bytes(20), "message block identifier 0x5a"),
        (b"\xaa" + bytes(4) + b"\x09" + bytes(10), "message length 9 outside 10 to 222"),
        (b"\xaa" + bytes(4) + b"\xff" + bytes(10), "message length 255 outside 10 to 222"),
        (b"\xaa" + bytes(4) + b"\x20" + bytes(10), "message length 32, but 16 bytes are left"),
    ],
)
def test_bad_headers_are_named(data: bytes, reason: str) -> None:
    blocks, errors = decode_blocks(data)
    assert blocks == ()
    assert len(errors) == 1
    assert reason in errors[0].reason


def test_block_with_bytes_behind_is_refused() -> None:
    with pytest.raises(VdbError, match="message length 10 in the header, but 11 bytes"):
        decode_block(encode_block(m.Type3(n_fill_bytes=0), "EDVE") + b"\0")


def reason_of(block: bytes) -> str:
    blocks, errors = decode_blocks(recoded(block))
    assert blocks == ()
    (error,) = errors
    assert isinstance(error, BlockError)
    return error.reason


def with_length(block: bytes, cut: int) -> bytes:
    body = block[6:-4][:cut] if cut < 0 else block[6:-4] + bytes(cut)
    return block[:5] + bytes((len(body) + 10,)) + body + bytes(4)


def test_body_of_wrong_length_is_named() -> None:
    type1 = encode_block(m.Type1(modified_z_count_s=0.0), "EDVE")
    assert "too long: 8 bits" in reason_of(with_length(type1, 1))
    assert "too short" in reason_of(with_length(type1, -1))


def test_out_of_range_field_with_a_right_crc_is_named() -> None:
    type1 = bytearray(encode_block(m.Type1(modified_z_count_s=0.0), "EDVE"))
    type1[6:8] = (12000).to_bytes(2, "little")
    assert "message type 1: modified_z_count_s = 1200.0 outside 0.0 to 1199.9 s" in reason_of(bytes(type1))


def test_bad_additional_blocks_are_named() -> None:
    block = type2_block()
    start = 6 + 18 + 6
    for length, reason in ((0, "length 0 outside 2 to 6"), (7, "length 7 outside 2 to 6")):
        damaged = bytearray(block)
        damaged[start] = length
        assert reason in reason_of(bytes(damaged))
    repeated = block[:-4] + block[start:-4] + bytes(4)
    assert "additional data block 3 is there twice" in reason_of(repeated[:5] + bytes((len(repeated),)) + repeated[6:])
    assert "additional data block length 1 outside" in reason_of(with_length(block[:-4] + b"\x01" + bytes(4), 0))


def test_bad_fas_crc_is_named() -> None:
    data_set = m.FasDataSet(fas=base_record("fas"), fasval_m=10.0, faslal_m=40.0)
    block = bytearray(encode_block(m.Type4(data_sets=(data_set, data_set)), "EDVE"))
    block[6 + 41 + 1 + 20] ^= 1
    assert "message type 4: FAS block CRC failed in data set 1" in reason_of(bytes(block))
    with pytest.raises(CrcError):
        decode_block(recoded(bytes(block)))


def test_strange_station_characters_are_named() -> None:
    block = bytearray(encode_block(m.Type3(n_fill_bytes=0), "EDVE"))
    block[1] = (block[1] & 0xC0) | 0x3F
    assert "station_id: character code 0x3f" in reason_of(bytes(block))


def test_spare_bits_are_not_looked_at() -> None:
    block = bytearray(encode_block(base_record("type2"), "EDVE"))
    block[6] |= 0x10  # the spare bit behind the accuracy designator
    (decoded,), errors = decode_blocks(recoded(bytes(block)))
    assert errors == ()
    assert same(decoded.message, base_record("type2"))


def test_fields_have_consistent_tables() -> None:
    for layout in LAYOUTS.values():
        for entry in layout.entries:
            if isinstance(entry, Number):
                low, high = entry.bounds
                width = (1 << entry.bits) - 1
                assert -(1 << (entry.bits - 1)) <= low <= high <= width
