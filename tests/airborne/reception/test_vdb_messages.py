"""From bursts to what the station told: what is taken, what is discarded and counted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import WEEK, Flight, World, burst_of, fas_data_set, station_data
from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.station_data import Corrections
from gbas_airborne.reception.vdb_messages import reception_step
from gbas_airborne.reception.vdb_state import ReceptionState
from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_core.satellites import SAT_INDEX, SOURCE_ID_INDEX
from gbas_msgs_py.events import Event
from gbas_vdb.messages.types import Correction30, Correction100, Type1, Type3, Type4, Type8, Type11
from gbas_vdb.transmission.burst import Burst

TOW_S = 345_600.5
PARAMS = AirborneParams()
AUTHENTIC = AirborneParams(authentication=True)


def corrections(*sources: int, **changes: object) -> tuple[Correction100, ...]:
    values = {"iod": 33, "prc_m": 1.25, "rrc_mps": -0.012, "sigma_pr_gnd_m": 0.3}
    values |= {"b_values_m": (0.1, -0.1, 0.0, math.nan)}
    return tuple(Correction100(ranging_source_id=source, **(values | changes)) for source in sources)


def type1(
    *sources: int, flag: int = 0, z_count_s: float | None = None, tow_s: float = TOW_S, **changes: object
) -> Type1:
    return Type1(
        modified_z_count_s=modified_z_count_s(tow_s) if z_count_s is None else z_count_s,
        additional_message_flag=flag,
        ephemeris_decorrelation=1.5e-4 if sources else math.nan,
        ephemeris_crc=0x1234 if sources else None,
        measurements=corrections(*sources, **changes),
    )


def received(
    *bursts: Burst, state: ReceptionState | None = None, tow_s: float = TOW_S, params: AirborneParams = PARAMS
) -> tuple[ReceptionState, tuple[Event, ...]]:
    return reception_step(state or ReceptionState(), bursts, WEEK, tow_s, params)


def received_corrections(state: ReceptionState) -> Corrections | None:
    """Corrections of the only product type 1 messages carry."""
    assert set(state.corrections) <= {"l1_100"}
    return state.corrections.get("l1_100")


def frame(*messages: object, tow_s: float = TOW_S, slot: int = 0, **how: object) -> Burst:
    return burst_of(messages, WEEK, tow_s, slot=slot, **how)


def selected(**changes: object) -> ReceptionState:
    """A receiver that has heard station data."""
    return received(frame(station_data(**changes)))[0]


def test_station_data_selects_the_station() -> None:
    state, events = received(frame(station_data(n_reference_receivers=3, gcid=2, d_max_m=36_000.0, k_md_e=4.5)))
    assert state.station_id == "EDVE"
    assert state.station is not None
    assert (state.station.n_receivers, state.station.gcid) == (3, 2)
    assert (state.station.d_max_m, state.station.k_md_e) == (36_000.0, 4.5)
    assert [event.cause for event in events] == ["station_selected"]


def test_station_data_without_additional_block_1_has_no_ephemeris_bound() -> None:
    state, _ = received(frame(replace(station_data(), adb1=None)))
    assert state.station is not None
    assert math.isnan(state.station.k_md_e)
    assert state.station.d_max_m == math.inf


def test_a_multiplier_of_zero_is_no_multiplier() -> None:
    state = selected(k_md_e=0.0)
    assert state.station is not None
    assert math.isnan(state.station.k_md_e)


def test_corrections_land_on_the_satellite_axis() -> None:
    state, _ = received(frame(type1(5, 71)), state=selected())
    assert received_corrections(state) is not None
    for satellite in ("G05", "E01"):
        index = SAT_INDEX[satellite]
        assert received_corrections(state).prc_m[index] == pytest.approx(1.25, abs=1e-12)
        assert received_corrections(state).rrc_mps[index] == pytest.approx(-0.012, abs=1e-12)
        assert received_corrections(state).sigma_m[index] == pytest.approx(0.3, abs=1e-12)
        np.testing.assert_allclose(received_corrections(state).b_m[:, index], [0.1, -0.1, 0.0, np.nan], atol=1e-12)
    assert np.isfinite(received_corrections(state).listed).sum() == 2
    assert (received_corrections(state).gps_week, received_corrections(state).tow_s) == (WEEK, TOW_S)
    assert received_corrections(state).received == (WEEK, TOW_S)


def test_first_measurement_carries_the_ephemeris_check() -> None:
    state, _ = received(frame(type1(5, 6)), state=selected())
    first, second = SOURCE_ID_INDEX[5], SOURCE_ID_INDEX[6]
    assert (state.checks.iod[first], state.checks.crc[first]) == (33.0, 0x1234)
    assert state.checks.p[first] == pytest.approx(1.5e-4, abs=1e-12)
    assert np.isnan(state.checks.crc[second])


def test_p_d_is_of_the_issue_it_was_told_with() -> None:
    """A new issue of data has none until a type 11 message tells it."""
    satellite, other = SOURCE_ID_INDEX[5], SOURCE_ID_INDEX[6]

    def type11(source: int) -> Type11:
        values = {"prc_30_m": 1.0, "rrc_30_mps": 0.0, "sigma_pr_gnd_d_m": 0.3, "sigma_pr_gnd_30_m": 0.4}
        return Type11(
            modified_z_count_s=modified_z_count_s(TOW_S),
            additional_message_flag=0,
            ephemeris_decorrelation_d=1e-4,
            measurements=(Correction30(ranging_source_id=source, **values),),
        )

    state, _ = received(frame(type1(5)), frame(type11(5), slot=1), frame(type11(6), slot=2), state=selected())
    state, _ = received(frame(type1(5)), state=state)
    assert state.p_d is not None
    assert np.isfinite(state.p_d[[satellite, other]]).all()  # said again, nothing is new
    state, _ = received(frame(type1(5, iod=34)), state=state)
    assert state.p_d is not None
    assert np.isnan(state.p_d[satellite])
    assert np.isfinite(state.p_d[other])
    state, _ = received(frame(type11(5), slot=1), state=state)
    assert state.p_d is not None
    assert np.isfinite(state.p_d[satellite])


def test_unknown_sources_are_left_out() -> None:
    """SBAS and GLONASS sources are not on the suite's axis."""
    state, _ = received(frame(type1(40, 5, 120)), state=selected())
    assert received_corrections(state) is not None
    assert np.flatnonzero(np.isfinite(received_corrections(state).listed)).tolist() == [SOURCE_ID_INDEX[5]]


