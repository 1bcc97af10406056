"""Events: what happened, to what, when, by how much, and why; one JSON object each.

An event carries everything needed to trace an alert in a bag to its cause, threshold and epoch without the code that
raised it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from gbas_core.gnss.gpstime import epoch_key
from gbas_msgs_py.codes import EventKind

SCHEMA: Final = "gbas/event/1"


class EventError(ValueError):
    """Text that is not an event; the message says what was expected and found."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """One event.

    Attributes
    ----------
    gps_week, tow_s
        Epoch of the data that caused it.
    kind : EventKind
    subject : str
        What it happened to: ``"G05"``, ``"rr2"``, ``"rr2/G05"``, ``"approach"``.
    cause : str
        Why, as one word of lower case: ``"b_value"``, ``"vpl_above_val"``.
    value, threshold : float
        The statistic and what it was compared with, in the unit the cause implies; NaN where there is none.
    source : str
        Who says so: the node, or the part of the station or receiver.
    """

    gps_week: int
    tow_s: float
    kind: EventKind
    subject: str
    cause: str
    value: float = math.nan
    threshold: float = math.nan
    source: str = ""

    @property
    def epoch(self) -> int:
        """Identifier of the epoch: milliseconds since the start of GPS time."""
        return int(epoch_key(self.gps_week, self.tow_s))

    def to_json(self) -> str:
        """The event as one line of JSON; NaN is null (JSON has no NaN), an infinity is the string ``"inf"``."""
        return json.dumps(
            {
                "schema": SCHEMA,
                "epoch": self.epoch,
                "gps_week": self.gps_week,
                "tow_s": self.tow_s,
                "kind": str(self.kind),
                "subject": self.subject,
                "cause": self.cause,
                "value": _number_out(self.value),
                "threshold": _number_out(self.threshold),
                "source": self.source,
            },
            allow_nan=False,
        )

    @staticmethod
    def from_json(text: str) -> Event:
        """The event of :meth:`to_json`.

        Raises
        ------
        EventError
            For text that is not JSON, another schema or version, a missing field, or one of another type.
        """
        try:
            fields = json.loads(text)
        except ValueError as error:
            raise EventError(f"not JSON: {error}") from None
        if not isinstance(fields, dict):
            raise EventError(f"a JSON {type(fields).__name__}, expected an object")
        if fields.get("schema") != SCHEMA:
            raise EventError(f"schema {fields.get('schema')!r}, expected {SCHEMA!r}")
        return Event(
            gps_week=_typed(fields, "gps_week", int),
            tow_s=float(_typed(fields, "tow_s", (int, float))),
            kind=_kind(_typed(fields, "kind", str)),
            subject=_typed(fields, "subject", str),
            cause=_typed(fields, "cause", str),
            value=_number_in(fields, "value"),
            threshold=_number_in(fields, "threshold"),
            source=_typed(fields, "source", str),
        )


class EventLog:
    """Events of one epoch from one source, collected in their order.

    Parameters
    ----------
    gps_week, tow_s
        The epoch.
    source : str
        Who says so, see :class:`Event`.
    """

    def __init__(self, gps_week: int, tow_s: float, source: str) -> None:
        self._gps_week, self._tow_s, self._source = gps_week, tow_s, source
        self._list: list[Event] = []

    def add(
        self, kind: EventKind, subject: str, cause: str, value: float = math.nan, threshold: float = math.nan
    ) -> None:
        """Note an event of this epoch."""
        self._list.append(
            Event(
                gps_week=self._gps_week, tow_s=self._tow_s, kind=kind, subject=subject, cause=cause,
                value=float(value), threshold=float(threshold), source=self._source,
            )
        )  # fmt: skip

    def extend(self, events: Iterable[Event]) -> None:
        """Take over events that are made already."""
        self._list.extend(events)

    def all(self) -> tuple[Event, ...]:
        """The events so far."""
        return tuple(self._list)


def _number_out(value: float) -> float | str | None:
    number = float(value)
    if math.isnan(number):
        return None
    return number if math.isfinite(number) else str(number)


def _number_in(fields: dict[str, Any], name: str) -> float:
    value = fields.get(name)
    if value is None:
        return math.nan
    if value in ("inf", "-inf"):
        return float(value)
    return float(_typed(fields, name, (int, float)))


def _typed(fields: dict[str, Any], name: str, kind: type | tuple[type, ...]) -> Any:
    value = fields.get(name)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise EventError(f"field {name!r} is {value!r}, expected {getattr(kind, '__name__', 'a number')}")
    return value


def _kind(text: str) -> EventKind:
    try:
        return EventKind(text)
    except ValueError:
        raise EventError(f"kind {text!r}, expected one of {', '.join(EventKind)}") from None
