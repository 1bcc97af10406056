"""Step, rate and acceleration of carriers: against polynomial fits, in noise, with faults, and with data missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5
from gbas_ground.channels.predicted_ranges import site_of
from gbas_ground.monitors.carrier_acceleration import (
    FEWEST_OTHERS,
    CarrierAccelerationParams,
    Carriers,
    carrier_acceleration_step,
    fewest_others,
    initial_carrier_acceleration,
)
from gbas_ground.monitors.carrier_detectability import detectable_fault, fault_response
from gbas_ground.monitors.double_difference import Troposphere, baselines_of, carrier_residual_m
from loop_acceleration import loop_statistics
from monitor_scenes import STATION, recorded_pair

PARAMS = STATION.carrier_acceleration_monitor()
BANDS, T = 2, 0.5
HERE = np.isin(np.arange(N_SATS), [0, 3, 5, 9, 12, 17, 20, 30, 33, 37, 40, 45, 51, 60])
ELEVATION = np.where(HERE, np.radians(8.0 + 1.1 * np.arange(N_SATS)), np.nan)
SIGMA = PARAMS.noise.sigma_m(ELEVATION, PARAMS.bands)
NEVER = np.zeros((4, BANDS, N_SATS), dtype=bool)


def world(rng, epochs, *, receivers=4, noise=1.0, interval_s=T):
    """Residuals (epochs, R, F, N): ambiguities, clocks that wander and step, slow atmosphere, white noise."""
    shape = (epochs, receivers, BANDS, N_SATS)
    clock = rng.normal(0.0, 50.0, (epochs, receivers, BANDS, 1)).cumsum(axis=0)
    rate = rng.uniform(-0.02, 0.02, (1, 1, 1, N_SATS)) * np.arange(epochs)[:, None, None, None] * interval_s
    value = rng.normal(0.0, 1e6, shape[1:]) + clock + rate + noise * SIGMA * rng.normal(size=shape)
    return np.where(HERE, value, np.nan)


def run(values, *, params=PARAMS, restarted=None, due=None, dt_s=None, shift=None):
    """State and results of each epoch."""
    n_epochs, receivers = values.shape[:2]
    state, results = initial_carrier_acceleration(receivers, params), []
    for number in range(n_epochs):
        interval = np.nan if number == 0 else (T if dt_s is None else dt_s[number])
        wanted = np.tile(HERE, (receivers, 1)) if due is None else due
        late = wanted if number >= params.least_points - 1 else np.zeros_like(wanted)
        slips = NEVER[:receivers] if restarted is None else restarted[number]
        seen = Carriers(values[number], slips, late, ELEVATION, None if shift is None else shift[number])
        state, result = carrier_acceleration_step(state, seen, interval, params)
        results.append(result)
    return state, results


def signed(history, age_s, receivers):
    sigma = np.broadcast_to(SIGMA, (receivers, BANDS, N_SATS))
    return loop_statistics(history, age_s, sigma)


def test_as_polynomial_fits_say():
    """Gaps, late starts, uneven intervals; nothing fails, so that every complete satellite is in the set."""
    rng = np.random.default_rng(1)
    values = world(rng, 14)
    values[3:6, 1, :, 5] = np.nan  # a gap shorter than the longest
    values[:8, 2, 1, 9] = np.nan  # a late start
    values[9, 3] = np.nan  # a receiver that misses an epoch
    dt = np.array([np.nan, 0.5, 0.5, 0.5, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1.0, 0.5, 0.5])
    state, results = run(values, dt_s=dt)
    expected = signed(state.residual_m, state.age_s, 4)
    assert len(expected) > 100
    for (receiver, band, satellite), numbers in expected.items():
        found = results[-1].channels.statistic[:, receiver, band, satellite]
        # Ambiguities of 1e6 m have 1e-10 m of rounding, and the fits amplify it.
        np.testing.assert_allclose(found, np.abs(numbers), rtol=1e-6, atol=1e-7)
    there = np.isfinite(results[-1].channels.statistic[0])
    assert there.sum() == len(expected)


def test_a_parabola_is_its_own_acceleration():
    """Without noise the fit is exact: c for the acceleration, and the slope in the middle of the window."""
    values = world(np.random.default_rng(2), 12, noise=0.0)
    time = np.arange(12) * T
    values[..., 5] += (0.5 * 0.004 * time**2)[:, None, None]
    params = replace(PARAMS, natural=(10.0, 10.0, 10.0))
    _, results = run(values, params=params)
    plain = run(world(np.random.default_rng(2), 12, noise=0.0), params=params)[1]
    statistic, before = results[-1].channels.statistic[..., 5], plain[-1].channels.statistic[..., 5]
    np.testing.assert_allclose(statistic[2], 0.004, atol=1e-6)
    # 14 satellites have constant rates, so no acceleration of their own
    assert np.nanmax(before[2]) < 1e-6


@pytest.mark.parametrize("fault", ["step", "ramp", "acceleration"])
def test_response_is_what_the_monitor_does_with_the_fault(fault):
    size, onset, epochs = 0.01, 20, 24
    age = np.maximum((np.arange(epochs) - onset) * T, 0.0)
    signal = {"step": (np.arange(epochs) >= onset) * 1.0, "ramp": age, "acceleration": 0.5 * age**2}[fault] * size
    values = world(np.random.default_rng(3), epochs, noise=0.0)
    values = np.where(HERE, 0.0 * values, np.nan)
    values[..., 5] += signal[:, None, None]
    _, results = run(values, params=replace(PARAMS, natural=(10.0, 10.0, 10.0)))
    for number in range(onset, epochs):
        expected = np.abs(fault_response(fault, (number - onset) * T, PARAMS)) * size
        np.testing.assert_allclose(results[number].channels.statistic[:, 0, 0, 5], expected, atol=1e-12)


def test_noise_is_as_the_thresholds_say_and_false_alarms_within_the_budget():
    """Variance and rate by simulation, with a budget that 1500 epochs can count."""
    rng = np.random.default_rng(4)
    params = replace(PARAMS, common=(0.0, 0.0, 0.0), natural=(0.0, 0.03, 0.0), p_false_alarm=0.03)
    values = world(rng, 1500, receivers=3)
    _, results = run(values, params=params)
    settled = results[12::10]  # a tenth: windows that hardly overlap
    ratio = np.array([(each.channels.statistic / each.channels.threshold)[[0, 2]] for each in settled])[..., HERE]
    k = params.multiplier(3)
    # rms of |x|/threshold is 1/k where the threshold is k sigma; 1500 * 84 samples: 1 %, and the set's weights another
    np.testing.assert_allclose(np.sqrt((ratio**2).mean(axis=(0, 2, 3, 4))) * k, 1.0, atol=0.03)
    averaged = np.array([(each.satellites.statistic / each.satellites.threshold)[[0, 2]] for each in settled])[
        ..., HERE
    ]
    np.testing.assert_allclose(np.sqrt((averaged**2).mean(axis=(0, 2, 3))) * k, 1.0, atol=0.05)
    excluded = np.array([each.failed_satellites | each.failed_channels.any(axis=0) for each in results[12:]])[:, HERE]
    # Budget of 15 s over 30 epochs; rates of 0.03 m/s never alarm, which leaves two statistics of three.
    expected = 0.03 / 30.0
    assert 0.1 * expected < excluded.mean() < expected


@pytest.mark.parametrize("fault", ["step", "ramp", "acceleration"])
@pytest.mark.parametrize("satellite", [0, 60])
def test_a_satellite_fault_is_found_in_time_and_blamed_on_the_satellite(fault, satellite):
    """The detectable size, P_md 1e-3: found within 1.5 s by every one of 40 runs, and nobody else excluded."""
    rng = np.random.default_rng(5)
    clock = 1.0 / np.sum(1.0 / SIGMA[0][HERE & (np.arange(N_SATS) != satellite)] ** 2)
    sigma = float(np.sqrt(SIGMA[0, satellite] ** 2 + clock))
    size = detectable_fault(fault, 1.5, sigma, PARAMS, n_receivers=4, k_md=float(norm.isf(1e-3)))
    onset = 15
    age = np.maximum((np.arange(19) - onset) * T, 0.0)
    signal = {"step": (np.arange(19) >= onset) * 1.0, "ramp": age, "acceleration": 0.5 * age**2}[fault] * size
    for _ in range(40):
        values = world(rng, 19)
        values[..., satellite] += signal[:, None, None]
        _, results = run(values)
        failed = np.array([each.failed_satellites for each in results])
        assert not failed[:onset].any()
        assert failed[onset:, satellite].any()  # 15 to 18 are 0 to 1.5 s
        assert not np.delete(failed, satellite, axis=1).any()


@pytest.mark.parametrize("size", [0.05, 1.0, 1000.0])
def test_a_large_fault_is_not_seen_on_others_through_the_clock(size):
    values = world(np.random.default_rng(6), 15)
    values[12:, :, :, [5, 40]] += size
    _, results = run(values)
    for result in results[12:]:
        assert set(np.flatnonzero(result.failed_satellites).tolist()) <= {5, 40}
    assert results[12].failed_satellites[[5, 40]].all()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("size", [0.06, 0.3])
def test_a_minority_of_faults_leaves_the_others_alone(count, size):
    """Up to six of fourteen, the lowest: the mean moves the high ones, with their small sigmas, further over theirs."""
    values = world(np.random.default_rng(count), 15)
    faulty = np.flatnonzero(HERE)[:count]
    values[12:, :, :, faulty] += size
    _, results = run(values)
    assert np.flatnonzero(results[12].failed_satellites).tolist() == faulty.tolist()
    assert not any(np.delete(each.failed_satellites, faulty).any() for each in results)


def test_one_channel_alone_is_the_channels_fault():
    values = world(np.random.default_rng(7), 15)
    values[12:, 2, 0, 5] += 0.2
    _, results = run(values)
    assert np.argwhere(results[12].failed_channels).tolist() == [[2, 5]]
    assert not results[12].failed_satellites.any()
    values[12:, 3, 0, 5] += 0.2
    _, results = run(values)
    assert np.flatnonzero(results[12].failed_satellites).tolist() == [5]


def test_channels_that_are_not_due_do_not_judge():
    """Two bad channels are the satellite's fault, unless nobody uses them."""
    values = world(np.random.default_rng(13), 15)
    values[12:, 2:, 0, 5] += 0.2
    due = np.broadcast_to(HERE, (4, N_SATS)).copy()
    due[2:, 5] = False
    _, results = run(values, due=due)
    assert not np.array([each.failed_satellites for each in results]).any()
    due[:, 5] = False
    _, results = run(values, due=due)
    assert not results[12].failed_satellites.any()
    assert results[12].satellites.statistic[0, 0, 5] > results[12].satellites.threshold[0, 0, 5]  # to be seen


