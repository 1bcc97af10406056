# mypy: disable-error-code="no-untyped-call"
"""What comes of the ways of flying on: satellites seen along each, and what is lost when."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.hypotheses import Hypotheses
from gbas_airborne.abia.prediction.kernels.masking import all_seen, first_lost
from gbas_airborne.abia.prediction.kernels.trajectories import trajectories
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_core.record import BoolArray, FloatArray

NO_PLAN: Final = AttitudePlan(start_s=0.0, step_s=1.0, bank_rad=np.zeros(2), pitch_rad=np.zeros(2))
"""Given where no hypothesis follows a plan."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What comes of the ways of flying on.

    Attributes
    ----------
    weights : (H,) array
    attitudes_rad : (H, K, 3) array
        Bank, pitch and heading along each way.
    short_s : (H,) array
        When fewer satellites than required are seen first, infinite when never [s].
    lost_s : (H, N) array
        When each satellite is first not seen, infinite when never; 0 of one that is not seen now [s].
    """

    weights: FloatArray
    attitudes_rad: FloatArray
    short_s: FloatArray
    lost_s: FloatArray

    @property
    def probability(self) -> float:
        """Weight of the ways on which too many satellites are lost."""
        return float(self.weights[np.isfinite(self.short_s)].sum())

    @property
    def soonest_s(self) -> float:
        """When too many satellites are lost first on any of them, infinite when never [s]."""
        return float(self.short_s.min(initial=math.inf))

    def satellites(self) -> tuple[FloatArray, FloatArray]:
        """Weight of the ways on which each satellite is not seen, and when it is first on any, (N,) each."""
        return self.weights @ np.isfinite(self.lost_s), self.lost_s.min(axis=0, initial=math.inf)


def look_vector(params: PredictionParams, anchor_rad: float) -> FloatArray:
    """How to look ahead, in the order of the kernels."""
    return np.array([params.horizon_s, params.step_s, params.roll_time_s, params.bank_limit_rad, anchor_rad])


def seen_at(attitudes_rad: FloatArray, los_enu: FloatArray, mask: MaskTable) -> BoolArray:
    """Satellites seen at attitudes ``(..., 3)`` bank, pitch, heading [rad]: ``(..., N)``.

    Parameters
    ----------
    los_enu : (3, N) array
        Unit vectors to the satellites in local axes; NaN where there is none.
    mask : MaskTable
    """
    flat = np.ascontiguousarray(attitudes_rad.reshape(-1, 3), dtype=np.float64)
    seen = all_seen(flat, los_enu, mask.blocked, antenna_vector(mask))
    return np.asarray(seen).reshape(*attitudes_rad.shape[:-1], los_enu.shape[1])


def antenna_vector(mask: MaskTable) -> FloatArray:
    """Axis, horizon and highest elevation the airframe hides, in the order of the kernels."""
    rows = np.flatnonzero(mask.blocked.any(axis=0))
    sin_top = math.sin(math.pi * ((rows[-1] + 1) / mask.blocked.shape[1] - 0.5)) if rows.size else -2.0
    return np.array([*mask.axis, math.sin(mask.horizon_rad), sin_top])


def higher(mask: MaskTable, margin_rad: float) -> MaskTable:
    """The mask with a higher horizon of the antenna."""
    return replace(mask, horizon_rad=mask.horizon_rad + margin_rad) if margin_rad else mask


def usable_los(los_enu: FloatArray, elevation_mask_rad: float) -> FloatArray:
    """Lines of sight above the elevation mask; NaN for the others. (3, N)."""
    with np.errstate(invalid="ignore"):
        above = los_enu[2] >= math.sin(elevation_mask_rad)
    return np.ascontiguousarray(np.where(above & np.isfinite(los_enu).all(axis=0), los_enu, np.nan))


def look_ahead(
    ways: Hypotheses, values: FloatArray, flown: tuple[float, Attitude, AttitudePlan | None],
    sky: tuple[FloatArray, MaskTable], params: PredictionParams,
) -> Outcome:  # fmt: skip
    """Follow the ways of flying on that are likely enough.

    Parameters
    ----------
    ways : Hypotheses
    values : (H, 3) array
        Theirs, with the weights of now.
    flown : (float, Attitude, AttitudePlan or None)
        Time [s], attitude at it, and plan.
    sky : ((3, N) array, MaskTable)
        Lines of sight that are usable, in local axes, and what hides them.
    params : PredictionParams
    """
    time_s, attitude, plan = flown[0], flown[1], flown[2] or NO_PLAN
    followed = values[:, 2] > params.least_weight
    attitudes = trajectories(
        ways.kinds[followed], np.ascontiguousarray(values[followed]), attitude.vector(), plan.bank_rad, plan.pitch_rad,
        plan.place(time_s), plan.step_s, look_vector(params, ways.anchor_rad),
    )  # fmt: skip
    los, mask = sky[0], higher(sky[1], ways.horizon_margin_rad)
    there = np.flatnonzero(np.isfinite(los[2]))
    short_s, lost_there_s = first_lost(
        attitudes, params.step_s, np.ascontiguousarray(los[:, there]), mask.blocked, antenna_vector(mask),
        params.required_satellites,
    )  # fmt: skip
    lost_s = np.full((len(attitudes), los.shape[1]), np.inf)
    lost_s[:, there] = lost_there_s
    return Outcome(weights=values[followed, 2], attitudes_rad=attitudes, short_s=short_s, lost_s=lost_s)
