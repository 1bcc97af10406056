"""Quality of service of every topic, stated once.

Everything is reliable: a lost correction or observation would make a replay differ from the original. Depths are
finite; a driver that runs faster than real time keeps them from overflowing by flow control
(:mod:`gbas_node.pacing`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gbas_msgs_py.topics import AIRBORNE_EPHEMERIS, CLOCK, DIAGNOSTICS, EPHEMERIS, EVENTS, PROGRESS_PREFIX, SCHEMAS


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Reliable, keep-last quality of service.

    Attributes
    ----------
    depth : int
        Messages kept a writer and a reader.
    latched : bool
        Transient local: a late reader gets the last `depth` messages.
    """

    depth: int
    latched: bool = False


DATA: Final = Qos(depth=256)
"""Tables, bursts and scalars: at 2 Hz two minutes of a table; 256 bursts are at least 16 s of a full schedule."""
EPHEMERIDES: Final = Qos(depth=1024, latched=True)
SCHEMA_DICTIONARY: Final = Qos(depth=1, latched=True)
LOG: Final = Qos(depth=1024)
"""Events: bursts of them come when many satellites change at once."""
STATUS: Final = Qos(depth=16)

_BY_TOPIC: Final = {
    EPHEMERIS: EPHEMERIDES,
    AIRBORNE_EPHEMERIS: EPHEMERIDES,
    SCHEMAS: SCHEMA_DICTIONARY,
    EVENTS: LOG,
    DIAGNOSTICS: STATUS,
    CLOCK: STATUS,
}


def qos_of(topic: str) -> Qos:
    """Quality of service of a topic by its name in :mod:`gbas_msgs_py.topics` (before any remapping)."""
    if topic.startswith(PROGRESS_PREFIX):
        return DATA
    return _BY_TOPIC.get(topic, DATA)
