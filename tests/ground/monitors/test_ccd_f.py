"""Divergence on two frequencies (GAST F): statistics against loops, modes against eq (17), what must stay invisible."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import mahalanobis
from scipy.stats import chi2

from divergence_loops import GAMMA_L5, clock_free, filtered_rates, four_statistics
from gbas_core.ranging.combinations import combination_matrix, iono_ratio
from gbas_core.ranging.divergence import DivergenceParams
from gbas_core.ranging.fault_modes import FAULT_MODES, fault_direction
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS
from gbas_ground.monitors.ccd_f import TwoFrequencyInput, TwoFrequencyParams, initial_two_frequency, two_frequency_step
from gbas_ground.monitors.divergence_covariance import PRINTED_COVARIANCE, StatisticCovariance
from gbas_ground.monitors.divergence_forms import full_rank_form, threshold

T_S = 0.5
SEEN = (0, 3, 7, 12, 20, 33, 40, 50, 60)  # five GPS and four Galileo satellites
FAULTY = 7
GROUPS = [[s for s in SEEN if s < 32], [s for s in SEEN if s >= 32]]
QUICK = TwoFrequencyParams(filters=DivergenceParams(tau_s=10.0, settle_s=20.0))
STEADY = 300
"""Epochs after which a ramp is shown to 1e-4: (1 + a n) (1 - a)^n."""


class World:
    """Ranges, clocks and measurements of some receivers, without noise unless asked for."""

    def __init__(self, *, fault=(0.0, 0.0, 0.0, 0.0), receivers=2, seed=1, noise_m=0.0, other=L5):
        self.rng = np.random.default_rng(seed)
        self.receivers, self.noise_m, self.other = receivers, noise_m, other
        self.seen = np.isin(np.arange(N_SATS), SEEN)
        self.rate = self.rng.uniform(-700.0, 700.0, N_SATS)
        self.acceleration = self.rng.uniform(-0.1, 0.1, N_SATS)
        self.clock_m = np.zeros(receivers)
        self.fault = np.array(fault)  # rates of code, other code, carrier, other carrier of the faulty satellite

    def epoch(self, number, params):
        t = T_S * number
        self.clock_m = self.clock_m + self.rng.normal(50.0, 20.0, self.receivers)  # a clock that wanders a lot
        geometric = 2.2e7 + self.rate * t + 0.5 * self.acceleration * t * t
        geometric = np.where(self.seen, geometric, np.nan) * np.ones((self.receivers, 1))
        clock_s = 1e-5 + 1e-11 * t + np.zeros_like(geometric)
        elevation = np.where(self.seen, 0.6 + 1e-4 * t, np.nan)
        zenith_m = params.zenith_delay_m / np.sqrt(0.002 + np.sin(elevation) ** 2)
        common = geometric - SPEED_OF_LIGHT_MPS * clock_s + self.clock_m[:, np.newaxis] + zenith_m
        code, carrier = np.full((2, self.receivers, N_BANDS, N_SATS), np.nan)
        for place, band in enumerate((L1, self.other)):
            code[:, band], carrier[:, band] = common, common + 100.0 * (band + 1)
            code[:, band, FAULTY] += self.fault[place] * t
            carrier[:, band, FAULTY] += self.fault[place + 2] * t
        code += self.rng.normal(0.0, 1.0, code.shape) * self.noise_m
        carrier += self.rng.normal(0.0, 0.01, code.shape) * self.noise_m
        return {
            "code_m": code, "carrier_m": carrier, "restarted": np.zeros(code.shape, dtype=bool),
            "range_m": geometric, "clock_s": clock_s, "rebased": np.zeros(N_SATS, dtype=bool),
            "elevation_rad": elevation, "used": np.ones(geometric.shape, dtype=bool),
            "clock_used": np.ones(geometric.shape, dtype=bool),
        }  # fmt: skip


def run(world, *, params=QUICK, epochs=200, change=lambda number, seen: None, keep=False):
    state = initial_two_frequency(world.receivers)
    results, inputs = [], []
    for number in range(epochs):
        seen = world.epoch(number, params)
        change(number, seen)
        dt_s = T_S if number else float("nan")
        state, result = two_frequency_step(state, TwoFrequencyInput(**seen), dt_s, params)
        if keep:
            results.append(result)
            inputs.append(seen)
    return (results, inputs) if keep else result


def test_statistics_agree_with_loops():
    world = World(noise_m=0.3)
    results, inputs = run(world, epochs=120, keep=True)
    alpha = T_S / QUICK.filters.tau_s
    for receiver in range(2):
        code = np.array([seen["code_m"][receiver] for seen in inputs])
        carrier = np.array([seen["carrier_m"][receiver] for seen in inputs])
        df1, df5, _, phase = four_statistics(code[:, L1], code[:, L5], carrier[:, L1], carrier[:, L5])
        elevation = np.array([seen["elevation_rad"] for seen in inputs])
        known = np.array(
            [seen["range_m"][receiver] - SPEED_OF_LIGHT_MPS * seen["clock_s"][receiver] for seen in inputs]
        )
        known += 2.4 / np.sqrt(0.002 + np.sin(elevation) ** 2)
        rates = np.diff(phase - known, axis=0) / T_S
        clean = np.array([clock_free(each, GROUPS) for each in rates])
        for satellite in SEEN:
            expected = [
                filtered_rates(np.diff(df1[:, satellite]) / T_S, alpha)[-1],
                filtered_rates(np.diff(df5[:, satellite]) / T_S, alpha)[-1],
                filtered_rates(clean[:, satellite], alpha)[-1],
            ]
            # Ranges of 2e7 m have 4e-9 m in the last bit, over 0.5 s.
            assert results[-1].receiver_mps[:, receiver, satellite] == pytest.approx(expected, abs=1e-7)
    assert results[-1].mean_mps[[0, 1, 3]] == pytest.approx(results[-1].receiver_mps.mean(axis=1), nan_ok=True)


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_steady_state_of_each_mode_is_eq_17(mode):
    world = World(fault=0.02 * fault_direction(mode))
    d1c, d5c, d1l, d5l = world.fault
    result = run(world, epochs=STEADY)
    printed = [
        d1c - 3.53 * d1l + 2.53 * d5l,
        d5c - 4.53 * d1l + 3.53 * d5l,
        2.26 * (d1c - d1l) - 1.26 * (d5c - d5l),
        2.26 * d1l - 1.26 * d5l,
    ]
    # The printed coefficients are rounded to 0.01 (3.53 for 3.5212).
    assert result.mean_mps[:, FAULTY] == pytest.approx(printed, abs=0.02 * 0.021)
    assert result.mean_mps[:, FAULTY] == pytest.approx(combination_matrix(L1, L5) @ world.fault, abs=1e-5)
    assert result.full_rank.failed[FAULTY]
    assert result.published.failed[FAULTY]


@pytest.mark.parametrize(
    ("other", "params"), [(L5, QUICK), (L2, TwoFrequencyParams(other_band="L2", filters=QUICK.filters))]
)
def test_an_ionosphere_is_not_seen(other, params):
    ratio = iono_ratio(L1, other)
    world = World(other=other, fault=(0.5, 0.5 * ratio, -0.5, -0.5 * ratio))
    result = run(world, params=params)
    assert result.mean_mps[:, list(SEEN)] == pytest.approx(np.zeros((4, len(SEEN))), abs=1e-7)
    assert (result.receivers[list(SEEN)] == 2).all()


def test_first_and_second_band_of_any_pair():
    params = TwoFrequencyParams(other_band="L2", filters=QUICK.filters)
    world = World(other=L2, fault=(0.02, 0.01, -0.03, 0.005))
    result = run(world, params=params, epochs=STEADY)
    assert result.mean_mps[:, FAULTY] == pytest.approx(combination_matrix(L1, L2) @ world.fault, abs=1e-5)


def test_a_fault_that_is_not_detected_shows_on_the_others_as_the_papers_mean_has_it():
    world = World(fault=(0.0, 0.0, 0.002, 0.002))
    result = run(world, epochs=STEADY)
    d_if = combination_matrix(L1, L5)[3] @ world.fault
    gps = [s for s in GROUPS[0] if s != FAULTY]
    assert not result.full_rank.failed.any()
    assert result.mean_mps[3, FAULTY] == pytest.approx(d_if, rel=1e-3)
    assert result.mean_mps[3, gps] == pytest.approx(np.full(4, -d_if / 4.0), rel=1e-3)
    assert result.mean_mps[3, GROUPS[1]] == pytest.approx(np.zeros(4), abs=1e-6)


def test_a_fault_that_is_detected_stays_with_its_satellite():
    world = World(fault=(0.0, 0.0, 0.4, 0.0))
    results, _ = run(world, epochs=STEADY, keep=True)
    failed = np.array([each.full_rank.failed for each in results])
    assert np.flatnonzero(failed.any(axis=0)).tolist() == [FAULTY]
    assert failed[60:, FAULTY].all()
    d_if = combination_matrix(L1, L5)[3] @ world.fault
    others = [s for s in SEEN if s != FAULTY]
    assert results[-1].mean_mps[3, FAULTY] == pytest.approx(d_if, rel=1e-3)
    assert results[-1].mean_mps[3, others] == pytest.approx(np.zeros(8), abs=1e-6)
    assert (results[-1].clock_satellites[[0, FAULTY]] == [3, 4]).all()


def test_two_faults_at_once_stay_with_their_satellites():
    def change(number, seen):
        seen["carrier_m"][:, L1, [0, 50]] += 0.2 * T_S * number

    params = TwoFrequencyParams(filters=QUICK.filters, min_clock_satellites=2)
    result = run(World(), params=params, epochs=STEADY, change=change)
    assert np.flatnonzero(result.full_rank.failed).tolist() == [0, 50]


def test_suspicion_falls_on_the_fault_though_others_with_smaller_sigmas_pass_first():
    covariance = StatisticCovariance(elevation_rad=(0.2, 0.5), factor=((1.0, 1.0, 10.0), (1.0, 1.0, 1.0)))
    params = TwoFrequencyParams(filters=QUICK.filters, zenith_delay_m=0.0).with_covariance(covariance)

    def change(number, seen):
        seen["elevation_rad"][FAULTY] = 0.1  # ten times the sigma: the others would fail with a quarter of the fault

    clock = (0.04, 0.04, 0.04, 0.04)  # on the IF carrier alone
    results, _ = run(World(fault=clock), params=params, epochs=STEADY, change=change, keep=True)
    failed = np.array([each.full_rank.failed for each in results])
    assert not np.delete(failed, FAULTY, axis=1).any()
    expected = (0.04 / (10.0 * np.sqrt(0.0724e-5 * 1.25))) ** 2  # the printed variance, four satellites in the clock
    assert results[-1].full_rank.statistic[FAULTY] == pytest.approx(expected, rel=0.05)


def test_a_code_fault_leaves_the_clocks_alone():
    def change(number, seen):
        seen["code_m"][:, L5, 20] += 0.05 * T_S * number
        seen["carrier_m"][:, :, 3] += 0.001 * T_S * number  # the largest carrier rate, and no fault

    result = run(World(), epochs=STEADY, change=change)
    assert np.flatnonzero(result.full_rank.failed).tolist() == [20]
    assert result.clock_satellites[[0, 3, 20]].tolist() == [4.0, 4.0, 4.0]


def test_too_few_for_a_verdict_without_the_suspect_fail_together():
    def change(number, seen):
        seen["carrier_m"][:, L1, 50] += 0.2 * T_S * number  # one of four: without it three are left, with two others
        seen["carrier_m"][..., GROUPS[0]] = np.nan

    result = run(World(), epochs=STEADY, change=change)
    assert np.flatnonzero(result.full_rank.failed).tolist() == GROUPS[1]


def test_the_clock_is_that_of_both_constellations_where_suspects_leave_too_few():
    def change(number, seen):
        seen["carrier_m"][:, L1, 50] += 0.2 * T_S * number

    result = run(World(), epochs=STEADY, change=change)
    assert np.flatnonzero(result.full_rank.failed).tolist() == [50]
    assert result.clock_satellites[[33, 50]].tolist() == [7.0, 3.0]  # two of its own and five of GPS


@pytest.mark.parametrize("faulty", [(0, 3, 7), (0, 3, 7, 12), (7, 40, 50), (0, 33, 40, 50)])
def test_a_minority_of_faults_leaves_the_others_alone(faulty):
    """Up to four of nine, and though they are most of a constellation: its mean moves the healthy ones further."""

    def change(number, seen):
        seen["carrier_m"][:, :, list(faulty)] += 0.02 * T_S * number

    results, _ = run(World(), epochs=STEADY, change=change, keep=True)
    failed = np.array([each.full_rank.failed for each in results])
    assert np.flatnonzero(failed.any(axis=0)).tolist() == list(faulty)
    assert failed[-1, list(faulty)].all()


def test_a_satellite_that_may_not_be_in_the_clock_is_not():
    def change(number, seen):
        seen["clock_used"][:, FAULTY] = False

    world = World(fault=(0.0, 0.0, 0.002, 0.002))
    result = run(world, epochs=STEADY, change=change)
    gps = [s for s in GROUPS[0] if s != FAULTY]
    assert result.mean_mps[3, gps] == pytest.approx(np.zeros(4), abs=1e-6)
    assert result.mean_mps[3, FAULTY] == pytest.approx(combination_matrix(L1, L5)[3] @ world.fault, rel=1e-3)


def test_faults_of_all_satellites_are_not_explained_away():
    def change(number, seen):
        seen["code_m"][:, L1] += 0.2 * T_S * number  # on every code of L1

    result = run(World(), epochs=STEADY, change=change)
    assert result.full_rank.failed[list(SEEN)].all()


def test_a_gap_is_bridged_without_the_clock():
    def change(number, seen):
        if number in (90, 91, 92):
            seen["code_m"][0, :, FAULTY] = np.nan
            seen["carrier_m"][0, :, FAULTY] = np.nan

    results, _ = run(World(), epochs=120, change=change, keep=True)
    assert results[91].receivers[FAULTY] == 1
    assert results[93].receivers[FAULTY] == 2
    # The clock wanders by 20 m an epoch; only its exact removal over the gap leaves nothing.
    assert results[-1].receiver_mps[:, :, list(SEEN)] == pytest.approx(np.zeros((3, 2, len(SEEN))), abs=1e-6)


def test_another_ephemeris_is_no_fault():
    def jump(rebased):
        def change(number, seen):
            if number >= 100:
                seen["range_m"][:, FAULTY] += 3.0
            if number == 100:
                seen["rebased"][FAULTY] = rebased

        return change

    told, untold = (run(World(), epochs=120, change=jump(each)) for each in (True, False))
    assert told.mean_mps[3, FAULTY] == pytest.approx(0.0, abs=1e-6)
    assert told.receivers[FAULTY] == 2
    assert abs(untold.mean_mps[3, FAULTY]) > 0.01


def test_rebasing_at_every_epoch_blinds_nobody():
    world = World(fault=(0.0, 0.0, 0.5, 0.5))

    def change(number, seen):
        seen["rebased"][FAULTY] = True

    result = run(world, epochs=200, change=change)
    assert result.receivers[FAULTY] == 0
    assert not np.isfinite(result.full_rank.statistic[FAULTY])


@pytest.mark.parametrize("band", [L1, L5])
def test_a_slip_on_either_band_restarts(band):
    def change(number, seen):
        if number == 150:
            seen["restarted"][0, band, FAULTY] = True

    result = run(World(), epochs=180, change=change)
    assert result.receivers[FAULTY] == 1
    assert result.settled[:, FAULTY].tolist() == [False, True]
    assert run(World(), epochs=192, change=change).receivers[FAULTY] == 2  # 20 s after the epoch after the slip


def test_too_few_satellites_for_a_clock():
    def change(number, seen):
        seen["carrier_m"][..., [40, 50]] = np.nan  # leaves two of Galileo

    result = run(World(), change=change)
    assert (result.receivers[[33, 60]] == 0).all()
    assert (result.receivers[GROUPS[0]] == 2).all()
    assert (result.clock_satellites[GROUPS[0]] == 4).all()


def test_unmonitored_is_not_failed_and_not_passed():
    result = run(World(), params=TwoFrequencyParams(), epochs=100)
    assert (result.receivers == 0).all()
    assert np.isnan(result.full_rank.statistic).all()
    assert not result.full_rank.failed.any()


def test_without_elevation_there_is_no_troposphere_and_no_monitoring():
    def change(number, seen):
        if number == 199:
            seen["elevation_rad"] = np.full(N_SATS, np.nan)

    result = run(World(), change=change)
    assert (result.receivers == 0).all()
    assert np.isnan(result.full_rank.statistic).all()


def test_thresholds():
    # ENC 2015, after table 3; chi-square with 3 degrees of freedom from scipy.
    assert threshold("published", 1e-9) == pytest.approx(47.8795, abs=5e-5)
    assert threshold("full_rank", 1e-9) == pytest.approx(chi2.isf(1e-9, 3), rel=1e-12)
    assert threshold("full_rank", 1e-9) == pytest.approx(44.84, abs=5e-3)


def test_forms_are_quadratic_forms_of_the_means():
    world = World(receivers=3, noise_m=0.1)
    result = run(world)
    inverse = np.linalg.pinv(PRINTED_COVARIANCE)
    for satellite in SEEN:
        x = result.mean_mps[:, satellite]
        assert result.published.statistic[satellite] == pytest.approx(3.0 * x @ inverse @ x, rel=1e-9)
        q = result.covariance[satellite]
        distance = mahalanobis(x[[0, 1, 3]], np.zeros(3), np.linalg.inv(q))
        assert result.full_rank.statistic[satellite] == pytest.approx(distance**2, rel=1e-9)


def test_covariance_of_one_satellite_does_not_touch_another():
    rates = np.ones((3, 2))
    covariance = np.stack([np.eye(3), np.full((3, 3), np.nan)])
    assert full_rank_form(rates, covariance) == pytest.approx([3.0, np.nan], nan_ok=True)


def test_more_receivers_make_independent_noise_smaller():
    covariance = StatisticCovariance(receiver=np.diag([1e-6] * 3).tolist(), common=np.zeros((3, 3)).tolist())
    three, one = covariance.at(np.full(2, 0.5), np.array([3, 1]), np.array([np.inf, 4.0]))
    assert three == pytest.approx(np.diag([1e-6 / 3.0] * 3))
    assert one == pytest.approx(np.diag([1e-6, 1e-6, 1.25e-6]))  # (1 + 1/n) for the clock


def test_gamma_of_the_loops_is_the_suites():
    assert iono_ratio(L1, L5) == pytest.approx(GAMMA_L5, rel=1e-15)


@pytest.mark.parametrize(
    "wrong",
    [{"band": 3}, {"other_band": "L1"}, {"p_false_alarm": 0.0}, {"min_clock_satellites": 0}, {"zenith_delay_m": -1.0}],
)
def test_parameters_are_checked(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        TwoFrequencyParams(**wrong)
