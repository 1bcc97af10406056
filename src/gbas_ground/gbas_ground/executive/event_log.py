"""Events of one epoch of the ground station."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_ground.consistency import Finding
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event

SOURCE: Final = "ground_station"


class EventLog:
    """Events of one epoch, collected."""

    def __init__(self, gps_week: int, tow_s: float) -> None:
        self._gps_week, self._tow_s = gps_week, tow_s
        self._list: list[Event] = []

    def add(self, kind: EventKind, subject: str, cause: str, value: float = np.nan, threshold: float = np.nan) -> None:
        self._list.append(
            Event(
                gps_week=self._gps_week, tow_s=self._tow_s, kind=kind, subject=subject, cause=cause,
                value=float(value), threshold=float(threshold), source=SOURCE,
            )
        )  # fmt: skip

    def extend(self, events: tuple[Event, ...]) -> None:
        self._list.extend(events)

    def found(self, findings: tuple[Finding, ...]) -> None:
        for each in findings:
            self.add(EventKind.EXCLUSION, each.subject, each.cause.word, each.value, each.threshold)

    def all(self) -> tuple[Event, ...]:
        return tuple(self._list)
