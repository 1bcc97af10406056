"""Counting errors beyond K sigma: against exact intervals, closed forms, and errors whose sigma is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binomtest

from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_msgs_py.records import SolutionEpoch
from gbas_studies.bounding import BoundingReport, ErrorSeries, bounding_report, error_series, measured_sigma
from gbas_studies.exceedances import StanfordCounts, correlation_time_s, interval, stanford_counts

EPOCHS, TAU_S = 1800, 10.0
SEEDS = 20


def autoregressive(generator: np.random.Generator, shape: tuple[int, int], tau_s: float) -> np.ndarray:
    """Unit normal errors of 1 Hz with an exponential correlation of `tau_s`."""
    rho = np.exp(-1.0 / tau_s)
    noise = generator.standard_normal(shape) * np.sqrt(1.0 - rho**2)
    noise[0] /= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], noise, axis=0))


def simulated(seed: int, *, growth: float = 1.0) -> ErrorSeries:
    """Eight satellites with sigmas by elevation; the second half's errors are `growth` times as large."""
    generator = np.random.default_rng(seed)
    elevation = np.full((EPOCHS, N_SATS), np.nan)
    elevation[:, :8] = np.radians([10.0, 20.0, 20.0, 30.0, 50.0, 50.0, 70.0, 80.0])
    errors = np.full((EPOCHS, N_SATS), np.nan)
    errors[:, :8] = autoregressive(generator, (EPOCHS, 8), TAU_S) * 0.3 / np.sin(elevation[0, :8])
    errors[EPOCHS // 2 :] *= growth
    projection = np.zeros((2, EPOCHS, N_SATS))
    projection[:, :, :8] = generator.uniform(-1.0, 1.0, (2, 1, 8))
    return ErrorSeries(
        time_s=np.arange(EPOCHS, dtype=np.float64),
        interval_s=1.0,
        range_m=errors,
        elevation_rad=elevation,
        sigma_m=np.where(np.isfinite(errors), 1.0, np.nan),
        projection=projection,
        position_m=(projection * np.nan_to_num(errors)).sum(axis=-1),
    )


def report_of(seed: int, growth: float = 1.0) -> BoundingReport:
    return bounding_report(simulated(seed, growth=growth), smoothing_tau_s=0.0, alert_limit_m=10.0)


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 25), (25, 25), (7, 400)])
def test_interval_is_the_exact_one(successes: int, trials: int) -> None:
    exact = binomtest(successes, trials).proportion_ci(0.95, method="exact")
    # scipy finds it by root search, to its default tolerance.
    assert interval(successes, trials) == pytest.approx((exact.low, exact.high), abs=1e-9)


def test_correlation_time_of_a_first_order_process() -> None:
    rho = np.exp(-1.0 / TAU_S)
    series = autoregressive(np.random.default_rng(1), (100_000, 1), TAU_S)
    # (1 + rho) / (1 - rho) is the closed form; 5000 correlation times leave some per cent.
    assert correlation_time_s(series, 1.0) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.15)
    assert correlation_time_s(np.ones((500, 1)), 2.0) == pytest.approx(1000.0)
    assert correlation_time_s(np.resize([1.0, -1.0], 100), 2.0) == pytest.approx(2.0)


def test_measured_sigma_is_that_of_the_errors() -> None:
    series = simulated(3)
    sigma = measured_sigma(series)
    there = np.isfinite(series.range_m)
    expected = 0.3 / np.sin(series.elevation_rad[there])
    # The range from 60 to 90 degrees holds 70 and 80; 90 correlation times and two satellites leave 10 %.
    np.testing.assert_allclose(sigma.at(series.elevation_rad)[there], expected, rtol=0.25)


def test_elevations_without_errors_take_the_sigma_below_them_or_the_largest() -> None:
    series = simulated(3)
    range_m = series.range_m.copy()
    range_m[:, [0, 3]] = np.nan
    sigma = measured_sigma(ErrorSeries(**{**vars(series), "range_m": range_m})).sigma_m
    assert sigma[0] == sigma[1:].max()
    assert sigma[2] == sigma[1]
    with pytest.raises(ValueError, match="30 errors"):
        measured_sigma(ErrorSeries(**{**vars(series), "range_m": np.full_like(range_m, np.nan)}))


