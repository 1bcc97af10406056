"""Injected faults: the limits by closed forms, and a few faults through the station to the burst."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_bringup.resources import named_config
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_ground.params import GroundParams
from gbas_sim.faults.kinds import CodeCarrierDivergence, ExcessiveAcceleration
from gbas_sim.scenario import read_sections, scenario_from_yaml
from gbas_studies.campaign import Execution
from gbas_studies.ccd.smoothed_error import Smoothing, StudyError, largest_error_s
from gbas_studies.faults.campaign import QUIET_S, WORLD_S, Setting, run_campaign
from gbas_studies.faults.cases import KINDS, cases_of
from gbas_studies.faults.exposure import TIME_TO_ALERT_S, divergence_limit_s, extrapolation_limit_s
from gbas_studies.faults.injection import inject, settle


@pytest.fixture(scope="module")
def world():
    params = scenario_from_yaml(named_config("quiet_approach"))
    return replace(params, flight=None, duration_s=WORLD_S, faults=(), fronts=())


@pytest.fixture(scope="module")
def station():
    return GroundParams.from_mapping(read_sections(named_config("quiet_approach"))["ground"])


@pytest.fixture(scope="module")
def settled(world, station):
    return settle(world, station, QUIET_S)


def test_the_worst_users_error_is_that_of_the_suites_own_filters():
    """Ramp of 1 m/s on the code from 0 s; users that started 80, 50 and 20 s before 100 s, by the filter itself."""
    filters = SmoothingParams(tau_s=(30.0,), start="elapsed")
    now_s, worst, no_slip = 100.0, 0.0, np.zeros(1, dtype=bool)

    def smoothed(begin_s):
        state, carrier = initial_smoothing(filters, n_sats=1), np.zeros(1)
        for number in range(round((now_s - begin_s) / 0.5) + 1):
            code = np.array([max(0.0, begin_s + 0.5 * number)])
            state, value = smooth_step(state, code, carrier, no_slip, 0.5 if number else np.nan, filters)
        return float(value[0, 0])

    ground = smoothed(-600.0)
    for begin_s in np.arange(-60.0, now_s - 49.5 + 0.25, 0.5):
        worst = max(worst, abs(smoothed(begin_s) - ground))
    assert largest_error_s(np.array([now_s]), Smoothing())[0] == pytest.approx(worst, rel=1e-9)


def test_limits():
    assert divergence_limit_s(0.0001, Smoothing()) == np.inf
    slow, fast = (divergence_limit_s(rate, Smoothing()) for rate in (0.3, 3.0))
    assert fast < slow < np.inf
    assert extrapolation_limit_s(1.7, 0.0, 0.0) == 0.0
    assert extrapolation_limit_s(0.0, 2.0, 0.0) == pytest.approx(0.8, abs=0.011)  # 1.6 m / 2 m/s, steps of 10 ms
    assert extrapolation_limit_s(0.0, 0.0, 0.1) == np.inf  # 0.15 m for good


@pytest.mark.parametrize(("size", "causes"), [
    ({"step_m": 3.0}, {"common_slip"}),
    ({"ramp_mps": 2.0}, {"common_slip", "carrier_step"}),
    ({"acceleration_mps2": 1.2}, {"carrier_step", "common_slip", "carrier_acceleration"}),
])  # fmt: skip
def test_faults_beyond_the_limit_reach_the_user_in_time(settled, size, causes):
    satellite, onset_s = settled.usable[0], QUIET_S + 0.8
    fault = ExcessiveAcceleration(satellite=satellite, start_s=onset_s, **size)
    reaction = inject(settled, (fault,), satellite, onset_s, 20.0)
    grown = (size.get(name, 0.0) for name in ("step_m", "ramp_mps", "acceleration_mps2"))
    assert reaction.burst_s - extrapolation_limit_s(*grown) <= TIME_TO_ALERT_S
    assert reaction.cause in causes
    assert reaction.others == ()


def test_a_divergence_is_told_before_the_error_passes_its_limit(settled):
    satellite, onset_s = settled.usable[1], QUIET_S + 0.7
    fault = CodeCarrierDivergence(satellite=satellite, mode="Code L1", ramp_mps=0.3, start_s=onset_s)
    reaction = inject(settled, (fault,), satellite, onset_s, 60.0)
    assert reaction.burst_s < divergence_limit_s(0.3, Smoothing())
    assert reaction.cause in ("code_carrier_divergence", "two_frequency_divergence")
    assert set(reaction.failed_s) & {"ccd/rate", "ccd_f/full_rank"}


def test_without_a_fault_nothing_happens(settled):
    harmless = CodeCarrierDivergence(satellite="G01", mode="Code L1", ramp_mps=1e-9, start_s=QUIET_S + 0.5)
    reaction = inject(settled, (harmless,), "G01", QUIET_S + 0.5, 60.0)
    assert not reaction.detected
    assert reaction.others == ()


@pytest.mark.campaign
def test_one_process_and_two_find_the_same(world, station):
    cases = [case for case in cases_of(("acceleration",)) if case.name in ("step 0.5 m", "ramp 0.2 m/s")]
    setting = Setting(world=world, station=station)
    one, two = (run_campaign(setting, cases, trials=1, execution=Execution(workers=each)) for each in (1, 2))
    assert [each.as_json() for each in one] == [each.as_json() for each in two]


def test_bad_requests():
    with pytest.raises(StudyError, match="kind 'nothing' is not one of divergence"):
        cases_of(("nothing",))
    with pytest.raises(StudyError, match="mode 'Code L7' is not one of"):
        cases_of(("divergence",), modes=("Code L7",))
    assert {case.kind for case in cases_of(KINDS)} == set(KINDS)
