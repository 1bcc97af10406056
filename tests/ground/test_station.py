"""The whole station on made-up observations whose corrections are known by construction."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK, add_seconds
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS, SAT_INDEX
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_ground.params import watching
from gbas_ground.station import RESTART_AFTER_REFUSED, GroundEpoch, GroundStation
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.records import GROUND_MONITORS, ChannelState, MonitorState
from ground_runs import half_seconds, params, run
from synthetic_ranges import TOW_S, WEEK, constellation, truth

MS_M = 1e-3 * SPEED_OF_LIGHT_MPS
# The time of transmission is found without the relativistic term of the clock, 9 ns here, in which a range changes by
# up to 8e-6 m. A range error of e metres moves that time too, and so the expected range by up to e * 3e-6 (900 m/s).
NOISE_FREE_M = 2e-5


def without_mean(values, present):
    """Values less the mean over each constellation's present satellites."""
    result = np.full(N_SATS, np.nan)
    for group in (IS_GPS, IS_GALILEO):
        own = present & group
        result[own] = values[own] - values[own].mean()
    return result


def usable(integrity):
    return integrity.state == ChannelState.USABLE


@pytest.mark.parametrize("receivers", [1, 2, 3, 4])
def test_correction_is_minus_the_error_less_what_the_clock_takes(receivers):
    error = np.random.default_rng(receivers).normal(0.0, 20.0, N_SATS)
    out = run(truth(receivers), params(receivers), half_seconds(40), code_error_m=lambda _: error)
    last = out.integrity[-1]
    assert usable(last).sum() > 20
    expected = without_mean(-error, usable(last))
    tolerance = NOISE_FREE_M + 3e-6 * np.abs(error).max()
    for name in ("prc_100_m", "prc_30_m"):
        assert np.nanmax(np.abs(getattr(last, name) - expected)) < tolerance
    for name in ("rrc_100_mps", "rrc_30_mps"):
        # satellites move by some 0.1 m/s in range rate over the run
        assert np.nanmax(np.abs(getattr(last, name))) < 1e-6
    b = last.b_m[:receivers][:, usable(last)]
    assert np.isnan(last.b_m[receivers:]).all()
    assert np.isnan(b).all() if receivers == 1 else np.abs(b).max() < tolerance
    assert last.n_receivers == receivers


def test_rate_follows_a_drifting_error():
    drift = np.linspace(-0.05, 0.05, N_SATS)
    out = run(truth(3), params(3), half_seconds(40), code_error_m=lambda second: drift * second)
    last = out.integrity[-1]
    expected = without_mean(-drift, usable(last))
    assert np.nanmax(np.abs(last.rrc_100_mps - expected)) < 1e-6  # the drift is 2e-2 of that over c
    change = out.integrity[-1].prc_30_m - out.integrity[-2].prc_30_m
    assert np.nanmax(np.abs(last.rrc_30_mps - change / 0.5)) < 1e-6


def test_b_values_of_a_bias():
    """Facts: a bias b in one of M receivers gives b/M there, -b/(M(M-1)) at the others; the clock takes 1/N of it."""
    bias = 0.3
    where = SAT_INDEX["G01"]
    error = np.zeros((4, N_SATS))
    error[2, where] = bias
    out = run(truth(4), params(4), half_seconds(20), code_error_m=lambda _: error, carrier_error_m=lambda _: 0.0)
    last = out.integrity[-1]
    n = (usable(last) & IS_GPS).sum()
    # PR_sc = -error: B has the opposite sign of a range error
    left = -bias * (1.0 - 1.0 / n)
    assert last.b_m[:, where] == pytest.approx([-left / 12, -left / 12, left / 4, -left / 12], abs=1e-5)
    assert np.nanmax(np.abs(last.b_m.sum(axis=0))) < NOISE_FREE_M


