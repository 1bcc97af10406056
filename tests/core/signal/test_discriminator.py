"""Loops in lock with a signal and its copies: closed forms for one copy, halving as second formulation for many."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.signal.discriminator import discriminator_errors
from gbas_core.signal.tracking_loops import BOC_1_1, BPSK_1


def one_copy(delay_chips, amplitude, spacing_chips, boc=False):
    delay = np.atleast_1d(np.asarray(delay_chips, dtype=float))
    copy = np.full((1, delay.size), amplitude, dtype=complex)
    return discriminator_errors(delay[np.newaxis], copy, np.full(delay.size, spacing_chips), boc=boc)


def envelope(delay: np.ndarray, a: float, d: float) -> np.ndarray:
    """Error of an early-late loop on BPSK without filter, with a copy in phase (a > 0) or against it (a < 0).

    From the triangle's slopes: rising while the copy's correlators are on both sides of its peak, a d / 2 while they
    are on its early side, falling while only the late one is on the copy. Braasch (1996), figures 14.8 and 14.9.
    """
    half = 0.5 * d
    rising = a / (1.0 + a) * delay
    falling = a * (1.0 + half - delay) / (2.0 - a)
    return np.where(
        delay <= (1.0 + a) * half,
        rising,
        np.where(delay <= 1.0 - half + a * half, a * half, np.where(delay < 1.0 + half, falling, 0.0)),
    )


@pytest.mark.parametrize("spacing_chips", [0.1, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("amplitude", [0.5, 0.1, -0.1, -0.5])
def test_envelope_of_one_copy(spacing_chips, amplitude):
    delay = np.linspace(0.0, 1.7, 400)
    found = one_copy(delay, amplitude, spacing_chips)
    np.testing.assert_allclose(found.code_chips, envelope(delay, amplitude, spacing_chips), rtol=0.0, atol=1e-9)


def test_any_phase_stays_within_the_envelope():
    delay = np.linspace(0.0, 1.2, 200)
    bounds = envelope(delay, -0.4, 0.1), envelope(delay, 0.4, 0.1)
    for phase in np.linspace(0.1, 3.0, 15):
        errors = one_copy(delay, 0.4 * np.exp(1j * phase), 0.1).code_chips
        assert (errors >= bounds[0] - 1e-9).all()
        assert (errors <= bounds[1] + 1e-9).all()


def test_phase_and_power_of_one_copy():
    """Sabatini et al., eq (21) and (22), for a copy so close that its correlation is the direct signal's."""
    for amplitude, phase in ((0.3, 1.0), (0.5, 2.5), (0.2, -0.7)):
        found = one_copy(1e-9, amplitude * np.exp(1j * phase), 0.1)
        expected = math.atan2(amplitude * math.sin(phase), 1.0 + amplitude * math.cos(phase))
        assert found.phase_rad[0] == pytest.approx(expected, abs=1e-6)
        power = 1.0 + amplitude**2 + 2.0 * amplitude * math.cos(phase)
        assert found.power_db[0] == pytest.approx(10.0 * math.log10(power), abs=1e-6)


def test_largest_phase_error_is_the_arc_sine_of_the_amplitude():
    phases = np.linspace(0.0, 2.0 * math.pi, 2001)
    errors = discriminator_errors(
        np.zeros((1, phases.size)), 0.4 * np.exp(1j * phases)[np.newaxis], np.full(phases.size, 0.1)
    )
    assert np.abs(errors.phase_rad).max() == pytest.approx(math.asin(0.4), abs=1e-6)


def test_boc_has_the_slopes_of_its_own():
    """Close copies move the balance of any symmetric peak alike: a delay / (1 + a); on the slopes it is a d / 2."""
    found = one_copy([0.02, 0.2], 0.3, 0.1, boc=True)
    np.testing.assert_allclose(found.code_chips, [0.3 / 1.3 * 0.02, 0.3 * 0.05], atol=1e-9)
    # Beyond a chip and a half spacing there is nothing of the copy.
    assert one_copy(1.06, 0.3, 0.1, boc=True).code_chips[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("spacing_chips", "modulation"), [(0.1, BPSK_1), (1.0, BPSK_1), (0.1, BOC_1_1)])
def test_many_copies_against_halving(spacing_chips, modulation):
    generator = np.random.default_rng(5)
    delay = generator.uniform(0.0, 1.5, (4, 500))
    amplitude = generator.uniform(0.0, 0.15, delay.shape) * np.exp(2j * np.pi * generator.uniform(size=delay.shape))
    found = discriminator_errors(delay, amplitude, np.full(500, spacing_chips), boc=modulation.boc)

    def power(place):
        return np.abs(modulation.correlation(place) + (amplitude * modulation.correlation(place - delay)).sum(axis=0))

    low, high = np.full(500, -0.5 * spacing_chips), np.full(500, 0.5 * spacing_chips)
    for _ in range(60):
        middle = 0.5 * (low + high)
        later = power(middle + 0.5 * spacing_chips) > power(middle - 0.5 * spacing_chips)
        low, high = np.where(later, middle, low), np.where(later, high, middle)
    np.testing.assert_allclose(found.code_chips, low, rtol=0.0, atol=1e-9)
    assert np.abs(low).max() > 0.05 * spacing_chips


def test_one_place_does_not_depend_on_the_others():
    generator = np.random.default_rng(6)
    delay = generator.uniform(0.0, 1.5, (2, 37))
    amplitude = generator.normal(0.0, 0.1, delay.shape) + 1j * generator.normal(0.0, 0.1, delay.shape)
    spacing, boc = generator.uniform(0.05, 0.3, 37), generator.uniform(size=37) < 0.5
    together = discriminator_errors(delay, amplitude, spacing, boc=boc)
    for first, last in ((5, 6), (0, 12), (30, 37)):
        part = slice(first, last)
        alone = discriminator_errors(delay[:, part], amplitude[:, part], spacing[part], boc=boc[part])
        for one, other in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one, other[part])
