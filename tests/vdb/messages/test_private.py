"""Messages of ours with corrections of a second frequency: bits by hand, and there and back."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_vdb.errors import FieldError, VdbError
from gbas_vdb.messages import types as m
from gbas_vdb.messages.block import decode_block, encode_block, encode_body
from gbas_vdb.messages.describe import message_document, message_of


def lsb_first(*fields: tuple[int, int]) -> bytes:
    """Bytes of fields of (value, bits), each least significant bit first, by nothing but strings of bits."""
    text = "".join("".join(str(value >> bit & 1) for bit in range(bits)) for value, bits in fields)
    assert len(text) % 8 == 0
    return bytes(int(text[at : at + 8][::-1], 2) for at in range(0, len(text), 8))


CORRECTION = m.Correction100(
    ranging_source_id=76,
    iod=33,
    prc_m=-3.21,
    rrc_mps=0.125,
    sigma_pr_gnd_m=0.34,
    b_values_m=(0.1, -0.25, math.nan, 0.0),
)
BYTES = b"G5" + lsb_first(
    (6005, 14), (3, 2), (1, 5), (1, 3),  # Z-count 600.5 s, second of a pair, one source, 30 s
    (76, 8), (33, 8), (-321 & 0xFFFF, 16), (125, 16), (17, 8), (2, 8), (-5 & 0xFF, 8), (0x80, 8), (0, 8),
)  # fmt: skip


def message(*corrections: m.Correction100, flag: int = 0, kind: int = 0) -> m.Type8:
    return m.Type8(
        modified_z_count_s=600.5, additional_message_flag=flag, measurement_type=kind, measurements=corrections
    )


def test_bytes_by_hand() -> None:
    assert encode_body(message(CORRECTION, flag=3, kind=1)) == BYTES
    block = decode_block(encode_block(m.UnknownMessage(message_type=8, body=BYTES), "EDVE"))
    assert block.message == message(CORRECTION, flag=3, kind=1)
    assert block.message_type == 8
    assert not block.notes


def test_sizes() -> None:
    """A header of 6 bytes, a CRC of 4, a head of 5 and 11 a source: 18 fit in a burst of 222 bytes."""
    for number in (0, 1, 18):
        assert len(encode_block(message(*[CORRECTION] * number), "EDVE")) == 15 + 11 * number
    with pytest.raises(FieldError, match="19"):
        encode_block(message(*[CORRECTION] * 19), "EDVE")


def test_extremes_and_missing_values() -> None:
    least = m.Correction100(
        ranging_source_id=1, iod=0, prc_m=-327.67, rrc_mps=-32.767, sigma_pr_gnd_m=5.08,
        b_values_m=(6.35, -6.35, math.nan, math.nan),
    )  # fmt: skip
    invalid = m.Correction100(
        ranging_source_id=255, iod=255, prc_m=math.nan, rrc_mps=math.nan, sigma_pr_gnd_m=math.nan,
        b_values_m=(math.nan,) * 4,
    )  # fmt: skip
    sent = message(least, invalid)
    assert decode_block(encode_block(sent, "EDVE")).message == sent
    with pytest.raises(FieldError, match="prc_m"):
        encode_body(message(m.Correction100(**{**_fields(least), "prc_m": 328.0})))


def _fields(correction: m.Correction100) -> dict:  # type: ignore[type-arg]
    return {name: getattr(correction, name) for name in correction.__slots__}


@given(
    prc=st.integers(-32767, 32767), rrc=st.integers(-32767, 32767), sigma=st.integers(0, 254),
    b=st.lists(st.one_of(st.none(), st.integers(-127, 127)), min_size=4, max_size=4),
    source=st.integers(0, 255), iod=st.integers(0, 255), kind=st.integers(0, 7), tenths=st.integers(0, 11_999),
)  # fmt: skip
def test_every_count_comes_back(prc, rrc, sigma, b, source, iod, kind, tenths) -> None:  # type: ignore[no-untyped-def]
    body = b"G5" + lsb_first(
        (tenths, 14), (0, 2), (1, 5), (kind, 3), (source, 8), (iod, 8), (prc & 0xFFFF, 16), (rrc & 0xFFFF, 16),
        (sigma, 8), *((0x80 if each is None else each & 0xFF, 8) for each in b),
    )  # fmt: skip
    found = decode_block(encode_block(m.UnknownMessage(message_type=8, body=body), "EDVE")).message
    assert isinstance(found, m.Type8)
    assert found.measurements[0].prc_m == pytest.approx(prc / 100.0, abs=1e-12)
    assert encode_body(found) == body


@pytest.mark.parametrize("body", [b"", b"G", b"G4" + bytes(3), b"private"])
def test_messages_of_others_are_left_alone(body: bytes) -> None:
    block = decode_block(encode_block(m.UnknownMessage(message_type=8, body=body), "EDVE"))
    assert block.message == m.UnknownMessage(message_type=8, body=body)


@pytest.mark.parametrize("body", [BYTES[:-1], BYTES + b"\0", b"G5"])
def test_damaged_ones_are_refused(body: bytes) -> None:
    with pytest.raises(VdbError):
        decode_block(encode_block(m.UnknownMessage(message_type=8, body=body), "EDVE"))


def test_documents() -> None:
    sent = message(CORRECTION, kind=1)
    assert message_of(8, message_document(sent)) == sent
    other = m.UnknownMessage(message_type=8, body=b"other")
    assert message_of(8, message_document(other)) == other
