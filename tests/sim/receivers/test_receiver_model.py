"""What a receiver adds: sizes measured from its output are those asked for, epoch by epoch the same bits."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signal.antenna import Cn0Curve, LinkBudget
from gbas_core.signal.tracking_loops import TrackingParams, lock_threshold_dbhz, noise_sigmas
from gbas_core.signals import L1, L2, L5, N_BANDS, WAVELENGTH_M
from gbas_sim.receivers.multipath import CorrelatedError, ElevationCurve
from gbas_sim.receivers.oscillators import HardwareParams
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.receivers.receiver_model import IDEAL, ReceiverErrors, ReceiverModel, rinex_rounded

NUMBERS = (0, 1, 2, 3, 100)
ELEVATION = np.radians(np.linspace(4.0, 88.0, N_SATS)) * np.ones((len(NUMBERS), 1))
NO_DELAYS = HardwareParams(band_m=0.0, system_m=0.0, code_carrier_m=0.0)
THERMAL = ReceiverModel(tracking=TrackingParams(code_bandwidth_hz=1.0), hardware=NO_DELAYS)


def bank(model: ReceiverModel, *, seed: int = 4, numbers=NUMBERS, interval_s: float = 0.5) -> ReceiverErrors:
    return ReceiverErrors(model, seed=seed, numbers=numbers, interval_s=interval_s)


def run(model: ReceiverModel, epochs: range, **kinds) -> dict[str, np.ndarray]:
    """Outputs (epochs, R, N_BANDS, N_SATS)."""
    errors = bank(model, **kinds)
    elevation = ELEVATION[: len(kinds.get("numbers", NUMBERS))]
    cn0 = errors.cn0_dbhz(elevation)
    values = [errors.at(epoch, elevation, cn0) for epoch in epochs]
    return {name: np.array([getattr(each, name) for each in values]) for name in values[0]._fields}


def test_noise_is_as_large_as_the_loops_say():
    """Every fourth epoch: the code's noise is correlated over 1/4 s, after 2 s it keeps exp(-8)."""
    values = run(THERMAL, range(0, 1600, 4))
    cn0 = Cn0Curve().cn0_dbhz(ELEVATION)
    sigmas = noise_sigmas(THERMAL.tracking, cn0)
    count = values["code_m"].shape[0]
    for name, sigma in zip(("code_m", "carrier_m", "doppler_hz"), sigmas, strict=True):
        measured = np.sqrt((values[name] ** 2).mean(axis=(0, 1)))
        # Each of 136 from 2000 samples: 5 x 1 / sqrt(4000) = 8 %.
        tolerance = 5.0 / math.sqrt(2.0 * count * len(NUMBERS))
        np.testing.assert_allclose(measured[[L1, L5]], sigma[0, [L1, L5]], rtol=tolerance)
        assert np.isnan(measured[L2]).all()
        # All satellites together: 0.7 %.
        ratio = values[name][:, :, [L1, L5]] / sigma[:, [L1, L5]]
        assert math.sqrt((ratio**2).mean()) == pytest.approx(1.0, abs=5.0 / math.sqrt(2.0 * ratio.size))
        assert abs(ratio.mean()) < 5.0 / math.sqrt(ratio.size)


def test_cn0_of_the_output():
    values = run(THERMAL, range(400))
    change = values["cn0_dbhz"] - Cn0Curve().cn0_dbhz(ELEVATION)
    known = change[:, :, [L1, L5]]
    assert known.std() == pytest.approx(0.2, rel=5.0 / math.sqrt(2.0 * known.size))
    assert abs(known.mean()) < 5.0 * 0.2 / math.sqrt(known.size)


def test_code_noise_has_the_loops_correlation():
    model = dataclasses.replace(THERMAL, tracking=TrackingParams(code_bandwidth_hz=0.125))
    values = run(model, range(600))["code_m"][:, :, [L1, L5]]
    unit = values / noise_sigmas(model.tracking, Cn0Curve().cn0_dbhz(ELEVATION)).code_m[:, [L1, L5]]
    for lag in (1, 4, 8):
        products = (unit[lag:] * unit[:-lag]).mean(axis=0)
        scatter = products.std() / math.sqrt(products.size)  # of 680 independent means
        assert products.mean() == pytest.approx(math.exp(-4.0 * 0.125 * 0.5 * lag), abs=5.0 * scatter)


def test_quantities_bands_receivers_and_satellites_are_independent():
    values = run(THERMAL, range(0, 800, 4))
    unit = {name: each[:, :, [L1, L5]] / each[:, :, [L1, L5]].std(axis=(0, 1)) for name, each in values.items()}
    pairs = (
        (unit["code_m"], unit["carrier_m"]),
        (unit["carrier_m"], unit["doppler_hz"]),
        (unit["code_m"][:, 0], unit["code_m"][:, 4]),
        (unit["carrier_m"][:, :, 0], unit["carrier_m"][:, :, 1]),
        (unit["code_m"][..., :30], unit["code_m"][..., 30:60]),
    )
    for one, other in pairs:
        assert abs((one * other).mean()) < 5.0 / math.sqrt(one.size)


