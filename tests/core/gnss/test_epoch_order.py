"""Which epochs are taken, refused, or begin time anew."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss.epoch_order import RESTART_AFTER_REFUSED, Arrival, EpochOrder, RefusedEpochs

START = 1_000_000


def arrivals(epochs: list[int], order: EpochOrder | None = None) -> tuple[list[Arrival], EpochOrder]:
    order, told = order or EpochOrder(), []
    for epoch_ms in epochs:
        order, arrival = order.step(epoch_ms)
        told.append(arrival)
    return told, order


def test_epochs_that_go_forward_are_taken() -> None:
    told, order = arrivals([START, START + 500, START + 90_000])
    assert told == [Arrival.TAKEN] * 3
    assert order == EpochOrder(last_ms=START + 90_000)


def test_an_epoch_that_is_not_later_is_refused_and_changes_nothing_after_it() -> None:
    told, order = arrivals([START, START, START - 500, START + 500])
    assert told == [Arrival.TAKEN, Arrival.REFUSED, Arrival.REFUSED, Arrival.TAKEN]
    assert order == EpochOrder(last_ms=START + 500)


def test_a_stream_that_goes_on_in_the_past_is_believed_in_the_end() -> None:
    past = [500 * k for k in range(RESTART_AFTER_REFUSED + 2)]
    told, order = arrivals([START, *past])
    refused, begun = RESTART_AFTER_REFUSED - 1, [Arrival.RESTART, Arrival.TAKEN, Arrival.TAKEN]
    assert told == [Arrival.TAKEN, *[Arrival.REFUSED] * refused, *begun]
    assert order.last_ms == past[-1]


def test_going_back_begins_the_count_anew() -> None:
    half = [500 * k for k in range(RESTART_AFTER_REFUSED - 1)]
    told, _ = arrivals([START, *half, *half, 0])
    assert set(told[1:]) == {Arrival.REFUSED}


def test_an_epoch_in_time_ends_the_count() -> None:
    half = [500 * k for k in range(RESTART_AFTER_REFUSED - 1)]
    told, _ = arrivals([START, *half, START + 500, *[20_000 + each for each in half]])
    assert Arrival.RESTART not in told


def test_the_same_epoch_of_several_sources_counts_once() -> None:
    """Two receivers whose streams begin again together."""
    twice = [epoch for k in range(RESTART_AFTER_REFUSED) for epoch in (500 * k, 500 * k)]
    told, _ = arrivals([START, *twice])
    assert told.index(Arrival.RESTART) == 1 + 2 * (RESTART_AFTER_REFUSED - 1)


def test_time_since_the_last_epoch() -> None:
    assert math.isnan(EpochOrder().since_last_s(START))
    assert EpochOrder(last_ms=START).since_last_s(START - 1500) == -1.5


@given(st.lists(st.integers(min_value=0, max_value=40), max_size=60))
def test_taken_epochs_rise_between_restarts(epochs: list[int]) -> None:
    """Written out: the last taken, and a list of the refused that rises strictly but for repetitions."""
    order, last, rising = EpochOrder(), None, []
    for epoch in epochs:
        order, arrival = order.step(epoch)
        if last is None or epoch > last:
            assert arrival is Arrival.TAKEN
            last, rising = epoch, []
            continue
        rising = [*rising, epoch] if not rising or epoch > rising[-1] else rising if epoch == rising[-1] else [epoch]
        if len(rising) >= RESTART_AFTER_REFUSED:
            assert arrival is Arrival.RESTART
            last, rising = epoch, []
        else:
            assert arrival is Arrival.REFUSED
            assert order.refused == RefusedEpochs(count=len(rising), last_ms=epoch)
