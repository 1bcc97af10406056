"""Geometry and protection levels along the way of flying on that is most likely."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gbas_airborne.abia.flags.epoch import Approach, FlagEpoch
from gbas_airborne.abia.flags.params import FlagParams
from gbas_airborne.abia.prediction.look_ahead import seen_at, usable_los
from gbas_airborne.abia.prediction.predictors import Prediction
from gbas_airborne.abia.visibility.geometry import dilution, estimated_errors
from gbas_airborne.abia.visibility.requirements import accuracy_missed, alert_limit_exceeded
from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.record import BoolArray, FloatArray


class Geometries(NamedTuple):
    """Satellites seen now, and those seen ahead: each set that differs from the one before.

    Attributes
    ----------
    sets : (U, N) bool array
        The first is that of now.
    first_s : (U,) array
        When each comes first [s].
    """

    sets: BoolArray
    first_s: FloatArray


class GeometryAhead(NamedTuple):
    """Whether now the accuracy is missed and an alert limit exceeded, and when each is first ahead, or infinite [s]."""

    missed: bool
    exceeded: bool
    missed_s: float
    exceeded_s: float


class LevelsAhead(NamedTuple):
    """Largest protection levels over the horizon [m], and when one exceeds its limit first, or infinite [s]."""

    vpl_m: float
    lpl_m: float
    exceeded_s: float


def geometries(epoch: FlagEpoch, prediction: Prediction, params: FlagParams) -> Geometries:
    """Sets of satellites along the most likely way; without a way that of now alone."""
    outcome = prediction.outcome
    if outcome is None or not outcome.weights.size:
        return Geometries(prediction.seen[np.newaxis], np.zeros(1))
    los = usable_los(epoch.ahead.los_enu, params.prediction.elevation_mask_rad)
    along = seen_at(outcome.attitudes_rad[int(outcome.weights.argmax())], los, epoch.ahead.mask)
    first = np.flatnonzero(np.append(True, (along[1:] != along[:-1]).any(axis=1)))
    first_s: FloatArray = np.asarray(first * params.prediction.step_s, dtype=np.float64)
    return Geometries(along[first], first_s)


def geometry_ahead(epoch: FlagEpoch, found: Geometries, params: FlagParams) -> GeometryAhead:
    """Estimated errors against the phase of flight.

    Source: Sabatini et al., eq (37) and IV.H, with EVE against VA where it prints EHE.
    """
    los = np.broadcast_to(epoch.ahead.los_enu, (len(found.sets), *epoch.ahead.los_enu.shape))
    errors = estimated_errors(dilution(los, found.sets, epoch.clock_groups), params.geometry.sigma_uere_m)
    missed = accuracy_missed(errors, params.geometry.requirement)
    exceeded = alert_limit_exceeded(errors, params.geometry.requirement)
    return GeometryAhead(bool(missed[0]), bool(exceeded[0]), _first(missed, found), _first(exceeded, found))


def levels_ahead(epoch: FlagEpoch, found: Geometries) -> LevelsAhead | None:
    """Predicted protection levels, PLPL and PVPL; None without an approach, levels or sigmas.

    The levels of now, times how much larger the standard deviation of the position is with the satellites seen then:
    with the same ranges all terms of the levels grow like it. Ours.
    """
    approach = epoch.approach
    if approach is None or epoch.sigma_m is None:
        return None
    sigma_m = epoch.sigma_m
    spread = np.array([_position_sigmas_m(epoch, np.where(each, sigma_m, np.nan), approach) for each in found.sets])
    levels = np.array([approach.vpl_m, approach.lpl_m]) * spread / spread[0]
    beyond = ~(levels <= np.array([approach.val_m, approach.lal_m])).all(axis=1)
    with np.errstate(invalid="ignore"):
        worst = levels.max(axis=0)
    return LevelsAhead(float(worst[0]), float(worst[1]), _first(beyond, found))


def _position_sigmas_m(epoch: FlagEpoch, sigma_m: FloatArray, approach: Approach) -> FloatArray:
    """Standard deviation, vertical and lateral, with the satellites that have a sigma; NaN without a position."""
    sine, cosine = math.sin(approach.course_rad), math.cos(approach.course_rad)
    turned = np.array([[sine, cosine, 0.0], [-cosine, sine, 0.0], [0.0, 0.0, 1.0]]) @ epoch.ahead.los_enu
    projection = projection_matrix(turned, sigma_m, epoch.clock_groups)
    if projection is None:
        return np.full(2, np.nan)
    both = np.stack(vertical_lateral(projection, approach.glide_path_rad))
    result: FloatArray = np.sqrt((both**2 * np.nan_to_num(sigma_m) ** 2).sum(axis=1))
    return result


def _first(bad: BoolArray, found: Geometries) -> float:
    return float(found.first_s[bad].min(initial=math.inf))
