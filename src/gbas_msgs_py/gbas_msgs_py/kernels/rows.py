"""Tables from the numbers of a record and back, each number looked at once.

What is wrong is given back as a place, -1 where nothing is; words are made where they are needed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray, IntArray


class Codes(NamedTuple):
    """Columns that have one of some numbers, and which of them are the key of a row.

    Attributes
    ----------
    place : (K,) int array
        Their columns.
    known : (K, L) bool array
        Numbers that each knows.
    weights : (K,) int array
        Of their numbers in the row's key, 0 for what is not part of it.
    n_keys : int
        Keys there can be; 1 where rows have none.
    n_columns : int
        Columns of the rows.
    """

    place: IntArray
    known: BoolArray
    weights: IntArray
    n_keys: int
    n_columns: int


@compiled
def satellite_table(block: FloatArray, head: FloatArray, source_id: FloatArray) -> tuple[FloatArray, int]:
    """Rows of the satellites that have any value.

    Parameters
    ----------
    block : (C * N,) array
        Columns after one another.
    head : (H,) array
        What every row begins with.
    source_id : (N,) array

    Returns
    -------
    table : (rows, H + 1 + C) array
        One row of NaN behind the head where no satellite has a value.
    infinite : int
        First column with an infinite value.
    """
    n_sats, n_head = len(source_id), len(head)
    n_block = len(block) // n_sats
    present = np.zeros(n_sats, dtype=np.bool_)
    for column in range(n_block):
        for sat in range(n_sats):
            if not math.isnan(block[column * n_sats + sat]):
                present[sat] = True
    width, row = n_head + 1 + n_block, 0
    table = np.full((max(present.sum(), 1), width), np.nan)
    for sat in range(n_sats):
        if present[sat]:
            table[row, n_head] = source_id[sat]
            for column in range(n_block):
                table[row, n_head + 1 + column] = block[column * n_sats + sat]
            row += 1
    for row in range(len(table)):
        for column in range(n_head):
            table[row, column] = head[column]
    return table, first_infinite(table)


@compiled
def row_table(block: FloatArray, head: FloatArray, n_block: int) -> tuple[FloatArray, int]:
    """Rows of a record's own: as :func:`satellite_table`, of columns ``(C * rows,)`` after one another."""
    n_rows, n_head = len(block) // n_block, len(head)
    table = np.full((max(n_rows, 1), n_head + n_block), np.nan)
    for row in range(len(table)):
        for column in range(n_head):
            table[row, column] = head[column]
    for row in range(n_rows):
        for column in range(n_block):
            table[row, n_head + column] = block[column * n_rows + row]
    return table, first_infinite(table)


@compiled
def first_infinite(table: FloatArray) -> int:
    """First column of ``(rows, columns)`` with an infinite value."""
    found = -1
    for row in range(table.shape[0]):
        for column in range(table.shape[1] if found < 0 else found):
            if math.isinf(table[row, column]):
                found = column
                break
    return found


@compiled
def differing_head(table: FloatArray, n_head: int) -> int:
    """First of the columns that are one value for the table, NaN equal to NaN, in which rows differ."""
    found = -1
    for row in range(1, table.shape[0]):
        for column in range(n_head if found < 0 else found):
            first, value = table[0, column], table[row, column]
            if value != first and not (math.isnan(value) and math.isnan(first)):
                found = column
                break
    return found


@compiled
def is_marker(table: FloatArray, begin: int) -> bool:
    """Whether a table is one row with nothing from the column `begin` on."""
    if table.shape[0] != 1:
        return False
    for column in range(begin, table.shape[1]):
        if not math.isnan(table[0, column]):
            return False
    return True


@compiled
def satellite_columns(
    table: FloatArray, n_head: int, index_of: IntArray, n_sats: int
) -> tuple[FloatArray, int, int, int, int]:
    """What a table of satellites says.

    Parameters
    ----------
    table : (rows, n_head + 1 + C) array
    n_head : int
    index_of : (S,) int array
        Place on the satellite axis of each ranging source, -1 for those that nobody knows.
    n_sats : int

    Returns
    -------
    block : (C, n_sats) array
    differing : int
        First column of the head in which rows differ.
    infinite : int
        First column with an infinite value.
    unknown : int
        First row whose satellite nobody knows.
    twice : int
        First satellite with more than one row.
    """
    n_block = table.shape[1] - n_head - 1
    block = np.full((n_block, n_sats), np.nan)
    unknown, twice = -1, n_sats
    seen = np.zeros(n_sats, dtype=np.bool_)
    for row in range(0 if is_marker(table, n_head) else table.shape[0]):
        number = table[row, n_head]
        source = int(number) if 0.0 <= number < len(index_of) else -1
        sat = index_of[source] if source >= 0 and source == number else -1
        if sat < 0:
            if unknown < 0:
                unknown = row
            continue
        if seen[sat]:
            twice = min(twice, sat)
        seen[sat] = True
        for column in range(n_block):
            block[column, sat] = table[row, n_head + 1 + column]
    return block, differing_head(table, n_head), first_infinite(table), unknown, -1 if twice == n_sats else twice


@compiled
def row_columns(table: FloatArray, n_head: int) -> tuple[FloatArray, int, int]:
    """Columns ``(C, rows)`` of a table of rows, and its first differing and infinite columns."""
    n_rows = 0 if is_marker(table, n_head) else table.shape[0]
    block = np.empty((table.shape[1] - n_head, n_rows))
    for row in range(n_rows):
        for column in range(len(block)):
            block[column, row] = table[row, n_head + column]
    return block, differing_head(table, n_head), first_infinite(table)


@compiled
def check_codes(block: FloatArray, codes: Codes) -> tuple[int, int, int]:
    """Look for unknown codes and rows about the same.

    Parameters
    ----------
    block : (C * rows,) array
        Columns after one another.
    codes : Codes

    Returns
    -------
    row, coded : int
        Place of the first unknown code.
    twice : int
        First row with the key of one before it.
    """
    n_rows = 0 if len(codes.place) == 0 else len(block) // codes.n_columns
    seen = np.zeros(codes.n_keys // 64 + 1, dtype=np.uint64)
    keyed = codes.n_keys > 1
    for row in range(n_rows):
        key = 0
        for coded in range(len(codes.place)):
            value = block[codes.place[coded] * n_rows + row]
            number = int(value) if 0.0 <= value < codes.known.shape[1] else -1
            if number < 0 or number != value or not codes.known[coded, number]:
                return row, coded, -1
            key += codes.weights[coded] * number
        if keyed:
            bit = np.uint64(1) << np.uint64(key & 63)
            if seen[key >> 6] & bit:
                return -1, -1, row
            seen[key >> 6] |= bit
    return -1, -1, -1
