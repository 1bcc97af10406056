"""Layouts of records: entries in the order of transmission, and the interpreter between records and bits.

:func:`encode` and :func:`decode` interpret the entries of a :class:`Layout`; records of a fixed length without groups
have a quicker way to the same bits (:class:`FixedPlaces`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

from gbas_vdb.coding.bits import BitReader, BitWriter
from gbas_vdb.errors import FieldError, VdbError
from gbas_vdb.messages.fields import Choice, Count, Letter, Number, Spare, Switch, Text, Vector, is_missing


@dataclass(frozen=True, kw_only=True)
class Group:
    """Items of one layout, as many as its :class:`Count` says: a tuple of records in the record."""

    name: str
    layout: Layout
    doc: str = ""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A record inside a record."""

    name: str
    layout: Layout


Entry = Number | Choice | Letter | Text | Spare | Vector | Switch | Count | Group | Part


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A record type and its entries in the order of transmission."""

    record: Callable[..., Any]
    entries: tuple[Entry, ...]

    @cached_property
    def bits(self) -> int:
        """Bits of a record without those of its groups."""
        return sum(_bits_of(entry) for entry in self.entries)

    @cached_property
    def conditional(self) -> tuple[Number, ...]:
        """Entries that are missing when another is."""
        return tuple(entry for entry in self.entries if isinstance(entry, Number) and entry.valid_if is not None)

    @cached_property
    def switched(self) -> tuple[Switch, ...]:
        """Entries decoded after the others."""
        return tuple(entry for entry in self.entries if isinstance(entry, Switch))

    @cached_property
    def fixed(self) -> FixedPlaces | None:
        """The quick codec, where every field is a number at a fixed place; None elsewhere."""
        simple = all(isinstance(entry, Number | Spare | Vector) for entry in self.entries)
        return FixedPlaces(self) if simple else None


def _bits_of(entry: Entry) -> int:
    match entry:
        case Group():
            return 0
        case Part():
            return entry.layout.bits
        case Vector():
            return entry.length * entry.item.bits
        case Switch():
            return entry.default.bits
        case _:
            return entry.bits


class FixedPlaces:
    """Codec of a layout of numbers whose places do not depend on the record: bits move as one integer.

    Corrections are by far the most of what is sent, and all of this kind: this costs a third of going entry by entry.

    Attributes
    ----------
    n_bits : int
        Of the whole layout.
    """

    def __init__(self, layout: Layout) -> None:
        self._record = layout.record
        self._conditional = tuple((number.name, str(number.valid_if), number.missing) for number in layout.conditional)
        self._numbers: list[tuple[Number, int, int]] = []
        self._vectors: list[tuple[Vector, tuple[int, ...], int]] = []
        at = 0
        for entry in layout.entries:
            if isinstance(entry, Vector):
                places = tuple(at + index * entry.item.bits for index in range(entry.length))
                self._vectors.append((entry, places, (1 << entry.item.bits) - 1))
                at += entry.length * entry.item.bits
            else:
                assert isinstance(entry, Number | Spare)
                if isinstance(entry, Number):
                    self._numbers.append((entry, at, (1 << entry.bits) - 1))
                at += entry.bits
        self.n_bits = at

    def encode(self, record: Any) -> int:
        """The record's bits; raises FieldError as :func:`encode` does."""
        bits = 0
        for entry, place, mask in self._numbers:
            raw = entry.quick_raw(getattr(record, entry.name))
            if raw is None:
                raw = _number_to_raw(entry, record)
            bits |= (raw & mask) << place
        for vector, places, mask in self._vectors:
            values, item = getattr(record, vector.name), vector.item
            _check_length(vector, values)
            for value, place in zip(values, places, strict=True):
                raw = item.quick_raw(value)
                bits |= ((item.to_raw(value) if raw is None else raw) & mask) << place
        return bits

    def decode(self, bits: int) -> Any:
        """The record of its bits; raises FieldError as :func:`decode` does."""
        values = {entry.name: entry.quick_value(bits >> place & mask) for entry, place, mask in self._numbers}
        for vector, places, mask in self._vectors:
            value_of = vector.item.quick_value
            values[vector.name] = tuple([value_of(bits >> place & mask) for place in places])
        for name, valid_if, missing in self._conditional:
            if is_missing(values[valid_if]):
                values[name] = missing
        return self._record(**values)


