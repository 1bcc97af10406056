"""Statistics of what receivers of a simulated world put out, against what was asked for.

Tolerances are five standard errors, from the number of samples: of a mean, sigma / sqrt(n); of a variance of normal
numbers, sqrt(2 / n) of itself; others where they are used. With 5 a right simulator fails once in 2e6 comparisons.
"""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2

from gbas_core.models.error_models import iono_obliquity
from gbas_core.satellites import IS_GPS, N_SATS, SAT_INDEX
from gbas_core.signal.tracking_loops import TrackingParams
from gbas_core.signals import IONO_RATIO, L1, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.faults.signal_faults import FAULT_MODES, CodeCarrierDivergence
from gbas_sim.receivers.presets import ground_receiver
from gbas_sim.receivers.receiver import GROUND_RECEIVER, ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams

SITES = (
    (3840619.039, 715604.228, 5024909.863),
    (3840835.113, 714861.969, 5024848.587),
    (3841202.939, 715429.959, 5024488.675),
)
ERRORS = 5.0
BANDS_DEG = (3.0, 12.0, 25.0, 45.0, 90.0)
BOTH = (L1, L5)
QUIET = dataclasses.replace(GROUND_RECEIVER, noise_scale=0.0)


def world(epochs: int, *, sites: int = 3, interval_s: float = 0.5, **changes) -> World:
    duration_s = (epochs - 1) * interval_s
    return World(WorldParams(
        receiver_ecef_m=SITES[:sites], flight=None, duration_s=duration_s, interval_s=interval_s, **changes
    ))  # fmt: skip


def output(of: World, *names: str) -> tuple[np.ndarray, ...]:
    """Fields of all epochs, (epochs, R, N_BANDS, N_SATS) each."""
    epochs = [epoch.ground for epoch in of]
    return tuple(np.array([[getattr(each, name) for each in ground] for ground in epochs]) for name in names)


def elevations_rad(of: World) -> np.ndarray:
    return np.array([of.elevations_rad(number) for number in range(len(of))])


def in_bands(elevation_rad: np.ndarray):
    for low, high in pairwise(BANDS_DEG):
        yield (np.degrees(elevation_rad) >= low) & (np.degrees(elevation_rad) < high)


# --- noise


def asked_sigmas_m(kind: ReceiverParams, elevation_rad: np.ndarray) -> dict[str, np.ndarray]:
    """Kaplan and Hegarty's formulas for the parameters asked for, (..., 2, N_SATS) for L1 and L5."""
    sine = np.sin(elevation_rad)
    code, carrier = [], []
    for place, band in enumerate(BOTH):
        zenith, horizon = kind.cn0_zenith_dbhz[place], kind.cn0_horizon_dbhz[place]
        ratio = 10.0 ** ((horizon + (zenith - horizon) * sine) / 10.0)
        spacing, chip_m = kind.spacing_chips[place], SPEED_OF_LIGHT_MPS / (1.023e6 if band == L1 else 10.23e6)
        steeper = np.where(IS_GPS, 1.0, 3.0) if band == L1 else 1.0  # the peak of BOC(1,1)
        squaring = 1.0 + 2.0 / ((2.0 - spacing) * kind.integration_s * ratio)
        code.append(chip_m * np.sqrt(kind.code_bandwidth_hz * spacing / (2.0 * steeper * ratio) * squaring))
        squaring = 1.0 + 1.0 / (2.0 * kind.integration_s * ratio)
        carrier.append(WAVELENGTH_M[band] / (2.0 * math.pi) * np.sqrt(kind.carrier_bandwidth_hz / ratio * squaring))
    return {"code_m": np.stack(code, axis=-2), "carrier_m": np.stack(carrier, axis=-2)}


def test_code_and_carrier_noise_by_elevation():
    """Of fourth differences in time, which leave nothing of orbits and clocks, without knowing either.

    Fourth differences of white noise have 70 times its variance and autocorrelations of -56, 28, -8 and 1 over 70. The
    variance of n of them is known to sqrt(2 (1 + 2 sum of squared autocorrelations) / n) = sqrt(5.25 / n) of itself.
    What orbits leave is the fourth derivative, below 1e-7 m/s^4, times 0.5^4 s^4: 6 nm.
    """
    many = world(600)
    elevation = elevations_rad(many)
    asked = asked_sigmas_m(GROUND_RECEIVER, elevation)
    tail = np.array([56.0, 28.0, 8.0, 1.0]) / 70.0
    inflation = 1.0 + 2.0 * float((tail**2).sum())
    for name, values in zip(asked, output(many, "code_m", "carrier_m"), strict=True):
        fourth = np.diff(values[:, :, BOTH], n=4, axis=0) / (math.sqrt(70.0) * asked[name][2:-2])
        for band in in_bands(elevation[2:-2]):
            for place in range(2):
                sample = fourth[:, :, place][band & np.isfinite(fourth[:, :, place])]
                assert sample.size > 2000
                error = math.sqrt(2.0 * inflation / sample.size)
                assert (sample**2).mean() == pytest.approx(1.0, abs=ERRORS * error), (name, place)


