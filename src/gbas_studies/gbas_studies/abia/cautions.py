# mypy: disable-error-code="no-untyped-call"
"""What each predictor says at each time of a flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gbas_airborne.abia.airframe.mask_table import BODY_UP, MaskTable
from gbas_airborne.abia.prediction.hypotheses import hypotheses_of
from gbas_airborne.abia.prediction.identification import identification_vector
from gbas_airborne.abia.prediction.look_ahead import antenna_vector, higher, look_vector
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_core.record import BoolArray, FloatArray
from gbas_studies.abia.flights import SKY_S, TICK_S, FlownFlight
from gbas_studies.abia.kernels.cautions import harmless_by_sky, loss_probabilities, seen_counts

TIMES_A_SKY: Final = round(SKY_S / TICK_S)
EVERY: Final = 2
"""Times of a flight from one prediction to the next."""
PERFECT: Final = "perfect_plan"
PERFECT_HORIZON_S: Final = 10.0
BOTH: Final = "margin_or_robust_plan"
NAMES: Final = ("margin", "hold", "roll_rate", "plan", "robust_plan", BOTH, PERFECT, "likely_loss")
"""The predictors, the paper's rule with the robust plan, and the robust plan's bound: the plan is what is flown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """A flight's losses, and the probability of a loss ahead by predictor, (T,) each."""

    loss: BoolArray
    probability: dict[str, FloatArray]


def counted_on(flight: FlownFlight, params: PredictionParams) -> FloatArray:
    """Lines of sight of the satellites that do not set within the horizon, (S, 3, N)."""
    ahead = math.ceil(params.horizon_s / SKY_S)
    later = np.concatenate([flight.los_enu[ahead:], np.repeat(flight.los_enu[-1:], ahead, axis=0)])
    return np.where(np.isfinite(later[:, 2:]), flight.los_enu, np.nan)


def seen(flight: FlownFlight, mask: MaskTable, horizon_rad: float) -> FloatArray:
    """How many satellites are seen at each time, (T,), with another antenna horizon."""
    antenna = antenna_vector(replace(mask, horizon_rad=horizon_rad))
    counts = seen_counts(flight.flown, flight.los_enu, TIMES_A_SKY, mask.blocked, antenna)
    return np.asarray(counts)


def losses(flight: FlownFlight, mask: MaskTable, required: int) -> BoolArray:
    """When fewer satellites are seen than are required, (T,)."""
    return np.asarray(seen(flight, mask, mask.horizon_rad) < required)


def on_the_margin(flight: FlownFlight, mask: MaskTable, params: PredictionParams) -> BoolArray:
    """When the required satellites are seen, no more, and not all of them well above the antenna's horizon, (T,)."""
    exactly = seen(flight, mask, mask.horizon_rad) == params.required_satellites
    low = seen(flight, mask, params.caution_elevation_rad) < params.required_satellites
    return np.asarray(exactly & low)


@dataclass(frozen=True, kw_only=True, eq=False)
class Skies:
    """Lines of sight of satellites that may be counted on, (S, 3, N), and the tilts that cost none, (S, sectors)."""

    los_enu: FloatArray
    harmless_rad: FloatArray


def skies(flight: FlownFlight, mask: MaskTable, params: PredictionParams) -> Skies:
    """What the predictions of a flight share."""
    los = counted_on(flight, params)
    if mask.blocked.any() or mask.axis != BODY_UP:
        return Skies(los_enu=los, harmless_rad=np.empty((len(los), 0)))
    harmless = harmless_by_sky(los, math.sin(mask.horizon_rad), params.required_satellites)
    return Skies(los_enu=los, harmless_rad=harmless)


def probability(
    name: str, flight: FlownFlight, mask: MaskTable, params: PredictionParams, known: dict[tuple[float, float], Skies]
) -> FloatArray:
    """Weight of the ways of flying on that lose too many satellites, at each time, (T,), by a predictor's name.

    known are skies of the flight by antenna horizon and look-ahead; what is missing is added.
    """
    if name == "margin":
        return on_the_margin(flight, mask, params).astype(np.float64)
    if name == PERFECT:
        name, plan_bank = "plan", flight.flown[:, 0]
        params = replace(params, horizon_s=PERFECT_HORIZON_S)
    else:
        plan_bank = flight.plan_bank_rad
    ways = hypotheses_of(name, params)
    mask = higher(mask, ways.horizon_margin_rad)
    key = mask.horizon_rad, params.horizon_s
    if key not in known:
        known[key] = skies(flight, mask, params)
    shared = known[key]
    found = loss_probabilities(
        flight.flown, TICK_S, EVERY, TIMES_A_SKY, np.ascontiguousarray(plan_bank), np.zeros_like(plan_bank), TICK_S,
        ways.kinds, ways.values, look_vector(params, ways.anchor_rad), ways.shifts_s, ways.errors_rad, ways.prior_shift,
        ways.prior_error, identification_vector(params), shared.los_enu, shared.harmless_rad, mask.blocked,
        antenna_vector(mask), params.required_satellites, params.least_weight,
    )  # fmt: skip
    return np.asarray(found)


def threshold(name: str, params: PredictionParams) -> float:
    """Probability from which a predictor cautions."""
    if name in ("margin", PERFECT):
        return 0.5
    return hypotheses_of(name, params).caution_weight


def judged(names: tuple[str, ...], flight: FlownFlight, mask: MaskTable, params: PredictionParams) -> Judged:
    """All of them for one flight."""
    known: dict[tuple[float, float], Skies] = {}
    found = {name: probability(name, flight, mask, params, known) for name in names if name != BOTH}
    return Judged(loss=losses(flight, mask, params.required_satellites), probability=found)


def caution(name: str, found: Judged, params: PredictionParams) -> BoolArray:
    """When a predictor cautions, (T,)."""
    if name == BOTH:
        return caution("margin", found, params) | caution("robust_plan", found, params)
    result: BoolArray = found.probability[name] >= threshold(name, params)
    return result
