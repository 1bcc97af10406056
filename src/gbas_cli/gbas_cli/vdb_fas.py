"""``gbas vdb fas``: FAS data blocks of ARINC 424 path point records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gbas_cli.base import Json, print_json
from gbas_core.errors import EXIT_BAD_INPUT, ConfigError, GbasError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(fas)


def fas(
    arinc424: Annotated[
        str,
        typer.Option(metavar="FILE|RECORD", help="Navigation data with path point records, or one record in quotes."),
    ],
    as_json: Json = False,
) -> None:
    """FAS data blocks of ARINC 424 path point records; their CRCs are checked. Exit code 2 if one is wrong.

    The block is the one of the record (SBAS: 34 bytes as in a type 4 message, two alert limits, CRC).
    """
    approaches = [_approach(record, where) for where, record in _records(arinc424)]
    if as_json:
        print_json({"approaches": approaches})
    else:
        for each in approaches:
            verdict = "good" if each["crc_ok"] else f"wrong, the block's is {each['fas_block_hex'][-8:]}"
            name = f"{each['airport']} {each['runway']}{each['route'] and '-' + each['route']}"
            print(f"{name:12} {each['fas_block_hex']}  CRC {each['crc']} {verdict}")
    if not all(each["crc_ok"] for each in approaches):
        raise typer.Exit(EXIT_BAD_INPUT)


def _records(text: str) -> list[tuple[str, str]]:
    """Records and where each is from: of a file, or the argument itself."""
    from gbas_core.positioning.arinc424 import is_path_point
    from gbas_vdb.messages.path_point import path_points_of

    path = Path(text)
    if is_path_point(text) or not _is_file(path):
        return [("record", text)]
    records = [(f"{path}:{number}", record) for number, record in path_points_of(_text_of(path))]
    if not records:
        raise ConfigError(path, "holds no ARINC 424 path point record (S or T, then P in columns 5 and 13)")
    return records


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a text no file can be named
        return False


def _text_of(path: Path) -> str:
    try:
        return path.read_text(
            encoding="latin-1"
        )  # names of places may have letters beyond ASCII; path points have none
    except OSError as error:
        raise ConfigError(path, f"cannot be read: {error}") from None


def _approach(record: str, where: str) -> dict[str, Any]:
    from gbas_vdb.messages.path_point import PathPointError, checked_path_point

    try:
        checked = checked_path_point(record)
    except PathPointError as error:
        raise GbasError(f"{where}: {error}") from None
    return {
        "airport": checked.point.airport,
        "runway": checked.point.runway,
        "route": checked.point.route,
        "crc": checked.point.crc,
        "crc_ok": checked.crc_ok,
        "fas_block_hex": checked.block.hex().upper(),
    }
