"""Joining streams by epoch: what is given out depends on the data, not on how the streams interleave."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss.epoch_order import RESTART_AFTER_REFUSED
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_msgs_py.joining import (
    MAX_WAITING_BURSTS,
    AirborneJoiner,
    BurstQueue,
    EpochJoiner,
    JoinedEpoch,
    ReceptionQueue,
)
from gbas_vdb.transmission.burst import Burst

START = epoch_key(2300, 1000.0)


def burst(key: int, slot: int = 0, in_frame: int = 1) -> Burst:
    week, tow_s = from_epoch_key(key)
    payload = bytes([slot + 1]) if in_frame else b""
    return Burst(gps_week=week, tow_s=tow_s, slot=slot, bursts_in_frame=in_frame, payload=payload)


def interleavings(streams: dict[str, list[Any]], seed: int) -> list[tuple[str, Any]]:
    """The streams' items in some order that keeps each stream's own."""
    rng, left = random.Random(seed), {name: list(items) for name, items in streams.items()}
    order = []
    while any(left.values()):
        name = rng.choice([name for name, items in left.items() if items])
        order.append((name, left[name].pop(0)))
    return order


# --- epochs of several sources


def test_an_epoch_is_complete_when_all_have_delivered() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    assert joiner.add("rr1", 500, "a", 0.0) == []
    assert joiner.add("rr2", 500, "b", 0.1) == [JoinedEpoch(key=500, items={"rr1": "a", "rr2": "b"})]


def test_a_later_epoch_of_a_stream_says_that_it_skipped_the_one_before() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 500, "a", 0.0)
    assert joiner.add("rr2", 1000, "b", 0.0) == [JoinedEpoch(key=500, items={"rr1": "a"})]
    assert joiner.add("rr1", 1000, "c", 0.0) == [JoinedEpoch(key=1000, items={"rr2": "b", "rr1": "c"})]


def test_deadline_counts_from_the_first_item_and_names_what_is_missing() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2", "rr3"], timeout_s=1.0)
    joiner.add("rr2", 500, "b", 10.0)
    joiner.add("rr1", 500, "a", 10.9)
    assert joiner.deadline_s == 11.0
    assert joiner.expire(10.999) == []
    assert joiner.expire(11.0) == [JoinedEpoch(key=500, items={"rr2": "b", "rr1": "a"}, timed_out=("rr3",))]
    assert joiner.timed_out == {"rr1": 0, "rr2": 0, "rr3": 1}
    assert joiner.deadline_s is None


def test_what_comes_after_its_epoch_is_dropped_and_counted() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 500, "a", 0.0)
    joiner.expire(2.0)
    assert joiner.add("rr2", 500, "late", 2.1) == []
    assert joiner.add("rr2", 400, "later still", 2.2) == []
    assert joiner.dropped("rr2") == 2
    joiner.add("rr1", 1000, "c", 3.0)
    assert joiner.add("rr2", 1000, "d", 3.0)[0].items == {"rr1": "c", "rr2": "d"}


def test_the_first_of_two_items_of_an_epoch_counts() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 500, "first", 0.0)
    assert joiner.add("rr1", 500, "second", 0.0) == []
    assert joiner.dropped("rr1") == 1
    assert joiner.add("rr2", 500, "b", 0.0)[0].items["rr1"] == "first"


def test_epochs_before_an_overdue_one_go_with_it() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 1000, "b", 0.0)
    joiner.add("rr2", 500, "a", 0.5)  # rr1 has passed it, so it is complete though its deadline has not come
    assert [epoch.key for epoch in joiner.expire(1.0)] == [1000]
    assert joiner.last_key == 1000


def test_end_of_the_data_gives_out_the_rest() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 500, "a", 0.0)
    joiner.add("rr1", 1000, "b", 0.0)
    assert [epoch.key for epoch in joiner.flush()] == [500, 1000]
    assert joiner.flush() == []


def test_sources_never_heard_are_known() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    joiner.add("rr1", 500, "a", 0.0)
    assert not joiner.heard_all
    joiner.add("rr2", 1000, "b", 0.0)
    assert joiner.heard_all


@given(
    present=st.lists(st.lists(st.sampled_from(["rr1", "rr2", "rr3"]), unique=True, min_size=1), max_size=30),
    seed=st.integers(0, 1000),
)
def test_interleaving_does_not_matter(present: list[list[str]], seed: int) -> None:
    """Second formulation: group by key. Every stream ends with a common last epoch, so all before it is decided."""
    keys = [START + 500 * n for n in range(len(present) + 1)]
    delivered = {
        key: {name: (name, key) for name in names}
        for key, names in zip(keys, [*present, ["rr1", "rr2", "rr3"]], strict=True)
    }
    streams = {name: [key for key in keys if name in delivered[key]] for name in ("rr1", "rr2", "rr3")}
    joiner: EpochJoiner[Any] = EpochJoiner(list(streams), timeout_s=1.0)
    given_out = []
    for name, key in interleavings(streams, seed):
        given_out += joiner.add(name, key, (name, key), 0.0)
    assert [(epoch.key, epoch.items, epoch.timed_out) for epoch in given_out] == [(k, delivered[k], ()) for k in keys]
    assert sum(joiner.dropped(name) for name in streams) == 0


def test_joiner_without_sources_or_time_is_refused() -> None:
    with pytest.raises(ValueError, match="sources"):
        EpochJoiner([], timeout_s=1.0)
    for timeout_s in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="timeout_s"):
            EpochJoiner(["rr1"], timeout_s=timeout_s)


# --- items with a time of reception


def test_items_are_given_out_from_their_reception_on_and_once() -> None:
    queue: ReceptionQueue[str] = ReceptionQueue()
    for key, name in ((2000, "b"), (1000, "a"), (2000, "c"), (3000, "d")):
        queue.add(key, name)
    assert queue.take(999) == ()
    assert queue.take(2000) == ("a", "b", "c")
    assert queue.take(2000) == ()
    queue.add(500, "late")
    assert queue.take(2500) == ("late",)
    assert len(queue) == 1


# --- bursts and observations


@pytest.mark.parametrize(
    ("wait_s", "expected"),
    [
        (0.5, [0, 500, 1000]),  # the frame that starts with its own epoch
        (0.0, [0, 500]),  # output at once: the frame before
        (0.25, [0, 500]),  # not long enough for a frame to be over
        (1.0, [0, 500, 1000, 1500]),
    ],
)
def test_bursts_of_an_observation_follow_the_waiting_time(wait_s: float, expected: list[int]) -> None:
    queue = BurstQueue(wait_s)
    queue.add(burst(START + offset) for offset in (0, 500, 1000, 1500, 2000))
    assert [epoch_key(b.gps_week, b.tow_s) - START for b in queue.take(START + 1000)] == expected


def test_bursts_come_once_in_order_of_frame_and_slot() -> None:
    queue = BurstQueue(0.5)
    queue.add([burst(START + 500, 3, 2), burst(START, 1, 2), burst(START, 0, 2), burst(START + 500, 1, 2)])
    taken = queue.take(START + 500)
    assert [(epoch_key(b.gps_week, b.tow_s) - START, b.slot) for b in taken] == [(0, 0), (0, 1), (500, 1), (500, 3)]
    assert queue.take(START + 1000) == ()


def test_a_burst_after_its_observation_goes_to_the_next() -> None:
    queue = BurstQueue(0.5)
    queue.take(START)
    queue.add([burst(START)])
    assert len(queue.take(START + 500)) == 1


def test_of_two_bursts_in_a_slot_the_first_counts() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_burst(burst(START))
    joiner.add_burst(burst(START))
    assert joiner.dropped_bursts == 1
    assert len(joiner.add_observation(START, "o", 0.0)[0].bursts) == 1


def test_bursts_that_nobody_fetches_are_bounded() -> None:
    queue = BurstQueue(0.5)
    queue.add(burst(START + 500 * n) for n in range(MAX_WAITING_BURSTS + 10))
    taken = queue.take(START + 500 * (MAX_WAITING_BURSTS + 10))
    assert len(taken) == MAX_WAITING_BURSTS
    assert queue.overflow == 10
    assert epoch_key(taken[0].gps_week, taken[0].tow_s) == START + 5000  # the oldest are lost


def test_an_observation_waits_for_its_whole_frame() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    assert joiner.add_observation(START, "o", 0.0) == []
    assert joiner.add_burst(burst(START, 0, 2)) == []
    (ready,) = joiner.add_burst(burst(START, 1, 2))
    assert (ready.key, ready.item, ready.timed_out) == (START, "o", False)
    assert [b.slot for b in ready.bursts] == [0, 1]


def test_a_frame_that_lost_a_burst_is_over_when_a_later_one_is_heard() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_observation(START, "o", 0.0)
    joiner.add_burst(burst(START, 1, 2))
    (ready,) = joiner.add_burst(burst(START + 500, 0, 2))
    assert [b.slot for b in ready.bursts] == [1]
    assert not ready.timed_out


def test_an_empty_frame_ends_the_wait_and_reaches_nobody() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_observation(START, "o", 0.0)
    (ready,) = joiner.add_burst(burst(START, in_frame=0))
    assert ready.bursts == ()
    assert not ready.timed_out


def test_silence_of_the_vdb_costs_the_timeout_from_arrival() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_observation(START, "a", 10.0)
    joiner.add_observation(START + 500, "b", 10.5)
    assert joiner.deadline_s == 11.0
    (first,) = joiner.expire(11.2)
    assert (first.item, first.timed_out) == ("a", True)
    assert joiner.deadline_s == 11.5
    assert joiner.timed_out == 1
    assert not joiner.heard_all


def test_a_late_frame_reaches_the_next_observation() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_observation(START, "a", 0.0)
    joiner.expire(1.0)
    joiner.add_burst(burst(START))
    joiner.add_burst(burst(START + 500))
    (ready,) = joiner.add_observation(START + 500, "b", 1.0)
    assert [epoch_key(b.gps_week, b.tow_s) - START for b in ready.bursts] == [0, 500]


def test_late_and_repeated_observations_are_dropped_and_counted() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    joiner.add_observation(START, "a", 0.0)
    joiner.add_observation(START, "again", 0.0)
    joiner.expire(5.0)
    assert joiner.add_observation(START - 500, "old", 5.0) == []
    assert joiner.dropped == 2


def test_equipment_that_outputs_at_once_needs_the_frame_before() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.0, timeout_s=1.0)
    joiner.add_burst(burst(START))
    (ready,) = joiner.add_observation(START + 500, "o", 0.0)
    assert len(ready.bursts) == 1


@given(
    frames=st.lists(st.integers(0, 4), min_size=1, max_size=25),
    observed=st.sets(st.integers(0, 24)),
    wait_s=st.sampled_from([0.0, 0.25, 0.5, 1.0]),
    seed=st.integers(0, 1000),
)
def test_live_interleaving_gives_what_the_rule_says(
    frames: list[int], observed: set[int], wait_s: float, seed: int
) -> None:
    """Second formulation: the observation at t has all bursts of frames up to t - 0.5 s + wait, not given before.

    A frame of zero bursts is announced as empty, so that data alone decide when each observation is ready.
    """
    keys = [START + 500 * n for n in range(len(frames))]
    sent = [
        each
        for key, count in zip(keys, frames, strict=True)
        for each in [burst(key, s, count) for s in range(count)] or [burst(key, in_frame=0)]
    ]
    observations = [START + 500 * n for n in sorted(observed) if n < len(frames)]
    joiner: AirborneJoiner[int] = AirborneJoiner(correction_wait_s=wait_s, timeout_s=1.0)
    ready = []
    for name, item in interleavings({"vdb": sent, "observations": observations}, seed):
        ready += joiner.add_observation(item, item, 0.0) if name == "observations" else joiner.add_burst(item)
    ready += joiner.flush()

    expected, left = [], [each for each in sent if each.bursts_in_frame]
    for key in observations:
        limit = key - 500 + round(1000 * wait_s)
        mine = [each for each in left if epoch_key(each.gps_week, each.tow_s) <= limit]
        left = [each for each in left if each not in mine]
        expected.append((key, tuple(mine)))
    assert [(each.key, each.bursts) for each in ready] == expected


def test_negative_wait_is_refused() -> None:
    for wait_s in (-0.1, float("nan")):
        with pytest.raises(ValueError, match="correction_wait_s"):
            BurstQueue(wait_s)


# --- a time that was wrong

DAY_MS = 86_400_000


def test_one_epoch_from_the_future_does_not_end_the_ground() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    given = []
    for key in (START, START + 500 + DAY_MS, *range(START + 1000, START + 20_000, 500)):
        given += [joined.key for source in ("rr1", "rr2") for joined in joiner.add(source, key, "x", 0.0)]
    resumed = START + 1000 + 500 * (RESTART_AFTER_REFUSED - 1)
    assert given == [START, START + 500 + DAY_MS, *range(resumed, START + 20_000, 500)]


def test_one_epoch_from_the_future_does_not_end_the_aircraft() -> None:
    joiner: AirborneJoiner[str] = AirborneJoiner(correction_wait_s=0.5, timeout_s=1.0)
    given = []
    for key in (START, START + 500 + DAY_MS, *range(START + 1000, START + 20_000, 500)):
        given += joiner.add_observation(key, "x", 0.0)
        given += joiner.add_burst(burst(key))
    assert [each.key for each in given[:2]] == [START, START + 500 + DAY_MS]
    assert given[-1].key == START + 19_500
    assert len(given) >= 2 + 37 - RESTART_AFTER_REFUSED  # what was late while the time was still in doubt is lost
    # the frame of its own epoch is waited for as before
    assert all([epoch_key(b.gps_week, b.tow_s) for b in each.bursts] == [each.key] for each in given[-20:])


def test_a_stream_that_comes_late_is_no_new_time() -> None:
    joiner: EpochJoiner[str] = EpochJoiner(["rr1", "rr2"], timeout_s=1.0)
    for k in range(40):
        joiner.add("rr1", START + 500 * k, "x", 0.5 * k)
        joiner.expire(0.5 * k + 10.0)
        if k >= 3:
            joiner.add("rr2", START + 500 * (k - 3), "y", 0.5 * k)
    assert joiner.late["rr2"] == 37
    assert joiner.last_key == START + 500 * 39
