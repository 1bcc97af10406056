"""Bits of the VDB: the first bit on the air is the least significant bit of the first byte.

A message is handled as one Python integer whose bit 0 is the first bit on the air (fields are then shifts and masks),
a burst as an array of single bits in the order of the air.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BitArray = NDArray[np.uint8]


class BitWriter:
    """Collects fields, the first one in the lowest bits."""

    __slots__ = ("n_bits", "value")

    def __init__(self) -> None:
        self.value = 0
        self.n_bits = 0

    def put(self, raw: int, bits: int) -> None:
        """Append the lowest `bits` bits of `raw` (two's complement when negative)."""
        self.value |= (raw & ((1 << bits) - 1)) << self.n_bits
        self.n_bits += bits

    def to_bytes(self) -> bytes:
        """The bits as bytes, least significant bit first; a part byte is completed with zeros."""
        return self.value.to_bytes((self.n_bits + 7) // 8, "little")


class BitReader:
    """Hands out fields from the lowest bits upwards; never beyond the end."""

    __slots__ = ("n_bits", "position", "value")

    def __init__(self, data: bytes) -> None:
        self.value = int.from_bytes(data, "little")
        self.n_bits = 8 * len(data)
        self.position = 0

    @property
    def remaining(self) -> int:
        """Bits not read yet."""
        return self.n_bits - self.position

    def take(self, bits: int) -> int:
        """The next `bits` bits as an unsigned integer.

        Raises
        ------
        EOFError
            When fewer than `bits` bits remain.
        """
        start = self.position
        if start + bits > self.n_bits:
            raise EOFError(f"{bits} bits wanted at bit {start} of {self.n_bits}")
        self.position = start + bits
        return (self.value >> start) & ((1 << bits) - 1)


def byte_array(data: bytes) -> BitArray:
    """(n,) bytes, read-only: the one kind of array that compiled loops are given."""
    return np.frombuffer(bytes(data), dtype=np.uint8)


def bits_lsb_first(data: bytes) -> BitArray:
    """(8 n,) bits of data bytes in the order of the air: each byte least significant bit first."""
    return np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")


def bits_msb_first(data: bytes) -> BitArray:
    """(8 n,) bits, each byte most significant bit first: the order of the application FEC bytes."""
    return np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="big")


def bytes_lsb_first(bits: BitArray) -> bytes:
    """Bytes of (8 n,) bits in the order of the air; inverse of :func:`bits_lsb_first`."""
    return np.packbits(bits, bitorder="little").tobytes()


def bytes_msb_first(bits: BitArray) -> bytes:
    """Inverse of :func:`bits_msb_first`."""
    return np.packbits(bits, bitorder="big").tobytes()


def integer_lsb_first(bits: BitArray) -> int:
    """Unsigned integer of (n,) bits, the first the least significant."""
    return int.from_bytes(bytes_lsb_first(bits), "little")


def bits_of_integer(value: int, n_bits: int) -> BitArray:
    """(n_bits,) bits of an unsigned integer, least significant first."""
    return bits_lsb_first(value.to_bytes((n_bits + 7) // 8, "little"))[:n_bits]
