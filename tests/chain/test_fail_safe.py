"""Faults at every place of the chain: no position without protection, and no error beyond it.

After each run :meth:`fault_runs.Outcome.violations` is empty: a position has finite protection levels, its error is
within them wherever the truth is known, it is made of satellites the station called usable, and everything can be sent.
That is asked of every epoch, with and without alert. What a test asks besides is the event that names the fault.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fault_runs import (
    QUANTITIES,
    Outcome,
    Scene,
    added,
    both,
    changed,
    clock_step,
    during,
    each_burst,
    frozen,
    lost,
    put,
    recorded_scene,
    retimed,
    rewritten,
    simulated_scene,
    tracking_only,
    without_doppler,
)
from gbas_airborne.params import AirborneParams
from gbas_airborne.receiver import AirborneReceiver
from gbas_airborne.service import ServiceState
from gbas_core.gnss.ephemeris import FIELDS, Ephemeris
from gbas_core.gnss.gpstime import add_seconds, from_epoch_key, modified_z_count_s
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID, SAT_INDEX
from gbas_ground.broadcast import BroadcastState
from gbas_msgs_py.products import L1_30, L1_100
from gbas_msgs_py.records import IntegrityEpoch, SolutionEpoch
from gbas_vdb.messages.types import Correction100, Message, Type1, Type2
from gbas_vdb.transmission.burst import Burst
from gbas_vdb.transmission.receive import decode_burst

FAULT = 10
"""Number of the epoch at which the fault begins."""
# The satellites of the simulated start whose geometry is best among all choices of four of GPS: no redundancy at all.
FOUR = [SAT_INDEX[name] for name in ("G01", "G16", "G18", "G22")]


@pytest.fixture(scope="module")
def scenes(data_dir) -> dict[str, Scene]:
    """Settled chains: recorded data with one reference receiver; simulated approaches with four, two and one."""
    return {
        "recorded": recorded_scene(data_dir),
        "four": simulated_scene(4),
        "two": simulated_scene(2),
        "one": simulated_scene(1),
        # protected against fronts, eight satellites of one system would be without service close in
        "gps": simulated_scene(4, "G", station={"ionosphere.threat_model": "none"}),
    }


@pytest.fixture(scope="module")
def bare() -> Scene:
    """Four satellites exactly: the aircraft has nothing to compare with."""
    return simulated_scene(4, "G", only=FOUR)


def safe(outcome: Outcome) -> Outcome:
    """The outcome, after looking at everything that must hold."""
    assert not outcome.violations()
    return outcome


def served(outcome: Outcome) -> np.ndarray:
    """Seconds since the first epoch of the epochs without alert."""
    return outcome.seconds()[outcome.alerts() == 0.0]


NAMES = ["recorded", "four", "two", "one", "gps"]


@pytest.mark.parametrize("name", NAMES)
def test_without_a_fault_all_epochs_are_served(scenes, name):
    outcome = safe(scenes[name].run())
    assert not outcome.alerts().any()
    assert len(outcome.rows) == len(scenes[name].epochs)


def test_four_satellites_will_do(bare):
    outcome = safe(bare.run(count=60))
    assert not outcome.alerts().any()
    assert {row.n_sats for row in outcome.rows} == {4}


@pytest.mark.parametrize("start_tow_s", [604_800.0 - 100.0, 604_800.0 - 61.0])
def test_the_week_may_roll_over(start_tow_s):
    outcome = safe(simulated_scene(start_tow_s=start_tow_s, epochs=90).run())
    assert not outcome.alerts().any()
    assert {row.gps_week for row in outcome.rows} == {2400, 2401}


@pytest.mark.parametrize("start_tow_s", [216_000.0 + 1200.0 - 100.0, 216_000.0 + 3600.0 - 61.0])
def test_the_modified_z_count_may_begin_again(start_tow_s):
    outcome = safe(simulated_scene(start_tow_s=start_tow_s, epochs=90).run())
    assert not outcome.alerts().any()
    assert min(modified_z_count_s(row.tow_s) for row in outcome.rows) == 0.0


def test_galileo_alone():
    outcome = safe(simulated_scene(systems="E", epochs=40).run())
    assert not outcome.alerts().any()


# --- numbers in the observations

BAD_NUMBERS = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1.0, 1e7, -1e7, 1e12, 1e30, -1e308, 1e308, 5e-324]


@st.composite
def damaged_numbers(draw, names):
    """Scene and fault: a number in a quantity of some satellites and bands of some receiver, for some epochs."""
    name = draw(st.sampled_from(names))
    who = draw(st.sampled_from(["user", "ground", 0]))
    quantity = draw(st.sampled_from(QUANTITIES))
    value = draw(st.sampled_from(BAD_NUMBERS))
    satellite = draw(st.one_of(st.none(), st.integers(0, 11)))
    band = draw(st.sampled_from([0, 2, slice(None)]))
    start, count = draw(st.integers(0, 12)), draw(st.sampled_from([1, 2, 7, 100]))
    return name, who, quantity, value, satellite, band, start, count


def damage_numbers(scenes, case):
    name, who, quantity, value, satellite, band, start, count = case
    scene = scenes[name]
    satellites = slice(None) if satellite is None else scene.satellites()[satellite % len(scene.satellites())]
    safe(scene.run(during(start, count, who, put(quantity, value, satellites, band)), count=24))


@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(case=damaged_numbers(["recorded", "four", "two", "gps"]))
def test_damaged_numbers(scenes, case):
    damage_numbers(scenes, case)


@pytest.mark.campaign
@settings(max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
@given(case=damaged_numbers(NAMES))
def test_damaged_numbers_at_length(scenes, case):
    damage_numbers(scenes, case)


@pytest.mark.parametrize("name", ["recorded", "four"])
@pytest.mark.parametrize("who", ["user", 0])
@pytest.mark.parametrize(
    ("tag", "value"), [("tow_s", np.nan), ("tow_s", np.inf), ("tow_s", -1.0), ("tow_s", 1e30), ("gps_week", -5)]
)
def test_impossible_time_tags(scenes, name, who, tag, value):
    """Such observations are as if missing; a single reference receiver needs two epochs again for a rate."""
    outcome = safe(scenes[name].run(during(FAULT, 1, who, lambda seen: replace(seen, **{tag: value})), count=20))
    assert "missing" in outcome.causes()
    assert not outcome.alerts()[FAULT + 2 :].any()


# --- receivers that are lost, step, slip, or say the same again


@pytest.mark.parametrize("receiver", [0, 3])
def test_one_of_four_receivers_lost(scenes, receiver):
    outcome = safe(scenes["four"].run(during(FAULT, 10, receiver, lost), count=100))
    subject = f"rr{receiver + 1}"
    assert [event.cause for event in outcome.events if event.subject == subject] == ["missing", "back", "used"]
    assert not outcome.alerts().any()


@pytest.mark.parametrize("name", ["recorded", "four"])
def test_all_receivers_lost(scenes, name):
    scene = scenes[name]
    outcome = safe(scene.run(during(FAULT, 20, "ground", lost), count=110))
    assert {"missing", "corrections_end", "station_unhealthy"} <= outcome.causes()
    gone = scene.epochs[FAULT + 1].key - outcome.first_key
    assert served(outcome).max() > gone / 1000.0 + SETTLED_AGAIN_S  # it all comes back
    silent = (outcome.seconds() >= gone / 1000.0) & (outcome.seconds() < gone / 1000.0 + 9.0)
    assert outcome.alerts()[silent].all()


SETTLED_AGAIN_S = 30.0


def silent(observed):
    """A receiver that is there and tracks nothing."""
    return ObservationEpoch(gps_week=observed.gps_week, tow_s=observed.tow_s)


@pytest.mark.parametrize("name", ["recorded", "four"])
@pytest.mark.parametrize("count", [1, 3, 20])
def test_airborne_receiver_lost(scenes, name, count):
    outcome = safe(scenes[name].run(during(FAULT, count, "user", silent), count=100))
    alerts = outcome.alerts()
    assert alerts[FAULT : FAULT + count].all()
    assert not alerts[:FAULT].any()
    assert not alerts[-1]
    assert "missing" in outcome.causes("observations")


@pytest.mark.parametrize("name", ["recorded", "four"])
@pytest.mark.parametrize("who", ["user", "ground", 0])
@pytest.mark.parametrize(("milliseconds", "carrier"), [(1.0, False), (1.0, True), (-1.0, False)])
def test_clock_steps_of_a_millisecond(scenes, name, who, milliseconds, carrier):
    """Of the code alone or with the carrier: both ends go on through it."""
    step = clock_step(milliseconds, carrier=carrier)
    outcome = safe(scenes[name].run(during(FAULT, 1000, who, step), count=20))
    assert not outcome.alerts().any()


# Of code and carrier [m]: beyond what is put down to noise and multipath.
STEPS = [(20.0, 0.0), (-60.0, 0.0), (5000.0, 0.0), (0.0, 0.19), (0.0, -2.0), (0.0, 100.0), (15.0, 15.0), (1e5, 1e5)]
steps = st.tuples(
    st.sampled_from(["recorded", "four", "two", "gps"]),
    st.sampled_from(["user", "ground", 0]),
    st.sampled_from(STEPS),
    st.integers(0, 15),
)


def step_one_satellite(scenes, case, count):
    name, who, step, satellite = case
    scene = scenes[name]
    chosen = scene.satellites()[satellite % len(scene.satellites())]
    safe(scene.run(during(FAULT, 1000, who, added(*step, chosen)), count=count))


@settings(max_examples=10, suppress_health_check=[HealthCheck.too_slow])
@given(case=steps)
def test_steps_and_slips_of_one_satellite(scenes, case):
    step_one_satellite(scenes, case, 30)


@pytest.mark.campaign
@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(case=steps)
def test_steps_and_slips_of_one_satellite_at_length(scenes, case):
    """Long enough for the filters to settle again on what is wrong."""
    step_one_satellite(scenes, case, None)


def drift(scene: Scene, bias_m: float, slope_mps: float, satellite: int):
    """The code of one receiver and satellite off by a bias and a ramp."""
    return lambda epochs: [
        changed(epoch, 0, added(bias_m + slope_mps * 0.5 * (k - FAULT), 0.0, satellite)) if k >= FAULT else epoch
        for k, epoch in enumerate(epochs)
    ]


@pytest.mark.parametrize(("receivers", "cause"), [("two", "two_frequency_divergence"), ("four", "b_value")])
def test_code_of_one_receiver_runs_away(scenes, receivers, cause):
    """As of a failing correlator: the B values find it, or with two receivers the divergence of their mean, and the H1
    level covers it until then."""
    scene = scenes[receivers]
    outcome = safe(scene.run(drift(scene, 0.0, 1.0, scene.satellites()[1]), count=80))
    assert cause in outcome.causes()


@pytest.mark.campaign
@pytest.mark.parametrize("receivers", ["two", "four"])
@pytest.mark.parametrize("bias_m", [0.0, 0.3, 1.0, 5.0, 9.0])
@pytest.mark.parametrize("slope_mps", [0.0, 0.02, 0.05, 0.2, -0.5, 3.0])
def test_multipath_and_ramps_of_one_receiver(scenes, receivers, bias_m, slope_mps):
    scene = scenes[receivers]
    for satellite in scene.satellites()[::4]:
        safe(scene.run(drift(scene, bias_m, slope_mps, satellite)))


@pytest.mark.parametrize("quantities", [QUANTITIES, ("code_m",), ("carrier_m",)])
@pytest.mark.parametrize("doppler", [pytest.param(True, marks=pytest.mark.campaign), False])
@pytest.mark.parametrize("who", [0, "ground", "user"])
def test_a_receiver_that_says_the_same_again(scenes, quantities, doppler, who):
    """A frozen output is not used, whatever else could tell: not even after the filters would have settled on it."""
    fault = frozen(FAULT, who, quantities)
    outcome = safe(scenes["four"].run(fault if doppler else both(without_doppler, fault), count=90))
    if who == 0:
        assert outcome.causes("rr1")
        assert not outcome.alerts().any()
    else:
        assert served(outcome).max() <= FAULT * 0.5


@pytest.mark.parametrize("quantities", [QUANTITIES, ("code_m",), ("carrier_m",)])
@pytest.mark.parametrize("who", ["ground", "user"])
def test_a_frozen_receiver_and_nothing_to_compare_with(bare, quantities, who):
    """Four satellites and no Doppler: the position would follow the satellites, kilometres in a minute."""
    outcome = safe(bare.run(both(without_doppler, frozen(FAULT, who, quantities)), count=90))
    assert served(outcome).max() <= FAULT * 0.5


@pytest.mark.parametrize(
    ("name", "late"),
    [
        ("one", 1),
        ("recorded", 1),
        *(pytest.param(n, k, marks=pytest.mark.campaign) for n in ("recorded", "one", "four") for k in (2, 20)),
    ],
)
def test_reference_receivers_with_a_wrong_time_tag(scenes, name, late):
    """Observations of a while ago under the present time: as many satellites fit within the limit as move slowly."""

    def fault(epochs):
        result = []
        for k, epoch in enumerate(epochs):
            week, tow_s = from_epoch_key(epoch.key)
            old = epochs[k - late] if k >= FAULT + late else None
            ground = epoch.ground if old is None else tuple(replace(o, gps_week=week, tow_s=tow_s) for o in old.ground)
            result.append(replace(epoch, ground=ground))
        return result

    outcome = safe(scenes[name].run(fault, count=100))
    assert "receiver_fault" in outcome.causes("rr1")
    assert outcome.alerts()[-1]


@pytest.mark.parametrize("name", ["recorded", "four"])
def test_no_satellites_at_all(scenes, name):
    outcome = safe(
        scenes[name].run(both(lambda e: [*e[:FAULT], *tracking_only([])(e[FAULT : FAULT + 4]), *e[FAULT + 4 :]]))
    )
    assert outcome.alerts()[FAULT : FAULT + 4].all()
    assert not outcome.alerts()[:FAULT].any()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_too_few_satellites(scenes, count):
    outcome = safe(scenes["four"].run(lambda e: e[:FAULT] + tracking_only(FOUR[:count])(e[FAULT:]), count=40))
    assert outcome.alerts()[FAULT:].all()


# --- time

DAY_S, WEEK_S = 86_400, 604_800


JUMPS_S = [1, -1, 20, 1200, -1200, DAY_S, -DAY_S, WEEK_S, 3 * WEEK_S]
SHORT_JUMPS = [("four", -1, 15), ("four", 20, 1), ("recorded", DAY_S, 1)]


@pytest.mark.parametrize(
    ("name", "jump_s", "count"),
    [
        *SHORT_JUMPS,
        *(
            pytest.param(name, jump_s, count, marks=pytest.mark.campaign)
            for name in ("recorded", "four")
            for jump_s in JUMPS_S
            for count in (1, 15)
            if (name, jump_s, count) not in SHORT_JUMPS
        ),
    ],
)
def test_time_jumps_and_comes_back(scenes, name, jump_s, count):
    """Some epochs under a wrong time, at both ends. Afterwards everything comes back without being switched off."""
    scene = scenes[name]
    outcome = safe(
        scene.run(
            lambda epochs: [
                retimed(epoch, 1000 * jump_s) if FAULT <= k < FAULT + count else epoch for k, epoch in enumerate(epochs)
            ]
        )
    )
    assert not outcome.rows[-1].alert
    assert (outcome.rows[-1].gps_week, outcome.rows[-1].tow_s) == from_epoch_key(scene.epochs[-1].key)


@pytest.mark.parametrize("name", ["recorded", "four"])
def test_epochs_twice_and_out_of_order(scenes, name):
    def fault(epochs):
        twice = [epoch for epoch in epochs[:20] for _ in range(2)]
        return [*twice, *epochs[22:24], *epochs[20:22], *epochs[24:]]

    outcome = safe(scenes[name].run(fault, count=60))
    assert "epoch_not_later" in outcome.causes()
    keys = [(row.gps_week, row.tow_s) for row in outcome.rows]
    assert keys == sorted(set(keys))
    assert not outcome.alerts()[30:].any()


# --- ephemerides


def one_ephemeris(scene: Scene, satellite: int, received: int, **values: float) -> Ephemeris:
    """The ephemeris in use of one satellite, received again at an epoch with some fields changed."""
    current = scene.chain._ground_state.integrity.receive.ephemerides.current
    columns = {name: np.where(np.arange(N_SATS) == satellite, getattr(current, name), np.nan) for name in FIELDS}
    for name, value in values.items():
        columns[name][satellite] = value
    week, tow_s = from_epoch_key(scene.epochs[received].key)
    return Ephemeris(gps_week=week, tow_s=tow_s, simulated=1.0, **columns)


EPHEMERIS_FACTORS = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1.0 + 1e-4, 1.01, 1e3, 1e308]


def damage_ephemeris(scenes, case):
    name, field, factor, ends, satellite, more = case
    scene = scenes[name]
    chosen = int(scene.satellites()[satellite % len(scene.satellites())])
    value = float(getattr(scene.chain._ground_state.integrity.receive.ephemerides.current, field)[chosen])
    with np.errstate(over="ignore", invalid="ignore"):
        bad = one_ephemeris(scene, chosen, 3, **{field: np.float64(value) * factor + more})
    safe(
        scene.run(
            ground_ephemerides=[bad] if "ground" in ends else [],
            user_ephemerides=[bad] if "user" in ends else [],
            count=30,
        )
    )


damaged_ephemerides = st.tuples(
    st.sampled_from(["recorded", "four", "gps"]),
    st.sampled_from([name for name in FIELDS if name not in ("iodc", "group_delay_e5b_s")]),
    st.sampled_from(EPHEMERIS_FACTORS),
    st.sampled_from([("ground",), ("user",), ("ground", "user")]),
    st.integers(0, 15),
    st.sampled_from([0.0, 1.0, -1e-5]),
)


@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(case=damaged_ephemerides)
def test_damaged_ephemerides(scenes, case):
    damage_ephemeris(scenes, case)


@pytest.mark.campaign
@settings(max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
@given(case=damaged_ephemerides)
def test_damaged_ephemerides_at_length(scenes, case):
    damage_ephemeris(scenes, case)


# Changes that pass the 250 m a new ephemeris may move a satellite; by radians, metres and seconds.
SMALL_CHANGES = {
    "omega_rad": 5e-6, "cus_rad": 5e-6, "i0_rad": 5e-6, "e": 5e-6, "crs_m": 100.0, "crc_m": 100.0, "idot_radps": 1e-8,
    "delta_n_radps": 5e-9, "af1_sps": 1e-10, "af2_sps2": 1e-13, "group_delay_s": 2e-7, "omega_dot_radps": 1e-8,
}  # fmt: skip


@pytest.mark.parametrize(
    ("field", "end"),
    [
        ("omega_rad", "ground"),
        ("cus_rad", "ground"),
        *(
            pytest.param(field, end, marks=pytest.mark.campaign)
            for field in SMALL_CHANGES
            for end in ("ground", "user", "both")
        ),
    ],
)
def test_an_ephemeris_that_changes_under_its_issue_of_data(scenes, request, field, end):
    """Long enough for the filters to settle on the other orbit. Known to one end alone, the CRC has to tell."""
    scene = scenes["gps"]
    every = scene.satellites()
    for satellite in every if request.node.get_closest_marker("campaign") else every[:3]:
        current = getattr(scene.chain._ground_state.integrity.receive.ephemerides.current, field)
        bad = one_ephemeris(scene, satellite, 3, **{field: current[satellite] + SMALL_CHANGES[field]})
        ends = {"both": ("ground", "user")}.get(end, (end,))
        outcome = safe(scene.run(**{f"{name}_ephemerides": [bad] for name in ends}))
        if end != "both" and "ephemeris_change" not in outcome.causes():  # the station did not refuse it at once
            used = np.array([np.isfinite(each.solution.s_vert[satellite]) for each in outcome.airborne])
            assert not used[80:].any()
            assert not outcome.alerts().any()


@pytest.mark.parametrize("name", ["recorded", "four"])
@pytest.mark.parametrize("end", ["ground", "user"])
def test_a_satellite_becomes_unhealthy(scenes, name, end):
    """Told to one end only: it is out of the position at once."""
    scene = scenes[name]
    chosen = int(scene.satellites()[0])
    sick = one_ephemeris(scene, chosen, FAULT, health=1.0)
    outcome = safe(scene.run(count=20, **{f"{end}_ephemerides": [sick]}))
    used = [np.isfinite(each.solution.s_vert[chosen]) for each in outcome.airborne]
    assert all(used[:FAULT])
    assert not any(used[FAULT:])
    assert not outcome.alerts().any()


def test_ephemerides_that_expire(scenes, monkeypatch):
    """Their validity ends (here early) and nothing new comes: the satellites go, and with them the service."""
    scene = scenes["four"]
    toe_s = np.nanmax(scene.chain._ground_state.integrity.receive.ephemerides.current.toe_tow_s)
    until = from_epoch_key(scene.epochs[FAULT].key)[1]
    monkeypatch.setattr("gbas_core.gnss.ephemeris.VALIDITY_S", np.full(N_SATS, until - toe_s - 0.1))
    outcome = safe(scene.run(count=20))
    assert "no_ephemeris" in outcome.causes()
    assert not outcome.alerts()[:FAULT].any()
    assert outcome.alerts()[FAULT:].all()


# --- the broadcast


@pytest.mark.parametrize(("silent_s", "alert"), [(3.0, False), (3.5, False), (4.0, True), (12.0, True)])
def test_a_silent_broadcast(scenes, silent_s, alert):
    """Guidance ends when the last type 1 message is more than 3.5 s old (GAST-C), and comes back with the next."""
    scene = scenes["four"]
    start = scene.epochs[FAULT].key
    channel = each_burst(lambda _: None, start, start + round(1000 * silent_s))
    outcome = safe(scene.run(channel=channel, count=60))
    assert outcome.alerts().any() == alert
    assert ("mt1_timeout" in outcome.causes()) == alert
    # The last message was of the epoch before the silence; from 3.5 s after it guidance may end.
    expected = (outcome.seconds() > 0.5 * (FAULT - 1) + 3.5) & (outcome.seconds() < 0.5 * FAULT + silent_s)
    np.testing.assert_array_equal(outcome.alerts() == 1.0, expected)


def test_a_broadcast_that_is_silent_for_long(scenes):
    """Then station data are forgotten too: they may have been withdrawn meanwhile."""
    scene = simulated_scene(airborne={"station_data_timeout_s": 20.0})
    start = scene.epochs[FAULT].key
    outcome = safe(scene.run(channel=each_burst(lambda _: None, start)))
    assert "station_data_timeout" in outcome.causes()
    assert served(outcome).max() <= FAULT * 0.5 + 3.5


def test_bursts_twice_or_in_any_order(scenes):
    """The receiver puts slots and frames in order, and what is repeated changes nothing."""
    scene = scenes["four"]
    plain = scene.run(count=60)
    for channel in (lambda _, bursts: bursts + bursts, lambda _, bursts: bursts[::-1]):
        outcome = safe(scene.run(channel=channel, count=60))
        for one, other in zip(plain.rows, outcome.rows, strict=True):
            assert one.fields() == other.fields()


def test_bursts_shuffled_over_epochs(scenes):
    rng = np.random.default_rng(1)
    waiting: list[Burst] = []

    def channel(_: int, bursts: tuple[Burst, ...]) -> list[Burst]:
        waiting.extend(bursts)
        rng.shuffle(waiting)
        number = int(rng.integers(0, len(waiting) + 1))
        arrived = waiting[:number]
        del waiting[:number]
        return arrived

    outcome = safe(scenes["four"].run(channel=channel, count=60))
    assert "burst_out_of_order" in outcome.causes("vdb")


@pytest.mark.parametrize("delay", [1, 4, 8, 20])
def test_a_broadcast_that_comes_late(scenes, delay):
    """Data time decides: bursts that are late by more than the time-out guide nobody."""
    waiting: list[tuple[Burst, ...]] = []

    def channel(_: int, bursts: tuple[Burst, ...]) -> tuple[Burst, ...]:
        waiting.append(bursts)
        return waiting.pop(0) if len(waiting) > delay else ()

    safe(scenes["four"].run(channel=channel, count=60))


def flipped(rng: np.random.Generator, count: int, burst: Burst) -> Burst:
    payload = bytearray(burst.payload)
    for place in rng.choice(len(payload), count, replace=False):
        payload[place] ^= int(rng.integers(1, 256))
    return replace(burst, payload=bytes(payload))


def test_three_wrong_bytes_in_every_burst(scenes):
    outcome = safe(scenes["four"].run(channel=each_burst(partial(flipped, np.random.default_rng(2), 3)), count=60))
    assert not outcome.alerts().any()


@pytest.mark.parametrize("count", [4, 20])
def test_more_wrong_bytes_than_can_be_corrected(scenes, count):
    outcome = safe(scenes["four"].run(channel=each_burst(partial(flipped, np.random.default_rng(3), count)), count=60))
    assert {"block_discarded", "mt1_timeout"} <= outcome.causes()
    assert outcome.alerts()[-1]


def test_truncated_bursts(scenes):
    rng = np.random.default_rng(4)
    cut = each_burst(lambda burst: replace(burst, payload=burst.payload[: int(rng.integers(0, len(burst.payload)))]))
    outcome = safe(scenes["four"].run(channel=cut, count=60))
    assert outcome.alerts()[-1]


def unchanged(message: Message) -> Message:
    return message


def unhealthy(message: Message) -> Message:
    return replace(message, gcid=7) if isinstance(message, Type2) else message


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (rewritten(unchanged, station_id="OTHR"), "mt1_timeout"),
        (rewritten(unchanged, test=True), "test_mode"),
        (rewritten(unhealthy), "station_unhealthy"),
    ],
)
def test_messages_that_must_not_guide(scenes, change, cause):
    """Another station's, a test's, an unhealthy station's: correct in every check."""
    scene = scenes["four"]
    start, stop = scene.epochs[FAULT].key, scene.epochs[FAULT + 12].key
    outcome = safe(scene.run(channel=each_burst(change, start, stop), count=80))
    assert cause in outcome.causes()
    assert outcome.alerts()[FAULT + 9 : FAULT + 12].all()
    assert not outcome.alerts()[-1]


