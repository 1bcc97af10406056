"""Messages of a bag against the contract: they decode, are in order, frames whole, alerts and exclusions traced."""

from __future__ import annotations

import contextlib
import itertools
import math
import struct
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from gbas_bags import epochs
from gbas_bags.mcap_scan import McapScan, Message
from gbas_bags.problems import CheckResult, Problem, text_of
from gbas_bags.topic_names import contract_name, is_ephemeris, is_observation, is_progress, split
from gbas_bags.versions import older_tables, older_text, table_identifier, version_read
from gbas_core.gnss.gpstime import calendar_text, epoch_key, from_epoch_key
from gbas_core.record import Record
from gbas_core.satellites import SAT_INDEX
from gbas_msgs_py import topics
from gbas_msgs_py.codes import EventKind, MonitorState
from gbas_msgs_py.events import Event, EventError
from gbas_msgs_py.monitors import monitor_named, traced_causes
from gbas_msgs_py.records import MonitorEpoch, ProtectionEpoch
from gbas_msgs_py.ros import BURST_LABEL, burst_from_msg, table_from_msg
from gbas_msgs_py.schema import SchemaError
from gbas_vdb.transmission.receive import decode_burst

UNFINISHED_EPOCHS: Final = 16
"""Epochs at either end of a recording that may be without outputs: they were under way."""
_GROUND_OUTPUTS: Final = (
    topics.GROUND_INTEGRITY,
    topics.GROUND_MONITORS,
    topics.GROUND_MONITOR_DETAILS,
    topics.GROUND_CHANNELS,
)
_COMPARING_CAUSES: Final = ("_above_", "timeout")


@dataclass
class _Series:
    """Epochs of a topic in order, with the index of each message."""

    file: str
    keys: list[int] = field(default_factory=list)
    last_sequence: int = 0


@dataclass
class _Frame:
    """Bursts of a VDB frame."""

    expected: int
    index: int
    file: str
    slots: list[int] = field(default_factory=list)


