"""Boxes of places made smaller by what the gradients demand, compiled.

If at some gradient only one receiver of a box can reach a statistic, then places where it does not reach it may be cut
off, from either end of its interval; if none can, nothing of the box is left. The gradients that tell most are those at
which a baseline has just become blind wherever in the box it ends: the others must take over there. Any choice of
gradients is valid; a poor one cuts less.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gbas_core.compiled import compiled
from gbas_core.record import FloatArray

# Keeps what rounding might have cut: a part in 1e12 of a length is far less than a gap in the statistic is worth.
_KEEP = 1.0e-12
_PASSES = 4
_WORTH_ANOTHER = 0.98


@compiled
def contract(
    low: FloatArray,
    high: FloatArray,
    gain: FloatArray,
    fixed: FloatArray,
    wavelength: FloatArray,
    tolerance: float,
    gradient_low: float,
    gradient_high: float,
    reach: float,
    alive: NDArray[np.bool_],
) -> None:
    """Cut off, in place, what cannot reach a statistic at every gradient.

    Parameters
    ----------
    low, high : (n, d) arrays
        Boxes: distances of the new receivers from the first [m]; changed.
    gain, wavelength : (k,) arrays
        Ionosphere and wavelength of each band [-], [m].
    fixed : (f,) array
        Distances of the existing receivers from the first [m].
    tolerance : float
        Placement tolerance of the new receivers [m].
    gradient_low, gradient_high : float
        Range of gradients [m/m].
    reach : float
        Statistic to be reached [m].
    alive : (n,) bool array
        Set to whether anything is left of each box.
    """
    for row in range(low.shape[0]):
        alive[row] = True
        for _ in range(_PASSES):
            before = np.sum(high[row] - low[row])
            alive[row] = _pass(
                low[row], high[row], gain, fixed, wavelength, tolerance, gradient_low, gradient_high, reach
            )
            if not alive[row] or np.sum(high[row] - low[row]) > _WORTH_ANOTHER * before:
                break


@compiled
def _pass(
    low: FloatArray,
    high: FloatArray,
    gain: FloatArray,
    fixed: FloatArray,
    wavelength: FloatArray,
    tolerance: float,
    gradient_low: float,
    gradient_high: float,
    reach: float,
) -> bool:
    """Look at all gradients that tell something, once; whether anything is left."""
    for i in range(1, low.size):  # new receivers are in ascending order
        low[i] = max(low[i], low[i - 1])
    for i in range(low.size - 1, 0, -1):
        high[i - 1] = min(high[i - 1], high[i])
    for gradient in (gradient_low, gradient_high):
        if not _demand(gradient, low, high, gain, fixed, wavelength, tolerance, reach):
            return False
    for i in range(low.size):
        for band in range(gain.size):
            count = int(gradient_high * gain[band] * high[i] / wavelength[band]) + 1
            for p in range(count + 1):
                # Just blind before the multiple, wherever the baseline ends; and still blind after it.
                before = _ratio(p * wavelength[band] - reach, gain[band] * low[i]) * (1.0 + _KEEP)
                after = _ratio(p * wavelength[band] + reach, gain[band] * high[i]) * (1.0 - _KEEP)
                for gradient in (before, after):
                    if gradient_low <= gradient <= gradient_high and not _demand(
                        gradient, low, high, gain, fixed, wavelength, tolerance, reach
                    ):
                        return False
    return True


@compiled
def _ratio(delay: float, slope: float) -> float:
    return delay / slope if slope > 0.0 else -1.0


@compiled
def _demand(
    gradient: float,
    low: FloatArray,
    high: FloatArray,
    gain: FloatArray,
    fixed: FloatArray,
    wavelength: FloatArray,
    tolerance: float,
    reach: float,
) -> bool:
    """Demand the statistic at one gradient; whether anything is left."""
    for distance in fixed:
        for band in range(gain.size):
            delay = gradient * gain[band] * distance
            if abs(delay - wavelength[band] * np.rint(delay / wavelength[band])) >= reach:
                return True
    only, begin, end = -1, np.inf, -np.inf
    for i in range(low.size):
        for band in range(gain.size):
            slope = gradient * gain[band]
            needed = reach + slope * tolerance
            first = _first_at_or_above(low[i], slope, wavelength[band], needed)
            last = _last_at_or_below(high[i], slope, wavelength[band], needed)
            if first <= last:
                if only not in (-1, i):
                    return True
                only = i
                begin, end = min(begin, first), max(end, last)
    if only == -1:
        return False
    low[only] = max(low[only], begin * (1.0 - _KEEP))
    high[only] = min(high[only], end * (1.0 + _KEEP))
    return bool(low[only] <= high[only])


@compiled
def _first_at_or_above(place: float, slope: float, wavelength: float, needed: float) -> float:
    """The nearest place at or above one from which the delay is so far from any multiple."""
    if 2.0 * needed > wavelength:
        return np.inf
    multiple = np.floor(slope * place / wavelength) * wavelength
    rest = slope * place - multiple
    if rest < needed:
        return float((multiple + needed) / slope)
    if rest > wavelength - needed:
        return float((multiple + wavelength + needed) / slope)
    return place


@compiled
def _last_at_or_below(place: float, slope: float, wavelength: float, needed: float) -> float:
    """The nearest place at or below one."""
    if 2.0 * needed > wavelength:
        return -np.inf
    multiple = np.floor(slope * place / wavelength) * wavelength
    rest = slope * place - multiple
    if rest > wavelength - needed:
        return float((multiple + wavelength - needed) / slope)
    if rest < needed:
        return float((multiple - needed) / slope)
    return place
