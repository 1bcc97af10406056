"""The 0.5 s frame: which message blocks are sent, and in which slots.

Type 1 (and 11) go out in every frame with every satellite; messages of ours with corrections of a second frequency
(type 8) in what these leave; station data, approaches and predictions where there is room, at least once in 20 frames.
A burst holds at most 222 bytes of application data and a block cannot be divided.

Source: ICAO Annex 10 vol. I, App. B 3.6.3, 3.6.4 and table B-75; RTCA DO-246E (authentication).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, cast

from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_vdb.coding.fec import MAX_APPLICATION_BYTES, encode_fec
from gbas_vdb.errors import ScheduleError
from gbas_vdb.messages.block import encode_block, encode_body, wrap_body
from gbas_vdb.messages.types import (
    Correction30,
    Correction100,
    FasDataSet,
    Type1,
    Type2,
    Type3,
    Type4,
    Type5,
    Type8,
    Type11,
    UnknownDataSet,
)
from gbas_vdb.transmission.burst import SLOT_NAMES, Burst
from gbas_vdb.transmission.capacity import (
    MAX_SOURCES,
    WRAPPER_BYTES,
    Slot,
    correction_lengths,
    further_lengths,
    further_sizes,
    group_sizes,
    message_flags,
    place_corrections,
    places_of,
    room_left,
    slot_names,
)
from gbas_vdb.transmission.frame import Frame, ItemHistory, ScheduleParams, ScheduleState, Sources, no_correction
from gbas_vdb.transmission.rotation import SourceHistory, choose_first

_TYPE_BYTE: Final = 4


def schedule_frame(
    state: ScheduleState, frame: Frame, params: ScheduleParams
) -> tuple[ScheduleState, tuple[Burst, ...]]:
    """The bursts of one frame.

    Parameters
    ----------
    state : ScheduleState
    frame : Frame
    params : ScheduleParams

    Returns
    -------
    state : ScheduleState
    bursts : tuple of Burst
        In the order of their slots; slots with nothing to say are silent.

    Raises
    ------
    ScheduleError
        When the blocks do not fit, naming bytes and slots.
    FieldError
        When a value cannot be sent, naming field, value and bound.

    Examples
    --------
    >>> state, bursts = schedule_frame(state, Frame(gps_week=w, tow_s=t, sources=s, station=station), params)
    >>> for block in decode_burst(bursts[0]).blocks:
    ...     block.message
    """
    _check_authentication(frame.station, params)
    corrections, sources = _correction_messages(state, frame, params)
    slots = tuple(Slot(number=number) for number in params.slots)
    for messages in (corrections, _further_messages(frame)):
        place_corrections(slots, [encode_block(each, params.station_id, test=params.test) for each in messages])
    items = _place_periodic(slots, _periodic_items(frame, params), state, params)
    bursts = _bursts(slots, frame, params)
    return ScheduleState(frame=state.frame + 1, sources=sources, items=items), bursts


def _check_authentication(station: Type2, params: ScheduleParams) -> None:
    if station.adb4 is not None and station.adb4.slots != params.slots:
        named, assigned = slot_names(station.adb4.slots), slot_names(params.slots)
        raise ScheduleError(f"additional data block 4 names {named}, but assigned are {assigned}")


def _correction_messages(
    state: ScheduleState, frame: Frame, params: ScheduleParams
) -> tuple[list[Type1 | Type11], dict[int, SourceHistory]]:
    sources = frame.sources
    row_of = {number: row for row, number in enumerate(sources.numbers)}
    if len(row_of) != len(sources.numbers):
        raise ScheduleError("a ranging source is there twice")
    if len(row_of) > MAX_SOURCES:
        raise ScheduleError(f"{len(row_of)} ranging sources; a linked pair of messages holds {MAX_SOURCES}")
    for kind in params.message_types:
        if kind not in sources.corrections and row_of:
            raise ScheduleError(no_correction(sources.numbers[0], kind))
    places = places_of(len(row_of))
    keys = dict(zip(sources.numbers, zip(sources.iods, sources.ephemeris_crcs, strict=True), strict=True))
    first, history = choose_first(state.sources, keys, state.frame, places)
    rest = [number for number in sorted(row_of) if number not in first]
    sizes = group_sizes(len(row_of), params.message_types, params.slots)
    z_count_s = modified_z_count_s(frame.tow_s)
    groups: list[tuple[int, list[int]]] = []
    for place, size in enumerate(sizes):
        order = [*first[place : place + 1], *rest[: max(size - 1, 0)]]
        del rest[: max(size - 1, 0)]
        groups.append((message_flags(len(row_of))[place], [row_of[number] for number in order]))
    return [
        _MESSAGES[kind](sources, rows, z_count_s, flag) for kind in params.message_types for flag, rows in groups
    ], history


def _further_messages(frame: Frame) -> list[Type8]:
    """Corrections in messages of ours; one without measurements where there is none."""
    z_count_s, messages = modified_z_count_s(frame.tow_s), []
    for measurement_type, items in frame.further.items():
        begin = 0
        for flag, size in zip(message_flags(len(items)), further_sizes(len(items)), strict=True):
            messages.append(
                Type8(
                    modified_z_count_s=z_count_s,
                    additional_message_flag=flag,
                    measurement_type=measurement_type,
                    measurements=cast("tuple[Correction100, ...]", items[begin : begin + size]),
                )
            )
            begin += size
    return messages


def _type1(sources: Sources, rows: list[int], z_count_s: float, flag: int) -> Type1:
    if not rows:
        return Type1(modified_z_count_s=z_count_s, additional_message_flag=flag)
    return Type1(
        modified_z_count_s=z_count_s,
        additional_message_flag=flag,
        ephemeris_decorrelation=sources.decorrelation[1][rows[0]],
        ephemeris_crc=sources.ephemeris_crcs[rows[0]],
        source_availability_s=sources.availability_s[rows[0]],
        measurements=cast("tuple[Correction100, ...]", sources.corrections[1].take(rows)),
    )


def _type11(sources: Sources, rows: list[int], z_count_s: float, flag: int) -> Type11:
    if not rows:
        return Type11(modified_z_count_s=z_count_s, additional_message_flag=flag)
    return Type11(
        modified_z_count_s=z_count_s,
        additional_message_flag=flag,
        ephemeris_decorrelation_d=sources.decorrelation[11][rows[0]],
        measurements=cast("tuple[Correction30, ...]", sources.corrections[11].take(rows)),
    )


_MESSAGES: Final[dict[int, Callable[[Sources, list[int], float, int], Type1 | Type11]]] = {1: _type1, 11: _type11}


@dataclass(frozen=True, kw_only=True, slots=True)
class _Item:
    """Something sent once in a while, by its bits."""

    name: str
    data: bytes
    is_data_set: bool = False
    required: bool = True


@lru_cache(maxsize=256)
def _encoded_block(message: Type2 | Type5, station_id: str, test: bool) -> bytes:
    return encode_block(message, station_id, test=test)


@lru_cache(maxsize=256)
def _encoded_data_set(data_set: FasDataSet | UnknownDataSet) -> bytes:
    return encode_body(Type4(data_sets=(data_set,)))


def _periodic_items(frame: Frame, params: ScheduleParams) -> list[_Item]:
    items = [_Item(name="station data", data=_encoded_block(frame.station, params.station_id, params.test))]
    for position, data_set in enumerate(frame.approaches):
        items.append(_Item(name=f"approach {position}", data=_encoded_data_set(data_set), is_data_set=True))
    if frame.predictions is not None:
        data = _encoded_block(frame.predictions, params.station_id, params.test)
        items.append(_Item(name="predictions", data=data, required=False))
    return items


def _place_periodic(
    slots: Sequence[Slot], items: Sequence[_Item], state: ScheduleState, params: ScheduleParams
) -> dict[bytes, ItemHistory]:
    """Place what is new or in the second half of its period, the most urgent first."""
    now, period = state.frame, params.period_frames
    new = ItemHistory(due=now + period - 1, sent=False)
    history = {item.data: state.items.get(item.data, new) for item in items}
    for item in sorted(items, key=lambda one: history[one.data].due):
        known = history[item.data]
        if known.sent and now < known.due - period // 2:
            continue
        if _place_item(slots, item):
            history[item.data] = ItemHistory(due=now + period, sent=True)
        elif item.required and now >= known.due:
            used = ", ".join(f"{SLOT_NAMES[slot.number]}: {slot.used}" for slot in slots)
            raise ScheduleError(
                f"{item.name} ({len(item.data)} bytes) found no room in {period} frames; "
                f"bytes used of {MAX_APPLICATION_BYTES} in slot {used}"
            )
    return history


def _place_item(slots: Sequence[Slot], item: _Item) -> bool:
    for slot in slots:
        if item.is_data_set and slot.takes_data_set(len(item.data)):
            slot.data_sets.append(item.data)
            return True
        if not item.is_data_set and slot.takes_block(len(item.data)):
            slot.blocks.append(item.data)
            return True
    return False


def _bursts(slots: Sequence[Slot], frame: Frame, params: ScheduleParams) -> tuple[Burst, ...]:
    authenticated = frame.station.adb4 is not None
    filled: list[tuple[int, bytes]] = []
    for slot in slots:
        blocks = list(slot.blocks)
        if slot.data_sets:
            blocks.append(wrap_body(4, b"".join(slot.data_sets), params.station_id, test=params.test))
        if authenticated:
            blocks.sort(key=lambda block: block[_TYPE_BYTE] != 2)  # station data is first in its burst
            blocks += _filler(sum(map(len, blocks)), params)
        if blocks:
            filled.append((slot.number, b"".join(blocks)))
    return tuple(
        Burst(
            gps_week=frame.gps_week,
            tow_s=frame.tow_s,
            slot=number,
            bursts_in_frame=len(filled),
            payload=application_data + encode_fec(application_data),
        )
        for number, application_data in filled
    )


def _filler(used: int, params: ScheduleParams) -> list[bytes]:
    """A null message, if the burst needs one to be as full as authentication asks for."""
    wanted = math.ceil(params.occupancy_min * MAX_APPLICATION_BYTES)
    if used >= wanted:
        return []
    n_fill_bytes = max(min(wanted, MAX_APPLICATION_BYTES) - used - WRAPPER_BYTES, 0)
    return [encode_block(Type3(n_fill_bytes=n_fill_bytes), params.station_id, test=params.test)]


def sources_that_fit(station: Type2, approaches: Sequence[FasDataSet | UnknownDataSet], params: ScheduleParams) -> int:
    """How many ranging sources a station can broadcast with its slots, and still send everything else in its turn."""
    items = _periodic_items(
        Frame(gps_week=0, tow_s=0.0, sources=Sources.of(()), station=station, approaches=tuple(approaches)), params
    )
    for n_sources in range(MAX_SOURCES, -1, -1):
        sizes = group_sizes(n_sources, params.message_types, params.slots)
        room = room_left(correction_lengths(sizes, params.message_types), params.slots)
        if all(len(item.data) + (WRAPPER_BYTES if item.is_data_set else 0) <= room for item in items):
            return n_sources
    raise ScheduleError(
        f"{slot_names(params.slots)} cannot hold the station's data: "
        f"{', '.join(f'{item.name} {len(item.data)} bytes' for item in items)}"
    )


def further_sources_that_fit(
    n_sources: int,
    kinds: Sequence[int],
    station: Type2,
    approaches: Sequence[FasDataSet | UnknownDataSet],
    params: ScheduleParams,
) -> int:
    """How many sources fit in messages of ours beside so many in types 1 and 11, with everything else in its turn.

    Parameters
    ----------
    n_sources : int
        Sources in types 1 and 11, whose messages come first.
    kinds : sequence of int
        Measurement types that are sent of each.

    Returns
    -------
    int
        At most `n_sources`; -1 where not even empty messages fit.
    """
    items = _periodic_items(
        Frame(gps_week=0, tow_s=0.0, sources=Sources.of(()), station=station, approaches=tuple(approaches)), params
    )
    largest = max((len(item.data) + (WRAPPER_BYTES if item.is_data_set else 0) for item in items), default=0)
    standard = correction_lengths(group_sizes(n_sources, params.message_types, params.slots), params.message_types)
    for n_further in range(n_sources, -1, -1):
        if room_left(standard, params.slots, further_lengths(n_further, kinds)) >= largest:
            return n_further
    return -1
