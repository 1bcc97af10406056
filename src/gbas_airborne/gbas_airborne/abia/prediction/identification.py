# mypy: disable-error-code="no-untyped-call"
"""Manoeuvre identification: how late and how wrong the plan is flown, from the bank."""

from __future__ import annotations

import numpy as np

from gbas_airborne.abia.prediction.hypotheses import Hypotheses
from gbas_airborne.abia.prediction.kernels.identification import identify
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import AttitudePlan
from gbas_core.record import FloatArray


def identification_vector(params: PredictionParams) -> FloatArray:
    """How to identify, in the order of the kernel."""
    return np.array(
        [
            params.bank_sigma_rad,
            params.bank_correlation_s,
            params.forget_level_s,
            params.forget_shift_s,
            params.outside_probability,
            params.forget_error_s,
        ]
    )


def identified(
    weights: FloatArray, ways: Hypotheses, bank_rad: float, plan: AttitudePlan, times_s: tuple[float, float],
    params: PredictionParams,
) -> FloatArray:  # fmt: skip
    """Weights of the ways of flying the plan after one more bank.

    Parameters
    ----------
    weights : (H,) array
        Before it.
    ways : Hypotheses
        A grid.
    bank_rad : float
        Flown now.
    plan : AttitudePlan
    times_s : (float, float)
        Now, and how long the weights are old; the bank of less than the correlation time tells less [s].
    params : PredictionParams
    """
    updated = weights.copy()
    identify(
        updated, ways.prior_shift, ways.prior_error, ways.shifts_s, ways.errors_rad, bank_rad, plan.bank_rad,
        plan.place(times_s[0]), plan.step_s, times_s[1], identification_vector(params),
    )  # fmt: skip
    return updated
