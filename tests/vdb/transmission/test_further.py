"""Frames with corrections of a second frequency beside types 1 and 11: nothing of these changes, and all that fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from gbas_core.satellites import GALILEO_SOURCE_ID_OFFSET
from gbas_vdb.errors import ScheduleError
from gbas_vdb.messages import types as m
from gbas_vdb.messages.fixed_places import Items
from gbas_vdb.messages.tables import PRIVATE_ENTRIES
from gbas_vdb.transmission.burst import Burst
from gbas_vdb.transmission.capacity import further_lengths
from gbas_vdb.transmission.frame import Frame, ScheduleParams, ScheduleState, Sources
from gbas_vdb.transmission.receive import decode_burst
from gbas_vdb.transmission.schedule import further_sources_that_fit, schedule_frame, sources_that_fit
from vdb_frames import STATION, approach, messages, source

KINDS = (0, 1)
APPROACHES = (approach(1), approach(2))
ALL_SLOTS = ScheduleParams(station_id="EDVE", slots=tuple(range(8)), message_types=(1, 11))


def further(numbers: Sequence[int], kinds: Sequence[int] = KINDS) -> dict[int, Items]:
    return {kind: Items.of(PRIVATE_ENTRIES[kind], [source(number).type1 for number in numbers]) for kind in kinds}


def sent(
    numbers: Sequence[int], second: Sequence[int] | None, params: ScheduleParams, n_frames: int = 20
) -> list[tuple[Burst, ...]]:
    state, frames = ScheduleState(), []
    for number in range(n_frames):
        frame = Frame(
            gps_week=2300,
            tow_s=100.0 + 0.5 * number,
            sources=Sources.of([source(each, gast_d=True) for each in numbers]),
            station=STATION,
            further={} if second is None else further(second),
            approaches=APPROACHES,
        )
        state, bursts = schedule_frame(state, frame, params)
        frames.append(bursts)
    return frames


TWO_CONSTELLATIONS = [*range(1, 19), *range(GALILEO_SOURCE_ID_OFFSET + 1, GALILEO_SOURCE_ID_OFFSET + 19)]


def test_two_full_constellations_fit_the_eight_slots() -> None:
    """36 sources in types 1 and 11 and both private messages, with station data and approaches in their turn.

    By hand, bytes: 2 x (10 + 7 + 18 x 11) = 430, 2 x (10 + 4 + 18 x 7) = 280, 4 x (10 + 5 + 18 x 11) = 852: 1562 of
    8 x 222 = 1776.
    """
    frames = sent(TWO_CONSTELLATIONS, TWO_CONSTELLATIONS, ALL_SLOTS)
    for bursts in frames:
        for kind in KINDS:
            pair = [each for each in messages(bursts, m.Type8) if each.measurement_type == kind]
            assert [each.additional_message_flag for each in pair] == [1, 3]
            assert [c.ranging_source_id for each in pair for c in each.measurements] == TWO_CONSTELLATIONS
        lengths = [
            block.length for burst in bursts for block in decode_burst(burst).blocks if block.message_type in (1, 8, 11)
        ]
        assert sum(lengths) == 430 + 280 + 852
    assert any(messages(bursts, m.Type2) for bursts in frames)
    assert {
        each.fas.reference_path_data_selector
        for bursts in frames
        for type4 in messages(bursts, m.Type4)
        for each in type4.data_sets
    } == {1, 2}
    assert further_sources_that_fit(36, KINDS, STATION, APPROACHES, ALL_SLOTS) == 36


def test_types_1_and_11_are_where_and_what_they_are_without() -> None:
    numbers = TWO_CONSTELLATIONS[:24]
    for with_them, without in zip(sent(numbers, numbers, ALL_SLOTS), sent(numbers, None, ALL_SLOTS), strict=True):
        standard = [
            [
                (burst.slot, place, block)
                for burst in bursts
                for place, block in enumerate(decode_burst(burst).blocks)
                if block.message_type in (1, 11)
            ]
            for bursts in (with_them, without)
        ]
        assert standard[0] == standard[1]
        assert not messages(without, m.Type8)


def test_only_some_sources_have_them() -> None:
    (bursts,) = sent(range(1, 11), [3, 7], ALL_SLOTS, n_frames=1)
    assert [[c.ranging_source_id for c in each.measurements] for each in messages(bursts, m.Type8)] == [[3, 7], [3, 7]]
    (bursts,) = sent(range(1, 11), [], ALL_SLOTS, n_frames=1)
    assert [len(each.measurements) for each in messages(bursts, m.Type8)] == [0, 0]


FITTING = [
    (replace(ALL_SLOTS, slots=tuple(range(n_slots))), n_sources)
    for n_slots in (2, 3, 5, 8)
    for n_sources in (4, 10, 18, 19, 30)
    if sources_that_fit(STATION, APPROACHES, replace(ALL_SLOTS, slots=tuple(range(n_slots)))) >= n_sources
]


@pytest.mark.parametrize(("params", "n_sources"), FITTING, ids=str)
def test_what_fits_is_sent_in_every_frame_and_one_more_does_not(params: ScheduleParams, n_sources: int) -> None:
    """The bound is one that frames keep for two whole periods, and no smaller than it has to be."""
    room = further_sources_that_fit(n_sources, KINDS, STATION, APPROACHES, params)
    numbers = TWO_CONSTELLATIONS[:n_sources]
    if room >= 0:
        sent(numbers, numbers[:room], params, n_frames=41)
    if room < n_sources:
        with pytest.raises(ScheduleError):
            sent(numbers, numbers[: room + 1], params, n_frames=41)


def test_lengths_are_those_of_the_messages() -> None:
    for number in (0, 5, 18, 19, 36):
        (bursts,) = sent(TWO_CONSTELLATIONS, TWO_CONSTELLATIONS[:number], ALL_SLOTS, n_frames=1)
        blocks = [block for burst in bursts for block in decode_burst(burst).blocks if block.message_type == 8]
        blocks.sort(key=lambda block: (block.message.measurement_type, block.message.additional_message_flag))
        assert [block.length for block in blocks] == further_lengths(number, KINDS)