def test_nothing_is_usable_before_the_filters_have_settled():
    out = run(truth(2), params(2, smoothing__settle_time_s=8.0), half_seconds(24))
    states = out.array("state")
    here = np.isfinite(states[-1]) & (states[-1] == ChannelState.USABLE)
    first = 16  # at 8.0 s
    assert (states[:first, here] == ChannelState.SETTLING).all()
    assert (out.array("cause")[:first, here] == ExclusionCause.SETTLING).all()
    assert (states[first:, here] == ChannelState.USABLE).all()
    assert np.isnan(out.array("prc_100_m")[:first]).all()
    assert [event[0] for event in out.told("settling")] == [8.0] * int(here.sum())
    assert out.told("corrections_begin") == [(8.0, "station", "station")]


def test_a_station_without_a_threat_model_of_the_ionosphere_says_so_once():
    out = run(truth(2), params(2), half_seconds(4))
    assert out.told("ionosphere_no_threat_model") == [(0.0, "station", "station")]


def step_on(receivers, receiver, satellite, size, begin, end=np.inf):
    """Code error of one channel between two times."""

    def error(second):
        result = np.zeros((receivers, N_SATS))
        if begin <= second < end:
            result[receiver, SAT_INDEX[satellite]] = size
        return result

    return error


def test_faulty_channel_is_excluded_and_comes_back_after_the_clear_time():
    """8 m of multipath on one channel, below the 10 m at which a code jump restarts the filter."""
    station = params(3, smoothing__tau_s=(2.0, 2.0), monitors__readmission_time_s=10.0, accuracy__designator="C")
    out = run(
        truth(3),
        station,
        half_seconds(140),
        code_error_m=step_on(3, 1, "G02", 8.0, 20.0, 30.0),
        carrier_error_m=lambda _: 0.0,
    )
    told = out.told("b_value")
    assert [event[1:] for event in told] == [("exclusion", "rr2/G02"), ("readmission", "rr2/G02")]
    excluded, back = told[0][0], told[1][0]
    assert 20.0 <= excluded <= 23.0  # 2 s filters
    used = out.array("receiver_used")[:, 1, SAT_INDEX["G02"]]
    seconds = np.array(out.seconds)
    assert (used[(seconds >= excluded) & (seconds < back)] == 0.0).all()
    assert (used[(seconds >= 5.0) & (seconds < excluded)] == 1.0).all()
    assert (used[seconds >= back] == 1.0).all()
    # gone at 30 s, out of the 2 s filter within some seconds, then 10 s clear
    assert 40.0 < back < 50.0
    # the satellite stays usable with the other two, and nothing else is touched
    state = out.array("state")[seconds >= 5.0, SAT_INDEX["G02"]]
    assert (state == ChannelState.USABLE).all()
    others = np.delete(out.array("prc_100_m")[seconds >= 5.0], SAT_INDEX["G02"], axis=1)
    present = np.isfinite(others).all(axis=0)
    assert present.sum() > 20


def test_excluded_channel_leaves_no_trace_in_the_corrections():
    station = params(4, smoothing__tau_s=(2.0, 2.0))
    quiet = lambda _: 0.0  # noqa: E731
    error = step_on(4, 0, "G02", 9.0, 10.0)
    out = run(truth(4), station, half_seconds(80), code_error_m=error, carrier_error_m=quiet)
    last = out.integrity[-1]
    assert last.receiver_used[:, SAT_INDEX["G02"]].tolist() == [0.0, 1.0, 1.0, 1.0]
    assert np.nanmax(np.abs(last.prc_100_m)) < NOISE_FREE_M
    assert np.nanmax(np.abs(last.b_m)) < NOISE_FREE_M
    assert np.isnan(last.b_m[0, SAT_INDEX["G02"]])


