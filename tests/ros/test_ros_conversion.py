"""Records, bursts and solutions as ROS messages."""

from __future__ import annotations

import array
import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Float64, Float64MultiArray, MultiArrayDimension, UInt8, UInt8MultiArray

from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.gnss.observations import ObservationEpoch
from gbas_msgs_py import cdr, ros, tables, topics
from gbas_msgs_py.qos import qos_of
from gbas_msgs_py.records import SolutionEpoch
from gbas_msgs_py.schema import SchemaError
from gbas_vdb.transmission.burst import Burst


def observations() -> ObservationEpoch:
    record = ObservationEpoch(gps_week=2300, tow_s=1000.5, simulated=1.0)
    record.code_m[:, [0, 7, 50]] = [[2.1e7, -0.0, 2.3e7], [1.0, np.nan, 5e-324], [3.0, 4.0, 1.7e308]]
    return record


def over_the_air(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


def test_table_survives_the_middleware_to_the_bit() -> None:
    sent = observations()
    got = ros.table_from_msg(over_the_air(ros.table_to_msg(tables.OBSERVATIONS, sent)), tables.OBSERVATIONS)
    assert tables.OBSERVATIONS.encode(got).tobytes() == tables.OBSERVATIONS.encode(sent).tobytes()


def test_layout_describes_itself() -> None:
    message = ros.table_to_msg(tables.OBSERVATIONS, observations())
    rows, columns = message.layout.dim
    assert (rows.label, rows.size, rows.stride) == ("rows", 3, 3 * 19)
    assert (columns.label, columns.size, columns.stride) == (tables.OBSERVATIONS.label, 19, 19)
    assert isinstance(message.data, array.array)


def _layout(**changes: Any) -> Callable[[Float64MultiArray], None]:
    def change(message: Float64MultiArray) -> None:
        for name, value in changes.items():
            dim = message.layout.dim[int(name[-1])]
            setattr(dim, name[:-1], value)

    return change


def _drop_dimension(message: Float64MultiArray) -> None:
    message.layout.dim = message.layout.dim[:1]


def _shorten(message: Float64MultiArray) -> None:
    message.data = message.data[:-1]


def _offset(message: Float64MultiArray) -> None:
    message.layout.data_offset = 8


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (_layout(size0=2), "57 numbers, expected 2 x 19"),
        (_layout(size0=19, size1=3), "shape (19, 3), expected"),
        (_layout(label0="satellites"), "layout has dimensions 'satellites'"),
        (_layout(label1="gbas/observations/9: x"), "gbas/observations/9"),
        (_drop_dimension, "layout has dimensions 'rows', expected"),
        (_shorten, "56 numbers, expected 3 x 19"),
        (_offset, "data_offset is 8"),
    ],
)
def test_bad_table_messages_are_refused(change: Callable[[Float64MultiArray], None], complaint: str) -> None:
    message = ros.table_to_msg(tables.OBSERVATIONS, observations())
    change(message)
    with pytest.raises(SchemaError) as told:
        ros.table_from_msg(message, tables.OBSERVATIONS)
    assert complaint in str(told.value)


def test_empty_message_is_refused() -> None:
    with pytest.raises(SchemaError, match="dimensions none"):
        ros.table_from_msg(Float64MultiArray())


def test_without_a_schema_any_registered_table_is_read() -> None:
    record = tables.ProgressEpoch(gps_week=2300, tow_s=1.5)
    got = ros.table_from_msg(ros.table_to_msg(tables.PROGRESS, record))
    assert isinstance(got, tables.ProgressEpoch)


@given(
    week=st.integers(0, 65535),
    half_seconds=st.integers(0, 1_209_599),
    slot=st.integers(0, 7),
    in_frame=st.integers(1, 8),
    payload=st.binary(max_size=228),
)
def test_burst_round_trip(week: int, half_seconds: int, slot: int, in_frame: int, payload: bytes) -> None:
    burst = Burst(gps_week=week, tow_s=half_seconds / 2, slot=slot, bursts_in_frame=in_frame, payload=payload)
    assert ros.burst_from_msg(over_the_air(ros.burst_to_msg(burst))) == burst


