"""The simulator's part of the benchmark: how long a simulated hour takes."""

from __future__ import annotations

import time
from typing import Any, Final

import numpy as np

from gbas_bench.figures import Figure, Part
from gbas_bringup.resources import config_path
from gbas_core.signals import L1
from gbas_sim.scenario import read_sections, scenario_from_mapping
from gbas_sim.world import World

EPOCHS_AN_HOUR: Final = 7200
HOUR_BUDGET_S: Final = 20.0
_WARM: Final = 20
# Everything that is evaluated at each epoch: receivers as the designators say, ionosphere, a front, scintillation.
_ALL: Final[dict[str, Any]] = {
    "ionosphere": {"sigma_vig": 4.0e-6},
    "scintillation": {"equatorial_s4": 0.3},
    "ground_receiver": {"preset": "gad_c"},
    "airborne_receiver": {"preset": "aad_b"},
    "threats": {
        "wedge": {"kind": "front", "gradient": 300e-6, "width_m": 50e3, "speed_mps": 100.0},
        "ramp": {"kind": "divergence", "satellite": "G08", "mode": "Code L1", "ramp_mps": 0.01, "start_s": 0.0},
    },
}


def measure_worlds(n_epochs: int) -> Part:
    """Processor time of so many epochs of a plain world and of one with everything in it, as an hour of them."""
    site = read_sections(config_path("braunschweig.yaml"))
    figures, details = [], {}
    for name, changes in (("receivers and troposphere", {}), ("with all of atmosphere and errors", _ALL)):
        world = World(scenario_from_mapping({**site, "sim": {**site["sim"], **changes}}))
        hour_s = EPOCHS_AN_HOUR * _epoch_s(world, n_epochs)
        figures.append(
            Figure(
                part="simulator",
                name=f"an hour at 2 Hz, 4+1 receivers, L1 and L5, {name}",
                value=hour_s,
                unit="s",
                against=f"bound {HOUR_BUDGET_S:g} s",
                reference=HOUR_BUDGET_S,
                better="less",
            )
        )
        details[f"{name}: satellites"] = int(np.isfinite(world.epoch(0).airborne.code_m[L1]).sum())  # type: ignore[union-attr]
    return Part(
        name="simulator",
        about=f"Processor time of an hour of simulated observations, from {n_epochs} epochs on one core. All 48 "
        "satellites are computed, in view or not.",
        figures=tuple(figures),
        details=details,
    )


def _epoch_s(world: World, n_epochs: int) -> float:
    for number in range(_WARM):
        world.epoch(number)
    begin_s = time.process_time()
    for number in range(_WARM, _WARM + n_epochs):
        world.epoch(number)
    return (time.process_time() - begin_s) / n_epochs
