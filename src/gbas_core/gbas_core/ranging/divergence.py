"""Rate of divergence between code and carrier: the two cascaded first-order filters of the CCD monitors.

The rate ``r_n = (z_n - z_{n-1}) / T`` of a combination z, mostly code minus carrier, goes through
``F1_n = (1 - a) F1_{n-1} + a r_n`` and ``F2_n = (1 - a) F2_{n-1} + a F1_n`` with ``a = T / tau``; F2 is the statistic.
A ramp of z at d m/s that meets a settled filter gives ``F2_n = d (1 - (1 + a n) (1 - a)^n)``, which tends to d.

Ground and airborne monitors share the filter and differ in their constants. Arrays are (..., N_SATS): usually
(receivers, satellites) or (receivers, bands, satellites). Every channel keeps its own time: one that misses epochs
bridges the gap, up to the longest one allowed, with its mean rate over the time it was away.

**When the statistic counts.** The filters start at zero with the first value z_0, whose error e_0 nothing averages:
it stays in F2 as ``e_0 (a n) (1 - a)^(n-1) / tau``, largest after tau (0.0123 e_0 per second for 30 s). White noise of
the same size gives a settled filter a standard deviation of only ``e_0 sqrt(T / (4 tau^3))``, so the young filter's
noise exceeds the settled one's until 4.2 tau (for T = 0.5 s and tau = 30 s), and adds 1 % to its variance at 6.9 tau,
207 s. By then it shows 99.2 % of a divergence that was there before it started. The paper waits 360 s, 12 tau, where
both are below 1e-4. Tests of the divergence module have the numbers.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (2) to (6); Simili and Pervan, IEEE/ION PLANS 2006.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.compiled import as_written
from gbas_core.ranging.kernels.divergence import cascaded
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS


@dataclass(frozen=True, kw_only=True)
class DivergenceParams:
    """What the filters are set to.

    Attributes
    ----------
    tau_s : float
        Time constant of both filters [s].
    max_gap_s : float
        A channel that was away longer starts anew [s]. Uncertain, ours: it must be above the data's interval, so raise
        it for 30 s data, as for the smoothing filter.
    settle_s : float
        Time a filter has to run before its statistic counts [s].
    """

    tau_s: float = 30.0
    max_gap_s: float = 3.5
    settle_s: float = 360.0

    def __post_init__(self) -> None:
        for name, least in (("tau_s", True), ("max_gap_s", True), ("settle_s", False)):
            value = getattr(self, name)
            if not (np.isfinite(value) and (value > 0.0 if least else value >= 0.0)):
                raise ValueError(f"{name} is {value}: it must be {'above' if least else 'at least'} 0 s")


# Known: ENC 2015, 2.1 (ground, after Simili and Pervan 2006; settle time from 3).
GROUND: Final = DivergenceParams(tau_s=30.0, settle_s=360.0)
GROUND_SIGMA_MPS: Final = 0.00399
GROUND_THRESHOLD_MPS: Final = 0.0233
# Known: time constant, sigma and threshold of the airborne monitor (ENC 2015, 2.1, after RTCA DO-253C). Uncertain,
# ours: the settle time. After 2 tau an error of 1 m of the first value is down to 0.0027 m/s, a fifth of the threshold,
# and a constant divergence is shown to 59 %.
AIRBORNE: Final = DivergenceParams(tau_s=100.0, settle_s=200.0)
AIRBORNE_SIGMA_MPS: Final = 0.0022
AIRBORNE_THRESHOLD_MPS: Final = 0.0125


@dataclass(frozen=True, kw_only=True, eq=False)
class DivergenceState:
    """What the filters remember; arrays ``(..., N_SATS)`` are never changed in place.

    Attributes
    ----------
    value_m : array
        Last value; not used by filters whose input is a rate [m].
    f1_mps, f2_mps : array
        Output of the first and of the second filter [m/s].
    since_s : array
        Time since the channel's last measurement; 0 when it has one now [s].
    age_s : array
        Time from the filter's start to its last measurement; NaN where there is no filter [s].
    """

    value_m: FloatArray
    f1_mps: FloatArray
    f2_mps: FloatArray
    since_s: FloatArray
    age_s: FloatArray


def initial_divergence(params: DivergenceParams, *leading: int, n_sats: int = N_SATS) -> DivergenceState:
    """State of filters that have seen nothing, for values of shape ``(*leading, n_sats)``."""
    shape = (*leading, n_sats)
    return DivergenceState(
        value_m=np.full(shape, np.nan),
        f1_mps=np.zeros(shape),
        f2_mps=np.zeros(shape),
        since_s=np.zeros(shape),
        age_s=np.full(shape, np.nan),
    )


def divergence_step(
    state: DivergenceState, value_m: FloatArray, restarted: BoolArray, dt_s: float, params: DivergenceParams
) -> tuple[DivergenceState, FloatArray, FloatArray]:
    """Advance every filter by one epoch.

    Parameters
    ----------
    state : DivergenceState
        From :func:`initial_divergence` or the previous step.
    value_m : (..., N_SATS) array
        Code minus carrier, or any other combination whose rate is filtered; NaN where there is no measurement [m].
    restarted : (..., N_SATS) bool array
        Where the value may have jumped since the last epoch, as by a cycle slip; it counts also while the channel is
        away. The filter starts anew with the next value.
    dt_s : float
        The station's time since the epoch before [s]. Not finite (as at the first epoch) or not positive: all start
        anew.
    params : DivergenceParams

    Returns
    -------
    state : DivergenceState
    rate_mps : (..., N_SATS) array
        Mean rate of the value since the channel's last measurement; NaN where a filter starts and where there is no
        measurement [m/s].
    filtered_mps : (..., N_SATS) array
        F2; NaN where `rate_mps` is. It counts where :func:`settled` says so [m/s].
    """
    since_s, alive = _elapsed(state, restarted, dt_s, params)
    present = np.isfinite(value_m)
    going = alive & present
    rate = np.where(going, (value_m - state.value_m) / np.where(going, since_s, 1.0), np.nan)
    starting = present & ~alive
    kept_age = np.where(alive, state.age_s, np.where(starting, 0.0, np.nan))
    new, filtered = _advanced(state, rate, going, starting, since_s, kept_age, params)
    value = np.where(present, value_m, np.where(alive, state.value_m, np.nan))
    return DivergenceState(value_m=value, **new), rate, filtered


def rate_step(
    state: DivergenceState,
    rate_mps: FloatArray,
    over_s: FloatArray,
    restarted: BoolArray,
    dt_s: float,
    params: DivergenceParams,
) -> tuple[DivergenceState, FloatArray]:
    """The same for an input that is a rate already.

    Parameters
    ----------
    state : DivergenceState
    rate_mps : (..., N_SATS) array
        Mean rate over a time that ends now; NaN: none [m/s].
    over_s : (..., N_SATS) array
        That time, which is the filter's T: mostly since the channel's last measurement [s].
    restarted : (..., N_SATS) bool array
        Where the filter is emptied; a rate given there is not used.
    dt_s : float
        As for :func:`divergence_step`.
    params : DivergenceParams

    Returns
    -------
    state : DivergenceState
    filtered_mps : (..., N_SATS) array
        F2; NaN where no rate was used [m/s].
    """
    since_s, alive = _elapsed(state, restarted, dt_s, params)
    usable = np.isfinite(rate_mps) & ~restarted & (over_s > 0.0) & (over_s <= params.max_gap_s)
    starting = usable & ~alive
    since_s = np.where(usable, over_s, since_s)
    age_s = np.where(alive, state.age_s, np.where(starting, 0.0, np.nan))
    new, filtered = _advanced(state, rate_mps, usable, starting, since_s, age_s, params)
    return DivergenceState(value_m=state.value_m, **new), filtered


def _elapsed(
    state: DivergenceState, restarted: BoolArray, dt_s: float, params: DivergenceParams
) -> tuple[FloatArray, BoolArray]:
    """Time since each channel's last measurement, and which filters go on (or wait)."""
    if not dt_s > 0.0:  # also NaN
        return state.since_s, np.zeros(state.age_s.shape, dtype=bool)
    since_s = state.since_s + dt_s
    return since_s, np.isfinite(state.age_s) & ~restarted & (since_s <= params.max_gap_s)


