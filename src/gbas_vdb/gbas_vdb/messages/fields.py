"""The kinds of entry a VDB field table has, and how each turns a value into counts and back.

Entries are data: bits, scale, bounds, special codes, rounding. :mod:`gbas_vdb.messages.layout` puts them in order and
interprets them. Physical values are in SI units and radians; missing is NaN (quantities) or None (designators), never a
default value.

Rounding is to the nearest count, unless the entry says otherwise: integrity bounds (sigmas, P, multipliers) round up,
limits (alert limits, maximum distance, availability) round down, so that quantisation never makes a value optimistic.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from operator import attrgetter
from typing import Any, Final, Literal

from gbas_core.compiled import as_written
from gbas_vdb.errors import FieldError
from gbas_vdb.messages.kernels.numbers import DOWN, LARGEST, NEAREST, UP, counts_of, quantity_of

Rounding = Literal["nearest", "up", "down"]


ROUNDINGS: Final[dict[Rounding, int]] = {"nearest": NEAREST, "up": UP, "down": DOWN}
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
        raw: int = _counts_of(value, *self.ratio, self.offset, ROUNDINGS[self.rounding])
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


def is_missing(value: Any) -> bool:
    """Whether a value says nothing: None, NaN or an empty group."""
    return value is None or value == () or value != value
