"""Forward error correction of a burst: the training sequence code and the Reed-Solomon code of the application data.

Source: Annex 10 Volume I, Appendix B, 3.6.3.3.4.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
import reedsolo
from numpy.typing import NDArray

from gbas_vdb.coding.bits import BitArray
from gbas_vdb.errors import FecError, VdbError

FEC_BYTES: Final = 6
MAX_APPLICATION_BYTES: Final = 222
_CODE_BYTES: Final = 255
_DATA_BYTES: Final = _CODE_BYTES - FEC_BYTES
# x^8 + x^7 + x^2 + x + 1; the generator's roots are alpha^120 to alpha^125.
_FIELD_POLYNOMIAL: Final = 0x187
_FIRST_ROOT: Final = 120


@cache
def _codec() -> reedsolo.RSCodec:
    return reedsolo.RSCodec(FEC_BYTES, nsize=_CODE_BYTES, fcr=_FIRST_ROOT, prim=_FIELD_POLYNOMIAL)


def encode_fec(application_data: bytes) -> bytes:
    """The six FEC bytes of application data, in the order of transmission (b0 first, each most significant bit first).

    Raises
    ------
    VdbError
        For more than 222 bytes.
    """
    _check_length(len(application_data))
    packed = np.bitwise_xor.reduce(_parity_table()[np.arange(len(application_data)), _as_array(application_data)])
    return int(packed).to_bytes(8, "little")[:FEC_BYTES]


def syndromes(payload: bytes) -> int:
    """The six syndromes of application data and FEC, packed in an integer; zero when there is no error.

    The code is linear: the contribution of each byte at each place is tabulated, and the sum is an exclusive or. This
    costs microseconds where the general decoder takes milliseconds, and nearly all bursts have no error.
    """
    return int(np.bitwise_xor.reduce(_syndrome_table()[_places(len(payload)), _as_array(payload)]))


def correct_fec(payload: bytes) -> tuple[bytes, int]:
    """Application data of a burst's application data and FEC, errors repaired.

    Parameters
    ----------
    payload : bytes
        Application data and the six FEC bytes.

    Returns
    -------
    application_data : bytes
    corrected : int
        Number of bytes that were wrong, FEC bytes included.

    Raises
    ------
    FecError
        When more than three bytes are wrong and this is noticed.
    VdbError
        When the length is not that of a burst.
    """
    n_data = len(payload) - FEC_BYTES
    _check_length(n_data)
    if syndromes(payload) == 0:
        return payload[:n_data], 0
    fill = bytes(_DATA_BYTES - n_data)
    codeword = payload[:n_data] + fill + payload[n_data:][::-1]
    try:
        message, _, places = _codec().decode(codeword)
    except reedsolo.ReedSolomonError as error:
        raise FecError(f"application FEC cannot repair the burst: {error}") from None
    if any(n_data <= place < _DATA_BYTES for place in places):
        raise FecError("application FEC cannot repair the burst: it finds errors in the part that is not sent")
    return bytes(message[:n_data]), len(places)


def _check_length(n_data: int) -> None:
    if not 0 <= n_data <= MAX_APPLICATION_BYTES:
        raise VdbError(f"application data of {n_data} bytes outside 0 to {MAX_APPLICATION_BYTES}")


def _as_array(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, dtype=np.uint8)


@cache
def _places(n_payload: int) -> NDArray[np.intp]:
    """Degree in the code polynomial of each payload byte: data from the highest down, then FEC b0 first."""
    n_data = n_payload - FEC_BYTES
    return np.concatenate([_CODE_BYTES - 1 - np.arange(n_data), np.arange(FEC_BYTES)])


@cache
def _powers() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Powers of alpha by exponent (twice round), and exponents by power (that of zero is not meant to be used)."""
    exponential = np.zeros(2 * 255, dtype=np.int64)
    logarithm = np.zeros(256, dtype=np.int64)
    value = 1
    for exponent in range(255):
        exponential[exponent] = exponential[exponent + 255] = value
        logarithm[value] = exponent
        value <<= 1
        if value & 0x100:
            value ^= _FIELD_POLYNOMIAL
    return exponential, logarithm


def _times_all_bytes(factors: NDArray[np.int64]) -> NDArray[np.int64]:
    """(..., 256) products of field elements with every byte value."""
    exponential, logarithm = _powers()
    values = np.arange(256)
    products = exponential[(logarithm[factors][..., None] + logarithm[values]) % 255]
    return np.where((factors[..., None] == 0) | (values == 0), 0, products)


def _packed(parts: NDArray[np.int64]) -> NDArray[np.uint64]:
    """(n, 256) integers of (n, 6, 256) bytes, the first in the lowest eight bits."""
    shifts = np.uint64(8) * np.arange(FEC_BYTES, dtype=np.uint64)
    packed: NDArray[np.uint64] = np.bitwise_or.reduce(parts.astype(np.uint64) << shifts[:, None], axis=1)
    return packed


@cache
def _syndrome_table() -> NDArray[np.uint64]:
    """(255, 256) packed syndromes of each byte value at each degree."""
    exponential, _ = _powers()
    degrees = np.arange(_CODE_BYTES)[:, None]
    roots = _FIRST_ROOT + np.arange(FEC_BYTES)
    return _packed(_times_all_bytes(exponential[(roots * degrees) % 255]))


@cache
def _parity_table() -> NDArray[np.uint64]:
    """(222, 256) packed FEC bytes of each byte value at each place of the application data.

    The generator matrix of the code, multiplied out: reedsolo's encoder is a Python loop over 249 times 6 products and
    costs several hundred microseconds a burst on a small machine, this costs about 5. Rows come from reedsolo itself.
    """
    rows = np.zeros((MAX_APPLICATION_BYTES, FEC_BYTES), dtype=np.int64)
    for place in range(MAX_APPLICATION_BYTES):
        unit = bytearray(_DATA_BYTES)
        unit[place] = 1
        rows[place] = list(_codec().encode(unit)[: _DATA_BYTES - 1 : -1])
    return _packed(_times_all_bytes(rows))


# One row a parity bit, over SSID and transmission length in the order of the air.
TRAINING_MATRIX: Final[NDArray[np.uint8]] = np.array(
    [
        [int(bit) for bit in row]
        for row in (
            "00000000111111111111",
            "00111111000011111111",
            "11000111001100001111",
            "11011011010100110011",
            "01101001111001010101",
        )
    ],
    dtype=np.uint8,
)
_TRAINING_COLUMNS: Final = [*map(tuple, TRAINING_MATRIX.T.tolist()), *map(tuple, np.eye(5, dtype=int).tolist())]


def training_parity(bits: BitArray) -> BitArray:
    """(5,) parity bits of the (20,) bits of SSID and transmission length."""
    return (TRAINING_MATRIX @ bits) % 2


def correct_training(bits: BitArray) -> tuple[BitArray, int]:
    """(20,) bits of SSID and transmission length of (25,) received bits, one error repaired.

    Returns
    -------
    bits : (20,) array
    corrected : int
        Number of bits that were wrong (0 or 1).

    Raises
    ------
    FecError
        When more than one bit is wrong and this is noticed.
    """
    syndrome = tuple(((training_parity(bits[:20]) + bits[20:]) % 2).tolist())
    if not any(syndrome):
        return bits[:20], 0
    if syndrome not in _TRAINING_COLUMNS:
        raise FecError("training sequence FEC cannot repair the station slot and the transmission length")
    repaired = bits.copy()
    repaired[_TRAINING_COLUMNS.index(syndrome)] ^= 1
    return repaired[:20], 1
