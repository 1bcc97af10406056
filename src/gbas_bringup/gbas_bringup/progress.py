"""What a person sees of long work: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Update = Callable[[int, int | None, str], None]
"""Called with what is done, what is to do (None if nobody knows) and a note."""


def _nothing(done: int, total: int | None, note: str) -> None:
    """An update nobody sees."""


def on_terminal() -> bool:
    """Whether a person is watching standard error."""
    return sys.stderr.isatty()


@contextmanager
def progress(title: str, *, enabled: bool = True, total: int | None = None) -> Iterator[Update]:
    """Show the progress of some work on standard error; does nothing when it is not a terminal."""
    if not (enabled and on_terminal()):
        yield _nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns: tuple[Any, ...] = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total, note="")

        def update(done: int, of: int | None = total, note: str = "") -> None:
            bar.update(task, completed=done, total=of, note=note)

        yield update