def test_true_sigmas_are_seldom_called_exceeded_and_small_ones_mostly() -> None:
    """Twenty records of half an hour; 95 % intervals err upwards in 2.5 %, and a measured sigma adds some."""
    right = [report_of(seed) for seed in range(SEEDS)]
    wrong = [report_of(seed, growth=2.0) for seed in range(SEEDS)]

    def exceeded(reports: list[BoundingReport], error: str, index: int) -> int:
        return sum(each.exceedances["measured"][error][index].verdict == "exceeded" for each in reports)

    for index in range(3):
        # At most 3 of 20: 2.5 % would give more than that once in 700 such tests.
        assert exceeded(right, "range", index) <= 3
        assert exceeded(right, "vertical", index) <= 3
        assert exceeded(wrong, "range", index) >= 0.9 * SEEDS
    assert right[0].exceedances["measured"]["range"][1].visible_ratio < 1.5


def test_stanford_regions() -> None:
    error = np.array([1.0, -1.0, 1.0, 3.0, 12.0, 12.0, 20.0, 5.0, np.nan])
    level = np.array([2.0, 2.0, 11.0, 2.0, 2.0, 11.0, 21.0, np.nan, 2.0])
    assert stanford_counts(error, level, 10.0) == StanfordCounts(
        normal=2, unavailable=3, misleading=1, unavailable_misleading=1, hazardous=1
    )


def test_errors_of_ranges_come_back_from_a_solution() -> None:
    generator = np.random.default_rng(5)
    truth = np.array([4_000_000.0, 600_000.0, 4_900_000.0])
    series = error_series([solution_of(generator, truth, k)[0] for k in range(3)], truth)
    generator = np.random.default_rng(5)
    for k in range(3):
        _, errors, expected = solution_of(generator, truth, k)
        gps = errors[:5] - errors[:5].mean()
        # 10 µm: directions at the position and at the truth, some 5 m apart, differ by 1e-6 rad.
        np.testing.assert_allclose(series.range_m[k, :5], gps * np.sqrt(5.0 / 4.0), rtol=0.0, atol=1e-5)
        np.testing.assert_allclose(series.position_m[:, k], expected, rtol=0.0, atol=1e-5)


def solution_of(
    generator: np.random.Generator, truth: np.ndarray, k: int
) -> tuple[SolutionEpoch, np.ndarray, np.ndarray]:
    """A least squares solution of five GPS and three Galileo satellites with known errors and clocks."""
    from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef

    used = np.flatnonzero(CLOCK_GROUPS[0])[:5].tolist() + np.flatnonzero(CLOCK_GROUPS[1])[:3].tolist()
    azimuth = np.full(N_SATS, np.nan)
    elevation, sigma = azimuth.copy(), azimuth.copy()
    azimuth[used] = [0.2, 1.3, 2.9, 4.2, 5.5, 0.9, 2.2, 3.9]
    elevation[used] = [0.3, 0.9, 0.6, 1.3, 0.4, 0.8, 0.5, 1.1]
    sigma[used] = 1.0
    enu = np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
    los = np.array([enu[1], -enu[0], enu[2]])
    projection = projection_matrix(los, sigma, CLOCK_GROUPS, max_condition=1e4)
    assert projection is not None
    errors = np.zeros(N_SATS)
    errors[used] = generator.standard_normal(8)
    change = projection @ errors
    residual = errors - (change[3:] @ CLOCK_GROUPS - change[:3] @ np.nan_to_num(los))
    vertical, lateral = vertical_lateral(projection, 0.0)
    latitude, longitude, _ = geodetic_from_ecef(truth)
    north, west, up = change[:3]
    place = truth + rot_enu_ecef(latitude, longitude).T @ np.array([-west, north, up])
    there = np.isfinite(sigma)

    def only(values: np.ndarray) -> np.ndarray:
        return np.where(there, values, np.nan)

    solution = SolutionEpoch(
        gps_week=2400, tow_s=float(k), x_m=place[0], y_m=place[1], z_m=place[2], n_sats=8.0,
        azimuth_rad=azimuth, elevation_rad=elevation, s_vert=only(vertical), s_lat=only(lateral),
        residual_m=only(residual), sigma_gnd_m=sigma, sigma_air_m=sigma, sigma_tropo_m=sigma, sigma_iono_m=sigma,
    )  # fmt: skip
    return solution, errors[used], np.array([up, west])
