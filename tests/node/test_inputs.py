"""When a node gives up on what others still owe it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gbas_node.inputs import InputWatch

START_WAIT_S = 20.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Wall time of the watch, as set."""
    time = SimpleNamespace(now_s=100.0)
    monkeypatch.setattr("gbas_node.inputs.time.monotonic", lambda: time.now_s)
    return time


def joiner(deadline_s: float | None, *, heard_all: bool = True) -> SimpleNamespace:
    return SimpleNamespace(deadline_s=deadline_s, heard_all=heard_all)


def test_nothing_is_given_up_before_anything_was_heard(clock: SimpleNamespace) -> None:
    watch = InputWatch()
    assert watch.wait_s(joiner(90.0), 200.0, START_WAIT_S) > 0.0
    watch.heard()
    assert watch.wait_s(joiner(None), 200.0, START_WAIT_S) > 0.0


def test_what_is_overdue_may_still_be_received_once(clock: SimpleNamespace) -> None:
    watch = InputWatch()
    watch.heard()
    assert watch.wait_s(joiner(103.0), 101.0, START_WAIT_S) == 2.0
    assert watch.wait_s(joiner(103.0), 103.0, START_WAIT_S) > 0.0  # the process may not have run
    assert watch.wait_s(joiner(103.0), 103.1, START_WAIT_S) == 0.0
    watch.activity += 1  # a message came: what is overdue may be the next
    assert watch.wait_s(joiner(103.0), 103.1, START_WAIT_S) > 0.0
    assert watch.wait_s(joiner(103.0), 103.2, START_WAIT_S) == 0.0


def test_inputs_never_heard_have_the_time_of_the_start(clock: SimpleNamespace) -> None:
    watch = InputWatch()
    watch.heard()
    assert watch.wait_s(joiner(103.0, heard_all=False), 110.0, START_WAIT_S) == 10.0


def test_silence_is_since_the_last_input(clock: SimpleNamespace) -> None:
    watch = InputWatch()
    clock.now_s = 130.0
    watch.heard()
    assert watch.silent_s(135.0) == 5.0