def test_two_receivers_exclude_the_satellite_and_bring_it_back():
    station = params(2, smoothing__tau_s=(2.0, 2.0), monitors__readmission_time_s=10.0, accuracy__designator="C")
    out = run(
        truth(2),
        station,
        half_seconds(140),
        code_error_m=step_on(2, 1, "G02", 8.0, 20.0, 30.0),
        carrier_error_m=lambda _: 0.0,
    )
    told = out.told("b_value")
    assert [event[1:] for event in told] == [("exclusion", "G02"), ("readmission", "G02")]
    seconds = np.array(out.seconds)
    state = out.array("state")[:, SAT_INDEX["G02"]]
    between = (seconds >= told[0][0]) & (seconds < told[1][0])
    # it fails for a while, then passes for the re-admission time, and nothing else in between
    changes = np.flatnonzero(np.diff(state[between]))
    assert len(changes) == 1
    assert (state[between][: changes[0] + 1] == ChannelState.EXCLUDED).all()
    assert (state[between][changes[0] + 1 :] == ChannelState.RECOVERING).all()
    assert (out.array("cause")[between, SAT_INDEX["G02"]] == ExclusionCause.B_VALUE).all()
    assert np.isnan(out.array("prc_100_m")[between, SAT_INDEX["G02"]]).all()
    assert state[-1] == ChannelState.USABLE
    assert 40.0 < told[1][0] < 50.0


def test_receiver_with_several_faults_is_excluded_whole():
    faulty = [SAT_INDEX[name] for name in ("G01", "G02", "G05", "G06")]

    def error(second):
        result = np.zeros((4, N_SATS))
        if 10.0 <= second < 15.0:
            result[3, faulty] = [9.0, -9.0, 8.0, -9.5]
        return result

    station = params(
        4, smoothing__tau_s=(2.0, 2.0), monitors__receiver_fault_channels=3, monitors__readmission_time_s=10.0
    )
    out = run(truth(4), station, half_seconds(120), code_error_m=error, carrier_error_m=lambda _: 0.0)
    told = out.told("receiver_fault")
    assert [event[1:] for event in told] == [("exclusion", "rr4"), ("readmission", "rr4")]
    seconds = np.array(out.seconds)
    between = (seconds >= told[0][0]) & (seconds < told[1][0])
    assert (out.array("n_receivers")[between] == 3.0).all()
    assert (np.nan_to_num(out.array("receiver_used")[between, 3]) == 0.0).all()
    assert out.integrity[-1].n_receivers == 4.0
    assert (out.array("state")[seconds >= 5.0] == ChannelState.USABLE).sum(axis=1).min() >= 20
    # sigma is that of three receivers meanwhile, so larger
    sigma = out.array("sigma_pr_gnd_m")[:, SAT_INDEX["G10"]]
    assert (sigma[between] > sigma[seconds == 9.0]).all()


def test_exclusions_that_leave_no_clock_still_end():
    """Two receivers, one wrong on every satellite: all are excluded, nothing is left to compare with, yet it ends."""

    def error(second):
        result = np.zeros((2, N_SATS))
        if 10.0 <= second < 15.0:
            result[1, in_view] = np.linspace(-9.5, 9.5, len(in_view))  # no five within what the clock could hide
        return result

    in_view = np.flatnonzero(np.isfinite(truth(2).range_m(WEEK, TOW_S)).all(axis=0) & IS_GPS)
    station = params(
        2,
        station__systems="G",
        smoothing__tau_s=(2.0, 2.0),
        monitors__readmission_time_s=10.0,
        accuracy__designator="C",
        monitors__min_common_satellites=5,
    )
    out = run(truth(2), station, half_seconds(120), code_error_m=error, carrier_error_m=lambda _: 0.0)
    count = (out.array("state") == ChannelState.USABLE).sum(axis=1)
    assert count[np.array(out.seconds) == 14.0] == 0
    assert count[-1] == count[np.array(out.seconds) == 9.0] > 8
    assert [event[1:] for event in out.told("corrections_end")] == [("station", "station")]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_correction_limit(sign):
    """A satellite 400 m off (its clock ran away): only this one is excluded, although the mean moves all the others."""
    error = np.zeros(N_SATS)
    error[SAT_INDEX["G02"]] = sign * 400.0
    station = params(3, expected_range__max_residual_m=1000.0)
    last = run(truth(3), station, half_seconds(20), code_error_m=lambda _: error).integrity[-1]
    assert last.cause[SAT_INDEX["G02"]] == ExclusionCause.PRC_LIMIT
    assert np.isnan(last.prc_100_m[SAT_INDEX["G02"]])
    assert (last.cause[usable(last)] == 0).all()
    assert usable(last).sum() > 20
    assert np.nanmax(np.abs(last.prc_100_m)) < NOISE_FREE_M


