"""Messages of the contract as the bytes the middleware carries, made and read without message objects.

rclpy sends and receives serialised messages as they are; filling and emptying its message objects costs several times
more than everything else a node does with a message. The layouts of the contract's messages are fixed but for a few
numbers, so each is a prepared piece of bytes. What does not look exactly like that is left to the general decoder
(:mod:`gbas_msgs_py.ros`).

The encoding is CDR, little-endian, version 1 (OMG DDS-XTypes 1.3, 7.4.3): four bytes that say so, then the fields,
each aligned to its size counted from there; a string has its length with the final NUL in front.
"""

from __future__ import annotations

import struct
from typing import Final, Generic, TypeVar

import numpy as np

from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK, epoch_key
from gbas_core.record import FloatArray, Record
from gbas_msgs_py.schema import TableSchema
from gbas_vdb.transmission.burst import SLOT_NAMES, Burst

R = TypeVar("R", bound=Record)

ENCAPSULATION: Final = b"\x00\x01\x00\x00"
ROWS_LABEL: Final = "rows"
BURST_LABEL: Final = "gbas/vdb_burst/1"
BURST_DIMENSIONS: Final = ("gps_week", "tow_ms", "slot", "bursts_in_frame", "bytes")
MAX_BURST_BYTES: Final = 228
"""222 bytes of application data and 6 of FEC (RTCA DO-246E 2.2.2)."""
GPS_EPOCH_UNIX_S: Final = 315_964_800
"""1980-01-06 as Unix time."""

_NUMBER: Final = struct.Struct("<I")
_DIMENSION: Final = struct.Struct("<II")
_CLOCK: Final = struct.Struct("<4siI")
_FLOAT64: Final = struct.Struct("<4sd")
_UINT8: Final = struct.Struct("<4sB")
_BURST_BOUNDS: Final = (65536, MILLISECONDS_PER_WEEK, len(SLOT_NAMES), len(SLOT_NAMES) + 1, MAX_BURST_BYTES + 1)


class _Layout:
    """A serialised MultiArrayLayout: fixed bytes, and where the sizes and strides are."""

    def __init__(self, labels: tuple[str, ...], alignment: int) -> None:
        head = bytearray(ENCAPSULATION + _NUMBER.pack(len(labels)))
        self.size_at: list[int] = []
        # Where each piece of fixed bytes begins; what pads it to the next number may be anything.
        pieces, begin = [], 0
        for label in labels:
            text = label.encode() + b"\x00"
            head += _NUMBER.pack(len(text)) + text
            pieces.append((begin, len(head)))
            head += bytes(-len(head) % 4)
            self.size_at.append(len(head))
            head += _DIMENSION.pack(0, 0)
            begin = len(head)
        head += _NUMBER.pack(0)  # data_offset
        pieces.append((begin, len(head)))
        self.count_at = len(head)
        head += _NUMBER.pack(0)  # length of the data
        head += bytes(-(len(head) - len(ENCAPSULATION)) % alignment)
        self.bytes = bytes(head)
        self.data_at = len(head)
        self._fixed = tuple((a, b, self.bytes[a:b]) for a, b in pieces)

    def matches(self, data: bytes) -> bool:
        """Whether a message has this layout, whatever its numbers."""
        return len(data) >= self.data_at and all(data[a:b] == piece for a, b, piece in self._fixed)

    def filled(self, dimensions: tuple[tuple[int, int], ...], count: int) -> bytearray:
        """The layout with sizes, strides and the length of the data."""
        head = bytearray(self.bytes)
        for place, (size, stride) in zip(self.size_at, dimensions, strict=True):
            _DIMENSION.pack_into(head, place, size, stride)
        _NUMBER.pack_into(head, self.count_at, count)
        return head

    def sizes(self, data: bytes) -> list[int]:
        """Sizes of the dimensions of a message that matches."""
        return [_NUMBER.unpack_from(data, place)[0] for place in self.size_at]

    def count(self, data: bytes) -> int:
        """Length of the data of a message that matches."""
        length: int = _NUMBER.unpack_from(data, self.count_at)[0]
        return length


