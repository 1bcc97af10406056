"""``gbas study``: sweeps and campaigns beyond the published ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from gbas_cli import study_abia as cli_study_abia
from gbas_cli import study_coverage as cli_study_coverage
from gbas_cli import study_faults as cli_study_faults
from gbas_cli import study_fronts as cli_study_fronts
from gbas_cli import study_gradient as cli_study_gradient
from gbas_cli.base import Json, print_json

if TYPE_CHECKING:
    from gbas_studies.ccd.worst_case import Worst

study_app = typer.Typer(help="Sweeps and campaigns beyond the published ones.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    cli_study_abia.register(study_app)
    cli_study_coverage.register(study_app)
    cli_study_faults.register(study_app)
    cli_study_fronts.register(study_app)
    cli_study_gradient.register(study_app)
    app.add_typer(study_app, name="study")


@study_app.callback()
def top() -> None:
    """Sweeps and campaigns beyond the published ones."""


@study_app.command()
def ccd(
    variant: Annotated[
        str, typer.Option(help="Start of the airborne smoothing filter: 'variant' or 'invariant'.")
    ] = "variant",
    mode: Annotated[
        str, typer.Option(help="Fault mode, such as 'Code L5', 'Code+Carrier L1', 'Code L1, Carrier L5'.")
    ] = "Code L1",
    monitor: Annotated[str, typer.Option(help="gast-d, gast-f-paper or gast-f-sound.")] = "gast-d",
    d_step: Annotated[float, typer.Option(help="Step of the rate of divergence [m/s].")] = 0.01,
    d_max: Annotated[float, typer.Option(help="Largest rate of divergence [m/s].")] = 0.1,
    onset_step: Annotated[float, typer.Option(help="Step of the air filter's start against the onset [s].")] = 1.0,
    onset_max: Annotated[float, typer.Option(help="Its largest value, before and after the onset [s].")] = 150.0,
    delay: Annotated[float, typer.Option(help="Delay to incorporation in the air [s].")] = 50.0,
    exclusion_delay: Annotated[
        float, typer.Option(help="From the monitor's alarm to the exclusion at the user [s]; the paper has none.")
    ] = 0.0,
    ground_age: Annotated[
        float | None,
        typer.Option(help="t_g: from the ground filter's start to the fault's onset [s] (default: it has settled)."),
    ] = None,
    ground_settle: Annotated[
        float,
        typer.Option(help="From the ground filter's start to the first use of the range [s]; the paper has none."),
    ] = 0.0,
    receivers: Annotated[int, typer.Option(help="Reference receivers averaged by the gast-f monitors.", min=1)] = 1,
    error_on: Annotated[
        str | None, typer.Option(help="Error of L1, L5 or IF ranges (default: L1, L5 where only L5 is at fault).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Worst undetected differential error under a code-carrier divergence, and the smallest mapping function.

    max_error_m is the largest error on the grid that is not detected, at d_mps, the air filter started at onset_s.

    min_mapping is the least ratio of statistic to error: F2/E [1/s] for gast-d, non-centrality/E [1/m] for the others.
    """
    from gbas_studies.ccd.monitors import error_on_of
    from gbas_studies.ccd.smoothed_error import Smoothing, start_of
    from gbas_studies.ccd.worst_case import Exclusion, Grid, study, worst_error_any_rate

    grid = Grid(d_step_mps=d_step, d_max_mps=d_max, onset_step_s=onset_step, onset_max_s=onset_max)
    smoothing = Smoothing(
        start=start_of(variant), delay_s=delay, ground_settle_s=ground_settle,
        ground_age_s=float("inf") if ground_age is None else ground_age,
    )  # fmt: skip
    exclusion = Exclusion(error_on=error_on_of(error_on), delay_s=exclusion_delay, receivers=receivers)
    error, mapping, found = study(mode, monitor, smoothing, grid, exclusion)
    anywhere = worst_error_any_rate(found, d_max)
    if as_json:
        print_json(
            {
                "max_error_m": error.value,
                "d_mps": error.d_mps,
                "onset_s": error.onset_s,
                "min_mapping": mapping.value,
                "min_mapping_d_mps": mapping.d_mps,
                "min_mapping_onset_s": mapping.onset_s,
                "max_error_any_rate_m": anywhere.value,
                "max_error_any_rate_d_mps": anywhere.d_mps,
                "max_error_any_rate_onset_s": anywhere.onset_s,
            }
        )
        return
    print(f"{mode}, {variant} filter, {monitor}; times are the air filter's start after the fault's onset")
    _print_worst(error, anywhere, mapping, "1/s" if monitor == "gast-d" else "1/m")


def _print_worst(error: Worst, anywhere: Worst, mapping: Worst, unit: str) -> None:
    rows = {
        "largest undetected error": f"{error.value:.6g} m at {error.d_mps:g} m/s, {error.onset_s:+g} s",
        "the same, any rate": f"{anywhere.value:.6g} m at {anywhere.d_mps:.6g} m/s, {anywhere.onset_s:+g} s",
        "smallest mapping function": f"{mapping.value:.6g} {unit} at {mapping.d_mps:g} m/s, {mapping.onset_s:+g} s",
    }
    for name, value in rows.items():
        print(f"{name:26} {value}")
