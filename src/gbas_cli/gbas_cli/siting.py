"""``gbas siting``: where reference receivers should stand to see every ionosphere gradient, and what given ones see."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from gbas_cli.base import Json, ListsCommand, print_json
from gbas_core.errors import GbasError

if TYPE_CHECKING:
    from gbas_siting.search import Siting

MM_PER_KM: Final = 1.0e6
"""Millimetres a kilometre in one metre a metre."""
_SIGNALS: Final = {"L1": ("L1",), "L5": ("L5",), "L1+L5": ("L1", "L5")}


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(cls=ListsCommand)(siting)


def siting(
    receivers: Annotated[
        int | None, typer.Option(metavar="N", help="Place receivers: how many in all, existing ones included.")
    ] = None,
    existing: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y [...]", help="Receivers that stay, metres east and north; the first is the reference."
        ),
    ] = None,
    runway_bearing: Annotated[
        float | None, typer.Option(metavar="DEG", help="True bearing of the runway (default: 90, along x).")
    ] = None,
    baselines: Annotated[
        str | None, typer.Option(metavar="star|all", help="Baselines of the first receiver, or all (default: star).")
    ] = None,
    tolerance_m: Annotated[
        float | None, typer.Option(metavar="M", help="A new receiver may stand this far off; worst case (default: 0).")
    ] = None,
    max_length_m: Annotated[
        float | None, typer.Option(metavar="M", help="Farthest from the first receiver (default: 500, or existing).")
    ] = None,
    baselines_m: Annotated[
        str | None, typer.Option(metavar="B[,B...]", help="Judge baselines of these lengths instead of placing any.")
    ] = None,
    sigma_m: Annotated[
        str | None, typer.Option(metavar="S[,S...]", help="Double-difference sigma, one for all or one a baseline.")
    ] = None,
    angles_deg: Annotated[
        str | None, typer.Option(metavar="A[,A...]", help="Angle of each baseline to the runway (default: 0).")
    ] = None,
    fuse: Annotated[
        str | None, typer.Option(metavar="any|all", help="Detected by one baseline, or by all (default: any).")
    ] = None,
    gradients: Annotated[str, typer.Option(metavar="LOW,HIGH", help="Range to be detected, in mm/km.")] = "300,2000",
    k: Annotated[float | None, typer.Option(metavar="K", help="k_ffd + k_md (default: 7.6096, 1e-4 each).")] = None,
    signal: Annotated[str, typer.Option(metavar="L1|L5|L1+L5", help="Carriers that are monitored.")] = "L1",
    as_json: Json = False,
) -> None:
    """Where reference receivers should stand to see every ionosphere gradient, or what given baselines see.

    With --receivers: the places that allow the largest sigma of the double-difference carrier with every gradient
    detected, and a proof how much more any other places could allow. With --baselines-m and --sigma-m: the share of
    the gradients that is detected, and the blind intervals. Sigmas are those of the double difference: twice a
    receiver's.
    """
    placing = {
        "--existing": existing, "--runway-bearing": runway_bearing, "--baselines": baselines,
        "--tolerance-m": tolerance_m, "--max-length-m": max_length_m,
    }  # fmt: skip
    judging = {"--sigma-m": sigma_m, "--angles-deg": angles_deg, "--fuse": fuse}
    if (receivers is None) == (baselines_m is None):
        raise GbasError("siting: give --receivers N to place receivers, or --baselines-m B,... to judge baselines")
    common = {"gradient_range": gradients_of(gradients), "k": _k(k), "bands": _bands(signal)}
    if receivers is not None:
        _only("--receivers", judging)
        _place({"n_receivers": receivers, **_placing(receivers, **_named(placing)), **common}, signal, as_json)
        return
    _only("--baselines-m", placing)
    _judge(str(baselines_m), sigma_m, angles_deg, fuse or "any", common, as_json)


def _only(form: str, others: dict[str, Any]) -> None:
    for option, value in others.items():
        if value is not None:
            raise GbasError(f"{option} has no meaning with {form}")


def _named(options: dict[str, Any]) -> dict[str, Any]:
    return {option.strip("-").replace("-", "_"): value for option, value in options.items()}


# --- options


def numbers_of(option: str, text: str, bound: str = "numbers separated by commas, without blanks") -> tuple[float, ...]:
    """The numbers in an option; complains of anything else."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    check(option, text, bool(values) and all(math.isfinite(value) for value in values), bound)
    return values


def check(option: str, value: Any, good: bool, bound: str) -> None:
    """Complain unless an option's value is good: one line with option, value and bound."""
    if not good:
        raise GbasError(f"{option} is {value}: must be {bound}")


def gradients_of(text: str) -> tuple[float, float]:
    """A range of gradients in mm/km [m/m]."""
    bound = "LOW,HIGH in mm/km, with 0 < LOW < HIGH, at most 100000"
    values = numbers_of("--gradients", text, bound)
    check("--gradients", text, len(values) == 2 and 0.0 < values[0] < values[1] <= 1.0e5, bound)
    return values[0] / MM_PER_KM, values[1] / MM_PER_KM


