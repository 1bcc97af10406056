"""Classification of two-frequency divergences: every mode is found, and what cannot be told apart is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import subspace_angles
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.signals import L1, L2, L5
from gbas_ground.monitors.divergence_classification import FREE_RATES, MODES, NO_FAULT, classify
from gbas_ground.monitors.divergence_covariance import INDEPENDENT, PRINTED_COVARIANCE

Q = PRINTED_COVARIANCE[np.ix_(INDEPENDENT, INDEPENDENT)]
COLUMNS = combination_matrix(L1, L5)[list(INDEPENDENT)]


def classified(x, *, prior=None):
    return classify(np.array(x)[:, np.newaxis], Q[np.newaxis], L1, L5, prior=prior)


@pytest.mark.parametrize("mode", [name for name in FAULT_MODES if sum(FAULT_MODES[name]) == 1])
def test_a_single_measurement_is_recognised(mode):
    x = COLUMNS @ (0.05 * np.array(FAULT_MODES[mode]))
    result = classified(x)
    assert result.best(0) == (mode,)
    assert result.log_likelihood[MODES.index(mode), 0] == pytest.approx(0.0, abs=1e-9)
    assert result.log_likelihood[MODES.index(NO_FAULT), 0] < -100.0


@pytest.mark.parametrize("mode", [name for name in FAULT_MODES if sum(FAULT_MODES[name]) == 2])
def test_two_measurements_at_rates_of_their_own_are_recognised(mode):
    x = COLUMNS @ (np.array([0.05, 0.11, -0.08, 0.06]) * FAULT_MODES[mode])
    assert classified(x).best(0) == (mode,)


def test_modes_of_three_measurements_or_more_are_one():
    x = COLUMNS @ np.array([0.05, 0.11, -0.08, 0.0])
    result = classified(x)
    full = tuple(name for name in FAULT_MODES if sum(FAULT_MODES[name]) >= 3)
    assert len(full) == 5
    assert result.best(0) == full
    places = [MODES.index(name) for name in full]
    assert result.posterior[places, 0] == pytest.approx(np.full(5, result.posterior[places[0], 0]))


@pytest.mark.parametrize("bands", [(L1, L5), (L1, L2)])
def test_spans_are_what_the_module_says(bands):
    columns = combination_matrix(*bands)[list(INDEPENDENT)]
    for place, members in enumerate(FAULT_MODES.values()):
        assert np.linalg.matrix_rank(columns[:, np.flatnonzero(members)]) == FREE_RATES[place]
    # No two spans of one or two dimensions are the same: only the five of three are.
    small = [np.flatnonzero(members) for members in FAULT_MODES.values() if sum(members) < 3]
    for number, first in enumerate(small):
        for second in small[number + 1 :]:
            if len(first) == len(second):
                assert subspace_angles(columns[:, first], columns[:, second]).max() > 1e-3


def test_quiet_statistics_are_no_fault():
    rng = np.random.default_rng(1)
    x = np.linalg.cholesky(Q) @ rng.normal(size=(3, 400))
    result = classify(x, np.broadcast_to(Q, (400, 3, 3)), L1, L5)
    best = result.posterior.argmax(axis=0)
    # Wrong only when some line explains more than 2 of the squared distance: a minority.
    assert (best == MODES.index(NO_FAULT)).mean() > 0.5
    assert result.posterior.sum(axis=0) == pytest.approx(np.ones(400))


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_likelihood_is_the_maximum_over_the_rates(mode):
    rng = np.random.default_rng(2)
    x = np.linalg.cholesky(Q) @ rng.normal(size=3) * 5.0
    members = np.flatnonzero(FAULT_MODES[mode])
    density = multivariate_normal(np.zeros(3), Q)
    scale = 1e-3
    best = minimize(
        lambda rates: -density.logpdf(x - COLUMNS[:, members] @ (rates * scale)), np.zeros(len(members)), tol=1e-12
    )
    expected = -best.fun - density.logpdf(np.zeros(3))
    assert classified(x).log_likelihood[MODES.index(mode), 0] == pytest.approx(expected, abs=1e-5)


def test_prior_and_unknown_statistics():
    x = COLUMNS @ np.array([0.05, 0.0, 0.0, 0.0])
    prior = np.ones(len(MODES))
    prior[MODES.index("Code L1")] = 0.0
    assert "Code L1" not in classified(x, prior=prior).best(0)
    unknown = classified([np.nan, 0.0, 0.0])
    assert np.isnan(unknown.posterior).all()
    assert unknown.best(0) == ()
    with pytest.raises(ValueError, match="prior"):
        classified(x, prior=np.zeros(len(MODES)))
