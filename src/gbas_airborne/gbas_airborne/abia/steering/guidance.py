"""The choice of a way to fly on, and the steering that follows from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gbas_airborne.abia.prediction.hypotheses import Hypotheses
from gbas_airborne.abia.prediction.kernels.trajectories import PLAN
from gbas_airborne.abia.prediction.look_ahead import Outcome, look_ahead, seen_at, usable_los
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import Prediction, PredictionEpoch
from gbas_airborne.abia.steering.candidates import Candidate, candidates
from gbas_airborne.abia.steering.params import SteeringParams

_ON_PLAN: Final = "on_plan"


@dataclass(frozen=True, kw_only=True, eq=False)
class Steering:
    """What to fly.

    Attributes
    ----------
    commanded : bool
        False: nothing is commanded, and the rest is missing.
    reason : str
        Why nothing is commanded, or what is: ``avoid`` a loss, ``recover`` from one.
    kind : str
        Of the candidate.
    keeps : bool
        Whether the satellites are kept over the horizon, with the margin for errors of attitude; after a loss, whether
        they come back within it.
    bank_rad, speed_mps : float
        Commands of now: bank one second ahead, and speed.
    plan : AttitudePlan or None
        The alternate plan.
    change_rad : float
        Its largest change of bank.
    time_s : float
        Until the loss it does not avoid, infinite when it avoids all; until the satellites are back, after a loss.
    """

    commanded: bool
    reason: str
    kind: str = ""
    keeps: bool = False
    bank_rad: float = math.nan
    speed_mps: float = math.nan
    plan: AttitudePlan | None = None
    change_rad: float = math.nan
    time_s: float = math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class SteeringEpoch:
    """What the choice is made of.

    Attributes
    ----------
    ahead : PredictionEpoch
    prediction : Prediction
        Of that epoch.
    height_m : float
        Above terrain; not known: nothing is commanded.
    """

    ahead: PredictionEpoch
    prediction: Prediction
    height_m: float


def steer(epoch: SteeringEpoch, prediction_params: PredictionParams, params: SteeringParams) -> Steering:
    """Choose the smallest change that keeps the required satellites, or after a loss the soonest to bring them back.

    Nothing is commanded without caution, without attitude, plan and satellites, without enough height above terrain, or
    where nothing is better than what is planned.
    """
    why_not = _why_not(epoch, params)
    if why_not:
        return Steering(commanded=False, reason=why_not)
    ahead, plan = epoch.ahead, epoch.ahead.plan
    assert plan is not None
    look = replace(prediction_params, horizon_s=params.horizon_s, least_weight=0.0)
    lost = int(epoch.prediction.seen.sum()) < prediction_params.required_satellites
    as_planned = Candidate(kind=_ON_PLAN, plan=plan, speed_mps=ahead.attitude.speed_mps, change_rad=0.0)
    ways = [as_planned, *candidates(ahead.time_s, ahead.attitude, plan, params)]
    if lost:
        return _recovery(ways, ahead, look, params)
    return _avoidance(ways, ahead, look, params)


def _why_not(epoch: SteeringEpoch, params: SteeringParams) -> str:
    """Why nothing may be commanded; empty when it may."""
    if not epoch.prediction.available or epoch.prediction.restriction:
        return epoch.prediction.restriction
    plan, time_s = epoch.ahead.plan, epoch.ahead.time_s
    if plan is None or not plan.covers(time_s, time_s + params.horizon_s):
        return "no_plan"
    if not epoch.height_m >= params.min_height_m:
        return "height"
    if not epoch.prediction.caution:
        return "no_caution"
    return ""


def _avoidance(
    ways: list[Candidate], ahead: PredictionEpoch, look: PredictionParams, params: SteeringParams
) -> Steering:
    """The first way that keeps the satellites with all errors; without one, that which loses them in fewest cases."""
    judged: list[tuple[float, float, int]] = []
    for k, way in enumerate(ways):
        outcome = _outcome(way, ahead, look, params)
        if outcome.probability == 0.0:
            return _steering("avoid", way, ahead, keeps=True, time_s=math.inf)
        judged.append((round(outcome.probability, 9), -outcome.soonest_s, k))
    _, later_s, best = min(judged)
    if best == 0:
        return Steering(commanded=False, reason="nothing_better")
    return _steering("avoid", ways[best], ahead, keeps=False, time_s=-later_s)


def _recovery(
    ways: list[Candidate], ahead: PredictionEpoch, look: PredictionParams, params: SteeringParams
) -> Steering:
    """The way on which the satellites are back soonest, whatever the error; of equal ones the smallest change."""
    los = usable_los(ahead.los_enu, look.elevation_mask_rad)
    back = []
    for way in ways:
        attitudes = _outcome(way, ahead, look, params).attitudes_rad
        enough = seen_at(attitudes, los, ahead.mask).sum(axis=-1) >= look.required_satellites
        first = np.where(enough.any(axis=1), enough.argmax(axis=1) * look.step_s, math.inf)
        back.append(round(float(first.max()), 9))
    best = int(np.argmin(back))
    if best == 0:
        return Steering(commanded=False, reason="nothing_better")
    return _steering("recover", ways[best], ahead, keeps=back[best] < math.inf, time_s=back[best])


def _outcome(way: Candidate, ahead: PredictionEpoch, look: PredictionParams, params: SteeringParams) -> Outcome:
    """A way flown as it is and with errors of bank either way, by the prediction's own code."""
    errors = (0.0, -params.error_rad, params.error_rad)
    empty = np.empty(0)
    flown = Hypotheses(
        kinds=np.full(len(errors), PLAN), values=np.array([(0.0, each, 1.0 / len(errors)) for each in errors]),
        anchor_rad=0.0, horizon_margin_rad=0.0, caution_weight=0.0,
        shifts_s=empty, errors_rad=empty, prior_shift=empty, prior_error=empty,
    )  # fmt: skip
    los = usable_los(ahead.los_enu, look.elevation_mask_rad)
    if ahead.setting is not None:
        los = np.where(ahead.setting, np.nan, los)
    attitude: Attitude = replace(ahead.attitude, speed_mps=way.speed_mps)
    return look_ahead(flown, flown.values, (ahead.time_s, attitude, way.plan), (los, ahead.mask), look)


def _steering(reason: str, way: Candidate, ahead: PredictionEpoch, *, keeps: bool, time_s: float) -> Steering:
    place = min(way.plan.place(ahead.time_s + 1.0), way.plan.bank_rad.size - 1.0)
    return Steering(
        commanded=True,
        reason=reason,
        kind=way.kind,
        keeps=keeps,
        bank_rad=float(np.interp(place, np.arange(way.plan.bank_rad.size), way.plan.bank_rad)),
        speed_mps=way.speed_mps,
        plan=way.plan,
        change_rad=way.change_rad,
        time_s=time_s,
    )
