"""Low power: averages against loops, drops found in time, false alarms as stated, and nothing learnt away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.expected_power import (
    N_BINS,
    PowerExpectationParams,
    initial_power_expectation,
    minimum_from_expectation,
    power_expectation_step,
)
from loop_power import loop_average, loop_minimum, mean_of
from monitor_scenes import STATION, recorded_pair

PARAMS = STATION.expected_power_monitor()
HERE = np.isin(np.arange(N_SATS), [0, 3, 5, 9, 12, 17, 33, 37, 40, 45, 60])
ELEVATION = np.where(HERE, np.radians(6.0 + 1.3 * np.arange(N_SATS)), np.nan)
DUE = np.broadcast_to(HERE, (4, N_SATS)).copy()


def run(values, *, params=PARAMS, dt_s=None, due=DUE, state=None):
    state, results = state or initial_power_expectation(values.shape[1], params), []
    for number, value in enumerate(values):
        interval = (np.nan if number == 0 else 0.5) if dt_s is None else dt_s[number]
        state, result = power_expectation_step(state, value, due[: values.shape[1]], ELEVATION, interval, params)
        results.append(result)
    return state, results


def level(epochs, *, receivers=4, above_db=5.0):
    """C/N0 (epochs, R, N_BANDS, N) a constant above the table."""
    table = [[loop_minimum(each, PARAMS.elevation_rad, row) if np.isfinite(each) else np.nan for each in ELEVATION]
             for row in PARAMS.minimum_dbhz]  # fmt: skip
    return np.broadcast_to(np.array(table) + above_db, (epochs, receivers, N_BANDS, N_SATS)).copy()


def test_as_loops_say():
    rng = np.random.default_rng(1)
    values = level(25) + rng.normal(0.0, 3.0, (25, 4, N_BANDS, N_SATS))
    values[rng.random(values.shape) < 0.4] = np.nan
    dt = np.concatenate([[np.nan], rng.choice([0.5, 1.0, 4.0], 24, p=[0.7, 0.2, 0.1])])
    times = np.nancumsum(dt)
    _, results = run(values, dt_s=dt)
    final = results[-1]
    for place, band in enumerate(PARAMS.bands):
        for satellite in np.flatnonzero(HERE):
            averages = []
            for receiver in range(4):
                series = [None if np.isnan(value) else float(value) for value in values[:, receiver, band, satellite]]
                averages.append(loop_average(series, times, PARAMS.average_s, PARAMS.max_gap_s))
                found = -final.channels.statistic[receiver, place, satellite]
                expected = np.nan if averages[-1] is None else averages[-1]
                np.testing.assert_allclose(found, expected, rtol=1e-12)
            np.testing.assert_allclose(-final.satellites.statistic[place, satellite], mean_of(averages), rtol=1e-12)
            minimum = loop_minimum(ELEVATION[satellite], PARAMS.elevation_rad, PARAMS.minimum_dbhz[band])
            np.testing.assert_allclose(-final.satellites.threshold[place, satellite], minimum, rtol=1e-12)


def test_false_alarms_are_those_of_the_formula():
    """A table made from expectation and sigma: tails of the average counted where they can be."""
    rng = np.random.default_rng(2)
    sigma, receivers, probability = 1.5, 3, 0.3
    minimum = float(minimum_from_expectation(42.0, sigma, receivers, probability=probability))
    params = PowerExpectationParams(
        elevation_rad=(0.1,),
        average_s=0.1,
        channel_margin_db=30.0,
        minimum_l1_dbhz=(minimum,),
        minimum_l2_dbhz=(minimum,),
        minimum_l5_dbhz=(minimum,),
    )
    values = 42.0 + sigma * rng.normal(size=(3000, receivers, N_BANDS, N_SATS))
    _, results = run(values, params=params)
    failed = np.array([each.satellites.failed[0] for each in results])[:, HERE].mean()
    # 0.3 in 30 epochs is 0.01 an epoch; 33000 samples: +-6 % (1 sigma)
    assert failed == pytest.approx(0.01, rel=0.2)


@pytest.mark.parametrize(("drop_db", "seconds"), [(10.5, 0.0), (7.0, 0.5), (5.4, 1.5)])
def test_low_power_of_a_satellite_is_found_in_time(drop_db, seconds):
    """Five above the table; weights of a half: 1/2, 3/4, 7/8 and 15/16 of a drop after 0, 0.5, 1 and 1.5 s."""
    values = level(30)
    values[20:, :, :, 5] -= drop_db
    _, results = run(values)
    failed = np.array([each.satellites.failed.any(axis=0) for each in results])
    assert not failed[:20].any()
    assert failed[20:, 5].argmax() * 0.5 <= seconds
    assert failed[20:, 5].any()
    assert not np.delete(failed, 5, axis=1).any()


def test_one_channel_low():
    values = level(30)
    values[20:, 2, L1, 5] -= 12.0  # 3 of the mean of four, 12 of its own, where 5 + 4 are allowed
    _, results = run(values)
    assert not np.array([each.satellites.failed for each in results]).any()
    assert np.argwhere(results[-1].channels.failed[:, 0]).tolist() == [[2, 5]]


@pytest.mark.parametrize("receivers", [1, 2])
def test_few_receivers(receivers):
    values = level(10, receivers=receivers)
    values[5:, :, L5, 9] -= 20.0
    _, results = run(values)
    assert np.argwhere(results[-1].satellites.failed).tolist() == [[1, 9]]


def test_missing_is_not_good():
    values = level(5)
    values[-1, 1, L1, 5] = np.nan
    values[-1, :, L1, 9] = np.nan
    values[-1, :, L5, 12] = np.nan  # due on L5 only where it is measured
    _, results = run(values)
    assert np.argwhere(results[-1].channels.failed).tolist() == [
        [0, 0, 9], [1, 0, 5], [1, 0, 9], [2, 0, 9], [3, 0, 9],
    ]  # fmt: skip
    assert np.argwhere(results[-1].satellites.failed).tolist() == [[0, 9]]
    _, results = run(np.full_like(values, np.nan))
    assert (results[-1].satellites.failed[0] == HERE).all()


def test_what_is_learnt_raises_the_minimum_and_never_lowers_it():
    params = replace(PARAMS, learn=True, learnt_after_s=60.0, drop_db=4.0)
    state, results = run(level(200, above_db=9.0), params=params)
    # 9 above the table; 4 below that is 5 above it (the bins' width moves the table by up to 5 deg x 0.3 dB/deg)
    raised = -results[-1].satellites.threshold[0, HERE] + results[-1].channels.threshold[0, 0, HERE] - 4.0
    assert raised == pytest.approx(5.0, abs=0.6)
    dropped = level(10, above_db=9.0)
    dropped[..., 5] -= 7.0  # still 2 above the table
    _, results = run(dropped, params=params, state=state, dt_s=np.full(10, 0.5))
    assert np.flatnonzero(results[-1].satellites.failed.any(axis=0)).tolist() == [5]
    assert not run(dropped)[1][-1].satellites.failed.any()
    # A fade over a long time is learnt, but ends at the table.
    fading = level(3000, above_db=9.0)
    fading -= np.linspace(0.0, 12.0, 3000)[:, None, None, None]
    _, results = run(fading, params=replace(params, learn_s=200.0))
    assert results[-1].satellites.failed[0, HERE].all()


def test_learning_is_a_mean_over_a_bin():
    params = replace(PARAMS, learn=True)
    rng = np.random.default_rng(3)
    values = level(50, above_db=20.0) + rng.normal(0.0, 1.0, (50, 4, N_BANDS, N_SATS))
    state, _ = run(values, params=params)
    bins = np.floor(np.degrees(ELEVATION) / 5.0)
    for number in range(N_BINS):
        inside = bins == number
        if inside.any():
            expected = values[1:, 2, L5][:, inside].mean()  # the first epoch has no interval
            assert state.learnt[0, 2, 1, number] == pytest.approx(expected, rel=1e-12)
            assert state.learnt[1, 2, 1, number] == pytest.approx(24.5)


def test_recorded_pair_has_power(data_dir):
    """Two mosaic-X5 on small antennas, 2024: the only recorded pair with C/N0."""
    _, epochs = recorded_pair("mosaic_base_rover", data_dir, 120)
    state = initial_power_expectation(2, PARAMS)
    judged = 0
    for number, epoch in enumerate(epochs):
        due = np.isfinite(epoch.carrier_m[:, L1]) & (epoch.elevation_rad >= np.radians(5.0))
        state, result = power_expectation_step(
            state, epoch.cn0_dbhz, due, epoch.elevation_rad, np.nan if number == 0 else 1.0, PARAMS
        )
        assert not result.satellites.failed.any()
        judged += int(np.isfinite(result.satellites.statistic).sum())
    assert judged > 1500


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"elevation_rad": (0.3, 0.2)}, "elevation_deg is not one node or more, rising"),
        ({"minimum_l2_dbhz": (30.0,)}, "minimum_l2_dbhz"),
        ({"average_s": 0.0}, "average_s"),
        ({"channel_margin_db": -1.0}, "channel_margin_db"),
        ({"bands": (0, 0)}, "bands"),
    ],
)
def test_bad_parameters(changes, word):
    with pytest.raises(ValueError, match=word):
        PowerExpectationParams(**changes)
