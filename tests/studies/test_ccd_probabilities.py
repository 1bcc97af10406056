"""Missed detection, required region, critical mapping functions, and importance sampling that knows nothing of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, ncx2, norm

from gbas_core.ranging.divergence import GROUND, DivergenceParams, white_noise_gain
from gbas_core.ranging.fault_modes import fault_direction
from gbas_studies.ccd.missed_detection import (
    critical_mapping_gast_d,
    critical_mapping_gast_f,
    p_md,
    required_p_md,
)
from gbas_studies.ccd.monitors import monitor_for, one_sided_threshold_mps
from gbas_studies.ccd.rare_events import COLUMNS, Sampling, single_frequency, two_frequency

SIGMA, THRESHOLD = 0.00399, 0.0233
NOISE_M = np.array([0.3, 0.2, 0.003, 0.004])
QUICK = DivergenceParams(tau_s=5.0)


def test_required_region():
    assert required_p_md([0.0, 0.7499, -0.7]) == pytest.approx([1.0, 1.0, 1.0])
    assert required_p_md(1.5) == pytest.approx(10.0 ** (-2.56 * 1.5 + 1.92))
    assert required_p_md([2.7, 10.0, -5.0]) == pytest.approx([1e-5] * 3)
    # Continuous to 2 % at both corners.
    assert required_p_md(0.75) == pytest.approx(1.0, rel=0.02)
    assert required_p_md(2.7 - 1e-9) == pytest.approx(1e-5, rel=0.02)


def test_missed_detection_against_scipy():
    single = monitor_for("gast-d", "Code L1")
    rate = np.linspace(0.0, 0.06, 13)
    expected = norm.cdf((THRESHOLD - rate) / SIGMA) - norm.cdf((-THRESHOLD - rate) / SIGMA)
    assert p_md(single, rate) == pytest.approx(expected, rel=1e-10)
    for name, freedom in (("gast-f-paper", 4), ("gast-f-sound", 3)):
        double = monitor_for(name, "Code L5")
        size = rate * double.gain
        expected = ncx2.cdf(chi2.isf(1e-9, freedom), freedom, size**2)
        # Two series for the same distribution; both lose digits in the far tail.
        assert p_md(double, size) == pytest.approx(expected, rel=1e-6, abs=1e-15)


def test_critical_mapping_just_touches_the_requirement():
    limit = one_sided_threshold_mps()
    mapping, decisive_m = critical_mapping_gast_d(SIGMA, limit)
    error_m = np.linspace(0.75, 5.0, 4000)
    margin = norm.cdf((limit - mapping * error_m) / SIGMA) / required_p_md(error_m)
    assert margin.max() == pytest.approx(1.0, abs=1e-4)
    assert error_m[margin.argmax()] == pytest.approx(decisive_m, abs=2e-3)
    for form, freedom in (("published", 4), ("full_rank", 3)):
        for power in (1, 2):
            mapping, _ = critical_mapping_gast_f(form, 1e-9, power=power)
            missed = ncx2.cdf(chi2.isf(1e-9, freedom), freedom, mapping * error_m**power)
            assert (missed / required_p_md(error_m)).max() == pytest.approx(1.0, abs=1e-3)


def agrees(found, exact):
    # Four standard errors: one in 16 000 runs of a right program would miss it, and the seeds are fixed.
    assert abs(found.value - exact) < 4.0 * found.standard_error
    assert found.standard_error < 0.1 * exact


def test_false_alarms_to_1e_9():
    def sampling(seed: int) -> Sampling:
        return Sampling(samples=4000, seed=seed, params=QUICK)

    agrees(single_frequency(0.0, SIGMA, THRESHOLD, sampling(1), alarm=True), 2.0 * norm.sf(THRESHOLD / SIGMA))
    exact = 2.0 * norm.sf(0.02438 / SIGMA)
    assert exact == pytest.approx(1e-9, rel=0.02)
    agrees(single_frequency(0.0, SIGMA, 0.02438, sampling(2), alarm=True), exact)
    agrees(two_frequency(None, 0.0, NOISE_M, sampling(3), alarm=True), 1e-9)


@pytest.mark.parametrize("rate", [0.01, 0.03, 0.0473])
def test_missed_detections_of_one_frequency(rate):
    found = single_frequency(rate, SIGMA, THRESHOLD, Sampling(samples=4000, seed=4, params=QUICK), alarm=False)
    agrees(found, norm.cdf((THRESHOLD - rate) / SIGMA))


@pytest.mark.parametrize("mode", ["Code L1", "Carrier L5", "Code L5, Carrier L1", "Code+Carrier L1+L5"])
@pytest.mark.parametrize("sizes", [5.0, 9.0, 12.4])
def test_missed_detections_of_two_frequencies(mode, sizes):
    alpha = 0.5 / QUICK.tau_s
    covariance = (white_noise_gain(alpha) / 0.5) ** 2 * (COLUMNS * NOISE_M**2) @ COLUMNS.T
    means = COLUMNS @ fault_direction(mode)
    rate = sizes / np.sqrt(means @ np.linalg.solve(covariance, means))
    found = two_frequency(mode, rate, NOISE_M, Sampling(samples=4000, seed=5, params=QUICK), alarm=False)
    agrees(found, ncx2.cdf(chi2.isf(1e-9, 3), 3, sizes**2))


def test_ground_filters_too():
    found = single_frequency(0.0, SIGMA, THRESHOLD, Sampling(samples=2000, seed=6, params=GROUND), alarm=True)
    agrees(found, 2.0 * norm.sf(THRESHOLD / SIGMA))


def test_the_same_seed_gives_the_same_bits():
    sampling = Sampling(samples=200, seed=7, params=QUICK)
    first, second = (single_frequency(0.0, SIGMA, THRESHOLD, sampling, alarm=True) for _ in range(2))
    assert first == second
