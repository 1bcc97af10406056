"""Records of numbers at fixed places: whole tables of them at once.

Corrections are by far the most of what is sent, and all of this kind. :class:`FixedPlaces` is the codec of such a
layout, :class:`Items` a table that is used like a tuple of records.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from gbas_core.record import FloatArray, IntArray
from gbas_vdb.coding.bits import byte_array
from gbas_vdb.errors import FieldError
from gbas_vdb.messages.fields import ROUNDINGS, Count, Number, Spare, Vector, is_missing
from gbas_vdb.messages.kernels.numbers import NO_CODE, Places, unpack

if TYPE_CHECKING:
    from gbas_vdb.messages.layout import Layout


class FixedPlaces:
    """Codec of a layout of numbers whose places do not depend on the record: whole tables of records at once.

    Attributes
    ----------
    n_numbers : int
    places : Places
        As the compiled loops have it.
    """

    def __init__(self, layout: Layout) -> None:
        self._record = layout.record
        entries = [_number_of(entry) if isinstance(entry, Count) else entry for entry in layout.leading]
        self._entries = [entry for entry in entries if isinstance(entry, Number | Vector)]
        self._numbers: list[Number] = []
        at, begins = 0, []
        for entry in entries:
            assert isinstance(entry, Number | Spare | Vector)
            items: list[Number | Spare] = [entry.item] * entry.length if isinstance(entry, Vector) else [entry]
            for item in items:
                if isinstance(item, Number):
                    self._numbers.append(item)
                    begins.append(at)
                at += item.bits
        self.n_numbers = len(self._numbers)
        self.places = _places(self._numbers, begins, at // 8)

    def row_of(self, record: Any) -> list[Any]:
        """The numbers of a record, in the order of the columns; None where they are missing and that is the way."""
        row = []
        for entry in self._entries:
            value = getattr(record, entry.name)
            if isinstance(entry, Vector):
                check_length(entry, value)
                row.extend([_number(entry.item, each) for each in value])
            else:
                row.append(_number(entry, (len(value) or None) if entry.counts else value))
        return row

    def values(self, row: FloatArray) -> dict[str, Any]:
        """The fields of the record of ``(F,)`` numbers."""
        values, numbers, at = {}, row.tolist(), 0
        for entry in self._entries:
            if isinstance(entry, Vector):
                end = at + entry.length
                values[entry.name] = tuple([_value(entry.item, each) for each in numbers[at:end]])
            else:
                end = at + 1
                values[entry.name] = _value(entry, numbers[at])
            at = end
        return values

    def unpack(self, data: bytes) -> FloatArray:
        """Numbers ``(n, F)`` of their bits; raises FieldError as :func:`decode` does."""
        rows, refused, raw = unpack(byte_array(data), self.places)
        if refused >= 0:
            number = self._numbers[refused % self.n_numbers]
            number.from_raw(raw)
            raise FieldError(f"{number.name}: count {raw} is not allowed")
        return rows

    def record(self, row: FloatArray) -> Any:
        """The record of ``(F,)`` numbers."""
        return self._record(**self.values(row))


def check_length(entry: Vector, values: Any) -> None:
    if len(values) != entry.length:
        raise FieldError(f"{entry.name} has {len(values)} values, not {entry.length}")


def _number(number: Number, value: Any) -> Any:
    """A value of a record as a table has it; missing in the other's way is minus infinity, which nothing can send."""
    if (value is None or value != value) and number.valid_if is None and type(value) is not type(number.missing_value):
        return -math.inf
    return value


def _number_of(count: Count) -> Number:
    """How many items a group has, as a number that is missing when there are none."""
    return Number(name=count.of, bits=count.bits, maximum=count.maximum, codes={0: None}, counts=True)


def _value(number: Number, value: float) -> Any:
    """A number as a record has it: missing is one object, so that records compare by value."""
    if value != value:
        return number.missing_value
    return int(value) if number.scale is None else value


def _places(numbers: Sequence[Number], begins: Sequence[int], n_bytes: int) -> Places:
    names = [number.name for number in numbers]

    def code(number: Number, wanted: Callable[[Any], bool]) -> int:
        return next((raw for raw, value in number.codes.items() if wanted(value)), NO_CODE)

    def whole(values: Iterable[int]) -> IntArray:
        return np.array(list(values), dtype=np.int64)

    return Places(
        at=whole(begins),
        bits=whole(number.bits for number in numbers),
        numerator=np.array([number.ratio[0] for number in numbers]),
        denominator=np.array([number.ratio[1] for number in numbers]),
        offset=np.array([float(number.offset) for number in numbers]),
        rounding=whole(ROUNDINGS[number.rounding] for number in numbers),
        low=whole(number.bounds[0] for number in numbers),
        high=whole(number.bounds[1] for number in numbers),
        of_missing=whole(code(number, is_missing) for number in numbers),
        of_infinity=whole(code(number, lambda value: value == math.inf) for number in numbers),
        integer=np.array([number.scale is None for number in numbers]),
        signed=np.array([number.signed for number in numbers]),
        saturates=np.array([number.saturates for number in numbers]),
        valid_if=whole(-1 if number.valid_if is None else names.index(number.valid_if) for number in numbers),
        n_bytes=n_bytes,
    )


class Items(Sequence[Any]):
    """Records of a layout of numbers at fixed places, as a table; a record is made when it is asked for.

    Equal to a tuple of equal records.

    Attributes
    ----------
    layout : Layout
    rows : (n, F) array
        Their numbers in the order of transmission; NaN for what is missing. Not to be written to.
    """

    __slots__ = ("layout", "rows")

    def __init__(self, layout: Layout, rows: FloatArray) -> None:
        self.layout, self.rows = layout, rows

    @classmethod
    def of(cls, layout: Layout, records: Sequence[Any]) -> Items:
        """The same as a table."""
        if isinstance(records, cls):
            return records
        numbers = [layout.places.row_of(record) for record in records]
        return cls(layout, np.array(numbers, dtype=np.float64).reshape(len(numbers), layout.places.n_numbers))

    @overload
    def __getitem__(self, index: int) -> Any: ...
    @overload
    def __getitem__(self, index: slice) -> Items: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return Items(self.layout, self.rows[index])
        return self.layout.places.record(self.rows[index])

    def take(self, rows: Sequence[int]) -> Items:
        """Some of them, in this order."""
        return Items(self.layout, self.rows[rows])

    def __len__(self) -> int:
        return len(self.rows)

    def __add__(self, other: Sequence[Any]) -> Items:
        return Items(self.layout, np.concatenate([self.rows, Items.of(self.layout, other).rows]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Items | tuple) or len(other) != len(self):
            return False
        if isinstance(other, Items) and other.layout is self.layout:
            return np.array_equal(other.rows, self.rows, equal_nan=True)
        return tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))
