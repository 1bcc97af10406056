"""Differential error of two carrier-smoothed ranges, ground and air, under a divergence that begins at one time.

Time is counted in samples from the fault's onset: the ramp is ``d T n`` from n = 0 on. Smoothing with the carrier is a
low-pass of code minus carrier added to the carrier, and the carrier cancels between ground and air; what is left
depends only on the rate of code minus carrier. A ramp on the code of +d and one on the carrier of -d therefore give the
same error, and both together twice that.

Two starts of a filter, as in the paper: *variant*, the m-th update weighs ``max(1/m, T/tau)`` (the time constant grows
with the filter's age), and *invariant*, always ``T/tau``. The first state is the raw code. A filter that started at
sample s before the fault at rest, and one that starts later has no lag to begin with.

Source: ENC 2015, eq (19) to (23) and 4; the closed forms are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.record import FloatArray

Start = Literal["variant", "invariant"]
LONG_BEFORE: Final = -(10**6)
"""Start of a filter that has settled, in samples."""


class StudyError(ValueError):
    """A study that was asked for something that does not exist."""


def start_of(text: str) -> Start:
    """The start of a filter by its name.

    Raises
    ------
    StudyError
        For another name.
    """
    for start in get_args(Start):
        if text == start:
            return cast(Start, start)
    raise StudyError(f"start of the filter {text!r} is not one of {', '.join(get_args(Start))}")


@dataclass(frozen=True, kw_only=True)
class Smoothing:
    """Filters of both ends and when the air uses its own.

    Attributes
    ----------
    interval_s, tau_s : float
        T and the time constant [s].
    start : {"variant", "invariant"}
        Of the airborne filter, and of the ground filter if that is young.
    delay_s : float
        Delay to incorporation: the range is used when the air filter has so many seconds of samples, the first
        included (50 s are 100 samples, 99 updates) [s].
    ground_age_s : float
        t_g: time from the ground filter's start to the fault's onset; infinite: it has settled [s].
    ground_settle_s : float
        Time from the ground filter's start until the station lets the range be used; the paper has none [s].
    """

    interval_s: float = 0.5
    tau_s: float = 30.0
    start: Start = "variant"
    delay_s: float = 50.0
    ground_age_s: float = float("inf")
    ground_settle_s: float = 0.0

    def __post_init__(self) -> None:
        start_of(self.start)
        for name in ("ground_age_s", "ground_settle_s"):
            if not getattr(self, name) >= 0.0:
                raise StudyError(f"{name} is {getattr(self, name)}: it must be at least 0 s")
        if not np.isfinite(self.ground_settle_s):
            raise StudyError("ground_settle_s is not finite: the range would never be used")
        for name in ("interval_s", "tau_s", "delay_s"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise StudyError(f"{name} is {value}: it must be above 0 s")
        if not self.interval_s <= self.tau_s:
            raise StudyError(f"interval_s is {self.interval_s}: it must be at most tau_s, {self.tau_s}")

    @property
    def alpha(self) -> float:
        """T / tau [-]."""
        return self.interval_s / self.tau_s

    @property
    def ground_start(self) -> int:
        """Start of the ground filter in samples from the onset."""
        return -round(min(self.ground_age_s / self.interval_s, -LONG_BEFORE))

    @property
    def released(self) -> int:
        """First sample at which the station lets the range be used."""
        return self.ground_start + round(self.ground_settle_s / self.interval_s)

    @property
    def updates(self) -> int:
        """Updates of the air filter when its range is first used."""
        return round(self.delay_s / self.interval_s) - 1


def smoothed_cmc_s(start: ArrayLike, sample: ArrayLike, smoothing: Smoothing) -> FloatArray:
    """Smoothed less carrier range over the rate of code minus carrier, in closed form.

    Parameters
    ----------
    start, sample : arrays of int
        When the filter starts and when it is looked at, in samples from the onset; they broadcast.
    smoothing : Smoothing

    Returns
    -------
    array
        Metres for a rate of 1 m/s, so seconds; NaN before the filter's start.
    """
    begun = np.asarray(start, dtype=np.float64)
    n = np.asarray(sample, dtype=np.float64)
    alpha, interval_s = smoothing.alpha, smoothing.interval_s
    q, final_lag = 1.0 - alpha, (1.0 - alpha) / alpha
    acting = np.maximum(n, 0.0)
    # Lags in samples. A filter of constant weight starts to lag at the onset, or at its own start.
    lag = final_lag * (1.0 - q ** np.maximum(n - np.maximum(begun, 0.0), 0.0))
    if smoothing.start == "variant":
        filling = np.floor(1.0 / alpha + 1e-9)  # updates that weigh 1/m
        m = n - begun
        young = np.minimum(m, filling)
        # While it fills, the filter is the mean of the samples after the first one.
        behind = np.maximum(-begun, 0.0)  # updates before the onset
        ramp = np.maximum(young - behind, 0.0)
        mean = np.where(begun >= 0.0, begun + 0.5 * (young + 1.0), ramp * (ramp + 1.0) / (2.0 * np.maximum(young, 1.0)))
        lag_filled = np.maximum(begun + young, 0.0) - np.where(young > 0.0, mean, np.maximum(begun, 0.0))
        aged = final_lag - (final_lag - lag_filled) * q ** np.maximum(m - filling, 0.0)
        # Filled before the onset: nothing is left of the start.
        lag = np.where(behind >= filling, lag, np.where(m <= filling, lag_filled, aged))
    return np.asarray(np.where(n >= begun, interval_s * (acting - lag), np.nan))


def unit_error_s(
    air_start: ArrayLike, smoothing: Smoothing, *, ground_start: int | None = None, later: ArrayLike = 0
) -> FloatArray:
    """Differential error, air less ground, over the rate of code minus carrier, when the air first uses the range.

    Parameters
    ----------
    air_start : array of int
        Start of the air filter in samples from the onset, ``(t_a - t_f) / T``.
    smoothing : Smoothing
    ground_start : int
        The same of the ground filter; as in `smoothing` when not given.
    later : array of int
        Samples after the first use.

    Returns
    -------
    array
        [s]; NaN before the ground filter's start.
    """
    sample = evaluation_sample(air_start, smoothing) + np.asarray(later)
    ground = smoothing.ground_start if ground_start is None else ground_start
    return smoothed_cmc_s(air_start, sample, smoothing) - smoothed_cmc_s(ground, sample, smoothing)


def largest_error_s(since_s: ArrayLike, smoothing: Smoothing, *, oldest_s: float = 600.0) -> FloatArray:
    """Largest differential error over the rate of code minus carrier, over all users, at times since the onset.

    Parameters
    ----------
    since_s : (n,) array
        Whole intervals of the filters [s].
    smoothing : Smoothing
    oldest_s : float
        Users whose filter started up to so long before the onset, and at least the delay to incorporation ago [s].

    Returns
    -------
    (n,) array
        Metres for 1 m/s, so seconds; 0 where nobody uses the range.
    """
    sample = np.rint(np.asarray(since_s, dtype=np.float64) / smoothing.interval_s)
    start = np.arange(-round(oldest_s / smoothing.interval_s), sample.max() - smoothing.updates + 1.0)
    ground = smoothed_cmc_s(smoothing.ground_start, sample, smoothing)
    error = np.abs(smoothed_cmc_s(start[:, np.newaxis], sample, smoothing) - ground)
    used = (start[:, np.newaxis] <= sample - smoothing.updates) & (sample >= smoothing.released)
    error = np.where(used, error, 0.0)
    return np.asarray(error.max(axis=0, initial=0.0))


def evaluation_sample(air_start: ArrayLike, smoothing: Smoothing) -> FloatArray:
    """Sample at which the air first uses the range, from the onset."""
    return np.asarray(air_start, dtype=np.float64) + smoothing.updates


def stepped_error_m(
    code_rate_mps: float, carrier_rate_mps: float, air_start: int, n_samples: int, smoothing: Smoothing, *,
    ground_start: int = -720,
) -> FloatArray:  # fmt: skip
    """The same in the time domain, by the suite's own smoothing filter.

    Parameters
    ----------
    code_rate_mps, carrier_rate_mps : float
        Rates of the fault [m/s].
    air_start, ground_start : int
        In samples from the onset.
    n_samples : int
        Last sample, from the onset.
    smoothing : Smoothing

    Returns
    -------
    (n_samples - air_start + 1,) array
        Air less ground from the air filter's start on [m].
    """
    first = min(air_start, ground_start)
    params = SmoothingParams(
        tau_s=(smoothing.tau_s,), start="elapsed" if smoothing.start == "variant" else "invariant",
        max_gap_s=10.0 * smoothing.interval_s,
    )  # fmt: skip
    state = initial_smoothing(params, n_sats=2)
    begins = np.array([air_start, ground_start])
    errors = []
    for number in range(first, n_samples + 1):
        ramp_s = smoothing.interval_s * max(number, 0)
        running = number >= begins
        code = np.where(running, code_rate_mps * ramp_s, np.nan)
        carrier = np.where(running, carrier_rate_mps * ramp_s, np.nan)
        state, smoothed = smooth_step(
            state, code, carrier, np.zeros(2, dtype=bool), smoothing.interval_s if number > first else np.nan, params
        )
        if number >= air_start:
            errors.append(smoothed[0, 0] - smoothed[0, 1])
    return np.array(errors)