class TableCodec(Generic[R]):
    """Records of one schema to and from a serialised ``std_msgs/Float64MultiArray``."""

    def __init__(self, schema: TableSchema[R]) -> None:
        self.schema = schema
        self._layouts = {label: _Layout((ROWS_LABEL, label), alignment=8) for label in schema.labels}

    def encode(self, record: R) -> bytes:
        """Message of a record; raises SchemaError as :meth:`TableSchema.encode` does."""
        return self.message(self.schema.encode(record))

    def message(self, table: FloatArray) -> bytes:
        """Message of a table."""
        rows, columns = table.shape
        head = self._layouts[self.schema.label_of(table)].filled(
            ((rows, rows * columns), (columns, columns)), rows * columns
        )
        return bytes(head + table.astype("<f8", copy=False).tobytes())

    def decode(self, data: bytes) -> R | None:
        """Record of a message, or None when the bytes are not laid out as :meth:`encode` does it.

        Raises
        ------
        SchemaError
            When the table does not follow the schema.
        """
        label, layout = next(((k, each) for k, each in self._layouts.items() if each.matches(data)), ("", None))
        if layout is None:
            return None
        rows, columns = layout.sizes(data)
        count = layout.count(data)
        begin, end = layout.data_at, layout.data_at + 8 * count
        if rows * columns != count or not end <= len(data) < end + 4:
            return None
        # The copy puts the numbers where the processor wants them: they begin at an odd multiple of four.
        numbers = np.frombuffer(data[begin:end], dtype="<f8")
        return self.schema.decode(label, numbers.reshape(rows, columns))


_BURST: Final = _Layout((BURST_LABEL, *BURST_DIMENSIONS), alignment=1)


def burst_numbers(burst: Burst) -> tuple[int, int, int, int, int]:
    """The numbers that travel with a burst, in the order of BURST_DIMENSIONS."""
    return (burst.gps_week, round(burst.tow_s * 1000.0), burst.slot, burst.bursts_in_frame, len(burst.payload))


def encode_burst(burst: Burst) -> bytes:
    """A burst as a serialised ``std_msgs/UInt8MultiArray``."""
    dimensions = ((0, 0), *((number, 0) for number in burst_numbers(burst)))
    return bytes(_BURST.filled(dimensions, len(burst.payload)) + burst.payload)


def decode_burst(data: bytes) -> Burst | None:
    """Burst of a message, or None for anything that is not exactly one: the general decoder says what is wrong."""
    if not _BURST.matches(data):
        return None
    label, *numbers = _BURST.sizes(data)
    week, tow_ms, slot, in_frame, size = numbers
    end = _BURST.data_at + size
    good = all(number < bound for number, bound in zip(numbers, _BURST_BOUNDS, strict=True))
    if label or not good or size != _BURST.count(data) or not end <= len(data) < end + 4 or (in_frame == 0 and size):
        return None
    payload = data[_BURST.data_at : end]
    return Burst(gps_week=week, tow_s=tow_ms / 1000.0, slot=slot, bursts_in_frame=in_frame, payload=payload)


def encode_float(value: float) -> bytes:
    """A serialised ``std_msgs/Float64``."""
    return _FLOAT64.pack(ENCAPSULATION, value)


def encode_uint8(value: int) -> bytes:
    """A serialised ``std_msgs/UInt8``."""
    return _UINT8.pack(ENCAPSULATION, value)


def stamp(gps_week: int, tow_s: float) -> tuple[int, int]:
    """Seconds and nanoseconds of an epoch in ROS time: GPS time from the Unix epoch, without leap seconds."""
    milliseconds = epoch_key(gps_week, tow_s) + GPS_EPOCH_UNIX_S * 1000
    return milliseconds // 1000, milliseconds % 1000 * 1_000_000


def encode_clock(gps_week: int, tow_s: float) -> bytes:
    """A serialised ``rosgraph_msgs/Clock`` of an epoch."""
    return _CLOCK.pack(ENCAPSULATION, *stamp(gps_week, tow_s))