def test_rate_limit():
    error = lambda second: np.where(np.arange(N_SATS) == SAT_INDEX["G02"], 5.0 * second, 0.0)  # noqa: E731
    # 5 m/s would be taken for a slip against the known range; here it is a rate both code and carrier have
    station = watching(params(3, smoothing__settle_time_s=0.0))
    out = run(truth(3), station, half_seconds(20), code_error_m=error)
    told = out.told("rrc_limit")
    assert told[0][1:] == ("exclusion", "G02")
    assert out.integrity[-1].cause[SAT_INDEX["G02"]] == ExclusionCause.RRC_LIMIT
    assert np.isnan(out.integrity[-1].rrc_100_mps[SAT_INDEX["G02"]])


def test_gross_error_of_one_channel_never_enters_the_corrections():
    station = params(4, monitors__readmission_time_s=10.0)
    out = run(truth(4), station, half_seconds(100), code_error_m=step_on(4, 0, "G02", 5000.0, 10.0, 11.0))
    told = out.told("range_residual")
    assert [event[1:] for event in told] == [("exclusion", "rr1/G02"), ("readmission", "rr1/G02")]
    assert told[0][0] == 10.0
    assert told[1][0] == 21.0  # last failure at 10.5, 10 s clear, next epoch
    late = np.array(out.seconds) >= 5.5
    assert np.nanmax(np.abs(out.array("prc_100_m")[late])) < NOISE_FREE_M
    assert (out.array("state")[late, SAT_INDEX["G02"]] == ChannelState.USABLE).all()


@pytest.mark.parametrize("missing_cn0", [False, True])
def test_weak_signal_is_not_used(missing_cn0):
    def weak(second, observed):
        if second >= 10.0:
            observed[2].cn0_dbhz[L1, SAT_INDEX["G05"]] = np.nan if missing_cn0 else 25.0
        return observed

    out = run(truth(3), params(3), half_seconds(40), change=weak)
    assert out.told("signal_power") == [(10.0, "exclusion", "rr3/G05")]
    assert out.integrity[-1].receiver_used[:, SAT_INDEX["G05"]].tolist()[:3] == [1.0, 1.0, 0.0]


def test_one_name_is_one_monitor():
    """What the monitors' table calls `power` is what the section `power` tells to watch only, and no other."""

    def weak(second, observed):
        if second >= 10.0:
            observed[2].cn0_dbhz[L1, SAT_INDEX["G05"]] = 25.0
        return observed

    def told(**sections):
        station = params(4, **sections)
        out = run(truth(4), station, half_seconds(40), change=weak)
        rows = [GROUND_MONITORS.index(name) for name in ("power", "expected_power")]
        assert (out.statistics[-1].state[rows, SAT_INDEX["G05"]] == MonitorState.FAILED).any()
        causes = {cause for cause in ("signal_power", "expected_power") if out.told(cause)}
        return causes, out.integrity[-1].receiver_used[2, SAT_INDEX["G05"]] == 1.0

    power, expected = {"signal_power__exclude": False}, {"expected_power__exclude": False}
    assert told() == ({"signal_power"}, False)  # the averaged one is slower, and does not look at what is out
    assert told(**power) == ({"expected_power"}, False)
    assert told(**expected) == ({"signal_power"}, False)
    assert told(**power, **expected) == (set(), True)


