"""Ephemerides come on a topic of their own; what an epoch sees of them must not depend on an executor's order."""

from __future__ import annotations

from typing import Any

import pytest
from rclpy.duration import Duration

from gbas_core.gnss.gpstime import epoch_key
from gbas_msgs_py import tables, topics
from gbas_node.node import GbasNode
from gbas_node.serving import light_executor
from synthetic_ranges import TOW_S, WEEK, constellation

pytestmark = pytest.mark.ros


def test_acknowledged_ephemerides_are_there_whatever_the_executor_has_done(probe: Any) -> None:
    """The node here never had an executor: the extreme of one that hands observations over first."""
    node = GbasNode("reader", context=probe.context)
    received = node.ephemeris_input()
    sent = [constellation(), constellation(tow_s=TOW_S + 30.0)]
    for each in sent:
        probe.send(topics.EPHEMERIS, tables.EPHEMERIS, each)
    assert probe.publisher(topics.EPHEMERIS).wait_for_all_acked(Duration(seconds=30))
    key = epoch_key(WEEK, TOW_S)
    assert [each.tow_s for each in received.take(key)] == [TOW_S]
    assert received.take(key) == ()

    executor = light_executor(probe.context)  # has been told of two messages that are no longer there
    executor.add_node(node)
    executor.spin_once(timeout_sec=0.1)
    assert [each.tow_s for each in received.take(key + 30_000)] == [TOW_S + 30.0]
    executor.remove_node(node)
    executor.shutdown()
    node.destroy_node()
