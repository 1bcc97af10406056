"""The gradient that a set of baselines sees worst: exact, from the breakpoints, compiled.

``D = min over gradients of max over baselines of dist(slope * gradient, wavelength * Z)`` is the largest threshold
``k sigma`` with which every gradient of a range is detected by at least one baseline.

Each term is a row of tents, so the maximum is piecewise linear in the gradient and has its smallest value at an end of
the range or where a falling side of one tent meets a rising side of another: ``p wavelength - slope_i gradient =
slope_j gradient - q wavelength``, that is at ``gradient = n wavelength / (slope_i + slope_j)``. Two rising or two
falling sides, which meet at ``n wavelength / |slope_i - slope_j|``, make no minimum, so these gradients need not be
looked at. No grid of gradients is needed.

A slack ``s`` takes ``s * gradient`` off a baseline's term. With ``s`` the tolerance of the baseline's length the result
is the worst case over all lengths within it, since ``dist`` changes by ``gradient * change`` at most and does so on one
side. With ``s`` minus the half width of an interval of lengths, ``D`` is an upper bound for all lengths in the
interval. The breakpoints are then at ``n wavelength / (slope_i + s_i + slope_j - s_j)``.

Source: Belabbas et al., Optimal linear distribution of monitors, where D is sought on grids; the breakpoints are ours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.compiled import compiled
from gbas_core.record import FloatArray


class Worst(NamedTuple):
    """Smallest value over the range, D ``(...)`` [m], and a gradient that has it ``(...)`` [m/m]."""

    statistic_m: FloatArray
    gradient: FloatArray


def worst_gradient(
    slope_m: ArrayLike,
    wavelength_m: ArrayLike,
    gradient_range: tuple[float, float],
    *,
    slack_m: ArrayLike = 0.0,
    enough_m: float = -np.inf,
) -> Worst:
    """Smallest, over a range of gradients, of the largest statistic of any baseline.

    Parameters
    ----------
    slope_m : (..., c) array
        Delay over each baseline per unit gradient: its length along the runway, times the ratio of the ionosphere on
        the carrier's band [m]. Not negative.
    wavelength_m : (c,) array or float
        Wavelength of each carrier [m].
    gradient_range : pair of float
        [m/m].
    slack_m : array that broadcasts against `slope_m`
        Tolerance of each slope, or minus the half width of an interval of slopes [m].
    enough_m : float
        A result below this may be any value that D does not exceed: it saves time in a search.

    Returns
    -------
    Worst
        D is never negative; it is zero, at the lowest gradient, when a missing slope is among them.
    """
    slope = np.asarray(slope_m, dtype=np.float64)
    rows = np.ascontiguousarray(slope.reshape(-1, slope.shape[-1]))
    slack = np.ascontiguousarray(np.broadcast_to(np.asarray(slack_m, dtype=np.float64), slope.shape)).reshape(
        rows.shape
    )
    wavelength = np.ascontiguousarray(np.broadcast_to(np.asarray(wavelength_m, dtype=np.float64), slope.shape[-1:]))
    least, where = np.empty(rows.shape[0]), np.empty(rows.shape[0])
    low, high = gradient_range
    if np.all(wavelength == wavelength[0]):
        _each_common(rows, slack, wavelength, low, high, enough_m, least, where)
    else:
        _each_mixed(rows, slack, wavelength, low, high, enough_m, least, where)
    return Worst(least.reshape(slope.shape[:-1]), where.reshape(slope.shape[:-1]))


@compiled
def _each_common(
    slope: FloatArray,
    slack: FloatArray,
    wavelength: FloatArray,
    low: float,
    high: float,
    enough: float,
    least: FloatArray,
    where: FloatArray,
) -> None:
    for row in range(slope.shape[0]):
        least[row], where[row] = _common(slope[row], slack[row], wavelength[0], low, high, enough)


@compiled
def _each_mixed(
    slope: FloatArray,
    slack: FloatArray,
    wavelength: FloatArray,
    low: float,
    high: float,
    enough: float,
    least: FloatArray,
    where: FloatArray,
) -> None:
    for row in range(slope.shape[0]):
        least[row], where[row] = _mixed(slope[row], slack[row], wavelength, low, high, enough)


@compiled
def _best(gradient: float, slope: FloatArray, slack: FloatArray, wavelength: float, least: float) -> float:
    """The smaller of `least` and the largest statistic at a gradient, one wavelength for all."""
    largest = 0.0
    for c in range(slope.size):
        delay = gradient * slope[c]
        value = abs(delay - wavelength * np.rint(delay / wavelength)) - gradient * slack[c]
        if value >= least:
            return least
        if value > largest:
            largest = value
    return largest


@compiled
def _best_mixed(gradient: float, slope: FloatArray, slack: FloatArray, wavelength: FloatArray, least: float) -> float:
    """The same for a wavelength of each baseline's own."""
    largest = 0.0
    for c in range(slope.size):
        delay = gradient * slope[c]
        value = abs(delay - wavelength[c] * np.rint(delay / wavelength[c])) - gradient * slack[c]
        if value >= least:
            return least
        if value > largest:
            largest = value
    return largest


