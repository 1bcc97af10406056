"""Which ionosphere gradients a double-difference carrier can see: exact intervals, no grid of gradients.

The double difference of the carrier between two surveyed receivers and two satellites, less its geometry, is a multiple
of the wavelength plus the gradient's delay over the baseline plus noise. Its distance to the nearest multiple is the
statistic; a gradient is detectable when that distance exceeds ``k sigma`` and blind when it does not. As a function of
the gradient the statistic is a row of tents, so detectable gradients are open intervals between the multiples.

A gradient is along the runway. A baseline at an angle to the runway sees only its component along the baseline, that is
the same delay as a baseline along the runway of the projected length ``b cos(angle)``; a projected length is used by
its size, since the statistic does not know the sign. Gradients are those of L1: the carrier of another band sees
``(f_L1 / f)^2`` times as much. Intervals are ``(n, 2)`` arrays of gradients [m/m], sorted and disjoint.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach,
eq (1) to (5), after Khanafseh, Yang, Pervan, ION GNSS 2010.

Notes
-----
Departures from the paper. Eq (4) projects the baseline from receiver 1 to 3 with the angle ``theta - beta``. At the
test bed the runway does not run between the two baselines, and the angle is ``theta + beta``: 62.67 degrees, not 58.69
(:func:`projected_length_m` takes it from the vectors). Eq (6) and (7) are misprinted: as printed the tents are
``2 sigma_hat`` high at the multiples, where they must be zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from gbas_core.compiled import as_written
from gbas_core.parameters import ParameterError
from gbas_core.record import FloatArray
from gbas_core.signals import IONO_RATIO, L1, WAVELENGTH_M
from gbas_ground.monitors.kernels.double_difference import wrapped

Fuse = Literal["any", "all"]

GRADIENT_RANGE: Final = (300.0e-6, 2000.0e-6)
"""Gradients to be detected for GAST-D [m/m]. Source: the paper, after ICAO Annex 10."""

SHORTEST_M: Final = 1.0e-3
"""Baselines that are shorter along the runway are none: antennas are surveyed no better [m]. Ours."""

P_FALSE_ALARM: Final = 1.0e-4
"""Fault-free detection, two-sided. Uncertain: the paper does not print it; it reproduces the paper's results."""
P_MISSED_DETECTION: Final = 1.0e-4
"""Missed detection, one-sided. Uncertain in the same way."""

