"""An MCAP file (profile ``ros2``) that survives the death of its writer, in the folder form of rosbag2.

The usual writer keeps a chunk of up to 1 MiB in memory and an unclosed file is then empty. Here every chunk is small,
is handed to the operating system at the latest `FLUSH_PERIOD_S` after its first message, and is made durable (fsync) by
a thread of its own so that a slow disk never delays a message. Metadata go first, so that they survive as well.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import yaml
from mcap.writer import CompressionType, Writer

from gbas_bags.definitions import MESSAGE_ENCODING, SCHEMA_ENCODING, definition
from gbas_core.errors import BagError

CHUNK_BYTES: Final = 256 * 1024
FLUSH_PERIOD_S: Final = 0.4
PROFILE: Final = "ros2"
LIBRARY: Final = "gbas"
METADATA_FILE: Final = "metadata.yaml"
ROS_DISTRO: Final = "jazzy"
METADATA_VERSION: Final = 9
EMPTY_START_NS: Final = 2**63 - 1


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A recorded topic: its name, type, and the QoS its publishers offered (rosbag2 form)."""

    name: str
    msgtype: str
    qos: tuple[Mapping[str, Any], ...] = ()
    schema_text: str | None = None
    type_hash: str | None = None

    def described(self) -> Topic:
        """The same topic with its message definition filled in from the distribution where it is missing."""
        if self.schema_text is not None:
            return self
        text, digest = definition(self.msgtype)
        return replace(self, schema_text=text, type_hash=digest)

    def qos_text(self) -> str:
        """QoS as the YAML text rosbag2 keeps in a channel's metadata."""
        return yaml.safe_dump([dict(item) for item in self.qos], sort_keys=False) if self.qos else ""


@dataclass
class _Span:
    """Count and time span of messages."""

    count: int = 0
    first_ns: int = EMPTY_START_NS
    last_ns: int = 0
    by_topic: dict[str, int] = field(default_factory=dict)

    def add(self, topic: str, log_time_ns: int) -> None:
        self.count += 1
        self.first_ns = min(self.first_ns, log_time_ns)
        self.last_ns = max(self.last_ns, log_time_ns)
        self.by_topic[topic] = self.by_topic.get(topic, 0) + 1


class McapLog:
    """Writer of one MCAP file; thread-safe.

    Parameters
    ----------
    path : Path
        The file; it must not exist.
    metadata : mapping of name to mapping of str to str
        Metadata records, written before any message.
    chunk_bytes : int
        A chunk is closed when it holds more than this.
    compression : {"zstd", "lz4", "none"}
        Compression of chunks.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        chunk_bytes: int = CHUNK_BYTES,
        compression: str = "zstd",
    ) -> None:
        self.path = path
        self._lock = threading.Lock()
        self._file = path.open("xb")
        kind = CompressionType[compression.upper()]
        # The CRC of the data section lets a reader find damage between the chunks as well as in them.
        self._writer = Writer(self._file, chunk_size=chunk_bytes, compression=kind, enable_data_crcs=True)
        self._writer.start(profile=PROFILE, library=LIBRARY)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[int, Topic]] = {}
        self._span = _Span()
        self._dirty = False
        for name, values in (metadata or {}).items():
            self._writer.add_metadata(name, dict(values))
        self._writer.flush()

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages written so far, by topic."""
        return dict(self._span.by_topic)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics in order of registration."""
        return tuple(topic for _, topic in self._channels.values())

    def __contains__(self, topic: str) -> bool:
        return topic in self._channels

    def add_topic(self, topic: Topic) -> None:
        """Register a topic; needed before its first message."""
        with self._lock:
            if topic.name in self._channels:
                return
            topic = topic.described()
            if topic.msgtype not in self._schemas:
                text = (topic.schema_text or "").encode()
                self._schemas[topic.msgtype] = self._writer.register_schema(topic.msgtype, SCHEMA_ENCODING, text)
            extra = {"offered_qos_profiles": topic.qos_text()}
            if topic.type_hash:
                extra["topic_type_hash"] = topic.type_hash
            channel = self._writer.register_channel(
                topic.name, MESSAGE_ENCODING, self._schemas[topic.msgtype], metadata=extra
            )
            self._channels[topic.name] = (channel, topic)

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int | None = None
    ) -> None:
        """Append one message; without `sequence` it gets the next number of its topic, from 1."""
        with self._lock:
            channel = self._channels[topic][0]
            number = self._span.by_topic.get(topic, 0) + 1 if sequence is None else sequence
            self._writer.add_message(channel, log_time_ns, data, publish_time_ns, number)
            self._span.add(topic, log_time_ns)
            self._dirty = True

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        with self._lock:
            self._writer.flush()
            self._writer.add_metadata(name, dict(values))
            self._writer.flush()

    def flush(self) -> bool:
        """Hand everything to the operating system; a killed process then loses nothing of it. True if there was any."""
        with self._lock:
            if not self._dirty:
                return False
            self._writer.flush()
            self._dirty = False
            return True

    def sync(self) -> None:
        """Flush and wait until the disk has it."""
        self.flush()
        os.fsync(self._file.fileno())

    def abandon(self) -> None:
        """Close the file as it is, without index and summary."""
        with self._lock:
            self._file.close()

    def rename(self, path: Path) -> None:
        """Move the file while it is being written."""
        self.path = self.path.replace(path)

    def close(self, metadata: Mapping[str, Mapping[str, str]] | None = None) -> _Span:
        """Write closing metadata, the index and the summary; the file is then complete."""
        with self._lock:
            self._writer.flush()
            for name, values in (metadata or {}).items():
                self._writer.add_metadata(name, dict(values))
            information = rosbag2_metadata(self.path.name, self.topics, self._span, {})
            self._writer.add_metadata("rosbag2", {"serialized_metadata": _yaml(information)})
            self._writer.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        return self._span


def rosbag2_metadata(file_name: str, topics: Iterable[Topic], span: _Span, custom: Mapping[str, str]) -> dict[str, Any]:
    """The record rosbag2 keeps of a bag (metadata version 9), in ``metadata.yaml`` and in the file itself."""
    start = {"nanoseconds_since_epoch": span.first_ns}
    duration = {"nanoseconds": max(0, span.last_ns - span.first_ns)}
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        "message_count": span.count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.msgtype,
                    "serialization_format": MESSAGE_ENCODING,
                    "offered_qos_profiles": [dict(item) for item in topic.qos],
                    "type_description_hash": topic.type_hash or "",
                },
                "message_count": span.by_topic.get(topic.name, 0),
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, "starting_time": start, "duration": duration, "message_count": span.count}],
        "custom_data": dict(custom) or None,
        "ros_distro": ROS_DISTRO,
    }


class _NoAliases(yaml.SafeDumper):
    """YAML without anchors: rosbag2's parser and people read it the same way."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(value: Any) -> str:
    return yaml.dump(value, Dumper=_NoAliases, sort_keys=False)


