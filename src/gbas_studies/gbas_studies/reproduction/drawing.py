"""Figures in one style, without the global state of pyplot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Colours that differ for colour-blind readers and in grey (P. Tol, "bright" scheme, 2021), and black.
COLOURS: Final = ("#4477AA", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377", "#BBBBBB", "#000000")
LIMIT_COLOUR: Final = "#B2182B"
"""Of thresholds and required limits."""
_GRID: Final[Mapping[str, Any]] = {"alpha": 0.3, "linewidth": 0.5}


def new_figure(rows: int = 1, columns: int = 1, *, width: float = 7.2, height: float = 4.4, **kwargs: Any) -> Figure:
    """An empty figure with axes, ready to be drawn on and saved.

    Parameters
    ----------
    rows, columns : int
        Of axes; they are ``figure.axes``.
    width, height : float
        Of the whole figure [inch].
    **kwargs
        Of :meth:`matplotlib.figure.Figure.subplots`, such as ``sharex=True``.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.subplots(rows, columns, **kwargs)
    for axis in figure.axes:
        axis.set_prop_cycle(color=COLOURS)
        axis.grid(which="major", **_GRID)
    return figure


def limit_line(axis: Axes, value: float, label: str, *, both_sides: bool = False) -> None:
    """Horizontal line of a threshold, with its name in the legend."""
    axis.axhline(value, color=LIMIT_COLOUR, linewidth=1.2, linestyle="--", label=label)
    if both_sides:
        axis.axhline(-value, color=LIMIT_COLOUR, linewidth=1.2, linestyle="--")
