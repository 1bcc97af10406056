"""Are errors bounded as the sigmas say? Tests on recorded or simulated positions whose truth is known, that can fail.

A protection level that was never exceeded in an hour is no evidence for a probability of 1e-7, only the absence of a
counter-example. What an hour can show is the core of the distribution: sigmas measured on its first half are put in
place of the assumed ones, and in its second half errors beyond ``K sigma`` are counted
(:mod:`gbas_studies.exceedances`) for probabilities at which there must be some.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.5 (the model: zero-mean normal errors, projected with S).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS
from gbas_msgs_py.records import SolutionEpoch
from gbas_studies.exceedances import Exceedance, StanfordCounts, correlation_time_s, exceedance, stanford_counts

ELEVATION_EDGES_DEG: Final = (0.0, 15.0, 25.0, 40.0, 60.0, 90.0)
"""Sigma is measured in these ranges of elevation."""
PROBABILITIES: Final = (0.3, 0.1, 0.01)
"""Two-sided probabilities of the scaled-down multipliers 1.036, 1.645 and 2.576: an hour must have errors beyond."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorSeries:
    """Errors of T epochs with a position.

    Attributes
    ----------
    time_s : (T,) array
        Since the first one [s].
    interval_s : float
        Between epochs, the commonest [s].
    range_m : (T, N_SATS) array
        Errors of corrected pseudoranges less their mean over the satellites of the same clock, and scaled by
        ``sqrt(n / (n - 1))`` for what that mean takes away [m]; NaN where not used, or alone on its clock.
    elevation_rad, sigma_m : (T, N_SATS) arrays
        Elevation, and sigma as the protection levels assume it (ground, air, troposphere, ionosphere).
    projection : (2, T, N_SATS) array
        Of range errors on the vertical and the lateral error; 0 where not used.
    position_m : (2, T) array
        Vertical and lateral error [m], signed.
    """

    time_s: FloatArray
    interval_s: float
    range_m: FloatArray
    elevation_rad: FloatArray
    sigma_m: FloatArray
    projection: FloatArray
    position_m: FloatArray

    def part(self, which: BoolArray) -> ErrorSeries:
        """Some of the epochs."""
        return ErrorSeries(
            time_s=self.time_s[which],
            interval_s=self.interval_s,
            range_m=self.range_m[which],
            elevation_rad=self.elevation_rad[which],
            sigma_m=self.sigma_m[which],
            projection=self.projection[:, which],
            position_m=self.position_m[:, which],
        )

    def position_sigma_m(self, sigma_m: FloatArray) -> FloatArray:
        """Vertical and lateral sigma ``(2, T)`` that sigmas of ranges ``(T, N_SATS)`` amount to [m]."""
        variance = np.where(self.projection != 0.0, self.projection**2 * sigma_m**2, 0.0)
        return np.asarray(np.sqrt(variance.sum(axis=-1)))


