"""Fronts that overtake an aircraft before they reach the station: closed forms against stepped filters."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.divergence import AIRBORNE, divergence_step, initial_divergence
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_studies.ccd.smoothed_error import LONG_BEFORE, Smoothing, StudyError
from gbas_studies.faults.cases import front_cases
from gbas_studies.faults.front_exposure import Encounter, front_limit, slope_error_s

FRONT_MPS, RADIUS_M, T_S = 100.0, 450.0, 0.5


def delays(gradient, time_s, distance_m):
    """Slant delay at a distance before the reference point; the edge touches the first antenna at 0 s."""
    edge_m = RADIUS_M - FRONT_MPS * time_s
    return gradient * np.maximum(0.0, distance_m - edge_m)


def stepped(delay_m, begin):
    """30 s smoothed error of a delay (code +, carrier -) by the suite's filter, which starts at a sample."""
    params = SmoothingParams(tau_s=(30.0,), start="elapsed")
    state, none = initial_smoothing(params, n_sats=1), np.zeros(1, dtype=bool)
    out = np.full(len(delay_m), np.nan)
    for number in range(begin, len(delay_m)):
        dt_s = T_S if number > begin else np.nan
        state, value = smooth_step(state, delay_m[[number]], -delay_m[[number]], none, dt_s, params)
        out[number] = value[0, 0]
    return out


def error_of(gradient, time_s, speed_mps, at_s, distance_m, filter_start_s, receiver_m):
    """Differential error over time of an aircraft that is at a distance at a time, against one receiver."""
    place_m = distance_m - speed_mps * (time_s - at_s)
    begin = int(np.searchsorted(time_s, filter_start_s - 1e-9))
    air = stepped(delays(gradient, time_s, place_m), begin)
    return air - stepped(delays(gradient, time_s, np.full_like(time_s, receiver_m)), 0)


def test_slope_error_is_the_textbooks():
    """Continuous filter: r (t - 2 tau (1 - exp(-t / tau))); settled, the delay less 2 tau r."""
    sample = np.arange(0.0, 1200.0)
    time_s = T_S * sample
    ours = slope_error_s(np.array(LONG_BEFORE), sample, Smoothing())
    # The discrete filter lags by T less, which counts twice.
    assert ours == pytest.approx(time_s - 60.0 * (1.0 - np.exp(-time_s / 30.0)), abs=2.0 * T_S)
    assert ours[-1] == pytest.approx(time_s[-1] - 2.0 * 29.5, abs=1e-6)
    assert ours.min() == pytest.approx(30.0 * (np.log(2.0) - 1.0), abs=0.5)  # at t = tau ln 2


@pytest.mark.parametrize("acquiring", [True, False])
@pytest.mark.parametrize("gradient", [600e-6, 2000e-6])
def test_the_aircraft_found_passes_the_limit_then_and_not_before(gradient, acquiring):
    found = front_limit(gradient, FRONT_MPS, Smoothing(), Encounter(acquiring=acquiring))
    met_s = found.since_touch_s - found.on_slope_s
    assert abs(found.distance_m) <= 6200.0 + 1e-6
    begin_s = met_s - 200.0
    time_s = np.arange(begin_s, found.since_touch_s + T_S / 2.0, T_S)
    filter_start_s = begin_s if not acquiring else met_s + found.filter_start_s
    sizes = []
    for receiver_m in (-RADIUS_M, RADIUS_M):
        error = error_of(
            gradient, time_s, found.aircraft_mps, found.since_touch_s, found.distance_m, filter_start_s, receiver_m
        )
        sizes.append(abs(error[-1]))
        # One sample of drift is r T; before the delay to incorporation nobody uses the range.
        used = (time_s >= filter_start_s + 49.5 - 1e-9) & (time_s < found.since_touch_s - 0.75)
        assert np.nanmax(np.abs(error[used]), initial=0.0) < 2.75 + 1e-9
    assert max(sizes) > 2.75
    assert max(sizes) < 2.75 + 2.0 * gradient * FRONT_MPS * T_S