def test_files_without_cn0_are_used_when_told_so():
    def without(_, observed):
        for each in observed:
            each.cn0_dbhz[:] = np.nan
        return observed

    out = run(truth(2), params(2), half_seconds(20), change=without)
    assert not usable(out.integrity[-1]).any()
    out = run(truth(2), params(2, signal_power__require_cn0=False), half_seconds(20), change=without)
    assert usable(out.integrity[-1]).any()


def later(ephemeris, seconds, **changes):
    """The ephemeris with another reception time."""
    week, tow_s = add_seconds(WEEK, TOW_S, seconds)
    return dataclasses.replace(ephemeris, gps_week=week, tow_s=tow_s, **changes)


def test_ephemeris_change_does_not_jump_the_rate():
    """The new ephemeris takes effect 120 s after reception. PRC steps by what the new clock says; RRC does not."""
    first = constellation(iod=17)
    step_s = np.where(np.isfinite(first.af0_s), 1e-8 * np.sin(np.arange(N_SATS)), np.nan)  # some metres
    second = later(first, 10.0, iod=np.where(np.isfinite(first.iod), 18.0, np.nan), af0_s=first.af0_s + step_s)
    world = truth(3)
    out = run(
        world, params(3), half_seconds(300), ephemerides={0.0: (later(first, -1000.0),), 10.0: (second,)}
    )  # fmt: skip
    iod, rrc, prc = (out.array(name) for name in ("iod", "rrc_100_mps", "prc_100_m"))
    here = usable(out.integrity[-1])
    switch = int(np.argmax(iod[:, np.argmax(here)] == 18.0))
    assert out.seconds[switch] == 130.0
    assert (iod[switch:, here] == 18.0).all()
    assert (iod[:switch, here] == 17.0).all()
    assert np.nanmax(np.abs(rrc[20:])) < 1e-6
    expected = without_mean(-SPEED_OF_LIGHT_MPS * step_s, here)
    assert np.nanmax(np.abs((prc[switch] - prc[switch - 1])[here] - expected[here])) < 1e-5  # clock step moves t_tx
    assert out.array("state")[20:, here].min() == ChannelState.USABLE
    crc = out.array("ephemeris_crc")
    assert (crc[switch, here] != crc[switch - 1, here]).all()
    assert len(out.told("new_ephemeris")) == np.isfinite(first.iod).sum()


def test_implausible_ephemeris_is_not_used():
    first = constellation(iod=17)
    wrong = {"cuc_rad": first.cuc_rad + np.where(np.arange(N_SATS) == SAT_INDEX["G02"], 9e-5, 0.0)}  # 2.4 km
    second = later(first, 10.0, iod=first.iod + 1.0, **wrong)
    out = run(truth(2), params(2), half_seconds(280), ephemerides={0.0: (later(first, -1000.0),), 10.0: (second,)})
    told = [event for event in out.events if event.cause == "ephemeris_change"]
    assert [event.subject for event in told] == ["G02"]
    assert told[0].value > told[0].threshold == 250.0
    last = out.integrity[-1]
    assert last.iod[SAT_INDEX["G02"]] == 17.0
    assert last.iod[SAT_INDEX["G01"]] == 18.0
    assert np.nanmax(np.abs(last.prc_100_m)) < NOISE_FREE_M


def test_unhealthy_satellite_is_dropped_at_once():
    first = constellation(iod=17)
    health = np.where(np.arange(N_SATS) == SAT_INDEX["G02"], 1.0, first.health)
    sick = later(first, 10.0, iod=first.iod + 1.0, health=health)
    out = run(truth(2), params(2), half_seconds(40), ephemerides={0.0: (later(first, -1000.0),), 10.0: (sick,)})
    seconds, state = np.array(out.seconds), out.array("state")[:, SAT_INDEX["G02"]]
    assert (state[(seconds >= 5.5) & (seconds < 10.0)] == ChannelState.USABLE).all()
    assert (state[seconds >= 10.0] == ChannelState.EXCLUDED).all()
    assert (out.array("cause")[seconds >= 10.0, SAT_INDEX["G02"]] == ExclusionCause.NO_EPHEMERIS).all()


