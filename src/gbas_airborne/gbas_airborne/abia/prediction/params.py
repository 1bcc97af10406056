"""Parameters of the prediction."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

from gbas_core.parameters import Parameter, parameters

PREDICTORS: Final = ("margin", "hold", "roll_rate", "plan", "robust_plan", "likely_loss")
"""Known predictors: what each of them is stands in :mod:`~.hypotheses`."""


@parameters
class PredictionParams:
    """How the flight ahead is looked at.

    Known is the rule of the margin (Sabatini et al., IV.H); the rest is chosen by the campaign of ``gbas study abia``.
    """

    predictor: Annotated[
        Literal["margin", "hold", "roll_rate", "plan", "robust_plan", "likely_loss"],
        Parameter("what is believed of the flight ahead where there is a plan; roll_rate is used where there is none"),
    ] = "likely_loss"
    horizon_s: Annotated[float, Parameter("how far is looked ahead", "s", 0.5, 60.0)] = 5.0
    step_s: Annotated[
        float, Parameter("between the attitudes looked at; some outages last under 1 s", "s", 0.02, 0.2)
    ] = 0.2
    roll_time_s: Annotated[
        float, Parameter("how long a roll rate is believed to go on without a plan", "s", 0.0, 2.0)
    ] = 2.0
    bank_limit_rad: Annotated[float, Parameter("largest bank extrapolated without a plan", "deg", 5.0, 85.0)] = (
        math.radians(75.0)
    )
    required_satellites: Annotated[
        int, Parameter("navigation is lost with fewer in view; 4 make a position", "-", 4, 12)
    ] = 4
    elevation_mask_rad: Annotated[
        float, Parameter("satellites lower above the local horizon are not used", "deg", 0.0, 45.0)
    ] = math.radians(5.0)
    margin_rule: Annotated[
        bool, Parameter("the paper's rule of the margin besides the predictor; many of its cautions are false")
    ] = False
    caution_elevation_rad: Annotated[
        float,
        Parameter(
            "with as many satellites as are required, antenna elevation below which there is caution", "deg", 0.0, 45.0
        ),
    ] = math.radians(10.0)  # fmt: skip
    robust_shift_s: Annotated[
        float, Parameter("robust_plan: the plan is flown so much later or sooner", "s", 0.0, 10.0)
    ] = 1.5
    robust_error_rad: Annotated[float, Parameter("robust_plan: error of bank, either way", "deg", 0.0, 30.0)] = (
        math.radians(5.0)
    )
    shift_sigma_s: Annotated[
        float, Parameter("likely_loss: 1 sigma of how late the plan is flown", "s", 0.05, 10.0)
    ] = 1.0
    error_sigma_rad: Annotated[
        float, Parameter("likely_loss: 1 sigma of the error of bank in turns", "deg", 0.1, 20.0)
    ] = math.radians(3.0)
    caution_probability: Annotated[
        float, Parameter("likely_loss: caution from this probability of a loss within the horizon", "-", 1e-3, 1.0)
    ] = 0.1
    horizon_margin_rad: Annotated[
        float,
        Parameter(
            "likely_loss: the antenna's horizon is taken so much higher ahead, for losses that only just happen",
            "deg", 0.0, 10.0,
        ),
    ] = math.radians(0.25)  # fmt: skip
    least_weight: Annotated[
        float, Parameter("likely_loss: less likely ways of flying the plan are not looked at", "-", 0.0, 0.1)
    ] = 1e-3
    outside_probability: Annotated[
        float, Parameter("likely_loss: that the plan is not followed at all", "-", 1e-6, 0.5)
    ] = 0.01
    bank_sigma_rad: Annotated[
        float, Parameter("likely_loss: 1 sigma of bank about a way of flying the plan", "deg", 0.1, 10.0)
    ] = math.radians(1.0)
    bank_correlation_s: Annotated[
        float, Parameter("likely_loss: over which bank tells something new", "s", 0.05, 10.0)
    ] = 0.5
    forget_level_s: Annotated[
        float, Parameter("likely_loss: over which lateness and error are forgotten, wings level", "s", 0.1, 600.0)
    ] = 1.0
    forget_shift_s: Annotated[
        float, Parameter("likely_loss: over which lateness is forgotten in turns", "s", 0.1, 600.0)
    ] = 5.0
    forget_error_s: Annotated[
        float, Parameter("likely_loss: over which the error of bank is forgotten in turns", "s", 0.1, 600.0)
    ] = 60.0

    def __post_init__(self) -> None:
        if self.step_s > self.horizon_s:
            raise ValueError(f"prediction: step_s = {self.step_s!r} is above horizon_s = {self.horizon_s!r}")
