"""The kinds of entry a VDB field table has, and the interpreter that turns tables and records into bits and back.

A :class:`Layout` is a record type and its entries in the order of transmission. Entries are data: bits, scale, bounds,
special codes, rounding. :func:`encode` and :func:`decode` interpret them. Physical values are in SI units and radians;
missing is NaN (quantities) or None (designators), never a default value.

Rounding is to the nearest count, unless the entry says otherwise: integrity bounds (sigmas, P, multipliers) round up,
limits (alert limits, maximum distance, availability) round down, so that quantisation never makes a value optimistic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Final, Literal, overload

import numpy as np

from gbas_core.compiled import as_written
from gbas_core.record import FloatArray, IntArray
from gbas_vdb.coding.bits import BitReader, BitWriter, byte_array
from gbas_vdb.errors import FieldError, VdbError
from gbas_vdb.messages.kernels.numbers import (
    DOWN,
    LARGEST,
    NEAREST,
    NO_CODE,
    UP,
    Places,
    counts_of,
    pack,
    quantity_of,
    unpack,
)

Rounding = Literal["nearest", "up", "down"]


_ROUNDINGS: Final[dict[Rounding, int]] = {"nearest": NEAREST, "up": UP, "down": DOWN}
_counts_of, _quantity_of = as_written(counts_of), as_written(quantity_of)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A quantity: value = offset + scale * raw.

    Attributes
    ----------
    name, unit, doc : str
        Name of the record's attribute, SI unit ("" for a plain count or code), meaning.
    bits : int
    signed : bool
        Two's complement.
    scale : Fraction, float or None
        Value of one count; None for integers.
    offset : int
    minimum, maximum : int or None
        Bounds of the raw count; by default what the bits hold.
    codes : mapping of raw count to value
        Special codes: the values NaN, None or infinity.
    saturates : bool
        Values above the maximum are sent as the maximum: the standard defines that code as "this much or more".
    rounding
    valid_if : str or None
        Name of another entry: when that one is missing (or an empty group), this one is missing too, and sent as zero.
    counts : bool
        It says how many items the group of its name has.
    """

    name: str
    bits: int
    unit: str = ""
    doc: str = ""
    signed: bool = False
    scale: Fraction | float | None = None
    offset: int = 0
    minimum: int | None = None
    maximum: int | None = None
    codes: Mapping[int, float | None] = field(default_factory=dict)
    saturates: bool = False
    rounding: Rounding = "nearest"
    valid_if: str | None = None
    counts: bool = False

    @cached_property
    def bounds(self) -> tuple[int, int]:
        """Smallest and largest raw count of an ordinary value."""
        low, high = (-(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1) if self.signed else (0, (1 << self.bits) - 1)
        return (low if self.minimum is None else self.minimum, high if self.maximum is None else self.maximum)

    @cached_property
    def ratio(self) -> tuple[float, float]:
        """Value of one count, as numerator and denominator."""
        if isinstance(self.scale, Fraction):
            return float(self.scale.numerator), float(self.scale.denominator)
        return (1.0 if self.scale is None else float(self.scale)), 1.0

    @cached_property
    def _raw_of_none(self) -> int | None:
        return next((raw for raw, value in self.codes.items() if value is None), None)

    @cached_property
    def _raw_of_nan(self) -> int | None:
        return next((raw for raw, value in self.codes.items() if value is not None and value != value), None)

    @cached_property
    def _raw_of_infinity(self) -> int | None:
        return next((raw for raw, value in self.codes.items() if value == math.inf), None)

    def physical(self, raw: int) -> Any:
        """Physical value of a raw count."""
        if self.scale is None:
            return raw + self.offset
        return _quantity_of(raw, *self.ratio, self.offset)

    def to_raw(self, value: Any) -> int:
        """Raw count of a physical value.

        Raises
        ------
        FieldError
            For a missing value the field has no code for, and for one out of bounds.
        """
        if value is None or value != value or value in (math.inf, -math.inf):
            return self._special(value)
        if not -LARGEST < value < LARGEST:
            raise self._out_of_bounds(value)
        raw = _counts_of(value, *self.ratio, self.offset, _ROUNDINGS[self.rounding])
        if self.scale is None and raw + self.offset != value:
            raise FieldError(f"{self.name} = {value!r} is not an integer")
        low, high = self.bounds
        if low <= raw <= high and raw not in self.codes:
            return raw
        if raw > high and self.saturates:
            return high
        raise self._out_of_bounds(value)

    def _special(self, value: Any) -> int:
        if value is None:
            raw = self._raw_of_none
        elif value != value:
            raw = self._raw_of_nan
        else:
            raw = self._raw_of_infinity if value > 0 else None
        if raw is None:
            raise FieldError(f"{self.name} = {value!r}: the field has no code for it")
        return raw

    def _out_of_bounds(self, value: Any) -> FieldError:
        low, high = self.bounds
        unit = f" {self.unit}" if self.unit else ""
        return FieldError(f"{self.name} = {value!r} outside {self.physical(low)!r} to {self.physical(high)!r}{unit}")

    def from_raw(self, raw: int) -> Any:
        """Physical value of a count as read (unsigned).

        Raises
        ------
        FieldError
            For a count the standard does not allow.
        """
        if self.signed and raw >> (self.bits - 1):
            raw -= 1 << self.bits
        if raw in self.codes:
            return self.codes[raw]
        low, high = self.bounds
        if not low <= raw <= high:
            raise self._out_of_bounds(self.physical(raw))
        return self.physical(raw)

    @cached_property
    def missing_value(self) -> float | None:
        """The same where there is a code for it, as the code has it."""
        return next((value for value in self.codes.values() if is_missing(value)), self.missing)

    @property
    def missing(self) -> float | None:
        """What stands for a missing value: None for integers, NaN for quantities."""
        return None if self.scale is None else math.nan


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A code with named values; the position in `values` is the raw count. None is a value without a meaning."""

    name: str
    bits: int
    values: tuple[Any, ...]
    doc: str = ""
    unit: str = ""
    valid_if: None = None

    def to_raw(self, value: Any) -> int:
        """Raw count of a named value."""
        for raw, known in enumerate(self.values):
            if known == value and isinstance(value, type(known)):
                return raw
        raise FieldError(f"{self.name} = {value!r} is not one of {', '.join(repr(known) for known in self.values)}")

    def from_raw(self, raw: int) -> Any:
        """Named value of a raw count."""
        if raw >= len(self.values):
            raise FieldError(f"{self.name} = {raw} has no meaning; {len(self.values)} values are defined")
        return self.values[raw]


@dataclass(frozen=True, kw_only=True)
class Letter:
    """One letter by its lowest five IA-5 bits (A is 1, Z is 26), or none (zero); `unused` ones are never assigned."""

    name: str
    unused: str = ""
    bits: int = 5
    doc: str = ""
    unit: str = ""
    valid_if: None = None

    @cached_property
    def _known(self) -> dict[int, str]:
        letters = (chr(code) for code in range(ord("A"), ord("Z") + 1))
        return {0: ""} | {ord(letter) & 0x1F: letter for letter in letters if letter not in self.unused}

    def to_raw(self, value: Any) -> int:
        """Raw code of a letter."""
        for raw, known in self._known.items():
            if known == value:
                return raw
        raise FieldError(f"{self.name} = {value!r} is not empty or one of {''.join(self._known.values())}")

    def from_raw(self, raw: int) -> str:
        """Letter of a raw code."""
        if raw not in self._known:
            raise FieldError(f"{self.name}: code {raw} is no letter of {''.join(self._known.values())}")
        return self._known[raw]


@dataclass(frozen=True, kw_only=True)
class Text:
    """Characters A-Z, 0-9 and space by their lowest six IA-5 bits; the rightmost is sent first; padded at the right."""

    name: str
    characters: int
    bits_per_character: int
    doc: str = ""
    unit: str = ""
    valid_if: None = None

    @property
    def bits(self) -> int:
        """Bits of the whole text."""
        return self.characters * self.bits_per_character

    def to_raw(self, value: Any) -> int:
        """Raw integer of a text."""
        if not isinstance(value, str) or len(value) > self.characters:
            raise FieldError(f"{self.name} = {value!r} is not a text of at most {self.characters} characters")
        raw = 0
        for character in value.ljust(self.characters):
            if character not in _ALPHABET:
                raise FieldError(f"{self.name} = {value!r}: character {character!r} is not one of A-Z, 0-9 and space")
            raw = (raw << self.bits_per_character) | (ord(character) & 0x3F)
        return raw

    def from_raw(self, raw: int) -> str:
        """Text of a raw integer, without the padding."""
        mask = (1 << self.bits_per_character) - 1
        text = ""
        for _ in range(self.characters):
            code = raw & mask
            if code not in _CHARACTER_OF_CODE:
                raise FieldError(f"{self.name}: character code {code:#04x} is not one of A-Z, 0-9 and space")
            text = _CHARACTER_OF_CODE[code] + text
            raw >>= self.bits_per_character
        return text.rstrip(" ")


_ALPHABET: Final = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 ")
_CHARACTER_OF_CODE: Final = {ord(character) & 0x3F: character for character in _ALPHABET}


@dataclass(frozen=True, kw_only=True)
class Spare:
    """Bits without a meaning: sent as zero, not looked at when received."""

    bits: int


@dataclass(frozen=True, kw_only=True)
class Vector:
    """A fixed number of equal quantities: a tuple in the record."""

    name: str
    length: int
    item: Number


@dataclass(frozen=True, kw_only=True)
class Switch:
    """An entry whose table depends on another value of the record, which may come later in the message.

    Attributes
    ----------
    on : str
        Dotted name of the value.
    cases : mapping
        Entry by value; all have the same bits and name.
    default : Number
    """

    on: str
    cases: Mapping[Any, Number]
    default: Number

    def chosen(self, record: Any) -> Number:
        """The entry that applies to a record."""
        return self.cases.get(attrgetter(self.on)(record), self.default)


@dataclass(frozen=True, kw_only=True)
class Count:
    """How many items the group `of` has; not in the record."""

    of: str
    bits: int
    maximum: int


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


class FixedPlaces:
    """Codec of a layout of numbers whose places do not depend on the record: whole tables of records at once.

    Corrections are by far the most of what is sent, and all of this kind.

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
            items = [entry.item] * entry.length if isinstance(entry, Vector) else [entry]
            for item in items:
                if isinstance(item, Number):
                    self._numbers.append(item)
                    begins.append(at)
                at += _bits_of(item)
        self.n_numbers = len(self._numbers)
        self.places = _places(self._numbers, begins, at // 8)

    def row_of(self, record: Any) -> list[Any]:
        """The numbers of a record, in the order of the columns; None where they are missing and that is the way."""
        row = []
        for entry in self._entries:
            value = getattr(record, entry.name)
            if isinstance(entry, Vector):
                _check_length(entry, value)
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
        rounding=whole(_ROUNDINGS[number.rounding] for number in numbers),
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


def is_missing(value: Any) -> bool:
    """Whether a value says nothing: None, NaN or an empty group."""
    return value is None or value == () or value != value


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


def _check_length(entry: Vector, values: Any) -> None:
    if len(values) != entry.length:
        raise FieldError(f"{entry.name} has {len(values)} values, not {entry.length}")


def _encode_vector(entry: Vector, values: Any, writer: BitWriter) -> None:
    _check_length(entry, values)
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