def test_another_station_in_slots_of_its_own(scenes):
    """Two stations on one frequency: only the one that was selected is listened to."""
    other = rewritten(unhealthy, station_id="OTHR")
    outcome = safe(
        scenes["four"].run(channel=lambda _, b: (*b, *(replace(other(x), slot=x.slot + 4) for x in b)), count=60)
    )
    assert not outcome.alerts().any()


def old_bursts(shift_ms: int, restamped: bool, beside: bool) -> Callable[[int, tuple[Burst, ...]], tuple[Burst, ...]]:
    """From the 40th epoch on, what was sent `shift_ms` before: instead of, or beside, what is sent."""
    sent: dict[int, tuple[Burst, ...]] = {}

    def channel(key: int, bursts: tuple[Burst, ...]) -> tuple[Burst, ...]:
        sent[key] = bursts
        if len(sent) <= 40:
            return bursts
        week, tow_s = from_epoch_key(key)
        old = sent[key - shift_ms]
        if restamped:
            old = tuple(replace(burst, gps_week=week, tow_s=tow_s, slot=(burst.slot + 4 * beside) % 8) for burst in old)
        return bursts + old if beside else old

    return channel


@pytest.mark.parametrize("restamped", [False, True])
@pytest.mark.parametrize("beside", [False, True])
def test_bursts_of_some_seconds_ago(scenes, restamped, beside):
    """Under their own time or under a new one: the Z-count tells."""
    outcome = safe(scenes["four"].run(channel=old_bursts(15_000, restamped, beside), count=80))
    assert outcome.alerts()[-1] != beside
    if beside:
        assert not outcome.alerts().any()


