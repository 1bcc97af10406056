"""The 0.5 s frame: what is sent when, and what does not fit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_vdb.errors import FieldError, ScheduleError
from gbas_vdb.messages import types as m
from gbas_vdb.transmission.burst import Burst
from gbas_vdb.transmission.frame import Frame, ScheduleParams, ScheduleState, SourceCorrection, Sources
from gbas_vdb.transmission.receive import decode_burst
from gbas_vdb.transmission.rotation import FRAMES_AFTER_CHANGE, FRAMES_BETWEEN, choose_first
from gbas_vdb.transmission.schedule import schedule_frame, sources_that_fit
from vdb_frames import STATION, approach, messages, source


def frames(
    n_frames: int,
    sources: Callable[[int], Sequence[SourceCorrection]],
    params: ScheduleParams,
    *,
    station: Callable[[int], m.Type2] = lambda _: STATION,
    approaches: Sequence[m.FasDataSet] = (),
    predictions: m.Type5 | None = None,
) -> list[tuple[Burst, ...]]:
    state, sent = ScheduleState(), []
    for number in range(n_frames):
        frame = Frame(
            gps_week=2300,
            tow_s=100.0 + 0.5 * number,
            sources=Sources.of(sources(number)),
            station=station(number),
            approaches=tuple(approaches),
            predictions=predictions,
        )
        state, bursts = schedule_frame(state, frame, params)
        sent.append(bursts)
    return sent


def intervals(sent: Sequence[tuple[Burst, ...]], present: Callable[[tuple[Burst, ...]], bool]) -> list[int]:
    """Frames from one sending to the next, counted from before the first frame and to behind the last."""
    places = [-1, *(number for number, bursts in enumerate(sent) if present(bursts))]
    return [after - before for before, after in zip(places, [*places[1:], len(sent)], strict=True)]


ONE_SLOT = ScheduleParams(station_id="EDVE", slots=(1,))
TWO_SLOTS_D = ScheduleParams(station_id="EDVE", slots=(0, 3), message_types=(1, 11))


# ---- one frame ----


def test_a_frame_carries_the_epoch_and_every_satellite() -> None:
    ((burst,),) = frames(1, lambda _: [source(number) for number in (9, 3, 27)], ONE_SLOT)
    assert (burst.gps_week, burst.tow_s, burst.slot, burst.bursts_in_frame) == (2300, 100.0, 1, 1)
    (type1,) = messages([burst], m.Type1)
    assert type1.modified_z_count_s == 100.0
    assert type1.additional_message_flag == 0
    assert sorted(item.ranging_source_id for item in type1.measurements) == [3, 9, 27]
    first = source(type1.measurements[0].ranging_source_id)
    assert type1.ephemeris_crc == first.ephemeris_crc
    assert type1.ephemeris_decorrelation == pytest.approx(first.decorrelation[1], abs=1e-12)
    assert type1.source_availability_s is None
    assert messages([burst], m.Type2)


def test_without_satellites_an_empty_message_is_sent() -> None:
    ((burst,),) = frames(1, lambda _: [], ONE_SLOT)
    (type1,) = messages([burst], m.Type1)
    assert type1.measurements == ()
    assert type1.ephemeris_crc is None
    first, _ = frames(2, lambda _: [], TWO_SLOTS_D)
    assert len(messages(first, m.Type11)) == 1


def test_type11_follows_type1() -> None:
    ((*bursts,),) = frames(1, lambda _: [source(number, gast_d=True) for number in range(1, 19)], TWO_SLOTS_D)
    assert [burst.slot for burst in bursts] == [0, 3]
    assert {burst.bursts_in_frame for burst in bursts} == {2}
    (type1,), (type11,) = messages(bursts, m.Type1), messages(bursts, m.Type11)
    order = [item.ranging_source_id for item in type1.measurements]
    assert [item.ranging_source_id for item in type11.measurements] == order
    assert type11.modified_z_count_s == type1.modified_z_count_s
    assert type11.ephemeris_decorrelation_d == pytest.approx(order[0] * 1e-5, abs=1e-12)


@pytest.mark.parametrize("n_sources", [19, 24, 36])
def test_more_than_18_satellites_are_a_linked_pair(n_sources: int) -> None:
    params = ScheduleParams(station_id="EDVE", slots=(0, 1, 2, 3), message_types=(1, 11))
    ((*bursts,),) = frames(1, lambda _: [source(number, gast_d=True) for number in range(1, n_sources + 1)], params)
    for kind in (m.Type1, m.Type11):
        first, second = messages(bursts, kind)
        assert (first.additional_message_flag, second.additional_message_flag) == (1, 3)
        assert first.modified_z_count_s == second.modified_z_count_s == 100.0
        found = [item.ranging_source_id for item in (*first.measurements, *second.measurements)]
        assert sorted(found) == list(range(1, n_sources + 1))
        assert max(len(first.measurements), len(second.measurements)) <= 18
    type1 = messages(bursts, m.Type1)
    assert [message.ephemeris_crc for message in type1] == [
        source(message.measurements[0].ranging_source_id).ephemeris_crc for message in type1
    ]


def test_no_burst_is_longer_than_222_bytes() -> None:
    for n_sources in range(37):
        params = ScheduleParams(station_id="EDVE", slots=(0, 1, 2, 3), message_types=(1, 11))
        for bursts in frames(3, lambda _, n=n_sources: [source(i, gast_d=True) for i in range(1, n + 1)], params):
            assert all(len(burst.payload) <= 228 for burst in bursts)


def test_what_does_not_fit_names_bytes_and_slots() -> None:
    with pytest.raises(ScheduleError, match=r"\(215 \+ 140 bytes\) do not fit slot B of 222 bytes each"):
        frames(
            1,
            lambda _: [source(number, gast_d=True) for number in range(1, 19)],
            replace(ONE_SLOT, message_types=(1, 11)),
        )
    with pytest.raises(ScheduleError, match="37 ranging sources"):
        frames(1, lambda _: [source(number) for number in range(1, 38)], ONE_SLOT)


def test_station_data_that_never_find_room_are_an_error_after_20_frames() -> None:
    # 215 bytes of type 1 leave 7: the 34 bytes of the type 2 message never fit.
    def full(_: int) -> list[SourceCorrection]:
        return [source(number) for number in range(1, 19)]

    frames(19, full, ONE_SLOT)
    with pytest.raises(ScheduleError, match=r"station data \(34 bytes\) found no room in 20 frames.*slot B: 215"):
        frames(20, full, ONE_SLOT)


@pytest.mark.parametrize(
    ("station", "approaches", "params"),
    [
        (STATION, (), ONE_SLOT),
        (STATION, (approach(1), approach(2)), ONE_SLOT),
        (STATION, (approach(1),), replace(ONE_SLOT, message_types=(1, 11))),
        (STATION, (approach(1), approach(2)), TWO_SLOTS_D),
        (STATION, (approach(1),), replace(TWO_SLOTS_D, slots=(0, 3, 5))),
        (STATION, (), replace(ONE_SLOT, slots=(0, 1, 2, 3), message_types=(1, 11))),
    ],
)
def test_capacity_is_what_can_be_sent(
    station: m.Type2, approaches: tuple[m.FasDataSet, ...], params: ScheduleParams
) -> None:
    capacity = sources_that_fit(station, approaches, params)

    def some(count: int) -> Callable[[int], list[SourceCorrection]]:
        return lambda _: [source(number, gast_d=11 in params.message_types) for number in range(1, count + 1)]

    sent = frames(45, some(capacity), params, approaches=approaches)
    assert len(sent) == 45
    if capacity < 36:
        with pytest.raises(ScheduleError):
            frames(45, some(capacity + 1), params, approaches=approaches)


def test_a_source_twice_is_refused() -> None:
    with pytest.raises(ScheduleError, match="twice"):
        frames(1, lambda _: [source(3), source(3)], ONE_SLOT)


def test_a_source_without_a_type_1_correction_is_refused() -> None:
    with pytest.raises(ScheduleError, match="no correction for message type 1"):
        frames(1, lambda _: [replace(source(3), corrections={})], ONE_SLOT)


def test_a_source_without_a_correction_of_each_type_is_refused() -> None:
    with pytest.raises(ScheduleError, match="ranging source 4 has no correction of its own for message type 11"):
        frames(1, lambda _: [source(3, gast_d=True), source(4)], TWO_SLOTS_D)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"slots": ()}, "slots"),
        ({"slots": (3, 1)}, "slots"),
        ({"slots": (0, 8)}, "slots"),
        ({"message_types": ()}, "message_types"),
        ({"message_types": (11, 1)}, "message_types"),
        ({"message_types": (1, 1)}, "message_types"),
        ({"message_types": (1, 2)}, "message_types"),
        ({"period_frames": 21}, "period_frames"),
        ({"period_frames": 0}, "period_frames"),
        ({"occupancy_min": 1.5}, "occupancy_min"),
        ({"station_id": "TOOLONG"}, "station_id"),
    ],
)
def test_bad_parameters_are_named(change: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        replace(ONE_SLOT, **change)


def test_a_value_that_cannot_be_sent_is_named() -> None:
    bad = source(5)
    bad = replace(bad, corrections={1: replace(bad.type1, prc_m=400.0)})
    with pytest.raises(FieldError, match=r"prc_m = 400\.0 outside -327\.67 to 327\.67 m"):
        frames(1, lambda _: [bad], ONE_SLOT)


# ---- over frames ----


def test_station_data_and_every_approach_within_20_frames() -> None:
    approaches = [approach(number) for number in range(1, 8)]
    sent = frames(100, lambda _: [source(number) for number in range(1, 11)], ONE_SLOT, approaches=approaches)
    assert max(intervals(sent, lambda bursts: bool(messages(bursts, m.Type2)))) <= 20
    for wanted in approaches:
        # Angles are rounded to 0.0005 seconds of arc: compare by the selector.
        selector = wanted.fas.reference_path_data_selector

        def present(bursts: tuple[Burst, ...], selector: int = selector) -> bool:
            found = [item for message in messages(bursts, m.Type4) for item in message.data_sets]
            return any(item.fas.reference_path_data_selector == selector for item in found)

        assert max(intervals(sent, present)) <= 20


def test_changed_station_data_are_sent_at_once() -> None:
    unhealthy = replace(STATION, gcid=7)
    sent = frames(
        30,
        lambda _: [source(number) for number in range(1, 6)],
        ONE_SLOT,
        station=lambda number: unhealthy if number >= 13 else STATION,
    )
    (message,) = messages(sent[13], m.Type2)
    assert message.gcid == 7


def test_predictions_are_sent_where_there_is_room() -> None:
    prediction = m.Type5(
        modified_z_count_s=100.0,
        sources=(m.PredictedSource(ranging_source_id=3, becomes_available=True, duration_s=60.0),),
    )
    sent = frames(25, lambda _: [source(number) for number in range(1, 6)], ONE_SLOT, predictions=prediction)
    assert max(intervals(sent, lambda bursts: bool(messages(bursts, m.Type5)))) <= 20
    full = frames(18, lambda _: [source(number) for number in range(1, 19)], ONE_SLOT, predictions=prediction)
    assert not any(messages(bursts, m.Type5) for bursts in full)


AUTHENTICATED = replace(STATION, adb4=m.AdditionalBlock4(slot_group=0b1001))


@pytest.mark.parametrize("n_sources", [0, 5, 11, 18])
def test_authentication_fills_the_slots_and_puts_station_data_first(n_sources: int) -> None:
    sent = frames(
        41,
        lambda _: [source(number, gast_d=True) for number in range(1, n_sources + 1)],
        TWO_SLOTS_D,
        station=lambda _: AUTHENTICATED,
        approaches=[approach(1)],
    )
    for bursts in sent:
        assert [burst.slot for burst in bursts] == [0, 3]
        for burst in bursts:
            assert 0.95 * 222 <= len(burst.payload) - 6 <= 222
            kinds = [block.message_type for block in decode_burst(burst).blocks]
            assert 2 not in kinds[1:]


def test_slot_group_must_be_the_assigned_slots() -> None:
    with pytest.raises(ScheduleError, match="slots A, D, but assigned are slot B"):
        frames(1, lambda _: [source(1)], ONE_SLOT, station=lambda _: AUTHENTICATED)


def test_test_blocks_are_marked() -> None:
    ((burst,),) = frames(1, lambda _: [source(1)], replace(ONE_SLOT, test=True), approaches=[approach(1)])
    assert all(block.test for block in decode_burst(burst).blocks)


# ---- rotation ----


def run_rotation(keys: Callable[[int], dict[int, object]], n_frames: int, places: int = 1) -> list[tuple[int, ...]]:
    history: dict = {}  # type: ignore[type-arg]
    firsts = []
    for frame in range(n_frames):
        chosen, history = choose_first(history, keys(frame), frame, places)
        firsts.append(chosen)
    return firsts


def gaps_of(firsts: Sequence[tuple[int, ...]], keys: Callable[[int], dict[int, object]]) -> dict[int, int]:
    """Longest time without being first, per source, from appearing or the last frame it was first."""
    last: dict[int, int] = {}
    worst: dict[int, int] = defaultdict(int)
    for frame, chosen in enumerate(firsts):
        for number in keys(frame):
            since = last.setdefault(number, frame - 1)
            worst[number] = max(worst[number], frame - since)
        for number in chosen:
            last[number] = frame
    return worst


@pytest.mark.parametrize(("n_sources", "places"), [(1, 1), (5, 1), (12, 1), (18, 1), (19, 2), (36, 2)])
def test_every_satellite_is_first_within_20_frames(n_sources: int, places: int) -> None:
    def keys(_: int) -> dict[int, object]:
        return dict.fromkeys(range(1, n_sources + 1), "ephemeris")

    firsts = run_rotation(keys, 200, places)
    assert max(gaps_of(firsts, keys).values()) <= FRAMES_BETWEEN
    assert all(len(set(chosen)) == min(places, n_sources) for chosen in firsts)


@pytest.mark.parametrize(("n_sources", "places"), [(5, 1), (12, 1), (17, 1), (24, 2)])
@pytest.mark.parametrize("when", [30, 37, 44])
def test_a_changed_ephemeris_is_first_in_three_consecutive_frames_at_once(
    n_sources: int, places: int, when: int
) -> None:
    def keys(frame: int) -> dict[int, object]:
        return {number: "new" if number == 4 and frame >= when else "old" for number in range(1, n_sources + 1)}

    firsts = run_rotation(keys, 100, places)
    assert all(4 in chosen for chosen in firsts[when : when + FRAMES_AFTER_CHANGE])
    assert max(gaps_of(firsts, keys).values()) <= FRAMES_BETWEEN


@pytest.mark.parametrize(("n_sources", "places"), [(12, 1), (18, 1), (30, 2), (36, 2)])
def test_when_all_ephemerides_change_at_once_all_are_sent_within_20_frames_and_each_gets_its_three(
    n_sources: int, places: int
) -> None:
    when = 50

    def keys(frame: int) -> dict[int, object]:
        return dict.fromkeys(range(1, n_sources + 1), frame >= when)

    firsts = run_rotation(keys, 600, places)
    assert max(gaps_of(firsts, keys).values()) <= FRAMES_BETWEEN
    for number in range(1, n_sources + 1):
        runs = [
            frame
            for frame in range(when, 598)
            if all(number in firsts[frame + offset] for offset in range(FRAMES_AFTER_CHANGE))
        ]
        assert runs


@pytest.mark.parametrize(("n_sources", "places"), [(12, 1), (18, 1), (36, 2)])
@given(seed=st.integers(0, 2**32 - 1), rate=st.sampled_from([0.01, 0.05, 0.2]))
@settings(max_examples=15, deadline=None)
def test_no_satellite_waits_longer_than_20_frames_whatever_comes_and_goes(
    n_sources: int, places: int, seed: int, rate: float
) -> None:
    # Satellites appear, set and change at random, now and then all at once.
    random = np.random.default_rng(seed)
    present = dict.fromkeys(range(n_sources), 0)
    history: dict = {}  # type: ignore[type-arg]
    last: dict[int, int] = {}
    for frame in range(150):
        if random.random() < rate:
            present.pop(int(random.integers(n_sources)), None)
        if random.random() < rate:
            number = int(random.integers(n_sources))
            present[number] = present.get(number, 0) + 1
        if random.random() < 0.01:
            present = {number: count + 1 for number, count in present.items()}
        chosen, history = choose_first(history, dict(present), frame, places)
        last = {number: since for number, since in last.items() if number in present}
        for number in present:
            assert frame - last.setdefault(number, frame - 1) <= FRAMES_BETWEEN
        last |= dict.fromkeys(chosen, frame)


def test_fewer_messages_than_before_leave_one_run() -> None:
    def keys(frame: int) -> dict[int, object]:
        # Two change at frame 40; one frame later only 18 satellites are left, so one message.
        count = 19 if frame <= 40 else 18
        return {number: (number in (2, 3) and frame >= 40) for number in range(1, count + 1)}

    history: dict = {}  # type: ignore[type-arg]
    firsts = []
    for frame in range(120):
        places = 2 if len(keys(frame)) > 18 else 1
        chosen, history = choose_first(history, keys(frame), frame, places)
        assert len(chosen) == places
        firsts.append(chosen)
    for number in (2, 3):
        assert any(all(number in firsts[frame + offset] for offset in range(3)) for frame in range(40, 117))


def test_the_same_input_gives_the_same_bursts() -> None:
    def some(number: int) -> list[SourceCorrection]:
        return [source(identifier, iod=7 + (number > 9 and identifier % 3 == 0)) for identifier in range(1, 13)]

    once = frames(40, some, ONE_SLOT, approaches=[approach(1)])
    # The order in which satellites are handed over does not matter either.
    again = frames(40, lambda number: list(reversed(some(number))), ONE_SLOT, approaches=[approach(1)])
    assert once == again