def _advanced(
    state: DivergenceState,
    rate_mps: FloatArray,
    going: BoolArray,
    starting: BoolArray,
    since_s: FloatArray,
    age_s: FloatArray,
    params: DivergenceParams,
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Filter the rates where `going`; empty what is `starting` or has no age."""
    empty = starting | ~np.isfinite(age_s)
    alpha = np.where(going, np.minimum(since_s / params.tau_s, 1.0), 0.0)
    rate = np.where(going, rate_mps, 0.0)
    f1, f2 = (np.where(empty, 0.0, before) for before in (state.f1_mps, state.f2_mps))
    f1, f2 = as_written(cascaded)(f1, f2, rate, alpha)
    measured = going | starting
    new = {
        "f1_mps": f1,
        "f2_mps": f2,
        "since_s": np.where(measured, 0.0, since_s),
        "age_s": np.where(going, age_s + since_s, age_s),
    }
    return new, np.where(going, f2, np.nan)


def settled(state: DivergenceState, params: DivergenceParams) -> BoolArray:
    """Where the filter has a measurement now and has run for ``params.settle_s``: its statistic counts.

    Returns
    -------
    (..., N_SATS) bool array
    """
    result: BoolArray = (state.age_s >= params.settle_s) & (state.since_s == 0.0)
    return result


def ramp_response(n: NDArray[np.integer] | FloatArray, alpha: float) -> FloatArray:
    """F2 over d, n epochs after a ramp began to act on a settled filter: ``1 - (1 + a n) (1 - a)^n``.

    Parameters
    ----------
    n : array
        Epochs since the last one without the ramp; 0 and below: not begun.
    alpha : float
        T / tau, within 0 (excluded) and 1.

    Returns
    -------
    array
        [-].

    Raises
    ------
    ValueError
        When `alpha` is out of bounds.

    Source: z-transform of ENC 2015, eq (3) and (4), for a unit step of the rate; its limit is eq (6).
    """
    if not 0.0 < alpha <= 1.0:
        raise ValueError(f"alpha is {alpha}: it must be above 0 and at most 1")
    count = np.maximum(np.asarray(n, dtype=np.float64), 0.0)
    return np.asarray(1.0 - (1.0 + alpha * count) * (1.0 - alpha) ** count)


def white_noise_gain(alpha: float) -> float:
    """Standard deviation of F2 over that of white noise in the value, times T.

    For independent errors of standard deviation s in z, that of a settled F2 is this times ``s / T``. The rate of
    white noise is not white but blue, and the filter takes away far more of it than of a white rate.

    Source: ours, the power of the impulse response ``a^2 (h_n - h_{n-1})`` with ``h_n = (n + 1) (1 - a)^n``, which is
    ``2 a^3 / (2 - a)^3`` exactly; ``a^3 / 4`` for small a. ENC 2015, eq (7) has ``a / 4``: that is for a white rate.
    """
    if not 0.0 < alpha <= 1.0:
        raise ValueError(f"alpha is {alpha}: it must be above 0 and at most 1")
    return float(np.sqrt(2.0 * alpha**3 / (2.0 - alpha) ** 3))


def white_noise_correlation(alpha: float) -> float:
    """Correlation of F2 between successive epochs for white noise in the value, of a settled filter [-].

    Noise that is itself correlated, and a white rate, leave F2 smoother: this is the least correlation there is to
    expect, 0.967 for T = 0.5 s and tau = 30 s (continuous: ``(1 - t / tau) exp(-t / tau)``).

    Source: ours, autocovariance of the impulse response of :func:`white_noise_gain`, ``(q^2 + 2 q - 1) / 2`` exactly
    with ``q = 1 - a``.
    """
    if not 0.0 < alpha <= 1.0:
        raise ValueError(f"alpha is {alpha}: it must be above 0 and at most 1")
    q = 1.0 - alpha
    return 0.5 * (q * q + 2.0 * q - 1.0)


def white_rate_gain(alpha: float) -> float:
    """Standard deviation of F2 over that of a white rate.

    Source: power of ``a^2 (n + 1) (1 - a)^n``, which is ``a (1 + q^2) / (1 + q)^3`` exactly with ``q = 1 - a``;
    ``a / 4`` for small a, ENC 2015, eq (7).
    """
    if not 0.0 < alpha <= 1.0:
        raise ValueError(f"alpha is {alpha}: it must be above 0 and at most 1")
    q = 1.0 - alpha
    return float(np.sqrt(alpha * (1.0 + q * q) / (1.0 + q) ** 3))
