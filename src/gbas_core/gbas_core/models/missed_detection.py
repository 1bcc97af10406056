"""Multipliers of the protection levels of approach service types C and D.

Source: ICAO Annex 10 vol. I, table B-67, from the probabilities behind it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from scipy.special import ndtri

K_FFMD_SINGLE: Final = 6.86
"""Fault-free multiplier with one reference receiver. Known."""


@lru_cache(maxsize=64)
def k_ffmd(n_receivers: int, probability: float = 2.5e-8) -> float:
    """Fault-free missed detection multiplier, K_ffmd = Q^-1(p / (2 (M+1))).

    Parameters
    ----------
    n_receivers : int
        M, two or more; one receiver has a multiplier of its own (:data:`K_FFMD_SINGLE`).
    probability : float
        p, shared equally by the fault-free and the M single receiver fault hypotheses.

    Source: ICAO Annex 10 vol. I, table B-67 (5.762, 5.810, 5.847), from the probabilities behind it.
    """
    return float(-ndtri(0.5 * probability / (n_receivers + 1)))


@lru_cache(maxsize=64)
def k_md(n_receivers: int, probability: float = 2.5e-8, receiver_fault_prior: float = 1e-5) -> float:
    """Missed detection multiplier given a faulted receiver, K_md = Q^-1((p / (M+1)) / (prior / M)).

    Source: ICAO Annex 10 vol. I, table B-67 (2.935, 2.898, 2.878), from the probabilities behind it.
    """
    return float(-ndtri((probability / (n_receivers + 1)) / (receiver_fault_prior / n_receivers)))
