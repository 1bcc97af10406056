"""Nodes as a program: from their start, through signals, to the exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

import rclpy
import rclpy.utilities
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from gbas_core.compiled import load_ahead
from gbas_node.node import EXIT_OK, POLL_S, GbasNode
from gbas_node.transport import use_profile

Factory = Callable[[], "GbasNode"]
EXIT_BAD_START: Final = 2


def run(factories: Factory | Sequence[Factory], args: Sequence[str] | None = None) -> None:
    """Run one node, or several in one process, until a signal or until one of them ends; then exit.

    Exit codes: 0 in order, 2 for parameters or files that cannot be used, 3 when a node gives up.
    """
    sys.exit(serve([factories] if callable(factories) else list(factories), args))


def serve(factories: Sequence[Factory], args: Sequence[str] | None = None) -> int:
    """As :func:`run`, but returns the exit code."""
    signals = _Signals()
    nodes: list[GbasNode] = []
    use_profile(os.environ)
    try:
        load_ahead()  # before there are subscriptions: once others see them, they are sent data
        rclpy.init(args=None if args is None else list(args), signal_handler_options=SignalHandlerOptions.NO)
        for factory in factories:
            nodes.append(factory())
            nodes[-1].check_overrides()
    except (ValueError, OSError, RuntimeError) as error:
        print(_start_error(error), file=sys.stderr, flush=True)
        _release(nodes, None, orderly=False)
        return EXIT_BAD_START
    executor = light_executor()
    for node in nodes:
        executor.add_node(node)
    orderly = False
    try:
        _spin(executor, nodes, signals)
        orderly = True
    finally:
        _release(nodes, executor, orderly=orderly)
    codes = [node.exit_code for node in nodes if node.exit_code]
    return max(codes, default=EXIT_OK)


def _spin(executor: Any, nodes: Sequence[GbasNode], signals: _Signals) -> None:
    signals.wake = lambda: executor.create_task(lambda: None)
    wait_s, poll_at_s = 0.0, 0.0
    while not signals.stop.is_set() and all(node.exit_code is None for node in nodes):
        before = sum(node.inputs.activity for node in nodes)
        executor.spin_once(timeout_sec=wait_s)
        idle = before == sum(node.inputs.activity for node in nodes)
        now = time.monotonic()
        if idle or now >= poll_at_s:
            poll_at_s = now + POLL_S
            due_s = min(node.poll(idle) for node in nodes)
        wait_s = due_s if idle else 0.0


def _release(nodes: Sequence[GbasNode], executor: Any, *, orderly: bool) -> None:
    for node in nodes:
        if executor is not None:
            executor.remove_node(node)
        node.close(orderly=orderly)
    if executor is not None:
        executor.shutdown()
    rclpy.utilities.try_shutdown()


def light_executor(context: Context | None = None) -> Any:
    """The executor that costs least a message (117 against 235 us); the plain one where it is missing."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def _start_error(error: Exception) -> str:
    program = os.path.basename(sys.argv[0]).removesuffix(".py")
    return f"{program}: {str(error).strip()}"


class _Signals:
    """SIGINT and SIGTERM as a flag.

    The signals are blocked and awaited by a thread: a handler would run only once the executor returns to Python, and
    rclpy's own handlers end the context before anything pending can be published. A second signal ends at once; one
    that comes while nodes are being made ends them as soon as they are. Threads of libraries that were loaded before do
    not block them (those of BLAS); for what reaches these there is a handler as well.
    """

    _AWAITED: Final = frozenset({signal.SIGINT, signal.SIGTERM})

    def __init__(self) -> None:
        self.stop = threading.Event()
        self.wake: Callable[[], Any] | None = None
        for number in self._AWAITED:
            signal.signal(number, signal.SIG_DFL)  # a shell starts background jobs with SIGINT ignored
        signal.pthread_sigmask(signal.SIG_BLOCK, self._AWAITED)
        for number in self._AWAITED:
            signal.signal(number, lambda *_: self._received())
        threading.Thread(target=self._await, name="signals", daemon=True).start()

    def _await(self) -> None:
        while True:
            signal.sigwait(self._AWAITED)
            self._received()

    def _received(self) -> None:
        if self.stop.is_set():
            os._exit(130)
        self.stop.set()
        if self.wake is not None:  # before, the nodes are still being made; what they have received by then counts
            self.wake()