def test_empty_type1_is_a_valid_message() -> None:
    state, _ = received(frame(type1()), state=selected())
    assert received_corrections(state).received == (WEEK, TOW_S)
    assert received_corrections(state) is not None
    assert not np.isfinite(received_corrections(state).listed).any()


def test_a_satellite_missing_from_the_newest_message_is_gone() -> None:
    state, _ = received(frame(type1(5, 6)), state=selected())
    state, _ = received(frame(type1(6, tow_s=TOW_S + 0.5), tow_s=TOW_S + 0.5), state=state, tow_s=TOW_S + 0.5)
    assert received_corrections(state) is not None
    assert np.flatnonzero(np.isfinite(received_corrections(state).listed)).tolist() == [SOURCE_ID_INDEX[6]]


def test_nothing_is_used_before_station_data() -> None:
    state, _ = received(frame(type1(5)))
    assert received_corrections(state) is None
    assert state.counts.unusable == 1


def test_other_measurement_types_are_not_l1() -> None:
    state, _ = received(frame(replace(type1(5), measurement_type=1)), state=selected())
    assert received_corrections(state) is None
    assert state.counts.unusable == 1


# --- linked pairs


def test_linked_pair_is_used_when_both_are_there() -> None:
    state, _ = received(frame(type1(5, 6, flag=1)), frame(type1(7, 8, flag=3), slot=1), state=selected())
    assert received_corrections(state) is not None
    assert np.isfinite(received_corrections(state).listed).sum() == 4
    assert state.pending_pair is None


def test_half_a_pair_is_not_used() -> None:
    state, _ = received(frame(type1(5, 6, flag=1)), state=selected())
    assert received_corrections(state) is None


@pytest.mark.parametrize("flag", [1, 3])
def test_a_pair_of_different_z_counts_is_not_used(flag: int) -> None:
    state, _ = received(frame(type1(5, flag=flag)), state=selected())
    later = TOW_S + 0.5
    state, _ = received(frame(type1(7, flag=4 - flag, tow_s=later), tow_s=later), state=state, tow_s=later)
    assert received_corrections(state) is None
    assert state.counts.unpaired == 1


def test_two_first_halves_are_no_pair() -> None:
    state, _ = received(frame(type1(5, flag=1)), frame(type1(7, flag=1), slot=1), state=selected())
    assert received_corrections(state) is None
    assert state.counts.unpaired == 1


