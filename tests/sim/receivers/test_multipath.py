"""Errors with memory: size by elevation and correlation time from the output, and what smoothing leaves of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS
from gbas_core.signals import L1, L2, L5
from gbas_sim.receivers.multipath import CorrelatedError, CorrelatedErrors, ElevationCurve, curves_m, smoothing_gain

NUMBERS = (0, 1, 2, 3)
CURVES = tuple(ElevationCurve.exponential(a0, a1, 10.0) for a0, a1 in ((0.3, 1.0), (0.2, 0.6), (0.1, 0.3)))
CARRIER = tuple(ElevationCurve.constant(sigma) for sigma in (0.002, 0.001, 0.003))
ELEVATION = np.radians(np.linspace(5.0, 85.0, N_SATS)) * np.ones((len(NUMBERS), 1))


def error(**changes) -> CorrelatedError:
    return CorrelatedError(**({"name": "test", "correlation_s": 20.0, "code": CURVES, "carrier": CARRIER} | changes))


def series(*errors: CorrelatedError, epochs: range, seed: int = 1, numbers=NUMBERS) -> tuple[np.ndarray, np.ndarray]:
    made = CorrelatedErrors(errors, seed=seed, numbers=numbers, interval_s=0.5)
    elevation = ELEVATION[: len(numbers)]
    pairs = [made.at(epoch, elevation) for epoch in epochs]
    return np.array([code for code, _ in pairs]), np.array([carrier for _, carrier in pairs])


def test_sizes_by_elevation_signal_and_quantity():
    """Every 100 s, five correlation times: nearly independent. 600 samples of each receiver, satellite and band."""
    code_m, carrier_m = series(error(), epochs=range(0, 30_000, 200))
    count = code_m.shape[0] * code_m.shape[1]
    degrees = np.degrees(ELEVATION[0])
    for values, curves in ((code_m, CURVES), (carrier_m, CARRIER)):
        measured = np.sqrt((values**2).mean(axis=(0, 1)))
        expected = np.full_like(measured, 0.0)
        expected[L1] = np.where(IS_GPS, curves[0].at_m(ELEVATION[0]), curves[1].at_m(ELEVATION[0]))
        expected[L5] = curves[2].at_m(ELEVATION[0])
        # One of 136 numbers, each with a relative error of 1 / sqrt(2 n), n 1.3 % less for exp(-10): 5 of it.
        np.testing.assert_allclose(measured[[L1, L5]], expected[[L1, L5]], rtol=5.0 / math.sqrt(2.0 * count))
        assert (measured[L2] == 0.0).all()
    np.testing.assert_allclose(CURVES[0].at_m(ELEVATION[0]), 0.3 + np.exp(-degrees / 10.0), rtol=2e-3)  # by degrees


def test_correlation_time_from_the_output():
    code_m, carrier_m = series(error(), epochs=range(1200))
    for values, curves in ((code_m, CURVES), (carrier_m, CARRIER)):
        unit = values[:, :, [L1, L5]] / curves_m(curves, ELEVATION)[:, [L1, L5]]
        for lag in (10, 40, 80):  # 5, 20 and 40 s: a quarter, one and two correlation times
            products = (unit[lag:] * unit[:-lag]).mean(axis=0)
            # The scatter of 544 independent means over 600 s gives the standard error of their mean: 1 %.
            error_of_mean = products.std() / math.sqrt(products.size)
            assert error_of_mean < 0.02
            assert products.mean() == pytest.approx(math.exp(-lag / 40.0), abs=5.0 * error_of_mean)
    # The processes behind have exactly this correlation: test_random_processes.py.


def test_shared_errors_are_the_same_at_all_receivers():
    code_m, _ = series(error(shared=True), epochs=range(3))
    np.testing.assert_array_equal(code_m, np.broadcast_to(code_m[:, :1], code_m.shape))
    own, _ = series(error(), epochs=range(3))
    assert not np.isclose(own[:, 0, L1], own[:, 1, L1]).any()


def test_errors_add_up_and_are_independent():
    both, _ = series(error(), error(), epochs=range(0, 8000, 200))
    first, _ = series(error(), epochs=range(0, 8000, 200))
    second = both - first
    count = first[:, :, [L1, L5]].size
    sizes = np.sqrt((first**2).mean() * (second**2).mean())
    assert abs((first * second)[:, :, [L1, L5]].mean()) < 5.0 * 3.0 * sizes / math.sqrt(
        count
    )  # kurtosis of the mixture


def test_any_epoch_in_any_company():
    code_m, carrier_m = series(error(), epochs=range(100))
    alone, alone_carrier = series(error(), epochs=range(77, 78), numbers=(0,))
    np.testing.assert_array_equal(alone[0, 0], code_m[77, 0])
    np.testing.assert_array_equal(alone_carrier[0, 0], carrier_m[77, 0])


def test_missing_elevations_give_no_error():
    elevation = np.full((1, N_SATS), np.nan)
    elevation[0, 3] = 1.0
    sigma = curves_m(CURVES, elevation)
    assert np.isfinite(sigma[0, [L1, L5], 3]).all()
    assert np.isnan(sigma[0, L1]).sum() == N_SATS - 1
    assert int((IS_GALILEO | IS_GPS).sum()) == N_SATS


@pytest.mark.parametrize(
    ("tau_s", "correlation_s"), [(100.0, 0.0), (100.0, 2.0), (100.0, 60.0), (30.0, 60.0), (30.0, 300.0)]
)
def test_smoothing_gain_is_the_filters(tau_s, correlation_s):
    """Second formulation: the double sum over the filter's impulse response and the error's autocorrelation."""
    interval_s = 0.5
    weight = interval_s / tau_s
    count = round(25.0 * tau_s / interval_s)  # exp(-25) is left
    response = weight * (1.0 - weight) ** np.arange(count)
    correlation = np.exp(-interval_s / correlation_s * np.arange(count)) if correlation_s else np.eye(1, count)[0]
    spread = np.correlate(response, response, mode="full")[count - 1 :]
    variance = spread[0] + 2.0 * (spread[1:] * correlation[1:]).sum()
    assert smoothing_gain(correlation_s, tau_s=tau_s, interval_s=interval_s) == pytest.approx(
        math.sqrt(variance), rel=1e-9
    )
    # In continuous time: T / (T + tau).
    if correlation_s > 10.0 * interval_s:
        assert variance == pytest.approx(correlation_s / (correlation_s + tau_s), rel=0.02)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: error(correlation_s=-1.0), "correlation_s = -1 is not within 0 to 100000 s"),
        (lambda: error(code=CURVES[:2]), "has not the right number of values"),
        (lambda: ElevationCurve(elevation_deg=(10.0, 5.0), sigma_m=(1.0, 1.0)), "(10.0, 5.0) is not ascending"),
        (lambda: ElevationCurve(elevation_deg=(10.0,), sigma_m=(-1.0,)), "sigma_m = -1 is not within 0 to 100 m"),
        (lambda: ElevationCurve(elevation_deg=(), sigma_m=()), "or both are empty"),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error_info:
        make()
    assert message in str(error_info.value)