@pytest.mark.parametrize("receivers", [1, 2])
def test_with_one_receiver_or_two_it_is_the_satellite(receivers):
    values = world(np.random.default_rng(8), 15, receivers=receivers)
    values[12:, 0, 0, 5] += 0.2
    _, results = run(values)
    assert not np.array([each.failed_satellites for each in results[:12]]).any()
    assert np.flatnonzero(results[12].failed_satellites).tolist() == [5]


def test_missing_is_not_good():
    values = world(np.random.default_rng(9), 15)
    values[14, 1, 0, 5] = np.nan  # due and not there
    values[14, :, 0, 9] = np.nan
    values[14, :, 1, 12] = np.nan  # the second band is due only where it can be judged
    _, results = run(values)
    assert np.argwhere(results[14].failed_channels).tolist() == [[0, 9], [1, 5], [1, 9], [2, 9], [3, 9]]
    assert np.flatnonzero(results[14].failed_satellites).tolist() == [9]
    values = world(np.random.default_rng(9), 15)
    values[:13, :, 1, 12] = np.nan  # and one that has just come
    assert not np.array([each.failed_satellites for each in run(values)[1]]).any()
    _, results = run(np.full_like(values, np.nan))
    assert (results[-1].failed_satellites == HERE).all()
    assert (results[-1].failed_channels == HERE).all()
    # Three satellites do not make a clock and leave something to test.
    few = np.where(np.isin(np.arange(N_SATS), [0, 3, 5]), values, np.nan)
    _, results = run(few)
    assert results[-1].failed_satellites[[0, 3, 5]].all()


