"""Many random flights, and what the cautions of each predictor are worth on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_studies.abia.cautions import NAMES, caution, judged
from gbas_studies.abia.flights import TICK_S, FlightParams, drawn_flight
from gbas_studies.abia.scoring import Score, Summary, score, summary
from gbas_studies.campaign import Campaign, Execution, run

DEFAULT_REQUIRED = 5
"""Satellites without which navigation is lost here: a position with the clocks of two systems, or one of one system
whose faults are seen. The paper's four are lost too rarely for figures of a thousand flights."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What flies, and what predicts.

    Attributes
    ----------
    flights : FlightParams
    prediction : PredictionParams
        Of all predictors.
    names : tuple of str
        Predictors, of :data:`~.cautions.NAMES`.
    """

    flights: FlightParams
    prediction: PredictionParams
    names: tuple[str, ...] = NAMES


def _prepare(plan: Plan) -> tuple[Plan, MaskTable]:
    return plan, MaskTable.open_sky(plan.flights.antenna_horizon_rad)


def _fly(context: tuple[Plan, MaskTable], number: int, seed: np.random.SeedSequence) -> dict[str, Score]:
    plan, mask = context
    flight = drawn_flight(plan.flights, np.random.default_rng(seed))
    found = judged(plan.names, flight, mask, plan.prediction)
    return {
        name: score(
            found.loss, caution(name, found, plan.prediction), tick_s=TICK_S, horizon_s=plan.prediction.horizon_s
        )
        for name in plan.names
    }


def run_campaign(plan: Plan, *, flights: int, seed: int, execution: Execution | None = None) -> dict[str, Summary]:
    """Fly so many flights, each with a seed of its own, and put each predictor's scores together."""
    campaign = Campaign(
        study="abia", settings=plan, trials=range(flights), prepare=_prepare, run_trial=_fly, result=dict[str, Score],
        seed=seed, batch=8,
    )  # fmt: skip
    scores = run(campaign, execution)
    return {name: summary([each[name] for each in scores]) for name in plan.names}


def as_json(summaries: dict[str, Summary]) -> dict[str, Sequence[dict[str, Any]]]:
    """Shares and percentiles by predictor; missing ones (no onset) are None."""
    return {
        "predictors": [
            {
                "name": name,
                "onsets": each.onsets,
                "lead_ge_2s": _number(each.enough.value),
                "missed": _number(each.missed.value),
                "false_share": _number(each.false.value),
                "lead_s": {"p5": _number(each.lead_p5_s), "p50": _number(each.lead_p50_s)},
            }
            for name, each in summaries.items()
        ]
    }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
