"""What the VDB codec raises: nothing else leaves it, whatever bits it is given."""

from __future__ import annotations


class VdbError(ValueError):
    """Bits, bytes or a document that are not what the VDB standard allows; the text says which and why."""


class FieldError(VdbError):
    """A field's value or raw count outside its table entry; names the field, the value and the bound."""


class CrcError(VdbError):
    """A cyclic redundancy check failed."""


class FecError(VdbError):
    """More errors than the forward error correction can repair."""


class ScheduleError(VdbError):
    """The blocks of a frame do not fit the station's slots."""
