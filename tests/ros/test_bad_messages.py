"""Messages no node may believe: dropped, counted, reported, and the node goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray, UInt8MultiArray

from gbas_core.gnss.observations import ObservationEpoch
from gbas_msgs_py import ros, tables, topics
from gbas_msgs_py.modes import L1_100
from gbas_msgs_py.records import IntegrityEpoch, SolutionEpoch
from gbas_vdb.transmission.burst import Burst

pytestmark = pytest.mark.ros

STATION = {
    "station": {"id": "TEST", "gcid": 1, "latitude_deg": 41.3889, "longitude_deg": 2.112, "height_m": 166.0},
    "receivers": {"rr1_ecef_m": [4789013.0077, 176610.1555, 4195034.8091], "minimum": 1},
}
ALONE = {"start_wait_s": 0.0}
Change = Callable[[Any], None]


def table(schema: Any, record: Any, **values: float) -> Float64MultiArray:
    """Message of a record with numbers changed afterwards, which no encoder of ours would let pass."""
    message = ros.table_to_msg(schema, record)
    for column, value in values.items():
        message.data[schema.columns.index(column)] = value
    return message


def labelled(message: Float64MultiArray, label: str) -> Float64MultiArray:
    message.layout.dim[1].label = label
    return message


def shortened(message: Float64MultiArray) -> Float64MultiArray:
    message.data = message.data[:-1]
    return message


def observed(tow_s: float) -> ObservationEpoch:
    record = ObservationEpoch(gps_week=2300, tow_s=tow_s, simulated=1.0)
    record.code_m[0, 3] = 2.2e7
    return record


def bad_tables(schema: Any, record: Any) -> list[tuple[Float64MultiArray, str]]:
    known, later = f"{schema.identifier}:", f"gbas/{schema.name}/{schema.version + 1}:"
    return [
        (table(schema, record, gps_week=np.nan), "gps_week is nan"),
        (table(schema, record, tow_s=np.nan), "tow_s is nan"),
        (table(schema, record, tow_s=1e9), "tow_s is 1000000000.0"),
        (labelled(table(schema, record), schema.label.replace(known, later)), later.removesuffix(":")),
        (labelled(table(schema, record), schema.label + ",more"), "columns, expected"),
        (labelled(table(schema, record), ""), "schema ''"),
        (shortened(table(schema, record)), "numbers, expected"),
        (Float64MultiArray(), "dimensions none"),
    ]


def check(probe: Any, node: str, topic: str, bad: list[tuple[Any, str]], publisher: Any) -> None:
    """Send each bad message and see it counted, with its reason."""
    status = probe.diagnostics()
    for number, (message, reason) in enumerate(bad, start=1):
        publisher.publish(message)

        def counted(number: int = number) -> bool:
            return status.get(node, (0, "", {}))[2].get(f"count of bad message on {topic}") == str(number)

        probe.until(counted, f"bad message {number} ({reason}) counted")
        level, text, values = status[node]
        assert reason in values["last_problem"], values
        # Reported as stale while there has been no good epoch, as a warning otherwise; never as well.
        assert level != b"\x00", text
    assert values["problems"] == str(len(bad))


def test_integrity_monitor(launcher: Any, probe: Any) -> None:
    topic, schema = topics.GROUND_OBSERVATIONS[0], tables.OBSERVATIONS
    integrity = probe.listen(topics.GROUND_INTEGRITY)
    process = launcher.start("gbas_ground.nodes.integrity_monitor", {"ground": STATION, **ALONE})
    bad = [
        *bad_tables(schema, observed(10.0)),
        (table(schema, observed(10.0), sat=33.0), "sat 33"),
        (table(schema, observed(10.0), code_l1_m=np.inf), "code_l1_m is infinite"),
    ]
    check(probe, "integrity_monitor", topic, bad, probe.publisher(topic))
    probe.send(topic, schema, observed(11.0))
    probe.until(lambda: integrity, "the next good epoch")
    assert [each.tow_s for each in integrity] == [11.0]
    assert process.running


def test_a_nan_in_a_value_is_a_missing_value(launcher: Any, probe: Any) -> None:
    """NaN is how missing is written: the message is good, the satellite is not used."""
    integrity = probe.listen(topics.GROUND_INTEGRITY)
    launcher.start("gbas_ground.nodes.integrity_monitor", {"ground": STATION, **ALONE})
    message = table(tables.OBSERVATIONS, observed(10.0), code_l1_m=np.nan)
    probe.publisher(topics.GROUND_OBSERVATIONS[0]).publish(message)
    probe.until(lambda: integrity, "the epoch")
    assert np.isnan(integrity[0].prc_m).all()


def test_correction_broadcast(launcher: Any, probe: Any) -> None:
    topic, schema = topics.GROUND_INTEGRITY, tables.INTEGRITY
    bursts = probe.bursts()
    process = launcher.start("gbas_ground.nodes.correction_broadcast", {"ground": STATION, **ALONE})
    bad = bad_tables(schema, IntegrityEpoch(gps_week=2300, tow_s=10.0))
    check(probe, "correction_broadcast", topic, bad, probe.publisher(topic))
    probe.send(topic, schema, IntegrityEpoch(gps_week=2300, tow_s=11.0))
    probe.until(lambda: bursts, "the next good frame")
    assert {each.tow_s for each in bursts} == {11.0}
    assert process.running


def test_positioning(launcher: Any, probe: Any) -> None:
    solutions = probe.listen(topics.AIRBORNE_SOLUTION)
    process = launcher.start("gbas_airborne.nodes.positioning", ALONE)
    good = Burst(gps_week=2300, tow_s=10.0, slot=0, bursts_in_frame=1, payload=bytes(50))
    late, long = ros.burst_to_msg(good), ros.burst_to_msg(good)
    late.layout.dim[2].size = 604_800_000
    long.data = long.data * 5
    long.layout.dim[5].size = 250
    bad = [(late, "tow_ms is 604800000"), (long, "bytes is 250"), (UInt8MultiArray(), "layout has dimensions []")]
    check(probe, "positioning", topics.VDB, bad, probe.publisher(topics.VDB, UInt8MultiArray))
    # Noise in a good frame is the decoder's business: it goes in, and no position comes out.
    probe.send(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, observed(10.0))
    probe.publisher(topics.VDB, UInt8MultiArray).publish(ros.burst_to_msg(good))
    probe.until(lambda: solutions, "the next good epoch")
    assert np.isnan(solutions[0].x_m)
    assert process.running


def test_protection_level(launcher: Any, probe: Any) -> None:
    topic, schema = topics.AIRBORNE_SOLUTION, tables.SOLUTION
    protections = probe.listen(topics.AIRBORNE_PROTECTION)
    process = launcher.start("gbas_airborne.nodes.protection_level", ALONE)
    bad = bad_tables(schema, SolutionEpoch(gps_week=2300, tow_s=10.0, mode=L1_100.number))
    check(probe, "protection_level", topic, bad, probe.publisher(topic))
    probe.send(topic, schema, SolutionEpoch(gps_week=2300, tow_s=11.0, mode=L1_100.number))
    probe.until(lambda: protections, "the next good epoch")
    assert (protections[0].tow_s, protections[0].service, protections[0].alert) == (11.0, 0.0, 1.0)
    assert process.running
