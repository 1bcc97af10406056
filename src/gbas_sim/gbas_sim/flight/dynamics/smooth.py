"""Smooth changes in time, and tables of smooth functions.

A change follows the polynomial 6 x^5 - 15 x^4 + 10 x^3, so that value, rate and acceleration have no step. Tables hold
values, first and second derivatives at evenly spaced arguments and join them by polynomials of degree 5: what they
return as derivative is the exact derivative of what they return as value.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gbas_core.record import FloatArray

STEEPEST: Final = 1.875
"""Largest rate of :func:`step`, at its middle."""


def step(x: FloatArray) -> FloatArray:
    """From 0 at x <= 0 to 1 at x >= 1."""
    inside = np.clip(x, 0.0, 1.0)
    result: FloatArray = inside**3 * (10.0 - inside * (15.0 - 6.0 * inside))
    return result


def step_area(x: FloatArray) -> FloatArray:
    """Integral of :func:`step` from 0."""
    inside = np.clip(x, 0.0, 1.0)
    result: FloatArray = inside**4 * (2.5 - inside * (3.0 - inside)) + np.maximum(x - 1.0, 0.0)
    return result


def pulse(time_s: FloatArray, duration_s: float, edge_s: float) -> FloatArray:
    """Rise from 0 to 1 in `edge_s`, stay, and be back at 0 after `duration_s`."""
    result: FloatArray = step(time_s / edge_s) - step((time_s - duration_s + edge_s) / edge_s)
    return result


def pulse_area(time_s: FloatArray, duration_s: float, edge_s: float) -> FloatArray:
    """Integral of :func:`pulse` from 0; in the end ``duration_s - edge_s``."""
    result: FloatArray = edge_s * (step_area(time_s / edge_s) - step_area((time_s - duration_s + edge_s) / edge_s))
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothTable:
    """Smooth functions of one argument, linear beyond the table's ends.

    Attributes
    ----------
    start, spacing : float
        First argument and distance between arguments.
    coefficients : (n_cells, 6, n_functions) array
        Of the polynomials, lowest power first, in the distance from the cell's start in units of the spacing.
    """

    start: float
    spacing: float
    coefficients: FloatArray

    @classmethod
    def make(cls, arguments: FloatArray, values: FloatArray, rates: FloatArray) -> Self:
        """Table through values and first derivatives ``(n, n_functions)`` at evenly spaced arguments ``(n,)``.

        Second derivatives are those of the cubic spline through the first.
        """
        spacing = float((arguments[-1] - arguments[0]) / (arguments.size - 1))
        first, second = rates * spacing, CubicSpline(arguments, rates, axis=0)(arguments, 1) * spacing**2
        rise = values[1:] - values[:-1] - first[:-1] - 0.5 * second[:-1]
        slope = first[1:] - first[:-1] - second[:-1]
        bend = second[1:] - second[:-1]
        parts = [
            values[:-1],
            first[:-1],
            0.5 * second[:-1],
            10.0 * rise - 4.0 * slope + 0.5 * bend,
            -15.0 * rise + 7.0 * slope - bend,
            6.0 * rise - 3.0 * slope + 0.5 * bend,
        ]
        return cls(start=float(arguments[0]), spacing=spacing, coefficients=np.stack(parts, axis=1))

    @property
    def end(self) -> float:
        """Last argument."""
        return self.start + self.spacing * len(self.coefficients)

    def value(self, argument: float) -> FloatArray:
        """Values (n_functions,) at one argument."""
        cells = (argument - self.start) / self.spacing
        index = min(max(int(cells), 0), len(self.coefficients) - 1)
        inside = min(max(cells - index, 0.0), 1.0)
        c = self.coefficients[index]
        result: FloatArray = c[0] + inside * (
            c[1] + inside * (c[2] + inside * (c[3] + inside * (c[4] + inside * c[5])))
        )
        return result

    def derivatives(self, arguments: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values, first and second derivatives, each (..., n_functions), at arguments (...)."""
        c, inside, beyond = self._cells(arguments)
        zeroth = c[..., 5, :]
        first, second = np.zeros_like(zeroth), np.zeros_like(zeroth)
        for power in (4, 3, 2, 1, 0):
            second = second * inside + 2.0 * first
            first = first * inside + zeroth
            zeroth = zeroth * inside + c[..., power, :]
        within = beyond == 0.0
        return zeroth + beyond * first, first / self.spacing, np.where(within, second, 0.0) / self.spacing**2

    def _cells(self, arguments: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients of the arguments' cells, position within them, and beyond the table in cells."""
        cells = (arguments - self.start) / self.spacing
        clipped = np.clip(cells, 0.0, float(len(self.coefficients)))
        index: NDArray[np.intp] = np.minimum(clipped.astype(np.intp), len(self.coefficients) - 1)
        inside, beyond = clipped - index, cells - clipped
        return self.coefficients[index], inside[..., np.newaxis], beyond[..., np.newaxis]
