"""Monitors of signals in the station: each fault is excluded by the monitor meant for it, and only its satellite is."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.parameters import ParameterError
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_ground.monitors.carrier_acceleration import CarrierAccelerationParams
from gbas_ground.monitors.sigma_monitor import SigmaMonitorParams
from gbas_ground.params import watching
from gbas_msgs_py.codes import ChannelState, ExclusionCause, MonitorState, Signal
from gbas_msgs_py.monitors import TESTS
from gbas_msgs_py.tables import MONITORS
from ground_runs import half_seconds, params, run
from synthetic_ranges import TOW_S, truth

G02 = SAT_INDEX["G02"]
ONSET_S = 10.0


def on_g02(size, receivers=slice(None), count=4):
    """An error of G02 that begins at the onset; `size` is a function of the time since."""

    def error(second):
        result = np.zeros((count, N_SATS))
        if second >= ONSET_S:
            result[receivers, G02] = size(second - ONSET_S)
        return result

    return error


def excluded_by(out, satellite="G02"):
    """Causes of the first exclusion of the satellite, and seconds since the onset."""
    told = [event for event in out.events if event.kind == "exclusion" and event.subject == satellite]
    assert told, "nothing was excluded"
    first = min(event.tow_s for event in told)
    return {event.cause for event in told if event.tow_s == first}, told[0]


def states_of(out, monitor):
    """States of a monitor, ``(epochs, N)``."""
    return np.array([each.states(monitor) for each in out.statistics])


def test_code_that_drifts_away_from_its_carrier():
    """0.1 m/s: 1 - (1 + a n)(1 - a)^n reaches 0.233 after 28 s."""
    alpha = 0.5 / 30.0
    expected = next(n for n in range(1000) if 0.1 * (1.0 - (1.0 + alpha * n) * (1.0 - alpha) ** n) > 0.0233)
    drift = on_g02(lambda since: 0.1 * since)
    out = run(truth(4), params(4), half_seconds(100), code_error_m=drift, carrier_error_m=lambda _: 0.0)
    causes, event = excluded_by(out)
    assert causes == {"code_carrier_divergence"}
    # the ramp's first epoch is the onset itself, with nothing on it yet
    assert (event.tow_s - TOW_S - ONSET_S) / 0.5 == pytest.approx(expected, abs=1.0)
    assert event.threshold == 0.0233
    assert event.value > event.threshold
    assert {each.subject for each in out.events if each.kind == "exclusion"} == {"G02"}


def first_beyond_s(size, threshold_m):
    """When the newest of ten epochs is further than the threshold from the line through the nine before it."""
    for epoch in range(100):
        times = 0.5 * (epoch - np.arange(10))
        values = [size(time) if time >= 0.0 else 0.0 for time in times]
        if abs(values[0] - np.polyval(np.polyfit(times[1:], values[1:], 1), times[0])) > threshold_m:
            return times[0]
    raise AssertionError("never")


@pytest.mark.parametrize("size", [lambda since: 0.08, lambda since: 0.05 * since, lambda since: 0.01 * since**2])
def test_carriers_that_do_not_go_on_as_they_went(size):
    """Steps, ramps and accelerations are first steps: against the line of the epochs before, long before a fit sees."""
    error = on_g02(size)
    out = run(truth(4), params(4), half_seconds(60), code_error_m=error, carrier_error_m=error)
    found, event = excluded_by(out)
    assert found == {"carrier_step"}
    assert event.tow_s - TOW_S - ONSET_S == first_beyond_s(size, event.threshold)
    assert event.value > event.threshold


def test_one_channel_that_steps_is_excluded_alone():
    error = on_g02(lambda since: 0.08, receivers=1)
    out = run(truth(4), params(4), half_seconds(40), code_error_m=error, carrier_error_m=error)
    told = {(event.subject, event.cause) for event in out.events if event.kind == "exclusion"}
    assert told == {("rr2/G02", "carrier_acceleration")}
    assert out.integrity[-1].state[G02] == ChannelState.USABLE


def test_carriers_that_differ_over_a_baseline():
    """A third of a wavelength on one of two receivers, since before the start: nothing but the gradient shows it."""
    shifted = np.zeros((2, N_SATS))
    shifted[1, G02] = 0.06
    station = params(2, atmosphere__refractivity=16.0)  # the ranges have no troposphere
    out = run(truth(2), station, half_seconds(30), code_error_m=lambda _: 0.0, carrier_error_m=lambda _: shifted)
    causes, event = excluded_by(out)
    assert causes == {"ionosphere_gradient", "ephemeris_residual"}
    assert event.value == pytest.approx(0.06, abs=3e-4)  # the thinnest air a station can have
    assert {each.subject for each in out.events if each.kind == "exclusion"} == {"G02"}


def test_a_monitor_that_only_watches_fails_and_excludes_nothing():
    drift = on_g02(lambda since: 0.1 * since)
    station = params(4, ccd__exclude=False)
    out = run(truth(4), station, half_seconds(100), code_error_m=drift, carrier_error_m=lambda _: 0.0)
    assert states_of(out, "ccd")[-1, G02] == MonitorState.FAILED
    assert out.integrity[-1].state[G02] == ChannelState.USABLE
    assert not [event for event in out.events if event.kind == "exclusion"]


def test_a_satellite_that_cannot_be_judged_yet_is_not_used():
    out = run(truth(4), params(4, ccd__settle_s=12.0), half_seconds(40))
    cause, state = out.array("cause")[:, G02], out.array("state")[:, G02]
    seconds = np.array(out.seconds)
    between = (seconds >= 5.0) & (seconds < 12.0)
    assert (cause[between] == ExclusionCause.UNMONITORED).all()
    assert (state[between] == ChannelState.SETTLING).all()
    assert (states_of(out, "ccd")[between, G02] == MonitorState.NOT_MONITORED).all()
    assert (state[seconds >= 12.0] == ChannelState.USABLE).all()


def test_data_too_slow_for_a_required_monitor_are_never_used():
    """Every 4 s: the acceleration monitor has two epochs in its window of 5 s."""
    station = params(4, smoothing__max_gap_s=10.0)
    out = run(truth(4), station, 4.0 * np.arange(20))
    assert (out.array("state")[:, G02] != ChannelState.USABLE).all()
    assert out.integrity[-1].cause[G02] == ExclusionCause.UNMONITORED
    assert run(truth(4), watching(station), 4.0 * np.arange(20)).integrity[-1].state[G02] == ChannelState.USABLE


def test_service_type_d_needs_the_gradient_monitor():
    """A single receiver has no baseline."""
    one = {"gast_d__enabled": True, "vdb__slots": "ABC", "receivers__minimum": 1}
    out = run(truth(1), params(1, **one), half_seconds(30))
    assert (out.array("state")[:, G02] != ChannelState.USABLE).all()
    assert out.integrity[-1].cause[G02] == ExclusionCause.UNMONITORED
    assert (
        run(truth(1), params(1, receivers__minimum=1), half_seconds(30)).integrity[-1].state[G02] == ChannelState.USABLE
    )
    unclaimed = params(1, **one, gast_d__required=False, station__gcid=7)  # for recorded data
    assert run(truth(1), unclaimed, half_seconds(30)).integrity[-1].state[G02] == ChannelState.USABLE


def test_a_quiet_station_passes_everything_and_every_table_can_be_sent():
    out = run(truth(4), params(4), half_seconds(40))
    last = out.statistics[-1]
    usable = out.integrity[-1].state == ChannelState.USABLE
    tests = {(monitor.name, test.name) for monitor, test in TESTS.values()}
    passing = {each for each in tests if (last.states(*each)[usable] == MonitorState.PASSED).all()}
    # the synthetic ranges are on L1 alone, so that there is nothing for the two-band monitors
    assert passing == tests - {("ccd_f", "full_rank"), ("ccd_f", "published")}
    assert not len(last.select(monitor="ccd_f"))
    assert set(last.signal.tolist()) <= {Signal.L1, Signal.NONE}
    for each in out.statistics:
        again = MONITORS.decode(MONITORS.label, MONITORS.encode(each))
        assert np.array_equal(again.state, each.state)
        assert np.array_equal(again.statistic, each.statistic, equal_nan=True)


def test_the_budget_of_false_exclusions_is_kept():
    with pytest.raises(ParameterError, match="together more than the budget of 2e-07"):
        params(4, ionosphere_gradient__p_false_alarm=3e-7)
    with pytest.raises(ParameterError, match=r"least_points = 20 is more than points = 10"):
        CarrierAccelerationParams(least_points=20)
    with pytest.raises(ParameterError, match=r"sample_s = 700 is not within"):
        SigmaMonitorParams(sample_s=700.0)