def test_bursts_of_twenty_minutes_ago():
    """The same modified Z-count, and ephemerides that are still in use: only the time of the burst tells."""
    scene = simulated_scene(epochs=2600, flight=LONG_FLIGHT)
    recorded: dict[int, tuple[Burst, ...]] = {}

    def channel(key: int, bursts: tuple[Burst, ...]) -> tuple[Burst, ...]:
        recorded[key] = bursts
        return bursts if len(recorded) <= 20 else recorded.get(key - 1_200_000, ())

    outcome = safe(scene.run(lambda epochs: epochs[:40] + epochs[2400:2480], channel=channel))
    again = outcome.seconds() >= 1200.0
    assert again.sum() > 50
    assert outcome.alerts()[again].all()


LONG_FLIGHT = {"speed_mps": 70.0, "intercept_distance_m": 6000.0, "level_time_s": 1400.0, "pushover_time_s": 20.0}


def test_bursts_under_a_wrong_time(scenes):
    rng = np.random.default_rng(5)

    def moved(burst: Burst) -> Burst:
        week, tow_s = add_seconds(
            burst.gps_week, burst.tow_s, float(rng.choice([0.0, -1200.0, 1200.0, WEEK_S, -0.5, 0.5]))
        )
        return replace(burst, gps_week=week, tow_s=tow_s)

    safe(scenes["four"].run(channel=each_burst(moved), count=60))


