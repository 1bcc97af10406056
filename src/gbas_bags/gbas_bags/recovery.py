"""Saving what is left of a damaged bag, and saying what is lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_bags.bags import END_METADATA, BagReader
from gbas_bags.mcap_log import BagWriter, Topic
from gbas_bags.mcap_scan import Channel, Damage, Message
from gbas_core.errors import BagError

RECOVERY_METADATA: Final = "gbas.recovery"
NOT_COPIED: Final = frozenset({"rosbag2", END_METADATA})


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
    copied = {name: values for name, values in reader.metadata.items() if name not in NOT_COPIED}
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