def test_no_ephemeris_no_correction():
    out = run(truth(2), params(2), half_seconds(20), ephemerides={})
    assert (out.array("state") != ChannelState.USABLE).all()
    tracked = np.isfinite(truth(2).range_m(WEEK, TOW_S)).all(axis=0)
    assert (out.integrity[-1].cause[tracked] == ExclusionCause.NO_EPHEMERIS).all()


# --- robustness


@pytest.mark.parametrize("code_only", [False, True])
def test_millisecond_jumps_of_a_receiver_clock(code_only):
    """Some receivers step code and carrier together, some the code alone; neither shows in the corrections."""
    before = truth(3)
    after = dataclasses.replace(before, clock_s=before.clock_s + np.array([0.0, 1e-3, 0.0]))

    def jump(second, observed):
        if second < 10.0:
            return observed
        week, tow_s = add_seconds(WEEK, TOW_S, second)
        carrier_error = np.array([[0.0], [-MS_M if code_only else 0.0], [0.0]])
        return after.observe(week, tow_s, carrier_error_m=carrier_error)

    out = run(before, params(3), half_seconds(60), change=jump)
    late = np.array(out.seconds) >= 5.5
    count = (out.array("state")[late] == ChannelState.USABLE).sum(axis=1)
    assert count.min() == count.max() > 20
    assert (out.array("n_receivers")[late] == 3.0).all()
    assert np.nanmax(np.abs(out.array("prc_100_m")[late])) < NOISE_FREE_M
    assert np.nanmax(np.abs(out.array("b_m")[late])) < NOISE_FREE_M
    assert np.nanmax(np.abs(out.array("rrc_100_mps")[late])) < 1e-5


def test_receiver_missing_for_an_epoch_keeps_its_filters():
    def drop(second, observed):
        return (observed[0], None, observed[2]) if second in (10.0, 12.0, 12.5) else observed

    error = np.random.default_rng(0).normal(0.0, 5.0, N_SATS)
    out = run(
        truth(3), params(3, smoothing__settle_time_s=5.0), half_seconds(40), change=drop, code_error_m=lambda _: error
    )
    seconds, receivers = np.array(out.seconds), out.array("n_receivers")
    away = np.isin(seconds, [10.0, 12.0, 12.5])
    assert (receivers[away] == 2.0).all()
    assert (receivers[(seconds >= 5.0) & ~away] == 3.0).all()
    assert out.told("missing") == [(10.0, "input", "rr2"), (12.0, "input", "rr2")]
    assert out.told("back") == [(10.5, "input", "rr2"), (13.0, "input", "rr2")]
    late = seconds >= 5.5
    assert np.nanmax(np.abs(out.array("rrc_100_mps")[late])) < 1e-6
    usable_count = (out.array("state")[late] == ChannelState.USABLE).sum(axis=1)
    assert usable_count.min() == usable_count.max()


def test_receiver_missing_too_long_starts_anew():
    def drop(second, observed):
        return (observed[0], None, observed[2]) if 10.0 <= second < 14.0 else observed

    out = run(
        truth(3), params(3, smoothing__settle_time_s=5.0, smoothing__max_gap_s=3.5), half_seconds(60), change=drop
    )
    seconds, receivers = np.array(out.seconds), out.array("n_receivers")
    assert (receivers[(seconds >= 10.0) & (seconds < 19.0)] == 2.0).all()
    assert (receivers[seconds >= 19.0] == 3.0).all()


def test_all_receivers_missing():
    def drop(second, observed):
        return (None,) * len(observed) if 10.0 <= second < 12.0 else observed

    out = run(truth(2), params(2), half_seconds(40), change=drop)
    seconds = np.array(out.seconds)
    away = (seconds >= 10.0) & (seconds < 12.0)
    assert (out.array("state")[away] != ChannelState.USABLE).all()
    assert (out.array("n_receivers")[away] == 0.0).all()
    assert all(bursts for bursts in out.bursts)  # a live but empty station
    assert usable(out.integrity[-1]).any()


