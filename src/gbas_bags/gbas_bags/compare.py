"""Two bags of the same inputs: are the outputs the nodes computed the same, bit for bit?"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from gbas_bags import epochs
from gbas_bags.bags import BagReader
from gbas_bags.mcap_scan import Message
from gbas_bags.topic_names import contract_name
from gbas_bags.versions import table_identifier, version_read
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_msgs_py import topics

NAMES: Final[dict[str, str]] = {
    topics.AIRBORNE_PROTECTION: "protection levels",
    topics.AIRBORNE_SOLUTION: "solutions",
    topics.AIRBORNE_MODES: "mode epochs",
    topics.VDB: "VDB bursts",
    topics.GROUND_INTEGRITY: "integrity epochs",
    topics.GROUND_MONITORS: "monitor epochs",
    topics.GROUND_MONITOR_DETAILS: "monitor detail epochs",
    topics.GROUND_CHANNELS: "channel epochs",
}
"""Outputs that are compared, and what they are called."""

Key = tuple[str, int, int, int]
"""Topic, epoch, slot, and number within these."""


def output_name(topic: str) -> str | None:
    """What a compared output is called; None for a topic that is not compared."""
    return NAMES.get(contract_name(topic))


@dataclass
class TopicComparison:
    """How the messages of one topic compare."""

    topic: str
    name: str
    recorded: int = 0
    identical: int = 0
    different: int = 0
    missing: int = 0
    extra: int = 0
    older: str = ""
    first_difference: dict[str, Any] | None = None

    @property
    def same(self) -> bool:
        """Whether everything recorded came out again; what an older version recorded cannot be compared."""
        return self.different == 0 and self.missing == 0 and not self.older

    def verdict(self) -> str:
        """One line for a person."""
        if self.older:
            return f"{self.recorded} {self.name} are {self.older}, and {version_read(self.older)} is made: not compared"
        text = f"{self.identical} of {self.recorded} {self.name} identical bit for bit"
        counts = (("different", self.different), ("missing", self.missing), ("that were not recorded", self.extra))
        rest = [f"{count} {what}" for what, count in counts if count]
        return f"{text}; {', '.join(rest)}" if rest else text

    def explanation(self) -> str:
        """Where the first difference is, for a person; empty without one."""
        if self.first_difference is None:
            return ""
        found = self.first_difference
        text = f"the first difference is at {found['gps_week']} {found['tow_s']:.3f}"
        if "difference" in found:
            text += f", largest in {found['column']}: {found['recorded']!r} became {found['replayed']!r}"
        return f"{text}: {found['what']}" if "what" in found else text


def compare(recorded: Path, replayed: Path) -> list[TopicComparison]:
    """Compare the outputs in two bags, topic by topic, the most important first.

    Raises
    ------
    BagError
        When a bag cannot be read.
    """
    expected: dict[Key, bytes] = {}
    results: dict[str, TopicComparison] = {}
    for key, message in _outputs(recorded):
        result = results.setdefault(key[0], TopicComparison(key[0], output_name(key[0]) or ""))
        result.recorded += 1
        result.older = result.older or _older(message)
        if not result.older:
            expected[key] = _digest(message)
    first: dict[str, tuple[Key, bytes]] = {}
    for key, message in _outputs(replayed):
        result = results.setdefault(key[0], TopicComparison(key[0], output_name(key[0]) or ""))
        if result.older:
            continue
        digest = expected.pop(key, None)
        if digest is None:
            result.extra += 1
        elif digest == _digest(message):
            result.identical += 1
        else:
            result.different += 1
            first.setdefault(key[0], (key, message.data))
    for key in expected:
        results[key[0]].missing += 1
    if first:
        _explain(recorded, results, first)
    order = list(NAMES.values())
    return sorted(results.values(), key=lambda result: (order.index(result.name), result.topic))


def _outputs(bag: Path) -> Iterator[tuple[Key, Message]]:
    seen: dict[tuple[str, int, int], int] = {}
    for message in BagReader(bag).messages():
        topic, msgtype = message.channel.topic, message.channel.schema.name
        if output_name(topic) is None:
            continue
        key = epochs.epoch_of(msgtype, message.data)
        slot = epochs.burst_layout(message.data).get("slot", 0) if msgtype == epochs.BURST_TYPE else 0
        place = (topic, key or 0, slot)
        seen[place] = seen.get(place, -1) + 1
        yield (*place, seen[place]), message


def _older(message: Message) -> str:
    """Schema of a table of an older version; empty for any other message."""
    if message.channel.schema.name != epochs.TABLE_TYPE:
        return ""
    identifier = table_identifier(message.data)
    return identifier if version_read(identifier) else ""


def _digest(message: Message) -> bytes:
    return hashlib.blake2b(epochs.payload(message.channel.schema.name, message.data), digest_size=16).digest()


def _explain(recorded: Path, results: dict[str, TopicComparison], first: dict[str, tuple[Key, bytes]]) -> None:
    """Say where the first difference of each topic is, and in which column it is largest."""
    wanted = dict(first.values())
    for key, message in _outputs(recorded):
        if key in wanted:
            week, tow_s = from_epoch_key(key[1])
            where: dict[str, Any] = {"gps_week": week, "tow_s": tow_s}
            if message.channel.schema.name == epochs.TABLE_TYPE:
                where |= _largest_difference(message.data, wanted[key])
            results[key[0]].first_difference = where


def _largest_difference(a: bytes, b: bytes) -> dict[str, Any]:
    shapes = [epochs.dimensions(data)[0] for data in (a, b)]
    if shapes[0] != shapes[1] or len(shapes[0]) != 2:
        return {"what": "another number of rows or other columns"}
    (_, rows), (label, columns) = shapes[0]
    names = label.partition(": ")[2].split(",")
    before, after = (epochs.table_head(data, rows * columns) for data in (a, b))
    unlike = [(abs(y - x), at) for at, (x, y) in enumerate(zip(before, after, strict=True)) if x != y]
    known = [(size, at) for size, at in unlike if not math.isnan(size)]
    if not known:
        gone = [at for _, at in unlike if math.isnan(before[at]) != math.isnan(after[at])]
        return {"column": names[gone[0] % columns], "what": "a value is there in one bag only"} if gone else {}
    size, at = max(known)
    return {"column": names[at % columns], "recorded": before[at], "replayed": after[at], "difference": size}
