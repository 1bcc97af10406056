"""The epoch a recorded message belongs to, read from its CDR bytes without decoding the whole message."""

from __future__ import annotations

import struct
from typing import Final

from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK

TABLE_TYPE: Final = "std_msgs/msg/Float64MultiArray"
BURST_TYPE: Final = "std_msgs/msg/UInt8MultiArray"
STRING_TYPE: Final = "std_msgs/msg/String"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
STAMPED_TYPES: Final = frozenset({"sensor_msgs/msg/NavSatFix"})

GPS_EPOCH_UNIX_S: Final = 315_964_800
"""1980-01-06T00:00:00 as a Unix time."""

_ORIGIN: Final = 4  # after the encapsulation header; CDR aligns relative to it
_LITTLE_ENDIAN: Final = b"\x00\x01"
_MAX_DIMENSIONS: Final = 16


class PayloadError(ValueError):
    """CDR bytes that do not hold what the topic's type says."""


def dimensions(data: bytes) -> tuple[list[tuple[str, int]], int]:
    """Labels and sizes of a MultiArray's layout, and where its data sequence begins."""
    if len(data) < 8 or data[:2] != _LITTLE_ENDIAN:
        raise PayloadError("is not little-endian CDR")
    (count,) = struct.unpack_from("<I", data, _ORIGIN)
    if count > _MAX_DIMENSIONS:
        raise PayloadError(f"{count} dimensions, expected at most {_MAX_DIMENSIONS}")
    at, found = _ORIGIN + 4, []
    for _ in range(count):
        (length,) = struct.unpack_from("<I", data, at)
        at += 4
        label = data[at : at + max(length - 1, 0)].decode("utf-8", "replace")
        at += length
        at += -(at - _ORIGIN) % 4
        (size,) = struct.unpack_from("<I", data, at)
        at += 8
        found.append((label, size))
    return found, at + 4


def table_head(data: bytes, count: int) -> tuple[float, ...]:
    """The first `count` numbers of a Float64MultiArray."""
    try:
        _, at = dimensions(data)
        (there,) = struct.unpack_from("<I", data, at)
        at += 4
        at += -(at - _ORIGIN) % 8
        if there < count:
            raise PayloadError(f"{there} numbers, expected at least {count}")
        return struct.unpack_from(f"<{count}d", data, at)
    except struct.error as error:
        raise PayloadError(str(error)) from None


def table_epoch(data: bytes) -> int:
    """Epoch key of a table: its first two numbers are GPS week and time of week."""
    week, tow_s = table_head(data, 2)
    try:
        return round(week) * MILLISECONDS_PER_WEEK + round(tow_s * 1000.0)
    except (ValueError, OverflowError):
        raise PayloadError(f"the epoch is {week}, {tow_s}") from None


def burst_layout(data: bytes) -> dict[str, int]:
    """The numbers that travel with a VDB burst, by label."""
    try:
        return dict(dimensions(data)[0])
    except struct.error as error:
        raise PayloadError(str(error)) from None


def burst_epoch(data: bytes) -> int:
    """Epoch key of the frame of a VDB burst."""
    layout = burst_layout(data)
    if "gps_week" not in layout or "tow_ms" not in layout:
        raise PayloadError("a burst whose layout has no gps_week and tow_ms")
    return layout["gps_week"] * MILLISECONDS_PER_WEEK + layout["tow_ms"]


def stamp_ns(data: bytes) -> int:
    """ROS time at the head of a message: a Clock's, or a Header's stamp [ns]."""
    if len(data) < 12:
        raise PayloadError("is too short for a time stamp")
    seconds, nanoseconds = struct.unpack_from("<iI", data, _ORIGIN)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def ros_time_ns(key: int) -> int:
    """ROS time of an epoch key [ns]: GPS time counted from the Unix epoch, without leap seconds."""
    return (GPS_EPOCH_UNIX_S * 1000 + key) * 1_000_000


def key_of_ros_time(time_ns: int) -> int:
    """Epoch key of a ROS time; the inverse of :func:`ros_time_ns`, rounded to the millisecond."""
    return (time_ns + 500_000) // 1_000_000 - GPS_EPOCH_UNIX_S * 1000


def epoch_of(msgtype: str, data: bytes) -> int | None:
    """Epoch key of a message, or None for a type that carries none.

    Raises
    ------
    PayloadError
        When the bytes are not what the type says.
    """
    if msgtype == TABLE_TYPE:
        return table_epoch(data)
    if msgtype == BURST_TYPE:
        return burst_epoch(data)
    if msgtype == CLOCK_TYPE or msgtype in STAMPED_TYPES:
        time_ns = stamp_ns(data)
        return key_of_ros_time(time_ns) if time_ns > 0 else None
    return None


def string_of(data: bytes) -> str:
    """Text of a std_msgs/String."""
    try:
        (length,) = struct.unpack_from("<I", data, _ORIGIN)
        return data[_ORIGIN + 4 : _ORIGIN + 4 + max(length - 1, 0)].decode("utf-8")
    except (struct.error, UnicodeDecodeError) as error:
        raise PayloadError(str(error)) from None


def payload(msgtype: str, data: bytes) -> bytes:
    """The bytes of a message without the padding that some transports put behind them."""
    try:
        if msgtype == BURST_TYPE:
            at = dimensions(data)[1]
            (count,) = struct.unpack_from("<I", data, at)
            return data[: at + 4 + count]
        if msgtype == STRING_TYPE:
            (length,) = struct.unpack_from("<I", data, _ORIGIN)
            return data[: _ORIGIN + 4 + length]
    except (struct.error, PayloadError):
        pass
    return data
