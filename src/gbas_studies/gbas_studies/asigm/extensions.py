"""What the paper leaves to do: more receivers, all baselines, placement tolerance, L5 and both bands."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE
from gbas_siting.chain import chain_statistic_m
from gbas_siting.problem import SitingProblem
from gbas_siting.search import BUDGET, Siting, best_siting
from gbas_studies.asigm.detectability import WAVELENGTH, K
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

_QUICK_BUDGET: Final = 300_000
_CASES: Final[dict[str, dict[str, Any]]] = {
    "Three receivers, all baselines": {"n_receivers": 3, "baselines": "all"},
    "Four receivers, all baselines": {"n_receivers": 4, "baselines": "all"},
    "Three receivers, 1 m tolerance": {"n_receivers": 3, "tolerance_m": 1.0},
    "Four receivers, 1 m tolerance": {"n_receivers": 4, "tolerance_m": 1.0},
    "Three receivers, L5": {"n_receivers": 3, "bands": (L5,)},
    "Three receivers, L1 or L5": {"n_receivers": 3, "bands": (L1, L5)},
    "Four receivers, L5": {"n_receivers": 4, "bands": (L5,)},
    "Four receivers, L1 or L5": {"n_receivers": 4, "bands": (L1, L5)},
    "Five receivers, all baselines": {"n_receivers": 5, "baselines": "all"},
    "Three receivers, 100 to 2000 mm/km": {"n_receivers": 3, "gradient_range": (100e-6, 2000e-6)},
}


def extensions_section(quick: bool) -> Section:
    """Optima beyond the paper's, each with what cannot be exceeded."""
    budget = _QUICK_BUDGET if quick else BUDGET
    stars = {m: best_siting(SitingProblem(n_receivers=m), budget=budget) for m in range(2, 9)}
    chain_mm = {m: chain_statistic_m(WAVELENGTH, GRADIENT_RANGE, m - 1) / K * 1e3 for m in stars}
    items: list[Value | Claim] = [
        _value(f"{m} receivers", siting, f"; the single-lobe chain has {chain_mm[m]:.3f} mm")
        for m, siting in stars.items()
    ]
    items += [_value(name, best_siting(SitingProblem(**case), budget=budget), "") for name, case in _CASES.items()]
    items.append(
        Claim(
            name="The chain is not always the best",
            holds=stars[5].sigma_m * 1e3 > chain_mm[5]
            and all(stars[m].sigma_bound_m * 1e3 < chain_mm[m] + 1e-4 for m in (3, 4, 6)),
            paper_text="–",
            ours_text=f"five receivers reach {stars[5].sigma_m * 1e3:.3f} mm, their chain {chain_mm[5]:.3f} mm; with "
            "three, four and six the chain is proved the best",
            definition="closed form against branch and bound",
            new=True,
        )
    )
    return Section(
        title="Beyond the paper",
        text="Largest double-difference sigma with every gradient of 300 to 2000 mm/km detected by at least one "
        "baseline. Each value comes with a proof how much more any places could allow.",
        items=items,
        pictures=[_picture(stars, chain_mm)],
    )


def _value(name: str, siting: Siting, more: str) -> Value:
    gap = 100.0 * (siting.bound_m / siting.statistic_m - 1.0)
    proof = "proved the best" if siting.closed else f"at most {gap:.2g} % more is possible"
    places = ", ".join(f"{place:.2f}" for place in siting.new_m)
    return Value(
        name=name, ours=siting.sigma_m * 1e3, unit="mm", definition=f"{places} m from the first receiver; {proof}{more}"
    )


def _picture(stars: dict[int, Siting], chain_mm: dict[int, float]) -> Picture:
    count = np.array(list(stars), dtype=np.float64)
    best: FloatArray = np.array([siting.sigma_m * 1e3 for siting in stars.values()])
    bound: FloatArray = np.array([siting.sigma_bound_m * 1e3 for siting in stars.values()])
    chain: FloatArray = np.array(list(chain_mm.values()))
    figure = new_figure(height=3.8)
    axis = figure.axes[0]
    axis.plot(count, best, "o-", label="best places")
    axis.plot(count, chain, "s--", markersize=4, label="single-lobe chain")
    axis.axhline(0.5 * WAVELENGTH / K * 1e3, color="grey", linestyle=":", label="half a wavelength")
    axis.set(xlabel="receivers", ylabel="sigma [mm]", ylim=(0.0, 13.0), title="Largest sigma with 100 % detected")
    axis.legend(loc="lower right")
    return Picture(
        name="receivers",
        title="More receivers",
        caption="Baselines of the first receiver, L1. No number of receivers allows more than half a wavelength "
        "over k.",
        figure=figure,
        data={"receivers": count, "sigma_mm": best, "bound_mm": bound, "chain_mm": chain},
    )
