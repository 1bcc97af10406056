"""``gbas study gradient``: what a gradient monitor detects under noise, over a range of gradients."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from gbas_cli.base import Json, print_json
from gbas_cli.campaign_options import Results, Scheduler, Workers, execution
from gbas_cli.siting import MM_PER_KM, as_many, check, gradients_of, numbers_of


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(gradient)


def gradient(
    baselines_m: Annotated[str, typer.Option(metavar="B[,B...]", help="Baselines of the first receiver, in metres.")],
    sigma_m: Annotated[float, typer.Option(metavar="S", help="Sigma of the double difference, in metres.")],
    angles_deg: Annotated[str, typer.Option(metavar="A[,A...]", help="Angle of each baseline to the runway.")] = "0",
    gradients: Annotated[str, typer.Option(metavar="LOW,HIGH", help="Range, in mm/km.")] = "300,2000",
    step: Annotated[float, typer.Option(metavar="G", help="Step of the gradients, in mm/km.")] = 1.0,
    p_false_alarm: Annotated[float, typer.Option(metavar="P", help="Of one baseline.")] = 1e-4,
    trials: Annotated[int, typer.Option(metavar="N", help="Of the Monte Carlo run.")] = 1_000_000,
    seed: Annotated[int, typer.Option(help="Of the Monte Carlo run.", min=0)] = 1,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Results = None,
    as_json: Json = False,
) -> None:
    """False alarms and missed detections of the L1 gradient monitor, by an integral and by Monte Carlo.

    A gradient is detected when one baseline or more alerts. Receivers have equal, independent noise, so that the
    baselines share that of the first. `gbas siting --baselines-m` says which gradients are detected with certainty.
    """
    low, high = gradients_of(gradients)
    lengths = numbers_of("--baselines-m", baselines_m)
    check("--baselines-m", baselines_m, all(0.0 < each <= 1e5 for each in lengths), "above 0, at most 100000 m each")
    angles = as_many("--angles-deg", angles_deg, len(lengths))
    along = tuple(b * abs(math.cos(math.radians(angle))) for b, angle in zip(lengths, angles, strict=True))
    check("--sigma-m", sigma_m, 0.0 < sigma_m <= 0.02, "above 0, at most 0.02 m")
    steps = (high - low) * MM_PER_KM / step if step > 0.0 else math.inf
    check("--step", step, 1.0 <= steps <= 1e5, "above 0, with 1 to 100000 steps in the range")
    check("--p-false-alarm", p_false_alarm, 0.0 < p_false_alarm < 1.0, "between 0 and 1")
    check("--trials", trials, 1000 <= trials <= 10**9, "1000 to 1000000000")

    from gbas_studies.asigm.noise import Star, sweep

    star = Star(lengths_m=along, sigma_m=sigma_m, p_false_alarm=p_false_alarm)
    with execution("drawing", workers=workers, scheduler=scheduler, out=out, quiet=as_json) as how:
        found = sweep(star, (low, high), round(steps), trials, seed, how)
    worst = int(found.missed.argmax())
    if as_json:
        print_json(
            {
                "p_false_alarm": found.p_false_alarm,
                "worst_p_missed_detection": float(found.missed[worst]),
                "worst_gradient_mm_per_km": float(found.gradients[worst]) * MM_PER_KM,
                "detected_percent": found.detected_percent,
                "simulated_percent": found.simulated_percent,
                "simulated_deviation_percent": found.deviation_percent,
                "threshold_m": star.threshold_m,
                "along_runway_m": list(along),
                "gradients_mm_per_km": (found.gradients * MM_PER_KM).tolist(),
                "p_missed_detection": found.missed.tolist(),
            }
        )
        return
    rows = {
        "threshold": f"{star.threshold_m * 1e3:.3f} mm from a multiple of the wavelength",
        "false alarm": f"{found.p_false_alarm:.3g}, any baseline, no gradient",
        "worst missed detection": f"{found.missed[worst]:.3g}, at {found.gradients[worst] * MM_PER_KM:.1f} mm/km",
        "detected": f"{found.detected_percent:.4f} % of {low * MM_PER_KM:g} to {high * MM_PER_KM:g} mm/km",
        "Monte Carlo": f"{found.simulated_percent:.4f} +- {found.deviation_percent:.4f} % of {trials} random gradients",
    }
    for name, value in rows.items():
        print(f"{name:23} {value}")
