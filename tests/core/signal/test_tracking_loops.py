"""Tracking loops: published thresholds, closed forms in the limits, and the papers' numbers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import quad
from scipy.optimize import brentq

from gbas_core.satellites import N_SATS
from gbas_core.signal.tracking_loops import (
    BOC_1_1,
    BPSK_1,
    BPSK_10,
    MODULATIONS,
    CodeJitter,
    TrackingParams,
    code_jitter,
    code_sigma_s,
    dynamic_phase_rad,
    frequency_sigma_hz,
    lock_threshold_dbhz,
    noise_sigmas,
    oscillator_phase_rad,
    phase_sigma_rad,
    vibration_phase_rad,
)
from gbas_core.signals import FREQUENCY_HZ, L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

TABLES = Path(__file__).resolve().parents[2] / "tables"
THRESHOLDS = yaml.safe_load((TABLES / "code_loop_thresholds.yaml").read_text(encoding="utf-8"))["thresholds"]


def approximate_jitter(spacing_chips: float, normalised_bandwidth: float) -> CodeJitter:
    """Kaplan and Hegarty, eq (5.23): what their figure shows."""
    d, b = spacing_chips, normalised_bandwidth
    if d * b >= math.pi:
        chips2, squaring = 0.5 * d, 2.0 / (2.0 - d)
    elif d * b > 1.0:
        chips2, squaring = 0.5 * (1.0 / b + b / (math.pi - 1.0) * (d - 1.0 / b) ** 2), 2.0 / (2.0 - d)
    else:
        chips2, squaring = 0.5 / b, 1.0
    return CodeJitter(chips2 / BPSK_1.chip_rate_hz**2, squaring)


@pytest.mark.parametrize("row", THRESHOLDS)
def test_code_threshold_of_the_figure(row):
    jitter = approximate_jitter(row["spacing_chips"], row["normalised_bandwidth"])

    def excess(cn0_dbhz: float) -> float:
        sigma_s = float(code_sigma_s(jitter, cn0_dbhz, row["bandwidth_hz"], row["integration_s"]))
        return 3.0 * sigma_s * BPSK_1.chip_rate_hz - 0.5 * row["spacing_chips"]

    # Printed with one digit, read off curves: 18 for 18.2.
    assert brentq(excess, 0.0, 40.0) == pytest.approx(row["cn0_dbhz"], abs=0.25)


@pytest.mark.parametrize(("spacing_chips", "normalised_bandwidth", "tolerance"), [(1.0, 17.0, 0.02), (0.5, 17.0, 0.04)])
def test_integral_is_the_approximation_where_that_is_good(spacing_chips, normalised_bandwidth, tolerance):
    """Where spacing times bandwidth is above pi; the approximation leaves out some per cent of filtered slope."""
    exact = code_jitter(BPSK_1, spacing_chips, normalised_bandwidth * BPSK_1.chip_rate_hz)
    approximate = approximate_jitter(spacing_chips, normalised_bandwidth)
    assert exact.variance_s2 == pytest.approx(approximate.variance_s2, rel=tolerance)
    assert exact.squaring == pytest.approx(approximate.squaring, rel=tolerance)


@pytest.mark.parametrize("modulation", MODULATIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("spacing_chips", [0.1, 0.2, 0.3])
def test_wide_front_end_gives_the_slopes_of_the_correlation_function(modulation, spacing_chips):
    """Without a filter: variance (1 - R(D)) / (2 R'^2), squaring (1 + R(D)) / (2 R(D/2)^2), from the correlation."""
    exact = code_jitter(modulation, spacing_chips, 400.0 * modulation.chip_rate_hz)
    beside, across = (float(modulation.correlation(part * spacing_chips)) for part in (0.5, 1.0))
    slope = (1.0 - across) / spacing_chips * modulation.chip_rate_hz
    # What a filter 400 chip rates wide leaves out of a density falling with the square: 2 / (pi^2 200) = 0.1 %, times
    # ten for the slope at D = 0.1 and its square.
    assert exact.variance_s2 == pytest.approx((1.0 - across) / (2.0 * slope**2), rel=0.03)
    assert exact.squaring == pytest.approx((1.0 + across) / (2.0 * beside**2), rel=0.01)


@pytest.mark.parametrize("modulation", MODULATIONS, ids=lambda each: each.name)
@pytest.mark.parametrize(("spacing_chips", "normalised_bandwidth"), [(1.0, 2.0), (1.0, 5.87), (0.1, 20.0), (0.3, 1.5)])
def test_integrals_are_values_of_the_filtered_correlation_function(modulation, spacing_chips, normalised_bandwidth):
    """Second formulation, in time: (R(0) - R(D)) / (2 R'(D/2)^2) and (R(0) + R(D)) / (2 R(D/2)^2) behind the filter."""
    rate, step = modulation.chip_rate_hz, 1e-4
    frequency = np.linspace(-0.5 * normalised_bandwidth, 0.5 * normalised_bandwidth, 20_001) * rate

    def correlation(lag_chips: float) -> float:
        values = modulation.density_s(frequency) * np.cos(2.0 * np.pi * frequency * lag_chips / rate)
        return float(np.trapezoid(values, frequency))

    exact = code_jitter(modulation, spacing_chips, normalised_bandwidth * rate)
    top, beside, across = (correlation(part * spacing_chips) for part in (0.0, 0.5, 1.0))
    slope = (correlation(0.5 * spacing_chips + step) - correlation(0.5 * spacing_chips - step)) / (2.0 * step) * rate
    # The trapezoidal rule and the central difference are good to 1e-6.
    assert exact.variance_s2 == pytest.approx((top - across) / (2.0 * slope**2), rel=1e-4)
    assert exact.squaring == pytest.approx((top + across) / (2.0 * beside**2), rel=1e-4)


@pytest.mark.parametrize("modulation", MODULATIONS, ids=lambda each: each.name)
def test_small_spacing_gives_the_rms_bandwidth(modulation):
    """Kaplan and Hegarty, eq (5.24), with its integrals by adaptive quadrature."""
    half_band = 4.0 * modulation.chip_rate_hz
    square = 2.0 * quad(lambda f: f**2 * float(modulation.density_s(f)), 0.0, half_band, limit=200)[0]
    power = 2.0 * quad(lambda f: float(modulation.density_s(f)), 0.0, half_band, limit=200)[0]
    exact = code_jitter(modulation, 0.002, 2.0 * half_band)
    assert exact.variance_s2 == pytest.approx(1.0 / ((2.0 * math.pi) ** 2 * square), rel=1e-4)
    assert exact.squaring == pytest.approx(1.0 / power, rel=1e-4)


@pytest.mark.parametrize("modulation", MODULATIONS, ids=lambda each: each.name)
def test_correlation_is_the_transform_of_the_density(modulation):
    rate = modulation.chip_rate_hz
    frequency = np.linspace(-300.0, 300.0, 600_001) * rate
    density = modulation.density_s(frequency)
    for lag in (0.0, 0.1, 0.4, 0.5, 0.7, 1.0, 1.3):
        transformed = (density * np.cos(2.0 * np.pi * frequency * lag / rate)).sum() * 0.001 * rate
        # The density beyond 300 chip rates: 1 / (pi^2 300), thrice that with a subcarrier.
        assert transformed == pytest.approx(float(modulation.correlation(lag)), abs=2e-3)


def test_published_phase_jitters():
    """Sabatini et al., with the parameters of their TORNADO: eq (46), (48), (49) in degrees."""
    l1 = float(FREQUENCY_HZ[L1])
    # 360 f S / (2 pi) sqrt(P (1/20 - 1/2000)) by hand: 57.296 x 1.57542 x sqrt(0.005 x 0.0495).
    assert math.degrees(vibration_phase_rad(l1, 1e-9, 0.005)) == pytest.approx(1.420, abs=5e-4)
    assert math.degrees(oscillator_phase_rad(l1, 1e-10, 18.0)) == pytest.approx(
        160 * 1e-10 * 1575.42e6 / 18.0, rel=1e-9
    )
    # The paper: 98 m/s^3 is 185,398 degrees/s^3 (with c = 299,792 km/s), times 0.4828 over the bandwidth cubed.
    assert math.degrees(dynamic_phase_rad(l1, 98.0, 18.0)) == pytest.approx(0.4828 * 185_398 / 18.0**3, rel=1e-4)


def test_phase_lock_threshold_of_the_paper():
    """ "25 to 28 dB-Hz" for 15 to 18 Hz and 5 to 20 ms: without stress at 18 Hz the one, with 10 g/s the other."""
    for integration_s in (0.005, 0.02):
        for jerk_mps3, low, high in ((0.0, 24.5, 25.5), (98.0, 27.5, 28.6)):
            params = TrackingParams(
                carrier_bandwidth_hz=18.0, integration_s=integration_s, jerk_mps3=jerk_mps3, vibration_g2phz=0.005
            )
            threshold = lock_threshold_dbhz(params)
            assert low <= threshold[L1, 0] <= high
            # The threshold is where its own inequality turns.
            margin = math.radians(15.0) - dynamic_phase_rad(float(FREQUENCY_HZ[L1]), jerk_mps3, 18.0) / 3.0
            others = vibration_phase_rad(float(FREQUENCY_HZ[L1]), 1e-9, 0.005), math.radians(1.400)
            thermal = float(phase_sigma_rad(threshold[L1, 0], 18.0, integration_s))
            assert math.hypot(thermal, *others) == pytest.approx(margin, rel=1e-4)


def test_thresholds_by_signal():
    threshold = lock_threshold_dbhz(TrackingParams())
    assert threshold.shape == (N_BANDS, N_SATS)
    assert np.isnan(threshold[L2]).all()
    assert np.isfinite(threshold[[L1, L5]]).all()
    assert np.isinf(lock_threshold_dbhz(TrackingParams(jerk_mps3=1000.0))[L1]).all()
    # A narrow code loop holds longer than the phase loop; a wide one with a small spacing does not.
    wide = lock_threshold_dbhz(TrackingParams(code_bandwidth_hz=10.0, spacing_chips=(0.05, 0.05, 0.1)))
    assert (wide[[L1, L5]] > threshold[[L1, L5]]).all()


def test_sigmas_by_hand():
    params = TrackingParams(spacing_chips=(0.2, 0.2, 1.0), front_end_hz=(50e6, 50e6, 60e6), code_bandwidth_hz=0.5)
    sigma = noise_sigmas(params, np.full((N_BANDS, N_SATS), 45.0))
    density, coherent = 10.0**4.5, 0.02 * 10.0**4.5
    # Wide front end: d/2 over the square of the slope (BOC: three times as steep, a third of the variance). The filter
    # takes some per cent off both slope and noise.
    ca = 293.05 * math.sqrt(0.5 * 0.1 / density * (1.0 + 2.0 / 1.8 / coherent))
    assert sigma.code_m[L1, 0] == pytest.approx(ca, rel=0.05)
    assert sigma.code_m[L1, 40] == pytest.approx(ca / math.sqrt(3.0), rel=0.06)
    # 10 MHz chips through 60 MHz: the filter takes up to a tenth off.
    l5 = 29.305 * math.sqrt(0.5 * 0.5 / density * (1.0 + 2.0 / coherent))
    assert 0.88 * l5 < sigma.code_m[L5, 0] < l5
    phase = math.sqrt(15.0 / density * (1.0 + 0.5 / coherent))
    np.testing.assert_allclose(sigma.carrier_m[[L1, L5], 0], phase * WAVELENGTH_M[[L1, L5]] / (2.0 * math.pi))
    doppler = math.sqrt(8.0 / density * (1.0 + 1.0 / coherent)) / (2.0 * math.pi * 0.02)
    np.testing.assert_allclose(sigma.doppler_hz[[L1, L5]], doppler)
    np.testing.assert_allclose(float(frequency_sigma_hz(45.0, 2.0, 0.02)), doppler)
    assert np.isnan(sigma.code_m[L2]).all()


def test_chips():
    assert [m.chip_m for m in MODULATIONS] == [SPEED_OF_LIGHT_MPS / 1.023e6] * 2 + [SPEED_OF_LIGHT_MPS / 10.23e6]
    assert (BPSK_1, BOC_1_1, BPSK_10) == MODULATIONS


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spacing_chips": (0.1, 0.1, 0.0)}, "spacing_chips = 0 is not within 0.02 to 1 chips"),
        ({"spacing_chips": (0.1, 0.1)}, "spacing_chips = (0.1, 0.1) has not the right number of values"),
        ({"code_bandwidth_hz": -1.0}, "code_bandwidth_hz = -1 is not within 0.01 to 10 Hz"),
        ({"integration_s": math.nan}, "integration_s = nan is not a finite number"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError) as error:
        TrackingParams(**changes)
    assert message in str(error.value)
