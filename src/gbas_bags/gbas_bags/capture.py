"""Taking messages off many topics as the bytes they came in, with what the middleware knows of each.

One wait serves all topics, and every topic is emptied after it: at high rates a message costs a fraction of what an
executor's callback does. Within a batch messages are put in the order in which they were published, so that cause comes
before effect also across topics.
"""

from __future__ import annotations

import contextlib
import importlib
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile

_WAIT_NS: Final = 100_000_000
_GATHER_S: Final = 0.010
"""Pause after a batch: the next one is then larger, and cheaper a message."""


class Taken(NamedTuple):
    """A message as it came."""

    topic: str
    data: bytes
    published_ns: int
    received_ns: int
    number: int | None


def message_class(msgtype: str) -> type:
    """The Python class of a ROS interface name such as ``std_msgs/msg/String``.

    Raises
    ------
    LookupError
        When it is not installed.
    """
    package, _, rest = msgtype.partition("/")
    name = rest.rpartition("/")[2]
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise LookupError(f"message type {msgtype} is not installed") from None


class Capture:
    """Reads topics in a thread of its own.

    Parameters
    ----------
    node : rclpy Node
        Owner of the subscriptions; must not be in an executor.
    on_batch : callable
        Gets each batch, in the thread of the capture.
    on_idle : callable
        Called about ten times a second, in the same thread: looks for new topics.
    """

    def __init__(
        self, node: Node, on_batch: Callable[[Sequence[Taken]], None], on_idle: Callable[[], None] = lambda: None
    ) -> None:
        self._node = node
        self._on_batch = on_batch
        self._on_idle = on_idle
        self._subscriptions: dict[str, Any] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="capture", daemon=True)
        self.failure: Exception | None = None

    @property
    def topics(self) -> frozenset[str]:
        """Topics that are read."""
        return frozenset(self._subscriptions)

    def subscribe(self, topic: str, msgtype: str, qos: QoSProfile) -> None:
        """Read another topic; raises LookupError for a message type that is not installed."""
        kind = message_class(msgtype)
        self._subscriptions[topic] = self._node.create_subscription(kind, topic, lambda _: None, qos, raw=True)

    def start(self) -> None:
        """Begin reading."""
        self._thread.start()

    def stop(self, quiet_s: float, limit_s: float) -> None:
        """Take what is still on its way: until nothing came for `quiet_s`, but no longer than `limit_s`; then end."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()
        now = time.monotonic()
        last_s, end_s = now, now + limit_s
        try:
            while self.failure is None and time.monotonic() < min(last_s + quiet_s, end_s):
                if self._take_all():
                    last_s = time.monotonic()
                else:
                    time.sleep(_GATHER_S)
        except Exception as error:
            self.failure = error

    def _run(self) -> None:
        try:
            idle_due_s = 0.0
            while not self._stop.is_set():
                if time.monotonic() >= idle_due_s:
                    self._on_idle()
                    idle_due_s = time.monotonic() + 0.1
                if self._subscriptions:
                    self._wait()
                    if self._take_all():
                        time.sleep(_GATHER_S)
                else:
                    self._stop.wait(0.05)
        except Exception as error:
            self.failure = error

    def _wait(self) -> None:
        subscriptions = list(self._subscriptions.values())
        with contextlib.ExitStack() as held:
            for subscription in subscriptions:
                held.enter_context(subscription.handle)
            context: Any = self._node.context.handle
            held.enter_context(context)
            waiting = _rclpy.WaitSet(len(subscriptions), 0, 0, 0, 0, 0, context)
            with waiting:
                waiting.clear_entities()
                for subscription in subscriptions:
                    waiting.add_subscription(subscription.handle)
                waiting.wait(_WAIT_NS)

    def _take_all(self) -> int:
        batch: list[Taken] = []
        for topic, subscription in self._subscriptions.items():
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                    data, about = taken
                    received = about["received_timestamp"]
                    batch.append(
                        Taken(
                            topic,
                            data,
                            about["source_timestamp"] or received,
                            received,
                            about["publication_sequence_number"],
                        )
                    )
        if batch:
            batch.sort(key=lambda message: message.published_ns)
            self._on_batch(batch)
        return len(batch)
