"""What all commands share: options that take lists, JSON on standard output, and errors as one line."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from gbas_core.errors import EXIT_BAD_INPUT, EXIT_INTERNAL, EXIT_INTERRUPTED, GbasError

OUT = Path("out")
_JSON_KEY = "gbas.json"
_NUMBER = re.compile(r"^-\.?\d")
_OWN_PACKAGES = ("gbas_",)
_WIDE = 200
"""Columns of a table that goes into a file or a pipe."""


class ListsCommand(TyperCommand):
    """A command whose repeatable options take several values at once: ``--ground A B`` is ``--ground A --ground B``.

    Everything up to the next option is a value; a number is one though it begins with a minus.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Write the lists out before the usual parsing."""
        names = {name for param in self.params if getattr(param, "multiple", False) for name in param.opts}
        return super().parse_args(ctx, spread_lists(args, names))


def spread_lists(arguments: Sequence[str], names: set[str]) -> list[str]:
    """Repeat the name of a list option before each of its values."""
    spread: list[str] = []
    current: str | None = None
    for at, argument in enumerate(arguments):
        if argument == "--":
            return spread + list(arguments[at:])
        if argument.startswith("-") and argument != "-" and not _NUMBER.match(argument):
            current = argument if argument in names else None
            spread.append(argument)
        elif current is not None and spread[-1] != current:
            spread += [current, argument]
        else:
            spread.append(argument)
    return spread


class GbasGroup(TyperGroup):
    """The top command: turns whatever goes wrong into one line and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except (typer.Exit, typer.Abort, BrokenPipeError):  # the last: whoever read the output has enough
            raise
        except KeyboardInterrupt:
            self._fail(ctx, "interrupted", EXIT_INTERRUPTED)
        except Exception as error:
            if hasattr(error, "format_message"):  # of typer itself: the command line
                if type(error).__name__ == "NoArgsIsHelpError":
                    raise
                self._fail(ctx, *_usage(error))
            self._fail(ctx, *describe(error), document=getattr(error, "document", None))

    @staticmethod
    def _fail(ctx: Any, text: str, code: int, document: Any = None) -> None:
        if wants_json(ctx):
            print(json.dumps(document if isinstance(document, dict) else {"error": text}))
        print(f"gbas: {text}", file=sys.stderr)
        raise typer.Exit(code)


def _usage(error: Any) -> tuple[str, int]:
    context = getattr(error, "ctx", None)
    message = " ".join(error.format_message().split())
    if context is None:
        return message, EXIT_BAD_INPUT
    command = context.command_path.split(maxsplit=1)[1:] or [""]
    name = f"{command[0]}: " if command[0] else ""
    return f"{name}{message} (see {context.command_path} --help)", EXIT_BAD_INPUT


def describe(error: Exception) -> tuple[str, int]:
    """One line and the exit code for an error.

    Errors that the suite's own packages define are about what a person gave; so are files that cannot be opened.
    Anything else is a fault of ours; ``GBAS_TRACEBACK=1`` shows where.
    """
    if isinstance(error, GbasError):
        return str(error), error.exit_code
    if type(error).__module__.startswith(_OWN_PACKAGES):
        return " ".join(str(error).split()), EXIT_BAD_INPUT
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}", EXIT_BAD_INPUT
    if os.environ.get("GBAS_TRACEBACK"):
        traceback.print_exception(error)
    kind = type(error).__name__
    return f"internal error, {kind}: {error} (GBAS_TRACEBACK=1 shows where)", EXIT_INTERNAL


def remember_json(ctx: typer.Context, value: bool) -> bool:
    """Callback of ``--json``: errors must be JSON then, too."""
    ctx.find_root().meta[_JSON_KEY] = value
    return value


BagPath = Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag, or a .mcap file.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON only.", callback=remember_json)]


def wants_json(ctx: Any) -> bool:
    """Whether the command was given ``--json``."""
    return bool(ctx.find_root().meta.get(_JSON_KEY))


def print_json(document: Any) -> None:
    """Write a document to standard output; a number that is none becomes null, for JSON has no NaN."""
    print(json.dumps(_plain(document), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and value - value != 0.0:
        return None
    return value if isinstance(value, str | int | float | bool | type(None)) else str(value)


def command_line() -> str:
    """What was typed."""
    return shlex.join(["gbas", *sys.argv[1:]])


def new_out(out: Path | None, stem: str) -> Path:
    """The folder a command writes to: the one given, or a new one below ``out``."""
    from gbas_bringup.runs import new_directory

    return out if out is not None else new_directory(OUT, stem)


def print_places(places: dict[str, Path]) -> None:
    """Say where files were written."""
    width = max(len(name) for name in places)
    for name, path in places.items():
        print(f"{name:{width}}  {path}")


def speed_option(text: str) -> float:
    """Speed of a run, as an option of a command; see :func:`gbas_bringup.run_config.speed_of`."""
    from gbas_bringup.run_config import speed_of

    try:
        return speed_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def position_of(text: str) -> tuple[float, float, float]:
    """An ECEF position ``X,Y,Z`` in metres.

    Raises
    ------
    typer.BadParameter
        For anything else.
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not X,Y,Z in metres (no blanks)") from None
    return x, y, z


def print_table(title: str, headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    """Rows in columns, as wide as the terminal."""
    from rich.console import Console
    from rich.table import Table

    if title:
        print(f"{title}:")
    table = Table(*headings, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else _WIDE).print(table)
