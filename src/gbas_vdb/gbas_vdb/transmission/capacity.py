"""Room in a frame: what the messages with corrections take of the slots, and how they are divided.

A burst holds at most 222 bytes of application data, a message block at most 222 bytes, and neither can be divided.

Source: ICAO Annex 10 vol. I, App. B 3.6.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from gbas_vdb.coding.fec import MAX_APPLICATION_BYTES
from gbas_vdb.errors import ScheduleError
from gbas_vdb.messages import tables
from gbas_vdb.messages.block import CRC_BYTES, HEADER_BYTES, MAX_BLOCK_BYTES
from gbas_vdb.transmission.burst import SLOT_NAMES

WRAPPER_BYTES: Final = HEADER_BYTES + CRC_BYTES
MAX_SOURCES: Final = 2 * tables.MAX_MEASUREMENTS
"""Ranging sources of a linked pair of messages."""
_MAX_DATA_SETS_BYTES: Final = MAX_BLOCK_BYTES - WRAPPER_BYTES


@dataclass(kw_only=True)
class Slot:
    """A burst being filled: whole blocks, and data sets that become one type 4 message."""

    number: int
    blocks: list[bytes] = field(default_factory=list)
    data_sets: list[bytes] = field(default_factory=list)

    @property
    def used(self) -> int:
        approaches = sum(map(len, self.data_sets))
        return sum(map(len, self.blocks)) + (approaches + WRAPPER_BYTES if self.data_sets else 0)

    def takes_block(self, n_bytes: int) -> bool:
        return self.used + n_bytes <= MAX_APPLICATION_BYTES

    def takes_data_set(self, n_bytes: int) -> bool:
        if not self.data_sets:
            return self.takes_block(n_bytes + WRAPPER_BYTES)
        return self.takes_block(n_bytes) and sum(map(len, self.data_sets)) + n_bytes <= _MAX_DATA_SETS_BYTES


def message_flags(n_sources: int) -> tuple[int, ...]:
    """Additional message flags of the messages that hold so many sources: single, or first and second of a pair."""
    return (0,) if places_of(n_sources) == 1 else (1, 3)


def further_sizes(n_sources: int) -> tuple[int, ...]:
    """Sources in each message of ours: the first is as full as it may be, so that the second leaves room for others.

    Raises
    ------
    ScheduleError
        For more than a linked pair holds.
    """
    if n_sources > MAX_SOURCES:
        raise ScheduleError(f"{n_sources} ranging sources; a linked pair of messages holds {MAX_SOURCES}")
    first = min(n_sources, tables.MAX_MEASUREMENTS)
    return (first,) if places_of(n_sources) == 1 else (first, n_sources - first)


def place_corrections(slots: Sequence[Slot], blocks: Sequence[bytes]) -> None:
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
                f"{slot_names([slot.number for slot in slots])} of {MAX_APPLICATION_BYTES} bytes each"
            )


def further_lengths(n_sources: int, kinds: Sequence[int]) -> list[int]:
    """Bytes of each message of ours."""
    head = WRAPPER_BYTES + tables.TYPE_8.bits // 8
    return [head + size * tables.PRIVATE_ENTRIES[kind].bits // 8 for kind in kinds for size in further_sizes(n_sources)]


def places_of(n_sources: int) -> int:
    """Messages that so many sources need."""
    return 2 if n_sources > tables.MAX_MEASUREMENTS else 1


def correction_lengths(sizes: Sequence[int], types: Sequence[int]) -> list[int]:
    """Bytes of each standard message with corrections."""
    return [
        WRAPPER_BYTES + (tables.WHOLE_MESSAGES[kind].bits + size * tables.CORRECTION_ENTRIES[kind].bits) // 8
        for kind in types
        for size in sizes
    ]


@lru_cache(maxsize=256)
def group_sizes(n_sources: int, types: tuple[int, ...], slots: tuple[int, ...]) -> tuple[int, ...]:
    """Satellites in each message of a linked pair: the division that leaves most room in one burst."""
    if places_of(n_sources) == 1:
        return (n_sources,)
    best, most_room = (-(-n_sources // 2), n_sources // 2), -1
    for larger in range(best[0], tables.MAX_MEASUREMENTS + 1):
        sizes = (larger, n_sources - larger)
        room = room_left(correction_lengths(sizes, types), slots)
        if room > most_room:
            best, most_room = sizes, room
    return best


def room_left(lengths: Sequence[int], slots: Sequence[int], further: Sequence[int] = ()) -> int:
    """Free bytes of the emptiest slot after the corrections are placed; -1 when they do not fit."""
    filled = [Slot(number=number) for number in slots]
    try:
        place_corrections(filled, [bytes(length) for length in lengths])
        place_corrections(filled, [bytes(length) for length in further])
    except ScheduleError:
        return -1
    return MAX_APPLICATION_BYTES - min(slot.used for slot in filled)


def slot_names(slots: Sequence[int]) -> str:
    """Slots in words."""
    return f"slot{'s' if len(slots) > 1 else ''} {', '.join(SLOT_NAMES[slot] for slot in slots)}"
