"""Bytes, slots and update times, against the sizes of the fields by hand."""

from __future__ import annotations

import pytest

from gbas_vdb.transmission.budget import frame_budget
from gbas_vdb.transmission.frame import ScheduleParams

EIGHT = ScheduleParams(station_id="GBAS", slots=tuple(range(8)), message_types=(1, 11))
FULL = [*range(1, 12), *range(71, 80)]  # 11 GPS, 9 Galileo


def wanted_bytes(n: int, kinds: int) -> dict[tuple[int, str], int]:
    """Header and CRC 10 bytes a message; heads of 7, 4 and 5; 11, 7 and 11 a source (ICAO Annex 10 vol. I, tables B-70,
    B-73 (known), and docs/conventions.md); beyond 18 sources two messages of each."""
    pieces = 1 if n <= 18 else 2
    second = {(8, f"L5/E5a, {tau} s"): pieces * 15 + 11 * n for tau in (100, 30)[:kinds]}
    return {(1, "L1/E1, 100 s"): pieces * 17 + 11 * n, (11, "L1/E1, 30 s"): pieces * 14 + 7 * n, **second}


@pytest.mark.parametrize("n", [4, 18, 19, 20, 36])
@pytest.mark.parametrize("kinds", [0, 1, 2])
def test_bytes_are_those_of_the_fields(n: int, kinds: int) -> None:
    found = frame_budget(range(1, n + 1), range(kinds), EIGHT)
    corrections = {(each.message_type, each.what): each for each in found.messages if each.message_type in (1, 8, 11)}
    assert {key: each.bytes_per_frame for key, each in corrections.items()} == wanted_bytes(n, kinds)
    assert {each.satellites for each in corrections.values()} == {n}
    assert {each.update_s for each in corrections.values()} == {0.5}
    assert found.capacity_bytes == 8 * 222
    assert sum(wanted_bytes(n, kinds).values()) < found.bytes_per_frame <= found.capacity_bytes
    assert max(found.slot_bytes) <= 222
    assert (found.left_out, found.second_left_out if kinds else 0) == (0, 0)


def test_periodic_messages_and_first_places_keep_their_periods() -> None:
    """ICAO Annex 10 vol. I, table B-75: station data and approaches once in 20 frames, every source first in 20."""
    found = frame_budget(FULL, (0, 1), EIGHT, n_approaches=3)
    assert {each.message_type for each in found.messages if each.update_s > 0.5} == {2, 4}
    assert all(each.update_s <= 10.0 for each in found.messages)
    assert found.first_s <= 10.0


def test_what_does_not_fit_is_said() -> None:
    two = ScheduleParams(station_id="GBAS", slots=(0, 1), message_types=(1, 11))
    found = frame_budget(FULL, (0, 1), two)
    assert found.room < 20
    assert found.left_out == 20 - found.room
    assert found.second_left_out == found.room - max(found.second_room, 0) > 0
    (eight,) = {each.satellites for each in frame_budget(FULL, (0, 1), EIGHT).messages if each.message_type == 8}
    assert eight == 20