def test_cn0_by_elevation():
    """Mean and scatter of a receiver that puts it out with noise of 0.2 dB, by elevation."""
    kind = ReceiverModel(cn0_sigma_db=0.2)
    some = world(200, ground=kind)
    elevation, (cn0,) = elevations_rad(some), output(some, "cn0_dbhz")
    for band, (zenith, horizon) in zip(BOTH, ((50.0, 37.0), (52.0, 39.0)), strict=True):
        away = cn0[:, :, band] - (horizon + (zenith - horizon) * np.sin(elevation))
        for inside in in_bands(elevation):
            sample = away[inside & np.isfinite(away)]
            assert sample.size > 500
            assert abs(sample.mean()) < ERRORS * 0.2 / math.sqrt(sample.size)
            assert sample.var() == pytest.approx(0.04, rel=ERRORS * math.sqrt(2.0 / sample.size))


# --- multipath


def test_correlation_time_of_multipath():
    """Of codes less those of receivers without it, in combinations of receivers that have no common error.

    The correlation r_k at lag k of n values of such a process, with phi that at lag 1, is known to (Bartlett)
    sqrt([(1 + phi^2) (1 - phi^2k) / (1 - phi^2) - 2 k phi^2k] / n); tau = -k T / ln(r_k), so to that times
    tau^2 / (k T r_k). The variance is known to sqrt(2 (1 + phi^2) / (1 - phi^2) / n).
    """
    correlation_s, interval_s, lag = 60.0, 10.0, 6
    preset = ground_receiver("B", multipath_s=correlation_s)
    kind = dataclasses.replace(preset, tracking=TrackingParams(noise_scale=0.0))
    spoilt = world(400, interval_s=interval_s, ground=kind)
    clean = world(400, interval_s=interval_s, ground=dataclasses.replace(kind, errors=()))
    errors_m = output(spoilt, "code_m")[0][:, :, BOTH] - output(clean, "code_m")[0][:, :, BOTH]
    own = preset.errors[0]
    elevation_deg = np.degrees(elevations_rad(spoilt))
    curves = [np.interp(elevation_deg, curve.elevation_deg, curve.sigma_m) for curve in own.code]
    sigma_m = np.stack([np.where(IS_GPS, curves[0], curves[1]), curves[2]], axis=2)
    # To unit variance of each receiver's own; what they share is alike in all at one elevation, to 0.01 degrees.
    unit = errors_m / sigma_m
    first = (unit[:, 0] - unit[:, 1]) / math.sqrt(2.0)
    second = (unit[:, 0] + unit[:, 1] - 2.0 * unit[:, 2]) / math.sqrt(6.0)
    series = np.stack([first, second], axis=1)
    known = np.isfinite(series).all(axis=0)
    series = series[:, known]
    n, phi = series.size, math.exp(-interval_s / correlation_s)
    assert series.shape[1] > 50
    squares = (1.0 + phi**2) / (1.0 - phi**2)
    assert (series**2).mean() == pytest.approx(1.0, abs=ERRORS * math.sqrt(2.0 * squares / n))
    products = (series[lag:] * series[:-lag]).mean() / (series**2).mean()
    error = math.sqrt((squares * (1.0 - phi ** (2 * lag)) - 2.0 * lag * phi ** (2 * lag)) / n)
    measured_s = -lag * interval_s / math.log(products)
    assert measured_s == pytest.approx(correlation_s, abs=ERRORS * error * correlation_s * math.e)
    assert ERRORS * error * math.e < 0.2  # tight enough to tell 60 s from 75 s


# --- ionosphere


