"""Bags: finding their files, reading them in order, what is in them, and saving what is left of a damaged one.

A bag is a rosbag2 folder or a single ``.mcap`` file; every command takes either.
"""

from __future__ import annotations

import datetime
import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from gbas_bags import epochs
from gbas_bags.mcap_log import METADATA_FILE, BagWriter, Topic
from gbas_bags.mcap_scan import Channel, Damage, McapScan, Message
from gbas_bags.topic_names import is_observation
from gbas_bags.versions import older_tables, table_identifier
from gbas_core.errors import BagError
from gbas_core.gnss.gpstime import from_epoch_key

SUITE_METADATA: Final = "gbas"
CONFIGURATION_METADATA: Final = "gbas.configuration"
MAIN_CONFIGURATION: Final = "configuration"
"""Key of the suite's metadata: which of the configuration files starts the nodes."""
VECTOR_METADATA: Final = "vector_instructions"
"""Key of the suite's metadata: the processor's vector instructions, which last bits of sines depend on."""
END_METADATA: Final = "gbas.end"
RECOVERY_METADATA: Final = "gbas.recovery"
_NOT_COPIED: Final = frozenset({"rosbag2", END_METADATA})


def bag_files(path: Path) -> tuple[Path, ...]:
    """The MCAP files of a bag in their order.

    Raises
    ------
    BagError
        When there is no such bag, or it holds no MCAP file.
    """
    if path.is_file():
        if path.suffix != ".mcap":
            raise BagError(path, f"is a {path.suffix or 'nameless'} file; a bag is a folder or a .mcap file")
        return (path,)
    if not path.exists():
        raise BagError(path, "there is no such bag")
    found = sorted(path.glob("*.mcap"), key=_natural)
    listed = _listed_files(path)
    missing = [name for name in listed if not (path / name).is_file()]
    if missing:
        raise BagError(path, f"{METADATA_FILE} names {missing[0]}, which is not there")
    if listed:
        return tuple(path / name for name in listed)
    if not found:
        others = ", ".join(sorted(item.name for item in path.iterdir())[:3])
        raise BagError(path, f"no .mcap file in it, only {others}" if others else "the folder is empty")
    return tuple(found)


def _natural(path: Path) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


