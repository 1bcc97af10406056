"""Lead against false cautions: each predictor a point, the likely loss a curve over its probability of caution."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_studies.abia.campaign import Plan
from gbas_studies.abia.cautions import caution, judged
from gbas_studies.abia.flights import TICK_S, drawn_flight
from gbas_studies.abia.scoring import Summary, score, summary

CURVE: Final = "likely_loss"
PROBABILITIES: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7)


@dataclass(frozen=True, kw_only=True)
class Tradeoff:
    """Summaries by predictor, and of the likely loss by probability."""

    points: dict[str, Summary]
    curve: dict[float, Summary]


def tradeoff(plan: Plan, *, flights: int, seed: int) -> Tradeoff:
    """Fly, and judge at all probabilities."""
    mask, horizon_s = MaskTable.open_sky(plan.flights.antenna_horizon_rad), plan.prediction.horizon_s
    found = [
        judged(plan.names, drawn_flight(plan.flights, np.random.default_rng([seed, number])), mask, plan.prediction)
        for number in range(flights)
    ]

    def of(name: str) -> Summary:
        return summary(
            [
                score(each.loss, caution(name, each, plan.prediction), tick_s=TICK_S, horizon_s=horizon_s)
                for each in found
            ]
        )

    def at(probability: float) -> Summary:
        on = [each.probability[CURVE] >= probability for each in found]
        scores = [score(each.loss, up, tick_s=TICK_S, horizon_s=horizon_s) for each, up in zip(found, on, strict=True)]
        return summary(scores)

    return Tradeoff(points={name: of(name) for name in plan.names}, curve={each: at(each) for each in PROBABILITIES})


def draw(found: Tradeoff, path: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    curve = list(found.curve.values())
    axes.plot([100 * each.false.value for each in curve], [100 * each.enough.value for each in curve], "o-", color="C0",
              label="likely loss, by probability of caution")  # fmt: skip
    for probability, each in found.curve.items():
        axes.annotate(f"{probability:g}", (100 * each.false.value, 100 * each.enough.value), fontsize=7,
                      xytext=(4, -9), textcoords="offset points")  # fmt: skip
    for name, each in found.points.items():
        if name == CURVE:
            continue
        axes.errorbar(
            100 * each.false.value, 100 * each.enough.value, fmt="s", capsize=2,
            xerr=[[100 * (each.false.value - each.false.low)], [100 * (each.false.high - each.false.value)]],
            yerr=[[100 * (each.enough.value - each.enough.low)], [100 * (each.enough.high - each.enough.value)]],
            label=name.replace("_", " "),
        )  # fmt: skip
    axes.axhline(98.0, color="0.7", lw=0.8)
    axes.axvline(20.0, color="0.7", lw=0.8)
    axes.set(xlabel="false cautions [% of cautions]", ylabel="lead of 2 s or more [% of onsets]")
    axes.legend(fontsize=8, loc="lower right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