# Gaps this many units in the last place of the largest gradient wide come from rounding where two intervals touch.
_ROUNDING: Final = 8.0 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True, kw_only=True)
class BaselineMonitor:
    """One baseline on one band.

    Attributes
    ----------
    length_m : float
        Length along the runway (projected, :func:`projected_length_m`); below `SHORTEST_M` it sees nothing [m].
    sigma_m : float
        Standard deviation that overbounds the double-difference carrier [m].
    band : int
        Band of the carrier.

    Raises
    ------
    ParameterError
        For a length or sigma that is negative or not finite.
    """

    length_m: float
    sigma_m: float
    band: int = L1

    def __post_init__(self) -> None:
        for name in ("length_m", "sigma_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ParameterError(f"{name} is {value}: must be at least 0 m and finite")

    @property
    def wavelength_m(self) -> float:
        """Wavelength of the carrier [m]."""
        return float(WAVELENGTH_M[self.band])

    @property
    def slope_m(self) -> float:
        """Delay over the baseline, on this carrier, of a unit L1 gradient along the runway [m]."""
        return self.length_m * float(IONO_RATIO[self.band])


def k_factor(p_false_alarm: float = P_FALSE_ALARM, p_missed_detection: float = P_MISSED_DETECTION) -> float:
    """Standard deviations from a multiple of the wavelength at which a gradient is detectable [-].

    The threshold takes ``k_ffd`` (two-sided), missed detection ``k_md`` (one-sided): 3.8906 + 3.7190 = 7.6096 for 1e-4
    each.

    Source: the paper, eq (3) and (5).
    """
    return -float(ndtri(0.5 * p_false_alarm) + ndtri(p_missed_detection))


def double_difference_sigma_m(reference_sigma_m: FloatArray | float, ratio: ArrayLike = 1.0) -> FloatArray:
    """Sigma of the double difference from the carrier sigma of the reference receiver [m].

    Parameters
    ----------
    reference_sigma_m, ratio : arrays that broadcast
        Carrier sigma of the reference receiver [m]; that of the other receiver over it [-].

    Source: the paper, eq (1). Twice the receivers' sigma when they are equal.
    """
    other = np.asarray(ratio, dtype=np.float64)
    result: FloatArray = np.sqrt(2.0 * (1.0 + other**2)) * reference_sigma_m
    return result


def projected_length_m(baseline_enu_m: ArrayLike, runway_bearing_rad: float) -> FloatArray:
    """Length of baselines along the runway.

    Parameters
    ----------
    baseline_enu_m : (..., 3) or (..., 2) array
        Baseline vectors, east, north and, where given, up [m].
    runway_bearing_rad : float
        True bearing of the runway, either end [rad].

    Returns
    -------
    (...) array
        Signed: positive in the direction of the bearing [m].
    """
    vector = np.asarray(baseline_enu_m, dtype=np.float64)
    result: FloatArray = vector[..., 0] * math.sin(runway_bearing_rad) + vector[..., 1] * math.cos(runway_bearing_rad)
    return result


def wrap_m(value_m: ArrayLike, wavelength_m: FloatArray | float) -> FloatArray:
    """What is left of a double difference when the nearest multiple of the wavelength is taken off [m].

    Parameters
    ----------
    value_m, wavelength_m : arrays that broadcast
        Double-difference carrier less its geometry, wavelength [m].

    Returns
    -------
    array
        From minus to plus half a wavelength; NaN stays NaN. Its size is the statistic.

    Source: Khanafseh, Yang, Pervan, ION GNSS 2010; the paper, eq (2).
    """
    result: FloatArray = as_written(wrapped)(np.asarray(value_m, dtype=np.float64), wavelength_m)
    return result


def statistic_m(gradient: ArrayLike, monitor: BaselineMonitor) -> FloatArray:
    """Noise-free statistic of a gradient: distance of its delay to the nearest multiple of the wavelength [m].

    Parameters
    ----------
    gradient : array
        L1 gradients along the runway [m/m].
    monitor : BaselineMonitor
    """
    return np.abs(wrap_m(np.asarray(gradient, dtype=np.float64) * monitor.slope_m, monitor.wavelength_m))


def detectable_intervals(
    monitors: Sequence[BaselineMonitor],
    k: float,
    *,
    fuse: Fuse = "any",
    gradient_range: tuple[float, float] = GRADIENT_RANGE,
) -> FloatArray:
    """Gradients that are detected: by at least one monitor, or by all.

    Parameters
    ----------
    monitors : sequence of BaselineMonitor
    k : float
        From :func:`k_factor`.
    fuse : {"any", "all"}
    gradient_range : pair of float
        Lowest and highest gradient [m/m].

    Returns
    -------
    (n, 2) array
        Sorted, disjoint [m/m].

    Raises
    ------
    ParameterError
        Without monitors; for k or a range that is no range.

    Source: the paper, eq (3) to (5).
    """
    return _complement(blind_intervals(monitors, k, fuse=fuse, gradient_range=gradient_range), gradient_range)


def blind_intervals(
    monitors: Sequence[BaselineMonitor],
    k: float,
    *,
    fuse: Fuse = "any",
    gradient_range: tuple[float, float] = GRADIENT_RANGE,
) -> FloatArray:
    """Gradients that are not detected; the complement of :func:`detectable_intervals`, with the same arguments.

    Gaps of the width of rounding, where two intervals touch, are none.
    """
    _check(monitors, k, fuse, gradient_range)
    seen = [_tents(monitor, k, gradient_range) for monitor in monitors]
    if fuse == "any":
        return _complement(_union(np.concatenate(seen)), gradient_range)
    return _union(np.concatenate([_complement(each, gradient_range) for each in seen]))


def coverage_percent(
    monitors: Sequence[BaselineMonitor],
    k: float,
    *,
    fuse: Fuse = "any",
    gradient_range: tuple[float, float] = GRADIENT_RANGE,
) -> float:
    """Share of the range of gradients that is detectable [%]; arguments as of :func:`detectable_intervals`."""
    blind = blind_intervals(monitors, k, fuse=fuse, gradient_range=gradient_range)
    if blind.shape[0] == 0:
        return 100.0
    low, high = gradient_range
    return 100.0 * (1.0 - float(np.sum(blind[:, 1] - blind[:, 0])) / (high - low))


def _check(monitors: Sequence[BaselineMonitor], k: float, fuse: str, gradient_range: tuple[float, float]) -> None:
    if not monitors:
        raise ParameterError("no baselines are given: at least one is needed")
    if not (math.isfinite(k) and k > 0.0):
        raise ParameterError(f"k is {k}: must be above 0 and finite")
    if fuse not in ("any", "all"):
        raise ParameterError(f"fuse is {fuse!r}: must be any or all")
    check_gradient_range(gradient_range)


def check_gradient_range(gradient_range: tuple[float, float]) -> None:
    """Complain of a range of gradients that is none.

    Raises
    ------
    ParameterError
        Unless both ends are finite and ``0 < low < high``.
    """
    low, high = gradient_range
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 < low < high):
        raise ParameterError(f"gradient range {low} to {high} m/m: must be finite, with 0 < low < high")


def _tents(monitor: BaselineMonitor, k: float, gradient_range: tuple[float, float]) -> FloatArray:
    """Detectable intervals of one monitor, within the range."""
    margin, wavelength, slope = k * monitor.sigma_m, monitor.wavelength_m, monitor.slope_m
    low, high = gradient_range
    if monitor.length_m < SHORTEST_M or 2.0 * margin >= wavelength:
        return np.empty((0, 2))
    multiple = np.arange(math.floor(low * slope / wavelength), math.floor(high * slope / wavelength) + 1.0) * wavelength
    ends = np.stack([multiple + margin, multiple + (wavelength - margin)], axis=-1) / slope
    clipped: FloatArray = np.clip(ends, low, high)
    return clipped[clipped[:, 0] < clipped[:, 1]]


def _union(intervals: FloatArray) -> FloatArray:
    """Sorted, disjoint intervals that cover the same."""
    if intervals.shape[0] == 0:
        return intervals
    ordered = intervals[np.argsort(intervals[:, 0], kind="stable")]
    reached = np.maximum.accumulate(ordered[:, 1])
    begins: NDArray[np.bool_] = np.concatenate([[True], ordered[1:, 0] > reached[:-1]])
    last = np.concatenate([np.flatnonzero(begins)[1:] - 1, [ordered.shape[0] - 1]])
    return np.stack([ordered[begins, 0], reached[last]], axis=-1)


def _complement(intervals: FloatArray, gradient_range: tuple[float, float]) -> FloatArray:
    """What sorted, disjoint intervals leave of the range."""
    low, high = gradient_range
    gaps = np.stack([np.append(low, intervals[:, 1]), np.append(intervals[:, 0], high)], axis=-1)
    kept: FloatArray = gaps[gaps[:, 1] - gaps[:, 0] > _ROUNDING * high]
    return kept