def _k(value: float | None) -> float:
    from gbas_ground.monitors.gradient_detectability import k_factor

    if value is None:
        return k_factor()
    check("--k", value, 0.0 < value <= 100.0, "above 0, at most 100")
    return value


def _bands(signal: str) -> tuple[int, ...]:
    from gbas_core.signals import BAND_INDEX

    check("--signal", signal, signal in _SIGNALS, "L1, L5 or L1+L5")
    return tuple(BAND_INDEX[name] for name in _SIGNALS[signal])


def _placing(
    receivers: int,
    *,
    existing: list[str] | None,
    runway_bearing: float | None,
    baselines: str | None,
    tolerance_m: float | None,
    max_length_m: float | None,
) -> dict[str, Any]:
    from gbas_siting.problem import MAX_RECEIVERS

    positions = tuple(_position(text) for text in existing or ())
    check("--receivers", receivers, 2 <= receivers <= MAX_RECEIVERS, f"2 to {MAX_RECEIVERS}")
    fewest = f"at least the number of --existing receivers, {len(positions)}"
    check("--receivers", receivers, receivers >= len(positions), fewest)
    bearing = 90.0 if runway_bearing is None else runway_bearing
    check("--runway-bearing", bearing, -360.0 <= bearing <= 360.0, "-360 to 360 degrees")
    kind = baselines or "star"
    check("--baselines", kind, kind in ("star", "all"), "star or all")
    tolerance = 0.0 if tolerance_m is None else tolerance_m
    check("--tolerance-m", tolerance, 0.0 <= tolerance <= 100.0, "0 to 100 m")
    if max_length_m is not None:
        check("--max-length-m", max_length_m, 0.0 < max_length_m <= 1.0e4, "above 0, at most 10000 m")
    return {
        "existing_m": positions,
        "runway_bearing_rad": math.radians(bearing),
        "baselines": kind,
        "tolerance_m": tolerance,
        "max_length_m": max_length_m,
    }


def _position(text: str) -> tuple[float, float]:
    bound = "X,Y in metres, within 100 km of the origin"
    values = numbers_of("--existing", text, bound)
    check("--existing", text, len(values) == 2 and all(abs(value) <= 1.0e5 for value in values), bound)
    return values[0], values[1]


# --- placing


def _place(arguments: dict[str, Any], signal: str, as_json: bool) -> None:
    from gbas_bringup.progress import progress
    from gbas_siting.problem import SitingProblem
    from gbas_siting.search import best_siting

    with progress("searching", enabled=not as_json):
        best = best_siting(SitingProblem(**arguments))
    if best.statistic_m == 0.0:
        raise GbasError("siting: no places within --tolerance-m and --max-length-m detect every gradient")
    if as_json:
        print_json(_siting_document(best, signal))
        return
    _print_siting(best, signal)


def _siting_document(best: Siting, signal: str) -> dict[str, Any]:
    import numpy as np

    problem = best.problem
    low, high = problem.gradient_range
    return {
        "sigma_m": best.sigma_m,
        "length_m": best.length_m,
        "positions_m": np.round(problem.positions_m(best.new_m), 9).tolist(),
        "detectability": best.detectability_percent,
        "sigma_receiver_m": 0.5 * best.sigma_m,
        "along_runway_m": problem.places_m(best.new_m[None])[0].tolist(),
        "baselines": [
            {"receivers": [int(first) + 1, int(second) + 1], "length_m": float(length)}
            for (first, second), length in zip(problem.pairs, best.baselines_m, strict=True)
        ],
        "worst_gradient_mm_per_km": best.worst_gradient * MM_PER_KM,
        "certificate": {
            "sigma_bound_m": best.sigma_bound_m,
            "sigma_gap_m": best.sigma_bound_m - best.sigma_m,
            "closed": best.closed,
            "length_limited": best.length_limited,
            "evaluations": best.evaluations,
        },
        "problem": {
            "receivers": problem.n_receivers,
            "existing": len(problem.existing_m),
            "runway_bearing_deg": math.degrees(problem.runway_bearing_rad),
            "gradients_mm_per_km": [low * MM_PER_KM, high * MM_PER_KM],
            "k": problem.k,
            "baselines": problem.baselines,
            "tolerance_m": problem.tolerance_m,
            "max_length_m": problem.length_limit_m,
            "signal": signal,
        },
    }


