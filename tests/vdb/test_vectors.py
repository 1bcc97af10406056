"""The published VDB examples, exact to the bit and symbol."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbas_vdb.coding import fec, radio
from gbas_vdb.coding.bits import BitWriter
from gbas_vdb.coding.crc import crc16, crc32q
from gbas_vdb.messages import tables
from gbas_vdb.messages.block import decode_blocks, encode_block
from gbas_vdb.messages.describe import decode_hex_to_json
from gbas_vdb.messages.fields import Choice, Number
from gbas_vdb.messages.types import Type1, Type4
from gbas_vdb.transmission.receive import decode_burst
from vdb_oracle import crc_remainder_bits, generator_polynomial

VECTORS = yaml.safe_load((Path(__file__).parents[1] / "tables" / "vdb_vectors.yaml").read_text())
TYPE4 = VECTORS["type4"]
APPLICATION_DATA = bytes.fromhex(TYPE4["application_data"])
PAYLOAD = APPLICATION_DATA + bytes.fromhex(TYPE4["application_fec"])
SCRAMBLED = "".join(TYPE4["scrambled"].split())
SCRAMBLED_BITS = SCRAMBLED[0] + "".join(f"{int(digit, 16):04b}" for digit in SCRAMBLED[1:])
SYMBOLS = "".join(TYPE4["symbols"].split())


def as_bits(text: str) -> np.ndarray:
    return np.array([int(character) for character in text if character in "01"], dtype=np.uint8)


def as_text(bits: np.ndarray) -> str:
    return "".join(str(bit) for bit in bits)


def test_type1_example_decodes_to_the_published_values() -> None:
    expected = VECTORS["type1"]
    blocks, errors = decode_blocks(bytes.fromhex(expected["block"]))
    assert errors == ()
    (block,) = blocks
    assert block.station_id == expected["station_id"]
    message = block.message
    assert isinstance(message, Type1)
    assert message.modified_z_count_s == expected["modified_z_count_s"]
    assert message.additional_message_flag == expected["additional_message_flag"]
    assert message.source_availability_s is None
    (measurement,) = message.measurements
    for name in ("ranging_source_id", "iod", "prc_m", "rrc_mps", "sigma_pr_gnd_m"):
        assert getattr(measurement, name) == expected[name]
    assert measurement.b_values_m[:3] == tuple(expected["b_values_m"][:3])
    assert math.isnan(measurement.b_values_m[3])


def test_type1_example_has_the_published_crc() -> None:
    data = bytes.fromhex(VECTORS["type1"]["block"])
    # Tables print the bit that is sent first at the right: the field as an integer.
    assert crc32q(data[:-4]) == int("".join(VECTORS["type1"]["crc"].split()), 2)
    (block,), _ = decode_blocks(data)
    assert encode_block(block.message, block.station_id) == data


@pytest.mark.parametrize("name", VECTORS["type2_codes"])
def test_type2_field_codes(name: str) -> None:
    published = VECTORS["type2_codes"][name]
    value = published.get("value")
    if "dms" in published:
        degrees, minutes, seconds = published["dms"]
        value = published["sign"] * (degrees + minutes / 60 + seconds / 3600)
    attribute = name
    if name.endswith("_deg"):
        attribute, value = name.removesuffix("_deg") + "_rad", math.radians(value)
    entry = next(entry for entry in tables.TYPE_2.entries if getattr(entry, "name", None) == attribute)
    assert isinstance(entry, (Number, Choice))
    code = "".join(published["code"].split())
    writer = BitWriter()
    writer.put(entry.to_raw(value), entry.bits)
    assert f"{writer.value:0{entry.bits}b}" == code
    # Angles through radians come back within rounding of the conversion.
    decoded = entry.from_raw(int(code, 2))
    assert decoded == value if isinstance(value, str) else decoded == pytest.approx(value, rel=1e-9)


def test_type4_burst_decodes_to_the_published_approaches() -> None:
    decoded = decode_burst(PAYLOAD)
    assert decoded.errors == ()
    assert decoded.corrected_bytes == 0
    (block,) = decoded.blocks
    assert (block.station_id, block.test, block.message_type, block.length) == ("CMJ", False, 4, 92)
    document = decode_hex_to_json(APPLICATION_DATA.hex())["blocks"][0]["fields"]["data_sets"]
    for data_set, expected in zip(document, TYPE4["approaches"], strict=True):
        found = {**data_set["fas"], **data_set}
        assert {name: found[name] for name in expected} == expected


def test_type4_encodes_to_the_published_bytes() -> None:
    (block,) = decode_burst(PAYLOAD).blocks
    assert isinstance(block.message, Type4)
    assert encode_block(block.message, "CMJ") == APPLICATION_DATA
    assert fec.encode_fec(APPLICATION_DATA).hex().upper() == TYPE4["application_fec"]


def test_published_burst_bits() -> None:
    bits = radio.burst_bits(PAYLOAD, TYPE4["ssid"])
    assert len(bits) == 809
    assert as_text(bits) == SCRAMBLED_BITS
    clear = radio.scrambled(bits)
    assert as_text(clear[20:25]) == TYPE4["training_parity"]
    assert int(as_text(clear[3:20])[::-1], 2) == TYPE4["transmission_length"]


def test_published_burst_symbols() -> None:
    symbols = radio.burst_symbols(PAYLOAD, TYPE4["ssid"])
    assert len(symbols) == 294
    assert as_text(symbols) == SYMBOLS


def test_published_bits_and_symbols_decode() -> None:
    expected = radio.RadioBurst(ssid=3, payload=PAYLOAD, training_corrected=0)
    assert radio.decode_burst_bits(as_bits(SCRAMBLED_BITS)) == expected
    assert radio.decode_burst_symbols(np.array([int(symbol) for symbol in SYMBOLS], dtype=np.uint8)) == expected


def test_fill_and_ramp_down_of_the_published_symbols() -> None:
    bits = radio.decode_symbols(np.array([int(symbol) for symbol in SYMBOLS], dtype=np.uint8))
    assert as_text(bits[15 + 48 + 809 :]) == "0" * 10


def test_scrambler_sequence() -> None:
    assert as_text(radio.scrambler_sequence()[:32]) == VECTORS["scrambler_first_bits"]


def test_generator_polynomial_of_the_second_formulation() -> None:
    assert bytes(generator_polynomial()) == bytes.fromhex(VECTORS["fec_generator"])


def test_catalogued_check_values() -> None:
    check = VECTORS["crc_check"]
    text = check["text"].encode()
    assert crc16(text) == check["crc16_kermit"]
    # The catalogue's CRC-32Q feeds bytes most significant bit first: reverse the bits of bytes and of the result.
    reversed_bits = bytes(int(f"{byte:08b}"[::-1], 2) for byte in text)
    assert int(f"{crc32q(reversed_bits):032b}"[::-1], 2) == check["crc32q_msb_first"]
    msb_first = "".join(f"{byte:08b}" for byte in text)
    assert int(crc_remainder_bits(msb_first, 0x1814141AB), 2) == check["crc32q_msb_first"]