@pytest.mark.parametrize("field", ["code_m", "carrier_m", "cn0_dbhz", "lli", "doppler_hz"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0])
def test_bad_numbers_never_reach_a_correction(field, bad):
    def spoil(second, observed):
        if 10.0 <= second < 11.0:
            getattr(observed[1], field)[L1, ::3] = bad
        return observed

    out = run(truth(3), params(3), half_seconds(30), change=spoil)
    late = np.array(out.seconds) >= 5.5
    for name in ("prc_100_m", "prc_30_m"):
        values = out.array(name)[late]
        assert np.isfinite(values).sum(axis=1).min() > 15
        assert np.nanmax(np.abs(values)) < 1e-5
    assert np.isfinite(out.array("n_receivers")).all()


@pytest.mark.parametrize("systems", ["G", "E", "GE"])
def test_systems(systems):
    out = run(truth(3, systems=systems), params(3, station__systems=systems), half_seconds(20))
    now = usable(out.integrity[-1])
    assert (now & IS_GPS).any() == ("G" in systems)
    assert (now & IS_GALILEO).any() == ("E" in systems)
    only = run(truth(3), params(3, station__systems=systems), half_seconds(20)).integrity[-1]
    assert np.array_equal(usable(only), now)


def test_intervals_may_change():
    seconds = np.concatenate([np.arange(0.0, 10.0, 0.5), np.arange(10.0, 20.0, 1.0), np.arange(20.0, 24.0, 0.25)])
    drift = np.linspace(-0.02, 0.02, N_SATS)
    out = run(truth(3), params(3), seconds, code_error_m=lambda second: drift * second)
    late = seconds >= 5.5
    expected = without_mean(-drift, usable(out.integrity[-1]))
    rate = out.array("rrc_100_mps")[late]
    assert np.nanmax(np.abs(rate - expected)) < 1e-5  # 0.25 s: rounding of 2e7 m over less time
    assert (out.array("state")[late] == ChannelState.USABLE).sum(axis=1).min() > 20


@pytest.mark.parametrize("normalised", [True, False])
def test_week_rollover(normalised):
    """The week ends in the middle; a tag of 604800 s or more in the old week means the same."""
    begin = SECONDS_PER_WEEK - 10.0
    world = dataclasses.replace(truth(3), ephemeris=constellation(WEEK, begin))

    station = params(3)
    state = None
    results = []
    for second in half_seconds(40):
        week, tow_s = add_seconds(WEEK, begin, second) if normalised else (WEEK, begin + second)
        world_epoch = world.observe(week, tow_s)
        received = (dataclasses.replace(world.ephemeris, tow_s=begin - 1000.0),) if state is None else ()
        if state is None:
            from gbas_ground.station import initial_state

            state = initial_state(station)
        epoch = GroundEpoch(gps_week=week, tow_s=tow_s, observations=world_epoch, ephemerides=received)
        state, monitored, _ = GroundStation.step(state, epoch, station)
        integrity, events = monitored.integrity, monitored.events
        results.append(integrity)
        assert not [event for event in events if event.cause == "epoch_not_later"]
    assert all(usable(each).sum() > 20 for each in results[11:])
    assert max(np.nanmax(np.abs(each.rrc_100_mps)) for each in results[11:]) < 1e-6


def test_epoch_that_is_not_later_is_refused():
    world, station = truth(2), params(2)
    out = run(world, station, half_seconds(20))
    again = run(world, station, [9.5, 9.0, 3.0], state=out.state)
    assert again.told("epoch_not_later") == [
        (9.5, "input", "station"),
        (9.0, "input", "station"),
        (3.0, "input", "station"),
    ]
    assert not any(again.bursts)
    assert all(np.isnan(each.state).all() and each.n_receivers == 0.0 for each in again.integrity)
    on = run(world, station, [10.0], state=again.state)
    assert usable(on.integrity[0]).sum() == usable(out.integrity[-1]).sum()