def _print_siting(best: Siting, signal: str) -> None:
    problem = best.problem
    low, high = (gradient * MM_PER_KM for gradient in problem.gradient_range)
    kind = "all baselines" if problem.baselines == "all" else "baselines of receiver 1"
    print(f"{problem.n_receivers} receivers, {kind}, {signal}, gradients {low:g} to {high:g} mm/km, k {problem.k:.5g}")
    if problem.tolerance_m:
        print(f"new receivers anywhere within {problem.tolerance_m:g} m of these places")
    print()
    print(f"sigma, double difference  {best.sigma_m * 1e3:.3f} mm: the largest with every gradient detected")
    print(f"sigma, each receiver      {best.sigma_m * 5e2:.3f} mm")
    print(f"no other places allow     {best.sigma_bound_m * 1e3:.3f} mm{_proof(best)}")
    limited = ": the length limit binds" if best.length_limited else ""
    print(f"longest baseline          {best.length_m:.2f} m along the runway{limited}")
    print(f"worst gradient            {best.worst_gradient * MM_PER_KM:.1f} mm/km")
    rows = [
        (str(number + 1), "stays" if number < len(problem.existing_m) else "new", *(f"{each:.2f}" for each in numbers))
        for number, numbers in enumerate(
            (along, *position)
            for along, position in zip(
                problem.places_m(best.new_m[None])[0], problem.positions_m(best.new_m), strict=True
            )
        )
    ]
    _print_table(("receiver", "", "along the runway [m]", "x, east [m]", "y, north [m]"), rows)


def _proof(best: Siting) -> str:
    if best.closed:
        return " (proved: nothing better exists)"
    return f": the search ended before it was closed, a gap of {100.0 * (best.bound_m / best.statistic_m - 1.0):.2g} %"


# --- judging


def _judge(
    baselines: str, sigma: str | None, angles: str | None, fuse: str, common: dict[str, Any], as_json: bool
) -> None:
    from gbas_ground.monitors import gradient_detectability as detectability
    from gbas_siting.worst_gradient import worst_gradient

    if sigma is None:
        raise GbasError("siting: --sigma-m is missing: the double-difference sigma in metres")
    check("--fuse", fuse, fuse in ("any", "all"), "any or all")
    lengths = numbers_of("--baselines-m", baselines)
    good = all(0.0 < length <= 1.0e5 for length in lengths)
    check("--baselines-m", baselines, good, "above 0, at most 100000 m each")
    turned = as_many("--angles-deg", angles or "0", len(lengths))
    sigmas = as_many("--sigma-m", sigma, len(lengths))
    check("--sigma-m", sigma, all(0.0 < each <= 1.0 for each in sigmas), "above 0, at most 1 m each")
    along = [length * abs(math.cos(math.radians(angle))) for length, angle in zip(lengths, turned, strict=True)]
    monitors = [
        detectability.BaselineMonitor(length_m=length, sigma_m=each, band=band)
        for band in common["bands"]
        for length, each in zip(along, sigmas, strict=True)
    ]
    terms = {"fuse": fuse, "gradient_range": common["gradient_range"]}
    k = common["k"]
    blind = detectability.blind_intervals(monitors, k, **terms) * MM_PER_KM
    coverage = detectability.coverage_percent(monitors, k, **terms)
    # In units of each baseline's own sigma: by how much all sigmas may grow, or must shrink, for full coverage.
    ratio = (
        worst_gradient(
            [each.slope_m / each.sigma_m for each in monitors],
            [each.wavelength_m / each.sigma_m for each in monitors],
            common["gradient_range"],
        ).statistic_m
        / k
    )
    if as_json:
        document = {
            "coverage_percent": coverage,
            "detectability": coverage,
            "blind_intervals_mm_per_km": blind.tolist(),
            "fuse": fuse,
            "baselines_m": list(lengths),
            "angles_deg": list(turned),
            "along_runway_m": along,
            "sigma_m": list(sigmas),
            "gradients_mm_per_km": [gradient * MM_PER_KM for gradient in common["gradient_range"]],
            "k": k,
        }
        if fuse == "any":
            document["sigma_for_full_coverage_m"] = [float(ratio) * each for each in sigmas]
        print_json(document)
        return
    low, high = (gradient * MM_PER_KM for gradient in common["gradient_range"])
    print(f"{coverage:.2f} % of {low:g} to {high:g} mm/km is detected by {_by(fuse, len(monitors))}")
    if fuse == "any":
        largest = ", ".join(f"{1e3 * float(ratio) * each:.3f}" for each in dict.fromkeys(sigmas))
        print(f"every gradient is detected up to a sigma of {largest} mm")
    rows = [(f"{first:.2f}", f"{last:.2f}", f"{last - first:.2f}") for first, last in blind]
    if rows:
        _print_table(("blind from [mm/km]", "to", "width"), rows)


def _by(fuse: str, count: int) -> str:
    if count == 1:
        return "the baseline"
    return f"at least one of {count} baselines" if fuse == "any" else f"all of {count} baselines at once"


def as_many(option: str, text: str, count: int) -> tuple[float, ...]:
    """Numbers, one for each baseline; a single one is that of all."""
    values = numbers_of(option, text)
    check(option, text, len(values) in (1, count), f"one number, or one for each of the {count} baselines")
    return values if len(values) == count else values * count


def _print_table(headings: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    print()
    table = Table(box=None, pad_edge=False)
    for heading in headings:
        # Text, so that the unit in brackets is not read as markup.
        table.add_column(Text(heading), justify="left" if heading in ("receiver", "") else "right")
    for row in rows:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 100, highlight=False).print(table)
