"""Excessive acceleration, carrier rate and carrier step: does a satellite's carrier go on as it went?

Over the last few epochs the carrier without geometry, satellite clock and troposphere is

    phi* = a + b t + c t^2 / 2,

with the receiver's clock in it. The clock at each epoch is the weighted mean of the satellites that were there all the
time, all but the one it is taken off. Three statistics of each channel are left: the newest carrier against the line
through those before it (step), the slope (rate) and c (acceleration); and each of them again averaged over the
receivers, because what a satellite does all receivers see, with independent noise.

One channel in three or more that fails alone is the channel's fault and has no part in the satellite's average; two, or
one of two, are the satellite's.

Axes: statistics S = 3, receivers R, bands F, satellites N.

Source: Xie, Pullen, Luo, Normark, Akos, Lee, Enge, Pervan, Integrity design and updated test results for the Stanford
LAAS integrity monitor testbed, ION AM 2001 (principle: acceleration, ramp and step of the carrier over some epochs);
Jiang, Milner, Macabiau, ENC 2015 (budget). The removal of the clocks and the thresholds are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from scipy.stats import binom

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.expected_range import row_median
from gbas_ground.monitors.false_alarm import EPOCH_S, EXPOSURE_S, FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.result import MonitorResult, upper_limit

STATISTICS: Final = ("step_m", "rate_mps", "acceleration_mps2")
Fault = Literal["step", "ramp", "acceleration"]
Triple = tuple[float, float, float]
_LEAST_POINTS: Final = 4  # a parabola and one to spare
_MOST_OTHERS: Final = 35
FAULT_RATE_PER_H: Final = 1e-5
"""Faults of one satellite. Known: GPS SPS Performance Standard 2020, major service failures."""


def fewest_others(p_false_alarm: float) -> int:
    """Fewest other satellites a receiver's clock may be taken from.

    A fault of another satellite is in that clock, and with one other a fault of either looks the same: of two, the one
    at fault is further from the clock of the rest. So two have to be left when all that fault at once are out of the
    set, and more than so many may fault only with less than the budget.

    Parameters
    ----------
    p_false_alarm : float
        For one source in 15 s.
    """
    faults = 0
    while binom.sf(faults, _MOST_OTHERS, FAULT_RATE_PER_H * EXPOSURE_S / 3600.0) > p_false_alarm:
        faults += 1
    return faults + 2


FEWEST_OTHERS: Final = fewest_others(FALSE_EXCLUSION)


@parameters
class CarrierAccelerationParams:
    """Step, rate and acceleration of the carriers.

    The noise is that between epochs: white, so less than that of the gradient monitor, which has slow multipath in it.
    What the receivers share (satellite clocks, ionosphere) and what is natural are uncertain, ours: 0.1 m/s is more
    than the ionosphere did in the storm of 30 October 2003 (0.06 to 0.09 m/s on L1), and enters and leaves the
    corrections as it should. The first of the bands is due wherever a channel is, the others where there are epochs
    enough.
    """

    exclude: Annotated[bool, Parameter("satellites and channels that fail are excluded")] = True
    window_s: Annotated[float, Parameter("oldest epoch in the fit", "s", 1.0, 600.0)] = 5.0
    points: Annotated[int, Parameter("most epochs in the fit", "-", _LEAST_POINTS, 120)] = 10
    least_points: Annotated[int, Parameter("fewest epochs in it", "-", _LEAST_POINTS, 120)] = 5
    min_satellites: Annotated[
        int, Parameter("others a receiver's clock is taken from (fewest_others)", "-", 2, 35)
    ] = FEWEST_OTHERS  # fmt: skip
    common: Annotated[
        Triple, Parameter("sigma of step, rate and acceleration that all receivers share", "m, m/s, m/s2", 0.0, 1.0)
    ] = (0.0015, 0.001, 0.0005)
    natural: Annotated[
        Triple, Parameter("largest step, rate and acceleration that are no fault", "m, m/s, m/s2", 0.0, 10.0)
    ] = (0.0, 0.1, 0.005)
    p_false_alarm: Annotated[
        float, Parameter("of one source in 15 s, over all statistics, bands and receivers", "-", 1e-12, 0.5)
    ] = FALSE_EXCLUSION
    max_gap_s: Annotated[float, Derived("longest gap, that of the smoothing", "s", 0.1, 3600.0)] = 3.5
    receiver_factor: Annotated[
        tuple[float, ...], Derived("on the sigma of rr1, rr2, ..., or one for all", "-", 0.1, 10.0)
    ] = (1.0,)
    bands: Annotated[tuple[int, ...], Derived("carriers tested", "-", 0, N_BANDS - 1)] = (L1, L5)
    interval_s: Annotated[float, Derived("between epochs, for the budget", "s", 0.01, 3600.0)] = EPOCH_S

    def __post_init__(self) -> None:
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ParameterError(f"bands = {self.bands} is not one or more, each once")
        if self.least_points > self.points:
            raise ParameterError(f"least_points = {self.least_points} is more than points = {self.points}")

    @cached_property
    def noise(self) -> CarrierNoise:
        """Noise between epochs."""
        return CarrierNoise(
            floor_m=(0.0015, 0.0015, 0.003), low_m=(0.006, 0.006, 0.010), receiver_factor=self.receiver_factor
        )

    def multiplier(self, n_receivers: int) -> float:
        """Standard deviations of every threshold: each channel and the average can exclude the source."""
        tests = len(STATISTICS) * len(self.bands) * (n_receivers + 1)
        return false_alarm_multiplier(self.p_false_alarm, tests=tests, interval_s=self.interval_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class CarrierAccelerationState:
    """The last epochs, the newest first.

    Attributes
    ----------
    residual_m : (W, R, F, N) array
        Carriers without geometry; NaN where there is none, or one that does not belong to the newest [m].
    age_s : (W,) array
        Time before the newest epoch; NaN where there is none [s].
    unseen_s : (R, F, N) array
        Time since each carrier was last there; NaN if it never was [s].
    """

    residual_m: FloatArray
    age_s: FloatArray
    unseen_s: FloatArray


def initial_carrier_acceleration(n_receivers: int, params: CarrierAccelerationParams) -> CarrierAccelerationState:
    """A monitor that has seen nothing."""
    return CarrierAccelerationState(
        residual_m=np.full((params.points, n_receivers, len(params.bands), N_SATS), np.nan),
        age_s=np.full(params.points, np.nan),
        unseen_s=np.full((n_receivers, len(params.bands), N_SATS), np.nan),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class CarrierAccelerationResult:
    """What was found.

    Attributes
    ----------
    channels : MonitorResult
        ``(S, R, F, N)``: size of the statistics of each channel, in the order of :data:`STATISTICS`.
    satellites : MonitorResult
        ``(S, F, N)``: averaged over the receivers. Also failed where channels of several receivers are.
    failed_channels : (R, N) bool array
        Channels that failed alone, or had no statistic.
    failed_satellites : (N,) bool array
    """

    channels: MonitorResult
    satellites: MonitorResult
    failed_channels: BoolArray
    failed_satellites: BoolArray


def carrier_acceleration_step(
    state: CarrierAccelerationState,
    residual_m: FloatArray,
    restarted: BoolArray,
    due: BoolArray,
    elevation_rad: FloatArray,
    dt_s: float,
    params: CarrierAccelerationParams,
    *,
    shift_m: FloatArray | None = None,
) -> tuple[CarrierAccelerationState, CarrierAccelerationResult]:
    """Test one epoch.

    Parameters
    ----------
    state : CarrierAccelerationState
    residual_m : (R, F, N) array
        From :func:`~gbas_ground.monitors.double_difference.carrier_residual_m`, `params.bands` [m].
    restarted : (R, F, N) bool array
        Carriers that do not go on from the epoch before.
    due : (R, N) bool array
        Channels that must be monitored: a missing statistic fails.
    elevation_rad : (N,) array
    dt_s : float
        Time since the epoch before [s]; NaN at the first.
    params : CarrierAccelerationParams
    shift_m : (R, N) array, optional
        Residual of this epoch less what it would be with the ephemerides of the epoch before: what a new ephemeris
        changes, 0 elsewhere [m]. Without it, a new ephemeris is a step.

    Returns
    -------
    state : CarrierAccelerationState
    result : CarrierAccelerationResult
    """
    if shift_m is not None:
        state = replace(state, residual_m=state.residual_m + shift_m[:, np.newaxis])
    state = _with_epoch(state, residual_m, restarted, dt_s, params)
    here = np.flatnonzero(np.isfinite(residual_m).any(axis=(0, 1)))
    sigma = params.noise.factors(len(residual_m))[:, np.newaxis, np.newaxis] * params.noise.sigma_m(
        elevation_rad[here], params.bands
    )
    k = params.multiplier(len(residual_m))
    known = _judged(state.residual_m[..., here], state.age_s, sigma, k, params)
    shape = (len(STATISTICS), *residual_m.shape)
    values = np.full((3, *shape), np.nan)
    values[..., here] = known
    first = (np.arange(len(params.bands)) == 0)[:, np.newaxis]
    wanted = due[:, np.newaxis] & (first | np.isfinite(values[0, 0]))
    return state, _concluded(_Known(*values), wanted, k, params)


def _with_epoch(
    state: CarrierAccelerationState,
    residual_m: FloatArray,
    restarted: BoolArray,
    dt_s: float,
    params: CarrierAccelerationParams,
) -> CarrierAccelerationState:
    """The newest epoch in front; what does not belong to it is forgotten."""
    goes_on = 0.0 < dt_s <= params.max_gap_s
    age = np.concatenate([[0.0], state.age_s[:-1] + dt_s])
    unseen = state.unseen_s + dt_s
    history = np.concatenate([residual_m[np.newaxis], state.residual_m[:-1]])
    in_window = age <= params.window_s if goes_on else np.arange(params.points) == 0
    if not in_window.all():
        history[~in_window] = np.nan
    lost = (restarted | (unseen > params.max_gap_s)) & np.isfinite(unseen)
    if lost.any():
        history[1:, lost] = np.nan
    return CarrierAccelerationState(
        residual_m=history,
        age_s=np.where(in_window, age, np.nan),
        unseen_s=np.where(np.isfinite(residual_m), 0.0, unseen),
    )


class _Known(NamedTuple):
    """Statistics, variances and thresholds, ``(S, R, F, n)``."""

    statistic: FloatArray
    variance: FloatArray
    threshold: FloatArray


def _judged(
    history_m: FloatArray, age_s: FloatArray, sigma_m: FloatArray, k: float, params: CarrierAccelerationParams
) -> _Known:
    """Statistics with the receivers' clocks taken from satellites that do not fail.

    When one fails, all whose step, rate or acceleration is beyond the threshold from the receiver's median leave its
    clock's set: a minority does not move the median, and a healthy satellite must not be the first to fail through the
    mean. Then the worst satellite of each receiver and band leaves, and all is computed again, until nobody in a set
    fails: a bad satellite must not be seen on the others through the clock.
    """
    change = history_m - history_m[0]
    there = np.isfinite(change)
    change = np.where(there, change, 0.0)
    powers = np.where(np.isfinite(age_s), -age_s, 0.0) ** np.arange(5.0)[:, np.newaxis]
    s = (powers @ there.reshape(len(there), sigma_m.size).astype(np.float64)).reshape(5, *sigma_m.shape)
    epochs = there.any(axis=-1, keepdims=True).sum(axis=0)
    in_set = (s[0] == epochs) & there[0] & (sigma_m > 0.0)
    first = True
    while True:
        known = _statistics(change, there, powers[:3], s, sigma_m, in_set, k, params)
        ratio = (np.abs(known.statistic) / known.threshold).max(axis=0)
        beyond = in_set & (ratio > 1.0)
        if not beyond.any():
            return known
        if first:
            first = False
            apart = in_set & _apart(change, powers[:3], s, in_set, known.threshold, params)
            if apart.any():
                in_set = in_set & ~apart
                continue
        in_set = in_set & ~(beyond & (ratio == np.where(beyond, ratio, 0.0).max(axis=-1, keepdims=True, initial=0.0)))


def _apart(
    change_m: FloatArray,
    powers: FloatArray,
    s: FloatArray,
    in_set: BoolArray,
    threshold: FloatArray,
    params: CarrierAccelerationParams,
) -> BoolArray:
    """Channels whose statistics, clock and all, are beyond the threshold from the median of the set, ``(R, F, n)``."""
    m = (powers @ change_m.reshape(len(change_m), in_set.size)).reshape(3, *in_set.shape)
    statistic, _ = _solved(s, m, params.least_points)
    known = in_set & np.isfinite(statistic).all(axis=0)
    middle = row_median(np.where(known, statistic, np.nan))
    return np.asarray(known & (np.abs(statistic - middle) > threshold).any(axis=0))


def _statistics(
    change_m: FloatArray,
    there: BoolArray,
    powers: FloatArray,
    s: FloatArray,
    sigma_m: FloatArray,
    in_set: BoolArray,
    k: float,
    params: CarrierAccelerationParams,
) -> _Known:
    """Least squares of each channel over the epochs it has; times count back from the newest, at zero.

    Notes
    -----
    With weights w_i in the clock, (phi_i - clock) / (1 - w_i) is phi_i less the mean of the others.
    """
    weight = np.where(in_set, sigma_m**-2, 0.0)
    total = weight.sum(axis=-1, keepdims=True)
    share = weight / np.where(total > 0.0, total, 1.0)
    clock = (change_m * share).sum(axis=-1, keepdims=True)  # the set has every epoch its receiver has
    free = (change_m - clock) * there / (1.0 - share)
    m = (powers @ free.reshape(len(free), sigma_m.size)).reshape(3, *sigma_m.shape)
    enough = in_set.sum(axis=-1, keepdims=True) - in_set >= params.min_satellites
    variance = sigma_m**2 + 1.0 / np.where(enough, total - weight, np.nan)
    statistic, gain = _solved(s, m, params.least_points)
    # what has no variance has no statistic
    spread = gain * variance
    return _Known(np.where(np.isnan(spread), np.nan, statistic), spread, _thresholds(spread, k, params))


def _solved(s: FloatArray, m: FloatArray, least_points: int) -> tuple[FloatArray, FloatArray]:
    """Step, rate and acceleration, and their variances for a variance of one, from sums of t^k and of t^k y.

    The newest epoch, at t = 0 with y = 0, is part of s_0 alone.
    """
    judged = s[0] >= least_points
    slope = np.where(judged, s[0] * s[2] - s[1] ** 2, np.nan)
    line = slope - s[2]  # the same without the newest
    # Cramer's rule for the coefficient of t^2, half the acceleration; the minors are those of its column.
    minor0 = s[1] * s[3] - s[2] ** 2
    minor1 = s[0] * s[3] - s[1] * s[2]
    parabola = minor0 * s[2] - minor1 * s[3] + slope * s[4]
    statistic = np.stack(
        [
            (s[1] * m[1] - s[2] * m[0]) / line,
            (s[0] * m[1] - s[1] * m[0]) / slope,
            2.0 * (minor0 * m[0] - minor1 * m[1] + slope * m[2]) / parabola,
        ]
    )
    return statistic, np.stack([1.0 + s[2] / line, s[0] / slope, 4.0 * slope / parabola])


def _thresholds(variance: FloatArray, k: float, params: CarrierAccelerationParams) -> FloatArray:
    column = (-1, *(1,) * (variance.ndim - 1))
    common, natural = np.array(params.common).reshape(column), np.array(params.natural).reshape(column)
    return np.asarray(k * np.sqrt(variance + common**2) + natural)


def _concluded(
    known: _Known, wanted: BoolArray, k: float, params: CarrierAccelerationParams
) -> CarrierAccelerationResult:
    statistic = known.statistic
    size = np.abs(statistic)
    channels = upper_limit(size, known.threshold, wanted[np.newaxis])
    # channels that are not due judge no satellite that others are due for; alone, they show how it would do
    there = np.isfinite(statistic[0]) & (wanted | ~wanted.any(axis=0))
    beyond = np.logical_or.reduce(size > known.threshold, axis=0) & there  # (R, F, N)
    number = beyond.sum(axis=0)
    alone = (number == 1) & (there.sum(axis=0) >= 3)
    taken = there & ~(beyond & alone)
    count = np.maximum(taken.sum(axis=0), 1)
    mean = np.where(taken.any(axis=0), np.where(taken, statistic, 0.0).sum(axis=1) / count, np.nan)
    spread = np.where(taken, known.variance, 0.0).sum(axis=1) / count**2
    due = np.broadcast_to(wanted.any(axis=0), mean.shape)
    averaged = upper_limit(np.abs(mean), _thresholds(spread, k, params), due)
    blamed = (number >= 1) & ~alone & due[0]
    satellites = MonitorResult(
        statistic=averaged.statistic, threshold=averaged.threshold, failed=averaged.failed | blamed
    )
    missing = wanted & ~there
    return CarrierAccelerationResult(
        channels=channels,
        satellites=satellites,
        failed_channels=((beyond & alone & wanted) | missing).any(axis=1),
        failed_satellites=np.asarray(satellites.failed.any(axis=(0, 1))),
    )


def fault_response(
    fault: Fault, since_s: float, params: CarrierAccelerationParams, interval_s: float = EPOCH_S
) -> FloatArray:
    """What a unit fault makes of the three statistics some time after its onset.

    Parameters
    ----------
    fault : {"step", "ramp", "acceleration"}
        1 m, 1 m/s or 1 m/s^2 from the onset on.
    since_s : float
        Age of the fault at the newest epoch [s].
    params : CarrierAccelerationParams
        The window is full.
    interval_s : float
        Between epochs [s].

    Returns
    -------
    (3,) array
        In the order of :data:`STATISTICS`.
    """
    age = np.arange(min(params.points, int(params.window_s / interval_s) + 1)) * interval_s
    grown = np.maximum(since_s - age, 0.0)
    signal = {"step": (since_s >= age).astype(np.float64), "ramp": grown, "acceleration": 0.5 * grown**2}[fault]
    change = signal - signal[0]
    powers = (-age) ** np.arange(5)[:, np.newaxis]
    return _solved(powers.sum(axis=1), powers[:3] @ change, params.least_points)[0]


def detectable_fault(
    fault: Fault,
    since_s: float,
    sigma_m: float,
    params: CarrierAccelerationParams,
    *,
    n_receivers: int = 1,
    k_md: float = 0.0,
    interval_s: float = EPOCH_S,
) -> float:
    """Smallest fault of a satellite that is found by its age `since_s` at the latest, in the fault's unit.

    Parameters
    ----------
    fault, since_s, params, interval_s
        As of :func:`fault_response`.
    sigma_m : float
        Sigma of one receiver's carrier less its clock [m].
    n_receivers : int
        Receivers averaged.
    k_md : float
        Standard deviations for missed detection; 0 is one half.
    """
    ages = np.arange(round(since_s / interval_s) + 1) * interval_s
    age = np.arange(min(params.points, int(params.window_s / interval_s) + 1)) * interval_s
    sums = ((-age) ** np.arange(5)[:, np.newaxis]).sum(axis=1)
    variance = _solved(sums, np.zeros(3), params.least_points)[1] * sigma_m**2 / n_receivers
    needed = _thresholds(variance, params.multiplier(n_receivers), params)
    needed = needed + k_md * np.sqrt(variance + np.array(params.common) ** 2)
    with np.errstate(divide="ignore"):
        sizes = [needed / np.abs(fault_response(fault, each, params, interval_s)) for each in ages]
    return float(np.min(sizes))
