# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Which of the ways of flying the plan is being flown, from the bank: a Bayes filter on a grid."""

from __future__ import annotations

import math
from typing import Final

from gbas_airborne.abia.prediction.kernels.trajectories import FADE_RAD, interpolated
from gbas_core.compiled import compiled

SIGMA, CORRELATION, FORGET_LEVEL, FORGET_SHIFT, OUTSIDE, FORGET_ERROR = range(6)
"""Places in the vector of how to identify [rad, s, s, s, -, s]."""
LEVEL_RAD: Final = math.radians(2.0)
"""Planned bank below which the wings are level."""
_SPREAD_RAD: Final = math.radians(120.0)
"""Range of bank an aircraft that does not follow its plan may have."""


@compiled
def identify(weights, prior_shift, prior_error, shifts, errors, bank, plan_bank, place, plan_step, elapsed, how):
    """Advance the weights, (S * E + 1,), of being late by shifts and wrong by errors; the last: not flying the plan.

    Each hypothesis stands for its cell of the grid: its likelihood is that of a normal distribution with the spread of
    the bank over the cell. What is learnt is forgotten: all of it wings level, lateness sooner than the error of bank
    otherwise, for each manoeuvre is late and wrong in its own way.
    """
    n_shifts, n_errors = shifts.shape[0], errors.shape[0]
    half_shift = 0.5 * (shifts[1] - shifts[0]) / plan_step
    cell_error = errors[1] - errors[0]
    power = min(elapsed / how[CORRELATION], 1.0)
    level = True
    total = 0.0
    for i in range(n_shifts):
        at = place - shifts[i] / plan_step
        planned = interpolated(plan_bank, at)
        span = interpolated(plan_bank, at + half_shift) - interpolated(plan_bank, at - half_shift)
        level = level and abs(planned) < LEVEL_RAD and abs(span) < LEVEL_RAD
        fade = min(abs(planned) / FADE_RAD, 1.0)
        variance = how[SIGMA] ** 2 + (span**2 + (fade * cell_error) ** 2) / 12.0
        flat = -0.5 * power * math.log(2.0 * math.pi * variance)
        sense = min(max(planned / FADE_RAD, -1.0), 1.0)
        for j in range(n_errors):
            residual = bank - planned - errors[j] * sense
            weights[i * n_errors + j] *= math.exp(flat - 0.5 * power * residual**2 / variance)
            total += weights[i * n_errors + j]
    last = n_shifts * n_errors
    weights[last] *= _SPREAD_RAD**-power
    total += weights[last]
    for h in range(last + 1):
        weights[h] /= total
    _forget(weights, prior_shift, prior_error, level, elapsed, how)


@compiled
def _forget(weights, prior_shift, prior_error, level, elapsed, how):
    """Let the weights go back to those nothing is known with."""
    n_shifts, n_errors = prior_shift.shape[0], prior_error.shape[0]
    last = n_shifts * n_errors
    all_of_it = min(elapsed / (how[FORGET_LEVEL] if level else how[FORGET_ERROR]), 1.0)
    lateness = min(elapsed / how[FORGET_SHIFT], 1.0)
    following = 1.0 - how[OUTSIDE]
    for i in range(n_shifts):
        for j in range(n_errors):
            prior = following * prior_shift[i] * prior_error[j]
            weights[i * n_errors + j] += all_of_it * (prior - weights[i * n_errors + j])
    weights[last] += all_of_it * (how[OUTSIDE] - weights[last])
    for j in range(n_errors):
        together = 0.0
        for i in range(n_shifts):
            together += weights[i * n_errors + j]
        for i in range(n_shifts):
            weights[i * n_errors + j] += lateness * (prior_shift[i] * together - weights[i * n_errors + j])
