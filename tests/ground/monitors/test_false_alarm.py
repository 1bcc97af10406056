"""False exclusions of correlated statistics: bivariate distributions, the filters themselves, and the budget."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, norm

from divergence_loops import filtered_rates
from gbas_core.parameters import ParameterError
from gbas_core.ranging.divergence import white_noise_correlation, white_noise_gain
from gbas_ground.monitors.false_alarm import EPOCH_S, EXPOSURE_S, exposure_probability, independent_samples
from gbas_ground.param_checks import FALSE_EXCLUSION_OF_ALL, false_exclusions
from ground_runs import params

ALPHA = 0.5 / 30.0


@pytest.mark.parametrize("alpha", [ALPHA, 1.0 / 30.0, 0.2, 1.0])
def test_correlation_is_that_of_the_impulse_response(alpha):
    rates = np.zeros(6000)
    rates[:2] = 1.0, -1.0  # what one error of a range does to the rates
    response = filtered_rates(rates, alpha)
    power = (response**2).sum()
    assert white_noise_correlation(alpha) == pytest.approx((response[1:] * response[:-1]).sum() / power, rel=1e-9)
    assert white_noise_gain(alpha) == pytest.approx(np.sqrt(power), rel=1e-9)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9668])
@pytest.mark.parametrize("limit", [1.0, 2.5, 4.0])
def test_two_epochs_are_exact(limit, correlation):
    """P(any of two) of a bivariate Gaussian, by scipy's own integration of the density."""
    pair = multivariate_normal(cov=[[1.0, correlation], [correlation, 1.0]])
    corners = ((limit, limit, 1.0), (-limit, limit, -2.0), (-limit, -limit, 1.0))
    inside = sum(sign * pair.cdf([x, y]) for x, y, sign in corners)
    found = exposure_probability(limit, correlation, exposure_s=2.0 * EPOCH_S)
    assert found == pytest.approx(1.0 - inside, abs=2e-6)  # accuracy of scipy's integration


def test_without_memory_every_epoch_counts():
    once = 2.0 * norm.sf(5.84)
    assert exposure_probability(5.84, 0.0) == pytest.approx(30.0 * once, rel=1e-5)
    assert independent_samples(5.84, 0.0) == pytest.approx(30.0, rel=1e-5)
    assert independent_samples(5.84, 0.9999) < 3.0  # one excursion, seen for the whole exposure


@pytest.mark.parametrize("freedom", [1, 3])
def test_it_bounds_what_the_filters_do(freedom):
    """White noise through the filters of 30 s at 2 Hz: how many exposures of 15 s have an alarm."""
    rng = np.random.default_rng(11)
    limit = float(np.sqrt(chi2.isf(2e-3, freedom)))
    noise = rng.standard_normal((freedom, 600_000))
    f2 = filtered_rates(np.diff(noise, axis=1), ALPHA)[:, 1000:] / white_noise_gain(ALPHA)
    size = np.sqrt((f2**2).sum(axis=0))
    windows = size[: len(size) // 30 * 30].reshape(-1, 30)
    seen = (windows > limit).any(axis=1).mean()
    bound = exposure_probability(limit, white_noise_correlation(ALPHA), freedom=freedom)
    # Some 20 000 windows, correlated over two minutes: 15 % of spread. The bound counts some excursions twice.
    assert 0.85 * seen < bound < 2.0 * seen
    assert bound < 0.75 * 30.0 * 2e-3


def test_published_thresholds_keep_the_budget():
    shares = false_exclusions(params())
    # 0.0233 m/s is 5.84 sigma, 5.2e-9 an epoch on both sides; 15 s are some 17 independent samples of it.
    assert shares["ccd"] == pytest.approx(17.4 * 2.0 * norm.sf(0.0233 / 0.00399), rel=0.01)
    assert shares["ccd_f"] == pytest.approx(18.6e-9, rel=0.01)
    assert sum(shares.values()) <= FALSE_EXCLUSION_OF_ALL == 2e-7
    assert set(shares) >= {
        "ionosphere_gradient",
        "carrier_acceleration",
        "ephemeris_residual",
        "signal_power",
        "sigma_monitor",
    }
    assert EXPOSURE_S / EPOCH_S == 30.0


def test_thresholds_beyond_the_budget_are_refused():
    with pytest.raises(ParameterError, match=r"ccd 5\.\de-07.*budget of 2e-07: ccd.threshold_mps over ccd.sigma_mps"):
        params(ccd__threshold_mps=0.022)
    with pytest.raises(ParameterError, match="budget of 2e-07"):
        params(ccd_f__p_false_alarm=1e-8)
    # whoever sets a smaller sigma, or lets the monitor only watch, says so
    params(ccd__threshold_mps=0.022, ccd__sigma_mps=0.0037)
    params(ccd__threshold_mps=0.010, ccd__exclude=False)
    params(ccd_f__p_false_alarm=1e-8, ccd_f__exclude="none")
    assert params(ccd__sigma_mps=0.002).ccd_monitor().sigma_mps == 0.002


def test_bad_arguments():
    for wrong in ({"limit": 0.0}, {"correlation": 1.0}, {"freedom": 0}, {"interval_s": 0.0}):
        with pytest.raises(ValueError, match="above 0"):
            exposure_probability(**({"limit": 5.0, "correlation": 0.9} | wrong))
    with pytest.raises(ValueError, match="alpha is 0"):
        white_noise_correlation(0.0)
