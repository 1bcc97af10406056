"""Compiled loops of the monitors against array expressions, with values missing, and with nothing in the sky."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.divergence import DivergenceParams, divergence_step, initial_divergence
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_core.signals import N_BANDS
from gbas_ground.monitors.carrier_acceleration import Carriers, carrier_acceleration_step, initial_carrier_acceleration
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.ccd import CcdInput, CcdParams, ccd_step, initial_ccd
from gbas_ground.monitors.ccd_f import TwoFrequencyInput, TwoFrequencyParams, initial_two_frequency, two_frequency_step
from gbas_ground.monitors.double_difference import double_differences, reference_satellites
from gbas_ground.monitors.ephemeris_residual import Orbits, ephemeris_residual_step, initial_ephemeris_residual
from gbas_ground.monitors.expected_power import initial_power_expectation, power_expectation_step
from gbas_ground.monitors.gradient_coverage import gradient_site
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams, check_ionosphere_gradient
from gbas_ground.monitors.kernels.ccd_f import chi_squares
from gbas_ground.monitors.kernels.double_difference import deciding
from gbas_ground.monitors.kernels.interpolation import interpolated
from gbas_ground.monitors.kernels.median import median
from gbas_ground.monitors.monitor_table import summarise, worst_of
from gbas_ground.monitors.result import MonitorResult
from monitor_scenes import BRAUNSCHWEIG_M, RUNWAY_RAD, STATION

RNG = np.random.default_rng(20)


def with_holes(values, share=0.2):
    """The same with missing and infinite values."""
    return np.where(RNG.random(values.shape) < share, RNG.choice([np.nan, np.nan, np.inf], values.shape), values)


def test_median_and_interpolation():
    for count in range(9):
        values = with_holes(RNG.normal(size=count))
        there = values[np.isfinite(values)]
        assert median(values) == pytest.approx(np.median(there) if there.size else np.nan, nan_ok=True)
    nodes, values = np.array([1.0, 2.0, 4.0]), np.array([3.0, -1.0, 7.0])
    for x in (0.0, 1.0, 1.3, 2.0, 3.9, 4.0, 9.0, np.nan):
        assert interpolated(x, nodes, values) == pytest.approx(np.interp(x, nodes, values), nan_ok=True)
    assert interpolated(3.0, nodes[:1], values[:1]) == 3.0


def test_filters_are_those_of_the_divergence_module():
    """Gaps, restarts, times that stand still: bit for bit what the array expressions give."""
    filters = DivergenceParams(tau_s=3.0, max_gap_s=2.0, settle_s=2.0)
    params = CcdParams(filters=filters)
    state, expected = initial_ccd(2), initial_divergence(filters, 2, N_BANDS)
    nothing = np.zeros((2, N_BANDS, N_SATS))
    for number in range(60):
        value = with_holes(RNG.normal(0.0, 1.0, nothing.shape))
        restarted = RNG.random(nothing.shape) < 0.05
        dt_s = np.nan if number in (0, 30) else float(RNG.choice([0.5, 0.5, 1.0, 2.5, 0.0]))
        state, seen = ccd_step(state, CcdInput(value, nothing, restarted, restarted[:, 0]), dt_s, params)
        expected, _, rate = divergence_step(expected, value, restarted, dt_s, filters)
        np.testing.assert_array_equal(seen.receiver_mps, rate)
        for mine, theirs in zip(state.filters, vars(expected).values(), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_quadratic_form_is_that_of_the_inverse():
    root = RNG.normal(size=(N_SATS, 3, 3))
    covariance = np.einsum("nij,nkj->nik", root, root) + 0.1 * np.eye(3)
    x = with_holes(RNG.normal(size=(3, N_SATS)))
    solved = np.linalg.solve(covariance, np.where(np.isfinite(x), x, 0.0).T[..., np.newaxis])[..., 0]
    form = np.where(np.isfinite(x).all(axis=0), np.einsum("in,ni->n", np.where(np.isfinite(x), x, 0.0), solved), np.nan)
    np.testing.assert_allclose(chi_squares(x, covariance), form, rtol=1e-9)  # condition of some 1e3 times eps
    covariance[3, 1, 2] = np.nan
    assert np.isnan(chi_squares(np.ones((3, N_SATS)), covariance)[3])


def test_references_are_the_highest_of_the_constellation():
    for may_refer in (RNG.random(N_SATS) < 0.6, np.zeros(N_SATS, dtype=bool), np.arange(N_SATS) == 40):
        elevation = np.where(RNG.random(N_SATS) < 0.1, np.nan, np.round(RNG.uniform(0.0, 1.5, N_SATS), 1))  # with ties
        found = reference_satellites(may_refer, elevation, 5)
        for group in CLOCK_GROUPS:
            here = np.flatnonzero(may_refer & group & np.isfinite(elevation))
            expected = here[np.argsort(-elevation[here], kind="stable")[:5]]
            assert (found[group] == np.pad(expected, (0, 5 - expected.size), constant_values=-1)).all()


@pytest.mark.parametrize("every", [False, True])
def test_what_decides(every):
    """Worst of all, or worst of the bands' best; NaN decides nothing."""
    for _ in range(300):
        ratio = np.where(RNG.random((3, 2)) < 0.4, np.nan, np.round(RNG.uniform(0.0, 2.0, (3, 2)), 1))
        best = np.where(np.isnan(ratio), np.inf, ratio).min(axis=0) if every else np.nan_to_num(ratio, nan=-1.0)
        largest = best[np.isfinite(best)].max(initial=-1.0)
        place = deciding(ratio, every)
        assert ratio[place] == largest or (largest < 0.0 and place == (0, 0))


