"""``gbas bag``: what is in a bag, whether it is good, and saving a damaged one."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from gbas_cli.base import BagPath, Json, print_json, print_places, print_table
from gbas_core.errors import EXIT_BAD_INPUT

app = typer.Typer(help="Look into recorded bags, check them, save damaged ones.", no_args_is_help=True)


@app.command()
def info(bag: BagPath, as_json: Json = False) -> None:
    """Topics, counts, duration, epochs, whether simulated, and which version wrote it."""
    from gbas_bags.info import info as bag_info
    from gbas_bags.versions import older_text

    document = bag_info(bag).as_json()
    if as_json:
        print_json(document)
        return
    epochs = document["epochs"]
    lines = {
        "bag": document["bag"],
        "size": f"{document['size_bytes'] / 1e6:.2f} MB in {len(document['files'])} file(s)",
        "data": document["origin"],
        "suite version": document["suite_version"] or "not known",
        "command": document["command"] or "not known",
        "created": document["created"] or "not known",
        "configuration": ", ".join(document["configuration"]) or "none stored",
        "duration": f"{document['duration_s']:.3f} s, from {document['start']} (GPS time)",
        "epochs": "none" if epochs is None else _epochs_text(epochs),
        "messages": str(document["messages"]),
        "tables": older_text(document["older_tables"]) if document["older_tables"] else "of this version",
        "lost in transport": "not known" if document["lost_in_transport"] is None else document["lost_in_transport"],
    }
    for name, value in lines.items():
        print(f"{name:18} {value}")
    rows = [(topic["topic"], topic["type"], str(topic["messages"])) for topic in document["topics"]]
    print_table("", ("topic", "type", "messages"), rows)
    for damage in document["damages"]:
        print(f"gbas: {damage['file']}: at byte {damage['offset']}: {damage['what']}", file=sys.stderr)
    if document["damages"]:
        print(f"gbas: what is readable is counted above; save it with: gbas bag recover {bag}", file=sys.stderr)


def _epochs_text(epochs: dict[str, Any]) -> str:
    first, last = epochs["first"], epochs["last"]
    span = f"week {first['gps_week']} {first['tow_s']:.3f} s to week {last['gps_week']} {last['tow_s']:.3f} s"
    return f"{epochs['count']}, {span}, every {epochs['interval_s']} s"


@app.command()
def check(bag: BagPath, as_json: Json = False) -> None:
    """Is it whole, readable by other tools, in order, and can its alerts be traced? Exit code 2 if not."""
    from gbas_bags.check import check as check_bag
    from gbas_bags.problems import problems_of

    result = check_bag(bag)
    if as_json:
        print_json(result.as_json())
    else:
        for line in problems_of(result):
            print(line)
        for note in result.notes:
            print(f"note: {note}")
        done = ", ".join(f"{count} {what}" for what, count in result.checked.items())
        verdict = "good" if result.ok else f"{len(result.problems) + result.unlisted} problems"
        print(f"{bag}: {verdict} ({result.messages} messages; {done})")
    if not result.ok:
        raise typer.Exit(EXIT_BAD_INPUT)


@app.command()
def recover(
    bag: BagPath,
    out: Annotated[Path | None, typer.Option(help="Folder of the new bag (default: BAG_recovered).")] = None,
    as_json: Json = False,
) -> None:
    """Make a good bag of what is whole in a damaged or unclosed one; the original is not touched."""
    from gbas_bags.recovery import recover as recover_bag

    result = recover_bag(bag, out)
    document = result.as_json()
    if as_json:
        print_json(document)
        return
    for damage in document["damages"]:
        print(f"{damage['file']}: at byte {damage['offset']}: {damage['what']}")
    unknown = document["parts_of_unknown_content"]
    more = f", and what was in {unknown} damaged part(s), which nobody can tell" if unknown else ""
    print(f"kept {document['kept']} messages of {len(document['kept_by_topic'])} topics")
    print(f"lost {document['lost']} messages{more}")
    for topic, count in document["lost_by_topic"].items():
        print(f"  {count} of {topic}")
    print_places({"bag": result.target})
