"""``gbas study faults``: what a running station does about injected faults, and how soon."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gbas_cli.base import Json, print_json
from gbas_cli.campaign_options import Results, Scheduler, Workers, execution
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_studies.faults.campaign import Setting


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(faults)


def faults(
    kind: Annotated[
        list[str] | None,
        typer.Option(help="divergence, acceleration, power, orbit, receiver or front; may be repeated (default: all)."),
    ] = None,
    mode: Annotated[
        list[str] | None, typer.Option(help="Only this divergence mode, such as 'Code L5'; may be repeated.")
    ] = None,
    rates: Annotated[str, typer.Option(metavar="R[,R...]", help="Rates of divergence, in m/s.")] = "0.01,0.02,0.05,0.1",
    trials: Annotated[int, typer.Option(help="Of each case, with other satellites and onsets.", min=1)] = 10,
    scenario: Annotated[str, typer.Option(help="World without faults: a .yaml file, or a name.")] = "quiet_approach",
    watch: Annotated[bool, typer.Option("--watch", help="Also every monitor's own time, with none excluding.")] = False,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Results = None,
    as_json: Json = False,
) -> None:
    """Put faults into a simulated station that has settled: found or not, by what, when, and when a burst says so.

    The time to alert counts from the moment the worst user's differential error passes its limit to the end of the
    burst without the satellite; 1.5 s are allowed. Negative: the alert came first.
    """
    from gbas_studies.faults import campaign
    from gbas_studies.faults.cases import KINDS, cases_of

    cases = cases_of(tuple(kind or KINDS), rates_mps=_rates(rates), modes=tuple(mode or ()))
    setting = _setting(scenario, watch=watch)
    with execution("injecting", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
        outcomes = campaign.run_campaign(setting, cases, trials=trials, execution=how)
    documents = [each.as_json() for each in outcomes]
    if as_json:
        print_json({"cases": documents})
    else:
        _print(documents)


def _rates(text: str) -> tuple[float, ...]:
    try:
        rates = tuple(float(each) for each in text.split(","))
    except ValueError:
        raise GbasError(f"--rates {text!r} is not numbers with commas between them") from None
    if not all(0.0 < each <= 100.0 for each in rates):
        raise GbasError(f"--rates {text} is not above 0, at most 100 m/s each")
    return rates


def _setting(scenario: str, *, watch: bool) -> Setting:
    """The scenario's station alone, for as long as the longest case takes."""
    from dataclasses import replace

    from gbas_bringup.resources import named_config
    from gbas_ground.params import GroundParams
    from gbas_sim.scenario import read_sections, scenario_from_yaml
    from gbas_studies.faults.campaign import WORLD_S, Setting

    path = named_config(scenario)
    world = replace(scenario_from_yaml(path), flight=None, duration_s=WORLD_S, faults=(), fronts=())
    station = GroundParams.from_mapping(read_sections(path)["ground"], source=str(path))
    return Setting(world=world, station=station, watch=watch)


def _print(documents: Sequence[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("fault", "found", "burst, median (largest)", "error passes limit", "time to alert, largest", "by",
                  box=None, pad_edge=False)  # fmt: skip
    for each in documents:
        times, late = each["burst_s"], each["time_to_alert_s"]
        found = f"{each['detected']} of {each['trials']}"
        burst = "" if times["median"] is None else f"{times['median']:.1f} s ({times['max']:.1f} s)"
        limit = "never" if each["limit_s"] is None else f"{each['limit_s']:.1f} s"
        alert = "" if each["limit_s"] is None else _alert(late["max"], each["undetected_beyond_limit"])
        causes = ", ".join(f"{cause} {count}" for cause, count in each["causes"].items())
        table.add_row(each["case"], found, burst, limit, alert, causes)
    Console(highlight=False, width=None if Console().is_terminal else 160).print(table)
    false = sum(each["false_exclusions"] for each in documents)
    print(f"exclusions of what has no fault: {false}")


def _alert(latest_s: float | None, undetected: int) -> str:
    if undetected:
        return f"{undetected} not found"
    return "" if latest_s is None else f"{latest_s:+.1f} s"