def test_fades_make_noise_and_end_in_loss_of_lock():
    errors = bank(THERMAL)
    threshold = lock_threshold_dbhz(THERMAL.tracking)
    change = np.zeros((len(NUMBERS), N_BANDS, N_SATS))
    change[:, L1, 5], change[:, L5, 6] = -10.0, -30.0
    faded, nominal = errors.cn0_dbhz(ELEVATION, change_db=change), errors.cn0_dbhz(ELEVATION)
    np.testing.assert_array_equal((faded - nominal)[:, L1, 5], -10.0)
    tracked = errors.tracked(ELEVATION, faded)
    assert not tracked[:, L5, 6].any()
    assert tracked[:, L1, 6].all()
    assert tracked[:, L1, 5].all()
    assert not tracked[:, L2].any()
    assert (faded[:, L5, 6] < threshold[L5, 6]).all()
    grown = errors.at(3, ELEVATION, faded).code_m[:, L1, 5] / errors.at(3, ELEVATION, nominal).code_m[:, L1, 5]
    # 10 dB: the root of ten, and some squaring loss.
    np.testing.assert_allclose(grown, math.sqrt(10.0), rtol=0.05)


def test_mask_and_missing_satellites():
    errors = bank(dataclasses.replace(THERMAL, elevation_mask_rad=math.radians(10.0)))
    elevation = ELEVATION.copy()
    elevation[:, 60] = np.nan
    cn0 = errors.cn0_dbhz(elevation)
    tracked = errors.tracked(elevation, cn0)
    np.testing.assert_array_equal(tracked[:, L1], np.degrees(elevation) >= 10.0)
    assert np.isnan(errors.at(0, elevation, cn0).code_m[:, L1, 60]).all()


def test_ideal_receiver_adds_nothing():
    values = run(IDEAL, range(3))
    for name in ("code_m", "carrier_m", "doppler_hz"):
        assert (values[name][:, :, [L1, L5]] == 0.0).all()
    clock = bank(IDEAL).clocks(1000)
    assert (clock.offset_s == 0.0).all()
    assert (clock.drift == 0.0).all()


def test_everything_adds_up():
    """The same seed with one part at a time: the parts' sum is the whole."""
    curves = (ElevationCurve.constant(1.0),) * 3
    error = CorrelatedError(name="multipath", correlation_s=10.0, code=curves, carrier=curves)
    whole = ReceiverModel(errors=(error,))
    quiet = dataclasses.replace(whole, tracking=TrackingParams(noise_scale=0.0))
    parts = (
        dataclasses.replace(whole, errors=(), hardware=NO_DELAYS),
        dataclasses.replace(quiet, hardware=NO_DELAYS),
        dataclasses.replace(quiet, errors=()),
    )
    for name in ("code_m", "carrier_m"):
        total = run(whole, range(5))[name]
        np.testing.assert_allclose(sum(run(part, range(5))[name] for part in parts), total, atol=1e-12)


def test_any_epoch_in_any_company_gives_the_same_bits():
    model = receiver_preset("aad_a")
    inorder = run(model, range(120))
    for epoch in (119, 3, 64):
        alone = run(model, range(epoch, epoch + 1), numbers=(0, 1))
        for name, values in alone.items():
            np.testing.assert_array_equal(values[0, 1], inorder[name][epoch, 1])
    clocks = bank(model)
    values = {epoch: clocks.clocks(epoch) for epoch in range(-1, 50)}
    again = bank(model, numbers=(100,)).clocks(33)
    assert again.offset_s[0] == values[33].offset_s[4]
    assert again.drift[0] == values[33].drift[4]


def test_a_file_has_three_digits():
    generator = np.random.default_rng(2)
    shape = (N_BANDS, N_SATS)
    exact = ObservationEpoch(
        gps_week=2400,
        tow_s=10.0,
        simulated=1.0,
        code_m=2.2e7 + generator.uniform(0.0, 1.0, shape),
        carrier_m=2.2e7 + generator.uniform(0.0, 1.0, shape),
        doppler_hz=generator.uniform(-4000.0, 4000.0, shape),
        cn0_dbhz=np.where(IS_GPS, generator.uniform(30.0, 50.0, shape), np.nan),
        lli=np.zeros(shape),
    )
    rounded = rinex_rounded(exact)
    wavelength = WAVELENGTH_M[:, np.newaxis]
    for values, original, step in (
        (rounded.code_m, exact.code_m, 1e-3),
        (rounded.carrier_m / wavelength, exact.carrier_m / wavelength, 1e-3),
        (rounded.doppler_hz, exact.doppler_hz, 1e-3),
    ):
        assert np.abs(values - original).max() <= 0.5 * step * (1.0 + 1e-4)  # 1e8 cycles keep 1.5e-8
        np.testing.assert_allclose(values / step, np.rint(values / step), atol=1e-3)
    np.testing.assert_array_equal(np.isnan(rounded.cn0_dbhz), np.isnan(exact.cn0_dbhz))
    np.testing.assert_array_equal(rounded.lli, exact.lli)


def test_antenna_that_banks():
    errors = bank(ReceiverModel(cn0=LinkBudget(antenna="patch")))
    banked = errors.cn0_dbhz(ELEVATION, antenna_elevation_rad=ELEVATION - 0.3)
    assert (banked[:, L1] <= errors.cn0_dbhz(ELEVATION)[:, L1]).all()


def test_bad_parameters_are_refused():
    with pytest.raises(ValueError, match="cn0_sigma_db = -1 is not within 0 to 10 dB"):
        ReceiverModel(cn0_sigma_db=-1.0)
