"""The recorder node: every topic of the suite into one bag, the bytes as they came.

Kill it at any moment and the bag holds everything up to the last second (``gbas bag recover`` puts the end on); end it
with SIGINT and it takes what is still on its way first. It tells the driver of the data which epoch it has written, so
that a run faster than real time loses nothing.
"""

from __future__ import annotations

import datetime
import platform
import re
import sys
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gbas_bags import epochs
from gbas_bags.bags import (
    CONFIGURATION_METADATA,
    END_METADATA,
    MAIN_CONFIGURATION,
    SUITE_METADATA,
    VECTOR_METADATA,
    origin_of,
    simulated_column,
    vector_instructions,
)
from gbas_bags.capture import Capture, Taken
from gbas_bags.data_time import DataTime
from gbas_bags.definitions import definition, qos_record
from gbas_bags.mcap_log import CHUNK_BYTES, FLUSH_PERIOD_S, BagWriter, Topic
from gbas_bags.topic_names import contract_name, is_observation
from gbas_core.errors import ConfigError
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_msgs_py import topics
from gbas_msgs_py.qos import qos_of
from gbas_msgs_py.tables import schema_dictionary
from gbas_node.node import EXIT_FAILED, GbasNode
from gbas_node.params import NodeParams
from gbas_node.serving import run

NODE_NAME: Final = "recorder"
SCHEMAS_METADATA: Final = "gbas.schemas"
QUEUE_DEPTH: Final = 4096
_PREFIX: Final = f"{topics.DEFAULT_NAMESPACE}/"
_DISCOVERY_PERIOD_S: Final = 0.5
_QUIET_S: Final = 0.3
_DRAIN_LIMIT_S: Final = 5.0
_MAX_HELD: Final = 20_000
# Topics with more than one publisher, whose numbers say nothing about losses.
_SHARED: Final = frozenset({topics.EVENTS, topics.DIAGNOSTICS, topics.SCHEMAS, "/rosout", "/parameter_events"})


@parameters
class RecorderParams(NodeParams):
    """Parameters of the recorder."""

    out: Annotated[str, Parameter("folder of the bag; must not exist, or be empty")]
    topics: Annotated[
        tuple[str, ...], Parameter("topics to record beside those of the suite, 'name' or 'name:type'")
    ] = ()
    exclude: Annotated[str, Parameter("regular expression of topics not to record; empty for none")] = ""
    config_files: Annotated[
        tuple[str, ...],
        Parameter("configuration files whose text goes into the bag, the one that starts the nodes first"),
    ] = ()
    command: Annotated[str, Parameter("command line that started it all")] = ""
    log_time: Annotated[
        Literal["data", "wall"],
        Parameter("what messages are laid out along: the data's time, or the time of their reception"),
    ] = "data"
    flush_period_s: Annotated[float, Parameter("longest time a message stays in this process", "s", 0.05, 0.5)] = (
        FLUSH_PERIOD_S
    )
    chunk_bytes: Annotated[int, Parameter("size at which a chunk is closed", "bytes", 1024, 1 << 24)] = CHUNK_BYTES
    compression: Annotated[Literal["zstd", "lz4", "none"], Parameter("of the chunks")] = "zstd"

    def __post_init__(self) -> None:
        if not self.out:
            raise ParameterError("out = '' is not the folder of the bag")
        try:
            re.compile(self.exclude)
        except re.error as error:
            raise ParameterError(f"exclude = {self.exclude!r} is not a regular expression ({error})") from None


