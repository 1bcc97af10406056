"""The executive's table of satellites and receivers: states in order, causes, and for how long."""

from __future__ import annotations

import numpy as np

from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_msgs_py.codes import ChannelState, ExclusionCause
from gbas_msgs_py.products import L1_100
from gbas_msgs_py.tables import CHANNELS
from ground_runs import half_seconds, params, run
from synthetic_ranges import truth

G02 = SAT_INDEX["G02"]
SETTLE_S, READMISSION_S = 5.0, 10.0


def faulty_run():
    """8 m of multipath on one of three receivers between 20 s and 30 s, with filters of 2 s."""

    def error(second):
        result = np.zeros((3, N_SATS))
        result[1, G02] = 8.0 if 20.0 <= second < 30.0 else 0.0
        return result

    station = params(3, smoothing__tau_s=(2.0, 2.0), accuracy__designator="C")
    return run(truth(3), station, half_seconds(140), code_error_m=error, carrier_error_m=lambda _: 0.0)


def runs_of(states, causes):
    """(state, cause, epochs) of each stretch."""
    stretches = []
    for pair in zip(states.tolist(), causes.tolist(), strict=True):
        if stretches and stretches[-1][0] == pair:
            stretches[-1][1] += 1
        else:
            stretches.append([pair, 1])
    return [(ChannelState(int(state)), ExclusionCause(int(cause)), count) for (state, cause), count in stretches]


def test_a_channel_goes_through_its_states_in_order_and_the_clock_of_each_starts_anew():
    out = faulty_run()
    state = np.array([each.channel_state[1, G02] for each in out.channels])
    cause = np.array([each.channel_cause[1, G02] for each in out.channels])
    since_s = np.array([each.channel_since_s[1, G02] for each in out.channels])
    stretches = runs_of(state, cause)
    assert [(each, why) for each, why, _ in stretches] == [
        (ChannelState.SETTLING, ExclusionCause.SETTLING),
        (ChannelState.USABLE, ExclusionCause.NONE),
        (ChannelState.EXCLUDED, ExclusionCause.B_VALUE),
        (ChannelState.RECOVERING, ExclusionCause.B_VALUE),
        (ChannelState.USABLE, ExclusionCause.NONE),
    ]
    assert stretches[0][2] == SETTLE_S / 0.5
    assert stretches[3][2] == READMISSION_S / 0.5
    # within each stretch the time counts 0, 0.5, 1, ... s
    assert since_s.tolist() == [0.5 * number for _, _, count in stretches for number in range(count)]


def test_the_other_receivers_and_the_satellite_stay_usable():
    for each in faulty_run().channels[20:]:
        assert (each.channel_state[[0, 2]][:, G02] == ChannelState.USABLE).all()
        assert each.state[G02] == ChannelState.USABLE
        assert np.isnan(each.channel_state[3]).all()  # the station has three receivers


def test_a_receiver_that_sends_nothing_is_not_tracking():
    def without_the_second(second, observed):
        return (observed[0], None, observed[2]) if second >= 15.0 else observed

    out = run(truth(3), params(3), half_seconds(60), change=without_the_second)
    last = out.channels[-1]
    tracked = np.isfinite(last.channel_state[0])
    assert tracked.sum() > 8
    assert (last.channel_state[1, tracked] == ChannelState.NOT_TRACKED).all()
    assert (last.channel_cause[1, tracked] == ExclusionCause.NOT_TRACKED).all()


def test_every_table_of_a_run_can_be_sent_and_agrees_with_the_integrity():
    out = faulty_run()
    for channels, integrity in zip(out.channels, out.integrity, strict=True):
        again = CHANNELS.decode(CHANNELS.label, CHANNELS.encode(channels))
        assert np.array_equal(again.channel_since_s, channels.channel_since_s, equal_nan=True)
        assert np.array_equal(channels.state, integrity.state, equal_nan=True)
        used = integrity.receiver_used[L1_100] == 1.0
        assert np.array_equal(channels.channel_state == ChannelState.USABLE, used)
