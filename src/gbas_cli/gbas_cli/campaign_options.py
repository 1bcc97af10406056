"""Options that all campaigns have: where their trials run, and the file that keeps them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_studies.campaign import Execution

Workers = Annotated[
    int, typer.Option(help="Processes on this machine; 1 is this one. The result is the same.", min=1, max=256)
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Of a dask scheduler, whose workers do it: tcp://HOST:PORT.")
]
Results = Annotated[
    Path | None, typer.Option("--out", help="File for all trials, JSON lines; what it has already is not done again.")
]


@contextmanager
def execution(title: str, *, workers: int, scheduler: str | None, out: Path | None, quiet: bool) -> Iterator[Execution]:
    """How a campaign is to run, with a bar that shows its trials.

    Raises
    ------
    GbasError
        For workers here and a scheduler elsewhere at once.
    """
    from gbas_bringup.progress import progress
    from gbas_studies.campaign import Execution

    if scheduler is not None and workers != 1:
        raise GbasError(f"--workers {workers} are processes here, and --scheduler {scheduler} has its own: give one")
    with progress(title, enabled=not quiet) as update:
        yield Execution(
            workers=workers, scheduler=scheduler, out=out, progress=lambda done, total: update(done, total, "")
        )
