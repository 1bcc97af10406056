"""Whatever is thrown at the station: it never stops, and what it calls usable is complete, consistent and in bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_core.gnss.gpstime import add_seconds
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1
from gbas_ground.station import GroundEpoch, GroundStation, initial_state
from gbas_msgs_py import tables
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.records import ChannelState
from gbas_vdb.transmission.receive import decode_burst
from ground_runs import params
from synthetic_ranges import TOW_S, WEEK, truth

EPOCHS = 60
WORLDS = {receivers: truth(receivers) for receivers in (1, 2, 3, 4)}


@pytest.fixture(scope="module")
def ranges():
    """Ranges of four receivers at 2 Hz, made once."""
    world = truth(4)
    return [world.observe(*add_seconds(WEEK, TOW_S, 0.5 * epoch)) for epoch in range(EPOCHS)]


def damaged(observed, rng, rate):
    """A copy with random damage: steps, drop-outs, nonsense, missing receivers, lost lock, weak signals."""
    result = []
    for each in observed:
        if rng.random() < rate:
            result.append(None)
            continue
        fields = {name: getattr(each, name).copy() for name in ("code_m", "carrier_m", "cn0_dbhz", "lli")}
        hit = rng.random((4, N_SATS)) < rate
        fields["code_m"][L1, hit[0]] += rng.choice([3.0, -9.0, 50.0, 1e3, 3e5, 1e15], hit[0].sum())
        fields["carrier_m"][L1, hit[1]] += rng.choice([0.19, -2.0, 1e4], hit[1].sum())
        fields["lli"][L1, hit[2]] = rng.choice([1.0, np.nan, 77.0, -3.0], hit[2].sum())
        name = rng.choice(list(fields))
        fields[name][L1, hit[3]] = rng.choice([np.nan, np.inf, 0.0, -1e9, 20.0], hit[3].sum())
        result.append(type(each)(gps_week=each.gps_week, tow_s=each.tow_s, simulated=1.0, **fields))
    return tuple(result)


def check(integrity, station):
    """What must hold of every integrity epoch."""
    usable = integrity.state == ChannelState.USABLE
    for name in ("prc_100_m", "prc_30_m", "rrc_100_mps", "rrc_30_mps", "sigma_pr_gnd_m", "sigma_pr_gnd_30_m"):
        assert np.array_equal(np.isfinite(getattr(integrity, name)), usable), name
    assert (np.abs(integrity.prc_100_m[usable]) <= station.correction_limits.max_prc_m).all()
    assert (np.abs(integrity.rrc_30_mps[usable]) <= station.correction_limits.max_rrc_mps).all()
    assert (integrity.cause[usable] == ExclusionCause.NONE).all()
    assert (integrity.elevation_rad[usable] >= station.monitors.elevation_mask_rad).all()
    used = integrity.receiver_used[: station.n_receivers, usable] == 1.0
    assert (used.sum(axis=0) >= station.receivers.minimum).all()
    b = integrity.b_m[: station.n_receivers, usable]
    several = used.sum(axis=0) >= 2
    assert np.array_equal(np.isfinite(b), used & several)
    assert np.abs(np.where(np.isfinite(b), b, 0.0).sum(axis=0)).max(initial=0.0) < 1e-6
    assert np.abs(b[np.isfinite(b)]).max(initial=0.0) <= 6.35
    unusable = np.isfinite(integrity.state) & ~usable
    assert (integrity.cause[unusable] != ExclusionCause.NONE).all()
    tables.INTEGRITY.encode(integrity)


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    receivers=st.integers(1, 4),
    rate=st.sampled_from([0.002, 0.02, 0.2, 0.8]),
    settle_s=st.sampled_from([0.0, 3.0]),
)
def test_invariants_under_random_damage(ranges, seed, receivers, rate, settle_s):
    rng = np.random.default_rng(seed)
    station = params(
        receivers,
        smoothing__settle_time_s=settle_s,
        monitors__readmission_time_s=2.0,
        smoothing__tau_s=(5.0, 2.0),
        gast_d__enabled=True,
        vdb__slots="ABC",
    )
    state = initial_state(station)
    ephemeris = WORLDS[receivers].ephemeris
    received = (type(ephemeris)(**(vars(ephemeris) | {"tow_s": TOW_S - 1000.0})),)
    for number, observed in enumerate(ranges):
        week, tow_s = add_seconds(WEEK, TOW_S, 0.5 * number)
        epoch = GroundEpoch(
            gps_week=week,
            tow_s=tow_s,
            observations=damaged(observed[:receivers], rng, rate),
            ephemerides=received if number == 0 else (),
        )
        state, monitored, bursts = GroundStation.step(state, epoch, station)
        integrity, events = monitored.integrity, monitored.events
        check(integrity, station)
        assert not any(decode_burst(burst).errors for burst in bursts)
        assert bursts
        for event in events:
            assert event.to_json()
