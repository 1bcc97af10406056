"""Detectability of ionosphere gradients on a dense grid of gradients: nothing of the exact intervals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def statistic_on_grid_m(gradients: np.ndarray, slopes_m: Iterable[float], wavelengths_m: Iterable[float]) -> np.ndarray:
    """Distance to the nearest multiple, by the remainder of a division ``(baselines, gradients)``."""
    rows = []
    for slope_m, wavelength_m in zip(slopes_m, wavelengths_m, strict=True):
        remainder = np.mod(gradients * slope_m, wavelength_m)
        rows.append(np.minimum(remainder, wavelength_m - remainder))
    return np.array(rows)


def worst_on_grid_m(
    slopes_m: Sequence[float],
    wavelengths_m: Sequence[float],
    gradient_range: tuple[float, float],
    slacks_m: Sequence[float],
    count: int,
) -> float:
    """Smallest, over the grid, of the largest statistic less its slack: never below the exact minimum."""
    gradients = np.linspace(*gradient_range, count)
    statistics = statistic_on_grid_m(gradients, slopes_m, wavelengths_m)
    statistics -= gradients * np.asarray(slacks_m)[:, np.newaxis]
    return max(0.0, float(statistics.max(axis=0).min()))


def best_on_grid_m(
    lengths: Sequence[np.ndarray], gradients: np.ndarray, wavelength_m: float
) -> tuple[float, list[float]]:
    """The best baselines of a grid of lengths, one axis a baseline, by the paper's procedure."""
    statistics = [
        statistic_on_grid_m(gradients, axis, np.full(axis.size, wavelength_m)) for axis in lengths
    ]  # each (lengths, gradients)
    best, where = -1.0, [0.0] * len(lengths)
    *outer, last = statistics
    for index in np.ndindex(*(each.shape[0] for each in outer)):
        fixed = np.zeros(gradients.size)
        for each, place in zip(outer, index, strict=True):
            fixed = np.maximum(fixed, each[place])
        worst = np.maximum(fixed, last).min(axis=1)
        at = int(worst.argmax())
        if worst[at] > best:
            best = float(worst[at])
            where = [float(axis[place]) for axis, place in zip(lengths, (*index, at), strict=True)]
    return best, where
