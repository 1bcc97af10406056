"""The worst undetected differential error, and the smallest mapping function from error to statistic.

For each offset between the start of the air filter and the fault's onset, error and statistic are d times a unit
response: a grid of rates and offsets is an outer product. A point is undetected when the statistic does not exceed its
threshold at the sample of evaluation; the statistic grows with time, so that it did not before, either.

Without a grid of rates the worst rate at an offset is the one that just is not detected, so the worst error over all
rates up to `d_max` is known exactly at each offset.

Source: ENC 2015, 4 and 5, tables 3 to 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.ranging.divergence import ramp_response
from gbas_core.record import FloatArray
from gbas_studies.ccd.monitors import TAU_S, ErrorOn, Monitor, cmc_rate, error_band, monitor_for
from gbas_studies.ccd.smoothed_error import Smoothing, StudyError, evaluation_sample, unit_error_s

LEAST_ERROR_M = 1e-12
"""Smaller errors are none: they have no mapping function."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Rates and offsets of a sweep.

    Attributes
    ----------
    d_step_mps, d_max_mps : float
        Rates are the multiples of the step up to the maximum [m/s].
    onset_step_s, onset_max_s : float
        Offsets ``t_a - t_f`` are the multiples of the step within plus and minus the maximum [s].
    """

    d_step_mps: float = 0.01
    d_max_mps: float = 0.1
    onset_step_s: float = 1.0
    onset_max_s: float = 150.0

    def __post_init__(self) -> None:
        for step, most in (("d_step_mps", "d_max_mps"), ("onset_step_s", "onset_max_s")):
            small, large = getattr(self, step), getattr(self, most)
            if not (np.isfinite(large) and 0.0 < small <= large):
                raise StudyError(f"{step} is {small} and {most} {large}: they must be 0 < step <= maximum")
            if large / small > 1e6:
                raise StudyError(f"{step} is {small}: more than a million steps up to {large}")

    def rates_mps(self) -> FloatArray:
        """(D,) [m/s]."""
        count = int(np.floor(self.d_max_mps / self.d_step_mps + 1e-9))
        return np.round(self.d_step_mps * np.arange(1, count + 1, dtype=np.float64), 12)

    def offsets(self, interval_s: float) -> FloatArray:
        """(S,) offsets in samples.

        Raises
        ------
        StudyError
            When the step is not a whole number of samples.
        """
        stride = self.onset_step_s / interval_s
        if abs(stride - round(stride)) > 1e-9 or round(stride) < 1:
            problem = f"it must be a multiple of the interval, {interval_s} s"
            raise StudyError(f"onset_step_s is {self.onset_step_s}: {problem}")
        half = int(np.floor(self.onset_max_s / self.onset_step_s + 1e-9))
        return round(stride) * np.arange(-half, half + 1, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Responses to a divergence of 1 m/s at each offset.

    Attributes
    ----------
    offset_s : (S,) array
        ``t_a - t_f`` [s].
    error_s : (S,) array
        Size of the differential error over d [s].
    statistic : (S,) array
        Monitor's statistic over d: [-] for GAST D, [s/m] for GAST F (square root of the non-centrality).
    monitor : Monitor
    """

    offset_s: FloatArray
    error_s: FloatArray
    statistic: FloatArray
    monitor: Monitor


@dataclass(frozen=True, kw_only=True)
class Worst:
    """An extremum and where it is: value, rate [m/s], offset ``t_a - t_f`` [s]; NaN where there is none."""

    value: float
    d_mps: float
    onset_s: float


def response(
    mode: str, monitor: Monitor, smoothing: Smoothing, offsets: FloatArray, *, error_on: ErrorOn | None = None,
    exclusion_delay_s: float = 0.0,
) -> Response:  # fmt: skip
    """Unit responses of one mode.

    Parameters
    ----------
    mode : str
    monitor : Monitor
        As it sees the mode.
    smoothing : Smoothing
    offsets : (S,) array
        In samples.
    error_on : {"L1", "L5", "IF"}, optional
    exclusion_delay_s : float
        From the statistic's passing of its threshold to the satellite's exclusion at the user; the paper has none [s].
    """
    rate = cmc_rate(mode, error_on or error_band(mode))
    sample = evaluation_sample(offsets, smoothing)
    seen = ramp_response(sample - round(exclusion_delay_s / smoothing.interval_s), smoothing.interval_s / TAU_S)
    # A range that the station does not release yet makes no error.
    error_s = np.where(sample >= smoothing.released, np.abs(rate * unit_error_s(offsets, smoothing)), 0.0)
    return Response(
        offset_s=offsets * smoothing.interval_s,
        error_s=error_s,
        statistic=monitor.gain * seen,
        monitor=monitor,
    )


