"""``gbas sim``: simulated worlds as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gbas_cli.base import Json, command_line, new_out, print_json, print_places

app = typer.Typer(help="Simulated worlds as files.", no_args_is_help=True)


@app.command("export")
def sim_export(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="A .yaml file, or a name from launch-list.")],
    rinex: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for RINEX 3 files of every receiver and the truth.")
    ] = None,
    bag: Annotated[bool, typer.Option("--bag", help="Run the scenario, too, and record a bag.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the bag (default: out/SCENARIO-N).")] = None,
    as_json: Json = False,
) -> None:
    """Write a scenario as observation, navigation and truth files that other software reads."""
    from gbas_bringup.progress import progress
    from gbas_bringup.resources import named_config
    from gbas_cli import sim_export as body

    if rinex is None and not bag:
        raise typer.BadParameter("nothing to write: give --rinex DIR, --bag, or both")
    path = named_config(scenario)
    places: dict[str, Path] = {}
    if rinex is not None:
        with progress("exporting", enabled=not as_json) as update:
            files = body.export_rinex(path, rinex, progress=lambda done, total: update(done, total, ""))
        places = {each.stem: each for each in files.observations} | {"navigation": files.navigation}
        places |= {} if files.truth is None else {"truth": files.truth}
    if bag:
        folder = new_out(out, path.stem)
        places["bag"] = body.export_bag(path, folder, quiet=as_json, command=command_line())
    if as_json:
        print_json({"simulated": True, "files": {name: str(place) for name, place in places.items()}})
    else:
        print_places(places)