def test_sigma_vig_between_two_receivers():
    """From the single difference of carriers over obliquity and distance; chi-squared bounds for 1 in 2e6."""
    params = IonosphereParams(night_delay_m=0.0, day_delay_m=0.0, sigma_vig=4e-6)
    orbits, sample = world(1).orbits, []
    for seed in range(60):
        common = {"receiver_ecef_m": SITES[:2], "flight": None, "duration_s": 0.0, "ground": QUIET, "seed": seed}
        without = World(WorldParams(**common), orbits=orbits)
        within = World(WorldParams(ionosphere=params, **common), orbits=orbits)
        delay_m = -(output(within, "carrier_m")[0] - output(without, "carrier_m")[0])[0]
        difference_m = (delay_m[1] - delay_m[0]) / iono_obliquity(within.elevations_rad(0)[1])
        seen = np.isfinite(difference_m[L1])
        np.testing.assert_allclose(difference_m[L5][seen], IONO_RATIO[L5] * difference_m[L1][seen], atol=2e-8)
        station = within.params.station
        along_m = station.axes[:2] @ (np.array(SITES[1]) - np.array(SITES[0]))
        sample.append(difference_m[L1][seen] / np.linalg.norm(along_m))
    gradients = np.concatenate(sample)
    assert gradients.size > 1000
    low, high = chi2.ppf([2.5e-7, 1.0 - 2.5e-7], gradients.size) / gradients.size
    assert low < (gradients**2).mean() / 4e-6**2 < high
    assert abs(gradients.mean()) < ERRORS * 4e-6 / math.sqrt(gradients.size)


def test_gradient_of_a_front_through_noise():
    """The mean of n single differences of carriers: known to sqrt(2) sigma / sqrt(n) over the distance."""
    front = WedgeFront(
        gradient=300e-6, width_m=100_000.0, direction_rad=math.radians(250.0), start_m=-50_000.0, reference="baseline"
    )
    within, without = world(60, sites=2, fronts=(front,)), world(60, sites=2, ground=QUIET)
    # White noise is drawn by receiver: with the front or without, single differences keep that of both.
    delay_m = -(output(within, "carrier_m")[0] - output(without, "carrier_m")[0])[:, :, BOTH]
    station = within.params.station
    distance_m = float((np.array(SITES[1]) - np.array(SITES[0])) @ station.towards(math.radians(250.0)))
    assert abs(distance_m) > 300.0
    sigma_m = asked_sigmas_m(GROUND_RECEIVER, elevations_rad(within))["carrier_m"]
    for place, band in enumerate(BOTH):
        slopes = (delay_m[:, 1, place] - delay_m[:, 0, place]) / (distance_m * IONO_RATIO[band])
        variance = (sigma_m[:, :, place] ** 2).sum(axis=1) / (distance_m * IONO_RATIO[band]) ** 2
        seen = np.isfinite(slopes)
        weight = 1.0 / variance[seen]
        measured, error = float((weight * slopes[seen]).sum() / weight.sum()), 1.0 / math.sqrt(weight.sum())
        assert error < 0.2e-6
        assert measured == pytest.approx(300e-6, abs=ERRORS * error)


# --- divergence


def test_divergence_rate_of_every_signal():
    """Slopes of codes and carriers by least squares, in all fifteen modes, on all receivers and satellites.

    A slope over n epochs T apart is known to sigma sqrt(12 / (n (n^2 - 1))) / T.
    """
    epochs, ramp_mps, weights = 41, 0.05, (1.0, 1.7933, -0.5, -0.25)
    exact = output(world(epochs, sites=2, ground=QUIET), "code_m", "carrier_m")
    satellite = SAT_INDEX["G08"]
    for number, (mode, signals) in enumerate(FAULT_MODES.items()):
        fault = CodeCarrierDivergence(satellite="G08", mode=mode, start_s=-10.0, ramp_mps=ramp_mps, weights=weights)
        faulty = world(epochs, sites=2, faults=(fault,), seed=1)
        sigma_m = asked_sigmas_m(GROUND_RECEIVER, elevations_rad(faulty)).values()
        since_s = 0.5 * (np.arange(epochs) - 0.5 * (epochs - 1))
        scale = math.sqrt(12.0 / (epochs * (epochs**2 - 1.0))) / 0.5
        for kind, (values, sigma, without) in enumerate(
            zip(output(faulty, "code_m", "carrier_m"), sigma_m, exact, strict=True)
        ):
            grown = (values - without)[:, :, BOTH]
            slope = np.tensordot(since_s, grown, axes=1) / (since_s**2).sum()
            expected = np.zeros((2, N_SATS))
            for place in range(2):
                signal = 2 * kind + place
                expected[place, satellite] = ramp_mps * weights[signal] * signals[signal]
            errors = (slope - expected) / (scale * sigma.mean(axis=0))
            assert np.isfinite(errors[:, :, satellite]).all()
            assert np.nanmax(np.abs(errors)) < ERRORS, (number, mode)
