"""From integrity to bursts and back: what arrives is what was meant, and what is not usable does not leave."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_core.positioning.approach import FinalApproach
from gbas_core.satellites import IS_GPS, RANGING_SOURCE_ID, SOURCE_ID_INDEX
from gbas_ground.broadcast import BroadcastState, empty_integrity
from gbas_ground.sections import GCID_UNHEALTHY
from gbas_ground.station import GroundStation
from gbas_msgs_py.codes import ChannelState
from gbas_msgs_py.products import L1_30, L1_100, PRODUCT_INDEX
from gbas_vdb.messages.types import Type1, Type2, Type4, Type11
from gbas_vdb.transmission.receive import decode_burst
from ground_runs import half_seconds, params, run
from synthetic_ranges import TOW_S, WEEK, truth

# Half of the last bit of each field (ICAO Annex 10 vol. I, table B-63), with room for the rounding of the conversion.
HALF = {"prc": 0.005, "rrc": 0.0005, "b": 0.025}
SIGMA_LSB = 0.02
EPSILON = 1e-9


def messages(bursts, kind):
    """Messages of one type in a frame."""
    decoded = [decode_burst(burst) for burst in bursts]
    assert not any(each.errors for each in decoded)
    return [block.message for each in decoded for block in each.blocks if isinstance(block.message, kind)]


def noisy(receivers=4, **changes):
    rng = np.random.default_rng(8)
    bias = rng.normal(0.0, 0.2, (receivers, 68))
    station = params(receivers, **changes)
    return station, run(
        truth(receivers),
        station,
        half_seconds(30),
        code_error_m=lambda s: bias + 0.01 * s,
        carrier_error_m=lambda s: 0.01 * s,
    )


@pytest.fixture(scope="module")
def full():
    return noisy(gast_d__enabled=True, vdb__slots="ABC")


def test_corrections_arrive_within_half_of_the_last_bit(full):
    _station, out = full
    integrity, bursts = out.integrity[-1], out.bursts[-1]
    usable = integrity.state == ChannelState.USABLE
    sent = [each for message in messages(bursts, Type1) for each in message.measurements]
    assert sorted(each.ranging_source_id for each in sent) == sorted(RANGING_SOURCE_ID[usable].tolist())
    assert len(sent) > 18  # a linked pair
    for each in sent:
        satellite = SOURCE_ID_INDEX[each.ranging_source_id]
        assert each.prc_m == pytest.approx(integrity.prc_m[L1_100, satellite], abs=HALF["prc"] + EPSILON)
        assert each.rrc_mps == pytest.approx(integrity.rrc_mps[L1_100, satellite], abs=HALF["rrc"] + EPSILON)
        assert each.b_values_m == pytest.approx(integrity.b_m[L1_100][:, satellite], abs=HALF["b"] + EPSILON)
        # never below, and less than one bit above
        assert -EPSILON <= each.sigma_pr_gnd_m - integrity.sigma_pr_gnd_m[L1_100, satellite] < SIGMA_LSB
        assert each.iod == integrity.iod[satellite]


def test_thirty_second_corrections_arrive(full):
    _station, out = full
    integrity, bursts = out.integrity[-1], out.bursts[-1]
    sent = [each for message in messages(bursts, Type11) for each in message.measurements]
    assert len(sent) == (integrity.state == ChannelState.USABLE).sum()
    for each in sent:
        satellite = SOURCE_ID_INDEX[each.ranging_source_id]
        assert each.prc_30_m == pytest.approx(integrity.prc_m[L1_30, satellite], abs=HALF["prc"] + EPSILON)
        assert each.rrc_30_mps == pytest.approx(integrity.rrc_mps[L1_30, satellite], abs=HALF["rrc"] + EPSILON)
        assert -EPSILON <= each.sigma_pr_gnd_d_m - integrity.sigma_pr_gnd_d_m[satellite] < SIGMA_LSB
        assert -EPSILON <= each.sigma_pr_gnd_30_m - integrity.sigma_pr_gnd_m[L1_30, satellite] < SIGMA_LSB


def test_first_measurement_owns_crc_and_rotates(full):
    _station, out = full
    first = {}
    for integrity, bursts in zip(out.integrity, out.bursts, strict=True):
        for message in messages(bursts, Type1):
            assert message.modified_z_count_s == modified_z_count_s(float(integrity.tow_s))
            if message.measurements:
                satellite = SOURCE_ID_INDEX[message.measurements[0].ranging_source_id]
                assert message.ephemeris_crc == integrity.ephemeris_crc[satellite]
                p = integrity.p_ephemeris[L1_100, satellite]
                assert message.ephemeris_decorrelation == pytest.approx(p, abs=1e-12)
                first[satellite] = True
    # 10 s of frames, two messages each: every satellite was first (Annex 10, App. B 3.6.7.2.2.8: once per 10 s)
    assert set(first) == set(np.flatnonzero(out.integrity[-1].state == ChannelState.USABLE))


def test_station_data_and_approach_are_sent(tmp_path):
    approach = FinalApproach.from_course(
        ltp_lat_rad=np.radians(52.32), ltp_lon_rad=np.radians(10.57), ltp_height_m=120.0, course_rad=np.radians(265.0),
        fpap_distance_m=2300.0, tch_m=15.0, gpa_rad=np.radians(3.0), airport_id="EDVE", runway="26", rpi="G26A", rpds=4,
    )  # fmt: skip
    station, out = noisy(3, approaches=(approach,))
    station_data = [message for bursts in out.bursts for message in messages(bursts, Type2)]
    sets = [each for bursts in out.bursts for message in messages(bursts, Type4) for each in message.data_sets]
    assert len(station_data) >= 2  # 15 s; ICAO Annex 10 vol. I, table B-75: at least once in 20 frames
    assert len(sets) >= 2
    assert sets[0].fas.runway_number == 26
    assert sets[0].fas.reference_path_data_selector == 4
    assert sets[0].fas.ltp_latitude_rad == pytest.approx(approach.ltp_lat_rad, abs=np.radians(0.0005 / 3600))
    last = station_data[-1]
    assert last.n_reference_receivers == 3
    assert last.latitude_rad == pytest.approx(station.station.latitude_rad, abs=np.radians(0.0005 / 3600))


def test_station_that_cannot_serve_says_so_and_stays_on_the_air():
    _, out = noisy(3)
    told = {(second, message.gcid) for second, bursts in zip(out.seconds, out.bursts, strict=True)
            for message in messages(bursts, Type2)}  # fmt: skip
    assert {gcid for second, gcid in told if second < 5.0} == {GCID_UNHEALTHY}
    assert {gcid for second, gcid in told if second >= 5.0} == {1}
    empty = messages(out.bursts[0], Type1)
    assert len(empty) == 1
    assert empty[0].measurements == ()


def test_gcid_changes_in_the_next_frame():
    """Nothing usable at 10 s: the station says it at once, not when station data is due."""

    def drop(second, observed):
        return (None,) * len(observed) if second >= 10.0 else observed

    out = run(truth(2), params(2), half_seconds(25), change=drop)
    at = {second: messages(bursts, Type2) for second, bursts in zip(out.seconds, out.bursts, strict=True)}
    assert [message.gcid for message in at[10.0]] == [GCID_UNHEALTHY]


def test_default_gcid_is_unhealthy():
    _, out = noisy(3, station__gcid=GCID_UNHEALTHY)
    assert {message.gcid for bursts in out.bursts for message in messages(bursts, Type2)} == {GCID_UNHEALTHY}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("prc_m/l1_100", np.nan), ("prc_m/l1_100", 400.0), ("prc_m/l1_30", np.inf),
        ("rrc_mps/l1_100", -4.0), ("rrc_mps/l1_30", np.nan),
        ("sigma_pr_gnd_m/l1_100", 0.0), ("sigma_pr_gnd_m/l1_100", 5.09), ("sigma_pr_gnd_m/l1_100", np.nan),
        ("sigma_pr_gnd_m/l1_30", np.nan), ("sigma_pr_gnd_d_m", 0.0), ("p_ephemeris/l1_30", np.nan),
        ("iod", np.nan), ("ephemeris_crc", np.nan), ("state", float(ChannelState.EXCLUDED)), ("state", np.nan),
        ("state", float(ChannelState.SETTLING)),
    ],
)  # fmt: skip
def test_incomplete_satellite_is_not_sent(full, field, value):
    """Also when the integrity epoch claims it usable: the table may have come from anywhere."""
    station, out = full
    integrity = out.integrity[-1]
    satellite = int(np.flatnonzero(integrity.state == ChannelState.USABLE)[2])
    name, _, product = field.partition("/")
    values = getattr(integrity, name).copy()
    values[(PRODUCT_INDEX[product], satellite) if product else satellite] = value
    _, bursts = GroundStation(station).broadcast(BroadcastState(), dataclasses.replace(integrity, **{name: values}))
    sent = {each.ranging_source_id for message in messages(bursts, Type1) for each in message.measurements}
    assert int(RANGING_SOURCE_ID[satellite]) not in sent
    assert len(sent) == (integrity.state == ChannelState.USABLE).sum() - 1


def test_b_value_beyond_the_field_is_not_sent(full):
    station, out = full
    integrity = out.integrity[-1]
    satellite = int(np.flatnonzero(integrity.state == ChannelState.USABLE)[0])
    b = integrity.b_m.copy()
    b[L1_100, 1, satellite] = 6.4
    _, bursts = GroundStation(station).broadcast(BroadcastState(), dataclasses.replace(integrity, b_m=b))
    sent = {each.ranging_source_id for message in messages(bursts, Type1) for each in message.measurements}
    assert int(RANGING_SOURCE_ID[satellite]) not in sent


@pytest.mark.parametrize("n_receivers", [0.0, 1.0, np.nan])
def test_too_few_receivers_send_nothing(full, n_receivers):
    station, out = full
    integrity = dataclasses.replace(out.integrity[-1], n_receivers=n_receivers)
    _, bursts = GroundStation(station).broadcast(BroadcastState(), integrity)
    assert all(message.measurements == () for message in messages(bursts, Type1))
    assert {message.gcid for message in messages(bursts, Type2)} == {GCID_UNHEALTHY}


def test_stale_epoch_gives_no_frame(full):
    station, out = full
    state, bursts = GroundStation(station).broadcast(out.state.broadcast, out.integrity[-1])
    assert bursts == ()
    _, bursts = GroundStation(station).broadcast(state, out.integrity[-5])
    assert bursts == ()


def test_epoch_between_frames_gives_no_frame(full):
    station, out = full
    odd = dataclasses.replace(out.integrity[-1], tow_s=out.integrity[-1].tow_s + 0.2)
    assert GroundStation(station).broadcast(BroadcastState(), odd)[1] == ()


def test_frame_without_integrity_is_a_live_but_empty_station():
    station = params(2)
    _, bursts = GroundStation(station).broadcast(BroadcastState(), empty_integrity(WEEK, TOW_S))
    assert messages(bursts, Type1)[0].measurements == ()
    assert messages(bursts, Type2)[0].gcid == GCID_UNHEALTHY


def test_more_satellites_than_fit_leave_out_the_lowest():
    _station, out = noisy(2, vdb__slots="A")
    integrity = out.integrity[-1]
    usable = np.flatnonzero(integrity.state == ChannelState.USABLE)
    sent = messages(out.bursts[-1], Type1)[0].measurements
    assert 4 < len(sent) < len(usable)
    indices = [SOURCE_ID_INDEX[each.ranging_source_id] for each in sent]
    left_out = sorted(set(usable.tolist()) - set(indices))
    assert integrity.elevation_rad[indices].min() > integrity.elevation_rad[left_out].max()


def test_galileo_is_numbered_apart():
    """The standard numbers no Galileo satellites; the suite uses 70 + SVID."""
    _, out = noisy(2, station__systems="GE")
    sent = [each.ranging_source_id for message in messages(out.bursts[-1], Type1) for each in message.measurements]
    assert {number <= 36 for number in sent} == {True, False}
    assert all((number > 70) == (not IS_GPS[SOURCE_ID_INDEX[number]]) for number in sent)
