"""The two cascaded filters of the divergence monitors: against closed forms, scipy, and plain loops."""

from __future__ import annotations

import numpy as np
import pytest

from divergence_loops import filter_with_gaps, filtered_rates
from gbas_core.ranging.divergence import (
    AIRBORNE,
    AIRBORNE_THRESHOLD_MPS,
    GROUND,
    GROUND_THRESHOLD_MPS,
    DivergenceParams,
    divergence_step,
    initial_divergence,
    ramp_response,
    rate_step,
    settled,
    white_noise_gain,
    white_rate_gain,
)

T_S = 0.5
NONE = np.zeros(1, dtype=bool)


def run(values_m, params, *, dt_s=T_S, restarts=()):
    """Filtered rates of one channel, and the settled flags."""
    state = initial_divergence(params, n_sats=1)
    filtered, counts = [], []
    for number, value in enumerate(values_m):
        step_s = float("nan") if number == 0 else dt_s
        restarted = np.array([number in restarts])
        state, _, f2 = divergence_step(state, np.array([value]), restarted, step_s, params)
        filtered.append(f2[0])
        counts.append(settled(state, params)[0])
    return np.array(filtered), np.array(counts)


@pytest.mark.parametrize("params", [GROUND, AIRBORNE], ids=["ground", "airborne"])
def test_ramp_meets_the_closed_form(params):
    # A settled filter at rest (200 epochs of zero), then a ramp of d from the sample n = 0 on.
    d, n = 0.02, np.arange(4000)
    values = np.concatenate([np.zeros(200), d * T_S * n])
    filtered, _ = run(values, params)
    expected = d * ramp_response(n, T_S / params.tau_s)
    assert filtered[200:] == pytest.approx(expected, abs=1e-12)
    assert expected[-1] == pytest.approx(d, rel=1e-6)  # eq (6): the steady state is d


def test_closed_form_of_the_continuous_filter():
    # With T -> 0 it becomes d (1 - (1 + t/tau) e^(-t/tau)): Laplace transform of ENC 2015, eq (5).
    t, tau, small = np.linspace(0.0, 200.0, 41), 30.0, 1e-3
    discrete = ramp_response(np.round(t / small), small / tau)
    assert discrete == pytest.approx(1.0 - (1.0 + t / tau) * np.exp(-t / tau), abs=2.0 * small / tau)


def test_random_input_agrees_with_scipy():
    rng = np.random.default_rng(1)
    values = np.cumsum(rng.normal(size=2000))
    filtered, _ = run(values, GROUND)
    oracle = filtered_rates(np.diff(values) / T_S, T_S / GROUND.tau_s)
    assert filtered[1:] == pytest.approx(oracle, abs=1e-12)


@pytest.mark.parametrize("alpha", [T_S / 30.0, T_S / 100.0, 1.0 / 30.0, 0.5, 1.0])
def test_noise_gains_are_the_power_of_the_impulse_response(alpha):
    pulse = np.zeros(20_000)
    pulse[0] = 1.0
    of_rate = filtered_rates(pulse, alpha)
    of_value = filtered_rates(np.diff(pulse, prepend=0.0), alpha)
    assert white_rate_gain(alpha) == pytest.approx(np.sqrt((of_rate**2).sum()), rel=1e-12)
    assert white_noise_gain(alpha) == pytest.approx(np.sqrt((of_value**2).sum()), rel=1e-12)


def test_noise_gains_for_small_alpha():
    # ENC 2015, eq (7): alpha / 4 of the variance of a white rate; alpha^3 / 4 for white noise of the value.
    assert white_rate_gain(1e-4) ** 2 == pytest.approx(1e-4 / 4.0, rel=1e-3)
    assert white_noise_gain(1e-4) ** 2 == pytest.approx(1e-12 / 4.0, rel=1e-3)


def test_settle_times_of_the_docstring():
    alpha = T_S / 30.0
    settled_noise = white_noise_gain(alpha) / T_S  # for noise of 1 m
    first_value = np.zeros(1200)
    first_value[0] = 1.0  # the filter starts with this value in error
    filtered, _ = run(first_value, GROUND)
    left = -filtered
    time = T_S * np.arange(1200)
    assert np.nanmax(left) == pytest.approx(0.0123, abs=1e-4)
    assert time[np.nanargmax(left)] == pytest.approx(30.0, abs=1.0)
    assert time[left > settled_noise].max() == pytest.approx(4.2 * 30.0, abs=3.0)
    assert time[left > 0.1 * settled_noise].max() == pytest.approx(207.0, abs=1.0)
    assert ramp_response(np.array([414]), alpha)[0] == pytest.approx(0.992, abs=5e-4)
    at_360_s = 720
    assert left[at_360_s] ** 2 < 1e-4 * settled_noise**2
    assert 1.0 - ramp_response(np.array([at_360_s]), alpha)[0] < 1e-4


def test_statistic_counts_after_the_settle_time():
    _, counts = run(np.zeros(800), GROUND)
    assert counts.argmax() == 720  # 360 s of 0.5 s
    assert counts[720:].all()
    _, counts = run(np.zeros(800), DivergenceParams(settle_s=0.0))
    assert counts.all()


