"""Records, bursts and events as ROS messages: the only place where the contract meets std_msgs.

Everything here is a pure conversion; nodes, publishers and subscriptions are in :mod:`gbas_node.node`. Decoders
raise :class:`gbas_msgs_py.schema.SchemaError` (or :class:`gbas_msgs_py.events.EventError`) and never guess.
"""

from __future__ import annotations

import array
import math
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String, UInt8MultiArray

from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK
from gbas_core.record import Record
from gbas_core.satellites import IS_GALILEO, IS_GPS
from gbas_msgs_py.cdr import (
    BURST_DIMENSIONS,
    BURST_LABEL,
    MAX_BURST_BYTES,
    ROWS_LABEL,
    TableCodec,
    burst_numbers,
    decode_burst,
    stamp,
)
from gbas_msgs_py.events import Event
from gbas_msgs_py.qos import Qos
from gbas_msgs_py.records import SolutionEpoch
from gbas_msgs_py.schema import SchemaError, TableSchema
from gbas_msgs_py.tables import schema_dictionary, schema_of
from gbas_vdb.transmission.burst import SLOT_NAMES, Burst

R = TypeVar("R", bound=Record)


def stamp_of(gps_week: int, tow_s: float) -> Time:
    """ROS time of an epoch: GPS time counted from the Unix epoch, without leap seconds (so it never jumps)."""
    seconds, nanoseconds = stamp(gps_week, tow_s)
    return Time(sec=seconds, nanosec=nanoseconds)


