"""The kinds of entry a VDB field table has, and how each turns a value into counts and back.

Entries are data: bits, scale, bounds, special codes, rounding. :mod:`gbas_vdb.messages.layout` puts them in order and
interprets them. Physical values are in SI units and radians; missing is NaN (quantities) or None (designators), never a
default value.

Rounding is to the nearest count, unless the entry says otherwise: integrity bounds (sigmas, P, multipliers) round up,
limits (alert limits, maximum distance, availability) round down, so that quantisation never makes a value optimistic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from operator import attrgetter
from typing import Any, Final, Literal

from gbas_vdb.errors import FieldError

# A value that was computed from counts (0.02 * 3) must round up to the same counts: this part of one count is allowed.
_ROUNDING_SLACK: Final = 1e-6

# Nothing on the VDB is larger than this; beyond it arithmetic could overflow before the bounds are looked at.
_LARGEST: Final = 1e15

# Fields up to this long are decoded by a table.
_TABULATED_BITS: Final = 8
_REFUSED: Final = object()

Rounding = Literal["nearest", "up", "down"]


def _rounded_up(counts: float) -> int:
    return math.ceil(counts - _ROUNDING_SLACK)


def _rounded_down(counts: float) -> int:
    return math.floor(counts + _ROUNDING_SLACK)


_ROUNDED: Final[dict[Rounding, Callable[[float], int]]] = {"nearest": round, "up": _rounded_up, "down": _rounded_down}


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

    @cached_property
    def bounds(self) -> tuple[int, int]:
        """Smallest and largest raw count of an ordinary value."""
        low, high = (-(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1) if self.signed else (0, (1 << self.bits) - 1)
        return (low if self.minimum is None else self.minimum, high if self.maximum is None else self.maximum)

    @cached_property
    def _ratio(self) -> tuple[float, float]:
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
        # The offset is added before the division: one rounding, so that decimal values come out as they are written.
        numerator, denominator = self._ratio
        return (self.offset * denominator + raw * numerator) / denominator

    def to_raw(self, value: Any) -> int:
        """Raw count of a physical value.

        Raises
        ------
        FieldError
            For a missing value the field has no code for, and for one out of bounds.
        """
        if value is None or value != value or value in (math.inf, -math.inf):
            return self._special(value)
        if not -_LARGEST < value < _LARGEST:
            raise self._out_of_bounds(value)
        numerator, denominator = self._ratio
        counts = (value - self.offset) * denominator / numerator
        if self.scale is None:
            raw = int(value) - self.offset
            if raw != counts:
                raise FieldError(f"{self.name} = {value!r} is not an integer")
        else:
            raw = _ROUNDED[self.rounding](counts)
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

    @property
    def missing(self) -> float | None:
        """What stands for a missing value: None for integers, NaN for quantities."""
        return None if self.scale is None else math.nan

    @cached_property
    def quick_raw(self) -> Callable[[Any], int | None]:
        """:meth:`to_raw` for ordinary values; gives None for all others, which are to_raw's business."""
        (low, high), offset, codes = self.bounds, self.offset, self.codes
        numerator, denominator = self._ratio
        roundings: dict[str, Callable[[float], int]] = {"nearest": round, "up": _rounded_up, "down": _rounded_down}
        rounded = roundings[self.rounding]

        def integer(value: Any) -> int | None:
            if type(value) is not int:
                return None
            raw = value - offset
            return raw if low <= raw <= high and raw not in codes else None

        def quantity(value: Any) -> int | None:
            if type(value) is not float or not -_LARGEST < value < _LARGEST:
                return None
            raw = rounded((value - offset) * denominator / numerator)
            return raw if low <= raw <= high and raw not in codes else None

        return integer if self.scale is None else quantity

    @cached_property
    def quick_value(self) -> Callable[[int], Any]:
        """:meth:`from_raw`; of short fields all values are made once."""
        if self.bits > _TABULATED_BITS:
            return self.from_raw
        values = [self._value_or_refused(raw) for raw in range(1 << self.bits)]

        def tabulated(raw: int) -> Any:
            value = values[raw]
            return self.from_raw(raw) if value is _REFUSED else value

        return tabulated

    def _value_or_refused(self, raw: int) -> Any:
        try:
            return self.from_raw(raw)
        except FieldError:
            return _REFUSED


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


def is_missing(value: Any) -> bool:
    """Whether a value says nothing: None, NaN or an empty group."""
    return value is None or value == () or value != value