@given(satellites=st.sets(st.integers(0, 67)), simulated=st.floats(allow_infinity=False))
def test_prepared_bytes_are_what_the_middleware_reads_and_writes(satellites: set[int], simulated: float) -> None:
    """Second formulation: rclpy's own serialisation, both ways."""
    sent = ObservationEpoch(gps_week=2300, tow_s=1000.5, simulated=simulated)
    sent.code_m[:, list(satellites)] = 2.1e7
    codec, table = cdr.TableCodec(tables.OBSERVATIONS), tables.OBSERVATIONS.encode(sent).tobytes()
    by_rclpy = deserialize_message(codec.encode(sent), Float64MultiArray)
    assert by_rclpy.layout == ros.table_to_msg(tables.OBSERVATIONS, sent).layout
    assert by_rclpy.data.tobytes() == table
    mine = codec.decode(serialize_message(ros.table_to_msg(tables.OBSERVATIONS, sent)))
    assert mine is not None
    assert tables.OBSERVATIONS.encode(mine).tobytes() == table


@given(slot=st.integers(0, 7), in_frame=st.integers(1, 8), payload=st.binary(max_size=228))
def test_prepared_bursts_are_what_the_middleware_reads_and_writes(slot: int, in_frame: int, payload: bytes) -> None:
    burst = Burst(gps_week=2300, tow_s=1.5, slot=slot, bursts_in_frame=in_frame, payload=payload)
    assert deserialize_message(cdr.encode_burst(burst), UInt8MultiArray) == ros.burst_to_msg(burst)
    assert cdr.decode_burst(serialize_message(ros.burst_to_msg(burst))) == burst


@given(
    value=st.floats(allow_nan=False),
    small=st.integers(0, 255),
    week=st.integers(0, 3000),
    tow_ms=st.integers(0, 604_799_999),
)
def test_prepared_scalars_are_what_the_middleware_reads(value: float, small: int, week: int, tow_ms: int) -> None:
    assert deserialize_message(cdr.encode_float(value), Float64).data == value
    assert deserialize_message(cdr.encode_uint8(small), UInt8).data == small
    clock = deserialize_message(cdr.encode_clock(week, tow_ms / 1000.0), Clock).clock
    assert clock == ros.stamp_of(week, tow_ms / 1000.0)


def _without_label(message: Any) -> None:
    message.layout.dim[0].label = "row"


@pytest.mark.parametrize("change", [_without_label, _shorten, _offset, _layout(size0=2), _drop_dimension])
def test_what_is_laid_out_otherwise_is_left_to_the_general_decoder(change: Callable[[Any], None]) -> None:
    message = ros.table_to_msg(tables.OBSERVATIONS, observations())
    change(message)
    codec, data = cdr.TableCodec(tables.OBSERVATIONS), serialize_message(message)
    assert codec.decode(data) is None
    with pytest.raises(SchemaError) as told:
        ros.table_from_bytes(data, codec)
    with pytest.raises(SchemaError) as expected:
        ros.table_from_msg(message, tables.OBSERVATIONS)
    assert str(told.value) == str(expected.value)


@given(data=st.binary(max_size=120), cut=st.integers(0, 500))
def test_random_bytes_never_do_worse_than_a_schema_error(data: bytes, cut: int) -> None:
    codec = cdr.TableCodec(tables.OBSERVATIONS)
    for attempt in (data, codec.encode(observations())[:cut] + data):
        for decode in (lambda each: ros.table_from_bytes(each, codec), ros.burst_from_bytes):
            with contextlib.suppress(SchemaError):
                decode(attempt)


def test_empty_frame_round_trip() -> None:
    frame = ros.empty_frame(2300, 1.5)
    assert ros.burst_from_msg(over_the_air(ros.burst_to_msg(frame))) == frame
    assert (frame.bursts_in_frame, frame.payload) == (0, b"")


