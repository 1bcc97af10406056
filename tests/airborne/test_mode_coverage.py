"""Noise of matching sigmas in every mode's ranges: errors exceed scaled-down levels as often as they may.

Levels of GAST-D are of the 100 s solution's sigmas and carry the rest, what 30 s of smoothing leave more, in D_V and
D_L: there the share may only be smaller.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import fas_data_set
from gbas_airborne import receiver
from gbas_airborne.navigation.locate import Located
from gbas_airborne.navigation.position import PositionInputs, Prior, find_positions
from gbas_airborne.params import AirborneParams, ServiceDParams
from gbas_airborne.protection.levels import Multipliers, levels_of_all
from gbas_airborne.ranging.corrected_ranges import Corrected, RangingSources
from gbas_airborne.receiver import AirborneReceiver, AirborneState
from gbas_airborne.reception.station_data import final_approach
from gbas_airborne.report import report
from gbas_core.satellites import N_SATS
from gbas_msgs_py.modes import MODES, Mode
from modes_world import ModesWorld, receive_l5

TRIALS = 400
EXCEEDED = 0.1
"""Share of trials that may be beyond the levels."""
K = 1.6449  # two-sided, 10 %
PARAMS = AirborneParams(
    settle_s=5.0, inflate_unsettled=False, modes=("all",), authentication=True, rpds=5, range_test_floor_m=1000.0,
    gast_d=ServiceDParams(divergence_settle_s=5.0, step_in_s=0.0),
)  # fmt: skip
FAS_D = fas_data_set(apd=2, rpi="AEDV")
FAS = final_approach(FAS_D)


@pytest.fixture(scope="module")
def corrected() -> Corrected:
    """The ranging sources of the last epoch of a flight without errors."""
    world = ModesWorld(path=lambda t: FAS.position_on_path(6000.0 - 70.0 * t), approaches=(FAS_D,))
    kept: list[Corrected] = []
    with pytest.MonkeyPatch.context() as patch:
        receive_l5(patch, world)
        plain = receiver.locate

        def locate(state, found, params):
            kept.append(found)
            return plain(state, found, params)

        patch.setattr(receiver, "locate", locate)
        state = AirborneState()
        for k in range(30):
            state, output = AirborneReceiver.step(state, world.epoch(0.5 * k), PARAMS)
    assert len(output.solutions) == len(MODES)
    return kept[-1]


def positions(sources: list[RangingSources], corrected: Corrected, start_m: np.ndarray) -> tuple:
    """Solutions of ranging sources of one mode, a trial each."""
    received = corrected.received
    inputs = [PositionInputs(each, each.reason, Prior(start_m, recent=False, dt_s=math.nan)) for each in sources]
    results = find_positions(inputs, received.station, received.approach, PARAMS)
    return report(Located(received=received, results=tuple(results), events=()))


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_fault_free_coverage(corrected: Corrected, mode: Mode) -> None:
    sources = next(each for each in corrected.sources if each.mode.name == mode.name)
    start_m = corrected.received.station.reference_ecef_m
    (quiet,) = positions([sources], corrected, start_m)
    sigma = np.sqrt(quiet.sigma_gnd_m**2 + quiet.sigma_air_m**2 + quiet.sigma_tropo_m**2 + quiet.sigma_iono_m**2)
    rng = np.random.default_rng(mode.number)
    trials = []
    for _ in range(TRIALS):
        error_m = rng.normal(size=N_SATS) * sigma
        more_m = rng.normal(size=N_SATS) * sigma if mode.beside else np.zeros(N_SATS)  # what 30 s have more of
        beside = sources.beside and replace(sources.beside, range_m=sources.beside.range_m + error_m)
        trials.append(replace(sources, range_m=sources.range_m + error_m + more_m, beside=beside))
    solutions = positions(trials, corrected, start_m)
    scaled = Multipliers(k_ffmd=np.full(5, K), k_md=np.full(5, np.nan))
    levels = levels_of_all(solutions, scaled)
    truth_m = np.array([quiet.x_m, quiet.y_m, quiet.z_m])
    for row, (axis, tan) in enumerate((((0.0, 0.0, 1.0), math.tan(FAS.gpa_rad)), ((0.0, 1.0, 0.0), 0.0))):
        direction = np.array(axis) + np.array([tan, 0.0, 0.0])
        errors = np.array([
            abs(direction @ (FAS.rot_approach_ecef @ (np.array([s.x_m, s.y_m, s.z_m]) - truth_m))) for s in solutions
        ])  # fmt: skip
        beyond = int((errors > np.array([each.h0_m[row] for each in levels])).sum())
        spread = 4.0 * math.sqrt(TRIALS * EXCEEDED * (1.0 - EXCEEDED))  # four standard deviations of a binomial
        assert beyond <= TRIALS * EXCEEDED + spread
        assert mode.beside or beyond >= TRIALS * EXCEEDED - spread