def test_time_that_stays_in_the_past_is_believed_in_the_end():
    """A player that loops, or one epoch with a date far in the future: the station starts anew after some epochs."""
    world, station = truth(2), params(2)
    out = run(world, station, [*half_seconds(20), 80_000.0])
    again = run(world, station, half_seconds(40, first=10.0), state=out.state, ephemerides={})
    assert len(again.told("epoch_not_later")) == RESTART_AFTER_REFUSED - 1
    assert again.told("restarted") == [(10.0 + 0.5 * (RESTART_AFTER_REFUSED - 1), "station", "station")]
    assert usable(again.integrity[-1]).sum() > 20


def test_observation_of_another_epoch_does_not_count():
    def stale(second, observed):
        if second == 10.0:
            return (observed[0], dataclasses.replace(observed[1], tow_s=TOW_S + 9.5), observed[2])
        return observed

    out = run(truth(3), params(3), half_seconds(25), change=stale)
    assert out.told("wrong_epoch") == [(10.0, "input", "rr2")]
    assert out.array("n_receivers")[20] == 2.0


def test_number_of_observations_must_be_that_of_the_receivers():
    station = params(3)
    with pytest.raises(ValueError, match="2 observations for 3 reference receivers"):
        run(truth(2), station, [0.0])


def test_satellite_tracked_by_one_receiver_is_not_corrected():
    def lose(second, observed):
        for each in observed[1:]:
            each.code_m[L1, SAT_INDEX["G05"]] = np.nan
        return observed

    out = run(truth(3), params(3), half_seconds(20), change=lose)
    assert out.integrity[-1].cause[SAT_INDEX["G05"]] == ExclusionCause.TOO_FEW_RECEIVERS


def test_few_satellites_of_a_constellation_have_no_clock():
    world = truth(2)
    galileo = np.flatnonzero(np.isfinite(world.range_m(WEEK, TOW_S)).all(axis=0) & IS_GALILEO)

    def lose(_, observed):
        for each in observed:
            each.code_m[L1, galileo[2:]] = np.nan
        return observed

    last = run(world, params(2), half_seconds(20), change=lose).integrity[-1]
    kept = galileo[:2]
    kept = kept[last.elevation_rad[kept] > np.radians(5.0)]
    assert len(kept)
    assert (last.cause[kept] == ExclusionCause.TOO_FEW_COMMON_SATELLITES).all()
    assert (usable(last) & IS_GPS).any()


def test_same_input_gives_the_same_bits():
    rng = np.random.default_rng(4)
    noise = {second: rng.normal(0.0, 0.5, (3, N_SATS)) for second in half_seconds(60)}
    once, again = (
        run(truth(3), params(3), half_seconds(60), code_error_m=noise.__getitem__, carrier_error_m=lambda _: 0.0)
        for _ in range(2)
    )
    assert once.bursts == again.bursts
    for name in ("prc_100_m", "b_m", "rrc_30_mps"):
        assert np.array_equal(once.array(name), again.array(name), equal_nan=True)


def test_satellite_that_sets_is_told():
    def lose(second, observed):
        if second >= 10.0:
            for each in observed:
                each.code_m[L1, SAT_INDEX["G05"]] = np.nan
        return observed

    out = run(truth(2), params(2), half_seconds(25), change=lose)
    assert out.told("not_tracked") == [(10.0, "exclusion", "G05")]
    last = out.integrity[-1]
    assert last.state[SAT_INDEX["G05"]] == ChannelState.NOT_TRACKED


def test_record_types_are_what_they_say():
    out = run(truth(2), params(2), half_seconds(3))
    assert isinstance(out.integrity[0].n_receivers, float)
    assert all(isinstance(each, ObservationEpoch) for each in truth(1).observe(WEEK, TOW_S))
    assert isinstance(constellation(), Ephemeris)