def test_halves_of_a_pair_twenty_minutes_apart_are_no_pair() -> None:
    """The modified Z-count is the same again."""
    state, _ = received(frame(type1(5, flag=1)), state=selected())
    later_s = TOW_S + 1200.0
    state, _ = received(frame(type1(71, flag=3, tow_s=later_s), tow_s=later_s), state=state, tow_s=later_s)
    assert received_corrections(state) is None


def test_a_single_message_ends_the_wait_for_the_second() -> None:
    bursts = frame(type1(5, flag=1)), frame(type1(6), slot=1), frame(type1(7, flag=3), slot=2)
    state, _ = received(*bursts, state=selected())
    assert received_corrections(state) is not None
    assert np.flatnonzero(np.isfinite(received_corrections(state).listed)).tolist() == [SOURCE_ID_INDEX[6]]
    assert state.counts.unpaired == 1


# --- times


def test_z_count_is_resolved_to_the_frame() -> None:
    """At 20 minutes past the hour the count starts again; corrections made just before belong to just before."""
    tow_s = 1200.0
    state, _ = received(
        frame(station_data(), tow_s=tow_s),
        frame(type1(5, z_count_s=1199.5), tow_s=tow_s, slot=1),
        tow_s=tow_s,
    )
    assert received_corrections(state) is not None
    assert (received_corrections(state).gps_week, received_corrections(state).tow_s) == (WEEK, 1199.5)


@pytest.mark.parametrize("offset_s", [0.5, 3.0, -10.5, -300.0, 500.0])
def test_z_count_far_from_the_frame_is_refused(offset_s: float) -> None:
    z_count_s = modified_z_count_s(TOW_S + offset_s)
    state, events = received(frame(type1(5, z_count_s=z_count_s)), state=selected())
    assert received_corrections(state) is None
    assert [event.cause for event in events] == ["z_count"]
    assert events[0].value == pytest.approx(-offset_s)


def test_older_corrections_do_not_replace_newer() -> None:
    state, _ = received(frame(type1(5)), state=selected())
    state, _ = received(frame(type1(6, tow_s=TOW_S - 1.0), tow_s=TOW_S - 1.0), state=state)
    assert received_corrections(state) is not None
    assert received_corrections(state).tow_s == TOW_S


def test_a_burst_of_an_earlier_frame_comes_too_late() -> None:
    """Else old station data would make a station healthy again."""
    state = selected(gcid=7)
    old = frame(station_data(gcid=1), tow_s=TOW_S - 5.0)
    state, events = received(old, state=state)
    assert state.station is not None
    assert state.station.gcid == 7
    assert [event.cause for event in events] == ["burst_out_of_order"]
    assert state.counts.unusable == 1


def test_station_data_that_are_not_repeated_are_forgotten() -> None:
    state = selected()
    for seconds, known in ((30.0, True), (60.0, True), (60.5, False)):
        tow_s = TOW_S + seconds
        state, events = received(frame(type1(5, tow_s=tow_s), tow_s=tow_s), state=state, tow_s=tow_s)
        assert (state.station is not None) == known
    assert [event.cause for event in events] == ["station_data_timeout"]
    assert received_corrections(state) is None


def test_an_approach_that_is_not_repeated_is_forgotten() -> None:
    params = AirborneParams(rpds=5)
    state, _ = received(frame(station_data(), Type4(data_sets=(fas_data_set(),))), params=params)
    assert state.approach is not None
    for seconds in (30.0, 60.5):
        tow_s = TOW_S + seconds
        state, events = received(frame(station_data(), tow_s=tow_s), state=state, tow_s=tow_s, params=params)
    assert state.approach is None
    assert state.station is not None
    assert [event.cause for event in events] == ["approach_timeout"]


def test_later_frames_wait_for_their_epoch() -> None:
    state, _ = received(frame(type1(5, tow_s=TOW_S + 1.0), tow_s=TOW_S + 1.0), state=selected())
    assert received_corrections(state) is None
    assert len(state.waiting) == 1
    state, _ = received(state=state, tow_s=TOW_S + 0.5)
    assert received_corrections(state) is None
    state, _ = received(state=state, tow_s=TOW_S + 1.0)
    assert received_corrections(state) is not None
    assert state.waiting == ()