class Contents:
    """Decodes every message of a bag and remembers what the later checks need."""

    def __init__(self, result: CheckResult) -> None:
        self._result = result
        self._stores: dict[str, Typestore] = {}
        self._indices: Counter[str] = Counter()
        self._series: dict[str, _Series] = {}
        self._frames: dict[str, dict[int, _Frame]] = defaultdict(dict)
        self._protection: dict[str, list[tuple[int, int, str, ProtectionEpoch]]] = defaultdict(list)
        self._alerts: dict[int, list[Event]] = defaultdict(list)
        self._exclusions: list[Event] = []
        self._failed: dict[tuple[int, str, str], list[tuple[float, float]]] = defaultdict(list)
        self._traced = traced_causes()
        self._older: Counter[tuple[str, str, str]] = Counter()
        self._specs = {topics.resolve(spec.name): spec for spec in topics.TOPICS}

    def read(self, file: Path) -> int:
        """Decode a file; returns the number of its messages."""
        scan = McapScan(file)
        count = 0
        for message in scan.messages():
            count += 1
            self._message(str(file), message)
        for damage in scan.damages:
            lost = "" if not damage.lost else f"; lost: {_counts(damage.lost)}"
            self._result.problem(Problem(f"at byte {damage.offset}: {damage.what}{lost}", str(file)))
        return count

    def _message(self, file: str, message: Message) -> None:
        topic = message.channel.topic
        index = self._indices[topic]
        self._indices[topic] += 1

        def wrong(what: str) -> None:
            self._result.problem(Problem(what, file, topic, index))

        self._sequence(file, topic, message, wrong)
        if self._is_older(file, topic, message):
            self._keep_place(topic, message)
            return
        try:
            decoded = self._deserialised(message)
            self._contract(file, topic, index, message, decoded)
        except (SchemaError, EventError, epochs.PayloadError) as error:
            wrong(str(error))
            self._keep_place(topic, message)
            return
        self._result.checked["payloads decoded"] += 1

    def _is_older(self, file: str, topic: str, message: Message) -> bool:
        """Whether it is a table of an older version, which is told once."""
        identifier = ""
        if message.channel.schema.name == epochs.TABLE_TYPE:
            with contextlib.suppress(epochs.PayloadError, struct.error):
                identifier = table_identifier(message.data)
        if version_read(identifier) is None:
            return False
        self._older[file, topic, identifier] += 1
        return True

    def _keep_place(self, topic: str, message: Message) -> None:
        """A message that cannot be used is not missing as well."""
        with contextlib.suppress(epochs.PayloadError):
            key = epochs.epoch_of(message.channel.schema.name, message.data)
            keys = self._series[topic].keys
            if key is not None and message.channel.schema.name == epochs.TABLE_TYPE and (not keys or keys[-1] < key):
                keys.append(key)

    def _sequence(self, file: str, topic: str, message: Message, wrong: Callable[[str], None]) -> None:
        series = self._series.setdefault(topic, _Series(file))
        if message.sequence and series.last_sequence and message.sequence != series.last_sequence + 1:
            wrong(f"has number {message.sequence} after {series.last_sequence}: messages are missing or out of order")
        series.last_sequence = message.sequence

    def _deserialised(self, message: Message) -> Any:
        """The message by the definition that stands in the bag itself."""
        schema = message.channel.schema
        try:
            if schema.name not in self._stores:
                store = get_typestore(Stores.EMPTY)
                store.register(get_types_from_msg(schema.text, schema.name))
                self._stores[schema.name] = store
            return self._stores[schema.name].deserialize_cdr(message.data, schema.name)
        except (TypesysError, KeyError) as error:
            raise epochs.PayloadError(f"the definition of {schema.name!r} cannot be used: {text_of(error)}") from None
        except Exception as error:  # rosbags lets whatever the bytes provoke through
            raise epochs.PayloadError(f"is no {schema.name}: {text_of(error)}") from None

    def _contract(self, file: str, topic: str, index: int, message: Message, decoded: Any) -> None:
        """What the topic carries must follow the contract."""
        spec = self._specs.get(topic) or self._specs.get(topics.resolve(contract_name(topic)))
        kind = message.channel.schema.name
        if spec is not None and spec.message_type != kind:
            raise SchemaError(f"has type {kind}, expected {spec.message_type}")
        if kind == epochs.TABLE_TYPE and topic.startswith(f"{topics.DEFAULT_NAMESPACE}/"):
            self._table(file, topic, index, decoded, spec.schema if spec else None)
        elif kind == epochs.BURST_TYPE and topic.startswith(f"{topics.DEFAULT_NAMESPACE}/"):
            self._burst(file, topic, index, decoded)
        elif topic == topics.EVENTS:
            event = Event.from_json(decoded.data)
            if event.kind is EventKind.ALERT:
                self._alerts[event.epoch].append(event)
            elif event.kind is EventKind.EXCLUSION and event.cause in self._traced and event.subject in SAT_INDEX:
                self._exclusions.append(event)

    def _table(self, file: str, topic: str, index: int, decoded: Any, schema: str | None) -> None:
        record: Record = table_from_msg(decoded)
        label = decoded.layout.dim[1].label.partition(":")[0]
        if schema is not None and label != schema:
            raise SchemaError(f"has schema {label!r}, expected {schema!r}")
        key = epoch_key(record.gps_week, record.tow_s)
        self._series[topic].keys.append(key)
        if isinstance(record, ProtectionEpoch):
            self._protection[topic].append((key, index, file, record))
        elif isinstance(record, MonitorEpoch):
            for row in record.rows():
                if row.state is MonitorState.FAILED:
                    cause = monitor_named(row.monitor).test(row.test).cause.word
                    self._failed[key, cause, row.sat].append((row.statistic, row.threshold))

    def _burst(self, file: str, topic: str, index: int, decoded: Any) -> None:
        burst = burst_from_msg(decoded)
        key = epoch_key(burst.gps_week, burst.tow_s)
        frame = self._frames[topic].setdefault(key, _Frame(burst.bursts_in_frame, index, file))
        frame.slots.append(burst.slot)
        if len(frame.slots) == 1:
            self._series[topic].keys.append(key)
        if burst.payload:
            errors = decode_burst(burst).errors
            if errors:
                raise SchemaError(f"{BURST_LABEL}: {errors[0].reason}")

    # --- versions

    def check_versions(self) -> None:
        """Tables of an older version cannot be checked."""
        for (file, topic, identifier), count in self._older.items():
            what = f"{count} tables are {identifier}, and {version_read(identifier)} is read: not checked"
            self._result.problem(Problem(what, file, topic))
        older = older_tables(identifier for _, _, identifier in self._older)
        if older:
            self._result.notes.append(f"written with {older_text(older)}")

    # --- order and completeness

    def check_order(self) -> None:
        """Epochs must grow, receivers must have them all, and every input must have its output."""
        for topic, series in self._series.items():
            if is_ephemeris(topic) or is_progress(topic):
                continue  # a reception, and how far a reader is, may be said twice
            for index, (before, after) in enumerate(itertools.pairwise(series.keys), start=1):
                if after <= before:
                    what = f"epoch {_epoch(after)} after {_epoch(before)}"
                    self._result.problem(Problem(what, series.file, topic, index))
        ground = {name: series for name, series in self._series.items() if _is_ground_observation(name)}
        observed = sorted({key for series in ground.values() for key in series.keys})
        for topic, series in ground.items():
            self._complete(topic, series, observed, "another receiver has")
        self._outputs(observed)
        self._gaps(observed)

    def _outputs(self, observed: list[int]) -> None:
        for topic, series in self._series.items():
            namespace, name = split(topic)
            if name in _GROUND_OUTPUTS:
                self._complete(topic, series, observed, "was observed")
            elif name in (topics.AIRBORNE_SOLUTION, topics.AIRBORNE_PROTECTION, topics.AIRBORNE_MODES):
                source = self._series.get(f"{namespace}/{topics.AIRBORNE_OBSERVATIONS}")
                self._complete(topic, series, sorted(source.keys) if source else [], "was observed")
            elif topic in self._frames:
                self._complete(topic, series, observed, "was observed")

    def _complete(self, topic: str, series: _Series, expected: list[int], why: str) -> None:
        there = set(series.keys)
        missing = [key for key in expected if key not in there]
        if not missing or not there:
            if missing:
                self._result.problem(Problem(f"none of {len(missing)} epochs is there", series.file, topic))
            return
        inside = [key for key in missing if min(there) < key < max(there)]
        ends = len(missing) - len(inside)
        if inside:
            what = f"{len(inside)} epochs are missing that {why}, the first is {_epoch(inside[0])}"
            self._result.problem(Problem(what, series.file, topic))
        if ends > UNFINISHED_EPOCHS:
            self._result.problem(Problem(f"{ends} epochs at the ends are missing that {why}", series.file, topic))
        elif ends:
            self._result.notes.append(f"{topic}: {ends} epochs at the ends of the recording were under way")

    def _gaps(self, observed: list[int]) -> None:
        """A gap in which no receiver observed anything is the receivers' doing; the numbering shows what was lost."""
        steps = Counter(after - before for before, after in itertools.pairwise(observed))
        if not steps:
            return
        interval = steps.most_common(1)[0][0]
        for before, after in itertools.pairwise(observed):
            if after - before > interval:
                self._result.notes.append(
                    f"no receiver observed for {(after - before) / 1000.0:g} s after {_epoch(before)}"
                )

    def check_frames(self) -> None:
        """A frame must have the bursts it says it has, each slot once; the last may have been under way."""
        for topic, frames in self._frames.items():
            last = max(frames)
            for key, frame in frames.items():
                expected = max(frame.expected, 1)  # an empty frame travels as one message
                if len(frame.slots) < expected and key == last:
                    continue
                if len(frame.slots) != expected or len(set(frame.slots)) != len(frame.slots):
                    what = f"frame {_epoch(key)} has {len(frame.slots)} bursts, and says {expected}"
                    self._result.problem(Problem(what, frame.file, topic, frame.index))
                self._result.checked["VDB frames"] += 1

    def check_alerts(self) -> None:
        """Each beginning and end of an alert must have an event of its epoch, with the cause and what was compared."""
        for topic, rows in self._protection.items():
            before: float | None = None
            for key, index, file, record in rows:
                alert = record.alert
                if alert != before and not (before is None and alert == 0.0):
                    self._trace(topic, key, index, file, begins=alert != 0.0)
                before = alert
                self._result.checked["protection levels"] += 1

    def check_exclusions(self) -> None:
        """Each satellite a monitor excluded must have failed in that monitor's table, by the same value."""
        topic = topics.resolve(topics.GROUND_MONITORS)
        if topic not in self._series or any(topic == older for _, older, _ in self._older):
            return
        for event in self._exclusions:
            measured = self._failed.get((event.epoch, event.cause, event.subject), [])
            if (event.value, event.threshold) not in measured:
                what = f"the exclusion of {event.subject} at {_epoch(event.epoch)} by {event.cause} is not in the table"
                self._result.problem(Problem(what, self._series[topic].file, topic))
            self._result.checked["exclusions traced"] += 1

    def _trace(self, topic: str, key: int, index: int, file: str, *, begins: bool) -> None:
        events = [event for event in self._alerts.get(key, []) if (event.cause == "cleared") != begins]
        if not events:
            what = f"the {'alert' if begins else 'end of an alert'} at {_epoch(key)} has no event"
            self._result.problem(Problem(what, file, topic, index))
            return
        for event in events:
            compared = any(mark in event.cause for mark in _COMPARING_CAUSES)
            if compared and not (math.isfinite(event.threshold) and not math.isnan(event.value)):
                what = f"the event of the alert at {_epoch(key)}, {event.cause}, lacks value or threshold"
                self._result.problem(Problem(what, file, topic, index))
            self._result.checked["alerts traced"] += 1


def _is_ground_observation(topic: str) -> bool:
    return is_observation(topic) and "/ground/" in topic


def _epoch(key: int) -> str:
    week, tow_s = from_epoch_key(key)
    return f"{week} {tow_s:.3f} ({calendar_text(week, tow_s)})"


def _counts(lost: dict[str, int]) -> str:
    return ", ".join(f"{count} of {topic}" for topic, count in sorted(lost.items()))
