"""Bags made without ROS, for tests of everything that reads them, and domains for tests that do use it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from gbas_bags.definitions import qos_record
from gbas_bags.mcap_log import BagWriter, Topic
from gbas_bringup.environment import held_domain
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import Record
from gbas_core.satellites import SAT_INDEX
from gbas_msgs_py import tables, topics
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import IntegrityEpoch, ProtectionEpoch, SolutionEpoch
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.messages.block import encode_block
from gbas_vdb.messages.types import Type1

STORE = get_typestore(Stores.ROS2_JAZZY)
TABLE = "std_msgs/msg/Float64MultiArray"
BURST = "std_msgs/msg/UInt8MultiArray"
STRING = "std_msgs/msg/String"
WEEK, FIRST_TOW_S = 2400, 345600.0
GPS_START_UNIX_S = 315964800  # 1980-01-06, as a Unix time


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain in which nothing else runs; nodes of the test itself keep to this machine as well."""
    with isolated_domain() as number:
        yield number


@contextmanager
def isolated_domain() -> Iterator[int]:
    """What :func:`domain` does, for fixtures that outlive a test."""
    with held_domain() as number, pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        environment.setenv("ROS_DOMAIN_ID", str(number))
        yield number


def wait_until(condition: Callable[[], object], what: str, timeout_s: float = 60.0) -> None:
    """Wait for a condition; the time-out only ends a test that has gone wrong."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"not within {timeout_s} s: {what}")
        time.sleep(0.01)


@pytest.fixture(scope="session", name="wait_until")
def _wait_until() -> Callable[..., None]:
    return wait_until


# --- messages as bytes


def _layout(dims: list[tuple[str, int, int]]) -> Any:
    kinds = STORE.types
    made = [kinds["std_msgs/msg/MultiArrayDimension"](label=label, size=size, stride=s) for label, size, s in dims]
    return kinds["std_msgs/msg/MultiArrayLayout"](dim=made, data_offset=0)


def table_bytes(record: Record, label: str | None = None) -> bytes:
    """A record as its message; `label` replaces the right one."""
    schema = next(each for each in tables.SCHEMAS.values() if each.record_type is type(record))
    table = schema.encode(record)
    rows, columns = table.shape
    layout = _layout([("rows", rows, rows * columns), (label or schema.label_of(table), columns, columns)])
    return bytes(STORE.serialize_cdr(STORE.types[TABLE](layout=layout, data=table.ravel()), TABLE))


def burst_bytes(key: int, payload: bytes, *, slot: int = 0, bursts_in_frame: int = 1) -> bytes:
    """A VDB burst as its message."""
    week, tow_s = from_epoch_key(key)
    numbers = {"gps_week": week, "tow_ms": round(tow_s * 1000), "slot": slot}
    numbers |= {"bursts_in_frame": bursts_in_frame, "bytes": len(payload)}
    layout = _layout([("gbas/vdb_burst/1", 0, 0), *((name, value, 0) for name, value in numbers.items())])
    data = np.frombuffer(payload, dtype=np.uint8)
    return bytes(STORE.serialize_cdr(STORE.types[BURST](layout=layout, data=data), BURST))


def string_bytes(text: str) -> bytes:
    """A text as its message."""
    return bytes(STORE.serialize_cdr(STORE.types[STRING](data=text), STRING))


def burst_payload(key: int) -> bytes:
    """A burst with a type 1 message that corrects no satellite."""
    z_count_s = from_epoch_key(key)[1] % 1200.0
    block = encode_block(Type1(modified_z_count_s=z_count_s), "TEST")
    return block + encode_fec(block)


# --- a bag


@dataclass
class FakeBag:
    """A recording of a short run in which the service begins at `served_from` and ends at `lost_at`.

    Change the messages of a topic in `content` before writing: (epoch key, bytes) pairs.
    """

    epochs: int = 40
    served_from: int = 10
    lost_at: int = 30
    receivers: int = 2
    simulated: float = 1.0
    content: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.keys = [epoch_key(WEEK, FIRST_TOW_S) + 500 * number for number in range(self.epochs)]
        names = [topics.resolve(name) for name in topics.GROUND_OBSERVATIONS[: self.receivers]]
        for name in (*names, topics.resolve(topics.AIRBORNE_OBSERVATIONS)):
            self.add(name, TABLE, [(key, table_bytes(self.observations(key))) for key in self.keys])
        self._tables(topics.GROUND_INTEGRITY, lambda number, epoch: IntegrityEpoch(**epoch, n_receivers=2.0))
        self.add(topics.VDB, BURST, [(key, burst_bytes(key, burst_payload(key))) for key in self.keys])
        self._tables(topics.AIRBORNE_SOLUTION, lambda number, epoch: SolutionEpoch(**epoch, x_m=3.84e6 + number))
        self._tables(topics.AIRBORNE_PROTECTION, self.protection)
        self.add(topics.EVENTS, STRING, [(event.epoch, string_bytes(event.to_json())) for event in self.events()])

    def add(self, topic: str, msgtype: str, messages: list[tuple[int, bytes]]) -> None:
        self.types[topic] = msgtype
        self.content[topic] = messages

    def _tables(self, name: str, make: Callable[[int, Mapping[str, Any]], Record]) -> None:
        epochs = [dict(zip(("gps_week", "tow_s"), from_epoch_key(key), strict=True)) for key in self.keys]
        messages = [
            (key, table_bytes(make(number, epoch)))
            for number, (key, epoch) in enumerate(zip(self.keys, epochs, strict=True))
        ]
        self.add(topics.resolve(name), TABLE, messages)

    def observations(self, key: int) -> ObservationEpoch:
        week, tow_s = from_epoch_key(key)
        record = ObservationEpoch(gps_week=week, tow_s=tow_s, simulated=self.simulated)
        record.code_m[0, SAT_INDEX["G05"]] = 2.2e7
        return record

    def protection(self, number: int, epoch: Mapping[str, Any]) -> ProtectionEpoch:
        served = self.served_from <= number < self.lost_at
        return ProtectionEpoch(**epoch, alert=0.0 if served else 1.0, service=1.0 if served else 0.0, vpl_m=3.0)

    def events(self) -> list[Event]:
        marks = ((0, "no_signal", np.nan, np.nan), (self.served_from, "cleared", 0.0, np.nan))
        marks += ((self.lost_at, "vpl_above_val", 11.0, 10.0),)
        return [
            Event(
                **dict(zip(("gps_week", "tow_s"), from_epoch_key(self.keys[number]), strict=True)),
                kind=EventKind.ALERT,
                subject="navigation",
                cause=cause,
                value=value,
                threshold=threshold,
                source="protection_level",
            )
            for number, cause, value, threshold in marks
        ]

    def write(
        self,
        folder: Path,
        *,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        close: bool = True,
        **options: Any,
    ) -> BagWriter:
        """Write the bag in the order of its epochs."""
        writer = BagWriter(folder, metadata=metadata or {}, flush_period_s=None, **options)
        merged = sorted(
            ((key, place, number, topic, data) for place, (topic, messages) in enumerate(self.content.items())
             for number, (key, data) in enumerate(messages)),
            key=lambda item: (item[0], item[1], item[2]),
        )  # fmt: skip
        for key, _, _, topic, data in merged:
            writer.log.add_topic(Topic(name=topic, msgtype=self.types[topic], qos=(qos_record(depth=256),)))
            time_ns = (GPS_START_UNIX_S * 1000 + key) * 1_000_000
            writer.log.write(topic, data, time_ns, time_ns)
        if close:
            writer.close()
        return writer


@pytest.fixture(scope="session", name="fake_bag")
def _fake_bag() -> Callable[..., FakeBag]:
    return FakeBag
