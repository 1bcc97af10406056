"""What a run tells of its events."""

from __future__ import annotations

from gbas_cli.event_summary import event_lines
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event

WEEK, NOON_S = 2400, 216_000.0  # Tuesday 2026-01-06 12:00:00


def event(after_s: float, kind: EventKind, subject: str, cause: str) -> Event:
    return Event(gps_week=WEEK, tow_s=NOON_S + after_s, kind=kind, subject=subject, cause=cause)


def test_one_line_a_kind_and_cause() -> None:
    events = [
        event(5.0, EventKind.EXCLUSION, "G05", "carrier_step"),
        event(1.0, EventKind.SERVICE, "approach", "in_service"),
        event(65.5, EventKind.EXCLUSION, "rr2/G07", "carrier_step"),
        event(65.5, EventKind.EXCLUSION, "G05", "carrier_step"),
        event(7.0, EventKind.EXCLUSION, "rr1", "receiver_fault"),
        event(90.0, EventKind.FINISHED, "simulator", "finished"),
    ]
    assert event_lines(events) == [
        "service      12:00:01: in_service (approach)",
        "excluded     12:00:05 to 12:01:05: carrier_step, 3 x (G05, rr2/G07)",
        "excluded     12:00:07: receiver_fault (rr1)",
    ]
    assert event_lines([]) == []


def test_many_subjects_are_cut_short() -> None:
    (line,) = event_lines(event(0.0, EventKind.EXCLUSION, f"G{n:02d}", "b_value") for n in range(1, 9))
    assert line == "excluded     12:00:00: b_value, 8 x (G01, G02, G03, G04, G05, G06, ...)"
