"""Starting the nodes without ``ros2 launch``, watching over them, and ending them in order.

Every node is a process of its own, or all are in one. A node that ends by itself ends the run and is named, with its
exit code and last lines. On SIGINT (and when the driver of time has sent everything) the nodes are ended along the flow
of the data: driver, ground, aircraft, recorder; so nothing that was sent is left unprocessed or unrecorded.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import yaml

from gbas_bringup.environment import process_environment
from gbas_bringup.node_kinds import NodeInstance, Stage
from gbas_bringup.node_process import NodeProcess
from gbas_bringup.run_config import RunConfig, one_driver
from gbas_core.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED, GbasError, NodeDied

OVERRIDES_FILE: Final = "overrides.yaml"
START_WAIT_S: Final = 60.0
"""A node that does not come up is noticed here at once, so a driver need not be impatient on a busy machine [s]."""
BATCH_JOIN_TIMEOUT_S: Final = 30.0
"""Join time-out of a run that is not in real time: no deadline must pass because the machine is busy."""
_JOINING: Final = frozenset({"integrity_monitor", "positioning"})
_POLL_S: Final = 0.05
_LAST_LINES: Final = 20
_STOP_S: Final[Mapping[Stage, float]] = {
    Stage.DRIVER: 5.0,
    Stage.GROUND: 5.0,
    Stage.AIRBORNE: 5.0,
    Stage.RECORDER: 20.0,
}
_TERMINATE_S: Final = 3.0
_ALL_IN_ONE: Final = "gbas_bringup.single_process"

Echo = Callable[[str, str], None]


class Interrupted(GbasError):
    """The run was ended with Ctrl-C or SIGTERM."""

    exit_code = EXIT_INTERRUPTED


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """All that a run depends on.

    Attributes
    ----------
    config : RunConfig
        The nodes and their parameters.
    directory : Path
        For the bag, the parameters set by the launcher and the logs.
    speed : float or None
        Multiple of real time, 0 for as fast as the nodes go; None for what the configuration says.
    single_process : bool
        All nodes in one process.
    domain : int or None
        ROS domain; None for that of this process.
    isolated : bool
        Keep to this machine.
    remaps : tuple of str
        ``from:=to``, for every node.
    overrides : mapping
        Parameters by full node name that count more than the configuration's.
    command : str
        Command line, for the bag.
    bag : str
        Name of the bag in the directory.
    """

    config: RunConfig
    directory: Path
    speed: float | None = None
    single_process: bool = False
    domain: int | None = None
    isolated: bool = False
    remaps: tuple[str, ...] = ()
    overrides: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    command: str = ""
    bag: str = "bag"

    @property
    def bag_path(self) -> Path:
        """The bag the recorder writes."""
        return self.directory / self.bag


def launch_parameters(plan: RunPlan) -> dict[str, dict[str, Any]]:
    """Parameters the launcher sets, by full node name: who waits for whom, the speed, the bag."""
    config = plan.config
    driver = one_driver(config)
    recorders = [node for node in config.nodes if node.kind.stage is Stage.RECORDER]
    parameters: dict[str, dict[str, Any]] = {}
    for node in config.nodes:
        values: dict[str, Any] = {}
        if node.kind.stage is not Stage.RECORDER:
            values["recorders"] = len(recorders)
        else:
            values |= {"out": str(plan.bag_path), "command": plan.command, "config_files": _config_files(plan)}
        if node.kind.name in _JOINING and _speed(plan, driver) != 1.0 and not config.given(node, "join_timeout_s"):
            values["join_timeout_s"] = BATCH_JOIN_TIMEOUT_S
        if node == driver:
            values |= _driver_parameters(plan, recorders)
        parameters[node.full_name] = {**values, **plan.overrides.get(node.full_name, {})}
    return parameters


def _config_files(plan: RunPlan) -> list[str]:
    """Every configuration file the nodes read, the one that starts them first."""
    further = {plan.overrides.get(name, {}).get("config", file) for name, file in plan.config.files.items()}
    return [str(plan.config.path), *sorted(further)]


def _speed(plan: RunPlan, driver: NodeInstance) -> float:
    if plan.speed is not None:
        return plan.speed
    configured = plan.config.value(driver, "speed")
    return 1.0 if configured is None else float(configured)


def _driver_parameters(plan: RunPlan, recorders: Sequence[NodeInstance]) -> dict[str, Any]:
    config = plan.config
    driver = one_driver(config)
    readers = {
        "wait_for_ground": [n for n in config.nodes if n.kind.name == "correction_broadcast"] + list(recorders),
        "wait_for": [n for n in config.nodes if n.kind.name == "protection_level"],
    }
    values: dict[str, Any] = {
        name: [node.progress for node in nodes] or [""]
        for name, nodes in readers.items()
        if not config.given(driver, name)
    }
    if not config.given(driver, "start_wait_s"):
        values["start_wait_s"] = START_WAIT_S
    if plan.speed is not None:
        values["speed"] = float(plan.speed)
    return values


def node_arguments(plan: RunPlan, node: NodeInstance | None) -> list[str]:
    """ROS arguments of a process; `node` is None for the process of all nodes."""
    arguments = ["--ros-args", "--params-file", str(plan.config.path)]
    arguments += ["--params-file", str(plan.directory / OVERRIDES_FILE)]
    if node is not None:
        arguments += ["-r", f"__ns:={node.namespace}"]
    for remap in plan.remaps:
        arguments += ["-r", remap]
    return arguments


class Program(NamedTuple):
    """A process to start: a module with a function ``main``, its arguments, and its stage."""

    module: str
    arguments: Sequence[str]
    stage: Stage


def programs(plan: RunPlan) -> dict[str, Program]:
    """The processes of a run, by label."""
    if plan.single_process:
        names = [node.full_name for node in plan.config.nodes]
        return {"nodes": Program(_ALL_IN_ONE, [*names, *node_arguments(plan, None)], Stage.DRIVER)}
    return {
        node.label: Program(node.kind.module, node_arguments(plan, node), node.kind.stage) for node in plan.config.nodes
    }


@dataclass
class _Running:
    """A process with what it said last."""

    label: str
    stage: Stage
    process: NodeProcess
    output: IO[str]
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_LAST_LINES))
    reader: threading.Thread | None = None

    def wait_until(self, deadline_s: float) -> bool:
        return self.process.wait(max(0.0, deadline_s - time.monotonic())) is not None


class Launcher:
    """Runs a plan.

    Parameters
    ----------
    plan : RunPlan
    echo : callable, optional
        Gets each line of output with the node's label.
    on_tick : callable, optional
        Called some times a second while everything runs.
    """

    def __init__(self, plan: RunPlan, *, echo: Echo | None = None, on_tick: Callable[[], None] | None = None) -> None:
        self.plan = plan
        self.late: tuple[str, ...] = ()
        self._echo = echo
        self._on_tick = on_tick
        self._running: list[_Running] = []
        self._signals = 0

    def run(self) -> None:
        """Start the nodes and wait until the driver has sent everything and all is processed.

        Raises
        ------
        NodeDied
            When a node ends by itself.
        GbasError
            When a node refuses its parameters or files; the text is the node's.
        Interrupted
            After an orderly end, on SIGINT or SIGTERM.
        """
        one_driver(self.plan.config)
        self._write_overrides()
        with self._own_signals():
            try:
                self._start()
                self._watch()
            finally:
                self._stop_all()

    @property
    def processes(self) -> Mapping[str, int]:
        """Process identifiers by label."""
        return {running.label: running.process.pid for running in self._running}

    def _write_overrides(self) -> None:
        self.plan.directory.mkdir(parents=True, exist_ok=True)
        parameters = launch_parameters(self.plan)
        document = {name: {"ros__parameters": values} for name, values in parameters.items() if values}
        text = yaml.safe_dump(document, sort_keys=False)
        (self.plan.directory / OVERRIDES_FILE).write_text(text, encoding="utf-8")

    def _start(self) -> None:
        plan = self.plan
        environment = process_environment(
            domain=plan.domain, isolated=plan.isolated, log_dir=plan.directory.resolve() / "log"
        )
        for label, program in programs(plan).items():
            ours, theirs = os.pipe()
            output = open(ours, errors="replace")  # noqa: SIM115
            try:
                process = NodeProcess(program.module, program.arguments, environment, theirs)
            finally:
                os.close(theirs)
            self._running.append(_Running(label, program.stage, process, output))
        for running in self._running:
            running.reader = threading.Thread(target=self._read, args=(running,), name=running.label, daemon=True)
            running.reader.start()

    def _read(self, running: _Running) -> None:
        with running.output:
            for line in running.output:
                running.lines.append(line.rstrip())
                if self._echo is not None:
                    self._echo(running.label, line.rstrip())

    def _watch(self) -> None:
        while True:
            if self._signals:
                raise Interrupted(f"interrupted; the nodes were ended in order{self._where_the_bag_is()}")
            for running in self._running:
                code = running.process.poll()
                if code is None:
                    continue
                if running.stage is Stage.DRIVER and code == 0:
                    return
                self._died(running, code)
            if self._on_tick is not None:
                self._on_tick()
            time.sleep(_POLL_S)

    def _where_the_bag_is(self) -> str:
        recorded = any(node.kind.stage is Stage.RECORDER for node in self.plan.config.nodes)
        return f"; the bag is {self.plan.bag_path}" if recorded else ""

    def _died(self, running: _Running, code: int) -> None:
        if running.reader is not None:
            running.reader.join(timeout=2.0)
        lines = tuple(line for line in running.lines if line)
        if code == EXIT_BAD_INPUT and lines:
            raise GbasError(lines[-1])
        raise NodeDied(running.label, code, lines)

    def _stop_all(self) -> None:
        late: list[str] = []
        for stage in Stage:
            group = [each for each in self._running if each.stage is stage and each.process.poll() is None]
            for each in group:
                each.process.send_signal(signal.SIGINT)
            deadline_s = time.monotonic() + _STOP_S[stage]
            for each in group:
                if not self._ends(each, deadline_s):
                    late.append(each.label)
        for each in self._running:
            if each.reader is not None:
                each.reader.join(timeout=2.0)
        self.late = tuple(late)

    def _ends(self, running: _Running, deadline_s: float) -> bool:
        """Wait for a process; with more force after the deadline, or at a second Ctrl-C."""
        while self._signals < 2 and time.monotonic() < deadline_s:
            if running.wait_until(min(deadline_s, time.monotonic() + _POLL_S)):
                return True
        running.process.send_signal(signal.SIGTERM)
        if not running.wait_until(time.monotonic() + (_TERMINATE_S if self._signals < 2 else 0.5)):
            running.process.kill()
            running.process.wait()
        return False

    @contextlib.contextmanager
    def _own_signals(self) -> Iterator[None]:
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def count(*_: Any) -> None:
            self._signals += 1

        before = {number: signal.signal(number, count) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