@pytest.mark.parametrize(("wait_s", "taken"), [(0.0, False), (0.4, False), (0.5, True), (1.0, True)])
def test_wait_decides_which_frame_an_epoch_may_use(wait_s: float, taken: bool) -> None:
    params = AirborneParams(correction_wait_s=wait_s)
    state, _ = received(frame(station_data()), frame(type1(5), slot=1), params=params)
    assert (received_corrections(state) is not None) == taken


# --- whose messages


def test_another_station_is_not_listened_to_while_ours_speaks() -> None:
    state = selected()
    state, _ = received(
        frame(station_data(gcid=2), station_id="LFBO", slot=3), frame(type1(5), station_id="LFBO", slot=4), state=state
    )
    assert state.station_id == "EDVE"
    assert received_corrections(state) is None
    assert state.counts.other_station == 2


def test_a_change_of_station_discards_everything() -> None:
    params = AirborneParams(rpds=5)
    state = received(frame(station_data()), frame(Type4(data_sets=(fas_data_set(),)), slot=1), params=params)[0]
    state, _ = received(frame(type1(5)), state=state, params=params)
    assert state.approach is not None
    later = TOW_S + 4.0  # silent for longer than the time-out
    message = frame(station_data(rsds=9), tow_s=later, station_id="EDXX")
    state, events = received(message, state=state, tow_s=later, params=params)
    assert state.station_id == "EDXX"
    assert received_corrections(state) is None
    assert state.approach is None
    assert not np.isfinite(state.checks.crc).any()
    assert [event.cause for event in events] == ["station_changed", "station_selected"]


def test_corrections_of_another_station_never_select_it() -> None:
    later = TOW_S + 60.0
    state, _ = received(frame(type1(5, tow_s=later), tow_s=later, station_id="EDXX"), state=selected(), tow_s=later)
    assert state.station_id == "EDVE"
    assert received_corrections(state) is None


def test_a_change_of_rsds_discards_everything() -> None:
    state, _ = received(frame(type1(5)), state=selected(rsds=3))
    state, events = received(frame(station_data(rsds=4)), state=state)
    assert state.station is not None
    assert state.station.rsds == 4
    assert received_corrections(state) is None
    assert events[0].cause == "rsds_changed"
    assert (events[0].value, events[0].threshold) == (4.0, 3.0)


def test_only_the_expected_station_is_listened_to() -> None:
    params = AirborneParams(station_id="LFBO")
    state, _ = received(frame(station_data()), params=params)
    assert state.station_id is None
    state, _ = received(frame(station_data(), station_id="LFBO"), state=state, params=params)
    assert state.station_id == "LFBO"


def test_gcid_changes_are_told() -> None:
    state, events = received(frame(station_data(gcid=7)), state=selected(gcid=1))
    assert [(e.cause, e.value, e.threshold) for e in events] == [("gcid_changed", 7.0, 1.0)]
    assert state.station is not None
    assert state.station.gcid == 7


# --- what is discarded


def test_test_messages_end_guidance() -> None:
    state, _ = received(frame(type1(5)), state=selected())
    state, events = received(frame(type1(5), test=True), state=state)
    assert state.station is None
    assert received_corrections(state) is None
    assert state.counts.test == 1
    assert [event.cause for event in events] == ["test_mode"]


def test_test_filler_ends_nothing() -> None:
    state, _ = received(frame(Type3(n_fill_bytes=20), test=True), state=selected())
    assert state.station is not None
    assert state.counts.test == 1


def test_test_messages_select_no_station() -> None:
    state, _ = received(frame(station_data(), test=True))
    assert state.station_id is None


def test_a_damaged_burst_is_discarded_and_counted() -> None:
    good = frame(type1(5, 6, 7))
    payload = bytearray(good.payload)
    for place in (3, 20, 30, 41, 47):  # more than the three bytes the code repairs
        payload[place] ^= 0x5A
    state, events = received(replace(good, payload=bytes(payload)), state=selected())
    assert received_corrections(state) is None
    assert state.counts.failed >= 1
    assert [event.cause for event in events] == ["block_discarded"]


def test_three_wrong_bytes_are_repaired() -> None:
    good = frame(type1(5, 6, 7))
    payload = bytearray(good.payload)
    for place in (3, 20, 30):
        payload[place] ^= 0x5A
    state, _ = received(replace(good, payload=bytes(payload)), state=selected())
    assert received_corrections(state) is not None
    assert state.counts.corrected_bytes == 3


