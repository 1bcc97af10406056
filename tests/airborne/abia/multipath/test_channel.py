"""The statistical channel: power and spectrum of each echo, delays beyond reach, and the same noise for a seed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import welch

from gbas_airborne.abia.multipath.channel import SOURCES, EchoSpectra, channel_echo, fading

SPECTRA = EchoSpectra(fuselage_b2_db=15.0)
INTERVAL_S = 0.02


@pytest.mark.parametrize("source", SOURCES)
def test_fading_has_its_spectrum_and_unit_power(source):
    """Averaged periodograms of 4000 s: 5 % of the power, and of the spectrum where there is any."""
    drawn = fading(SPECTRA, source, 200_000, INTERVAL_S, seed=3)
    assert np.mean(np.abs(drawn) ** 2) == pytest.approx(1.0, rel=0.05)
    assert abs(np.mean(drawn)) < 0.1
    frequency, density = welch(drawn, fs=1.0 / INTERVAL_S, nperseg=1024, return_onesided=False, detrend=False)
    expected = SPECTRA.density_s(source, frequency)
    strong = expected > 0.2 * expected.max()
    np.testing.assert_allclose(density[strong].sum(), expected[strong].sum(), rtol=0.05)
    assert density[np.abs(frequency) > 21.0].sum() < 1e-3 * density.sum()


def test_gaussian_spectrum_fades_as_its_transform():
    """Autocorrelation exp(-2 (pi sigma t)^2): 0.51 after 0.05 s at 3.8 Hz."""
    drawn = fading(SPECTRA, "ground", 200_000, 0.01, seed=4)
    for steps in (2, 5, 10):
        found = np.mean(drawn[steps:] * np.conj(drawn[:-steps]))
        assert found.real == pytest.approx(math.exp(-2.0 * (math.pi * 3.8 * 0.01 * steps) ** 2), abs=0.03)
        assert abs(found.imag) < 0.03


def test_spectra_have_unit_power():
    frequency = np.linspace(-30.0, 30.0, 60_001)
    for source in SOURCES:
        assert np.trapezoid(SPECTRA.density_s(source, frequency), frequency) == pytest.approx(1.0, abs=1e-3)
    # Eq (31): falls with frequency from b2 above the floor.
    low, high = SPECTRA.density_s("fuselage", [0.0, 19.9])
    assert 10.0 * math.log10(low / high) == pytest.approx(15.0, abs=0.01)


def test_power_delay_and_seed():
    delay = np.array([100.0, 430.0, 450.0, math.nan] * 25_000)
    echo = channel_echo(SPECTRA, "ground", delay, INTERVAL_S, seed=5)
    there = np.isfinite(echo.delay_m)
    np.testing.assert_array_equal(there, delay < 1.5 * 293.05)
    assert (echo.amplitude[~there] == 0.0).all()
    assert 10.0 * math.log10(np.mean(np.abs(echo.amplitude[there]) ** 2)) == pytest.approx(-15.0, abs=0.2)
    again = channel_echo(SPECTRA, "ground", delay, INTERVAL_S, seed=5)
    np.testing.assert_array_equal(echo.amplitude, again.amplitude)
    assert (fading(SPECTRA, "wing", 10, INTERVAL_S, 5) != fading(SPECTRA, "ground", 10, INTERVAL_S, 5)).all()
    with pytest.raises(ValueError, match="interval_s = 0.1 is too long for a bandwidth of 40 Hz"):
        fading(SPECTRA, "wing", 10, 0.1, 5)
