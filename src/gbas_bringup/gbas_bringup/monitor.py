"""What the running nodes say of themselves, for the person who started them."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from gbas_core.errors import GbasError
from gbas_msgs_py import topics


@dataclass(frozen=True)
class Status:
    """The last status of a node."""

    level: int
    message: str
    values: Mapping[str, str] = field(default_factory=dict)

    @property
    def epochs(self) -> int:
        """Epochs the node has finished with."""
        text = self.values.get("epochs", "0")
        return int(text) if text.isdigit() else 0


class Monitor:
    """Listens to ``/diagnostics`` in a thread of its own.

    Parameters
    ----------
    environment : mapping
        That of the nodes: its domain and discovery settings are used.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        for name in ("AMENT_PREFIX_PATH", "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
            if name in environment:
                os.environ[name] = environment[name]
        self._statuses: dict[str, Status] = {}
        self._stop = threading.Event()
        self._context = Context()
        try:
            rclpy.init(args=[], context=self._context, domain_id=int(environment.get("ROS_DOMAIN_ID", "0") or 0))
        except ValueError as error:
            raise GbasError(f"ROS_DOMAIN_ID is {environment.get('ROS_DOMAIN_ID')!r}, expected a number") from error
        self._node = Node(
            f"launcher_{os.getpid()}",
            namespace=topics.DEFAULT_NAMESPACE,
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, 100)
        self._thread = threading.Thread(target=self._spin, name="monitor", daemon=True)
        self._thread.start()

    @property
    def statuses(self) -> Mapping[str, Status]:
        """Last status by node name."""
        return dict(self._statuses)

    def close(self) -> None:
        """Stop listening."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context) if hasattr(rclpy, "try_shutdown") else self._context.try_shutdown()

    def __enter__(self) -> Monitor:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        try:
            while not self._stop.is_set():
                executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return
        finally:
            executor.shutdown(timeout_sec=0.5)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            level = int.from_bytes(status.level, "little") if isinstance(status.level, bytes) else int(status.level)
            values = {pair.key: pair.value for pair in status.values}
            self._statuses[status.name] = Status(level, status.message, values)


LEVELS = {
    int.from_bytes(DiagnosticStatus.OK, "little"): "ok",
    int.from_bytes(DiagnosticStatus.WARN, "little"): "warning",
    int.from_bytes(DiagnosticStatus.ERROR, "little"): "error",
    int.from_bytes(DiagnosticStatus.STALE, "little"): "waiting",
}