def _listed_files(folder: Path) -> list[str]:
    """File names in the order ``metadata.yaml`` gives; none when it is absent or unreadable."""
    try:
        document = yaml.safe_load((folder / METADATA_FILE).read_text(encoding="utf-8"))
        names = document["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(name).name for name in names if str(name).endswith(".mcap")]
    except (OSError, yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError):
        return []


@dataclass
class BagReader:
    """Messages of a bag in file order, with what was found on the way.

    Parameters
    ----------
    path : Path
        Folder or file.
    strict : bool
        Raise at the first damage instead of going on behind it.
    """

    path: Path
    strict: bool = True
    scans: list[McapScan] = field(default_factory=list)

    def messages(self) -> Iterator[Message]:
        """All messages.

        Raises
        ------
        BagError
            When there is no such bag; if strict, when a part of it cannot be read.
        """
        self.scans = []
        for file in bag_files(self.path):
            scan = McapScan(file)
            self.scans.append(scan)
            for message in scan.messages():
                if self.strict and scan.damages:
                    break
                yield message
            if self.strict and (scan.damages or not scan.closed):
                damage = scan.damages[0] if scan.damages else Damage(0, "the file was never closed")
                raise BagError(file, f"at byte {damage.offset}: {damage.what}; try: gbas bag recover {self.path}")

    @property
    def damages(self) -> tuple[tuple[Path, Damage], ...]:
        """What could not be read, by file."""
        return tuple((scan.path, damage) for scan in self.scans for damage in scan.damages)

    @property
    def closed(self) -> bool:
        """Whether every file was ended by its writer."""
        return bool(self.scans) and all(scan.closed for scan in self.scans)

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name; of records with one name the last one."""
        return {name: values for scan in self.scans for name, values in scan.metadata}


def configuration_of(path: Path, metadata: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The configuration files stored in a bag, by name.

    Raises
    ------
    BagError
        When the bag holds none.
    """
    stored = metadata.get(CONFIGURATION_METADATA)
    if not stored:
        raise BagError(path, "no configuration is stored in it, so the nodes cannot be started as they were")
    return dict(stored)


def simulated_column(data: bytes) -> bool | None:
    """Whether an observation table says that a simulator made it; None when it does not say."""
    labels = [label for label, _ in epochs.dimensions(data)[0] if label.startswith("gbas/")]
    columns = labels[0].partition(": ")[2].split(",") if labels else []
    if "simulated" not in columns:
        return None
    value = epochs.table_head(data, columns.index("simulated") + 1)[-1]
    return None if math.isnan(value) else value != 0.0


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


def origin_of(origins: set[bool | None]) -> str:
    """What observation tables say they are, all of them: simulated, recorded, both or unknown."""
    known = origins - {None}
    if not known:
        return "unknown"
    if len(known) > 1:
        return "simulated and recorded"
    return "simulated" if known == {True} else "recorded"


@dataclass(frozen=True)
class Recovery:
    """What a recovery kept and what was lost."""

    source: Path
    target: Path
    kept: Mapping[str, int]
    lost: Mapping[str, int]
    unknown_losses: int
    damages: tuple[tuple[Path, Damage], ...]

    def as_json(self) -> dict[str, Any]:
        """The result as JSON-able data."""
        return {
            "bag": str(self.source),
            "recovered": str(self.target),
            "kept": sum(self.kept.values()),
            "kept_by_topic": dict(sorted(self.kept.items())),
            "lost": sum(self.lost.values()),
            "lost_by_topic": dict(sorted(self.lost.items())),
            "parts_of_unknown_content": self.unknown_losses,
            "damages": [
                {"file": str(file), "offset": damage.offset, "what": damage.what, "lost": damage.lost}
                for file, damage in self.damages
            ],
        }


def recover(path: Path, target: Path | None = None) -> Recovery:
    """Write a good bag with every message that is whole in `path`; the original is not touched.

    Parameters
    ----------
    target : Path, optional
        Folder of the new bag; ``<name>_recovered`` beside the original when not given.

    Raises
    ------
    BagError
        When there is no such bag, nothing in it can be read, or the target exists.
    """
    target = target or path.parent / f"{path.stem if path.is_file() else path.name}_recovered"
    reader = BagReader(path, strict=False)
    stream = reader.messages()
    first = next(stream, None)
    if first is None and not reader.metadata:
        raise BagError(path, f"nothing in it can be saved: {_first_damage(reader)}")
    copied = {name: values for name, values in reader.metadata.items() if name not in _NOT_COPIED}
    writer = BagWriter(target, metadata=copied, flush_period_s=None)
    losses = _SequenceGaps()
    if first is not None:
        _copy(writer, first, losses)
    for message in stream:
        _copy(writer, message, losses)
    counted, unknown = _losses(reader.damages, losses)
    summary = {
        "source": str(path.resolve().name),
        "problems": "\n".join(f"{file.name} at byte {d.offset}: {d.what}" for file, d in reader.damages),
        "lost": str(sum(counted.values())),
        "parts_of_unknown_content": str(unknown),
    }
    late = {name: values for name, values in reader.metadata.items() if name == END_METADATA}
    kept = writer.close({**late, RECOVERY_METADATA: summary})
    return Recovery(path, target, kept, counted, unknown, reader.damages)


def _first_damage(reader: BagReader) -> str:
    return reader.damages[0][1].what if reader.damages else "it is empty"


class _SequenceGaps:
    """Counts messages missing from each topic's numbering, where the bag's own recorder numbered them."""

    def __init__(self) -> None:
        self.missing: dict[str, int] = {}
        self._last: dict[str, int] = {}

    def add(self, topic: str, sequence: int) -> None:
        last = self._last.get(topic)
        if sequence > 0 and last is not None and sequence > last + 1:
            self.missing[topic] = self.missing.get(topic, 0) + sequence - last - 1
        self._last[topic] = sequence


def _copy(writer: BagWriter, message: Message, losses: _SequenceGaps) -> None:
    name = message.channel.topic
    if name not in writer.log:
        writer.log.add_topic(topic_of(message.channel))
    writer.log.write(name, message.data, message.log_time_ns, message.publish_time_ns, message.sequence)
    losses.add(name, message.sequence)


def topic_of(channel: Channel) -> Topic:
    """The topic a channel describes, for writing it again."""
    try:
        profiles = yaml.safe_load(channel.metadata.get("offered_qos_profiles", "")) or []
    except yaml.YAMLError:
        profiles = []
    return Topic(
        name=channel.topic,
        msgtype=channel.schema.name,
        qos=tuple(profiles) if isinstance(profiles, list) else (),
        schema_text=channel.schema.text,
        type_hash=channel.metadata.get("topic_type_hash"),
    )


def _losses(damages: tuple[tuple[Path, Damage], ...], gaps: _SequenceGaps) -> tuple[dict[str, int], int]:
    """Messages known to be lost by topic, and the number of damaged parts that do not tell what was in them."""
    counted: Counter[str] = Counter()
    unknown = 0
    for _, damage in damages:
        if damage.lost is None:
            unknown += 1
        else:
            counted.update(damage.lost)
    for topic, missing in gaps.missing.items():
        counted[topic] = max(counted[topic], missing)
    return dict(counted), unknown


def vector_instructions() -> str:
    """Vector instructions numpy computes with here; the last bits of sines depend on them."""
    found = np.show_config(mode="dicts")["SIMD Extensions"]  # type: ignore[index]  # a dictionary in this mode
    return ",".join([*found.get("baseline", ()), *found.get("found", ())])
