"""Layouts of records: entries in the order of transmission, and the interpreter between records and bits.

:func:`encode` and :func:`decode` interpret the entries of a :class:`Layout`; records of numbers at fixed places have a
quicker way to the same bits (:mod:`gbas_vdb.messages.fixed_places`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from gbas_vdb.coding.bits import BitReader, BitWriter, byte_array
from gbas_vdb.errors import FieldError, VdbError
from gbas_vdb.messages.fields import Choice, Count, Letter, Number, Spare, Switch, Text, Vector, is_missing
from gbas_vdb.messages.fixed_places import FixedPlaces, Items, check_length
from gbas_vdb.messages.kernels.numbers import pack, unpack


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
    def leading(self) -> tuple[Entry, ...]:
        """All entries, but for a group at the end."""
        return self.entries[:-1] if isinstance(self.entries[-1], Group) else self.entries

    @cached_property
    def group(self) -> Group | None:
        """A group of fixed items at the end."""
        last = self.entries[-1]
        return last if isinstance(last, Group) and last.layout.is_fixed and last.layout.group is None else None

    @cached_property
    def is_fixed(self) -> bool:
        """Whether every field is a number at a fixed place, in whole bytes, but for such a group at the end."""
        simple = all(isinstance(entry, Number | Spare | Vector | Count) for entry in self.leading)
        return simple and self.bits % 8 == 0 and (self.leading == self.entries or self.group is not None)

    @cached_property
    def places(self) -> FixedPlaces:
        """The codec of whole tables, where fields are fixed."""
        return FixedPlaces(self)


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


def encode(layout: Layout, record: Any, writer: BitWriter) -> None:
    """Append a record's fields to `writer`.

    Raises
    ------
    FieldError
        Naming the field, its value and the bound; group items are named with their position.
    """
    if layout.group is not None and layout.is_fixed:
        row = np.array([layout.places.row_of(record)], dtype=np.float64)
        data, refused = pack(row, layout.places.places)
        if refused < 0:
            writer.put(int.from_bytes(data.tobytes(), "little"), layout.bits)
            _encode_group(layout.group, getattr(record, layout.group.name), writer)
            return
    for entry in layout.entries:  # or what cannot be sent is told here
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


def _encode_vector(entry: Vector, values: Any, writer: BitWriter) -> None:
    check_length(entry, values)
    for value in values:
        writer.put(entry.item.to_raw(value), entry.item.bits)


def _encode_group(entry: Group, items: Any, writer: BitWriter) -> None:
    if isinstance(items, Items):
        data, refused = pack(items.rows, entry.layout.places.places)
        if refused < 0:
            writer.put(int.from_bytes(data.tobytes(), "little"), 8 * len(data))
            return
    # Each item is collected apart: shifting a short integer is cheaper than shifting the whole message.
    for position, item in enumerate(items):
        part = BitWriter()
        try:
            encode(entry.layout, item, part)
        except FieldError as error:
            raise FieldError(f"{entry.name}[{position}]: {error}") from None
        writer.put(part.value, part.n_bits)


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
    if layout.group is not None and layout.is_fixed and reader.remaining >= layout.bits:
        begin, n_bytes = reader.position, layout.bits // 8
        rows, refused, _ = unpack(
            byte_array(reader.take(layout.bits).to_bytes(n_bytes, "little")), layout.places.places
        )
        if refused < 0:
            values = layout.places.values(rows[0])
            values[layout.group.name] = _decoded_group(layout.group.layout, values[layout.group.name] or 0, reader)
            return layout.record(**values)
        reader.position = begin  # what is not allowed is told below
    return _decode_entries(layout, reader)


def _decode_entries(layout: Layout, reader: BitReader) -> Any:
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
            values[entry.name] = _decoded_group(entry.layout, counts[entry.name], reader)
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


def _decoded_group(layout: Layout, count: int, reader: BitReader) -> Sequence[Any]:
    if layout.is_fixed and count:
        n_bytes = count * layout.bits // 8
        return Items(layout, layout.places.unpack(reader.take(8 * n_bytes).to_bytes(n_bytes, "little")))
    return tuple([_decode(layout, reader) for _ in range(count)])


def _checked_count(entry: Count, count: int) -> int:
    if count > entry.maximum:
        raise FieldError(f"{entry.of}: {count} items, at most {entry.maximum} are allowed")
    return count