def _write_atomically(path: Path, text: str) -> None:
    temporary = path.with_suffix(path.suffix + ".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


class BagWriter:
    """A rosbag2 folder ``<name>/<name>_0.mcap`` and ``<name>/metadata.yaml``, flushed by a thread of its own.

    Parameters
    ----------
    folder : Path
        The bag's folder; refused when it holds anything already.
    metadata : mapping of name to mapping of str to str
        Metadata records of the MCAP file.
    custom : mapping of str to str
        ``custom_data`` of metadata.yaml.
    flush_period_s : float or None
        Longest time a message stays in this process [s]; None for no timed flush (offline writers).

    Raises
    ------
    BagError
        When the folder exists and is not empty, or cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        *,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        custom: Mapping[str, str] | None = None,
        flush_period_s: float | None = FLUSH_PERIOD_S,
        **log_options: Any,
    ) -> None:
        self.folder = folder
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BagError(folder, "already exists; a recording never overwrites anything, choose another name")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BagError(folder, f"cannot make the folder: {error.strerror}") from error
        self._path = folder / f"{folder.name}_0.mcap"
        self._metadata = {name: dict(values) for name, values in (metadata or {}).items()}
        self._custom = dict(custom or {})
        self._log_options = log_options
        self.log = McapLog(self._path, metadata=self._metadata, **log_options)
        self.failure: OSError | None = None
        self._restart_lock = threading.Lock()
        self._stop = threading.Event()
        self._period_s = flush_period_s
        self._thread = threading.Thread(target=self._keep_flushed, name="bag-flush", daemon=True)
        if flush_period_s is not None:
            self._thread.start()

    def _keep_flushed(self) -> None:
        assert self._period_s is not None
        next_sync = 0.0
        while self.failure is None and not self._stop.wait(self._period_s):
            try:
                with self._restart_lock:
                    if self.log.flush() and time.monotonic() >= next_sync:
                        self.log.sync()
                        next_sync = time.monotonic() + 2.0 * self._period_s
            except OSError as error:
                self.failure = error

    def restart(self, messages: Sequence[tuple[str, bytes, int, int]]) -> None:
        """Begin the file anew with `messages` (topic, data, log time, publish time); the old one stays until then.

        For the recorder, which only knows what time the first messages belong to once an epoch has come.
        """
        with self._restart_lock:
            old = self.log
            fresh = McapLog(self._path.with_suffix(".mcap.new"), metadata=self._metadata, **self._log_options)
            for topic in old.topics:
                fresh.add_topic(topic)
            for topic_name, data, log_time_ns, publish_time_ns in messages:
                fresh.write(topic_name, data, log_time_ns, publish_time_ns)
            fresh.sync()
            fresh.rename(self._path)
            self.log = fresh
            old.abandon()

    def close(
        self, metadata: Mapping[str, Mapping[str, str]] | None = None, *, custom: Mapping[str, str] | None = None
    ) -> Mapping[str, int]:
        """End the recording, with more ``custom_data`` if there is some; returns messages by topic."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        span = self.log.close(metadata)
        information = rosbag2_metadata(self._path.name, self.log.topics, span, self._custom | dict(custom or {}))
        _write_atomically(self.folder / METADATA_FILE, _yaml({"rosbag2_bagfile_information": information}))
        return dict(span.by_topic)