def test_no_aircraft_of_many_is_earlier():
    """Aircraft of all speeds and places, half of them fast and near, by the filters themselves in the geometry."""
    rng, gradient = np.random.default_rng(2), 2000e-6
    limit = front_limit(gradient, FRONT_MPS, Smoothing()).since_touch_s
    earliest = np.inf
    time_s = np.arange(-250.0, 30.0, T_S)
    count = 1000
    speed = np.where(np.arange(count) % 2, rng.uniform(55.0, 85.0, count), rng.uniform(80.0, 85.0, count))
    nearest_m = np.where(np.arange(count) % 2, rng.uniform(-3e3, 2e4, count), rng.uniform(2e3, 6e3, count))
    place_m = nearest_m - speed * time_s[:, np.newaxis]
    delay_m = delays(gradient, time_s[:, np.newaxis], place_m)
    begin = rng.integers(0, len(time_s) - 100, count)
    params = SmoothingParams(tau_s=(30.0,), start="elapsed")
    state, none = initial_smoothing(params, n_sats=count), np.zeros(count, dtype=bool)
    for number in range(len(time_s)):
        running = number >= begin
        code = np.where(running, delay_m[number], np.nan)
        state, value = smooth_step(state, code, -code, none, T_S if number else np.nan, params)
        used = (number - begin >= 99) & (np.abs(place_m[number]) <= 6200.0)
        if time_s[number] < 0.0 and (np.abs(value[0]) > 2.75)[used].any():
            earliest = min(earliest, float(time_s[number]))
    assert limit - 1e-9 <= earliest
    assert earliest < limit + 4.0  # five hundred of them come close to the worst


def test_farther_aircraft_and_steeper_fronts_are_earlier():
    times = [front_limit(each, FRONT_MPS, Smoothing()).since_touch_s for each in (300e-6, 600e-6, 2000e-6)]
    assert times[0] > times[1] > times[2]
    assert times[0] > 0.0 > times[2]  # 300 mm/km reaches the station first, 2000 mm/km the aircraft
    far = front_limit(2000e-6, FRONT_MPS, Smoothing(), Encounter(farthest_m=11_000.0)).since_touch_s
    # Before the touch only the place matters: 4.8 km more at the front's speed.
    assert far == pytest.approx(times[2] - 48.0, abs=1e-9)
    assert front_limit(1e-6, FRONT_MPS, Smoothing()).since_touch_s == np.inf
    with pytest.raises(StudyError, match="faster than every aircraft"):
        front_limit(300e-6, 80.0, Smoothing())


def test_the_airborne_monitor_alarms_when_its_filters_do():
    found = front_limit(2000e-6, FRONT_MPS, Smoothing(), Encounter(acquiring=False))
    met_s = found.since_touch_s - found.on_slope_s
    state, none = initial_divergence(AIRBORNE, n_sats=1), np.zeros(1, dtype=bool)
    rate_mps, alarm_s = 2000e-6 * (FRONT_MPS - found.aircraft_mps), np.inf
    for number in range(-1000, 1000):
        cmc_m = np.array([2.0 * rate_mps * T_S * max(number, 0)])
        state, _, filtered = divergence_step(state, cmc_m, none, T_S if number > -1000 else np.nan, AIRBORNE)
        if filtered[0] > 0.0125:
            alarm_s = T_S * number
            break
    assert found.airborne_alarm_s - met_s == pytest.approx(alarm_s, abs=1e-9)
    assert found.airborne_alarm_s < found.since_touch_s


def test_the_campaigns_limits_are_these():
    cases = list(front_cases((2000e-6,)))
    assert cases[0].limit_s == front_limit(2000e-6, 100.0, Smoothing()).since_touch_s < 0.0
