"""Events as JSON and back."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event, EventError, EventLog

EXAMPLE = Event(
    gps_week=2300, tow_s=12.5, kind=EventKind.EXCLUSION, subject="rr2/G05", cause="b_value", value=0.75, threshold=0.5
)


def test_json_has_everything_an_alert_is_traced_with() -> None:
    fields = json.loads(EXAMPLE.to_json())
    assert fields == {
        "schema": "gbas/event/1",
        "epoch": 2300 * 604_800_000 + 12_500,
        "gps_week": 2300,
        "tow_s": 12.5,
        "kind": "exclusion",
        "subject": "rr2/G05",
        "cause": "b_value",
        "value": 0.75,
        "threshold": 0.5,
        "source": "",
    }


def test_missing_numbers_are_null_because_json_has_no_nan() -> None:
    text = Event(gps_week=1, tow_s=0.0, kind=EventKind.INPUT, subject="rr1", cause="missing").to_json()
    assert json.loads(text)["value"] is None
    assert "NaN" not in text
    assert math.isnan(Event.from_json(text).threshold)


@given(
    week=st.integers(0, 65535),
    tow_s=st.floats(0.0, 604799.0),
    kind=st.sampled_from(EventKind),
    text=st.text(),
    numbers=st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)),
)
def test_round_trip(week: int, tow_s: float, kind: EventKind, text: str, numbers: tuple[float, float]) -> None:
    event = Event(
        gps_week=week, tow_s=tow_s, kind=kind, subject=text, cause=text, value=numbers[0], threshold=numbers[1],
        source=text,
    )  # fmt: skip
    assert Event.from_json(event.to_json()) == event
    assert "\n" not in event.to_json()


def _changed(**changes: Any) -> str:
    fields = {**json.loads(EXAMPLE.to_json()), **changes}
    return json.dumps({name: value for name, value in fields.items() if value != "gone"})


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[1]", "expected an object"),
        (_changed(schema="gbas/event/2"), "schema 'gbas/event/2', expected 'gbas/event/1'"),
        (_changed(schema="gone"), "schema None"),
        (_changed(kind="sneeze"), "kind 'sneeze', expected one of"),
        (_changed(gps_week=2300.5), "'gps_week'"),
        (_changed(gps_week=True), "'gps_week'"),
        (_changed(tow_s="12"), "'tow_s'"),
        (_changed(subject="gone"), "'subject'"),
        (_changed(value="big"), "'value'"),
    ],
)
def test_what_is_not_an_event_is_refused_by_name(text: str, complaint: str) -> None:
    with pytest.raises(EventError) as told:
        Event.from_json(text)
    assert complaint in str(told.value)


def test_a_log_keeps_events_of_its_epoch_and_source_in_order() -> None:
    log = EventLog(2300, 12.5, "station")
    log.add(EventKind.INPUT, "rr1", "missing")
    log.extend([EXAMPLE])
    log.add(EventKind.EXCLUSION, "rr2/G05", "b_value", 1, 2)
    first, second, third = log.all()
    assert (first.gps_week, first.tow_s, first.source, first.cause) == (2300, 12.5, "station", "missing")
    assert math.isnan(first.value)
    assert math.isnan(first.threshold)
    assert second is EXAMPLE
    assert (type(third.value), third.value, third.threshold) == (float, 1.0, 2.0)
