"""Running a configuration, with what a person sees of it: what ``gbas run``, ``demo`` and ``replay`` share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gbas_bringup.environment import process_environment
from gbas_bringup.launcher import Launcher, RunPlan
from gbas_bringup.monitor import Monitor
from gbas_bringup.progress import progress
from gbas_core.errors import BagError

_TICK_S = 0.25


def execute(plan: RunPlan, *, title: str, verbose: bool = False, quiet: bool = False, total: int | None = None) -> None:
    """Run a plan to its end.

    Parameters
    ----------
    verbose : bool
        Show every line the nodes write; else warnings and errors only.
    quiet : bool
        Show nothing but what goes wrong.
    total : int, optional
        Epochs there will be.

    Raises
    ------
    GbasError
        As :meth:`gbas_bringup.launcher.Launcher.run`.
    """
    if plan.bag_path.exists() and any(node.kind.name == "recorder" for node in plan.config.nodes):
        raise BagError(plan.bag_path, "already exists; a recording never overwrites anything, choose another folder")
    plan = replace(plan, config=plan.config.written(plan.directory))
    environment = process_environment(domain=plan.domain, isolated=plan.isolated)
    with progress(title, enabled=not (quiet or verbose), total=total) as update, Monitor(environment) as monitor:
        driver = plan.config.drivers[0].kind.name
        launcher = Launcher(plan, echo=_printer(verbose), on_tick=_ticker(monitor, driver, total, update))
        launcher.run()
        for label in launcher.late:
            print(f"gbas: {label} did not end in time and was killed", file=sys.stderr)


def _printer(verbose: bool) -> Callable[[str, str], None]:
    def echo(label: str, line: str) -> None:
        if line and (verbose or line.startswith(("WARN", "ERROR", "FATAL"))):
            print(f"[{label}] {line}", file=sys.stderr)

    return echo


def _ticker(
    monitor: Monitor, driver: str, total: int | None, update: Callable[[int, int | None, str], None]
) -> Callable[[], None]:
    due_s = 0.0

    def tick() -> None:
        nonlocal due_s
        if time.monotonic() < due_s:
            return
        due_s = time.monotonic() + _TICK_S
        status = monitor.statuses.get(driver)
        if status is not None:
            update(status.epochs, total, status.message)

    return tick


def new_directory(base: Path, stem: str) -> Path:
    """A folder for a run that does not exist yet: ``<base>/<stem>-<number>``."""
    number = 1
    while (base / f"{stem}-{number}").exists():
        number += 1
    return base / f"{stem}-{number}"