def test_restarts_and_gaps():
    values = world(np.random.default_rng(10), 20)
    values[14:, :, :, 5] += 100.0  # a slip that is told
    restarted = np.zeros((20, *NEVER.shape), dtype=bool)
    restarted[14, :, :, 5] = True
    _, results = run(values, restarted=restarted)
    statistic = np.array([each.channels.statistic[0, 0, 0, 5] for each in results])
    assert np.isnan(statistic[14:18]).all()  # five epochs are needed anew
    assert statistic[18] < 0.05
    assert all(each.failed_satellites[5] for each in results[14:18])  # due, and not judged
    # The whole station misses 3 s: bridged. 4 s: everything starts anew.
    values = world(np.random.default_rng(11), 12)
    for gap, judged in ((3.0, True), (4.0, False)):
        dt = np.full(12, T)
        dt[11] = gap
        _, results = run(values, dt_s=dt)
        # after 3 s the window of 5 s holds five epochs of those before
        assert np.isfinite(results[11].channels.statistic[0][..., HERE]).all() == judged
        assert results[11].failed_satellites[HERE].all() != judged


def test_a_new_ephemeris_is_no_step():
    values = world(np.random.default_rng(12), 15)
    shift = np.zeros((15, 4, N_SATS))
    shift[12, :, 5] = 0.36
    values[12:, :, :, 5] += 0.36
    _, results = run(values, shift=shift)
    assert not np.array([each.failed_satellites for each in results]).any()
    _, results = run(values)
    assert results[12].failed_satellites[5]


