"""Receiver clocks and hardware: Allan deviation from the output, steps of milliseconds, delays that stay."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.satellites import IS_GALILEO, IS_GPS
from gbas_core.signals import L1, L2, L5
from gbas_sim.receivers.oscillators import OSCILLATORS, ClockBank, HardwareParams, OscillatorParams, hardware_delays

NUMBERS = tuple(range(40))


def offsets_s(params: OscillatorParams, epochs: int, interval_s: float, numbers=NUMBERS) -> np.ndarray:
    bank = ClockBank(params, seed=3, numbers=numbers, interval_s=interval_s)
    return np.array([bank.at(epoch).offset_s for epoch in range(epochs)])


@pytest.mark.parametrize("name", ["tcxo", "ocxo", "rubidium"])
@pytest.mark.parametrize("spacing", [1, 20])
def test_allan_deviation(name, spacing):
    params, interval_s = OSCILLATORS[name], 1.0
    params = OscillatorParams(h0_s=params.h0_s, h_minus2_hz=params.h_minus2_hz)
    phase = offsets_s(params, 802, interval_s)[::spacing]
    second = phase[2:] - 2.0 * phase[1:-1] + phase[:-2]
    variance = (second**2).mean() / (2.0 * (spacing * interval_s) ** 2)
    # Second differences of one clock are correlated over two of them, at 3/8 at most: not more than a third of the
    # degrees of freedom is lost.
    freedom = second.size / 1.5
    expected = params.allan_deviation(spacing * interval_s) ** 2
    assert abs(variance / expected - 1.0) < 5.0 * math.sqrt(2.0 / freedom)


def test_published_levels():
    """By hand, sqrt(h0 / 2 + 6.58 h_-2) of Brown and Hwang's table."""
    assert OSCILLATORS["ocxo"].allan_deviation(1.0) == pytest.approx(2.0e-12, rel=0.01)
    assert OSCILLATORS["rubidium"].allan_deviation(1.0) == pytest.approx(1e-11, rel=0.01)
    assert OSCILLATORS["tcxo"].allan_deviation(1.0) == pytest.approx(4.81e-10, rel=0.01)


def test_start_is_within_its_bounds_and_drift_is_the_rate_of_the_offset():
    params = OscillatorParams(offset_s=1e-6, drift=1e-9)
    bank = ClockBank(params, seed=9, numbers=NUMBERS, interval_s=0.5)
    before, first, last = bank.at(-1), bank.at(0), bank.at(4000)
    assert np.abs(before.offset_s).max() <= 1e-6
    assert np.abs(before.drift).max() <= 1e-9
    assert np.ptp(before.offset_s) > 1.5e-6  # 40 uniform numbers leave a quarter of the range with 1e-4
    # Without noise: a straight line, of which 2e-6 s keep 4e-22 s.
    np.testing.assert_allclose(last.offset_s - first.offset_s, 2000.0 * first.drift, rtol=0.0, atol=1e-20)
    np.testing.assert_array_equal(last.drift, before.drift)


def test_millisecond_steps():
    free = OscillatorParams(drift=1e-6)
    kept = OscillatorParams(drift=1e-6, millisecond_steps=True)
    wandering, stepped = (offsets_s(each, 3000, 1.0) for each in (free, kept))
    assert np.abs(stepped).max() <= 0.5e-3
    assert np.abs(wandering).max() > 2e-3
    steps = (wandering - stepped) / 1e-3
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_clocks_do_not_depend_on_their_company():
    params = OSCILLATORS["tcxo"]
    together = offsets_s(params, 50, 0.5)
    np.testing.assert_array_equal(offsets_s(params, 50, 0.5, numbers=(7, 3)), together[:, [7, 3]])


def test_hardware_delays():
    params = HardwareParams(band_m=3.0, system_m=2.0, code_carrier_m=0.5)
    numbers = tuple(range(200))
    code_m, carrier_m = hardware_delays(params, seed=5, numbers=numbers)
    for band, system in ((L1, IS_GPS), (L1, IS_GALILEO), (L5, IS_GPS), (L5, IS_GALILEO)):
        for values in (code_m, carrier_m):
            of_group = values[:, band][:, system]
            assert (np.ptp(of_group, axis=1) == 0.0).all()
    assert (carrier_m[:, L1][:, IS_GPS] == 0.0).all()
    np.testing.assert_array_equal(carrier_m[:, L2], carrier_m[:, L1])
    for bound, values in (
        (3.0, carrier_m[:, L5, 0]),
        (2.0, carrier_m[:, L1, 40]),
        (0.5, (code_m - carrier_m)[:, L1, 0]),
        (0.5, (code_m - carrier_m)[:, L5, 40]),
    ):
        assert np.abs(values).max() <= bound
        # Uniform: standard deviation bound / sqrt(3), known from 200 to 5 x 0.45 / sqrt(200) of itself.
        assert values.std() == pytest.approx(bound / math.sqrt(3.0), rel=0.16)
    some = hardware_delays(params, seed=5, numbers=(9, 100))
    np.testing.assert_array_equal(some.code_m, code_m[[9, 100]])


def test_bad_parameters_are_refused():
    with pytest.raises(ValueError, match="drift = 1 is not within 0 to 1e-05 s/s"):
        OscillatorParams(drift=1.0)
    with pytest.raises(ValueError, match="band_m = -1 is not within 0 to 1000 m"):
        HardwareParams(band_m=-1.0)