def test_summaries_are_of_the_worst():
    statistic, threshold = with_holes(RNG.normal(size=(2, 3, N_SATS))), with_holes(RNG.normal(size=(2, 3, N_SATS)))
    result = MonitorResult(statistic=statistic, threshold=threshold, failed=RNG.random(statistic.shape) < 0.1)
    due = RNG.random(statistic.shape) < 0.5
    summary, expected = summarise(result, due), worst_of(result, axes=2)
    for mine, theirs in zip(summary[:3], expected, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert (summary.due == due.any(axis=(0, 1))).all()


@pytest.mark.parametrize("receivers", [1, 4])
@pytest.mark.parametrize("satellites", [0, 1])
def test_an_empty_sky_and_one_receiver(receivers, satellites):
    """Nothing or one satellite to look at: nothing is judged, nothing fails that need not be there."""
    here = np.arange(N_SATS) < satellites
    elevation = np.where(here, 1.0, np.nan)
    channel = np.where(here, np.ones((receivers, N_SATS)), np.nan)
    bands = np.where(here, np.ones((receivers, N_BANDS, N_SATS)), np.nan)
    never, used = np.zeros(bands.shape, dtype=bool), np.isfinite(channel)
    gradient = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,))
    site = gradient_site(BRAUNSCHWEIG_M[:receivers], BRAUNSCHWEIG_M[0], gradient)
    acceleration, orbit = STATION.carrier_acceleration_monitor(), STATION.ephemeris_monitor()
    power, double = STATION.expected_power_monitor(), TwoFrequencyParams()
    states = (
        initial_carrier_acceleration(receivers, acceleration), initial_ccd(receivers), initial_two_frequency(receivers),
        initial_ephemeris_residual(len(site.baselines), orbit), initial_power_expectation(receivers, power),
    )  # fmt: skip
    nobody = np.zeros(N_SATS, dtype=bool)
    for dt_s in (np.nan, 0.5, 0.5):
        carriers = Carriers(bands[:, :2].copy(), never[:, :2].copy(), used & False, elevation)
        two = TwoFrequencyInput(bands, bands, never, channel, channel, nobody, elevation, used, used)
        references = reference_satellites(here, elevation, 5)
        made = double_differences(bands[:, :2], site.baselines, references, elevation, CarrierNoise(), gradient.bands)
        first, moved = carrier_acceleration_step(states[0], carriers, dt_s, acceleration)
        second, one = ccd_step(states[1], CcdInput(bands, bands, never, used), dt_s, CcdParams())
        third, both = two_frequency_step(states[2], two, dt_s, double)
        fourth, away = ephemeris_residual_step(states[3], Orbits(made, here), site.baselines, dt_s, orbit)
        fifth, low = power_expectation_step(states[4], bands + 50.0, used, elevation, dt_s, power)
        states = first, second, third, fourth, fifth
        seen = check_ionosphere_gradient(made, here, site, gradient)
        assert np.isnan(moved.satellites.statistic).all()
        assert np.isnan(seen.verdict.statistic).all()
        assert not seen.monitored.any()
        for result in (
            moved.satellites,
            one.satellites,
            both.published,
            both.full_rank,
            away,
            low.satellites,
            seen.verdict,
        ):
            assert not result.failed.any()
        assert not low.channels.failed.any()
