"""``gbas study coverage``: which gradients a station's monitor detects on the satellites of a day, by elevation."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from gbas_cli.base import Json, print_json
from gbas_cli.campaign_options import Results, Scheduler, Workers, execution
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_studies.asigm.coverage import Bin


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(coverage)


def coverage(
    scenario: Annotated[str, typer.Option(help="Station and satellites: a .yaml file, or a name.")] = "braunschweig",
    receivers: Annotated[str, typer.Option(metavar="R[,R...]", help="Receivers used, from rr1 on.")] = "4,3,2",
    paper: Annotated[bool, typer.Option("--paper", help="With the paper's k_ffd, 3.8906, not the station's.")] = False,
    step: Annotated[float, typer.Option(metavar="S", help="Between the epochs of the day, in s.")] = 600.0,
    repetitions: Annotated[int, typer.Option(help="Monte Carlo runs of each epoch.", min=1, max=10_000)] = 4,
    seed: Annotated[int, typer.Option(help="Of the Monte Carlo run.", min=0)] = 1,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Results = None,
    as_json: Json = False,
) -> None:
    """Coverage of the gradient monitor, satellite by satellite over a day, and what a Monte Carlo run detects.

    covered: share of 300 to 2000 mm/km (or the station's range) along the runway that is detected with k_ffd + k_md;
    none: share of satellites of which nothing is. detected: share of random gradients that the monitor detected in
    noise. missed: covered gradients that it did not detect; P_md of them is allowed.
    """
    from gbas_bringup.resources import named_config
    from gbas_core.signals import L1, L5
    from gbas_ground.params import GroundParams
    from gbas_sim.scenario import read_sections, scenario_from_yaml
    from gbas_studies.asigm import coverage as studied

    if not 10.0 <= step <= 21_600.0:
        raise GbasError(f"--step {step:g} is not within 10 to 21600 s")
    path = named_config(scenario)
    station = GroundParams.from_mapping(read_sections(path)["ground"], source=str(path))
    counts = _receivers(receivers, station.n_receivers)
    elevation = studied.elevations_of_a_day(station, scenario_from_yaml(path), step)
    stations = {}
    for count in counts:
        for name, bands in (("L1", (L1,)), ("L1+L5", (L1, L5))):
            site, params = studied.site_with(station, count, bands)
            stations[f"{count} receivers, {name}"] = (studied.papers_multiplier(site) if paper else site, params)
    multipliers = {name: [each.k_ffd for each in site.tests] for name, (site, _) in stations.items()}
    k_md = site.k_md
    elevation = studied.elevations_of_a_day(station, scenario_from_yaml(path), step)
    day = studied.Day(elevation_rad=elevation, stations=stations, repetitions=repetitions)
    with execution("injecting", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
        tables = studied.study(day, seed=seed, execution=how)
    if as_json:
        print_json(
            {
                "tables": {name: [asdict(each) for each in rows] for name, rows in tables.items()},
                "k_ffd": multipliers,
                "k_md": k_md,
            }
        )
        return
    for name, rows in tables.items():
        _print(f"{name}; k_ffd {', '.join(f'{k:.2f}' for k in multipliers[name])}, k_md {k_md:.2f}", rows)


def _receivers(text: str, most: int) -> list[int]:
    try:
        counts = [int(each) for each in text.split(",")]
    except ValueError:
        raise GbasError(f"--receivers {text!r} is not whole numbers with commas between them") from None
    if not all(2 <= each <= most for each in counts):
        raise GbasError(f"--receivers {text} is not within 2 to {most}, the receivers of the station")
    return counts


def _print(title: str, rows: list[Bin]) -> None:
    print(title)
    print(f"{'elevation':>10} {'satellites':>10} {'none':>7} {'covered':>8} {'least':>7} {'detected':>9}  missed")
    for row in rows:
        if not row.samples:
            continue
        print(
            f"{row.low_deg:4.0f}-{row.high_deg:2.0f} deg {row.samples:10d} {row.unmonitored_percent:6.1f}% "
            f"{row.coverage_percent:7.1f}% {row.least_percent:6.1f}% {row.detected_percent:8.1f}%  "
            f"{row.missed} of {row.covered}"
        )
    alarms, quiet = sum(row.false_alarms for row in rows), sum(row.quiet for row in rows)
    print(f"failed without a gradient: {alarms} of {quiet}\n")
