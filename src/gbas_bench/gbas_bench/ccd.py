"""The divergence's part of the benchmark: the full sweep of the study, and one epoch of the monitors."""

from __future__ import annotations

import statistics
import time
from typing import Final

import numpy as np

from gbas_bench.figures import Figure, Part
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.ccd import CcdParams, ccd_step, initial_ccd
from gbas_ground.monitors.ccd_f import TwoFrequencyInput, TwoFrequencyParams, initial_two_frequency, two_frequency_step
from gbas_ground.monitors.divergence_classification import classify
from gbas_studies.ccd.monitors import MONITORS
from gbas_studies.ccd.smoothed_error import Smoothing
from gbas_studies.ccd.worst_case import Grid, study

SWEEP_BUDGET_S: Final = 1.0
STEP_BUDGET_S: Final = 2e-3
RECEIVERS: Final = 4
_T_S: Final = 0.5
_GRID: Final = Grid(d_step_mps=0.001, d_max_mps=0.1, onset_step_s=0.5, onset_max_s=150.0)


def measure_ccd(n_epochs: int) -> Part:
    """Processor time of the sweep and of the monitors, the latter a median of so many epochs."""
    begin_s = time.process_time()
    for start in ("variant", "invariant"):
        for mode in FAULT_MODES:
            for monitor in MONITORS:
                study(mode, monitor, Smoothing(start=start), _GRID)
    sweep_s = time.process_time() - begin_s
    rates, offsets = len(_GRID.rates_mps()), len(_GRID.offsets(_T_S))
    figures = (
        Figure(
            part="ccd", name=f"sweep, {rates} rates x {offsets} offsets, 15 modes, 3 monitors, both filters",
            value=sweep_s, unit="s", against=f"bound {SWEEP_BUDGET_S:g} s", reference=SWEEP_BUDGET_S, better="less",
        ),
        Figure(
            part="ccd", name=f"CCD of GAST D and F, {RECEIVERS} receivers x 40 satellites x 2 bands, an epoch",
            value=1e3 * _monitors_s(n_epochs), unit="ms", against=f"bound of all monitors {1e3 * STEP_BUDGET_S:g} ms",
            reference=1e3 * STEP_BUDGET_S, better="less",
        ),
    )  # fmt: skip
    about = f"Processor time. The monitors' is a median of {n_epochs} epochs and has the classification in it."
    return Part(name="ccd", about=about, figures=figures)


def _monitors_s(n_epochs: int) -> float:
    epochs = [_epoch(number) for number in range(n_epochs)]
    single_params, double_params = CcdParams(), TwoFrequencyParams()
    single, double = initial_ccd(RECEIVERS), initial_two_frequency(RECEIVERS)
    taken = []
    for number, epoch in enumerate(epochs):
        dt_s = _T_S if number else float("nan")
        begin_s = time.process_time()
        single, _ = ccd_step(single, epoch, dt_s, single_params)
        double, seen = two_frequency_step(double, epoch, dt_s, double_params)
        classify(seen.mean_mps[[0, 1, 3]], seen.covariance, L1, L5)
        taken.append(time.process_time() - begin_s)
    return statistics.median(taken)


def _epoch(number: int) -> TwoFrequencyInput:
    """Ranges of 20 satellites of each constellation with white noise."""
    rng = np.random.default_rng(number)
    here = np.zeros(N_SATS, dtype=bool)
    here[:20] = here[32:52] = True
    range_m = np.where(here, 2.2e7 + 400.0 * _T_S * number, np.nan) * np.ones((RECEIVERS, 1))
    shape = (RECEIVERS, N_BANDS, N_SATS)
    yes = np.ones((RECEIVERS, N_SATS), dtype=bool)
    return TwoFrequencyInput(
        code_m=range_m[:, np.newaxis] + rng.normal(0.0, 0.3, shape),
        carrier_m=range_m[:, np.newaxis] + rng.normal(0.0, 0.003, shape),
        restarted=np.zeros(shape, dtype=bool),
        range_m=range_m,
        clock_s=np.zeros_like(range_m),
        rebased=np.zeros(N_SATS, dtype=bool),
        elevation_rad=np.full(N_SATS, 0.7),
        used=yes,
        clock_used=yes,
    )