@pytest.mark.parametrize(("name", "bands"), [("upc1_upc2", (L1, L2)), ("mosaic_base_rover", (L1, L5))])
def test_recorded_pairs_have_no_false_alarm(data_dir, name, bands):
    station, epochs = recorded_pair(name, data_dir, 500)
    params = replace(PARAMS, bands=bands, interval_s=1.0)
    site = site_of(station).positions_m
    baselines, air = baselines_of(site[:2], site[2]), Troposphere(refractivity=330.0, scale_height_m=7900.0)
    state, before, judged, largest = initial_carrier_acceleration(2, params), None, 0, 0.0
    for epoch in epochs:
        delay = air.delay_m(epoch.elevation_rad, epoch.azimuth_rad, baselines.place_m)
        residual = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, delay, bands)
        dt = np.nan if before is None else (epoch.key - before) / 1000.0
        before = epoch.key
        restarted = np.ascontiguousarray(epoch.restarted[:, list(bands)])
        due = np.zeros((2, N_SATS), dtype=bool)
        seen = Carriers(residual, restarted, due, epoch.elevation_rad, epoch.shift_m)
        state, result = carrier_acceleration_step(state, seen, dt, params)
        high = epoch.elevation_rad >= np.radians(5.0)
        ratio = (result.channels.statistic / result.channels.threshold)[..., high]
        judged += int(np.isfinite(ratio).sum())
        largest = max(largest, float(np.max(ratio, initial=0.0, where=np.isfinite(ratio))))
    assert judged > 5_000
    assert largest < 1.0
    assert largest > 0.2  # thresholds are not idle: six sigma of noise that is about right


def test_detection_is_far_below_what_hurts():
    """1.5 s after its onset, and another 1.5 s until the corrections that are sent reach the user, an acceleration that
    is just found has moved the satellite by less than the 0.75 m at which the GAST D limit begins."""
    largest = detectable_fault("acceleration", 1.5, 0.008, PARAMS, n_receivers=2, k_md=float(norm.isf(1e-5)))
    assert 0.5 * largest * 3.0**2 < 0.75
    assert detectable_fault("step", 0.0, 0.008, PARAMS, n_receivers=2, k_md=float(norm.isf(1e-5))) < 0.75


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"bands": ()}, "bands"),
        ({"least_points": 3}, "least_points"),
        ({"least_points": 11}, "least_points"),
        ({"min_satellites": 1}, "min_satellites"),
        ({"window_s": float("nan")}, "window_s"),
        ({"natural": (0.0, -1.0, 0.0)}, "natural"),
        ({"p_false_alarm": 0.0}, "p_false_alarm"),
    ],
)
def test_bad_parameters(changes, word):
    with pytest.raises(ValueError, match=word):
        CarrierAccelerationParams(**changes)


def test_fewest_others_follow_from_the_budget():
    """One fault among all others has to be reckoned with, two at once not: two are left when the faulty one is out.

    In 15 s: 35 others at 1e-5 an hour make 1.5e-6, more than 1e-8; two of them 1e-12, less.
    """
    assert (
        fewest_others(1e-8) == FEWEST_OTHERS == PARAMS.min_satellites == CarrierAccelerationParams().min_satellites == 3
    )
    assert fewest_others(1e-5) == 2
    assert fewest_others(1e-13) == 4
