"""Bursts as bits and symbols: round trips, noise, and what is refused."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_vdb.coding import radio
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.errors import FecError, VdbError

PAYLOADS = st.binary(min_size=0, max_size=222).map(lambda data: data + encode_fec(data))


@given(payload=PAYLOADS, ssid=st.integers(0, 7), offset=st.integers(0, 7))
@settings(deadline=None)
def test_symbol_round_trip_at_any_carrier_phase(payload: bytes, ssid: int, offset: int) -> None:
    symbols = radio.burst_symbols(payload, ssid)
    # 5 + 16 symbols before, 3 after, and the scrambled part completed to whole symbols.
    assert len(symbols) == 24 + -(-(25 + 8 * len(payload)) // 3)
    assert radio.decode_burst_symbols((symbols + offset) % 8) == radio.RadioBurst(ssid=ssid, payload=payload)


@given(payload=PAYLOADS, ssid=st.integers(0, 7))
@settings(deadline=None)
def test_bit_round_trip(payload: bytes, ssid: int) -> None:
    bits = radio.burst_bits(payload, ssid)
    assert len(bits) == 25 + 8 * len(payload)
    assert radio.decode_burst_bits(bits) == radio.RadioBurst(ssid=ssid, payload=payload)


def test_longest_burst_is_the_standards() -> None:
    bits = radio.burst_bits(bytes(228), 0)
    assert len(bits) + (-len(bits) % 3) <= 1851


def test_scrambler_period_is_that_of_a_primitive_polynomial() -> None:
    # x^15 + x + 1 is primitive: the sequence repeats after 2^15 - 1 bits and has 2^14 ones.
    sequence = radio.scrambler_sequence(2 * 32_767)
    assert np.array_equal(sequence[:32_767], sequence[32_767:])
    assert sequence[:32_767].sum() == 16_384


@pytest.mark.parametrize("place", range(25))
def test_a_wrong_training_bit_is_corrected(place: int) -> None:
    payload = b"GBAS" + encode_fec(b"GBAS")
    bits = radio.burst_bits(payload, 5)
    bits[place] ^= 1
    assert radio.decode_burst_bits(bits) == radio.RadioBurst(ssid=5, payload=payload, training_corrected=1)


def test_every_symbol_is_one_bit_from_its_neighbours() -> None:
    # Gray coding: a phase error of one step is one wrong bit.
    triples = [[first, second, third] for first in (0, 1) for second in (0, 1) for third in (0, 1)]
    phase = {int(radio.encode_symbols(np.array(bits, dtype=np.uint8))[0]): bits for bits in triples}
    assert sorted(phase) == list(range(8))
    for step in range(8):
        assert sum(a != b for a, b in zip(phase[step], phase[(step + 1) % 8], strict=True)) == 1


def test_what_cannot_be_sent_is_refused() -> None:
    with pytest.raises(VdbError, match="payload of 5 bytes"):
        radio.burst_bits(bytes(5), 0)
    with pytest.raises(VdbError, match="payload of 229 bytes"):
        radio.burst_bits(bytes(229), 0)
    with pytest.raises(VdbError, match="station slot identifier 8"):
        radio.burst_bits(bytes(6), 8)


def test_what_cannot_be_received_is_refused() -> None:
    payload = bytes(20)
    bits = radio.burst_bits(payload, 0)
    with pytest.raises(VdbError, match="training sequence alone has 25"):
        radio.decode_burst_bits(bits[:24])
    with pytest.raises(VdbError, match="transmission length of 160 bits, but 159 are there"):
        radio.decode_burst_bits(bits[:-1])
    symbols = radio.burst_symbols(payload, 0)
    with pytest.raises(VdbError, match="synchronisation"):
        radio.decode_burst_symbols(symbols[1:])
    with pytest.raises(VdbError, match="synchronisation"):
        radio.decode_burst_symbols(symbols[:3])


def test_training_beyond_repair_is_refused() -> None:
    bits = radio.burst_bits(bytes(20), 0)
    refused = 0
    for first in range(25):
        for second in range(first):
            damaged = bits.copy()
            damaged[[first, second]] ^= 1
            try:
                radio.decode_burst_bits(damaged)
            except FecError:
                refused += 1
            except VdbError:
                pass
    assert refused == 66


@given(bits=st.lists(st.integers(0, 1), max_size=2000))
@settings(max_examples=300, deadline=None)
def test_any_bits_give_a_burst_or_a_vdb_error(bits: list[int]) -> None:
    try:
        burst = radio.decode_burst_bits(np.array(bits, dtype=np.uint8))
    except VdbError:
        return
    assert 6 <= len(burst.payload) <= 228


@given(symbols=st.lists(st.integers(0, 7), max_size=700))
@settings(max_examples=300, deadline=None)
def test_any_symbols_give_a_burst_or_a_vdb_error(symbols: list[int]) -> None:
    with suppress(VdbError):
        radio.decode_burst_symbols(np.array(symbols, dtype=np.uint8))
