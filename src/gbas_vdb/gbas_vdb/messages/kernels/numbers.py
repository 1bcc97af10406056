"""Quantities and the counts they are sent as: one field, and tables of records of fields at fixed places."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray, IntArray

NEAREST: Final = 0
UP: Final = 1
DOWN: Final = 2
# A value that was computed from counts (0.02 * 3) must round up to the same counts: this part of one count is allowed.
ROUNDING_SLACK: Final = 1e-6
# Nothing on the VDB is larger than this; beyond it arithmetic could overflow before the bounds are looked at.
LARGEST: Final = 1e15
NO_CODE: Final = -(2**62)


class Places(NamedTuple):
    """Numbers of a record, each at a fixed place: one row a field.

    Attributes
    ----------
    at, bits : (F,) int arrays
        First bit and number of bits.
    numerator, denominator, offset : (F,) arrays
        Value = offset + numerator / denominator * raw.
    rounding, low, high : (F,) int arrays
        NEAREST, UP or DOWN; bounds of the raw count.
    of_missing, of_infinity : (F,) int arrays
        Raw counts that stand for them; NO_CODE where there is none.
    integer, signed, saturates : (F,) bool arrays
    valid_if : (F,) int array
        The field without which this one is missing and sent as zero; -1 where it stands alone.
    n_bytes : int
        Of the record.
    """

    at: IntArray
    bits: IntArray
    numerator: FloatArray
    denominator: FloatArray
    offset: FloatArray
    rounding: IntArray
    low: IntArray
    high: IntArray
    of_missing: IntArray
    of_infinity: IntArray
    integer: BoolArray
    signed: BoolArray
    saturates: BoolArray
    valid_if: IntArray
    n_bytes: int


@compiled
def counts_of(value: float, numerator: float, denominator: float, offset: float, rounding: int) -> int:
    """Raw count of a quantity: to the nearest, or such that rounding never makes it optimistic."""
    counts = (value - offset) * denominator / numerator
    if rounding == UP:
        return math.ceil(counts - ROUNDING_SLACK)
    if rounding == DOWN:
        return math.floor(counts + ROUNDING_SLACK)
    return int(np.rint(counts))


@compiled
def quantity_of(raw: int, numerator: float, denominator: float, offset: float) -> float:
    """Quantity of a raw count.

    The offset is added before the division: one rounding, so that decimal values come out as they are written.
    """
    return (offset * denominator + raw * numerator) / denominator


@compiled
def special_raw(value: float, depends_on: float, of_missing: int, of_infinity: int) -> int:
    """Raw count of what is no quantity: NO_CODE for what cannot be sent, 0 where what it depends on is missing."""
    if math.isnan(value):
        return 0 if math.isnan(depends_on) else of_missing
    return of_infinity if value > 0.0 else NO_CODE


@compiled
def bounded_raw(raw: int, low: int, high: int, of_missing: int, of_infinity: int, saturates: bool) -> int:
    """The count of a quantity; NO_CODE where it is out of bounds or a code."""
    if low <= raw <= high:
        return NO_CODE if raw in (of_missing, of_infinity) else raw
    return high if raw > high and saturates else NO_CODE


@compiled
def pack(values: FloatArray, places: Places) -> tuple[NDArray[np.uint8], int]:
    """Bytes of records, the first bit sent the lowest.

    Parameters
    ----------
    values : (n, F) array
        What is missing is NaN.
    places : Places

    Returns
    -------
    data : (n * n_bytes,) array
    refused : int
        Place in the flattened `values` of the first that cannot be sent; -1 when there is none.
    """
    data = np.zeros(len(values) * places.n_bytes, dtype=np.uint8)
    for row in range(len(values)):
        begin = row * places.n_bytes
        for field in range(len(places.at)):
            value = values[row, field]
            of_missing, of_infinity = places.of_missing[field], places.of_infinity[field]
            if not math.isfinite(value):
                depends = places.valid_if[field]
                raw = special_raw(value, 0.0 if depends < 0 else values[row, depends], of_missing, of_infinity)
            elif abs(value) < LARGEST:
                raw = counts_of(
                    value, places.numerator[field], places.denominator[field], places.offset[field],
                    places.rounding[field],
                )  # fmt: skip
                inexact = places.integer[field] and raw + places.offset[field] != value
                raw = bounded_raw(
                    raw, places.low[field], places.high[field], of_missing, of_infinity, places.saturates[field]
                )
                raw = NO_CODE if inexact else raw
            else:
                raw = NO_CODE
            if raw == NO_CODE:
                return data, row * len(places.at) + field
            at = places.at[field]
            left = (raw & ((1 << places.bits[field]) - 1)) << (at & 7)
            place = begin + (at >> 3)
            while left:
                data[place] |= np.uint8(left & 0xFF)
                left >>= 8
                place += 1
    return data, -1


@compiled
def unpack(data: NDArray[np.uint8], places: Places) -> tuple[FloatArray, int, int]:
    """Records ``(n, F)`` of bytes; inverse of :func:`pack`.

    Returns
    -------
    values : (n, F) array
    refused : int
        Place in the flattened `values` of the first count the standard does not allow, -1 when there is none; and
        that count, unsigned.
    """
    n_fields = len(places.at)
    values = np.full((len(data) // places.n_bytes, n_fields), np.nan)
    for row in range(len(values)):
        begin = row * places.n_bytes
        for field in range(n_fields):
            read, at, bits = 0, places.at[field], places.bits[field]
            for place in range((at & 7) + bits + 7 >> 3):
                read |= int(data[begin + (at >> 3) + place]) << (8 * place)
            read = (read >> (at & 7)) & ((1 << bits) - 1)
            raw = read - (1 << bits) if places.signed[field] and read >> (bits - 1) else read
            if raw == places.of_missing[field]:
                continue
            if raw == places.of_infinity[field]:
                values[row, field] = math.inf
            elif places.low[field] <= raw <= places.high[field]:
                values[row, field] = quantity_of(
                    raw, places.numerator[field], places.denominator[field], places.offset[field]
                )
            else:
                return values, row * n_fields + field, read
        for field in range(n_fields):
            if places.valid_if[field] >= 0 and math.isnan(values[row, places.valid_if[field]]):
                values[row, field] = np.nan
    return values, -1, 0