@compiled
def _common(
    slope: FloatArray, slack: FloatArray, wavelength: float, low: float, high: float, enough: float
) -> tuple[float, float]:
    """D of one set of baselines on one wavelength."""
    for c in range(slope.size):
        if not slope[c] >= 0.0:
            return 0.0, low
    least, where = _best(low, slope, slack, wavelength, np.inf), low
    value = _best(high, slope, slack, wavelength, least)
    if value < least:
        least, where = value, high
    plain = slope.size > 1
    for c in range(slope.size):
        plain = plain and slack[c] == 0.0
    for i in range(slope.size):
        for j in range(slope.size):
            # Without slack, (j, i) is (i, j), and a tent's own valley is a minimum only where all others are zero, too.
            if plain and j <= i:
                continue
            if j < i and slack[i] == slack[j]:
                continue
            span = (slope[i] + slack[i]) + (slope[j] - slack[j])
            for n in range(max(1, int(np.ceil(low * span / wavelength))), int(np.floor(high * span / wavelength)) + 1):
                if least < enough:
                    return least, where
                gradient = n * wavelength / span
                value = _best(gradient, slope, slack, wavelength, least)
                if value < least:
                    least, where = value, gradient
    return least, where


@compiled
def _mixed(
    slope: FloatArray, slack: FloatArray, wavelength: FloatArray, low: float, high: float, enough: float
) -> tuple[float, float]:
    """D of one set of baselines on several wavelengths."""
    for c in range(slope.size):
        if not slope[c] >= 0.0:
            return 0.0, low
    least, where = _best_mixed(low, slope, slack, wavelength, np.inf), low
    value = _best_mixed(high, slope, slack, wavelength, least)
    if value < least:
        least, where = value, high
    for i in range(slope.size):
        for j in range(slope.size):
            span = (slope[i] + slack[i]) + (slope[j] - slack[j])
            if not (span > 0.0 and slope[i] > 0.0):
                continue
            for p in range(
                int(np.ceil(low * slope[i] / wavelength[i])), int(high * slope[i] / wavelength[i] + 0.5) + 1
            ):
                # The falling side of this tent is between these gradients; rising sides that overlap it can meet it.
                begin = max(low, (p - 0.5) * wavelength[i] / slope[i])
                end = min(high, p * wavelength[i] / slope[i])
                first = int(np.floor(begin * slope[j] / wavelength[j] - 0.5))
                for q in range(max(first, 0), int(np.ceil(end * slope[j] / wavelength[j])) + 1):
                    if least < enough:
                        return least, where
                    gradient = (p * wavelength[i] + q * wavelength[j]) / span
                    if low <= gradient <= high:
                        value = _best_mixed(gradient, slope, slack, wavelength, least)
                        if value < least:
                            least, where = value, gradient
    return least, where