@pytest.mark.parametrize(
    "broken",
    [
        {"payload": b""},
        {"payload": b"\x00" * 5},
        {"payload": b"\xff" * 228},
        {"tow_s": math.nan},
        {"tow_s": math.inf},
        {"slot": -1},
        {"slot": 8},
    ],
)
def test_nonsense_is_counted_and_forgotten(broken: dict[str, object]) -> None:
    state, _ = received(replace(frame(type1(5)), **broken), state=selected())
    assert received_corrections(state) is None
    assert state.waiting == ()
    assert state.counts.failed >= 1


# --- approaches


def test_the_selected_approach_is_kept() -> None:
    data_sets = (fas_data_set(rpds=4, rpi="GXXX"), fas_data_set(rpds=5, fasval_m=9.5, faslal_m=38.0))
    params = AirborneParams(rpds=5)
    state, events = received(frame(station_data()), frame(Type4(data_sets=data_sets), slot=1), params=params)
    assert state.approach is not None
    assert (state.approach.rpds, state.approach.rpi) == (5, "GEDV")
    assert (state.approach.fasval_m, state.approach.faslal_m) == (pytest.approx(9.5), pytest.approx(38.0))
    assert "approach_received" in {event.cause for event in events}
    # Repeated, as it is every ten seconds, it is no news.
    _, events = received(frame(Type4(data_sets=data_sets)), state=state, params=params)
    assert events == ()


def test_no_approach_without_selection() -> None:
    state, _ = received(frame(Type4(data_sets=(fas_data_set(),))), state=selected())
    assert state.approach is None


@pytest.mark.parametrize(
    ("data_set", "cause"),
    [
        (fas_data_set(provider=1), "fas_not_for_gbas"),
        (replace(fas_data_set(), fas=replace(fas_data_set().fas, operation_type=1)), "fas_not_straight_in"),
        (
            replace(
                fas_data_set(),
                fas=replace(fas_data_set().fas, delta_fpap_latitude_rad=0.0, delta_fpap_longitude_rad=0.0),
            ),
            "fas_out_of_bounds",
        ),
    ],
)
def test_unsuitable_approaches_are_refused(data_set: object, cause: str) -> None:
    params = AirborneParams(rpds=5)
    state, events = received(frame(station_data()), frame(Type4(data_sets=(data_set,)), slot=1), params=params)
    assert state.approach is None
    assert cause in {event.cause for event in events}


# --- authentication


def test_slots_of_the_group_are_accepted() -> None:
    state, _ = received(frame(station_data(slot_group=0b11)), frame(type1(5), slot=1), params=AUTHENTIC)
    assert received_corrections(state) is not None


def test_slots_outside_the_group_are_rejected() -> None:
    state, _ = received(frame(station_data(slot_group=0b11)), frame(type1(5), slot=2), params=AUTHENTIC)
    assert received_corrections(state) is None
    assert state.counts.not_authentic == 1


def test_station_data_from_outside_its_own_group_is_rejected() -> None:
    state, _ = received(frame(station_data(slot_group=0b11), slot=4), params=AUTHENTIC)
    assert state.station is None


def test_station_data_without_a_group_is_rejected() -> None:
    state, events = received(frame(station_data()), params=AUTHENTIC)
    assert state.station is None
    assert events[0].cause == "slot_group"


def test_an_unexpected_group_is_rejected() -> None:
    params = AirborneParams(authentication=True, slot_group="AB")
    state, events = received(frame(station_data(slot_group=0b101)), params=params)
    assert state.station is None
    assert (events[0].value, events[0].threshold) == (5.0, 3.0)
    state, _ = received(frame(station_data(slot_group=0b11)), params=params)
    assert state.station is not None


def test_without_authentication_groups_do_not_matter() -> None:
    state, _ = received(frame(station_data(slot_group=0b11)), frame(type1(5), slot=5))
    assert received_corrections(state) is not None


@pytest.mark.parametrize(("slot", "letter"), list(enumerate("AXZJCVPT")))
def test_the_path_identifier_names_the_first_slot(slot: int, letter: str) -> None:
    """Known letters of the slots A to H."""
    params = AirborneParams(authentication=True, rpds=5)
    station = frame(station_data(slot_group=1 << slot), slot=slot)
    right = frame(Type4(data_sets=(fas_data_set(rpi=f"{letter}EDV"),)), slot=slot)
    wrong = frame(Type4(data_sets=(fas_data_set(rpi="GEDV"),)), slot=slot)
    assert received(station, right, params=params)[0].approach is not None
    state, events = received(station, wrong, params=params)
    assert state.approach is None
    assert "fas_not_authentic" in {event.cause for event in events}


