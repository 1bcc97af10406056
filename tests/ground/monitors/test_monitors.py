"""Single monitors: where they fail, where they must not, and how often they fail on noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from gbas_core.models.error_models import sigma_pr_gnd
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_ground.corrections.kernels.consistency import summarise_corrections
from gbas_ground.corrections.kernels.formation import b_values_m, clock_removed_sigma_m, clock_weights, remove_clocks
from gbas_ground.corrections.kernels.limits import MAX_B_VALUE_M, b_limit_m, unused_limit_m
from gbas_ground.corrections.sigma import settings_of
from gbas_ground.monitors.ephemeris_change import check_ephemeris_change
from gbas_ground.monitors.expected_range import check_expected_range
from gbas_ground.monitors.signal_power import check_signal_power
from ground_runs import params
from synthetic_ranges import TOW_S, WEEK, constellation

CONSTELLATION = CLOCK_GROUPS.argmax(axis=0)
HERE = np.arange(N_SATS) < 12


def tracked(receivers=3):
    return np.broadcast_to(HERE, (receivers, N_SATS)).copy()


def test_expected_range_finds_the_gross_error_and_no_other():
    residual = np.where(tracked(), np.linspace(-20.0, 30.0, N_SATS), np.nan) + np.array([[1e5], [0.0], [-3e5]])
    residual[1, 4] += 400.0
    result = check_expected_range(residual, tracked(), 150.0)
    assert np.argwhere(result.failed).tolist() == [[1, 4]]
    # The median of the others lies within their spread of 10 m.
    assert result.at(1, 4)[0] == pytest.approx(400.0, abs=10.0)
    assert result.at(1, 4)[1] == 150.0


def test_expected_range_keeps_constellations_apart():
    """The receiver's delay between GPS and Galileo is part of neither residual."""
    both = np.zeros((1, N_SATS), dtype=bool)
    both[0, [0, 1, 2, 3, 40, 41, 42]] = True
    residual = np.where(both, np.where(np.arange(N_SATS) < 32, 0.0, 500.0), np.nan)
    assert not check_expected_range(residual, both, 150.0).failed.any()


def test_expected_range_needs_a_number():
    """Tracked but not computable is not good."""
    residual = np.where(tracked(), 0.0, np.nan)
    residual[0, 3] = np.nan
    assert np.argwhere(check_expected_range(residual, tracked(), 150.0).failed).tolist() == [[0, 3]]


@pytest.mark.parametrize(("required", "expected"), [(True, [[0, 2], [0, 3]]), (False, [[0, 2]])])
def test_signal_power(required, expected):
    cn0 = np.where(tracked(1), 45.0, np.nan)
    cn0[0, 2], cn0[0, 3] = 29.0, np.nan
    result = check_signal_power(cn0, tracked(1), 30.0, required=required)
    assert np.argwhere(result.failed).tolist() == expected


def test_ephemeris_change():
    """A satellite 2.4 km along its orbit from where the last ephemeris had it; 250 m is the bound."""
    old, new = constellation(iod=1), constellation(iod=2)
    shift_m = 2400.0
    new.m0_rad[5] += shift_m / new.sqrt_a[5] ** 2
    new.m0_rad[6] += 100.0 / new.sqrt_a[6] ** 2
    new.message[7] = np.nan
    result = check_ephemeris_change(new, old, WEEK, TOW_S, 250.0)
    assert np.flatnonzero(result.failed).tolist() == [5]
    # e = 0.0035: along-track distance differs from a dM by at most 2 e
    assert result.at(5)[0] == pytest.approx(shift_m, rel=0.01)
    nothing = constellation(systems="")
    assert not check_ephemeris_change(new, nothing, WEEK, TOW_S, 250.0).failed.any()


def test_new_ephemeris_without_a_position_fails():
    new = constellation(iod=2)
    new.sqrt_a[3] = np.nan
    assert np.flatnonzero(check_ephemeris_change(new, constellation(), WEEK, TOW_S, 250.0).failed).tolist() == [3]


