"""``gbas vdb budget``: what a station's messages take of its slots."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Annotated, Any

import typer

from gbas_cli.base import Json, print_json, print_table
from gbas_core.errors import GbasError

_PRODUCTS = {"100": 0, "30": 1}
"""Measurement types of the messages of a second band, by smoothing constant."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(budget)


def budget(
    satellites: Annotated[str, typer.Option("--satellites", metavar="G:N,E:N", help="Satellites of each system.")],
    bands: Annotated[int, typer.Option("--bands", min=1, max=2, help="1: L1/E1; 2: L5/E5a too.")] = 1,
    constants: Annotated[
        str, typer.Option("--second", metavar="100,30", help="Smoothing constants of the second band [s].")
    ] = "100,30",
    slots: Annotated[str, typer.Option("--slots", metavar="A..H", help="Slots assigned.")] = "ABCDEFGH",
    service: Annotated[str, typer.Option("--service", metavar="C|D", help="D: type 11 messages too.")] = "D",
    approaches: Annotated[int, typer.Option("--approaches", min=0, max=48, help="FAS data blocks.")] = 1,
    as_json: Json = False,
) -> None:
    """Bytes, slots and update times of the messages of so many satellites, counted in frames that are made."""
    from gbas_vdb.transmission.budget import frame_budget
    from gbas_vdb.transmission.burst import SLOT_NAMES
    from gbas_vdb.transmission.frame import ScheduleParams

    if not slots or "".join(sorted(set(slots) & set(SLOT_NAMES))) != slots:
        raise GbasError(f"--slots {slots!r} is not letters A to H, each once, in order")
    if service not in ("C", "D"):
        raise GbasError(f"--service {service!r} is not C or D")
    params = ScheduleParams(
        station_id="GBAS",
        slots=tuple(SLOT_NAMES.index(slot) for slot in slots),
        message_types=(1, 11) if service == "D" else (1,),
    )
    kinds = _kinds(constants) if bands == 2 else ()
    found = frame_budget(_numbers(satellites), kinds, params, n_approaches=approaches)
    document = asdict(found) | {
        "slots": slots,
        "bands": bands,
        "left_out": found.left_out,
        "second_left_out": found.second_left_out if kinds else 0,
    }
    if as_json:
        print_json(document)
    else:
        _show(document)


def _numbers(text: str) -> list[int]:
    """Ranging source identifiers of ``G:11,E:9``, the first ones of each system."""
    from gbas_vdb.transmission.budget import FIRST_SOURCE, MOST

    numbers: list[int] = []
    seen: set[str] = set()
    for part in text.split(","):
        match = re.fullmatch(r"([A-Z]):(\d{1,3})", part.strip())
        if match is None or match[1] not in FIRST_SOURCE or match[1] in seen:
            raise GbasError(f"--satellites {text!r}: {part!r} is not a system (G, E), once, a colon and a number")
        count = int(match[2])
        if count > MOST[match[1]]:
            raise GbasError(f"--satellites {text!r}: {count} is more than the {MOST[match[1]]} there are of {match[1]}")
        seen.add(match[1])
        numbers += range(FIRST_SOURCE[match[1]], FIRST_SOURCE[match[1]] + count)
    return numbers


def _kinds(text: str) -> tuple[int, ...]:
    parts = text.split(",")
    if not set(parts) <= set(_PRODUCTS) or len(set(parts)) != len(parts):
        raise GbasError(f"--second {text!r} is not 100, 30, or both")
    return tuple(sorted(_PRODUCTS[part] for part in parts))


def _show(document: dict[str, Any]) -> None:
    print_table(
        "messages of a frame of 0.5 s",
        ("type", "what", "satellites", "messages", "bytes", "update"),
        [
            (
                str(each["message_type"]),
                each["what"],
                str(each["satellites"] or ""),
                f"{each['messages_per_frame']:g}",
                f"{each['bytes_per_frame']:g}",
                f"{each['update_s']:g} s",
            )
            for each in document["messages"]
        ],
    )
    used = [f"{slot} {size}" for slot, size in zip(document["slots"], document["slot_bytes"], strict=True)]
    print(f"fullest bytes of each slot (of 222): {', '.join(used)}")
    print(f"fullest frame: {document['bytes_per_frame']} of {document['capacity_bytes']} bytes")
    print(f"every satellite first in a type 1 message (ephemeris CRC and P) within {document['first_s']:g} s")
    sent = document["satellites"] - document["left_out"]
    print(f"satellites: {sent} of {document['satellites']} fit; room for {document['room']}")
    if document["bands"] == 2:
        fit = sent - document["second_left_out"]
        print(f"second band: {fit} of {sent} fit beside them")