def error_series(solutions: Sequence[SolutionEpoch], truth_m: FloatArray) -> ErrorSeries:
    """Errors of ranges and positions against the true antenna positions.

    Parameters
    ----------
    solutions : sequence of SolutionEpoch
        In order of time; those without a position are left out.
    truth_m : (3,) or (len(solutions), 3) array
        True positions, ECEF [m]; NaN where unknown.

    Raises
    ------
    ValueError
        With fewer than two epochs that have a position and a truth.

    Notes
    -----
    With G = [-u, 1] the error of a corrected range is its residual less u times the position error, but for the clock,
    which no position feels: the sum of S over the satellites of a clock is zero.
    """
    position = np.array([(s.x_m, s.y_m, s.z_m) for s in solutions]).reshape(-1, 3)
    error = position - np.broadcast_to(truth_m, position.shape)
    known = np.flatnonzero(np.isfinite(error).all(axis=1))
    if known.size < 2:
        raise ValueError(f"{known.size} epochs have both a position and a truth; at least 2 are needed")
    kept = [solutions[int(k)] for k in known]
    time_s = np.array([epoch_key(s.gps_week, s.tow_s) for s in kept]) / 1000.0
    residual, elevation, azimuth, vertical, lateral = (
        np.array([getattr(s, name) for s in kept])
        for name in ("residual_m", "elevation_rad", "azimuth_rad", "s_vert", "s_lat")
    )
    parts = (np.array([getattr(s, f"sigma_{name}_m") for s in kept]) for name in ("gnd", "air", "tropo", "iono"))
    cosine = np.cos(elevation)
    los_enu = np.array([cosine * np.sin(azimuth), cosine * np.cos(azimuth), np.sin(elevation)])
    latitude, longitude, _ = geodetic_from_ecef(position[known])
    enu = np.einsum("tij,tj->it", rot_enu_ecef(latitude, longitude), error[known])
    raw = residual - (los_enu * enu[:, :, np.newaxis]).sum(axis=0)
    projection = np.nan_to_num(np.array([vertical, lateral]))
    return ErrorSeries(
        time_s=time_s - time_s[0],
        interval_s=float(np.median(np.diff(time_s))),
        range_m=_without_clock(raw),
        elevation_rad=elevation,
        sigma_m=np.sqrt(sum(part**2 for part in parts)),
        projection=projection,
        position_m=(projection * np.nan_to_num(raw)).sum(axis=-1),
    )


def _without_clock(range_m: FloatArray) -> FloatArray:
    """Errors ``(T, N_SATS)`` less the mean of each clock's satellites, at the size they have without that loss."""
    result = np.full_like(range_m, np.nan)
    for group in CLOCK_GROUPS:
        there = np.isfinite(range_m) & group
        count = there.sum(axis=1, keepdims=True)
        enough = there & (count >= 2)
        mean = np.where(there, range_m, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1)
        scale = np.sqrt(count / np.maximum(count - 1, 1))
        result = np.where(enough, (range_m - mean) * scale, result)
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredSigma:
    """Root mean square errors of ranges by elevation [m]; a range of elevation without data has the next lower one's.

    Attributes
    ----------
    edges_deg : (n + 1,) array
    sigma_m : (n,) array
    count : (n,) array
        Errors behind each.
    """

    edges_deg: FloatArray
    sigma_m: FloatArray
    count: NDArray[np.int64]

    def at(self, elevation_rad: FloatArray) -> FloatArray:
        """Sigma at elevations [m]; NaN stays NaN."""
        index = np.digitize(np.degrees(elevation_rad), self.edges_deg[1:-1])
        return np.asarray(np.where(np.isfinite(elevation_rad), self.sigma_m[index], np.nan))


def measured_sigma(
    series: ErrorSeries, edges_deg: Sequence[float] = ELEVATION_EDGES_DEG, *, least: int = 30
) -> MeasuredSigma:
    """Sigma of corrected ranges by elevation: root mean squares about zero, so that biases are in them.

    A range of elevation with fewer than `least` errors takes the sigma below it, the lowest one the largest of all:
    errors grow towards the horizon, so neither is optimistic.

    Raises
    ------
    ValueError
        When no range of elevation has enough.
    """
    edges = np.asarray(edges_deg, dtype=np.float64)
    there = np.isfinite(series.range_m)
    index = np.digitize(np.degrees(series.elevation_rad[there]), edges[1:-1])
    square = series.range_m[there] ** 2
    count = np.bincount(index, minlength=len(edges) - 1)
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.bincount(index, weights=square, minlength=len(edges) - 1) / np.maximum(count, 1))
    sigma[count < least] = np.nan
    if not np.isfinite(sigma).any():
        raise ValueError(f"no range of elevation has {least} errors to measure a sigma from")
    for k in range(len(sigma)):
        if np.isnan(sigma[k]):
            sigma[k] = np.nanmax(sigma) if k == 0 else sigma[k - 1]
    return MeasuredSigma(edges_deg=edges, sigma_m=sigma, count=count)


