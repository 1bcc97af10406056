"""The two forward error correction codes, against polynomial arithmetic."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import reedsolo
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_vdb.coding.bits import bits_of_integer
from gbas_vdb.coding.fec import TRAINING_MATRIX, correct_fec, correct_training, encode_fec, training_parity
from gbas_vdb.errors import FecError, VdbError
from vdb_oracle import codeword_values_at_roots, fec_by_division

APPLICATION_DATA = st.binary(min_size=0, max_size=222)
LENGTHS = (1, 10, 92, 222)


def sample(n_bytes: int, seed: int = 0) -> bytes:
    return np.random.default_rng(seed).bytes(n_bytes)


@given(data=APPLICATION_DATA)
@settings(max_examples=40, deadline=None)
def test_fec_is_the_remainder_of_the_division(data: bytes) -> None:
    assert encode_fec(data) == fec_by_division(data)


@given(data=APPLICATION_DATA)
@settings(max_examples=30, deadline=None)
def test_encoded_polynomial_vanishes_at_the_roots(data: bytes) -> None:
    assert codeword_values_at_roots(data, encode_fec(data)) == [0] * 6


@given(data=APPLICATION_DATA)
@settings(deadline=None)
def test_fec_agrees_with_the_library(data: bytes) -> None:
    codec = reedsolo.RSCodec(6, nsize=255, fcr=120, prim=0x187)
    assert encode_fec(data) == bytes(codec.encode(data + bytes(249 - len(data)))[-6:][::-1])


@given(data=APPLICATION_DATA)
def test_no_error_needs_no_correction(data: bytes) -> None:
    assert correct_fec(data + encode_fec(data)) == (data, 0)


@pytest.mark.parametrize("n_bytes", LENGTHS)
def test_every_single_wrong_byte_is_corrected(n_bytes: int) -> None:
    data = sample(n_bytes)
    payload = data + encode_fec(data)
    for place in range(len(payload)):
        for error in (1, 0x80, 0xFF):
            damaged = bytearray(payload)
            damaged[place] ^= error
            assert correct_fec(bytes(damaged)) == (data, 1)


@given(
    data=st.binary(min_size=1, max_size=222),
    errors=st.lists(st.tuples(st.integers(0, 10_000), st.integers(1, 255)), min_size=1, max_size=3),
)
@settings(max_examples=300, deadline=None)
def test_any_three_wrong_bytes_are_corrected(data: bytes, errors: list[tuple[int, int]]) -> None:
    payload = data + encode_fec(data)
    by_place = {place % len(payload): error for place, error in errors}
    damaged = bytearray(payload)
    for place, error in by_place.items():
        damaged[place] ^= error
    assert correct_fec(bytes(damaged)) == (data, len(by_place))


def test_more_wrong_bytes_give_an_error_or_another_codeword() -> None:
    # Four errors are beyond the code: it refuses, or lands on another codeword. Nothing else may come out.
    random = np.random.default_rng(4)
    refused = 0
    for _ in range(400):
        data = random.bytes(100)
        damaged = bytearray(data + encode_fec(data))
        for place in random.choice(len(damaged), size=int(random.integers(4, 9)), replace=False):
            damaged[place] ^= int(random.integers(1, 256))
        try:
            found, corrected = correct_fec(bytes(damaged))
        except FecError:
            refused += 1
            continue
        assert 1 <= corrected <= 3
        whole = found + encode_fec(found)
        assert sum(a != b for a, b in zip(whole, damaged, strict=True)) == corrected
    # Of 255 places 106 are sent: a correction elsewhere is refused too, so more than 9 in 10 such words are.
    assert refused > 360


@pytest.mark.parametrize("n_bytes", [0, 5])
def test_payload_shorter_than_the_fec_is_refused(n_bytes: int) -> None:
    with pytest.raises(VdbError, match="outside 0 to 222"):
        correct_fec(bytes(n_bytes))


def test_payload_longer_than_a_burst_is_refused() -> None:
    with pytest.raises(VdbError, match="application data of 223 bytes outside 0 to 222"):
        correct_fec(bytes(229))
    with pytest.raises(VdbError, match="application data of 223 bytes outside 0 to 222"):
        encode_fec(bytes(223))


# ---- training sequence ----


def header(ssid: int, length: int) -> np.ndarray:
    return np.concatenate([bits_of_integer(ssid, 3), bits_of_integer(length, 17)])


@given(ssid=st.integers(0, 7), length=st.integers(0, 2**17 - 1))
def test_training_parity_is_the_matrix_product(ssid: int, length: int) -> None:
    bits = header(ssid, length)
    expected = [sum(int(a) * int(b) for a, b in zip(row, bits, strict=True)) % 2 for row in TRAINING_MATRIX]
    assert training_parity(bits).tolist() == expected


@given(ssid=st.integers(0, 7), length=st.integers(0, 2**17 - 1))
@settings(max_examples=30, deadline=None)
def test_every_single_training_error_is_corrected(ssid: int, length: int) -> None:
    bits = header(ssid, length)
    code = np.concatenate([bits, training_parity(bits)])
    corrected, n_corrected = correct_training(code)
    assert n_corrected == 0
    assert np.array_equal(corrected, bits)
    for place in range(25):
        damaged = code.copy()
        damaged[place] ^= 1
        corrected, n_corrected = correct_training(damaged)
        assert n_corrected == 1
        assert np.array_equal(corrected, bits)


def test_double_training_errors() -> None:
    # 25 columns of 31 possible non-zero syndromes: pairs whose sum is one of the other six are noticed. The standard
    # says 75 of 300; the matrix it prints gives 66.
    bits = header(3, 784)
    code = np.concatenate([bits, training_parity(bits)])
    noticed = 0
    for first, second in itertools.combinations(range(25), 2):
        damaged = code.copy()
        damaged[[first, second]] ^= 1
        try:
            corrected, _ = correct_training(damaged)
        except FecError:
            noticed += 1
        else:
            assert not np.array_equal(corrected, bits)
    assert noticed == 66