# --- message type 11 and long runs


def test_type_11_is_kept_for_later_use() -> None:
    def message(z_count_s: float, flag: int) -> Type11:
        values = {"prc_30_m": 1.0, "rrc_30_mps": 0.0, "sigma_pr_gnd_d_m": 0.2, "sigma_pr_gnd_30_m": 0.3}
        return Type11(
            modified_z_count_s=z_count_s,
            additional_message_flag=flag,
            ephemeris_decorrelation_d=1e-4,
            measurements=(Correction30(ranging_source_id=5, **values),),
        )

    z_count_s = modified_z_count_s(TOW_S)
    state, _ = received(frame(message(z_count_s, 1)), frame(message(z_count_s, 3), slot=1), state=selected())
    assert [m.additional_message_flag for m in state.type11] == [1, 3]
    state, _ = received(frame(message(z_count_s + 0.5, 0), slot=1), state=state)
    assert len(state.type11) == 1


def test_more_satellites_than_one_message_holds() -> None:
    """Twenty and more satellites come as a linked pair and are all used."""
    world = World(mask_rad=math.radians(5.0))
    world.satellites = [*world.satellites, *[s for s in range(24) if s not in world.satellites]][:22]
    assert len(world.type1(0.0)) == 2
    flight = Flight(world, AirborneParams(settle_s=2.0, elevation_mask_rad=math.radians(5.0)))
    flight.run(0.0, 3.0)
    assert np.isfinite(flight.state.position.reception.vdb.corrections["l1_100"].listed).sum() == 22


# --- corrections of a second frequency


def type8(*sources: int, kind: int = 0, flag: int = 0, tow_s: float = TOW_S, **changes: object) -> Type8:
    return Type8(
        modified_z_count_s=modified_z_count_s(tow_s),
        additional_message_flag=flag,
        measurement_type=kind,
        measurements=corrections(*sources, **changes),
    )


def test_private_messages_are_corrections_of_their_product() -> None:
    state, events = received(frame(type8(5, 71), type8(5, kind=1, prc_m=-2.5)), state=selected())
    assert set(state.corrections) == {"l5_100", "l5_30"}
    assert np.flatnonzero(np.isfinite(state.corrections["l5_100"].listed)).tolist() == [4, SAT_INDEX["E01"]]
    assert state.corrections["l5_30"].prc_m[4] == pytest.approx(-2.5, abs=1e-12)
    assert state.corrections["l5_30"].received == (WEEK, TOW_S)
    assert not events
    assert state.counts.unusable == 0


def test_halves_of_a_private_pair_make_a_set_in_either_order_within_one_frame() -> None:
    first, second = type8(5, flag=1), type8(6, flag=3)
    for order in ((first, second), (second, first)):
        state, _ = received(frame(*order), state=selected())
        assert np.flatnonzero(np.isfinite(state.corrections["l5_100"].listed)).tolist() == [4, 5]
        assert state.counts.unpaired == 0
    state, _ = received(frame(first), state=selected())
    assert "l5_100" not in state.corrections
    later = TOW_S + 0.5
    state, _ = received(frame(type8(6, flag=3, tow_s=later), tow_s=later), state=state, tow_s=later)
    assert "l5_100" not in state.corrections
    assert state.counts.unpaired == 1
    state, _ = received(frame(type8(7, tow_s=later), tow_s=later), state=state, tow_s=later)
    assert np.flatnonzero(np.isfinite(state.corrections["l5_100"].listed)).tolist() == [6]
    assert state.counts.unpaired == 2


def test_pairs_of_two_products_do_not_mix() -> None:
    state, _ = received(frame(type8(5, flag=1), type8(6, flag=3, kind=1)), state=selected())
    assert not state.corrections


def test_private_messages_that_cannot_be_used_are_counted() -> None:
    state, _ = received(frame(type8(5, kind=2)), state=selected())
    assert state.counts.unusable == 1
    state, _ = received(frame(type8(5)))  # before station data
    assert state.counts.unusable == 1
    state, events = received(frame(type8(5, tow_s=TOW_S - 60.0)), state=selected())
    assert not state.corrections
    assert [(event.subject, event.cause) for event in events] == [("type8", "z_count")]