@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32 - 1), rate=st.sampled_from([0.1, 0.5, 1.0]))
def test_anything_may_arrive(scenes, seed, rate):
    """Random bytes, lengths, slots and times among the bursts."""
    rng = np.random.default_rng(seed)

    def channel(key: int, bursts: tuple[Burst, ...]) -> tuple[Burst, ...]:
        week, tow_s = from_epoch_key(key + int(rng.integers(-5, 5)) * 500)
        noise = Burst(
            gps_week=week, tow_s=tow_s, slot=int(rng.integers(0, 8)), bursts_in_frame=int(rng.integers(0, 9)),
            payload=rng.bytes(int(rng.integers(0, 300))),
        )  # fmt: skip
        return (*bursts, noise) if rng.random() < rate else bursts

    safe(scenes["four"].run(channel=channel, count=24))


# --- records between the nodes


@pytest.fixture(scope="module")
def records(scenes) -> tuple[IntegrityEpoch, SolutionEpoch, Any]:
    """Integrity and solution of one epoch, and the chain that made them."""
    outcome = scenes["four"].run(count=2)
    return outcome.ground[-1].integrity, outcome.airborne[-1].solution, scenes["four"].chain


@pytest.mark.parametrize(
    "name", [item.name for item in fields(IntegrityEpoch) if item.name not in ("gps_week", "tow_s")]
)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, -1.0, 0.5, 1e9, 1e308])
def test_damaged_integrity_is_not_broadcast(records, name, value):
    """Whatever number is in the monitor's table: what is sent of a satellite was there, and could be sent; the station
    stays on the air all the same."""
    integrity, _, chain = records
    assert len(_sent(integrity, chain)) >= 4
    current = getattr(integrity, name)
    damaged = replace(
        integrity, **{name: value if np.ndim(current) == 0 else np.where(np.isfinite(current), value, current)}
    )
    for satellite, (measurement, first_p) in _sent(damaged, chain).items():
        for column, (low, high) in SENDABLE.items():
            number = getattr(damaged, column)
            made = number[[L1_100, L1_30]] if np.ndim(number) > 1 else number  # of every product the station makes
            sent = np.asarray(made if np.ndim(number) == 0 else made[..., satellite])
            assert ((low <= sent) & (sent <= high)).all(), column
        b_m = damaged.b_m[L1_100, :, satellite]
        assert (np.isnan(b_m) | (np.abs(b_m) <= 6.35)).all()
        assert np.isnan(first_p) or first_p >= damaged.p_ephemeris[L1_100, satellite]
        assert measurement.iod == damaged.iod[satellite] % 256  # IODnav has 10 bits, the message sends 8
        # Half a step of the messages: 0.01 m, 0.001 m/s, 0.05 m; sigmas go up to the next 0.02 m.
        assert measurement.prc_m == pytest.approx(damaged.prc_m[L1_100, satellite], abs=0.0051)
        assert measurement.rrc_mps == pytest.approx(damaged.rrc_mps[L1_100, satellite], abs=0.00051)
        assert measurement.b_values_m == pytest.approx(tuple(b_m), abs=0.0251, nan_ok=True)
        assert 0.0 <= measurement.sigma_pr_gnd_m - damaged.sigma_pr_gnd_m[L1_100, satellite] + 1e-6 < 0.021


