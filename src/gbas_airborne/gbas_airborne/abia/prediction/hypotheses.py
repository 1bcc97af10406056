"""The ways in which the flight may go on, by predictor.

============== ====================================================================================================
margin         none: as many satellites as required, and one of them low, is all that is looked at
hold           bank as it is
roll_rate      the roll rate goes on for 2 s at most, then the bank is held
plan           the plan, as it is
robust_plan    the plan 1.5 s sooner, in time and later, with bank 5 degrees less, as planned and more
likely_loss    the plan on a grid of lateness and error of bank, each as likely as the bank flown makes it, and
               roll_rate for an aircraft that does not follow its plan
============== ====================================================================================================

A predictor that flies one hypothesis or some cautions when any of them loses too many satellites; ``likely_loss`` when
those that do are likely enough together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from gbas_airborne.abia.prediction.kernels.trajectories import HOLD, PLAN, ROLL
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_core.record import FloatArray, IntArray

SIGMAS: Final = 3.0
"""How far the grid reaches."""
SHIFTS: Final = 9
ERRORS: Final = 9
NEEDS_PLAN: Final = ("plan", "robust_plan", "likely_loss")


@dataclass(frozen=True, kw_only=True, eq=False)
class Hypotheses:
    """Ways of flying on.

    Attributes
    ----------
    kinds : (H,) int array
        Of :mod:`~.kernels.trajectories`.
    values : (H, 3) array
        How late [s], error of bank [rad], weight [-].
    anchor_rad : float
        Half the width in bank that a hypothesis of the plan stands for [rad].
    horizon_margin_rad : float
        By which the antenna's horizon is taken higher [rad].
    caution_weight : float
        Caution from this weight of losses.
    shifts_s, errors_rad, prior_shift, prior_error : arrays
        The grid and its weights, empty without.
    """

    kinds: IntArray
    values: FloatArray
    anchor_rad: float
    horizon_margin_rad: float
    caution_weight: float
    shifts_s: FloatArray
    errors_rad: FloatArray
    prior_shift: FloatArray
    prior_error: FloatArray

    @property
    def reach_s(self) -> float:
        """How far from now, sooner or later, the plan is looked at besides the horizon [s]."""
        planned = self.kinds == PLAN
        return float(np.abs(self.values[planned, 0]).max()) if planned.any() else 0.0


@lru_cache(maxsize=32)
def hypotheses_of(name: str, params: PredictionParams) -> Hypotheses:
    """Hypotheses of a predictor, with the weights nothing is known with."""
    if name == "likely_loss":
        return _grid(params)
    shift, error = params.robust_shift_s, params.robust_error_rad
    ways: dict[str, list[tuple[int, float, float]]] = {
        "margin": [],
        "hold": [(HOLD, 0.0, 0.0)],
        "roll_rate": [(ROLL, 0.0, 0.0)],
        "plan": [(PLAN, 0.0, 0.0)],
        "robust_plan": [(PLAN, s, e) for s in (0.0, -shift, shift) for e in (0.0, -error, error)],
    }
    chosen = ways[name]
    empty = np.empty(0)
    return Hypotheses(
        kinds=np.array([kind for kind, _, _ in chosen], dtype=np.int64),
        values=np.array([(s, e, 1.0 / len(chosen)) for _, s, e in chosen]).reshape(-1, 3),
        anchor_rad=0.0, horizon_margin_rad=0.0, caution_weight=0.5 / max(len(chosen), 1),
        shifts_s=empty, errors_rad=empty, prior_shift=empty, prior_error=empty,
    )  # fmt: skip


def _grid(params: PredictionParams) -> Hypotheses:
    shifts = np.linspace(-SIGMAS, SIGMAS, SHIFTS) * params.shift_sigma_s
    errors = np.linspace(-SIGMAS, SIGMAS, ERRORS) * params.error_sigma_rad
    prior_shift, prior_error = _normal(shifts / params.shift_sigma_s), _normal(errors / params.error_sigma_rad)
    grid = np.stack(np.meshgrid(shifts, errors, indexing="ij"), axis=-1).reshape(-1, 2)
    weights = (1.0 - params.outside_probability) * np.outer(prior_shift, prior_error).ravel()
    values = np.column_stack([np.append(grid, [[0.0, 0.0]], axis=0), np.append(weights, params.outside_probability)])
    return Hypotheses(
        kinds=np.append(np.full(len(grid), PLAN), ROLL).astype(np.int64),
        values=values,
        anchor_rad=float(0.5 * (errors[1] - errors[0])), horizon_margin_rad=params.horizon_margin_rad,
        caution_weight=params.caution_probability,
        shifts_s=shifts, errors_rad=errors, prior_shift=prior_shift, prior_error=prior_error,
    )  # fmt: skip


def _normal(deviates: FloatArray) -> FloatArray:
    density = np.exp(-0.5 * deviates**2)
    result: FloatArray = density / density.sum()
    return result