def suite_metadata(command: str, config_files: Sequence[str]) -> dict[str, dict[str, str]]:
    """What every bag says of its making: version, time, command line, configuration, schemas.

    Raises
    ------
    ConfigError
        When a configuration file cannot be read.
    """
    about = {
        "suite_version": version("gbas_bags"),
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": command,
        "python": platform.python_version(),
        VECTOR_METADATA: vector_instructions(),
    }
    files: dict[str, str] = {}
    for path in map(Path, config_files):
        if path.name in files:
            raise ConfigError(path, "another configuration file of the run has the same name, and a bag keeps one")
        try:
            files[path.name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(path, f"cannot be read: {error}") from error
    if files:
        about[MAIN_CONFIGURATION] = next(iter(files))
    return {
        SUITE_METADATA: about,
        CONFIGURATION_METADATA: files,
        SCHEMAS_METADATA: {"dictionary": schema_dictionary()},
    }


def _simulated(data: bytes) -> bool | None:
    try:
        return simulated_column(data)
    except epochs.PayloadError:
        return None


class Recording:
    """Puts messages into a bag: names their time, counts what the transport lost, holds what came before any time."""

    def __init__(self, writer: BagWriter, *, data_time: bool) -> None:
        self.writer = writer
        self.time = DataTime()
        self.written = 0
        self.newest_epoch: int | None = None
        self.lost: dict[str, int] = {}
        self._held: list[Taken] | None = [] if data_time else None
        self._data_time = data_time
        self._simulated: dict[str, bool | None] = {}
        self._types: dict[str, str] = {}
        self._numbers: dict[str, int] = {}

    def add_topic(self, topic: Topic) -> None:
        """Make a topic known; needed before its first message."""
        self._types[topic.name] = topic.msgtype
        self.writer.log.add_topic(topic)

    def add(self, message: Taken) -> None:
        """Write one message."""
        self._count_lost(message)
        key = self.time.key_of(message.topic, self._types[message.topic], message.data)
        if self._held is not None:
            self._hold(message)
        else:
            self._write(message, key)
        if key is not None and is_observation(message.topic):
            self.newest_epoch = key if self.newest_epoch is None else max(self.newest_epoch, key)
            if message.topic not in self._simulated:
                self._simulated[message.topic] = _simulated(message.data)

    @property
    def origin(self) -> str:
        """Whether the observations are simulated, by the first of each receiver."""
        return origin_of(set(self._simulated.values()))

    def _write(self, message: Taken, key: int | None) -> None:
        timed = self._data_time and key is not None
        log_time_ns = epochs.ros_time_ns(key) if timed and key is not None else message.received_ns
        self.writer.log.write(message.topic, message.data, log_time_ns, message.published_ns)
        self.written += 1

    def _hold(self, message: Taken) -> None:
        """Before the first epoch messages are written by the wall clock, and again by the data's once that is known."""
        assert self._held is not None
        self._held.append(message)
        self._write(message, None)
        if self.time.current is not None:
            now_ns = epochs.ros_time_ns(self.time.current)
            self.writer.restart([(held.topic, held.data, now_ns, held.published_ns) for held in self._held])
            self._held = None
        elif len(self._held) > _MAX_HELD:
            self._held = None

    def _count_lost(self, message: Taken) -> None:
        if message.number is None or message.topic in _SHARED:
            return
        last = self._numbers.get(message.topic)
        if last is not None and message.number > last + 1:
            self.lost[message.topic] = self.lost.get(message.topic, 0) + message.number - last - 1
        self._numbers[message.topic] = message.number


class Recorder(GbasNode):
    """Records the topics of the suite, of every namespace below ``/gbas``, and what else it is told to."""

    params_type = RecorderParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(NODE_NAME, **kwargs)
        self.check_overrides()  # before there is a bag
        params: RecorderParams = self.params
        metadata = suite_metadata(params.command or " ".join(sys.argv), params.config_files)
        writer = BagWriter(
            Path(params.out),
            metadata=metadata,
            custom={"gbas_version": version("gbas_bags")},
            flush_period_s=params.flush_period_s,
            chunk_bytes=params.chunk_bytes,
            compression=params.compression,
        )
        self._recording = Recording(writer, data_time=params.log_time == "data")
        self._exclude = re.compile(params.exclude) if params.exclude else None
        self._wanted = dict(_wanted(entry) for entry in params.topics)
        self._refused: set[str] = set()
        self._known: set[str] = set()
        self._discovery_due_s = 0.0
        self._inputs = Node(
            f"{self.get_name()}_inputs",
            namespace=self.get_namespace(),
            context=self.context,
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._capture = Capture(self._inputs, self._on_batch, self._discover)
        for spec in topics.TOPICS:
            self._subscribe(topics.resolve(spec.name), spec.message_type, latched=spec.latched)
        for name, msgtype in self._wanted.items():
            if msgtype:
                self._subscribe(name, msgtype, latched=False)
        self._capture.start()

    # --- topics

    def _subscribe(self, name: str, msgtype: str, *, latched: bool, reliable: bool = True) -> None:
        if name in self._capture.topics or name in self._refused or (self._exclude and self._exclude.search(name)):
            return
        profile = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=QUEUE_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        try:
            definition(msgtype)
            self._capture.subscribe(name, msgtype, profile)
        except LookupError as error:
            self._refused.add(name)
            self.problem("topic not recorded", f"{name}: message type {error} is not known")

    def _discover(self) -> None:
        """Find topics of other namespaces, progress, and those asked for by name alone."""
        now = time.monotonic()
        if now < self._discovery_due_s:
            return
        self._discovery_due_s = now + _DISCOVERY_PERIOD_S
        for name, types in self._inputs.get_topic_names_and_types():
            if name in self._capture.topics or len(types) != 1:
                continue
            if name.startswith(_PREFIX) or name in self._wanted:
                offered = self._inputs.get_publishers_info_by_topic(name)
                if offered:
                    latched = all(_latched(info.qos_profile) for info in offered)
                    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in offered)
                    self._subscribe(name, types[0], latched=latched, reliable=reliable)

    def _register(self, name: str) -> None:
        """Describe a topic in the bag, with the QoS its publishers offer."""
        offered = self._inputs.get_publishers_info_by_topic(name)
        types = dict(self._inputs.get_topic_names_and_types()).get(name) or [_type_of(name)]
        profiles = [
            qos_record(
                depth=info.qos_profile.depth or qos_of(contract_name(name)).depth,  # discovery does not tell the depth
                reliable=info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
                transient_local=_latched(info.qos_profile),
            )
            for info in offered[:1]
        ]
        self._recording.add_topic(Topic(name=name, msgtype=types[0], qos=tuple(profiles)))
        self._known.add(name)

    # --- messages

    def _on_batch(self, batch: Sequence[Taken]) -> None:
        before = self._recording.newest_epoch
        for message in batch:
            if message.topic not in self._known:
                self._register(message.topic)
            self._recording.add(message)
        newest = self._recording.newest_epoch
        if newest is not None and newest != before:
            self.finished_epoch(*from_epoch_key(newest))

    def due(self, now_s: float) -> float:
        """Look after the writing threads; a disk that is full must not go unnoticed."""
        failure = self._capture.failure or self._recording.writer.failure
        if failure is not None and self.exit_code is None:
            self.problem("recording failed", str(failure))
            print(f"{NODE_NAME}: {self.params.out}: {failure}", file=sys.stderr, flush=True)
            self.end(EXIT_FAILED)
        return super().due(now_s)

    def details(self) -> dict[str, Any]:
        """Values for the diagnostics."""
        lost = sum(self._recording.lost.values())
        return {"messages": self._recording.written, "lost": lost, "bag": self.params.out}

    def finish(self) -> None:
        """Take what is on its way and close the bag."""
        self._capture.stop(_QUIET_S, _DRAIN_LIMIT_S)
        lost, origin = self._recording.lost, self._recording.origin
        end = {
            "data": origin,
            "reason": "failed" if self.exit_code else "ended",
            "lost": str(sum(lost.values())),
            "lost_by_topic": ", ".join(f"{name} {count}" for name, count in sorted(lost.items())),
        }
        try:
            counts = self._recording.writer.close({END_METADATA: end}, custom={"data": origin})
        except OSError as error:
            if self.exit_code is None:
                print(f"{NODE_NAME}: {self.params.out}: {error}", file=sys.stderr, flush=True)
            self.end(EXIT_FAILED)
            return
        self.get_logger().info(f"{sum(counts.values())} messages of {len(counts)} topics in {self.params.out}")

    def close(self, *, orderly: bool) -> None:
        """End the thread before what it uses goes."""
        if not orderly:
            self._capture.stop(0.0, 0.0)
        super().close(orderly=orderly)
        self._inputs.destroy_node()


def _wanted(entry: str) -> tuple[str, str | None]:
    name, _, msgtype = entry.partition(":")
    if not name.startswith("/"):
        raise ParameterError(f"topics = {entry!r} is not an absolute name, '/name' or '/name:package/msg/Type'")
    return name, msgtype or None


def _type_of(name: str) -> str:
    for spec in topics.TOPICS:
        if topics.resolve(spec.name) == name:
            return spec.message_type
    raise LookupError(name)


def _latched(profile: QoSProfile) -> bool:
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def main() -> None:
    """Run the recorder."""
    run(Recorder)


if __name__ == "__main__":
    main()