@dataclass(frozen=True, kw_only=True)
class BoundingReport:
    """Of one record: sigmas of the first half, counted in the second.

    Attributes
    ----------
    measured : MeasuredSigma
    correlation_s : float
        Correlation time that the trials are counted with [s].
    ratio : float
        Measured sigma over the assumed one, root mean square over the ranges of the first half.
    exceedances : dict
        By sigma (``measured``, ``assumed``) and error (``range``, ``vertical``, ``lateral``): one for each probability.
    stanford : dict
        Vertical counts of the second half by multiplier of the measured sigma: the scaled-down ones, by probability.
    """

    measured: MeasuredSigma
    correlation_s: float
    ratio: float
    exceedances: dict[str, dict[str, tuple[Exceedance, ...]]]
    stanford: dict[float, StanfordCounts]

    def as_json(self) -> dict[str, Any]:
        """The report as JSON-able data."""
        return {
            "elevation_edges_deg": self.measured.edges_deg.tolist(),
            "sigma_m": self.measured.sigma_m.tolist(),
            "sigma_from": self.measured.count.tolist(),
            "correlation_s": self.correlation_s,
            "measured_over_assumed": self.ratio,
            "exceedances": {
                sigma: {
                    error: [{**asdict(each), "verdict": each.verdict} for each in found]
                    for error, found in by_error.items()
                }
                for sigma, by_error in self.exceedances.items()
            },
            "stanford": {f"{probability:g}": asdict(counts) for probability, counts in self.stanford.items()},
        }


def halves(series: ErrorSeries) -> tuple[ErrorSeries, ErrorSeries]:
    """The series before and after the middle of its time."""
    first = series.time_s < 0.5 * (series.time_s[0] + series.time_s[-1])
    return series.part(first), series.part(~first)


def bounding_report(
    series: ErrorSeries,
    *,
    smoothing_tau_s: float,
    alert_limit_m: float,
    probabilities: Sequence[float] = PROBABILITIES,
) -> BoundingReport:
    """Measure sigmas on the first half of a record and test measured and assumed ones on the second.

    Parameters
    ----------
    series : ErrorSeries
    smoothing_tau_s : float
        Time constant of the carrier smoothing [s]: errors are correlated over twice that at least, however short the
        record in which it is measured.
    alert_limit_m : float
        Vertical alert limit of the Stanford counts [m].

    Raises
    ------
    ValueError
        When the first half is too short for a sigma.
    """
    first, second = halves(series)
    sigma = measured_sigma(first)
    correlation = max(
        correlation_time_s(first.range_m / sigma.at(first.elevation_rad), series.interval_s), 2.0 * smoothing_tau_s
    )
    exceedances: dict[str, dict[str, tuple[Exceedance, ...]]] = {}
    for name, sigma_m in (("measured", sigma.at(second.elevation_rad)), ("assumed", second.sigma_m)):
        vertical, lateral = second.position_m / second.position_sigma_m(sigma_m)
        errors = {"range": second.range_m / sigma_m, "vertical": vertical, "lateral": lateral}
        exceedances[name] = {
            error: tuple(
                exceedance(values, p, interval_s=series.interval_s, correlation_s=correlation) for p in probabilities
            )
            for error, values in errors.items()
        }
    vertical_sigma = second.position_sigma_m(sigma.at(second.elevation_rad))[0]
    return BoundingReport(
        measured=sigma,
        correlation_s=correlation,
        ratio=float(np.sqrt(np.nanmean((first.range_m / first.sigma_m) ** 2))),
        exceedances=exceedances,
        stanford={
            p: stanford_counts(second.position_m[0], float(norm.isf(p / 2.0)) * vertical_sigma, alert_limit_m)
            for p in probabilities
        },
    )
