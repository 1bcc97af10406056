"""Flow control and playback speed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_node.pacing import Pacer, Playback


def test_window_fills_and_empties() -> None:
    pacer = Pacer(2, ["end"])
    pacer.sent(1000)
    assert pacer.may_send()
    pacer.sent(1500)
    assert not pacer.may_send()
    assert pacer.lagging == ("end",)
    assert pacer.on_progress("end", 1000)
    assert pacer.may_send()
    assert pacer.outstanding == 1


def test_slowest_reader_counts() -> None:
    pacer = Pacer(1, ["ground", "air"])
    pacer.sent(1000)
    assert not pacer.on_progress("ground", 1000)
    assert pacer.lagging == ("air",)
    assert pacer.on_progress("air", 1000)


def test_an_epoch_waits_only_for_the_readers_that_get_it() -> None:
    pacer = Pacer(1, ["ground", "air"])
    pacer.sent(1000, ["ground"])
    assert pacer.on_progress("ground", 1000)
    pacer.sent(1500)
    assert not pacer.on_progress("ground", 1500)
    assert pacer.on_progress("air", 1500)


def test_progress_on_a_later_epoch_covers_those_before() -> None:
    pacer = Pacer(3, ["end"])
    for key in (1, 2, 3):
        pacer.sent(key)
    assert pacer.on_progress("end", 3)
    assert pacer.outstanding == 0
    assert pacer.lagging == ()


def test_progress_that_goes_back_or_comes_from_others_changes_nothing() -> None:
    pacer = Pacer(1, ["end"])
    pacer.on_progress("end", 5)
    pacer.sent(6)
    assert not pacer.on_progress("end", 4)
    assert not pacer.on_progress("somebody", 6)
    assert not pacer.may_send()


def test_without_readers_nothing_is_waited_for() -> None:
    pacer = Pacer(1, [])
    for key in range(100):
        assert pacer.may_send()
        pacer.sent(key)
    assert pacer.n_sent == 100


@given(window=st.integers(1, 10), order=st.lists(st.sampled_from(["send", "a", "b"]), max_size=200))
def test_never_more_under_way_than_the_window(window: int, order: list[str]) -> None:
    """Second formulation: an epoch is under way from its sending until both readers have passed it."""
    pacer, sent, done = Pacer(window, ["a", "b"]), 0, {"a": 0, "b": 0}
    for what in order:
        if what == "send" and pacer.may_send():
            sent += 1
            pacer.sent(sent)
        elif what != "send" and done[what] < sent:
            done[what] += 1
            pacer.on_progress(what, done[what])
        under_way = sent - min(done.values())
        assert pacer.outstanding == under_way
        assert under_way <= window
        assert pacer.may_send() == (under_way < window)


@pytest.mark.parametrize("window", [0, -1])
def test_impossible_window_is_refused(window: int) -> None:
    with pytest.raises(ValueError, match="window_epochs"):
        Pacer(window, [])


def test_playback_keeps_to_the_first_epoch() -> None:
    playback = Playback(2.0)
    assert playback.delay_s(10_000, 100.0) == 0.0
    assert playback.delay_s(11_000, 100.1) == pytest.approx(0.4)  # due at 100.5
    assert playback.delay_s(11_000, 100.6) == 0.0  # late: at once,
    assert playback.delay_s(12_000, 100.6) == pytest.approx(0.4)  # and the next is not moved (due at 101.0)


def test_speed_zero_never_waits() -> None:
    playback = Playback(0.0)
    assert [playback.delay_s(key, 0.0) for key in (0, 10**9)] == [0.0, 0.0]


@pytest.mark.parametrize("speed", [-1.0, float("inf"), float("nan")])
def test_impossible_speed_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="speed"):
        Playback(speed)
