"""``gbas vdb``: messages of the VHF data broadcast, bits to values and back."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from gbas_cli import vdb_budget, vdb_fas
from gbas_cli.base import Json, print_json
from gbas_core.errors import ConfigError

app = typer.Typer(help="Messages of the VHF data broadcast: bits to values and back.", no_args_is_help=True)
vdb_fas.register(app)
vdb_budget.register(app)


@app.command()
def decode(
    hex_text: Annotated[str, typer.Option("--hex", metavar="AA...", help="Hexadecimal digits; '-' reads them.")],
    burst: Annotated[bool, typer.Option("--burst", help="Application data with FEC, or all scrambled bits.")] = False,
    as_json: Json = False,
) -> None:
    """Message blocks or a burst, as physical values. A bad CRC is an error."""
    from gbas_vdb.messages.describe import decode_hex_to_json

    print_json(decode_hex_to_json(sys.stdin.read() if hex_text == "-" else hex_text, burst))


@app.command()
def encode(
    document: Annotated[Path, typer.Argument(metavar="DOCUMENT", help="JSON as decode prints it; '-' reads it.")],
    burst: Annotated[bool, typer.Option("--burst", help="With the application FEC.")] = False,
    as_json: Json = False,
) -> None:
    """Hexadecimal digits of the message blocks in a JSON document."""
    import json

    from gbas_vdb.messages.describe import encode_json_to_hex

    text = sys.stdin.read() if str(document) == "-" else document.read_text(encoding="utf-8")
    try:
        content = json.loads(text)
    except ValueError as error:
        raise ConfigError(document, f"is not JSON: {error}") from error
    digits = encode_json_to_hex(content, burst)
    if as_json:
        print_json({"hex": digits})
    else:
        print(digits)
