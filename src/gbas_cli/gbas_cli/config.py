"""``gbas config``: effective values of a configuration file, a check of it, and its schema for editors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gbas_cli.base import Json, print_json
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_cli.config_values import Effective, Value

_WIDE = 160
"""Columns of a table that goes into a file or a pipe."""

File = Annotated[str, typer.Argument(metavar="FILE", help="A .yaml file, or a name from `gbas launch-list`.")]

app = typer.Typer(help="Configuration files: values in use, checks, a schema for editors.", no_args_is_help=True)


@app.command()
def show(
    file: File,
    everything: Annotated[bool, typer.Option("--all", help="Defaults, too.")] = False,
    as_json: Json = False,
) -> None:
    """Show the values a run of the file would have, in the file's units, and where each came from.

    Only what somebody set, unless --all is given; the file itself first, then what it is based on.
    """
    from gbas_cli.config_values import effective

    found = effective(_path(file))
    if as_json:
        print_json(
            {
                "file": str(found.path),
                "files": list(map(str, found.files)),
                "nodes": list(found.nodes),
                "left_to_others": list(found.lacking),
                "values": {name: [_document(each) for each in values] for name, values in found.values.items()},
            }
        )
        return
    for name, values in found.values.items():
        _print_values(found, name, values, everything=everything)
    for each in found.lacking:
        print(f"left to others: {each}")


@app.command()
def check(file: File, as_json: Json = False) -> None:
    """Check all that a run of the file would check at its start, and start nothing. Exit code 2 if it is refused.

    Keys, values, bounds and names of nodes; the files it is based on or names; the simulated world is made, recorded
    files are looked for but not read.
    """
    from gbas_cli.config_sections import SECTIONS
    from gbas_cli.config_values import effective

    found = effective(_path(file), start=True)
    given = {name: sum(each.given for each in values) for name, values in found.values.items() if name in SECTIONS}
    if as_json:
        print_json({
            "good": True, "file": str(found.path), "files": list(map(str, found.files)), "nodes": list(found.nodes),
            "left_to_others": list(found.lacking), "given": given,
        })  # fmt: skip
        return
    print(f"good: {found.path}")
    for path in found.files[1:]:
        print(f"reads {path}")
    for name, number in given.items():
        print(f"{name}: {number} of {len(found.values[name])} values given, the others are defaults")
    print(f"starts {', '.join(found.nodes)}" if found.nodes else "starts no node: to be used with other files")
    for each in found.lacking:
        print(f"leaves to others: {each}")


@app.command()
def schema(
    part: Annotated[str, typer.Argument(metavar="[ground|airborne|sim|file]", help="A section, or a file.")] = "file",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write it there.")] = None,
) -> None:
    """Print the JSON Schema of configuration files, or of one section (angles in degrees, as in files)."""
    from gbas_cli.config_schema import file_schema, section_schema, text_of
    from gbas_cli.config_sections import SECTIONS

    if part not in (*SECTIONS, "file"):
        raise GbasError(f"{part!r} is not one of {', '.join(SECTIONS)}, file")
    text = text_of(file_schema() if part == "file" else section_schema(part))
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")
        print(f"schema  {out}")


def _path(file: str) -> Path:
    from gbas_bringup.resources import named_config

    return named_config(file)


def _document(value: Value) -> dict[str, Any]:
    item = value.declared
    return {
        "key": item.key, "value": item.value, "unit": item.parameter.unit, "source": value.source,
        "description": item.parameter.doc,
    }  # fmt: skip


def _print_values(found: Effective, name: str, values: tuple[Value, ...], *, everything: bool) -> None:
    """A table of a section: what the file itself sets, what those below it set, and defaults if wanted."""
    import sys

    from rich import box
    from rich.console import Console
    from rich.table import Table

    from gbas_cli.config_values import BY_RUN, DEFAULT

    order: dict[str, int] = {str(path): rank for rank, path in enumerate(found.files)} | {BY_RUN: 98, DEFAULT: 99}
    shown = sorted((each for each in values if everything or each.given), key=lambda each: order[each.source])
    if not shown:
        return
    rest = len(values) - len(shown)
    title = f"{name} ({rest} defaults more: --all)" if rest else name
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in ("key", "value", "unit", "from"):
        table.add_column(column, overflow="fold")
    for each in shown:
        item = each.declared
        source = Path(each.source).name if each.source in map(str, found.files) else each.source
        table.add_row(item.key, _words(item.value), item.parameter.unit, source)
    Console(width=None if sys.stdout.isatty() else _WIDE, markup=False, highlight=False).print(table)


def _words(value: Any) -> str:
    """A value as a file has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_words, value))}]"
    if isinstance(value, bool) or value is None:
        return str(value).lower() if value is not None else "none"
    return str(value)
