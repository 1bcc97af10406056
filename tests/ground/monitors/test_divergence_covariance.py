"""Covariance of the two-frequency statistics: eq (16) to its printed digits, Monte Carlo, calibration that bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from divergence_loops import filtered_rates, four_statistics
from gbas_core.signals import L1, L5
from gbas_ground.monitors.divergence_covariance import (
    INDEPENDENT,
    PRINTED_COVARIANCE,
    StatisticCovariance,
    calibrate,
    measurement_covariance,
    published_by_origin,
)

T_S, TAU_S = 0.5, 30.0
ALPHA = T_S / TAU_S

# Coefficients of ENC 2015, eq (16), on the variances of (rho1, rho5, phi1, phi5), with n = 4 for the clock; the two
# entries that are misprinted stand as derived.
PRINTED = {
    (0, 0): (2.0, 0.0, 24.9, 12.8),
    (1, 1): (0.0, 2.0, 41.0, 24.9),
    (2, 2): (10.2, 3.2, 10.2, 3.2),
    (3, 3): (0.0, 0.0, 10.2 * 1.25, 3.2 * 1.25),  # printed with code variances in place of the carriers' own
    (0, 1): (0.0, 0.0, 32.0, 17.9),
    (0, 2): (4.52, 0.0, 15.9, 6.4),
    (0, 3): (0.0, 0.0, -15.9, -6.4),
    (1, 2): (0.0, -2.5, 20.5, 8.9),
    (1, 3): (0.0, 0.0, -20.5, -8.9),
    (2, 3): (0.0, 0.0, -10.22, -3.18),  # printed -2.26 and -3.2, with a code variance
}


@pytest.mark.parametrize("entry", PRINTED)
def test_derived_covariance_is_eq_16(entry):
    for place, coefficient in enumerate(PRINTED[entry]):
        sigma = np.zeros(4)
        sigma[place] = 1.0
        covariance = measurement_covariance(
            sigma, L1, L5, alpha=ALPHA, interval_s=T_S, clock_satellites=4.0, white="rate"
        )
        ours = covariance[entry] / (ALPHA / (4.0 * T_S**2))
        # The paper rounds the coefficients of A to two digits before squaring (3.53^2 x 2 = 24.9, exactly 24.798).
        assert ours == pytest.approx(coefficient, rel=0.012, abs=0.06)


def test_derived_covariance_has_rank_three():
    sigma = np.array([0.3, 0.2, 0.002, 0.003])
    covariance = measurement_covariance(
        sigma, L1, L5, alpha=ALPHA, interval_s=T_S, clock_satellites=np.inf, white="measurement"
    )
    values = np.linalg.eigvalsh(covariance)
    assert values[0] < 1e-12 * values[-1]
    assert (values[1:] > 0.0).all()


def test_printed_covariance_is_none():
    # Its negative eigenvalue, and that the three independent statistics are fine.
    assert np.linalg.eigvalsh(PRINTED_COVARIANCE)[0] == pytest.approx(-6.2e-11, rel=0.01)
    assert np.linalg.eigvalsh(PRINTED_COVARIANCE[np.ix_(INDEPENDENT, INDEPENDENT)])[0] > 7e-7


def test_white_measurements_by_monte_carlo():
    rng = np.random.default_rng(1)
    sigma = np.array([0.3, 0.15, 0.004, 0.006])
    noise = rng.normal(size=(4, 40_000)) * sigma[:, np.newaxis]
    alpha = 0.2  # quick filters: many independent samples
    filtered = np.array([filtered_rates(np.diff(each) / T_S, alpha) for each in four_statistics(*noise)])[:, 500:]
    covariance = measurement_covariance(
        sigma, L1, L5, alpha=alpha, interval_s=T_S, clock_satellites=np.inf, white="measurement"
    )
    spread = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    # 40 000 epochs are at least 2000 independent samples: 3 sigma of a covariance is 3 sqrt(2/2000) = 0.095.
    assert np.cov(filtered) / spread == pytest.approx(covariance / spread, abs=0.095)


def correlated(rng, covariance, *shape):
    return rng.normal(size=(*shape, 3)) @ np.linalg.cholesky(covariance).T


RECEIVER = np.array([[1.4, 0.2, 0.1], [0.2, 1.3, 0.0], [0.1, 0.0, 0.7]]) * 1e-6
COMMON = np.array([[0.3, 0.1, 0.0], [0.1, 0.4, 0.0], [0.0, 0.0, 0.2]]) * 1e-6


def gaussian(rng, epochs=3000, receivers=3, satellites=4, scale=1.0):
    own = correlated(rng, RECEIVER, epochs, receivers, satellites)
    shared = correlated(rng, COMMON, epochs, 1, satellites)
    return np.moveaxis(scale * (own + shared), -1, 2)


def test_calibration_finds_what_was_put_in():
    rng = np.random.default_rng(2)
    found = calibrate(gaussian(rng), np.full((3000, 4), 0.5), interval_s=120.0, tau_s=30.0)
    assert found.common_known
    assert found.samples == 36_000
    assert found.effective_samples == 36_000  # one each 4 tau
    receiver, common = np.array(found.covariance.receiver), np.array(found.covariance.common)
    # 12 000 independent triples: 3 sigma of a covariance is below 4 % of the variances.
    assert receiver / found.inflation == pytest.approx(RECEIVER, abs=0.04 * RECEIVER.max())
    assert common / found.inflation == pytest.approx(COMMON, abs=0.04 * RECEIVER.max())
    assert 1.0 <= found.tail_inflation < 1.3


@pytest.mark.parametrize("tails", ["gaussian", "heavy", "mixture"])
def test_calibration_bounds_every_tail_of_the_data(tails):
    rng = np.random.default_rng(3)
    scale = {
        "gaussian": 1.0,
        "heavy": np.sqrt(3.0 / rng.chisquare(3.0, (2000, 1, 1, 4))),  # Student's t with 3 degrees of freedom
        "mixture": np.where(rng.random((2000, 1, 1, 4)) < 0.02, 4.0, 1.0),
    }[tails]
    x = gaussian(rng, 2000) * scale
    found = calibrate(x, np.full((2000, 4), 0.5), interval_s=1.0, tau_s=30.0)
    one = np.array(found.covariance.receiver) + np.array(found.covariance.common)
    flat = np.moveaxis(x, 2, -1).reshape(-1, 3)
    form = np.sort(np.einsum("mi,ij,mj->m", flat, np.linalg.inv(one), flat))
    for level in (0.5, 0.9, 0.99, 0.999):
        assert (form > chi2.ppf(level, 3)).mean() <= 1.0 - level
    assert form[-1] <= chi2.isf(1.0 / (len(form) + 1), 3)
    assert found.inflation == pytest.approx(found.tail_inflation * found.sample_inflation)
    if tails != "gaussian":
        assert found.tail_inflation > 1.5


def test_one_receiver_cannot_tell_what_is_common():
    rng = np.random.default_rng(4)
    found = calibrate(gaussian(rng, receivers=1), np.full((3000, 4), 0.5), interval_s=1.0, tau_s=30.0)
    assert not found.common_known
    assert np.array(found.covariance.receiver) == pytest.approx(np.zeros((3, 3)), abs=1e-20)
    four, one = found.covariance.at(np.full(2, 0.5), np.array([4, 1]), np.full(2, np.inf))
    assert four == pytest.approx(one)


def test_elevation_dependence_is_found_and_used():
    rng = np.random.default_rng(5)
    elevation = rng.uniform(0.1, 1.5, (3000, 4))
    scale = np.where(elevation < 0.5, 3.0, 1.0)
    x = np.moveaxis(np.moveaxis(gaussian(rng), 2, -1) * scale[:, np.newaxis, :, np.newaxis], -1, 2)
    edges = np.array([0.1, 0.5, 1.0, 1.5])
    found = calibrate(x, elevation, interval_s=120.0, tau_s=30.0, edges_rad=edges)
    low, high = found.covariance.at(np.array([0.2, 1.4]), np.ones(2), np.full(2, np.inf))
    assert np.sqrt(np.diag(low) / np.diag(high)) == pytest.approx([3.0] * 3, rel=0.05)
    held = found.covariance.at(np.array([0.0, np.nan]), np.ones(2), np.full(2, np.inf))
    assert held[0] == pytest.approx(low)
    assert np.isnan(held[1]).all()


def test_small_samples_cost_inflation():
    rng = np.random.default_rng(6)
    x = gaussian(rng, 200)
    elevation = np.full((200, 4), 0.5)
    short = calibrate(x, elevation, interval_s=1.0, tau_s=30.0)
    long = calibrate(x, elevation, interval_s=60.0, tau_s=30.0)
    # 20 effective samples: nu / chi2_nu(5 %) = 20 / 10.85.
    assert short.sample_inflation == pytest.approx(20.0 / chi2.ppf(0.05, 20), rel=1e-9)
    assert 1.0 < long.sample_inflation < 1.1


def test_clock_noise_is_taken_out_and_put_back():
    rng = np.random.default_rng(7)
    x = gaussian(rng)
    x[:, :, 2] *= np.sqrt(1.25)
    found = calibrate(x, np.full((3000, 4), 0.5), clock_satellites=4.0, interval_s=120.0, tau_s=30.0)
    plain = calibrate(gaussian(np.random.default_rng(7)), np.full((3000, 4), 0.5), interval_s=120.0, tau_s=30.0)
    assert np.array(found.covariance.common) == pytest.approx(np.array(plain.covariance.common))


@pytest.mark.parametrize("epochs", [0, 5])
def test_too_little_is_refused(epochs):
    with pytest.raises(ValueError, match="too few"):
        calibrate(np.zeros((epochs, 1, 3, 2)), np.zeros((epochs, 2)), interval_s=1.0, tau_s=30.0)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"common": ((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))}, "negative eigenvalue"),
        ({"common": ((1.0, 0.5, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))}, "symmetric"),
        ({"common": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))}, "singular"),
        ({"elevation_rad": (0.5, 0.4), "factor": ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))}, "rise"),
        ({"elevation_rad": (0.5,), "factor": ((1.0, 0.0, 1.0),)}, "above 0"),
        ({"elevation_rad": (0.5,)}, "one triple"),
    ],
)
def test_a_covariance_that_is_none_is_refused(wrong, match):
    with pytest.raises(ValueError, match=match):
        StatisticCovariance(**wrong)


def test_white_is_checked():
    with pytest.raises(ValueError, match="white"):
        measurement_covariance(np.ones(4), L1, L5, alpha=0.1, interval_s=0.5, clock_satellites=1.0, white="pink")


def test_the_default_divides_nothing_and_the_one_by_origin_the_codes_alone():
    printed = PRINTED_COVARIANCE[np.ix_([0, 1, 3], [0, 1, 3])]
    for covariance, share in ((StatisticCovariance(), 1.0), (published_by_origin(), 0.25)):
        one, four = (covariance.at(np.ones(1), np.full(1, count), np.full(1, np.inf))[0] for count in (1.0, 4.0))
        assert one == pytest.approx(printed, rel=1e-12)
        assert four[2] == pytest.approx(printed[2], rel=1e-12)  # all that has the carrier in it
        assert np.diag(four)[:2] == pytest.approx(share * np.diag(printed)[:2], rel=1e-4)


@pytest.mark.parametrize("receivers", [1, 2, 4])
def test_what_averaging_divides_through_the_filters(receivers):
    """Codes' noise of each receiver, carriers' noise of the satellites: plain loops and scipy's filter against Q(M, n).

    The receiver clock is averaged over n other satellites, whose carriers have noise of their own.
    """
    rng, clock, epochs, alpha = np.random.default_rng(5), 4, 60_000, 0.2
    code = rng.standard_normal((receivers, 2, epochs)) * np.array([0.3, 0.2])[:, np.newaxis]
    carrier = rng.standard_normal((1 + clock, 2, epochs)) * 0.02  # the same at all receivers
    df, other_df, _, phase = four_statistics(code[:, 0], code[:, 1], carrier[0, 0], carrier[0, 1])
    others = np.mean([four_statistics(0.0, 0.0, *each)[3] for each in carrier[1:]], axis=0)
    statistics = np.array([df, other_df, np.broadcast_to(phase - others, df.shape)]).mean(axis=1)
    found = np.cov(filtered_rates(np.diff(statistics, axis=1), alpha)[:, 200:])
    parts = [
        measurement_covariance(np.array(sigmas), L1, L5, alpha=alpha, interval_s=1.0, clock_satellites=np.inf,
                               white="measurement")[np.ix_([0, 1, 3], [0, 1, 3])]
        for sigmas in ((0.3, 0.2, 0.0, 0.0), (0.0, 0.0, 0.02, 0.02))
    ]  # fmt: skip
    receiver, common = (tuple(map(tuple, part)) for part in parts)
    ours = StatisticCovariance(receiver=receiver, common=common).at(
        np.ones(1), np.full(1, float(receivers)), np.full(1, float(clock))
    )[0]
    # 60 000 epochs, neighbours correlated over some five: three standard deviations of a variance are 4 %.
    scale = np.sqrt(np.outer(np.diag(ours), np.diag(ours)))
    assert found / scale == pytest.approx(ours / scale, abs=0.04)
