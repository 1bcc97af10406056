"""False alarms and missed detections down to 1e-9 by importance sampling, through the filters themselves.

White noise of code and carrier goes epoch by epoch through :func:`gbas_core.ranging.divergence.divergence_step` until
the filters have settled. To make the rare event common the noise is given a mean, proportional to the filters' impulse
response, so that the statistic arrives near its threshold; each sample counts with the ratio of its densities without
and with that mean, which depends on the statistic alone. For an alarm on any side the mean points anywhere at random.

The closed forms of :mod:`~.missed_detection` are not used here: the two are independent ways to one number.

Source: importance sampling by an exponential change of measure, Bucklew, Introduction to Rare Event Simulation, 2004.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.divergence import DivergenceParams, divergence_step, initial_divergence, white_noise_gain
from gbas_core.ranging.fault_modes import fault_direction
from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.divergence_covariance import INDEPENDENT
from gbas_ground.monitors.divergence_forms import threshold

COLUMNS: Final[FloatArray] = combination_matrix(L1, L5)[list(INDEPENDENT)]
# Epochs from rest to settled in time constants: what is missing then is below 1e-6 of the noise.
_SETTLED_TAU = 16.0


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A probability found by simulation.

    Attributes
    ----------
    value, standard_error : float
    samples : int
    """

    value: float
    standard_error: float
    samples: int

    @classmethod
    def of(cls, weighted: FloatArray) -> Estimate:
        """Mean of weighted indicators."""
        spread = float(weighted.std(ddof=1) / np.sqrt(len(weighted)))
        return cls(value=float(weighted.mean()), standard_error=spread, samples=len(weighted))


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How a probability is estimated: random samples, each an epoch sequence through the filters of a monitor."""

    samples: int
    seed: int
    params: DivergenceParams
    interval_s: float = 0.5


def _impulse_response(params: DivergenceParams, interval_s: float, epochs: int) -> FloatArray:
    """What noise of 1 m at each epoch adds to the last filtered rate, (epochs,) [1/s]."""
    alpha = interval_s / params.tau_s
    age = np.arange(epochs - 1, -1, -1, dtype=np.float64)  # epochs ago
    q = 1.0 - alpha
    step = alpha**2 * (age + 1.0) * q**age
    before = np.where(age > 0.0, alpha**2 * age * q ** np.maximum(age - 1.0, 0.0), 0.0)
    result = (step - before) / interval_s
    result[0] = -before[0] / interval_s  # the first value has no rate of its own
    return np.asarray(result)


def _filtered(
    values_at: Callable[[int], FloatArray],
    epochs: int,
    shape: tuple[int, ...],
    params: DivergenceParams,
    interval_s: float,
) -> FloatArray:
    """Last filtered rate of values (..., samples) that a function gives epoch by epoch."""
    state = initial_divergence(params, *shape[:-1], n_sats=shape[-1])
    none = np.zeros(shape, dtype=bool)
    filtered = np.full(shape, np.nan)
    for number in range(epochs):
        dt_s = interval_s if number else float("nan")
        state, _, filtered = divergence_step(state, values_at(number), none, dt_s, params)
    return filtered


def _epochs(params: DivergenceParams, interval_s: float) -> int:
    return int(np.ceil(_SETTLED_TAU * params.tau_s / interval_s))


def single_frequency(
    rate_mps: float, sigma_mps: float, threshold_mps: float, sampling: Sampling, *, alarm: bool
) -> Estimate:
    """Probability that the GAST D statistic exceeds its threshold on either side, or that it does not.

    Parameters
    ----------
    rate_mps : float
        Divergence, in steady state [m/s].
    sigma_mps : float
        Standard deviation of the settled statistic; the noise of code minus carrier is made so large [m/s].
    threshold_mps : float
    sampling : Sampling
    alarm : bool
        True: probability of an alarm; False: that of none.
    """
    samples, params, interval_s = sampling.samples, sampling.params, sampling.interval_s
    rng = np.random.default_rng(sampling.seed)
    epochs = _epochs(params, interval_s)
    noise_m = sigma_mps * interval_s / white_noise_gain(interval_s / params.tau_s)
    pulse = _impulse_response(params, interval_s, epochs)
    sigma = noise_m * np.sqrt((pulse**2).sum())
    # Where the rare event begins, from the mean: either threshold for an alarm of none, the upper one otherwise.
    aim = threshold_mps - rate_mps if (alarm or rate_mps > threshold_mps) else 0.0
    both = alarm and rate_mps == 0.0
    sign = rng.choice((-1.0, 1.0), samples) if both else np.ones(samples)

    def values(number: int) -> FloatArray:
        mean = aim * pulse[number] / (pulse**2).sum()
        return np.asarray(rng.normal(size=samples) * noise_m + sign * mean + rate_mps * interval_s * number)

    deviation = _filtered(values, epochs, (samples,), params, interval_s) - rate_mps
    pull = aim * deviation / sigma**2
    log_ratio = 0.5 * (aim / sigma) ** 2 - (np.logaddexp(pull, -pull) - np.log(2.0) if both else pull)
    exceeds = np.abs(deviation + rate_mps) > threshold_mps
    return Estimate.of(np.where(exceeds == alarm, np.exp(log_ratio), 0.0))


def two_frequency(
    mode: str | None, d_mps: float, sigma_m: FloatArray, sampling: Sampling, *, alarm: bool, p_false_alarm: float = 1e-9
) -> Estimate:
    """The same for the GAST F form of full rank, with a known receiver clock.

    Parameters
    ----------
    mode : str or None
        Fault mode; None: no fault.
    d_mps : float
        Its rate, in steady state [m/s].
    sigma_m : (4,) array
        White noise of code L1, code L5, carrier L1, carrier L5 [m].
    sampling : Sampling
    alarm : bool
    p_false_alarm : float
        Sets the threshold.
    """
    samples, params, interval_s = sampling.samples, sampling.params, sampling.interval_s
    rng = np.random.default_rng(sampling.seed)
    epochs = _epochs(params, interval_s)
    pulse = _impulse_response(params, interval_s, epochs)
    energy = float((pulse**2).sum())
    covariance = energy * (COLUMNS * sigma_m**2) @ COLUMNS.T
    root = np.linalg.cholesky(covariance)
    limit = np.sqrt(threshold("full_rank", p_false_alarm))
    drift = np.zeros(4) if mode is None else d_mps * fault_direction(mode)
    mean = solve_triangular(root, COLUMNS @ drift, lower=True)
    size = float(np.linalg.norm(mean))
    if mode is None and alarm:
        unit = rng.normal(size=(3, samples))
        aim = limit * unit / np.sqrt((unit**2).sum(axis=0))
    else:
        toward = limit / size - 1.0 if (size > limit) != alarm and size > 0.0 else 0.0
        aim = np.broadcast_to(toward * mean[:, np.newaxis], (3, samples))
    # Smallest mean of the four noises that brings the statistics where they are wanted.
    push = (sigma_m**2)[:, np.newaxis] * (COLUMNS.T @ solve_triangular(root, aim, lower=True, trans=1))

    def values(number: int) -> FloatArray:
        four = rng.normal(size=(4, samples)) * sigma_m[:, np.newaxis] + pulse[number] * push
        return np.asarray(COLUMNS @ (four + (drift * interval_s * number)[:, np.newaxis]))

    filtered = _filtered(values, epochs, (3, samples), params, interval_s)
    z = solve_triangular(root, filtered, lower=True)
    if mode is None and alarm:
        radius = limit * np.sqrt((z**2).sum(axis=0))
        # Mean over all directions of exp(aim z) in three dimensions is sinh(r) / r.
        log_ratio = 0.5 * limit**2 - (radius + np.log1p(-np.exp(-2.0 * radius)) - np.log(2.0 * radius))
    else:
        log_ratio = 0.5 * (aim**2).sum(axis=0) - (aim * (z - mean[:, np.newaxis])).sum(axis=0)
    exceeds = (z**2).sum(axis=0) > limit**2
    return Estimate.of(np.where(exceeds == alarm, np.exp(log_ratio), 0.0))