def encode(layout: Layout, record: Any, writer: BitWriter) -> None:
    """Append a record's fields to `writer`.

    Raises
    ------
    FieldError
        Naming the field, its value and the bound; group items are named with their position.
    """
    for entry in layout.entries:
        if isinstance(entry, Number):
            writer.put(_number_to_raw(entry, record), entry.bits)
        elif isinstance(entry, (Choice, Letter, Text)):
            writer.put(entry.to_raw(getattr(record, entry.name)), entry.bits)
        elif isinstance(entry, Spare):
            writer.put(0, entry.bits)
        elif isinstance(entry, Vector):
            _encode_vector(entry, getattr(record, entry.name), writer)
        elif isinstance(entry, Count):
            count = len(getattr(record, entry.of))
            if count > entry.maximum:
                raise FieldError(f"{entry.of}: {count} items, at most {entry.maximum} fit")
            writer.put(count, entry.bits)
        elif isinstance(entry, Switch):
            chosen = entry.chosen(record)
            writer.put(_number_to_raw(chosen, record), chosen.bits)
        elif isinstance(entry, Group):
            _encode_group(entry, getattr(record, entry.name), writer)
        else:
            encode(entry.layout, getattr(record, entry.name), writer)


def _number_to_raw(entry: Number, record: Any) -> int:
    value = getattr(record, entry.name)
    if entry.valid_if is not None and is_missing(value) and is_missing(getattr(record, entry.valid_if)):
        return 0
    return entry.to_raw(value)


def _check_length(entry: Vector, values: Any) -> None:
    if len(values) != entry.length:
        raise FieldError(f"{entry.name} has {len(values)} values, not {entry.length}")


def _encode_vector(entry: Vector, values: Any, writer: BitWriter) -> None:
    _check_length(entry, values)
    for value in values:
        writer.put(entry.item.to_raw(value), entry.item.bits)


def _encode_group(entry: Group, items: Any, writer: BitWriter) -> None:
    # Each item is collected apart: shifting a short integer is cheaper than shifting the whole message.
    for position, item in enumerate(items):
        try:
            bits, n_bits = _item_bits(entry.layout, item)
        except FieldError as error:
            raise FieldError(f"{entry.name}[{position}]: {error}") from None
        writer.put(bits, n_bits)


def _item_bits(layout: Layout, item: Any) -> tuple[int, int]:
    if layout.fixed is not None:
        return layout.fixed.encode(item), layout.fixed.n_bits
    part = BitWriter()
    encode(layout, item, part)
    return part.value, part.n_bits


def decode(layout: Layout, reader: BitReader) -> Any:
    """Read one record.

    Raises
    ------
    VdbError
        When the bits end too early.
    FieldError
        For a count the standard does not allow.
    """
    try:
        return _decode(layout, reader)
    except EOFError as error:
        raise VdbError(f"too short: {error}") from None


def _decode(layout: Layout, reader: BitReader) -> Any:
    if layout.fixed is not None:
        return layout.fixed.decode(reader.take(layout.fixed.n_bits))
    values: dict[str, Any] = {}
    counts: dict[str, int] = {}
    raw_of_switch: dict[int, int] = {}
    for entry in layout.entries:
        if isinstance(entry, (Number, Choice, Letter, Text)):
            values[entry.name] = entry.from_raw(reader.take(entry.bits))
        elif isinstance(entry, Spare):
            reader.take(entry.bits)
        elif isinstance(entry, Vector):
            item = entry.item
            values[entry.name] = tuple([item.from_raw(reader.take(item.bits)) for _ in range(entry.length)])
        elif isinstance(entry, Count):
            counts[entry.of] = _checked_count(entry, reader.take(entry.bits))
        elif isinstance(entry, Group):
            values[entry.name] = tuple([_decode(entry.layout, reader) for _ in range(counts[entry.name])])
        elif isinstance(entry, Switch):
            raw_of_switch[id(entry)] = reader.take(entry.default.bits)
        else:
            values[entry.name] = _decode(entry.layout, reader)
    for switch in layout.switched:
        values[switch.default.name] = switch.chosen(SimpleNamespace(**values)).from_raw(raw_of_switch[id(switch)])
    for number in layout.conditional:
        if is_missing(values[str(number.valid_if)]):
            values[number.name] = number.missing
    return layout.record(**values)


def _checked_count(entry: Count, count: int) -> int:
    if count > entry.maximum:
        raise FieldError(f"{entry.of}: {count} items, at most {entry.maximum} are allowed")
    return count
