"""Prediction of one epoch: what is believed of the flight ahead, and whether that is cause for caution.

Fail-safe: without attitude or satellites nothing is predicted and the prediction is not available; without a plan, or
beyond its end, a predictor that needs one is replaced by the one that needs none, and that is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.hypotheses import NEEDS_PLAN, Hypotheses, hypotheses_of
from gbas_airborne.abia.prediction.identification import identified
from gbas_airborne.abia.prediction.look_ahead import Outcome, look_ahead, seen_at, usable_los
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_core.record import BoolArray, FloatArray

WITHOUT_PLAN: Final = "roll_rate"
NO_ATTITUDE: Final = "no_attitude"
NO_SATELLITES: Final = "no_satellites"
NO_PLAN: Final = "no_plan"
_LONGEST_GAP_S: Final = 1.0  # after which what was identified is of another time


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionEpoch:
    """What is known at one time.

    Attributes
    ----------
    time_s : float
        Of the attitude, on the time scale of the plan [s].
    attitude : Attitude
    plan : AttitudePlan or None
    los_enu : (3, N) array
        Unit vectors to the satellites that could be used, in local axes; NaN for one that has no ephemeris or is not
        to be used.
    mask : MaskTable
        What the airframe hides.
    setting : (N,) bool array or None
        Satellites that will be below the elevation mask at the end of the horizon, which are not counted on: lines of
        sight are those of now. None: not looked at.
    """

    time_s: float
    attitude: Attitude
    plan: AttitudePlan | None
    los_enu: FloatArray
    mask: MaskTable
    setting: BoolArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionState:
    """What is remembered: when it was predicted last, and the weights of the ways of flying the plan."""

    time_s: float = math.nan
    weights: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What is predicted.

    Attributes
    ----------
    available : bool
        False: nothing is known of what comes, and everything else is missing.
    restriction : str
        Why it is not available, or by less than was asked for; empty: nothing.
    predictor : str
        By which it was made.
    caution : bool
        Whether the loss of too many satellites is to be cautioned of.
    probability : float
        Weight of the ways of flying on with such a loss [-].
    loss_s : float
        Time to the soonest of these losses, infinite without any [s].
    seen : (N,) bool array
        Satellites seen now.
    satellite_probability, satellite_loss_s : (N,) arrays
        The same of each satellite seen now.
    outcome : Outcome or None
        What comes of each way of flying on.
    """

    available: bool
    restriction: str
    predictor: str
    caution: bool
    probability: float
    loss_s: float
    seen: BoolArray
    satellite_probability: FloatArray
    satellite_loss_s: FloatArray
    outcome: Outcome | None = None


def predict(
    state: PredictionState, epoch: PredictionEpoch, params: PredictionParams
) -> tuple[PredictionState, Prediction]:
    """Advance the identification by one epoch and look ahead."""
    los = usable_los(epoch.los_enu, params.elevation_mask_rad)
    if not epoch.attitude.is_known or not math.isfinite(epoch.time_s):
        return PredictionState(), _unavailable(NO_ATTITUDE, params, los.shape[1])
    if not np.isfinite(epoch.los_enu).all(axis=0).any():
        return PredictionState(), _unavailable(NO_SATELLITES, params, los.shape[1])
    ways, name, plan = _ways(epoch, params)
    values = ways.values
    weights = _weights(state, epoch, ways, plan, params)
    if weights is not None:
        values = np.column_stack([ways.values[:, :2], weights])
    staying = los if epoch.setting is None else np.where(epoch.setting, np.nan, los)
    outcome = look_ahead(ways, values, (epoch.time_s, epoch.attitude, plan), (staying, epoch.mask), params)
    return PredictionState(time_s=epoch.time_s, weights=weights), _judged(outcome, ways, name, epoch, params)


def _unavailable(why: str, params: PredictionParams, satellites: int) -> Prediction:
    nothing = np.full(satellites, np.nan)
    return Prediction(
        available=False, restriction=why, predictor=params.predictor, caution=False, probability=math.nan,
        loss_s=math.nan, seen=np.zeros(satellites, dtype=bool), satellite_probability=nothing, satellite_loss_s=nothing,
    )  # fmt: skip


def _ways(epoch: PredictionEpoch, params: PredictionParams) -> tuple[Hypotheses, str, AttitudePlan | None]:
    """Hypotheses of the predictor asked for, or of the one that needs no plan where the plan does not reach."""
    ways = hypotheses_of(params.predictor, params)
    if params.predictor not in NEEDS_PLAN:
        return ways, params.predictor, None
    plan = epoch.plan
    if plan is not None and plan.covers(epoch.time_s, epoch.time_s + params.horizon_s):
        return ways, params.predictor, plan
    return hypotheses_of(WITHOUT_PLAN, params), WITHOUT_PLAN, None


def _weights(
    state: PredictionState, epoch: PredictionEpoch, ways: Hypotheses, plan: AttitudePlan | None,
    params: PredictionParams,
) -> FloatArray | None:  # fmt: skip
    """Weights of a grid of ways of flying the plan; None without a grid."""
    if plan is None or not ways.shifts_s.size:
        return None
    elapsed_s = epoch.time_s - state.time_s
    if state.weights is None or not 0.0 < elapsed_s <= _LONGEST_GAP_S:
        return ways.values[:, 2]
    return identified(state.weights, ways, epoch.attitude.bank_rad, plan, (epoch.time_s, elapsed_s), params)


def _judged(
    outcome: Outcome, ways: Hypotheses, name: str, epoch: PredictionEpoch, params: PredictionParams
) -> Prediction:
    los = usable_los(epoch.los_enu, params.elevation_mask_rad)
    attitude = epoch.attitude
    seen = seen_at(np.array([attitude.bank_rad, attitude.pitch_rad, attitude.heading_rad]), los, epoch.mask)
    probability, soonest_s = outcome.probability, outcome.soonest_s
    caution = probability >= ways.caution_weight
    if params.margin_rule or name == "margin":
        caution = caution or _on_the_margin(seen, epoch, los, params)
    weight, loss_s = outcome.satellites()
    return Prediction(
        available=True,
        restriction=NO_PLAN if name != params.predictor else "",
        predictor=name,
        caution=bool(caution),
        probability=probability,
        loss_s=soonest_s,
        seen=seen,
        satellite_probability=np.where(seen, weight, 0.0),
        satellite_loss_s=np.where(seen, loss_s, np.inf),
        outcome=outcome,
    )


def _on_the_margin(seen: BoolArray, epoch: PredictionEpoch, los: FloatArray, params: PredictionParams) -> bool:
    """As many satellites as required are seen, and one of them is low in the antenna's frame.

    Source: Sabatini et al., IV.H: with exactly four, below 10 degrees is caution.
    """
    if int(seen.sum()) != params.required_satellites:
        return False
    attitude = np.array([epoch.attitude.bank_rad, epoch.attitude.pitch_rad, epoch.attitude.heading_rad])
    low = MaskTable(
        blocked=epoch.mask.blocked,
        horizon_rad=max(params.caution_elevation_rad, epoch.mask.horizon_rad),
        axis=epoch.mask.axis,
    )
    return bool((seen & ~seen_at(attitude, los, low)).any())
