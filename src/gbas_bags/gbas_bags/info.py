"""What is in a bag: files, times, topics, versions, where it came from."""

from __future__ import annotations

import datetime
import itertools
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gbas_bags import epochs
from gbas_bags.bags import (
    CONFIGURATION_METADATA,
    END_METADATA,
    SUITE_METADATA,
    BagReader,
    bag_files,
    origin_of,
    simulated_column,
)
from gbas_bags.mcap_scan import Damage, Message
from gbas_bags.topic_names import is_observation
from gbas_bags.versions import older_tables, table_identifier
from gbas_core.gnss.gpstime import from_epoch_key


@dataclass
class _TopicSummary:
    """What `info` tells of a topic."""

    msgtype: str
    count: int = 0
    first_epoch: int | None = None
    last_epoch: int | None = None
    bytes: int = 0
    schemas: set[str] = field(default_factory=set)

    def add(self, message: Message) -> None:
        self.count += 1
        self.bytes += len(message.data)
        try:
            if self.msgtype == epochs.TABLE_TYPE:
                self.schemas.add(table_identifier(message.data))
            key = epochs.epoch_of(self.msgtype, message.data)
        except epochs.PayloadError:
            return
        if key is not None:
            self.first_epoch = key if self.first_epoch is None else min(self.first_epoch, key)
            self.last_epoch = key if self.last_epoch is None else max(self.last_epoch, key)


@dataclass
class BagInfo:
    """Summary of a bag; :meth:`as_json` is what ``gbas bag info --json`` prints."""

    path: Path
    files: tuple[Path, ...]
    topics: dict[str, _TopicSummary]
    metadata: dict[str, dict[str, str]]
    closed: bool
    damages: tuple[tuple[Path, Damage], ...]
    first_ns: int
    last_ns: int
    epochs: tuple[int, ...]
    origin: str

    @property
    def messages(self) -> int:
        """All messages that could be read."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def older_tables(self) -> dict[str, str]:
        """Tables of an older version, each with the version that is read."""
        return older_tables(each for topic in self.topics.values() for each in topic.schemas)

    def as_json(self) -> dict[str, Any]:
        """The summary as JSON-able data."""
        suite = self.metadata.get(SUITE_METADATA, {})
        return {
            "bag": str(self.path),
            "files": [str(file) for file in self.files],
            "size_bytes": sum(file.stat().st_size for file in self.files),
            "closed": self.closed,
            "suite_version": suite.get("suite_version"),
            "origin": self.origin,
            "command": suite.get("command"),
            "created": suite.get("created"),
            "configuration": sorted(self.metadata.get(CONFIGURATION_METADATA, {})),
            "ended": self.metadata.get(END_METADATA, {}).get("reason"),
            "lost_in_transport": _integer(self.metadata.get(END_METADATA, {}).get("lost")),
            "duration_s": max(0, self.last_ns - self.first_ns) / 1e9 if self.messages else 0.0,
            "start": _calendar(self.first_ns) if self.messages else None,
            "end": _calendar(self.last_ns) if self.messages else None,
            "epochs": _epoch_range(self.epochs),
            "messages": self.messages,
            "older_tables": self.older_tables,
            "topics": [
                {
                    "topic": name,
                    "type": topic.msgtype,
                    "schemas": sorted(topic.schemas - {""}),
                    "messages": topic.count,
                    "bytes": topic.bytes,
                    "first_epoch": _epoch_json(topic.first_epoch),
                    "last_epoch": _epoch_json(topic.last_epoch),
                }
                for name, topic in sorted(self.topics.items())
            ],
            "damages": [
                {"file": str(file), "offset": damage.offset, "what": damage.what, "lost": damage.lost}
                for file, damage in self.damages
            ],
        }


def _integer(text: str | None) -> int | None:
    return int(text) if text is not None and text.isdigit() else None


def _calendar(time_ns: int) -> str:
    moment = datetime.datetime.fromtimestamp(time_ns / 1e9, tz=datetime.UTC)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3]


def _epoch_json(key: int | None) -> dict[str, float] | None:
    if key is None:
        return None
    week, tow_s = from_epoch_key(key)
    return {"gps_week": week, "tow_s": tow_s}


def _epoch_range(keys: tuple[int, ...]) -> dict[str, Any] | None:
    if not keys:
        return None
    steps = Counter(b - a for a, b in itertools.pairwise(keys))
    interval = steps.most_common(1)[0][0] / 1000.0 if steps else None
    return {"first": _epoch_json(keys[0]), "last": _epoch_json(keys[-1]), "count": len(keys), "interval_s": interval}


def info(path: Path) -> BagInfo:
    """Read a bag through and sum it up; damage is listed, not raised.

    Raises
    ------
    BagError
        When there is no such bag.
    """
    files = bag_files(path)
    reader = BagReader(path, strict=False)
    topics: dict[str, _TopicSummary] = {}
    observed: set[int] = set()
    origins: set[bool | None] = set()
    first_ns, last_ns = 2**63 - 1, 0
    for message in reader.messages():
        name = message.channel.topic
        summary = topics.setdefault(name, _TopicSummary(message.channel.schema.name))
        summary.add(message)
        first_ns, last_ns = min(first_ns, message.log_time_ns), max(last_ns, message.log_time_ns)
        if is_observation(name) and summary.msgtype == epochs.TABLE_TYPE:
            try:
                observed.add(epochs.table_epoch(message.data))
                origins.add(simulated_column(message.data))
            except epochs.PayloadError:
                continue
    return BagInfo(
        path=path,
        files=files,
        topics=topics,
        metadata=reader.metadata,
        closed=reader.closed,
        damages=reader.damages,
        first_ns=first_ns,
        last_ns=last_ns,
        epochs=tuple(sorted(observed)),
        origin=origin_of(origins),
    )