BURST = Burst(gps_week=2300, tow_s=1.5, slot=1, bursts_in_frame=2, payload=bytes(range(60)))


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("gps_week", 65536, "gps_week is 65536"),
        ("tow_ms", 604_800_000, "tow_ms is 604800000"),
        ("slot", 8, "slot is 8, expected 0 to 7"),
        ("bursts_in_frame", 9, "bursts_in_frame is 9, expected 0 to 8"),
        ("bursts_in_frame", 0, "60 bytes in a frame of 0 bursts"),
        ("bytes", 61, "60 bytes of data, expected 61"),
        ("bytes", 229, "bytes is 229, expected 0 to 228"),
    ],
)
def test_bad_burst_numbers_are_refused(name: str, value: int, complaint: str) -> None:
    message = ros.burst_to_msg(BURST)
    next(dim for dim in message.layout.dim if dim.label == name).size = value
    with pytest.raises(SchemaError) as told:
        ros.burst_from_msg(message)
    assert complaint in str(told.value)


def test_other_byte_arrays_are_no_bursts() -> None:
    with pytest.raises(SchemaError, match="expected gbas/vdb_burst/1"):
        ros.burst_from_msg(UInt8MultiArray())
    message = ros.burst_to_msg(BURST)
    message.layout.dim[0] = MultiArrayDimension(label="gbas/vdb_burst/2")
    with pytest.raises(SchemaError, match="vdb_burst/2"):
        ros.burst_from_msg(message)


def test_stamp_is_gps_time_from_the_unix_epoch() -> None:
    """GPS week 0 began on 1980-01-06; week 2300 is 2300 x 7 days later; no leap seconds."""
    assert (ros.stamp_of(0, 0.0).sec, ros.stamp_of(0, 0.0).nanosec) == (315964800, 0)
    stamp = ros.stamp_of(2300, 1.25)
    assert (stamp.sec, stamp.nanosec) == (315964800 + 2300 * 604800 + 1, 250_000_000)


def test_fix_without_a_position_says_so() -> None:
    fix = ros.fix_from_solution(SolutionEpoch(gps_week=2300, tow_s=1.5), protected=True)
    assert fix.status.status == NavSatStatus.STATUS_NO_FIX
    assert math.isnan(fix.latitude)
    assert math.isnan(fix.longitude)
    assert math.isnan(fix.altitude)
    assert fix.status.service == 0


def test_fix_of_a_position() -> None:
    x, y, z = ecef_from_geodetic(math.radians(52.32), math.radians(10.56), 130.0)
    solution = SolutionEpoch(gps_week=2300, tow_s=1.5, x_m=float(x), y_m=float(y), z_m=float(z))
    solution.elevation_rad[[3, 40]] = 0.5
    assert ros.fix_from_solution(solution, protected=False).status.status == NavSatStatus.STATUS_NO_FIX
    fix = ros.fix_from_solution(solution, protected=True)
    assert fix.status.status == NavSatStatus.STATUS_GBAS_FIX
    assert fix.status.service == NavSatStatus.SERVICE_GPS | NavSatStatus.SERVICE_GALILEO
    assert fix.position_covariance_type == NavSatFix.COVARIANCE_TYPE_UNKNOWN
    # 1e-9 degrees are 0.1 mm, far above the rounding of the transformation and far below any use of the fix.
    assert fix.latitude == pytest.approx(52.32, abs=1e-9)
    assert fix.longitude == pytest.approx(10.56, abs=1e-9)
    assert fix.altitude == pytest.approx(130.0, abs=1e-4)
    part = replace(solution, y_m=math.nan)
    assert ros.fix_from_solution(part, protected=True).status.status == NavSatStatus.STATUS_NO_FIX


def test_quality_of_service_is_reliable_and_latched_where_a_late_reader_needs_it() -> None:
    for spec in topics.TOPICS:
        assert qos_of(spec.name).latched == spec.latched, spec.name
        assert ros.qos_profile(qos_of(spec.name)).reliability.name == "RELIABLE"
        assert ros.qos_profile(qos_of(spec.name)).history.name == "KEEP_LAST"
