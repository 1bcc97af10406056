"""Sigma monitor: do the B values, over minutes and hours, stay within what the broadcast sigma says?

A B value over its sigma should have mean zero and a variance of at most one. Over a short and a long window both are
estimated for every channel, and the variance also for every receiver, over its satellites. A mean off zero is a bias
the sigma does not know of; a variance above one is a sigma that no longer bounds.

B values come from smoothed ranges, so neighbours in time are nearly the same number: a window of an hour holds some
twenty that are independent. Thresholds therefore come from the distribution of the estimates of a correlated Gaussian
process: the variance estimate is a sum of chi-square variables weighted with the eigenvalues of the weighted
correlation matrix, and its tail is that sum's (saddle point). A chi-square distribution with as many effective degrees
of freedom has the right variance, but its tail at 1e-9 is too thin by a factor of up to 2000.

It is slow: what it finds at once is several times the sigma; half again as much takes the long window. Faults of a
single epoch are the B value check's (:mod:`~gbas_ground.monitors.b_value`).

Axes: windows W, smoothing constants T, receivers R, satellites N.

Source: Lee, Pullen, Enge, Sigma-mean monitoring for the local area augmentation of GPS, IEEE Trans. AES 42 (2006)
(principle: estimates of mean and sigma of normalised B values over hours); Lugannani, Rice, Adv. Appl. Prob. 12 (1980),
pp. 475-490 (tail). The recursion and the thresholds are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final, NamedTuple

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal
from scipy.optimize import brentq
from scipy.special import chdtri, ndtr, ndtri

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_ground.monitors.false_alarm import EXPOSURE_S, FALSE_EXCLUSION
from gbas_ground.monitors.kernels import sigma as kernels
from gbas_ground.monitors.result import MonitorResult

_ROOT_2_PI: Final = float(np.sqrt(2.0 * np.pi))


@parameters
class SigmaMonitorParams:
    """Mean and spread of the B values over time.

    The correlation time is that of the filter and of a minute or so of multipath. Uncertain, ours; two geodetic
    receivers of 2010 have some 90 s with either constant. Too short a time raises false alarms, too long a time
    thresholds.
    """

    exclude: Annotated[bool, Parameter("channels and receivers that fail are excluded")] = True
    window_s: Annotated[
        tuple[float, ...], Parameter("time constants; each starts as a plain mean", "s", 60.0, 86_400.0)
    ] = (1800.0, 7200.0)
    correlation_s: Annotated[
        tuple[float, float],
        Parameter("correlation time of the B values of each smoothing constant, 100 and 30 s", "s", 1.0, 3600.0),
    ] = (160.0, 110.0)
    sample_s: Annotated[
        float, Parameter("between the values taken: those between would add next to nothing", "s", 0.5, 600.0)
    ] = 50.0
    forget_s: Annotated[float, Parameter("a channel not seen for longer starts anew", "s", 1.0, 86_400.0)] = 1800.0
    p_false_alarm: Annotated[
        float, Parameter("of one source in 15 s, over all windows, smoothing constants and receivers", "-", 1e-12, 0.5)
    ] = FALSE_EXCLUSION

    def __post_init__(self) -> None:
        if not self.window_s:
            raise ParameterError("window_s = () is not one time constant or more")
        if not self.sample_s <= min(self.window_s):
            raise ParameterError(f"sample_s = {self.sample_s} is longer than the shortest window")

    def share(self, n_receivers: int) -> float:
        """False alarm probability of one statistic at one sample."""
        tests = len(self.window_s) * len(self.correlation_s) * (2 * n_receivers + 1)
        return self.p_false_alarm * max(1.0, self.sample_s / EXPOSURE_S) / tests


def window_weights(count: int, window_s: float, sample_s: float) -> FloatArray:
    """Weights of the samples in an estimate after `count` of them, the oldest first; their sum is one.

    A plain mean at first, exponential once it holds a window.
    """
    steady = -np.expm1(-sample_s / window_s)
    newest = np.maximum(1.0 / np.arange(1, count + 1), steady)
    kept = np.cumprod((1.0 - newest[::-1])[:-1])[::-1]
    return np.asarray(newest * np.concatenate([kept, [1.0]]))


def _saddle(eigenvalues: FloatArray, freedom: int, t: float) -> tuple[float, float]:
    """Value of the sum that belongs to a saddle point t above 0, and the probability of a larger one."""
    left = 1.0 - 2.0 * eigenvalues * t
    value = freedom * float((eigenvalues / left).sum())
    w = np.sqrt(2.0 * t * value + freedom * np.log(left).sum())
    u = t * np.sqrt(2.0 * freedom * ((eigenvalues / left) ** 2).sum())
    return value, float(ndtr(-w) + np.exp(-0.5 * w**2) / _ROOT_2_PI * (1.0 / u - 1.0 / w))


def quadratic_quantile(eigenvalues: FloatArray, probability: float, freedom: int = 1) -> float:
    """Value that a weighted sum of chi-square variables exceeds with a probability.

    Parameters
    ----------
    eigenvalues : (n,) array
        Weights, all above 0.
    probability : float
        0.1 or less.
    freedom : int
        Degrees of freedom of each variable.

    Source: Lugannani, Rice, 1980; the probability is good to a few percent.
    """
    largest = float(eigenvalues.max())
    if eigenvalues.size == 1:
        return largest * float(chdtri(freedom, probability))
    # from a thousandth of the way to the pole, where the tail is nearly a half, to where it underflows
    t = brentq(
        lambda t: np.log(max(_saddle(eigenvalues, freedom, t)[1], 1e-300) / probability),
        1e-3 * 0.5 / largest,
        (1.0 - 1e-9) * 0.5 / largest,
        xtol=1e-13 / largest,
    )
    return _saddle(eigenvalues, freedom, t)[0]


class _Tables(NamedTuple):
    """Thresholds by the number of samples: those of a number count until the next one in `counts` is reached."""

    steady: FloatArray  # (W,), weight of a sample once a window is full
    full: FloatArray  # (W,), samples that fill it
    counts: FloatArray  # (G,)
    limits: FloatArray  # (2, W, T, G), of mean and variance
    receiver: FloatArray  # (W, T, N + 1), by satellites in the mean over a receiver


def estimate_distribution(
    count: int, window_s: float, correlation_s: float, sample_s: float
) -> tuple[float, FloatArray]:
    """Variance of the mean, and eigenvalues of the variance estimate, for B values over their sigma.

    Parameters
    ----------
    count : int
        Samples.
    window_s, correlation_s, sample_s : float
        [s].

    Returns
    -------
    variance : float
        Of the weighted mean of samples of unit variance, correlated like ``exp(-t / correlation)``.
    eigenvalues : (n,) array
        The weighted mean of their squares is the sum of these times chi-square variables; they sum to one.
    """
    weights = window_weights(count, window_s, sample_s)
    rho = float(np.exp(-sample_s / correlation_s))
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    variance = float(weights @ rho**apart @ weights)
    if count == 1:
        return variance, weights
    # The inverse of the correlation matrix has three diagonals, and its eigenvalues come in no time.
    inner = np.full(count, 1.0 + rho**2)
    inner[[0, -1]] = 1.0
    root = np.sqrt(weights)
    inverse = eigvalsh_tridiagonal(inner / weights / (1.0 - rho**2), -rho / (root[1:] * root[:-1]) / (1.0 - rho**2))
    return variance, np.asarray(1.0 / inverse, dtype=np.float64)


@lru_cache(maxsize=16)
def _tables(params: SigmaMonitorParams, n_receivers: int) -> _Tables:
    share = params.share(n_receivers)
    longest = int(np.ceil(4.0 * max(params.window_s) / params.sample_s))
    counts = np.unique(np.geomspace(1, longest, 24).astype(np.int64))
    shape = (len(params.window_s), len(params.correlation_s))
    limits = np.zeros((2, *shape, counts.size))
    receiver = np.full((*shape, N_SATS + 1), np.inf)
    for place in np.ndindex(shape):
        window, correlation = params.window_s[place[0]], params.correlation_s[place[1]]
        for number, count in enumerate(counts):
            # beyond four windows nothing changes any more
            used = min(int(count), int(np.ceil(4.0 * window / params.sample_s)))
            spread, eigenvalues = estimate_distribution(used, window, correlation, params.sample_s)
            limits[0, *place, number] = -ndtri(0.5 * share) * np.sqrt(spread)
            limits[1, *place, number] = quadratic_quantile(eigenvalues, share)
        _, eigenvalues = estimate_distribution(_full(window, params), window, correlation, params.sample_s)
        for satellites in range(1, N_SATS + 1):
            receiver[*place, satellites] = quadratic_quantile(eigenvalues / satellites, share, satellites)
    steady = -np.expm1(-params.sample_s / np.array(params.window_s))
    full = np.array([float(_full(window, params)) for window in params.window_s])
    return _Tables(steady, full, counts.astype(np.float64), limits, receiver)


def _full(window_s: float, params: SigmaMonitorParams) -> int:
    """Samples that fill a window."""
    return max(1, round(window_s / params.sample_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class SigmaMonitorState:
    """Estimates of every channel.

    Attributes
    ----------
    estimates : (2, W, T, R, N) array
        Weighted means of the normalised B values and of their squares.
    samples : (2, R, N) array
        Samples taken; time since the last one [s].
    """

    estimates: FloatArray
    samples: FloatArray

    @property
    def count(self) -> FloatArray:
        """Samples taken, ``(R, N)``."""
        return np.asarray(self.samples[0])

    @property
    def since_s(self) -> FloatArray:
        """Time since the last one, ``(R, N)`` [s]."""
        return np.asarray(self.samples[1])


def initial_sigma_monitor(n_receivers: int, params: SigmaMonitorParams) -> SigmaMonitorState:
    """A monitor that has seen nothing; makes the tables of thresholds, which takes half a second once."""
    _tables(params, n_receivers)
    shape = (2, len(params.window_s), len(params.correlation_s), n_receivers, N_SATS)
    return SigmaMonitorState(estimates=np.zeros(shape), samples=np.zeros((2, *shape[3:])))


class SigmaMonitorResult(NamedTuple):
    """What was found; statistics are those of the last sample of each channel.

    Attributes
    ----------
    channels : MonitorResult
        ``(2, W, T, R, N)``: size of the mean of the normalised B values, and their mean square.
    receivers : MonitorResult
        ``(W, T, R)``: mean square over the satellites that have filled the window. NaN, and not failed, without one.
    """

    channels: MonitorResult
    receivers: MonitorResult

    @property
    def mean(self) -> MonitorResult:
        """Size of the mean, ``(W, T, R, N)``."""
        return MonitorResult(*(each[0] for each in self.channels))

    @property
    def variance(self) -> MonitorResult:
        """Mean square, ``(W, T, R, N)``."""
        return MonitorResult(*(each[1] for each in self.channels))


def normalised_b(b_m: FloatArray, sigma_m: FloatArray, used: BoolArray) -> FloatArray:
    """B values over their sigmas, ``(T, R, N)``; NaN where there is none.

    Parameters
    ----------
    b_m : (T, R, N) array
        B values [m].
    sigma_m : (T, N) array
        Sigma of one receiver's correction, :func:`~gbas_ground.monitors.b_value.channel_sigma_m` [m].
    used : (R, N) bool array
        Receivers behind each satellite.

    Notes
    -----
    Sigma of a B value is that sigma over sqrt(M (M - 1)).
    """
    normalised = np.empty(b_m.shape)
    kernels.normalise(b_m, sigma_m, used, normalised)
    return normalised


def sigma_monitor_step(
    state: SigmaMonitorState, normalised: FloatArray, due: BoolArray, dt_s: float, params: SigmaMonitorParams
) -> tuple[SigmaMonitorState, SigmaMonitorResult]:
    """Take samples of one epoch and test.

    Parameters
    ----------
    state : SigmaMonitorState
    normalised : (T, R, N) array
        From :func:`normalised_b`, with the sigma that is broadcast.
    due : (R, N) bool array
        Channels that must be monitored: those with a B value. One that never had a sample fails.
    dt_s : float
        Time since the epoch before [s]; NaN at the first. However long, it only delays the next sample.
    params : SigmaMonitorParams

    Returns
    -------
    state : SigmaMonitorState
    result : SigmaMonitorResult

    Notes
    -----
    The weight of a sample depends on their number alone, not on the time between them: after a gap the samples are less
    correlated than the thresholds take them to be, which is the safe side.
    """
    tables = _tables(params, len(due))
    shape = state.estimates.shape
    estimates, samples = np.empty(shape), np.empty(state.samples.shape)
    found, failed = np.empty((2, *shape)), np.empty(shape, dtype=bool)
    pooled, pooled_failed = np.empty((2, *shape[1:4])), np.empty(shape[1:4], dtype=bool)
    kernels.step(
        state.estimates,
        state.samples,
        normalised,
        due,
        float(dt_s),
        float(params.sample_s),
        float(params.forget_s),
        *tables,
        estimates,
        samples,
        found,
        failed,
        pooled,
        pooled_failed,
    )
    return SigmaMonitorState(estimates=estimates, samples=samples), SigmaMonitorResult(
        channels=MonitorResult(statistic=found[0], threshold=found[1], failed=failed),
        receivers=MonitorResult(statistic=pooled[0], threshold=pooled[1], failed=pooled_failed),
    )
