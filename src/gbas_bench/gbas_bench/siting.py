"""The siting part of the benchmark: how many places of receivers are judged a second, and how long a search takes."""

from __future__ import annotations

import time
from typing import Final

import numpy as np

from gbas_bench.figures import Figure, Part
from gbas_core.signals import L1, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE
from gbas_siting.problem import MAX_LENGTH_M, SitingProblem
from gbas_siting.search import best_siting
from gbas_siting.worst_gradient import worst_gradient

CANDIDATES_A_SECOND: Final = 5.0e6
SEARCH_BUDGET_S: Final = 1.0
_REPEATS: Final = 3


def measure_siting(n_candidates: int) -> Part:
    """Candidates of three receivers judged a second of processor time on one core, and the search for four."""
    lengths_m = np.random.default_rng(1).uniform(0.0, MAX_LENGTH_M, (n_candidates, 2))
    wavelength_m = float(WAVELENGTH_M[L1])
    worst_gradient(lengths_m[:1], wavelength_m, GRADIENT_RANGE)  # compiles
    rates = []
    for _ in range(_REPEATS):
        begin_s = time.process_time()
        worst_gradient(lengths_m, wavelength_m, GRADIENT_RANGE)
        rates.append(n_candidates / (time.process_time() - begin_s))
    begin_s = time.process_time()
    best = best_siting(SitingProblem(n_receivers=4))
    search_s = time.process_time() - begin_s
    figures = (
        Figure(
            part="siting",
            name="places of three receivers judged exactly, one core",
            value=max(rates) / 1e6,
            unit="million/s",
            against=f"bound {CANDIDATES_A_SECOND / 1e6:g} million/s",
            reference=CANDIDATES_A_SECOND / 1e6,
            better="more",
        ),
        Figure(
            part="siting",
            name="search for the best places of four receivers, proof included",
            value=search_s,
            unit="s",
            against=f"budget {SEARCH_BUDGET_S:g} s",
            reference=SEARCH_BUDGET_S,
            better="less",
        ),
    )
    return Part(
        name="siting",
        about=f"Processor time for {n_candidates} places of three receivers up to {MAX_LENGTH_M:g} m apart, gradients "
        f"300 to 2000 mm/km, the best of {_REPEATS} runs; and of one search.",
        figures=figures,
        details={"sigma of four receivers [mm]": best.sigma_m * 1e3, "proved": best.closed},
    )
