"""``gbas reproduce``: the tables and figures of published papers, each value beside ours."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gbas_bringup.resources import data_folder
from gbas_cli.base import Json, command_line, new_out, print_json, print_places
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_studies.reproduction.items import Reproduction, Verdict

_WIDE = 150
"""Columns of the table in a file or a pipe."""
_STYLES = {
    "REPRODUCED": "green", "CLOSE": "green", "POINT": "yellow", "DIFFERS": "red", "OTHER": "cyan", "NEW": "blue",
    "LEFT_OUT": "dim",
}  # fmt: skip


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(reproduce)


def reproduce(
    study: Annotated[str, typer.Argument(metavar="STUDY", help="a paper (ccd, asigm, modes, abia), or all.")],
    out: Annotated[Path | None, typer.Option(help="Folder for what is written (default: out/STUDY-N).")] = None,
    data: Annotated[Path | None, typer.Option(help="Folder of recorded data (default: GBAS_DATA).")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Smaller campaigns: less exact.")] = False,
    seed: Annotated[int, typer.Option(help="Of everything random.", min=0)] = 1,
    as_json: Json = False,
) -> None:
    """Recompute a published paper: every table and figure, the paper's value beside ours.

    Writes report.html (complete in itself), results.json, and pictures with their data as CSV.

    Each item has its definition and a verdict that follows from the printed digits; what does not come out is said.
    """
    from gbas_bringup.progress import progress
    from gbas_studies.reproduction import registry
    from gbas_studies.reproduction.report import as_json as document
    from gbas_studies.reproduction.report import write_report

    folder = data or data_folder()
    if folder is not None and not folder.is_dir():
        raise GbasError(f"{folder}: no such folder of recorded data (from {'--data' if data else 'GBAS_DATA'})")
    with progress("reproducing", enabled=not as_json) as update:
        options = registry.Options(data=folder, quick=quick, seed=seed, progress=lambda note: update(0, None, note))
        reproductions = registry.run(study, options)
        update(0, None, "writing the report")
        notes = _notes(folder, quick)
        written = write_report(reproductions, new_out(out, study), command=command_line(), notes=notes)
    if as_json:
        print_json(document(reproductions, command=command_line(), notes=notes))
        return
    _print_tables(reproductions)
    for note in notes:
        print(f"note: {note}")
    print_places({"report": written.report, "results": written.results, "pictures": written.results.parent / "figures"})


def _notes(data: Path | None, quick: bool) -> list[str]:
    notes = []
    if quick:
        notes.append("Quick run: campaigns are smaller than those of a full one, and their figures less exact.")
    if data is None:
        notes.append("No folder of recorded data (--data, GBAS_DATA): what needs recordings is left out.")
    return notes


def _print_tables(reproductions: Iterable[Reproduction]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from gbas_studies.reproduction.items import reason

    console = Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False)
    for reproduction in reproductions:
        console.print(Text(reproduction.title, style="bold"))
        console.print(Text(reproduction.source, style="dim"))
        for section in reproduction.sections:
            if not section.items:
                continue
            console.print()
            table = Table(title=section.title, title_justify="left", title_style="bold", box=None, pad_edge=False)
            for name in ("", "item", "paper", "ours", "unit", "definition, and why"):
                number = name in ("paper", "ours")
                table.add_column(name, justify="right" if number else "left", overflow="fold")
            for item in section.items:
                how = Text(item.definition)
                if why := reason(item):
                    how.append(f"\n{why}", style="dim")
                mark = Text(item.verdict.value, style=_STYLES[item.verdict.name])
                cells = (item.name, item.paper_text, item.ours_text, item.unit)
                table.add_row(mark, *(Text(cell) for cell in cells), how)
            console.print(table)
        console.print()
        for line in verdict_lines(reproduction):
            console.print(Text(line))


def verdict_lines(reproduction: Reproduction) -> Sequence[str]:
    """How often there is each verdict, for people; and how many of the ticks are results."""
    counts: dict[Verdict, int] = reproduction.counts()
    return [f"{each.value} {count:3d}  {reproduction.headline(each)}" for each, count in counts.items() if count]
