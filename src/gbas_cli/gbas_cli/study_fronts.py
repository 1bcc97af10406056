"""``gbas study fronts``: ionospheric fronts against a station and an aircraft, with protection and without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gbas_cli.base import Json, print_json
from gbas_cli.campaign_options import Results, Scheduler, Workers, execution
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_ground.params import GroundParams
    from gbas_studies.fronts.campaign import Plan


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(fronts)


def fronts(
    threat: Annotated[
        str, typer.Option(help="Threat model the fronts are drawn from: conus, germany, or '' for the station's own.")
    ] = "",
    protection: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:KEY=VALUE,...]",
            help="A station to meet them: none, or a threat model with keys of its ionosphere section; may be repeated "
            "(default: none and the scenario's own).",
        ),
    ] = None,
    systems: Annotated[str, typer.Option(help="Constellations of station and aircraft: G, E or GE.")] = "GE",
    runs: Annotated[int, typer.Option(help="Fronts, shared by the kinds.", min=1)] = 700,
    kind: Annotated[list[str] | None, typer.Option(help="Kind of fronts; may be repeated (default: all).")] = None,
    within: Annotated[float, typer.Option(help="Distance to the threshold looked at, in m.", min=100.0)] = 6_000.0,
    seed: Annotated[int, typer.Option(help="Of the fronts.", min=0)] = 1,
    scenario: Annotated[str, typer.Option(help="World without threats: a .yaml file, or a name.")] = "quiet_approach",
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Results = None,
    as_json: Json = False,
) -> None:
    """Put fronts of a threat model before a station and its aircraft, and count misleading positions.

    A position is misleading when its error exceeds its protection level, with service and without alert.
    """
    from gbas_studies.fronts.campaign import KINDS, run_campaign

    kinds = tuple(kind or KINDS)
    for each in kinds:
        if each not in KINDS:
            raise GbasError(f"--kind {each!r} is not one of {', '.join(KINDS)}")
    asked = Asked(
        threat=threat, protections=tuple(protection or ()), systems=systems, runs=runs, kinds=kinds, within_m=within,
        seed=seed,
    )  # fmt: skip
    plan = plan_of(scenario, asked)
    with execution("fronts", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
        rows = run_campaign(plan, how)
    if as_json:
        print_json({"rows": rows})
    else:
        _print(rows)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What of a campaign is asked for.

    Attributes
    ----------
    threat : str
        Threat model the fronts are drawn from; empty: the station's own.
    protections : sequence of str
        Stations to meet them, ``NAME[:KEY=VALUE,...]``; none: without protection, and the scenario's own.
    systems : str
    runs : int
    kinds : sequence of str
        Of fronts; none: all.
    within_m : float
        Distance to the threshold looked at [m].
    seed : int
    interval_s : float, optional
        Between epochs, in place of the scenario's [s].
    """

    threat: str = ""
    protections: Sequence[str] = ()
    systems: str = "GE"
    runs: int = 700
    kinds: Sequence[str] = ()
    within_m: float = 6_000.0
    seed: int = 1
    interval_s: float | None = None


def plan_of(scenario: str, asked: Asked) -> Plan:
    """The campaign on a scenario: its world without threats, as long as filters and approach take.

    Raises
    ------
    GbasError, ParameterError
        For a threat model or a station that is none.
    """
    from dataclasses import replace

    from gbas_airborne.params import AirborneParams
    from gbas_bringup.resources import named_config
    from gbas_ground.ionosphere.section import NO_THREAT
    from gbas_ground.ionosphere.threat import THREATS
    from gbas_sim.flight.straight_in import StraightIn
    from gbas_sim.scenario import read_sections, scenario_from_yaml
    from gbas_studies.fronts.campaign import KINDS, Plan

    path = named_config(scenario)
    sections, world = read_sections(path), scenario_from_yaml(path)
    if not isinstance(world.flight, StraightIn):
        raise GbasError(f"--scenario {scenario} has no straight approach")
    of_systems = {"systems": asked.systems}
    ground = dict(sections["ground"]) | {"station": dict(sections["ground"]["station"]) | of_systems}
    own = dict(ground.get("ionosphere", {}))
    drawn = asked.threat or own.get("threat_model", NO_THREAT)
    if drawn not in THREATS:
        raise GbasError(f"--threat {drawn!r} is not one of {', '.join(THREATS)}")
    flight = replace(world.flight, intercept_distance_m=asked.within_m + 1_000.0, level_time_s=_LEVEL_S)
    shorter_s = round(world.length_s - flight.duration_s, 1)  # it ends when the scenario's does
    return Plan(
        world=replace(
            world,
            flight=flight,
            systems=asked.systems,
            faults=(),
            fronts=(),
            duration_s=None,
            interval_s=asked.interval_s or world.interval_s,
            start_tow_s=world.start_tow_s + shorter_s,
        ),
        stations=_stations(ground, own, asked.protections),
        aircraft=AirborneParams.from_mapping(dict(sections["airborne"]) | of_systems),
        threat=THREATS[drawn],
        kinds=tuple(asked.kinds or KINDS),
        runs=asked.runs,
        within_m=asked.within_m,
        seed=asked.seed,
    )


def _stations(ground: dict[str, Any], own: dict[str, Any], protections: Sequence[str]) -> dict[str, GroundParams]:
    """A station for each protection, by its text."""
    from gbas_ground.ionosphere.section import NO_THREAT
    from gbas_ground.params import GroundParams

    stations = {}
    for text in protections or (NO_THREAT, "own"):
        name, _, keys = text.partition(":")
        section = own if name == "own" else {"threat_model": name}
        given = {key: _value(value) for key, _, value in (each.partition("=") for each in keys.split(",") if each)}
        # the distance of use belongs to the protection: so far it is screened
        distance = {key: given.pop(key) for key in ("max_use_distance_m",) if key in given}
        stations[text] = GroundParams.from_mapping(
            ground | {"ionosphere": section | given, "station": dict(ground["station"]) | distance},
            source=f"--protection {text}",
        )
    return stations


_LEVEL_S = 270.0  # filters on the ground and on board settle in 230 s


def _value(text: str) -> Any:
    import yaml

    return yaml.safe_load(text)


def _print(rows: Sequence[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("station", "fronts", "runs", "misleading runs (epochs)", "largest error of level", "largest vertical",
                  "excluded", "service lost", box=None, pad_edge=False)  # fmt: skip
    for row in rows:
        lost = row["lost_epochs"] / max(1, row["epochs"] + row["lost_epochs"])
        table.add_row(
            row["station"], row["kind"], str(row["runs"]), f"{row['misleading_runs']} ({row['misleading_epochs']})",
            f"{row['error_m']:.2f} of {row['level_m']:.2f} m, {row['largest_ratio']:.2f}",
            f"{row['largest_vertical_m']:.2f} m", f"{row['excluded_runs']}", f"{100.0 * lost:.1f} %",
        )  # fmt: skip
    Console(highlight=False, width=None if Console().is_terminal else 160).print(table)
