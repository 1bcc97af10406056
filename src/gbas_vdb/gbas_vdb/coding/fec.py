"""Forward error correction of a burst: the training sequence code and the Reed-Solomon code of the application data.

Source: Annex 10 Volume I, Appendix B, 3.6.3.3.4.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
import reedsolo
from numpy.typing import NDArray

from gbas_vdb.coding.bits import BitArray, byte_array
from gbas_vdb.coding.kernels.registers import FEC_BYTES as FEC_BYTES
from gbas_vdb.coding.kernels.registers import code_remainder
from gbas_vdb.errors import FecError, VdbError

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
    # what is not sent is zero and lies between data and FEC
    zeros = _DATA_BYTES - len(application_data)
    return code_remainder(byte_array(application_data), zeros, _generator_table()).to_bytes(FEC_BYTES, "little")


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
    if encode_fec(payload[:n_data]) == payload[n_data:]:  # nearly all bursts; the general decoder takes milliseconds
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


@cache
def _generator_table() -> NDArray[np.uint64]:
    """(256,) generator polynomial without its highest term times every byte, the highest power in the highest byte."""
    generator = [1]
    for exponent in range(FEC_BYTES):
        root = _power(_FIRST_ROOT + exponent)
        shifted, scaled = [*generator, 0], [0, *(_product(root, each) for each in generator)]
        generator = [one ^ other for one, other in zip(shifted, scaled, strict=True)]
    rows = [bytes(_product(byte, each) for each in generator[1:]) for byte in range(256)]
    return np.array([int.from_bytes(row, "big") for row in rows], dtype=np.uint64)


def _product(one: int, other: int) -> int:
    """Product of two elements of the field."""
    result = 0
    while other:
        if other & 1:
            result ^= one
        one <<= 1
        if one & 0x100:
            one ^= _FIELD_POLYNOMIAL
        other >>= 1
    return result


def _power(exponent: int) -> int:
    """Power of alpha."""
    return 1 if exponent == 0 else _product(2, _power(exponent - 1))


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
