"""Sigma monitor: its estimates, the tails of their distribution, false alarms and detections of correlated B values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from array_corrections import b_failures
from gbas_core.satellites import N_SATS
from gbas_ground.monitors.sigma_monitor import (
    SigmaMonitorParams,
    estimate_distribution,
    initial_sigma_monitor,
    normalised_b,
    quadratic_quantile,
    sigma_monitor_step,
    window_weights,
)
from loop_sigma import correlated, dense_distribution, stored_estimates
from monitor_scenes import STATION

PARAMS = STATION.sigma_monitor
HERE = np.arange(N_SATS) < 10
STEP_S = 50.0


def due(receivers=4):
    return np.broadcast_to(HERE, (receivers, N_SATS)).copy()


def run(values, *, params=PARAMS, dt_s=STEP_S, wanted=None):
    state, results = initial_sigma_monitor(values.shape[2], params), []
    for number, value in enumerate(values):
        state, result = sigma_monitor_step(
            state, value, due(values.shape[2]) if wanted is None else wanted, np.nan if number == 0 else dt_s, params
        )
        results.append(result)
    return state, results


def b_like(rng, count, *, receivers=4, params=PARAMS):
    """Normalised B values with the correlation the monitor allows for, (count, T, R, N)."""
    parts = [correlated(rng, count, (receivers, N_SATS), STEP_S, each) for each in params.correlation_s]
    return np.where(HERE, np.stack(parts, axis=1), np.nan)


def test_recursion_is_the_weighted_sum_of_what_was_sampled():
    rng = np.random.default_rng(1)
    values = rng.normal(size=(120, 2, 4, N_SATS))
    values[rng.random(values.shape) < 0.02] = np.nan
    values[:, :, :, ~HERE] = np.nan
    state, _ = run(values, dt_s=20.0)  # a sample every third epoch
    for place in ((0, 0, 0, 0), (1, 1, 2, 7), (0, 1, 3, 9)):
        window, constant, receiver, satellite = place
        series, taken, since = values[:, :, receiver, satellite], [], np.inf
        for value in series:
            since += 20.0
            if np.isfinite(value).all() and since >= PARAMS.sample_s:
                taken.append(float(value[constant]))
                since = 0.0
        mean, square = stored_estimates(taken, PARAMS.window_s[window], PARAMS.sample_s)
        assert state.count[receiver, satellite] == len(taken) > 35
        assert state.estimates[0][place] == pytest.approx(mean, rel=1e-12)
        assert state.estimates[1][place] == pytest.approx(square, rel=1e-12)


@pytest.mark.parametrize("count", [1, 2, 30, 90])
def test_distribution_from_three_diagonals_is_that_of_the_whole_matrix(count):
    weights = window_weights(count, 1800.0, 50.0)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    variance, eigenvalues = estimate_distribution(count, 1800.0, 160.0, 50.0)
    whole_variance, whole = dense_distribution(weights, 50.0, 160.0)
    assert variance == pytest.approx(whole_variance, rel=1e-10)
    np.testing.assert_allclose(np.sort(eigenvalues), np.sort(whole), rtol=1e-6, atol=1e-12)
    assert eigenvalues.sum() == pytest.approx(1.0, rel=1e-9)  # a mean of squares of unit variance


@pytest.mark.parametrize("probability", [1e-2, 1e-5, 1e-9])
def test_tail_is_that_of_chi_square_where_it_is_one(probability):
    """Equal weights: the saddle point is good to a few percent of the probability, here as a probability."""
    for freedom in (3, 10, 40):
        value = quadratic_quantile(np.full(freedom, 0.5), probability)
        assert chi2.sf(2.0 * value, freedom) == pytest.approx(probability, rel=0.08)
        pooled = quadratic_quantile(
            np.full(1, 0.5) if freedom == 1 else np.full(freedom // 3 or 1, 0.5), probability, 3
        )
        assert chi2.sf(2.0 * pooled, 3 * (freedom // 3)) == pytest.approx(probability, rel=0.08)
    assert quadratic_quantile(np.array([1.0]), probability) == pytest.approx(chi2.isf(probability, 1))


def test_tail_of_correlated_samples_by_simulation():
    """A window of 1800 s in its steady state; half a million estimates count a tail of 1e-3 to 5 %."""
    rng = np.random.default_rng(2)
    _, eigenvalues = estimate_distribution(144, 1800.0, 160.0, 50.0)
    threshold = quadratic_quantile(eigenvalues, 1e-3)
    count = 0
    for _ in range(5):
        count += int(((rng.normal(size=(100_000, eigenvalues.size)) ** 2) @ eigenvalues > threshold).sum())
    assert count / 5e5 == pytest.approx(1e-3, rel=0.15)
    # A chi-square with the effective degrees of freedom would put the threshold too low.
    freedom = 1.0 / (eigenvalues**2).sum()
    assert threshold > 1.1 * chi2.isf(1e-3, freedom) / freedom


def test_false_alarms_by_simulation():
    """Correlated B values of the very sigma: every statistic within its share, and not idle."""
    rng = np.random.default_rng(3)
    params = replace(PARAMS, p_false_alarm=0.3)
    share = params.share(4)
    counts = np.zeros(3)
    number = np.zeros(3)
    for _ in range(6):
        _, results = run(b_like(rng, 300), params=params)
        for result in results[3:]:
            for place, each in enumerate((result.mean, result.variance, result.receivers)):
                inside = np.isfinite(each.statistic)
                counts[place] += each.failed.sum()
                number[place] += inside.sum()
    rate = counts / number
    # Samples of some hours are few independent ones: rates scatter by a tenth.
    assert rate[:2] == pytest.approx([share, share], rel=0.25)
    # A receiver's satellites have more samples than its threshold is for, by up to four windows.
    assert 0.02 * share < rate[2] < share


@pytest.mark.parametrize(("factor", "minutes"), [(5.0, 15.0), (3.0, 45.0), (2.0, 240.0)])
def test_a_sigma_that_does_not_bound_is_found(factor, minutes):
    """One channel worse from the start of a pass; times are the honest ones: five times sigma takes minutes, twice
    hours."""
    rng = np.random.default_rng(4)
    found = []
    for _ in range(10):
        values = b_like(rng, 300)
        values[:, :, 1, 4] *= factor
        _, results = run(values)
        failed = np.array([(each.variance.failed | each.mean.failed).any(axis=(0, 1)) for each in results])
        assert not np.delete(failed.reshape(300, -1), 1 * N_SATS + 4, axis=1).any()
        found.append(failed[:, 1, 4].argmax() if failed[:, 1, 4].any() else 300)
    assert np.median(found) * STEP_S / 60.0 <= minutes


def test_a_receiver_that_is_worse_on_all_satellites():
    """Half again the sigma: no channel says so for long, the ten satellites together do."""
    rng = np.random.default_rng(5)
    values = b_like(rng, 300)
    values[:, :, 2] *= 1.6
    _, results = run(values)
    failed = np.array([each.receivers.failed.any(axis=(0, 1)) for each in results])
    assert failed[:, 2].any()
    assert not failed[:, [0, 1, 3]].any()
    # The long window's ten satellites: 1.6^2 = 2.56 against 1.56
    assert failed[:, 2].argmax() * STEP_S <= 7200.0


def test_a_bias_is_found_by_the_mean():
    rng = np.random.default_rng(6)
    values = b_like(rng, 300)
    values[:, :, 0, 3] += 2.5
    _, results = run(values)
    failed = np.array([each.mean.failed.any(axis=(0, 1)) for each in results])
    assert failed[:, 0, 3].any()
    assert not np.delete(failed.reshape(300, -1), 3, axis=1).any()


def test_normalised_with_the_sigma_of_the_b_value_check():
    """The check's threshold is K sigma_B: over it the normalised values exceed K, and no others."""
    rng = np.random.default_rng(7)
    used = rng.random((4, N_SATS)) < 0.7
    sigma = rng.uniform(0.05, 0.3, (2, N_SATS))
    count = used.sum(axis=0)
    b = np.where(used & (count >= 2), rng.normal(0.0, 0.5, (2, 4, N_SATS)), np.nan)
    _, _, failed = b_failures(b, sigma, used, 5.5)
    normalised = normalised_b(b, sigma, used)
    assert (failed == (np.abs(normalised) > 5.5)).all()
    assert np.isnan(normalised[:, :, count < 2]).all()


