"""Receivers of the accuracy designators: what smoothing leaves of their output has the standards' sigmas."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_core.models.error_models import (
    E1_GROUND_FACTOR_SURROGATE,
    L5_GROUND_SURROGATE,
    L5_MULTIPATH_SURROGATE,
    L5_NOISE_SURROGATE,
    airborne_curve_m,
    ground_curve_m,
    sigma_air,
    sigma_pr_gnd,
)
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.satellites import N_GPS, N_SATS
from gbas_core.signal.antenna import LinkBudget
from gbas_core.signal.tracking_loops import noise_sigmas
from gbas_core.signals import L1, L5
from gbas_sim.receivers.multipath import smoothing_gain
from gbas_sim.receivers.presets import PRESETS, TAU_S, airborne_receiver, ground_receiver, receiver_preset
from gbas_sim.receivers.receiver_model import IDEAL, ReceiverErrors, ReceiverModel

# Four elevations on GPS and on Galileo, eight or more satellites each.
DEGREES = np.array([5.0, 12.0, 30.0, 80.0])
ELEVATION = np.radians(DEGREES[np.arange(N_SATS) % 4])


def smoothed_errors_m(model: ReceiverModel, receivers: int, epochs: int, interval_s: float, seed: int) -> np.ndarray:
    """Settled smoothed code errors (samples, R, N_BANDS, N_SATS), one sample each 100 s."""
    errors = ReceiverErrors(model, seed=seed, numbers=tuple(range(receivers)), interval_s=interval_s)
    elevation = np.tile(ELEVATION, (receivers, 1))
    params = SmoothingParams(tau_s=(TAU_S,), max_gap_s=2.0 * interval_s)
    state = initial_smoothing(params, receivers, 3)
    cn0, slipped = errors.cn0_dbhz(elevation), np.zeros((receivers, 3, N_SATS), dtype=bool)
    kept = []
    for epoch in range(epochs):
        values = errors.at(epoch, elevation, cn0)
        state, smoothed = smooth_step(state, values.code_m, values.carrier_m, slipped, interval_s, params)
        if epoch * interval_s >= 500.0 and epoch % round(100.0 / interval_s) == 0:
            kept.append(smoothed[0])
    # Hardware delays are constant biases, which a differential system does not have: they are taken off.
    return np.array(kept)


def check(measured: np.ndarray, expected: np.ndarray, satellites: slice, largest: float) -> None:
    """Rms of errors (samples, N_SATS) over their sigma, by elevation and all together.

    Satellites are independent: the scatter of their mean squares gives the standard error.
    """
    squares = (measured[:, satellites] / expected[satellites]) ** 2
    own = squares.mean(axis=0)
    error = own.std(ddof=1) / math.sqrt(own.size)
    assert error < largest
    assert own.mean() == pytest.approx(1.0, abs=5.0 * error)
    for elevation in np.unique(ELEVATION[satellites]):
        there = own[ELEVATION[satellites] == elevation]
        # Of eight satellites; their scatter taken from all, whose distribution is the same.
        assert there.mean() == pytest.approx(1.0, abs=5.0 * own.std(ddof=1) / math.sqrt(there.size))


def without_delays(model: ReceiverModel) -> ReceiverModel:
    return dataclasses.replace(model, hardware=IDEAL.hardware)


def check_ground(designator: str, interval_s: float, epochs: int, seed: int, largest: float) -> None:
    model = without_delays(ground_receiver(designator, interval_s=interval_s))  # type: ignore[arg-type]
    errors = smoothed_errors_m(model, 4, epochs, interval_s, seed)
    correction = errors.mean(axis=1)
    gps, galileo = slice(0, N_GPS), slice(N_GPS, N_SATS)
    l1 = sigma_pr_gnd(designator, ELEVATION, 4)  # type: ignore[arg-type]
    check(correction[:, L1], l1, gps, largest)
    check(correction[:, L1], E1_GROUND_FACTOR_SURROGATE * l1, galileo, largest)
    check(correction[:, L5], ground_curve_m(L5_GROUND_SURROGATE, ELEVATION, 4), slice(0, N_SATS), largest)
    # One receiver alone: the same curve for M = 1.
    check(errors[:, 0, L1], sigma_pr_gnd(designator, ELEVATION, 1), gps, largest)  # type: ignore[arg-type]


def check_airborne(designator: str, interval_s: float, epochs: int, seed: int, largest: float) -> None:
    model = without_delays(airborne_receiver(designator, interval_s=interval_s))  # type: ignore[arg-type]
    errors = smoothed_errors_m(model, 1, epochs, interval_s, seed)[:, 0]
    l1 = sigma_air(designator, ELEVATION)  # type: ignore[arg-type]
    check(errors[:, L1], l1, slice(0, N_SATS), largest)
    l5 = np.hypot(airborne_curve_m(L5_NOISE_SURROGATE, ELEVATION), airborne_curve_m(L5_MULTIPATH_SURROGATE, ELEVATION))
    check(errors[:, L5], l5, slice(0, N_SATS), largest)


@pytest.mark.parametrize("designator", ["A", "B", "C"])
def test_corrections_have_sigma_pr_gnd(designator):
    check_ground(designator, interval_s=5.0, epochs=1500, seed=11, largest=0.12)


@pytest.mark.parametrize("designator", ["A", "B"])
def test_airborne_ranges_have_sigma_air(designator):
    check_airborne(designator, interval_s=5.0, epochs=1500, seed=12, largest=0.08)


@pytest.mark.campaign
@pytest.mark.parametrize("designator", ["A", "B", "C"])
def test_corrections_have_sigma_pr_gnd_at_2_hz(designator):
    check_ground(designator, interval_s=0.5, epochs=50_000, seed=13, largest=0.06)


@pytest.mark.campaign
@pytest.mark.parametrize("designator", ["A", "B"])
def test_airborne_ranges_have_sigma_air_at_2_hz(designator):
    check_airborne(designator, interval_s=0.5, epochs=50_000, seed=14, largest=0.05)


@pytest.mark.parametrize(
    ("name", "link"),
    [
        *((name, None) for name in ("gad_a", "gad_b", "gad_c", "aad_a", "aad_b")),
        ("gad_b", LinkBudget(antenna="patch", loss_db=3.0)),
        ("aad_b", LinkBudget(antenna="fighter")),
    ],
)
def test_parts_add_to_the_curve_at_2_hz(name, link):
    """Thermal noise and each error through the filter's exact gain (test_multipath.py): the standard's curve."""
    model = receiver_preset(name, cn0=link)
    assert link is None or model.cn0 == link
    degrees = np.array([5.0, 6.0, 9.0, 20.0, 34.0, 36.0, 60.0, 90.0])
    elevation = np.radians(degrees)[:, np.newaxis] * np.ones(N_SATS)
    thermal = noise_sigmas(model.tracking, model.cn0.cn0_dbhz(elevation)).code_m[:, L1, 0]
    own = (thermal * smoothing_gain(model.tracking.code_correlation_s, tau_s=TAU_S, interval_s=0.5)) ** 2
    common = np.zeros(degrees.size)
    for error in model.errors:
        part = error.code[0].at_m(elevation[:, 0]) * smoothing_gain(error.correlation_s, tau_s=TAU_S, interval_s=0.5)
        own, common = (own, common + part**2) if error.shared else (own + part**2, common)
    if name.startswith("gad"):
        expected = sigma_pr_gnd(name[-1].upper(), elevation[:, 0], 3)  # type: ignore[arg-type]
        np.testing.assert_allclose(np.sqrt(own / 3.0 + common), expected, rtol=1e-9)
    else:
        np.testing.assert_allclose(np.sqrt(own), sigma_air(name[-1].upper(), elevation[:, 0]), rtol=1e-9)  # type: ignore


def test_between_degrees_the_curve_is_met_closely():
    """Curves are laid down degree by degree; their bend between degrees is below 0.1 %."""
    model = receiver_preset("gad_b")
    elevation = np.radians(np.array([5.5, 10.5, 40.5]))
    error = model.errors[0]
    own = error.code[0].at_m(elevation) * smoothing_gain(error.correlation_s, tau_s=TAU_S, interval_s=0.5)
    expected = 0.16 + 1.07 * np.exp(-np.degrees(elevation) / 15.5)
    np.testing.assert_allclose(own, expected, rtol=3e-3)  # thermal noise is another 0.2 %


def test_names():
    for name in PRESETS:
        assert isinstance(receiver_preset(name), ReceiverModel)
    assert receiver_preset("ideal") == IDEAL
    with pytest.raises(ValueError, match="receiver: preset = 'gad_d' is not one of ideal, gad_a"):
        receiver_preset("gad_d")
    with pytest.raises(ValueError, match="designator = 'D' is not one of A, B, C"):
        ground_receiver("D")  # type: ignore[arg-type]
