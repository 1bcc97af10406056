"""Documents of message blocks: what `gbas vdb decode` prints and `encode` takes."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_vdb.coding import radio
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.errors import VdbError
from gbas_vdb.messages import types as m
from gbas_vdb.messages.block import encode_block
from gbas_vdb.messages.describe import DecodeError, decode_hex_to_json, encode_json_to_hex
from vdb_fields import drawn_record

VECTORS = yaml.safe_load((Path(__file__).parents[2] / "tables" / "vdb_vectors.yaml").read_text())
TYPE4 = VECTORS["type4"]
TYPE4_HEX = "".join(TYPE4["application_data"].split())
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


def through_json(document: dict[str, Any]) -> dict[str, Any]:
    """As it comes out of a file: strict JSON has no NaN and no infinity."""
    return json.loads(json.dumps(document, allow_nan=False))  # type: ignore[no-any-return]


def test_type1_document_of_the_published_example() -> None:
    assert decode_hex_to_json(VECTORS["type1"]["block"]) == {
        "blocks": [
            {
                "message_type": 1,
                "station_id": "BELL",
                "crc_ok": True,
                "test": False,
                "fields": {
                    "modified_z_count_s": 100.0,
                    "additional_message_flag": 3,
                    "measurement_type": 0,
                    "ephemeris_decorrelation": 0.0,
                    "ephemeris_crc": 0,
                    "source_availability_s": None,
                    "measurements": [
                        {
                            "ranging_source_id": 122,
                            "iod": 2,
                            "prc_m": 1.0,
                            "rrc_mps": -0.2,
                            "sigma_pr_gnd_m": 1.96,
                            "b_values_m": [0.1, 0.15, -0.25, None],
                        }
                    ],
                },
            }
        ]
    }


def test_burst_as_bytes_as_digits_and_as_bits() -> None:
    expected = decode_hex_to_json(TYPE4_HEX)["blocks"]
    assert expected[0]["station_id"] == "CMJ"
    as_bytes = decode_hex_to_json(TYPE4_HEX + TYPE4["application_fec"], burst=True)
    assert as_bytes == {"corrected_bytes": 0, "blocks": expected}
    payload = bytes.fromhex(TYPE4_HEX + TYPE4["application_fec"])
    row = "".join(str(bit) for bit in radio.burst_bits(payload, 3))
    for text in (TYPE4["scrambled"], row, f"{row[:100]}\n{row[100:]}"):
        assert decode_hex_to_json(text, burst=True) == {
            "station_slot_identifier": "D",
            "corrected_bytes": 0,
            "blocks": expected,
        }


def test_lower_case_and_white_space_are_read() -> None:
    assert decode_hex_to_json("\n " + TYPE4_HEX.lower() + " ") == decode_hex_to_json(TYPE4_HEX)


def test_burst_with_wrong_bytes_is_repaired_and_says_so() -> None:
    payload = bytearray(bytes.fromhex(TYPE4_HEX + TYPE4["application_fec"]))
    payload[5] ^= 0x10
    payload[-1] ^= 0xFF
    assert decode_hex_to_json(payload.hex(), burst=True)["corrected_bytes"] == 2


def test_bad_crc_is_an_error_that_names_it() -> None:
    wrong = TYPE4_HEX[:-1] + ("0" if TYPE4_HEX[-1] != "0" else "1")
    with pytest.raises(DecodeError, match=r"byte 0: message CRC failed.*message type 4") as failure:
        decode_hex_to_json(wrong)
    assert failure.value.document["blocks"] == []
    assert failure.value.document["errors"][0]["offset"] == 0


def test_good_blocks_beside_a_bad_one_are_in_the_document() -> None:
    good = encode_block(m.Type3(n_fill_bytes=1), "EDVE")
    bad = bytearray(good)
    bad[-1] ^= 1
    with pytest.raises(DecodeError, match="byte 0: message CRC failed") as failure:
        decode_hex_to_json((bytes(bad) + good).hex())
    assert [block["message_type"] for block in failure.value.document["blocks"]] == [3]


@pytest.mark.parametrize(
    ("text", "burst", "reason"),
    [
        ("AAX", False, "'X' is not a digit"),
        ("AAA", False, "3 digits are not whole bytes"),
        ("", False, "there is no message block"),
        ("00" * 20, False, "there is no message block"),
        ("AA00", False, "message block of 2 bytes"),
        ("AA" * 5, True, "application data of -1 bytes"),
        ("", True, "application data of -6 bytes"),
        ("2AA", True, "first digit stands for one bit"),
        ("1AA", True, "training sequence alone has 25"),
        ("G", True, "first digit stands for one bit"),
        ("0" * 72 + "1", True, "transmission length|training"),
    ],
)
def test_texts_that_are_not_bursts_are_named(text: str, burst: bool, reason: str) -> None:
    with pytest.raises(VdbError, match=reason):
        decode_hex_to_json(text, burst=burst)


def test_burst_beyond_repair_is_an_error() -> None:
    payload = bytearray(bytes.fromhex(TYPE4_HEX + TYPE4["application_fec"]))
    for place in range(10, 40):
        payload[place] ^= 0x55
    with pytest.raises(VdbError, match="application FEC cannot repair"):
        decode_hex_to_json(payload.hex(), burst=True)


# ---- round trips ----


@pytest.mark.parametrize("name", ["type1", "type2", "type5", "type11"])
@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_documents_round_trip_to_the_same_bits(name: str, data: st.DataObject) -> None:
    message, _ = drawn_record(data.draw, name, RECORDS, counts={"approaches": 1} if name == "type5" else None)
    if name == "type2" and data.draw(st.booleans()):
        blocks = {block: drawn_record(data.draw, block, RECORDS)[0] for block in ("adb1", "adb3", "adb4")}
        unknown = (m.UnknownAdditionalBlock(number=9, data=b"\x01"),)
        message = m.Type2(
            **{item: getattr(message, item) for item in message.__slots__ if item not in (*blocks, "unknown")},
            **blocks,
            unknown=unknown,
        )
    text = encode_block(message, "EDVE", test=data.draw(st.booleans())).hex().upper()
    assert encode_json_to_hex(through_json(decode_hex_to_json(text))) == text


@given(data=st.data(), limits=st.tuples(st.integers(0, 255), st.integers(0, 255)))
@settings(max_examples=40, deadline=None)
def test_approach_documents_round_trip_to_the_same_bits(data: st.DataObject, limits: tuple[int, int]) -> None:
    fas, _ = drawn_record(data.draw, "fas", RECORDS)
    per_metre = 5 if fas.approach_performance_designator == 0 else 10
    fasval, faslal = (
        math.nan if raw == 255 else raw / scale for raw, scale in zip(limits, (per_metre, 5), strict=True)
    )
    data_set = m.FasDataSet(fas=fas, fasval_m=fasval, faslal_m=faslal)
    message = m.Type4(data_sets=(data_set, m.UnknownDataSet(data=b"\x01\x02")))
    text = encode_block(message, "EDVE").hex().upper()
    assert encode_json_to_hex(through_json(decode_hex_to_json(text))) == text


@pytest.mark.parametrize("message", [m.Type3(n_fill_bytes=7), m.UnknownMessage(message_type=101, body=b"abc")])
def test_other_documents_round_trip(message: m.Message) -> None:
    text = encode_block(message, "CMJ").hex().upper()
    assert encode_json_to_hex(through_json(decode_hex_to_json(text))) == text


def test_burst_documents_round_trip() -> None:
    text = TYPE4_HEX + TYPE4["application_fec"]
    assert encode_json_to_hex(through_json(decode_hex_to_json(text, burst=True)), burst=True) == text


def test_one_block_alone_may_be_given() -> None:
    document = decode_hex_to_json(TYPE4_HEX)
    assert encode_json_to_hex(document["blocks"][0]) == TYPE4_HEX


def test_defaults_may_be_left_out() -> None:
    document = {"message_type": 1, "station_id": "EDVE", "fields": {"modified_z_count_s": 12.5, "measurements": []}}
    assert decode_hex_to_json(encode_json_to_hex(document))["blocks"][0]["fields"]["additional_message_flag"] == 0


def test_an_unlimited_distance_is_a_text() -> None:
    station = decode_hex_to_json(encode_block(station_data(), "EDVE").hex())["blocks"][0]
    assert station["fields"]["adb1"]["d_max_m"] == "unlimited"
    assert station["fields"]["adb1"]["reference_station_data_selector"] is None


def station_data() -> m.Type2:
    return m.Type2(
        n_reference_receivers=None,
        ground_accuracy_designator="C",
        gcid=1,
        magnetic_variation_rad=0.0,
        sigma_vert_iono_gradient=4e-6,
        refractivity_index=379,
        scale_height_m=7900,
        refractivity_uncertainty=20,
        latitude_rad=0.91,
        longitude_rad=0.18,
        ellipsoid_height_m=87.5,
        adb1=m.AdditionalBlock1(k_md_e_pos_gps=5.0, k_md_e_c_gps=5.0),
    )


# ---- what is wrong is named ----


def type1_document() -> dict[str, Any]:
    return decode_hex_to_json(VECTORS["type1"]["block"])


def changed(path: list[Any], value: Any) -> dict[str, Any]:
    document = through_json(type1_document())
    place: Any = document["blocks"][0]
    for step in path[:-1]:
        place = place[step]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return document


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        (["message_type"], "1", r"blocks\[0\].message_type = '1'"),
        (["message_type"], True, r"message_type = True"),
        (["message_type"], 256, r"message_type = 256"),
        (["station_id"], 5, r"station_id = 5"),
        (["station_id"], "edve", r"blocks\[0\]: station_id"),
        (["test"], "no", r"test = 'no'"),
        (["fields"], None, r"fields = None is not an object"),
        (["fields", "prc"], 1, r"blocks\[0\].fields.prc is not a field"),
        (["fields", "modified_z_count_s"], ..., r"fields.modified_z_count_s is missing"),
        (["fields", "modified_z_count_s"], None, r"modified_z_count_s = nan"),
        (["fields", "modified_z_count_s"], "12", r"modified_z_count_s = '12' is not a number"),
        (["fields", "modified_z_count_s"], True, r"modified_z_count_s = True is not a number"),
        (["fields", "modified_z_count_s"], 1200, r"modified_z_count_s = 1200 outside 0.0 to 1199.9"),
        (["fields", "modified_z_count_s"], 10**400, r"is not a number of the VDB"),
        (["fields", "additional_message_flag"], 1.5, r"additional_message_flag = 1.5 is not an integer"),
        (["fields", "measurements"], {}, r"fields.measurements is not a list"),
        (["fields", "measurements", 0], 7, r"fields.measurements\[0\] = 7 is not an object"),
        (["fields", "measurements", 0, "prc_m"], 400, r"measurements\[0\]: prc_m = 400 outside -327.67 to 327.67 m"),
        (["fields", "measurements", 0, "prc_m"], "unlimited", r"prc_m = inf"),
        (["fields", "measurements", 0, "prc_m"], ..., r"measurements\[0\].prc_m is missing"),
        (["fields", "measurements", 0, "b_values_m"], [0.0], r"b_values_m has 1 values, not 4"),
        (["fields", "measurements", 0, "b_values_m"], [0, 0, 0, "x"], r"b_values_m\[3\] = 'x' is not a number"),
    ],
)
def test_errors_in_a_document_are_named(path: list[Any], value: Any, reason: str) -> None:
    with pytest.raises(VdbError, match=reason):
        encode_json_to_hex(changed(path, value))


@pytest.mark.parametrize(
    ("message_type", "fields", "reason"),
    [
        (3, {"n_fill_bytes": 213}, "n_fill_bytes = 213"),
        (3, {}, "n_fill_bytes = None"),
        (4, {"data_sets": [{"data_hex": "0"}]}, "1 digits are not whole bytes"),
        (4, {"data_sets": [5]}, r"data_sets\[0\] = 5 is not an object"),
        (4, {"data_sets": [{"data_hex": 5}]}, "data_hex = 5 is not a hexadecimal text"),
        (8, {"body_hex": None}, "body_hex = None is not a hexadecimal text"),
        (2, {"unknown": [{"number": 3, "data_hex": ""}]}, "is missing|number = 3 is not"),
        (2, {"adb4": 3}, "is missing|is not an object"),
    ],
)
def test_errors_in_other_documents_are_named(message_type: int, fields: dict[str, Any], reason: str) -> None:
    with pytest.raises(VdbError, match=reason):
        encode_json_to_hex({"message_type": message_type, "station_id": "EDVE", "fields": fields})


def test_blocks_must_be_a_list() -> None:
    with pytest.raises(VdbError, match="blocks is not a list"):
        encode_json_to_hex({"blocks": "AA"})


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


@given(data=st.data(), value=JSON_VALUES)
@settings(max_examples=150, deadline=None)
def test_any_value_anywhere_encodes_or_is_named(data: st.DataObject, value: Any) -> None:
    documents = [
        type1_document(),
        decode_hex_to_json(TYPE4_HEX),
        decode_hex_to_json(encode_block(station_data(), "EDVE").hex()),
    ]
    document: Any = through_json(data.draw(st.sampled_from(documents)))
    place: Any = document
    for _ in range(data.draw(st.integers(1, 7))):
        keys = list(place) if isinstance(place, dict) else range(len(place))
        if not keys:
            break
        key = data.draw(st.sampled_from(list(keys)))
        if not isinstance(place[key], (dict, list)) or data.draw(st.booleans()):
            break
        place = place[key]
    else:
        return
    if not isinstance(place, (dict, list)) or not place:
        return
    place[key] = value
    with suppress(VdbError):
        encode_json_to_hex(document)


@given(text=st.text("0123456789abcdefABCDEF \n01", max_size=500), burst=st.booleans())
@settings(max_examples=300, deadline=None)
def test_any_text_decodes_or_is_named(text: str, burst: bool) -> None:
    with suppress(VdbError):
        decode_hex_to_json(text, burst=burst)


def test_fec_of_a_document_is_that_of_its_bytes() -> None:
    text = encode_json_to_hex(type1_document(), burst=True)
    data = bytes.fromhex(text)[:-6]
    assert bytes.fromhex(text)[-6:] == encode_fec(data)
