"""What happened in a run, for people: exclusions, re-admissions, alerts and changes of service by cause and time."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from gbas_bags.bags import BagReader
from gbas_bags.definitions import typestore
from gbas_bags.topic_names import contract_name
from gbas_core.errors import BagError
from gbas_core.gnss.gpstime import calendar_text
from gbas_msgs_py import topics
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event, EventError

_TITLES: Final = {
    EventKind.SERVICE: "service",
    EventKind.ALERT: "alert",
    EventKind.EXCLUSION: "excluded",
    EventKind.READMISSION: "re-admitted",
    EventKind.STATION: "station",
    EventKind.INPUT: "input",
}
_SUBJECTS_SHOWN: Final = 6
STRING_TYPE: Final = "std_msgs/msg/String"


def read_events(bag: Path) -> list[Event]:
    """The events in a bag, in its order.

    Raises
    ------
    BagError
        When one cannot be read.
    """
    events = []
    for message in BagReader(bag).messages():
        if message.channel.schema.name == STRING_TYPE and contract_name(message.channel.topic) == topics.EVENTS:
            try:
                decoded: Any = typestore().deserialize_cdr(message.data, STRING_TYPE)
                events.append(Event.from_json(decoded.data))
            except EventError as error:
                raise BagError(bag, f"{message.channel.topic}, event {len(events) + 1}: {error}") from error
    return events


def event_lines(events: Iterable[Event]) -> list[str]:
    """One line for each kind and cause: how often, when first and last, and on what."""
    groups: dict[tuple[EventKind, str], list[Event]] = {}
    for event in events:
        if event.kind in _TITLES:
            groups.setdefault((event.kind, event.cause), []).append(event)
    order = list(_TITLES)
    lines = []
    for (kind, cause), group in sorted(groups.items(), key=lambda item: (order.index(item[0][0]), item[1][0].epoch)):
        subjects = list(dict.fromkeys(event.subject for event in group))
        more = ", ..." if len(subjects) > _SUBJECTS_SHOWN else ""
        first, last = (_clock(event) for event in (group[0], group[-1]))
        when = first if first == last else f"{first} to {last}"
        what = f"{cause}, {len(group)} x" if len(group) > 1 else cause
        lines.append(f"{_TITLES[kind]:12} {when}: {what} ({', '.join(subjects[:_SUBJECTS_SHOWN])}{more})")
    return lines


def _clock(event: Event) -> str:
    """Time of day of an event's epoch."""
    return calendar_text(event.gps_week, event.tow_s)[11:19]