def test_missing_is_not_good():
    """Due and never sampled fails; a channel that was sampled keeps its verdict until it is forgotten."""
    values = np.where(HERE, np.zeros((10, 2, 4, N_SATS)), np.nan)
    values[:, :, 1, 4] = np.nan
    _, results = run(values)
    failed = results[-1].variance.failed.any(axis=(0, 1))
    assert np.argwhere(failed).tolist() == [[1, 4]]
    assert (results[-1].mean.failed.any(axis=(0, 1)) == failed).all()
    _, results = run(np.full_like(values, np.nan))
    assert (results[-1].variance.failed.any(axis=(0, 1)) == HERE).all()
    values[1:, :, 2, 5] = np.nan
    state, results = run(values, dt_s=300.0)
    assert np.isnan(results[-1].variance.statistic[0, 0, 2, 5])  # 2700 s ago
    assert results[-1].variance.failed[0, 0, 2, 5]
    assert state.count[2, 5] == 0.0


def test_gaps_only_delay_the_next_sample():
    values = np.where(HERE, np.ones((3, 2, 4, N_SATS)), np.nan)
    state, _ = run(values, dt_s=1000.0)
    assert (state.count[:, HERE] == 3).all()
    state, _ = run(values, dt_s=0.5)
    assert (state.count[:, HERE] == 1).all()


@pytest.mark.parametrize("receivers", [1, 2])
def test_one_receiver_or_two(receivers):
    """One has no B value: with none due nothing fails, and nothing is claimed. Two have the same, of opposite sign."""
    used = due(receivers)
    b = np.zeros((2, receivers, N_SATS))
    b[:, 0, :], b[:, -1, :] = 3.0, -3.0
    normalised = normalised_b(b, np.full((2, N_SATS), 0.1), used)
    wanted = used & (used.sum(axis=0) >= 2)
    _, results = run(np.repeat(normalised[np.newaxis], 5, axis=0), wanted=wanted)
    failed = results[-1].variance.failed.any(axis=(0, 1))
    assert (failed == wanted).all()
    assert failed.any() == (receivers == 2)


def test_thresholds_for_one_sample_are_those_of_a_gaussian():
    _, results = run(np.where(HERE, np.zeros((1, 2, 4, N_SATS)), np.nan))
    share = PARAMS.share(4)
    assert results[0].mean.threshold[0, 0, 0, 0] == pytest.approx(norm.isf(0.5 * share))
    assert results[0].variance.threshold[0, 0, 0, 0] == pytest.approx(chi2.isf(share, 1))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"window_s": ()}, "window_s"),
        ({"correlation_s": (0.0,)}, "correlation_s"),
        ({"sample_s": 2000.0}, "sample_s"),
        ({"forget_s": -1.0}, "forget_s"),
        ({"p_false_alarm": 0.7}, "p_false_alarm"),
    ],
)
def test_bad_parameters(changes, word):
    with pytest.raises(ValueError, match=word):
        SigmaMonitorParams(**changes)
