"""The 0.5 s frame: which message blocks are sent, and in which slots.

Type 1 (and 11) go out in every frame with every satellite; station data, approaches and predictions where there is
room, at least once in 20 frames. A burst holds at most 222 bytes of application data and a block cannot be divided.

Source: ICAO Annex 10 vol. I, App. B 3.6.3, 3.6.4 and table B-75; RTCA DO-246E (authentication).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, cast

from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_vdb.coding.fec import MAX_APPLICATION_BYTES, encode_fec
from gbas_vdb.errors import ScheduleError
from gbas_vdb.messages import tables
from gbas_vdb.messages.block import CRC_BYTES, HEADER_BYTES, MAX_BLOCK_BYTES, encode_block, encode_body, wrap_body
from gbas_vdb.messages.types import (
    Correction30,
    Correction100,
    FasDataSet,
    Type1,
    Type2,
    Type3,
    Type4,
    Type5,
    Type11,
    UnknownDataSet,
)
from gbas_vdb.transmission.burst import SLOT_NAMES, Burst
from gbas_vdb.transmission.frame import Frame, ItemHistory, ScheduleParams, ScheduleState, Sources, no_correction
from gbas_vdb.transmission.rotation import SourceHistory, choose_first

_WRAPPER_BYTES: Final = HEADER_BYTES + CRC_BYTES
_MAX_SOURCES: Final = 2 * tables.MAX_MEASUREMENTS
_TYPE_BYTE: Final = 4
_MAX_DATA_SETS_BYTES: Final = MAX_BLOCK_BYTES - _WRAPPER_BYTES


@dataclass(kw_only=True)
class _Slot:
    """A burst being filled."""

    number: int
    blocks: list[bytes] = field(default_factory=list)
    data_sets: list[bytes] = field(default_factory=list)

    @property
    def used(self) -> int:
        approaches = sum(map(len, self.data_sets))
        return sum(map(len, self.blocks)) + (approaches + _WRAPPER_BYTES if self.data_sets else 0)

    def takes_block(self, n_bytes: int) -> bool:
        return self.used + n_bytes <= MAX_APPLICATION_BYTES

    def takes_data_set(self, n_bytes: int) -> bool:
        if not self.data_sets:
            return self.takes_block(n_bytes + _WRAPPER_BYTES)
        return self.takes_block(n_bytes) and sum(map(len, self.data_sets)) + n_bytes <= _MAX_DATA_SETS_BYTES


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
    slots = tuple(_Slot(number=number) for number in params.slots)
    _place_corrections(slots, [encode_block(message, params.station_id, test=params.test) for message in corrections])
    items = _place_periodic(slots, _periodic_items(frame, params), state, params)
    bursts = _bursts(slots, frame, params)
    return ScheduleState(frame=state.frame + 1, sources=sources, items=items), bursts


def _check_authentication(station: Type2, params: ScheduleParams) -> None:
    if station.adb4 is not None and station.adb4.slots != params.slots:
        raise ScheduleError(
            f"additional data block 4 names {_names(station.adb4.slots)}, but assigned are {_names(params.slots)}"
        )


def _names(slots: Sequence[int]) -> str:
    return f"slot{'s' if len(slots) > 1 else ''} {', '.join(SLOT_NAMES[slot] for slot in slots)}"


def _correction_messages(
    state: ScheduleState, frame: Frame, params: ScheduleParams
) -> tuple[list[Type1 | Type11], dict[int, SourceHistory]]:
    sources = frame.sources
    row_of = {number: row for row, number in enumerate(sources.numbers)}
    if len(row_of) != len(sources.numbers):
        raise ScheduleError("a ranging source is there twice")
    if len(row_of) > _MAX_SOURCES:
        raise ScheduleError(f"{len(row_of)} ranging sources; a linked pair of messages holds {_MAX_SOURCES}")
    for kind in params.message_types:
        if kind not in sources.corrections and row_of:
            raise ScheduleError(no_correction(sources.numbers[0], kind))
    places = _places(len(row_of))
    keys = dict(zip(sources.numbers, zip(sources.iods, sources.ephemeris_crcs, strict=True), strict=True))
    first, history = choose_first(state.sources, keys, state.frame, places)
    rest = [number for number in sorted(row_of) if number not in first]
    sizes = _group_sizes(len(row_of), params.message_types, params.slots)
    z_count_s = modified_z_count_s(frame.tow_s)
    groups: list[tuple[int, list[int]]] = []
    for place, size in enumerate(sizes):
        order = [*first[place : place + 1], *rest[: max(size - 1, 0)]]
        del rest[: max(size - 1, 0)]
        groups.append((0 if places == 1 else (1, 3)[place], [row_of[number] for number in order]))
    return [
        _MESSAGES[kind](sources, rows, z_count_s, flag) for kind in params.message_types for flag, rows in groups
    ], history


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


def _place_corrections(slots: Sequence[_Slot], blocks: Sequence[bytes]) -> None:
    """First fit, longest first; what is placed first stays first in its burst."""
    for block in sorted(blocks, key=len, reverse=True):
        for slot in slots:
            if slot.takes_block(len(block)):
                slot.blocks.append(block)
                break
        else:
            lengths = " + ".join(str(len(one)) for one in blocks)
            raise ScheduleError(
                f"the correction messages of a frame ({lengths} bytes) do not fit "
                f"{_names([slot.number for slot in slots])} of {MAX_APPLICATION_BYTES} bytes each"
            )


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
    slots: Sequence[_Slot], items: Sequence[_Item], state: ScheduleState, params: ScheduleParams
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


def _place_item(slots: Sequence[_Slot], item: _Item) -> bool:
    for slot in slots:
        if item.is_data_set and slot.takes_data_set(len(item.data)):
            slot.data_sets.append(item.data)
            return True
        if not item.is_data_set and slot.takes_block(len(item.data)):
            slot.blocks.append(item.data)
            return True
    return False


def _bursts(slots: Sequence[_Slot], frame: Frame, params: ScheduleParams) -> tuple[Burst, ...]:
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
    n_fill_bytes = max(min(wanted, MAX_APPLICATION_BYTES) - used - _WRAPPER_BYTES, 0)
    return [encode_block(Type3(n_fill_bytes=n_fill_bytes), params.station_id, test=params.test)]


def sources_that_fit(station: Type2, approaches: Sequence[FasDataSet | UnknownDataSet], params: ScheduleParams) -> int:
    """How many ranging sources a station can broadcast with its slots, and still send everything else in its turn."""
    items = _periodic_items(
        Frame(gps_week=0, tow_s=0.0, sources=Sources.of(()), station=station, approaches=tuple(approaches)), params
    )
    for n_sources in range(_MAX_SOURCES, -1, -1):
        sizes = _group_sizes(n_sources, params.message_types, params.slots)
        room = _room(_correction_lengths(sizes, params.message_types), params.slots)
        if all(len(item.data) + (_WRAPPER_BYTES if item.is_data_set else 0) <= room for item in items):
            return n_sources
    raise ScheduleError(
        f"{_names(params.slots)} cannot hold the station's data: "
        f"{', '.join(f'{item.name} {len(item.data)} bytes' for item in items)}"
    )


def _places(n_sources: int) -> int:
    return 2 if n_sources > tables.MAX_MEASUREMENTS else 1


def _correction_lengths(sizes: Sequence[int], types: Sequence[int]) -> list[int]:
    """Bytes of each message."""
    return [
        _WRAPPER_BYTES + (tables.WHOLE_MESSAGES[kind].bits + size * tables.CORRECTION_ENTRIES[kind].bits) // 8
        for kind in types
        for size in sizes
    ]


@lru_cache(maxsize=256)
def _group_sizes(n_sources: int, types: tuple[int, ...], slots: tuple[int, ...]) -> tuple[int, ...]:
    """Satellites in each message of a linked pair: the division that leaves most room in one burst."""
    if _places(n_sources) == 1:
        return (n_sources,)
    best, most_room = (-(-n_sources // 2), n_sources // 2), -1
    for larger in range(best[0], tables.MAX_MEASUREMENTS + 1):
        sizes = (larger, n_sources - larger)
        room = _room(_correction_lengths(sizes, types), slots)
        if room > most_room:
            best, most_room = sizes, room
    return best


def _room(lengths: Sequence[int], slots: Sequence[int]) -> int:
    """Free bytes of the emptiest slot after the corrections are placed; -1 when they do not fit."""
    filled = [_Slot(number=number) for number in slots]
    try:
        _place_corrections(filled, [bytes(length) for length in lengths])
    except ScheduleError:
        return -1
    return MAX_APPLICATION_BYTES - min(slot.used for slot in filled)
