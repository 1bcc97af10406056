"""Satellites that are not where they say: offsets in their own axes, wrong uploads, and what an end makes of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_core.gnss.ephemeris import EphemerisStore, is_complete
from gbas_core.gnss.frames import EARTH_RATE_RADPS, ecef_from_geodetic
from gbas_core.gnss.orbits import SatelliteState, satellite_state
from gbas_core.satellites import N_SATS, SAT_INDEX, satellites_of
from gbas_sim.faults.kinds import BroadcastFault, OrbitFault, displaced, with_wrong_broadcasts
from gbas_sim.satellites.constellation import nominal_ephemeris

WEEK, TOW_S = 2400, 216_000.0
EPHEMERIS = nominal_ephemeris(WEEK, TOW_S, seed=1, systems=satellites_of("GE"))
G05, E11 = SAT_INDEX["G05"], SAT_INDEX["E11"]


def state_at(since_s: float) -> SatelliteState:
    return satellite_state(EPHEMERIS, WEEK, np.full(N_SATS, TOW_S + since_s), None)


def moved_at(fault: OrbitFault, since_s: float) -> SatelliteState:
    return displaced(state_at(since_s), (fault,), np.full(N_SATS, since_s))


def fault(**changes) -> OrbitFault:
    return OrbitFault(**({"satellite": "G05", "start_s": 0.0} | changes))


def test_offsets_are_along_the_axes():
    """Up from the Earth's centre, along the velocity among the stars (the orbits are circles), across to the left."""
    state = state_at(100.0)
    position = state.position_m[:, G05]
    inertial = state.velocity_mps[:, G05] + np.cross([0.0, 0.0, EARTH_RATE_RADPS], position)
    up, ahead = position / np.linalg.norm(position), inertial / np.linalg.norm(inertial)
    axes = {"radial": up, "along": ahead, "cross": np.cross(up, ahead)}
    for name, axis in axes.items():
        offset = moved_at(fault(**{f"{name}_m": 1000.0}), 100.0).position_m - state.position_m
        # The nominal orbits are circles to 1e-9 and a metre in velocity; 2.7e7 m keep 4e-9 m.
        np.testing.assert_allclose(offset[:, G05], 1000.0 * axis, atol=1e-2)
        assert (np.nan_to_num(offset[:, np.arange(N_SATS) != G05]) == 0.0).all()


def test_offsets_grow_and_end():
    growing = fault(start_s=50.0, end_s=150.0, along_m=100.0, along_mps=2.0)
    for since_s, size_m in ((49.0, 0.0), (50.0, 100.0), (100.0, 200.0), (150.0, 0.0)):
        offset = moved_at(growing, since_s).position_m - state_at(since_s).position_m
        assert float(np.linalg.norm(offset[:, G05])) == pytest.approx(size_m, abs=1e-6)


def test_velocity_is_the_derivative_of_the_position():
    moving = fault(along_m=2000.0, cross_m=-1500.0, radial_m=800.0, along_mps=1.0, cross_mps=-0.5, radial_mps=0.2)
    before, here, after = (moved_at(moving, since_s) for since_s in (99.0, 100.0, 101.0))
    plain = [state_at(since_s) for since_s in (99.0, 100.0, 101.0)]
    # The offset's part alone. The axes leave out that the orbit's plane turns, by 8e-9 rad/s: 2e-5 m/s at 2.6 km.
    derivative = 0.5 * ((after.position_m - plain[2].position_m) - (before.position_m - plain[0].position_m))
    offset = here.velocity_mps - plain[1].velocity_mps
    np.testing.assert_allclose(offset[:, G05], derivative[:, G05], rtol=0.0, atol=3e-5)
    assert np.linalg.norm(offset[:, G05]) > 0.1
    np.testing.assert_array_equal(here.clock_s, plain[1].clock_s)


def test_ranges_at_two_places_differ_as_geometry_says():
    """Along-track, d e . change of direction: 3 km over 2.2e7 m range and 5 km of distance is up to 0.7 m."""
    state, moved = state_at(0.0), moved_at(fault(along_m=3000.0), 0.0)
    places = [ecef_from_geodetic(math.radians(52.32), math.radians(10.56), 100.0)]
    places.append(places[0] + np.array([3000.0, 0.0, -4000.0]))
    change = [
        np.linalg.norm(moved.position_m[:, G05] - place) - np.linalg.norm(state.position_m[:, G05] - place)
        for place in places
    ]
    offset = moved.position_m[:, G05] - state.position_m[:, G05]
    lines = [(state.position_m[:, G05] - place) / np.linalg.norm(state.position_m[:, G05] - place) for place in places]
    # First order: the offset's second order is d^2 / 2r times the change of direction, 0.2 m x 2e-4.
    assert change[0] - change[1] == pytest.approx(float(offset @ (lines[0] - lines[1])), abs=1e-3)
    assert abs(change[0] - change[1]) < 0.75


