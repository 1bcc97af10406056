"""Work that waits for its readers."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from gbas_node.start_gate import StartGate


def output(readers: int) -> SimpleNamespace:
    """Stands for a publisher: its name, and how many read it."""
    made = SimpleNamespace(topic_name="/gbas/corrections", readers=readers)
    made.get_subscription_count = lambda: made.readers
    return made


def test_work_waits_keeps_its_order_and_is_done_at_once_later() -> None:
    done: list[int] = []
    gate = StartGate(wait_s=60.0)
    assert not gate.waiting
    for number in range(3):
        gate.when_ready(lambda number=number: done.append(number))
    assert (done, gate.backlog, gate.waiting, gate.starting) == ([], 3, True, True)
    gate.open()
    assert (done, gate.backlog, gate.waiting) == ([0, 1, 2], 0, False)
    gate.when_ready(lambda: done.append(3))
    assert done == [0, 1, 2, 3]


def test_outputs_without_their_readers_are_named() -> None:
    gate = StartGate(wait_s=60.0)
    wanted = output(1)
    gate.add(wanted, 2)
    gate.add(output(0), 0)
    assert gate.missing_readers() == ["/gbas/corrections has 1 of 2 readers"]
    wanted.readers = 2
    assert gate.missing_readers() == []


def test_the_wait_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    time = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr("gbas_node.start_gate.time.monotonic", lambda: time.now_s)
    gate = StartGate(wait_s=5.0)
    time.now_s = 100.0  # counts from the first work on
    gate.when_ready(lambda: None)
    time.now_s = 104.9
    assert gate.starting
    time.now_s = 105.0
    assert not gate.starting
    assert gate.waiting