# Bounds of the fields, ICAO Annex 10 vol. I, tables B-64, B-65 and B-70; a correction and its rate beyond their own
# limits, and a station without a receiver or with more than four, are not sent either.
SENDABLE: dict[str, tuple[float, float]] = {
    "state": (2, 2), "n_receivers": (1, 4), "sigma_vert_iono_gradient": (0.0, 25.5e-6), "iod": (0, 1023),
    "ephemeris_crc": (0, 0xFFFF), "p_ephemeris": (0.0, 1.275e-3),
    "prc_m": (-327.67, 327.67), "rrc_mps": (-32.767, 32.767),
    "sigma_pr_gnd_m": (1e-300, 5.08), "sigma_pr_gnd_d_m": (1e-300, 5.08),
}  # fmt: skip


def _sent(integrity: IntegrityEpoch, chain: Any) -> dict[int, tuple[Correction100, float]]:
    """Valid corrections of a frame by satellite, each with P of the message where it is that of the satellite."""
    _, bursts = chain._station.broadcast(BroadcastState(), integrity)
    assert bursts
    found: dict[int, tuple[Correction100, float]] = {}
    for burst in bursts:
        decoded = decode_burst(burst)
        assert decoded.errors == ()
        for block in decoded.blocks:
            if isinstance(block.message, Type1):
                for place, each in enumerate(block.message.measurements):
                    first_p = block.message.ephemeris_decorrelation if place == 0 else np.nan
                    if np.isfinite(each.sigma_pr_gnd_m):
                        satellite = int(np.flatnonzero(each.ranging_source_id == RANGING_SOURCE_ID)[0])
                        found[satellite] = each, first_p
    return found


