"""The recorder as a process: killed, interrupted, flooded, refused; what is in the bag afterwards."""

from __future__ import annotations

import os
import random
import resource
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64, Float64MultiArray, String

from gbas_bags.bags import BagReader
from gbas_bags.check import check
from gbas_bags.info import info
from gbas_bags.recovery import recover
from gbas_bringup.environment import process_environment
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import SAT_INDEX
from gbas_msgs_py import ros, tables, topics
from gbas_msgs_py.qos import qos_of
from gbas_node.pacing import Pacer
from gbas_node.transport import use_profile
from started_nodes import LoggedNode

pytestmark = pytest.mark.ros

RR = [topics.resolve(name) for name in topics.GROUND_OBSERVATIONS]
PROGRESS = topics.resolve(topics.progress("recorder"))
FIRST = epoch_key(2400, 345600.0)
ALLOWED_LOSS_S = 1.0  # what DESIGN promises


class Source:
    """A node in the test that publishes, and remembers what and when."""

    def __init__(self, domain: int) -> None:
        use_profile(os.environ)
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("source", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.sent: list[tuple[str, int, float]] = []
        self._publishers: dict[str, Any] = {}

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def publisher(self, topic: str, kind: type = Float64MultiArray) -> Any:
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(kind, topic, ros.qos_profile(qos_of(topic)))
        return self._publishers[topic]

    def observe(self, topic: str, key: int) -> None:
        week, tow_s = from_epoch_key(key)
        record = ObservationEpoch(gps_week=week, tow_s=tow_s, simulated=1.0)
        record.code_m[0, SAT_INDEX["G05"] : SAT_INDEX["G05"] + 12] = 2.2e7
        message = ros.table_to_msg(tables.OBSERVATIONS, record)
        self.sent.append((topic, key, time.time()))
        self.publisher(topic).publish(message)

    def until_read(self, wait_until: Callable[..., None], names: list[str]) -> None:
        for name in names:
            publisher = self.publisher(name)
            wait_until(lambda publisher=publisher: publisher.get_subscription_count() > 0, f"a reader of {name}")


@pytest.fixture
def source(domain: int) -> Iterator[Source]:
    source = Source(domain)
    yield source
    source.close()


class RecorderProcess(LoggedNode):
    """A recorder."""

    def __init__(self, domain: int, out: Path, log: Path, *parameters: str) -> None:
        self.out = out
        arguments = [part for each in (f"out:={out}", *parameters) for part in ("-p", each)]
        environment = process_environment(domain=domain, isolated=True)
        super().__init__("gbas_bags.recorder", ["--ros-args", *arguments], environment, log)


@pytest.fixture
def recorder(domain: int, tmp_path: Path) -> Iterator[Callable[..., RecorderProcess]]:
    started: list[RecorderProcess] = []

    def start(*parameters: str, out: Path | None = None) -> RecorderProcess:
        log = tmp_path / f"recorder_{len(started)}.log"
        started.append(RecorderProcess(domain, out or tmp_path / "bag", log, *parameters))
        return started[-1]

    yield start
    for each in started:
        each.kill()
        each.wait()


def keys_in(bag: Path, **options: Any) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for message in BagReader(bag, **options).messages():
        if message.channel.topic in RR:
            record = ros.table_from_msg(deserialize_message(message.data, Float64MultiArray), tables.OBSERVATIONS)
            found.setdefault(message.channel.topic, []).append(epoch_key(record.gps_week, record.tow_s))
    return found


@pytest.mark.parametrize("seconds", [0.6, 1.7, 2.9])
def test_kill_loses_at_most_the_last_second(
    source: Source, recorder: Any, wait_until: Any, seconds: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Messages come all the time; the recorder is killed at a moment that has nothing to do with its flushing."""
    process = recorder()
    source.until_read(wait_until, RR[:2])
    moment = time.time() + seconds + random.Random(seconds).random() * 0.4
    number = 0
    while time.time() < moment:
        for topic in RR[:2]:
            source.observe(topic, FIRST + 10 * number)
        number += 1
        time.sleep(0.005)  # paces the publisher; nothing depends on it
    process.kill()
    killed_s = time.time()
    process.wait()
    result = recover(process.out)
    kept = keys_in(result.target)
    late_s = killed_s - ALLOWED_LOSS_S
    for topic in RR[:2]:
        due = [key for name, key, sent_s in source.sent if name == topic and sent_s <= late_s]
        there = kept.get(topic, [])
        assert there[: len(due)] == due
        assert there == sorted(there)
    total = sum(map(len, kept.values()))
    with capsys.disabled():
        print(f" [{len(source.sent)} sent before the kill, {total} kept, {len(source.sent) - total} lost]", end="")


def test_interrupt_keeps_everything(source: Source, recorder: Any, wait_until: Any, tmp_path: Path) -> None:
    config = tmp_path / "site.yaml"
    config.write_text("/**: {ros__parameters: {}}\n")
    process = recorder(f"config_files:=[{config}]", "command:=gbas run site.yaml")
    source.until_read(wait_until, RR[:2])
    for number in range(200):
        for topic in RR[:2]:
            source.observe(topic, FIRST + 500 * number)
    for topic in RR[:2]:
        assert source.publisher(topic).wait_for_all_acked()
    code, output = process.end(signal.SIGINT)
    assert code == 0, output
    assert keys_in(process.out) == {topic: [FIRST + 500 * number for number in range(200)] for topic in RR[:2]}
    document = info(process.out).as_json()
    assert document["closed"]
    assert document["origin"] == "simulated"
    assert document["command"] == "gbas run site.yaml"
    assert document["configuration"] == ["site.yaml"]
    assert document["lost_in_transport"] == 0
    assert info(process.out).metadata["gbas.configuration"]["site.yaml"] == config.read_text()
    assert info(process.out).metadata["gbas.end"]["data"] == "simulated"
    written = yaml.safe_load((process.out / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert written["custom_data"]["data"] == "simulated"  # where `ros2 bag info` shows it
    assert check(process.out).ok


def test_bag_is_laid_out_along_the_data_time(source: Source, recorder: Any, wait_until: Any) -> None:
    """Also what came before the first epoch; the wall clock of the publisher is the publish time."""
    before_s = time.time()
    process = recorder()
    source.until_read(wait_until, RR[:1])
    names = source.publisher(topics.SCHEMAS, String)
    wait_until(lambda: names.get_subscription_count() > 0, "a reader of the schemas")
    names.publish(ros.schemas_msg())
    assert names.wait_for_all_acked()
    for number in range(3):
        source.observe(RR[0], FIRST + 500 * number)
    assert source.publisher(RR[0]).wait_for_all_acked()
    process.end(signal.SIGINT)
    week, tow_s = from_epoch_key(FIRST)
    first_ns = ros.stamp_of(week, tow_s).sec * 1_000_000_000
    messages = list(BagReader(process.out).messages())
    times = {(m.channel.topic, m.log_time_ns) for m in messages if m.channel.topic in (RR[0], topics.SCHEMAS)}
    assert times == {(topics.SCHEMAS, first_ns), *((RR[0], first_ns + 500_000_000 * number) for number in range(3))}
    assert all(before_s <= message.publish_time_ns / 1e9 <= time.time() for message in messages)


def test_nothing_is_lost_at_full_speed(source: Source, recorder: Any, wait_until: Any) -> None:
    """A driver that waits for the recorder's progress, and otherwise sends as fast as it can."""
    process = recorder()
    source.until_read(wait_until, RR)
    pacer = Pacer(8, ("recorder",))

    def on_progress(message: Float64MultiArray) -> None:
        record = ros.table_from_msg(message, tables.PROGRESS)
        pacer.on_progress("recorder", epoch_key(record.gps_week, record.tow_s))

    source.node.create_subscription(Float64MultiArray, PROGRESS, on_progress, 100)
    deadline_s = time.monotonic() + 120.0
    number = 0
    while number < 1500 or pacer.outstanding:
        assert time.monotonic() < deadline_s, f"{number} epochs sent, waiting for {pacer.lagging}"
        if number < 1500 and pacer.may_send():
            for topic in RR:
                source.observe(topic, FIRST + 500 * number)
            pacer.sent(FIRST + 500 * number, ("recorder",))
            number += 1
        source.executor.spin_once(timeout_sec=0.0 if pacer.may_send() else 0.01)
    code, _ = process.end(signal.SIGINT)
    assert code == 0
    assert keys_in(process.out) == {topic: [FIRST + 500 * number for number in range(1500)] for topic in RR}
    assert info(process.out).as_json()["lost_in_transport"] == 0


def test_other_namespaces_and_named_topics_are_recorded(source: Source, recorder: Any, wait_until: Any) -> None:
    second = "/gbas/second/airborne/vpl"
    process = recorder("topics:=[/weather/pressure, '/weather/wind:std_msgs/msg/Float64']", "exclude:=/ground/")
    for name in (second, "/weather/pressure", "/weather/wind", "/elsewhere"):
        source.publisher(name, Float64)
    for name in (second, "/weather/pressure", "/weather/wind"):
        wait_until(lambda name=name: source.publisher(name).get_subscription_count() > 0, f"a reader of {name}")
    for name in (second, "/weather/pressure", "/weather/wind", "/elsewhere"):
        source.publisher(name).publish(Float64(data=1.5))
        assert source.publisher(name).wait_for_all_acked()
    process.end(signal.SIGINT)
    counts = {topic["topic"]: topic["messages"] for topic in info(process.out).as_json()["topics"]}
    assert {name: counts.get(name) for name in (second, "/weather/pressure", "/weather/wind")} == {
        second: 1,
        "/weather/pressure": 1,
        "/weather/wind": 1,
    }
    assert "/elsewhere" not in counts


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (("chunk_bytes:=1",), "chunk_bytes = 1 is not within 1024 to 16777216 bytes"),
        (("colour:=red",), "parameter 'colour' is unknown"),
        (("config_files:=[/nowhere.yaml]",), "/nowhere.yaml: cannot be read"),
        (("topics:=[weather]",), "topics = 'weather' is not an absolute name"),
        (("exclude:='['",), "a regular expression"),
    ],
)
def test_bad_parameters_end_it_with_one_line(recorder: Any, parameters: tuple[str, ...], words: str) -> None:
    process = recorder(*parameters)
    code, output = process.end()
    assert code == 2
    (line,) = output.splitlines()
    assert words in line


def test_existing_bag_is_not_touched(recorder: Any, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").write_text("mine")
    process = recorder()
    code, output = process.end()
    assert code == 2
    assert "already exists" in output
    assert (tmp_path / "bag" / "bag_0.mcap").read_text() == "mine"


def test_full_disk_ends_it_with_a_word(source: Source, recorder: Any, wait_until: Any) -> None:
    """A limit on the size of files stands for a disk that is full; what was written before can be saved."""
    process = recorder("compression:=none")
    source.until_read(wait_until, RR[:1])
    # Not before: files of the transport are larger. What the bag begins with is 50 kB.
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (200_000, 200_000))
    stop = threading.Event()

    def publish() -> None:
        number = 0
        while not stop.wait(0.005):
            source.observe(RR[0], FIRST + 10 * number)
            number += 1

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        code, output = process.end()
    finally:
        stop.set()
        thread.join()
    assert code == 3, output
    assert f"{process.out}: " in output
    assert "File too large" in output
    assert sum(recover(process.out).kept.values()) > 0