def qos_profile(qos: Qos) -> QoSProfile:
    """The rclpy profile of a :class:`gbas_msgs_py.qos.Qos`."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.latched else DurabilityPolicy.VOLATILE,
    )


def table_to_msg(schema: TableSchema[R], record: R) -> Float64MultiArray:
    """Message of a record; raises SchemaError as :meth:`TableSchema.encode` does."""
    table = schema.encode(record)
    rows, columns = table.shape
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label=ROWS_LABEL, size=rows, stride=rows * columns),
            MultiArrayDimension(label=schema.label_of(table), size=columns, stride=columns),
        ]
    )
    message = Float64MultiArray(layout=layout)
    message.data = array.array("d", table.tobytes())
    return message


def table_from_msg(message: Float64MultiArray, schema: TableSchema[R] | None = None) -> R:
    """Record of a message.

    Parameters
    ----------
    message : Float64MultiArray
    schema : TableSchema, optional
        The schema expected; without it, any that is registered.

    Raises
    ------
    SchemaError
        When the layout, the size of the data, the label or the values do not follow the schema.
    """
    dims = message.layout.dim
    if len(dims) != 2 or dims[0].label != ROWS_LABEL:
        labels = ", ".join(repr(dim.label[:40]) for dim in dims) or "none"
        raise SchemaError(f"layout has dimensions {labels}, expected {ROWS_LABEL!r} and a schema label")
    if message.layout.data_offset != 0:
        raise SchemaError(f"layout.data_offset is {message.layout.data_offset}, expected 0")
    rows, columns, label = dims[0].size, dims[1].size, dims[1].label
    if rows * columns != len(message.data):
        raise SchemaError(f"{label.partition(':')[0][:80]}: {len(message.data)} numbers, expected {rows} x {columns}")
    expected = schema_of(label) if schema is None else schema
    record: R = expected.decode(label, np.frombuffer(message.data, dtype=np.float64).reshape(rows, columns))
    return record


def burst_to_msg(burst: Burst) -> UInt8MultiArray:
    """Message of a burst; the numbers are the sizes of labelled dimensions, the bytes are the data."""
    dims = [MultiArrayDimension(label=BURST_LABEL)]
    dims += [MultiArrayDimension(label=k, size=v) for k, v in zip(BURST_DIMENSIONS, burst_numbers(burst), strict=True)]
    message = UInt8MultiArray(layout=MultiArrayLayout(dim=dims))
    message.data = array.array("B", burst.payload)
    return message


def empty_frame(gps_week: int, tow_s: float) -> Burst:
    """The burst that says "this frame has none": no bits, so nothing reaches the receiver but the end of its wait."""
    return Burst(gps_week=gps_week, tow_s=tow_s, slot=0, bursts_in_frame=0, payload=b"")


def burst_from_msg(message: UInt8MultiArray) -> Burst:
    """Burst of a message.

    Raises
    ------
    SchemaError
        When the layout is another one, or a number is out of range.
    """
    labels = [dim.label for dim in message.layout.dim]
    if labels != [BURST_LABEL, *BURST_DIMENSIONS]:
        raise SchemaError(
            f"layout has dimensions {str(labels)[:120]}, expected {BURST_LABEL}, {', '.join(BURST_DIMENSIONS)}"
        )
    week, tow_ms, slot, in_frame, size = (dim.size for dim in message.layout.dim[1:])
    payload = bytes(message.data)
    for name, value, bound in (
        ("gps_week", week, 65536),
        ("tow_ms", tow_ms, MILLISECONDS_PER_WEEK),
        ("slot", slot, len(SLOT_NAMES)),
        ("bursts_in_frame", in_frame, len(SLOT_NAMES) + 1),
        ("bytes", size, MAX_BURST_BYTES + 1),
    ):
        if not 0 <= value < bound:
            raise SchemaError(f"{BURST_LABEL}: {name} is {value}, expected 0 to {bound - 1}")
    if len(payload) != size:
        raise SchemaError(f"{BURST_LABEL}: {len(payload)} bytes of data, expected {size}")
    if in_frame == 0 and size:
        raise SchemaError(f"{BURST_LABEL}: {size} bytes in a frame of 0 bursts, expected none")
    return Burst(gps_week=week, tow_s=tow_ms / 1000.0, slot=slot, bursts_in_frame=in_frame, payload=payload)


def table_from_bytes(data: bytes, codec: TableCodec[R]) -> R:
    """Record of a serialised message; raises SchemaError as :func:`table_from_msg` does."""
    record = codec.decode(data)
    return table_from_msg(_deserialised(data, Float64MultiArray), codec.schema) if record is None else record


def burst_from_bytes(data: bytes) -> Burst:
    """Burst of a serialised message; raises SchemaError as :func:`burst_from_msg` does."""
    burst = decode_burst(data)
    return burst_from_msg(_deserialised(data, UInt8MultiArray)) if burst is None else burst


def _deserialised(data: bytes, message_type: type) -> Any:
    try:
        return deserialize_message(data, message_type)
    except Exception as error:
        raise SchemaError(f"{len(data)} bytes that are no {message_type.__name__}: {error}") from None


def event_to_msg(event: Event) -> String:
    """Message of an event."""
    return String(data=event.to_json())


def event_from_msg(message: String) -> Event:
    """Event of a message; raises EventError."""
    return Event.from_json(message.data)


def schemas_msg() -> String:
    """The schema dictionary."""
    return String(data=schema_dictionary())


def fix_from_solution(solution: SolutionEpoch, *, protected: bool, frame_id: str = "gbas_antenna") -> NavSatFix:
    """Position as NavSatFix, for maps and displays; no fix where the position has no protection level.

    The status says that a position corrected by GBAS exists, never that it may be used for an approach: the service
    type and the protection levels are on their own topics. The covariance is unknown, because the solution table has
    the projection of the vertical and lateral direction only.
    """
    fix = NavSatFix()
    fix.header.stamp = stamp_of(solution.gps_week, solution.tow_s)
    fix.header.frame_id = frame_id
    position = np.array([solution.x_m, solution.y_m, solution.z_m])
    valid = protected and bool(np.isfinite(position).all())
    fix.status.status = NavSatStatus.STATUS_GBAS_FIX if valid else NavSatStatus.STATUS_NO_FIX
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN
    fix.latitude = fix.longitude = fix.altitude = math.nan
    if valid:
        latitude_rad, longitude_rad, height_m = geodetic_from_ecef(position)
        fix.latitude, fix.longitude = math.degrees(latitude_rad), math.degrees(longitude_rad)
        fix.altitude = float(height_m)
        fix.status.service = _constellations(solution)
    return fix


def _constellations(solution: SolutionEpoch) -> int:
    used = ~np.isnan(solution.elevation_rad)
    gps = NavSatStatus.SERVICE_GPS if (used & IS_GPS).any() else 0
    galileo = NavSatStatus.SERVICE_GALILEO if (used & IS_GALILEO).any() else 0
    return int(gps | galileo)


def diagnostic(name: str, level: bytes, message: str, values: Mapping[str, Any]) -> DiagnosticStatus:
    """One status of a DiagnosticArray; `level` is one of DiagnosticStatus.OK, WARN, ERROR, STALE."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id="gbas",
        values=[KeyValue(key=str(key), value=str(value)) for key, value in values.items()],
    )
