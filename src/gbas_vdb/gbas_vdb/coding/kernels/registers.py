"""Shift registers fed with bytes: cyclic redundancy checks and the Reed-Solomon remainder."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.compiled import compiled

FEC_BYTES: Final = 6
_WHOLE: Final = np.uint64((1 << 8 * FEC_BYTES) - 1)
_BYTE: Final = np.uint64(8)
_TOP: Final = np.uint64(8 * (FEC_BYTES - 1))


@compiled
def reflected_remainder(data: NDArray[np.uint8], table: NDArray[np.uint32]) -> int:
    """CRC register after bytes fed least significant bit first; `table` ``(256,)`` is that of the reflected code."""
    register = np.uint32(0)
    for byte in data:
        register = np.uint32(table[(register ^ byte) & np.uint32(0xFF)] ^ (register >> np.uint32(8)))
    return int(register)


@compiled
def code_remainder(data: NDArray[np.uint8], n_zeros: int, table: NDArray[np.uint64]) -> int:
    """Remainder of data and zeros behind, divided by the generator of the Reed-Solomon code.

    Parameters
    ----------
    data : (n,) array
        Coefficients, the highest power first.
    n_zeros : int
    table : (256,) array
        The generator without its highest term times every byte, the highest power in the highest byte.

    Returns
    -------
    int
        Six bytes, the lowest power in the lowest byte.
    """
    register = np.uint64(0)
    for place in range(len(data) + n_zeros):
        byte = np.uint64(data[place]) if place < len(data) else np.uint64(0)
        register = ((register << _BYTE) & _WHOLE) ^ table[(register >> _TOP) ^ byte]
    return int(register)