def worst_error(found: Response, rates_mps: FloatArray) -> Worst:
    """Largest undetected error over a grid of rates [m]."""
    error = np.where(
        rates_mps[:, np.newaxis] * found.statistic <= found.monitor.threshold,
        rates_mps[:, np.newaxis] * found.error_s,
        -np.inf,
    )
    return _at(error, rates_mps, found, int(np.argmax(error)))


def worst_error_any_rate(found: Response, d_max_mps: float) -> Worst:
    """The same over all rates up to `d_max_mps`, without a grid of them."""
    with np.errstate(divide="ignore"):
        rate = np.minimum(found.monitor.threshold / found.statistic, d_max_mps)
    error = rate * found.error_s
    place = int(np.argmax(error))
    return Worst(value=float(error[place]), d_mps=float(rate[place]), onset_s=float(found.offset_s[place]))


def smallest_mapping(found: Response, rates_mps: FloatArray) -> Worst:
    """Smallest ratio of the statistic to the error over a grid: F2/E [1/s], or non-centrality delta/E [1/m].

    Notes
    -----
    delta/E grows with d, so its minimum is at the smallest rate of the grid and halves with it. See
    :func:`scale_free_mapping`.
    """
    power = 1 if found.monitor.freedom == 0 else 2
    if power == 1:
        rates_mps = rates_mps[:1]  # the same for every rate, but for rounding
    error = rates_mps[:, np.newaxis] * found.error_s
    statistic = (rates_mps[:, np.newaxis] * found.statistic) ** power
    mapping = np.where(error > LEAST_ERROR_M, statistic / np.maximum(error, LEAST_ERROR_M), np.inf)
    return _at(mapping, rates_mps, found, int(np.argmin(mapping)))


def scale_free_mapping(found: Response) -> Worst:
    """Smallest ``sqrt(delta) / E`` [1/m] (or F2/E [1/s]), the same for every rate; the rate is therefore NaN."""
    ratio = np.where(found.error_s > LEAST_ERROR_M, found.statistic / np.maximum(found.error_s, LEAST_ERROR_M), np.inf)
    place = int(np.argmin(ratio))
    if not np.isfinite(ratio[place]):
        return Worst(value=float("inf"), d_mps=float("nan"), onset_s=float("nan"))
    return Worst(value=float(ratio[place]), d_mps=float("nan"), onset_s=float(found.offset_s[place]))


def _at(values: FloatArray, rates_mps: FloatArray, found: Response, place: int) -> Worst:
    row, column = np.unravel_index(place, values.shape)
    value = float(values[row, column])
    if not np.isfinite(value):  # all detected, or no error anywhere
        return Worst(value=value if value > 0.0 else float("nan"), d_mps=float("nan"), onset_s=float("nan"))
    return Worst(value=value, d_mps=float(rates_mps[row]), onset_s=float(found.offset_s[column]))


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """What is looked at, and how it ends.

    Attributes
    ----------
    error_on : {"L1", "L5", "IF"} or None
        Ranges whose error counts; None: by the mode.
    delay_s : float
        From the monitor's alarm to the exclusion at the user [s].
    receivers : int
        Averaged by the monitor.
    """

    error_on: ErrorOn | None = None
    delay_s: float = 0.0
    receivers: int = 1


def study(
    mode: str, monitor: str, smoothing: Smoothing, grid: Grid, exclusion: Exclusion | None = None
) -> tuple[Worst, Worst, Response]:
    """Worst undetected error and smallest mapping of one mode on a grid, and the responses behind them.

    Raises
    ------
    StudyError
        For an unknown mode or monitor, and a grid that does not fit the samples.
    """
    exclusion = Exclusion() if exclusion is None else exclusion
    watched = monitor_for(monitor, mode, error_on=exclusion.error_on, receivers=exclusion.receivers)
    found = response(
        mode, watched, smoothing, grid.offsets(smoothing.interval_s), error_on=exclusion.error_on,
        exclusion_delay_s=exclusion.delay_s,
    )  # fmt: skip
    rates = grid.rates_mps()
    return worst_error(found, rates), smallest_mapping(found, rates), found