def test_gaps_are_bridged_with_their_own_time():
    rng = np.random.default_rng(2)
    values = np.cumsum(rng.normal(size=400))
    values[rng.random(400) < 0.3] = np.nan
    values[:2] = 0.0, 1.0
    longest = 100.0
    filtered, _ = run(values, DivergenceParams(max_gap_s=longest))
    oracle, _ = filter_with_gaps(T_S * np.arange(400), values, 30.0)
    assert filtered == pytest.approx(np.array(oracle), abs=1e-12, nan_ok=True)
    assert np.isnan(filtered[np.isnan(values)]).all()


@pytest.mark.parametrize(("missing", "goes_on"), [(6, True), (7, False)])
def test_a_gap_that_is_too_long_restarts(missing, goes_on):
    values = 0.02 * T_S * np.arange(1000)
    values[800 : 800 + missing] = np.nan  # 3.5 s from measurement to measurement when six are missing
    filtered, counts = run(values, GROUND)
    back = 800 + missing
    assert np.isfinite(filtered[back]) == goes_on
    assert counts[back] == goes_on
    assert filtered[back + 1] == pytest.approx(0.02, rel=1e-3) if goes_on else filtered[back + 1] < 0.001


@pytest.mark.parametrize("away", [False, True])
def test_a_slip_restarts_also_while_the_channel_is_away(away):
    values = 0.02 * T_S * np.arange(1000)
    if away:
        values[800] = np.nan
    filtered, counts = run(values, GROUND, restarts={800})
    first = 801 if away else 800
    assert np.isnan(filtered[first])
    assert not counts[first : first + 719].any()
    assert counts[first + 720 :].all() or first + 720 >= 1000


@pytest.mark.parametrize("dt_s", [float("nan"), 0.0, -0.5, float("inf"), 10.0])
def test_an_interval_that_is_none_restarts_all(dt_s):
    params = DivergenceParams(settle_s=0.0)
    state = initial_divergence(params, n_sats=2)
    values = np.array([1.0, np.nan])
    none = np.zeros(2, dtype=bool)
    for step_s in (float("nan"), 0.5, 0.5):
        state, _, _ = divergence_step(state, values, none, step_s, params)
    state, rate, filtered = divergence_step(state, values + 5.0, none, dt_s, params)
    assert np.isnan(rate).all()
    assert np.isnan(filtered).all()
    assert state.age_s[0] == 0.0
    _, rate, _ = divergence_step(state, values + 6.0, none, 0.5, params)
    assert rate[0] == pytest.approx(2.0)


def test_a_filter_of_rates_is_the_same_filter():
    rng = np.random.default_rng(3)
    values = np.cumsum(rng.normal(size=(300, 4)), axis=0)
    values[rng.random((300, 4)) < 0.2] = np.nan
    params = DivergenceParams(settle_s=20.0)
    by_value, by_rate = initial_divergence(params, n_sats=4), initial_divergence(params, n_sats=4)
    restarted = rng.random((300, 4)) < 0.01
    for number in range(300):
        dt_s = T_S if number else float("nan")
        over_s = by_value.since_s + T_S
        by_value, rate, expected = divergence_step(by_value, values[number], restarted[number], dt_s, params)
        by_rate, filtered = rate_step(by_rate, rate, over_s, restarted[number], dt_s, params)
        usable = np.isfinite(filtered)
        assert filtered == pytest.approx(expected, abs=1e-12, nan_ok=True)
        assert (settled(by_rate, params) == (settled(by_value, params) & usable)).all()


def test_leading_axes_do_not_mix():
    rng = np.random.default_rng(4)
    values = np.cumsum(rng.normal(size=(50, 2, 3, 68)), axis=0)
    params = GROUND
    together = initial_divergence(params, 2, 3)
    alone = initial_divergence(params)
    none = np.zeros((2, 3, 68), dtype=bool)
    for number, each in enumerate(values):
        dt_s = T_S if number else float("nan")
        together, _, both = divergence_step(together, each, none, dt_s, params)
        alone, _, one = divergence_step(alone, each[1, 2], none[1, 2], dt_s, params)
    assert both.shape == (2, 3, 68)
    assert (both[1, 2] == one).all()


def test_data_of_the_time_constant_or_slower_are_not_filtered():
    # At 30 s and tau = 30 s the weight is 1: the statistic is the rate itself, and nothing is smoothed.
    values = np.array([0.0, 1.0, 4.0, 2.0])
    filtered, _ = run(values, DivergenceParams(max_gap_s=35.0), dt_s=30.0)
    assert filtered[1:] == pytest.approx(np.diff(values) / 30.0)


@pytest.mark.parametrize(
    "wrong", [{"tau_s": 0.0}, {"tau_s": float("nan")}, {"max_gap_s": -1.0}, {"settle_s": -1.0}, {"settle_s": np.inf}]
)
def test_parameters_are_checked(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        DivergenceParams(**wrong)


@pytest.mark.parametrize("alpha", [0.0, -0.1, 1.1, float("nan")])
def test_alpha_is_checked(alpha):
    for function in (lambda a: ramp_response(np.array([1]), a), white_noise_gain, white_rate_gain):
        with pytest.raises(ValueError, match="alpha"):
            function(alpha)


def test_published_constants():
    # ENC 2015, 2.1.
    assert (GROUND.tau_s, GROUND_THRESHOLD_MPS, GROUND.settle_s) == (30.0, 0.0233, 360.0)
    assert (AIRBORNE.tau_s, AIRBORNE_THRESHOLD_MPS) == (100.0, 0.0125)
