"""Real nodes as processes, in a ROS domain of their own; nothing is waited for by sleeping and hoping.

Every wait has a condition and a deadline. The deadlines are generous (a busy machine must not fail a test): they end a
test that has gone wrong, they are never part of what is measured.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String, UInt8MultiArray

from gbas_msgs_py import ros, tables, topics
from gbas_msgs_py.qos import DATA, qos_of
from gbas_node.transport import use_profile
from started_nodes import LoggedNode

START_S = 60.0
ANSWER_S = 3.0
END_S = 30.0


class Launcher:
    """Starts nodes in the test's domain and ends what is left of them."""

    def __init__(self, folder: Path) -> None:
        self._environment = dict(os.environ)  # in which the fixture `domain` names it, and keeps it to this machine
        self._folder = folder
        self.processes: list[LoggedNode] = []

    def start(
        self, module: str, parameters: dict[str, Any] | None = None, ros_args: tuple[str, ...] = ()
    ) -> LoggedNode:
        """Start ``python -m module`` with a parameter file that holds for whatever node it makes."""
        number = len(self.processes)
        arguments = ["--ros-args", *ros_args]
        if parameters is not None:
            file = self._folder / f"{number}.yaml"
            file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
            arguments += ["--params-file", str(file)]
        process = LoggedNode(module, arguments, self._environment, self._folder / f"{number}_{module}.log")
        self.processes.append(process)
        return process

    def logs(self) -> str:
        return "\n".join(f"--- {p.module} (running: {p.running})\n{p.output}" for p in self.processes)

    def end_all(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def launcher(domain: int, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Launcher]:
    launcher = Launcher(tmp_path)
    yield launcher
    launcher.end_all()
    print(launcher.logs())  # pytest shows it when the test has failed


class Probe:
    """A node inside the test: publishes, listens, and waits for conditions."""

    def __init__(self, domain: int) -> None:
        use_profile(os.environ)
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("probe", namespace=topics.DEFAULT_NAMESPACE, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Any] = {}

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def until(self, condition: Callable[[], object], what: str, timeout_s: float = START_S) -> None:
        """Receive messages until the condition holds."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > deadline:
                pytest.fail(f"not within {timeout_s} s: {what}")
            self._executor.spin_once(timeout_sec=0.02)

    def ask(self, service_type: type, service: str, request: Any) -> Any:
        """The answer of a service; asked again when it gets lost, as happens while the two ends are still meeting."""
        client = self.node.create_client(service_type, service)
        self.until(client.service_is_ready, f"the service {service}")
        asked = [client.call_async(request)]

        def answered() -> bool:
            if time.monotonic() - began > ANSWER_S * len(asked):
                asked.append(client.call_async(request))
            return any(each.done() for each in asked)

        began = time.monotonic()
        self.until(answered, f"an answer of {service}")
        return next(each.result() for each in asked if each.done())

    def listen(self, topic: str, message_type: type = Float64MultiArray, decode: Any = None) -> list[Any]:
        """List that fills with what arrives on a topic."""
        heard: list[Any] = []
        convert = decode or (ros.table_from_msg if message_type is Float64MultiArray else lambda message: message)
        profile = ros.qos_profile(qos_of(topic))
        self.node.create_subscription(message_type, topic, lambda message: heard.append(convert(message)), profile)
        return heard

    def report_progress(self, topic: str) -> None:
        """Be a reader a driver waits for, under the name ``probe``: report each table that arrives on a topic."""
        publisher = self.node.create_publisher(Float64MultiArray, topics.progress("probe"), ros.qos_profile(DATA))

        def report(message: Float64MultiArray) -> None:
            done = ros.table_from_msg(message)
            record = tables.ProgressEpoch(gps_week=done.gps_week, tow_s=done.tow_s)
            publisher.publish(ros.table_to_msg(tables.PROGRESS, record))

        self.node.create_subscription(Float64MultiArray, topic, report, ros.qos_profile(DATA))

    def events(self) -> list[Any]:
        return self.listen(topics.EVENTS, String, ros.event_from_msg)

    def bursts(self) -> list[Any]:
        return self.listen(topics.VDB, UInt8MultiArray, ros.burst_from_msg)

    def diagnostics(self) -> dict[str, Any]:
        """Dictionary that holds the latest status by name: level, message and values."""
        latest: dict[str, Any] = {}

        def keep(message: DiagnosticArray) -> None:
            for status in message.status:
                latest[status.name] = (status.level, status.message, {v.key: v.value for v in status.values})

        self.node.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, keep, ros.qos_profile(qos_of("/diagnostics"))
        )
        return latest

    def publisher(self, topic: str, message_type: type = Float64MultiArray, *, readers: int = 1) -> Any:
        """Publisher that has its readers."""
        if topic not in self._publishers:
            profile = ros.qos_profile(qos_of(topic))
            self._publishers[topic] = self.node.create_publisher(message_type, topic, profile)
        publisher = self._publishers[topic]
        self.until(lambda: publisher.get_subscription_count() >= readers, f"{readers} readers of {topic}")
        return publisher

    def send(self, topic: str, schema: Any, record: Any) -> None:
        self.publisher(topic).publish(ros.table_to_msg(schema, record))


@pytest.fixture
def probe(domain: int) -> Iterator[Probe]:
    probe = Probe(domain)
    yield probe
    probe.close()
