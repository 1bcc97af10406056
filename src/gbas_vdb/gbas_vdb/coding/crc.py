"""The VDB's two cyclic redundancy checks, table driven.

Both registers shift towards their most significant bit and are fed with bits in the order of the air. Bytes hold the
first bit on the air in their least significant bit, so both are computed with reflected tables, and the register comes
out reflected: its bit 0 is the coefficient of the highest power, which is transmitted first. The result is therefore
the integer of the transmitted field, least significant bit first, like any other field.

Source: Annex 10 Volume I, Appendix B, 3.6.3.3.3 (CRC-32Q) and 3.6.3.2.2.3 (ephemeris CRC).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_vdb.coding.bits import byte_array
from gbas_vdb.coding.kernels.registers import reflected_remainder

# x^32 + x^31 + x^24 + x^22 + x^16 + x^14 + x^8 + x^7 + x^5 + x^3 + x + 1 without its highest term.
CRC32_POLYNOMIAL: Final = 0x814141AB
# x^16 + x^12 + x^5 + 1 without its highest term.
CRC16_POLYNOMIAL: Final = 0x1021


def _reflected_table(polynomial: int, width: int) -> NDArray[np.uint32]:
    reflected = int(f"{polynomial:0{width}b}"[::-1], 2)
    table = []
    for byte in range(256):
        register = byte
        for _ in range(8):
            register = (register >> 1) ^ (reflected if register & 1 else 0)
        table.append(register)
    return np.array(table, dtype=np.uint32)


_TABLE_32: Final = _reflected_table(CRC32_POLYNOMIAL, 32)
_TABLE_16: Final = _reflected_table(CRC16_POLYNOMIAL, 16)


def crc32q(data: bytes) -> int:
    """CRC of a message block or FAS block: the 32-bit field, first transmitted bit least significant."""
    return reflected_remainder(byte_array(data), _TABLE_32)


def crc16(data: bytes) -> int:
    """Ephemeris CRC over bytes fed least significant bit first: the 16-bit field of the type 1 message."""
    return reflected_remainder(byte_array(data), _TABLE_16)