@pytest.mark.parametrize("receivers", [2, 3, 4])
@pytest.mark.parametrize("k_b", [2.5, 3.5])
def test_false_alarms_of_b_values_follow_the_normal_tail(receivers, k_b):
    """Independent Gaussian receivers: P(|B| > K sigma_B) is the two-sided tail of K, clocks removed or not."""
    rng = np.random.default_rng(receivers)
    n = 20_000
    elevation = np.where(HERE, np.radians(np.linspace(8.0, 80.0, N_SATS) + 5.0), np.nan)
    used = tracked(receivers)
    count = used.sum(axis=0).astype(float)
    sigma = sigma_pr_gnd("C", elevation, count)
    weights = clock_weights(np.stack([HERE, np.zeros(N_SATS, dtype=bool)]), elevation, True)
    noise = rng.normal(size=(n, receivers, N_SATS)) * np.where(HERE, sigma * np.sqrt(receivers), np.nan)
    noise = noise + rng.normal(0.0, 1e4, (n, receivers, 1))
    adjusted = remove_clocks(noise.reshape(-1, N_SATS), weights, CONSTELLATION).reshape(noise.shape)
    b = np.array([b_values_m(each, used) for each in adjusted])
    channel_sigma_m = clock_removed_sigma_m(sigma * np.sqrt(count), weights, CONSTELLATION)
    limit_m = np.array([b_limit_m(*each, k_b) for each in zip(channel_sigma_m, count, strict=True)])
    failed = ~(np.abs(b) <= limit_m)
    rate = failed[..., HERE].mean()
    expected = 2.0 * stats.norm.sf(k_b)
    # The 12 satellites share clocks and the M B values of one satellite have M - 1 degrees of freedom: count one
    # independent sample an epoch, which is fewer than there are. Four standard errors.
    tolerance = 4.0 * np.sqrt(expected / n)
    assert rate == pytest.approx(expected, abs=tolerance)


def failures(b, sigma, used):
    """B values that fail, as the kernel has it of each satellite."""
    settings, count = settings_of(params(2)), used.sum(axis=0).astype(float)
    limit_m = np.array([b_limit_m(*each, settings.k_b) for each in zip(sigma, count, strict=True)])
    checks = summarise_corrections(
        used, count, np.zeros((1, N_SATS)), np.zeros((1, N_SATS)), b[np.newaxis], sigma[np.newaxis], settings
    )
    failed = used & (count >= 2) & ~(np.abs(b) <= limit_m)
    assert np.array_equal(checks[2][0], failed.any(axis=0))
    assert checks[4] == failed.any(axis=0).sum()
    return [tuple(each) for each in np.argwhere(failed).tolist()]


def test_b_value_needs_two_receivers_and_fits_the_message():
    used = tracked(2)
    used[1, 3] = False
    b = np.where(used, 0.0, np.nan)
    b[:, 3] = np.nan
    b[0, 5] = MAX_B_VALUE_M + 0.01
    sigma = np.where(HERE, 100.0, np.nan)
    assert failures(b, sigma, used) == [(0, 5)]
    sigma[7] = np.nan
    assert failures(b, sigma, used) == [(0, 5), (0, 7), (1, 7)]


@pytest.mark.parametrize("count", [1, 3])
def test_channels_that_are_not_used_are_judged_at_the_same_rate(count):
    rng = np.random.default_rng(count)
    n, k = 20_000, 3.0
    sigma = np.where(HERE, 0.3, np.nan)
    prc = rng.normal(size=(n, N_SATS)) * sigma / np.sqrt(count)
    channel = rng.normal(size=(n, 1, N_SATS)) * sigma
    failed = ~(np.abs(channel - prc[:, np.newaxis]) <= unused_limit_m(0.3, float(count), k))
    n_samples = n * HERE.sum()
    expected = 2.0 * stats.norm.sf(k)
    assert failed[..., HERE].mean() == pytest.approx(expected, abs=4.0 * np.sqrt(expected / n_samples))
