"""``gbas study abia``: how early, how often wrongly and how seldom too late an aircraft is cautioned."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from gbas_cli.base import Json, print_json
from gbas_cli.campaign_options import Results, Scheduler, Workers, execution
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_studies.abia.guided import Plan as GuidedPlan
    from gbas_studies.abia.scoring import Interval, Summary


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(abia)


def abia(
    flights: Annotated[int, typer.Option(help="Random flights.", min=1, max=1_000_000)] = 1000,
    seed: Annotated[int, typer.Option(help="Of the flights.", min=0)] = 1,
    required: Annotated[int, typer.Option(help="Satellites below which navigation is lost.", min=4, max=12)] = 5,
    minutes: Annotated[float, typer.Option(help="Of each flight.", min=1.0, max=600.0)] = 25.0,
    guidance: Annotated[
        str | None,
        typer.Option(
            metavar="AIRCRAFT", help="Fly with and without guidance instead: fighter, airliner or uav, 100 s a flight."
        ),
    ] = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Results = None,
    as_json: Json = False,
) -> None:
    """Fly random turns with errors of the plan, and compare predictors of the losses they cause.

    lead_ge_2s: share of onsets of a loss with a caution 2 s or more before; missed: with none before; false_share: of
    cautions, those no loss follows within the horizon or while they are on. Without --json with 95 % intervals.
    """
    from gbas_airborne.abia.prediction.params import PredictionParams
    from gbas_studies.abia import campaign
    from gbas_studies.abia.flights import FlightParams
    from gbas_studies.abia.guided import run_guided, table

    if guidance is not None:
        guided = _guided_plan(guidance, required)
        with execution("flying", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
            print_json({guidance: table(run_guided(guided, flights=flights, seed=seed, execution=how))})
        return
    plan = campaign.Plan(
        flights=FlightParams(duration_s=60.0 * minutes), prediction=PredictionParams(required_satellites=required)
    )
    with execution("flying", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
        summaries = campaign.run_campaign(plan, flights=flights, seed=seed, execution=how)
    if as_json:
        print_json(campaign.as_json(summaries))
    else:
        _print(summaries)


def _guided_plan(aircraft: str, required: int) -> GuidedPlan:
    from gbas_airborne.abia.prediction.params import PredictionParams
    from gbas_studies.abia.guided import AIRCRAFT, Plan

    if aircraft not in AIRCRAFT:
        raise GbasError(f"--guidance {aircraft!r} is not one of {', '.join(AIRCRAFT)}")
    return Plan(aircraft=aircraft, prediction=PredictionParams(required_satellites=required))


def _print(summaries: dict[str, Summary]) -> None:
    print(f"{'predictor':22} {'onsets':>6} {'lead >= 2 s':>20} {'missed':>20} {'false':>20} {'lead p5, p50':>13}")
    for name, each in summaries.items():
        shares = " ".join(f"{_share(of):>20}" for of in (each.enough, each.missed, each.false))
        print(f"{name:22} {each.onsets:6d} {shares} {each.lead_p5_s:6.1f} {each.lead_p50_s:4.1f} s")


def _share(of: Interval) -> str:
    return f"{100 * of.value:.1f} ({100 * of.low:.1f}-{100 * of.high:.1f}) %"
