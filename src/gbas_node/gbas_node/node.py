"""Base of all nodes: parameters, publishers and subscriptions of the contract, diagnostics, start and end.

A node decodes, calls one step, encodes; everything that every node does is here:

- Parameters are those of the class in ``params_type`` (:mod:`gbas_core.parameters`). Unknown names, wrong types and
  values out of bounds end the program with one line and exit code 2.
- A message that cannot be decoded is dropped, counted and reported in ``/diagnostics``; the node goes on.
- The first epoch is held back until every output has its readers, so a chain of processes loses nothing at its start
  (:mod:`gbas_node.start_gate`).
- SIGINT and SIGTERM let the node publish what is pending; the exit code is then 0 (:mod:`gbas_node.serving`).

Programs that run nodes must be started as console scripts or with ``python -m``: the ROS wheels re-execute Python once.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, ClassVar, Final, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, Float64MultiArray, String, UInt8, UInt8MultiArray

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.parameters import declared, file_key, from_mapping, unknown_parameters
from gbas_core.record import Record
from gbas_msgs_py import cdr, ros, topics
from gbas_msgs_py.cdr import TableCodec
from gbas_msgs_py.events import Event
from gbas_msgs_py.joining import ReceptionQueue
from gbas_msgs_py.qos import qos_of
from gbas_msgs_py.schema import SchemaError, TableSchema
from gbas_msgs_py.tables import EPHEMERIS, PROGRESS, ProgressEpoch
from gbas_node.descriptors import descriptor_of
from gbas_node.inputs import EphemerisInput, InputWatch
from gbas_node.params import NodeParams
from gbas_node.publishers import TablePublisher, when_heard
from gbas_node.start_gate import StartGate
from gbas_vdb.transmission.burst import Burst

R = TypeVar("R", bound=Record)

EXIT_OK: Final = 0
EXIT_FAILED: Final = 3
STATUS_OK: Final = DiagnosticStatus.OK
STATUS_WARN: Final = DiagnosticStatus.WARN
STATUS_ERROR: Final = DiagnosticStatus.ERROR
STATUS_STALE: Final = DiagnosticStatus.STALE
REPORT_PERIOD_S: Final = 1.0
PROBLEM_REPORT_S: Final = 0.1
"""A problem is reported this soon, not only with the next regular report."""
_PROGRESS: Final = TableCodec(PROGRESS)
POLL_S: Final = 0.1
_GATE_POLL_S: Final = 0.01
_LAST_ACK_S: Final = 2.0
SECTIONS: Final = ("ground", "airborne", "sim", "qos_overrides")
"""First words of dotted parameters that belong to a part of the suite; one file may hold them for all nodes."""


class GbasNode(Node):
    """A node of the suite.

    Parameters
    ----------
    name : str
        Default node name.
    **kwargs
        Passed to :class:`rclpy.node.Node`; the namespace is ``/gbas`` unless given.

    Attributes
    ----------
    params_type : type
        Class of the node's own parameters.
    """

    params_type: ClassVar[type[Any]] = NodeParams

    def __init__(self, name: str, **kwargs: Any) -> None:
        kwargs.setdefault("namespace", topics.DEFAULT_NAMESPACE)
        super().__init__(name, **kwargs)
        self.params: Any = self._own_params()
        self.inputs = InputWatch()
        self.exit_code: int | None = None
        self.processed = 0
        self.last_epoch: tuple[int, float] | None = None
        self.problems: Counter[str] = Counter()
        self.last_problem = ""
        self._reported_problems = 0
        self._report_due_s = 0.0
        self.gate = StartGate(self.params.start_wait_s)
        self._events = self._gated_publisher(String, topics.EVENTS, 0)
        self._diagnostics = self._publisher(DiagnosticArray, topics.DIAGNOSTICS)
        self._progress = self._publisher(Float64MultiArray, topics.progress(self.get_name()))

    # --- parameters

    def overrides(self, prefix: str = "") -> dict[str, Any]:
        """Parameter values given from outside whose names start with `prefix`, by the rest of their names."""
        given = self._parameter_overrides.items()
        return {name[len(prefix) :]: _plain(each.value) for name, each in given if name.startswith(prefix)}

    def _own_params(self) -> NodeParams:
        known = {file_key(name) for name in self.params_type.__dataclass_fields__}
        given = {name: value for name, value in self.overrides().items() if name in known}
        params: NodeParams = from_mapping(self.params_type, given)
        self.show_parameters(params)
        return params

    def show_parameters(self, params: Any, prefix: str = "") -> None:
        """Show a set of parameters to ROS, read-only: values given from outside have been taken already."""
        for each in declared(params, prefix):
            if each.value is None:  # left out
                continue
            self.declare_read_only(each.key, each.value, descriptor_of(each))

    def declare_read_only(self, name: str, value: Any, about: str | ParameterDescriptor) -> None:
        """Show one parameter; `about` is its descriptor, or what it means."""
        if isinstance(about, str):
            about = ParameterDescriptor(description=about, read_only=True, dynamic_typing=True)
        if isinstance(value, tuple):
            value = list(value) or [""]
        self.declare_parameter(name, value, about, ignore_override=True)

    def check_overrides(self) -> None:
        """Refuse parameters that nothing in this node has declared; the end of the start."""
        given = [name for name in self.overrides() if name.partition(".")[0] not in SECTIONS]
        unknown_parameters(given, [*self._parameters, "use_sim_time"])
        qos = [name for name in self.overrides() if name.startswith("qos_overrides.")]
        unknown_parameters(qos, self._parameters)

    # --- outputs

    def table_publisher(self, topic: str, schema: TableSchema[R], *, readers: int = 0) -> TablePublisher[R]:
        """Publisher of records; the first epoch waits until it has `readers` readers beside the recorders."""
        return TablePublisher(self._gated_publisher(Float64MultiArray, topic, readers), schema)

    def burst_publisher(self, topic: str, *, readers: int = 0) -> Callable[[Burst], None]:
        """Function that sends a burst."""
        publisher = self._gated_publisher(UInt8MultiArray, topic, readers)
        return lambda burst: publisher.publish(cdr.encode_burst(burst))

    def message_publisher(self, message_type: type, topic: str) -> Publisher:
        """Publisher of a standard message."""
        return self._gated_publisher(message_type, topic, 0)

    def float_publisher(self, topic: str) -> Callable[[float], None]:
        """Function that sends a number; nothing is made when nobody listens."""
        return when_heard(self._gated_publisher(Float64, topic, 0), cdr.encode_float)

    def uint8_publisher(self, topic: str) -> Callable[[int], None]:
        """Function that sends a small integer; nothing is made when nobody listens."""
        return when_heard(self._gated_publisher(UInt8, topic, 0), cdr.encode_uint8)

    def clock_publisher(self) -> Callable[[int, float], None]:
        """Function that sets ``/clock`` to an epoch; for whoever drives time."""
        return when_heard(self._publisher(Clock, topics.CLOCK), cdr.encode_clock)

    def publish_schemas(self) -> None:
        """Put the schema dictionary on its topic, where late readers find it."""
        self._publisher(String, topics.SCHEMAS).publish(ros.schemas_msg())

    def publish_events(self, events: Iterable[Event]) -> None:
        """Send events, in order."""
        for event in events:
            self._events.publish(ros.event_to_msg(event))

    def finished_epoch(self, gps_week: int, tow_s: float) -> None:
        """Note that an epoch is done, and say so to whoever drives the data."""
        self.processed += 1
        self.last_epoch = (gps_week, tow_s)
        self._publish_progress()

    def _publish_progress(self) -> None:
        if self.last_epoch is not None and self._progress.get_subscription_count():
            record = ProgressEpoch(gps_week=self.last_epoch[0], tow_s=self.last_epoch[1])
            self._progress.publish(_PROGRESS.encode(record))

    def _publisher(self, message_type: type, topic: str) -> Publisher:
        options = QoSOverridingOptions.with_default_policies()
        profile = ros.qos_profile(qos_of(topic))
        return self.create_publisher(message_type, topic, profile, qos_overriding_options=options)

    def _gated_publisher(self, message_type: type, topic: str, readers: int) -> Publisher:
        publisher = self._publisher(message_type, topic)
        self.gate.add(publisher, readers + self.params.recorders)
        return publisher

    # --- inputs

    def table_subscription(
        self, topic: str, schema: TableSchema[R], callback: Callable[[R], None], *, quiet: bool = False
    ) -> Subscription:
        """Call back with each record; with `quiet` they do not count as input whose absence is reported."""
        decode = partial(ros.table_from_bytes, codec=TableCodec(schema))
        return self._subscription(Float64MultiArray, topic, decode, callback, quiet)

    def ephemeris_input(self) -> EphemerisInput:
        """The broadcast ephemerides; each is taken at the epoch of its reception."""
        queue: ReceptionQueue[Ephemeris] = ReceptionQueue()

        def keep(ephemeris: Ephemeris) -> None:
            queue.add(epoch_key(ephemeris.gps_week, ephemeris.tow_s), ephemeris)

        return EphemerisInput(queue, self.table_subscription(topics.EPHEMERIS, EPHEMERIS, keep, quiet=True))

    def progress_subscription(self, reader: str, callback: Callable[[ProgressEpoch], None]) -> None:
        """Call back when a reader, named by its node or its topic, has finished with an epoch."""
        self.table_subscription(topics.progress(reader), PROGRESS, callback)

    def has_progress_publisher(self, reader: str) -> bool:
        """Whether a reader that says which epochs it has finished with is there."""
        return self.count_publishers(self.resolve_topic_name(topics.progress(reader))) > 0

    def burst_subscription(self, topic: str, callback: Callable[[Burst], None]) -> None:
        """Call back with each burst."""
        self._subscription(UInt8MultiArray, topic, ros.burst_from_bytes, callback, quiet=False)

    def _subscription(
        self,
        message_type: type,
        topic: str,
        decode: Callable[[bytes], Any],
        callback: Callable[[Any], None],
        quiet: bool,
    ) -> Subscription:
        def receive(data: bytes) -> None:
            self.inputs.activity += 1
            try:
                item = decode(data)
            except SchemaError as error:
                self.problem(f"bad message on {topic}", str(error))
                return
            if not quiet:
                self.inputs.heard()
            callback(item)

        options = QoSOverridingOptions.with_default_policies()
        profile = ros.qos_profile(qos_of(topic))
        return self.create_subscription(message_type, topic, receive, profile, qos_overriding_options=options, raw=True)

    def problem(self, kind: str, detail: str = "") -> None:
        """Count something that went wrong without ending the node; diagnostics and the log show it."""
        self.problems[kind] += 1
        self._report_due_s = min(self._report_due_s, time.monotonic() + PROBLEM_REPORT_S)
        self.last_problem = f"{kind}: {detail}" if detail else kind
        self.get_logger().warning(self.last_problem, throttle_duration_sec=1.0)

    def note_counts(self, kind: str, total: int) -> None:
        """Report as problems what has been counted elsewhere."""
        while self.problems[kind] < total:
            self.problem(kind)

    def now_s(self) -> float:
        """Monotonic wall time, for deadlines only [s]."""
        return time.monotonic()

    def silent_s(self, now_s: float) -> float:
        """Time since the last input [s]."""
        return self.inputs.silent_s(now_s)

    def enforce(self, joiner: Any, now_s: float, steps: Callable[[Any], None]) -> float:
        """Let a joiner give up on what is overdue; returns seconds until the next deadline."""
        wait_s = self.inputs.wait_s(joiner, now_s, self.params.start_wait_s)
        if wait_s == 0.0:
            steps(joiner.expire(now_s))
        return wait_s

    # --- start gate

    def when_ready(self, work: Callable[[], None]) -> None:
        """Do the work now, or as soon as the outputs have their readers; work keeps its order."""
        self.gate.when_ready(work)

    def _poll_gate(self) -> None:
        if not self.gate.waiting:
            return
        lacking = self.gate.missing_readers()
        if lacking and self.gate.starting:
            return
        if lacking:
            self.problem("started without readers", "; ".join(lacking))
        self.gate.open()

    # --- life

    def poll(self, idle: bool) -> float:
        """Work that is due by wall time; returns seconds until there may be more.

        `idle` is True when no message was waiting: only then may a deadline for missing data be enforced.
        """
        now = time.monotonic()
        self._poll_gate()
        if now >= self._report_due_s:
            self._report_due_s = now + REPORT_PERIOD_S
            self._report(now)
            self._publish_progress()  # a reader that was discovered late would wait for it for ever
        wait = self.due(now) if idle else POLL_S
        return min(wait, _GATE_POLL_S if self.gate.waiting else POLL_S)

    def due(self, now_s: float) -> float:
        """Enforce deadlines (overridden by nodes that have any); returns seconds until the next."""
        return POLL_S

    def finish(self) -> None:
        """Publish what is pending; called once, when the node ends in an orderly way."""

    def end(self, exit_code: int = EXIT_OK) -> None:
        """End the program after the current callback."""
        self.exit_code = exit_code

    def log(self, text: str) -> None:
        """Say something once."""
        self.get_logger().info(text)

    def fail(self, reason: str) -> None:
        """End the program because it cannot do its work."""
        self.get_logger().fatal(reason)
        self.end(EXIT_FAILED)

    def close(self, *, orderly: bool) -> None:
        """Finish and release the node."""
        if orderly:
            self.gate.open()
            self.finish()
            self._report(time.monotonic(), final=True)
            deadline_s = time.monotonic() + _LAST_ACK_S  # for all together: a reader that was killed never answers
            for publisher in [*self.publishers]:
                publisher.wait_for_all_acked(Duration(seconds=max(0.0, deadline_s - time.monotonic())))
        self.destroy_node()

    # --- diagnostics

    def details(self) -> dict[str, Any]:
        """More values for the node's diagnostics (overridden)."""
        return {}

    def statuses(self) -> list[DiagnosticStatus]:
        """More statuses, one a monitor (overridden)."""
        return []

    def _report(self, now_s: float, *, final: bool = False) -> None:
        level, message = self.health(now_s)
        values: dict[str, Any] = {
            "epochs": self.processed,
            "last_epoch": "none" if self.last_epoch is None else f"{self.last_epoch[0]} {self.last_epoch[1]:.3f}",
            "problems": self.problems.total(),
            "last_problem": self.last_problem,
            **{f"count of {kind}": count for kind, count in sorted(self.problems.items())},
            **self.details(),
        }
        if final:
            message = "ended"
        array = DiagnosticArray(status=[ros.diagnostic(self.get_name(), level, message, values), *self.statuses()])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def health(self, now_s: float) -> tuple[bytes, str]:
        """Level and text of the node's own status."""
        fresh = self.problems.total() - self._reported_problems
        self._reported_problems = self.problems.total()
        silent_s = self.silent_s(now_s)
        if self.last_epoch is None and not fresh:
            waiting = "; ".join(self.gate.missing_readers()) if self.gate.backlog else "no data yet"
            return STATUS_STALE, f"waiting: {waiting}"
        if silent_s > self.params.silence_s:
            return STATUS_ERROR, f"no input for {silent_s:.0f} s"
        if fresh:
            return STATUS_WARN, f"{fresh} problems since the last report; the last: {self.last_problem}"
        return STATUS_OK, "running"


def _plain(value: Any) -> Any:
    """A ROS parameter's value; an empty list has no type in ROS, and comes as none."""
    return list(value) if hasattr(value, "typecode") else [] if value is None else value
