"""Closed form of the single-lobe chain: each baseline sees its first tent only, and takes over where the next ends.

With ``q`` baselines from the first receiver and ``rho`` the ratio of the highest to the lowest gradient, the longest
baseline begins at the lowest gradient and each tent ends where that of the next shorter baseline begins, the last at
the highest gradient: ``D = wavelength / (1 + rho^(1/q))``.

It is the best arrangement of three, four and six receivers over 300 to 2000 mm/km, but not of any number: with five
and seven, arrangements that use second tents are better (:mod:`~gbas_siting.search` proves both).
"""

from __future__ import annotations

import numpy as np

from gbas_core.record import FloatArray


def chain_statistic_m(wavelength_m: float, gradient_range: tuple[float, float], n_baselines: int) -> float:
    """Statistic of the gradient the chain sees worst, D [m]."""
    low, high = gradient_range
    return float(wavelength_m / (1.0 + (high / low) ** (1.0 / n_baselines)))


def chain_lengths_m(wavelength_m: float, gradient_range: tuple[float, float], n_baselines: int) -> FloatArray:
    """Lengths of the chain's baselines ``(n_baselines,)``, ascending [m].

    The longest is ``D / low``; the others are shorter by the same ratio each.
    """
    low, high = gradient_range
    longest = chain_statistic_m(wavelength_m, gradient_range, n_baselines) / low
    steps = np.arange(1 - n_baselines, 1) / n_baselines
    result: FloatArray = longest * (high / low) ** steps
    return result