# What a protection level, a limit or the service is made of; the others are for people.
MATTERS = (
    "mode", "x_m", "y_m", "z_m", "n_receivers", "correction_age_s", "message_age_s", "gcid", "k_md_e", "fasval_m",
    "faslal_m", "apd", "d_vert_m", "d_lat_m", "s_vert", "s_lat", "sigma_gnd_m", "sigma_air_m", "sigma_tropo_m",
    "sigma_iono_m", "b_m", "ephemeris_error_m",
)  # fmt: skip


@pytest.mark.parametrize("name", MATTERS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_damaged_solution_is_an_alert(records, name, value):
    _, solution, chain = records
    current = getattr(solution, name)
    params: AirborneParams = chain._airborne_params
    _, good, _ = AirborneReceiver.protect(ServiceState(), solution, params)
    assert good.alert == 0.0
    damaged = replace(
        solution, **{name: value if np.ndim(current) == 0 else np.where(np.isfinite(current), value, current)}
    )
    _, protection, _ = AirborneReceiver.protect(ServiceState(), damaged, params)
    assert protection.alert == 1.0


@pytest.mark.parametrize("name", ["d_vert_m", "d_lat_m", "k_md_e", "ephemeris_error_m", "sigma_gnd_m", "sigma_iono_m"])
def test_a_negative_size_is_an_alert(records, name):
    _, solution, chain = records
    current = getattr(solution, name)
    damaged = replace(
        solution, **{name: -1.0 if np.ndim(current) == 0 else np.where(np.isfinite(current), -1.0, current)}
    )
    _, protection, _ = AirborneReceiver.protect(ServiceState(), damaged, chain._airborne_params)
    assert protection.alert == 1.0