def test_nothing_to_move_is_the_same_state():
    state = state_at(0.0)
    assert displaced(state, (), np.zeros(N_SATS)) is state


# --- wrong broadcasts


def wrong(**changes) -> BroadcastFault:
    return BroadcastFault(**({"satellite": "G05", "start_s": 300.0, "field": "m0_rad", "change": 1e-4} | changes))


def test_a_wrong_upload_comes_at_the_start():
    first, upload = with_wrong_broadcasts((EPHEMERIS,), (wrong(),), WEEK, TOW_S)
    assert first is EPHEMERIS
    assert (upload.gps_week, upload.tow_s) == (WEEK, TOW_S + 300.0)
    assert np.isfinite(upload.message).sum() == 1
    assert upload.m0_rad[G05] == EPHEMERIS.m0_rad[G05] + 1e-4
    assert upload.sqrt_a[G05] == EPHEMERIS.sqrt_a[G05]
    assert upload.iod[G05] % 256 != EPHEMERIS.iod[G05] % 256
    assert upload.iodc[G05] % 256 == upload.iod[G05]
    assert is_complete(upload)[G05]
    # It tells of an orbit 26,560 km x 1e-4 rad ahead.
    right, told = (satellite_state(each, WEEK, np.full(N_SATS, TOW_S + 400.0), None) for each in (EPHEMERIS, upload))
    offset_m = float(np.linalg.norm((told.position_m - right.position_m)[:, G05]))
    assert offset_m == pytest.approx(2656.0, rel=1e-3)


def test_users_take_the_wrong_one_once_it_has_settled():
    store = EphemerisStore()
    for each in with_wrong_broadcasts((EPHEMERIS,), (wrong(),), WEEK, TOW_S):
        store = store.add(each)
    for since_s, field in ((400.0, EPHEMERIS.m0_rad[G05]), (430.0, EPHEMERIS.m0_rad[G05] + 1e-4)):
        usable = store.usable(WEEK, TOW_S + since_s, settle_s=120.0)
        assert usable.m0_rad[G05] == field
        assert usable.m0_rad[E11] == EPHEMERIS.m0_rad[E11]


def test_regular_ephemerides_meanwhile_are_wrong_too_and_the_end_puts_it_right():
    renewed = dataclasses.replace(EPHEMERIS, tow_s=TOW_S + 600.0, iod=EPHEMERIS.iod + 1.0, iodc=EPHEMERIS.iodc + 1.0)
    later = dataclasses.replace(EPHEMERIS, tow_s=TOW_S + 4000.0, iod=EPHEMERIS.iod + 2.0, iodc=EPHEMERIS.iodc + 2.0)
    broadcast = with_wrong_broadcasts((EPHEMERIS, renewed, later), (wrong(end_s=1000.0),), WEEK, TOW_S)
    assert [each.tow_s - TOW_S for each in broadcast[1:]] == [300.0, 600.0, 1000.0, 4000.0]
    right = EPHEMERIS.m0_rad[G05]
    assert [float(each.m0_rad[G05] - right) for each in broadcast] == pytest.approx(
        [0.0, 1e-4, 1e-4, 0.0, 0.0], abs=1e-15
    )
    issues = [float(each.iod[G05]) % 256 for each in broadcast]
    assert len(set(issues)) == len(issues)
    np.testing.assert_array_equal(
        broadcast[2].m0_rad[np.arange(N_SATS) != G05], renewed.m0_rad[np.arange(N_SATS) != G05]
    )


def test_galileo_has_ten_bits_and_no_iodc():
    first, upload = with_wrong_broadcasts(
        (EPHEMERIS,), (wrong(satellite="E11", field="af0_s", change=1e-6),), WEEK, TOW_S
    )
    assert upload.iod[E11] == (first.iod[E11] + 128) % 1024
    assert np.isnan(upload.iodc[E11])
    assert is_complete(upload)[E11]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (fault, "fault orbit: all offsets and rates are 0: nothing would happen"),
        (lambda: fault(along_m=1e9), "along_m = 1000000000 is not within -1000000 to 1000000 m"),
        (lambda: wrong(field="health"), "field = 'health' is not one of sqrt_a, e, m0_rad"),
        (lambda: wrong(change=0.0), "fault broadcast: change is 0: nothing would happen"),
        (
            lambda: with_wrong_broadcasts((EPHEMERIS,), (wrong(satellite="G32"),), WEEK, TOW_S),
            "fault broadcast: no ephemeris of G32 was received before 300 s",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)
