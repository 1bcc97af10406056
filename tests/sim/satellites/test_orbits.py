"""Sources of orbits: nominal sets renewed for a day, almanacs, recorded navigation with one record after another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gbas_core.gnss.almanac import almanac_state, read_almanac
from gbas_core.gnss.ephemeris import EphemerisStore, is_complete
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.gnss.orbits import satellite_state
from gbas_core.satellites import IS_GPS, satellites_of
from gbas_sim.satellites.broadcast import BLEND_S, Orbits, almanac_orbits, nominal_orbits, recorded_orbits, renewed
from gbas_sim.satellites.constellation import nominal_ephemeris

BOTH = satellites_of("GE")
WEEK, START_S, DAY_S = 2400, 590_000.0, 86_400.0  # a day across the end of a week
RECORDED = "nav_rinex4_2026/BRD400DLR_S_20260680000_01D_MN.rnx.gz"
RECORDED_START = (2409, 86_400.0 + 8 * 3600.0 - 900.0)  # Monday 2026-03-09, a quarter of an hour before a switch


def day() -> Orbits:
    return nominal_orbits(WEEK, START_S, DAY_S, seed=1, systems=BOTH)


def test_nominal_ephemerides_are_renewed_every_two_hours():
    orbits = day()
    received = [epoch_key(each.gps_week, each.tow_s) for each in orbits.received]
    # The first an hour before the start; a set each 2 h after, as long as the day.
    assert len(received) == 13
    np.testing.assert_allclose(np.diff(received[1:]), 7_200_000)
    issues = [float(np.nanmax(each.iod)) for each in orbits.received]
    # No receiver keeps more than four: an issue may come again after some hours.
    assert all(len(set(issues[first : first + 6])) == len(issues[first : first + 6]) for first in range(len(issues)))
    for each in orbits.received:
        assert is_complete(each)[np.isfinite(each.sqrt_a)].all()
        assert np.isfinite(each.sqrt_a).sum() == 48


def test_there_is_always_a_usable_ephemeris_of_every_satellite():
    orbits, store = day(), EphemerisStore()
    pending = list(orbits.received)
    for since_s in np.arange(0.0, DAY_S + 1.0, 600.0):
        at_s = WEEK * 604_800.0 + START_S + since_s
        while pending and pending[0].gps_week * 604_800.0 + pending[0].tow_s <= at_s:
            store = store.add(pending.pop(0))
        usable = store.usable(int(at_s // 604_800.0), at_s % 604_800.0, 120.0)
        assert np.isfinite(usable.sqrt_a).sum() == 48
    assert not pending


def test_what_is_broadcast_is_the_truth_to_the_message_s_digits():
    """Over all sets and their times of use: orbits to centimetres, clocks to half of 2^-31 s, across the week."""
    orbits = day()
    (truth,) = orbits.truth
    for number, sent in enumerate(orbits.received):
        for since_s in (-3600.0, 0.0, 3600.0):
            tow_s = START_S + 7200.0 * number + since_s
            true, said = (satellite_state(each, WEEK, tow_s, None) for each in (truth, sent))
            away_m = np.linalg.norm(true.position_m - said.position_m, axis=0)
            # Half steps of 2^-31 semicircles in three angles at 3e7 m: 2.2 cm each; 2^-19 in the root of the axis:
            # 1 cm; 2^-43 semicircles a second in two rates for an hour: 2 cm each.
            assert np.nanmax(away_m) < 0.08
            assert np.nanmax(np.abs(true.clock_s - said.clock_s)) < 0.51 * 2.0**-31 + 3600.0 * 2.0**-43


def test_renewing_to_the_same_time_changes_nothing():
    first = nominal_ephemeris(WEEK, START_S, seed=3, systems=BOTH)
    again = renewed(first, int(np.nanmax(first.toe_week)), float(np.nanmax(first.toe_tow_s)))
    for name in ("m0_rad", "omega0_rad", "i0_rad", "af0_s", "toe_tow_s", "iod", "e", "sqrt_a"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name), err_msg=name)


@pytest.mark.parametrize("name", ["test_input_yuma377.txt", "test_input_sem387.txt"])
def test_almanac_orbits(data_dir: Path, name):
    path = data_dir / "almanacs" / name
    almanac = read_almanac(path, near_week=1400)
    week, tow_s = int(np.nanmax(almanac.toa_week)), 302_400.0
    orbits = almanac_orbits(path, week, tow_s, 7200.0, seed=1, systems=BOTH)
    healthy = np.isfinite(almanac.sqrt_a) & (almanac.health == 0.0)
    np.testing.assert_array_equal(np.isfinite(orbits.received[0].sqrt_a), healthy)
    assert is_complete(orbits.received[0])[healthy].all()
    for since_s in (0.0, 7200.0):
        state = orbits.arc(week, tow_s + since_s)(np.array([tow_s + since_s]))
        expected = almanac_state(almanac, week, tow_s + since_s)
        away_m = np.linalg.norm(state.position_m - expected.position_m, axis=0)[healthy]
        # The almanac's own rates are multiples of the ephemeris' steps to within half a step: 0.1 m in two hours.
        assert away_m.max() < 0.3


def recorded(data_dir: Path) -> Orbits:
    return recorded_orbits([data_dir / RECORDED], *RECORDED_START, 1800.0, systems=BOTH)


def test_recorded_orbits_are_the_broadcast_ones(data_dir: Path):
    orbits = recorded(data_dir)
    assert len(orbits.truth) == 2
    week, tow_s = RECORDED_START
    store = EphemerisStore()
    for each in orbits.received:
        if epoch_key(each.gps_week, each.tow_s) <= epoch_key(week, tow_s):
            store = store.add(each)
    usable = store.usable(week, tow_s, 0.0)
    true = orbits.arc(week, tow_s)(np.array([tow_s]))
    said = satellite_state(usable, week, tow_s, None)
    same = (orbits.truth[0].iod == usable.iod) & (orbits.truth[0].toe_tow_s == usable.toe_tow_s)
    assert (same & IS_GPS).sum() > 20
    np.testing.assert_array_equal(true.position_m[:, same], said.position_m[:, same])
    away_m = np.linalg.norm(true.position_m - said.position_m, axis=0)
    assert np.nanmedian(away_m) < 1.0  # where another record is the truth: one ephemeris from the next
    assert all(each.simulated == 1.0 for each in orbits.received)


def test_from_one_record_to_the_next_nothing_steps(data_dir: Path):
    """Positions and clocks through the passage: velocities are their rates, and there is no step at its ends."""
    orbits = recorded(data_dir)
    (switch_s,) = orbits.switch_s
    week = RECORDED_START[0]
    middle_s = switch_s - week * 604_800.0
    h = 0.5
    for tow_s in (middle_s - 0.5 * BLEND_S, middle_s - 100.0, middle_s, middle_s + 0.5 * BLEND_S, middle_s + 370.0):
        before, here, after = (orbits.arc(week, tow_s)(np.array([tow_s + step])) for step in (-h, 0.0, h))
        rate = (after.position_m - before.position_m) / (2.0 * h)
        known = np.isfinite(rate) & np.isfinite(here.velocity_mps)
        assert known.sum() > 3 * 40
        # Jerk of 1e-4 m/s^3 over half a second: 4 um/s; rounding of 3e7 m: 8 nm/s.
        np.testing.assert_allclose(here.velocity_mps[known], rate[known], atol=5e-5)
        drift = (after.clock_s - before.clock_s) / (2.0 * h)
        ticking = np.isfinite(drift)
        np.testing.assert_allclose(
            here.clock_drift[ticking], drift[ticking], atol=1e-13
        )  # its rate has a kink at both ends
    # Both arcs agree where one takes over from the other.
    edge = middle_s + 0.5 * BLEND_S + 61.0
    one, other = (orbits.arc(week, edge + step)(np.array([edge])) for step in (-0.001, 0.001))
    np.testing.assert_allclose(one.position_m, other.position_m, rtol=0.0, atol=1e-7)


def test_a_satellite_without_a_next_record_stays_on_its_orbit(data_dir: Path):
    orbits = recorded(data_dir)
    first, second = orbits.truth
    gone = np.zeros(second.sqrt_a.size, dtype=bool)
    gone[int(np.flatnonzero(np.isfinite(second.sqrt_a))[0])] = True
    columns = {name: np.where(gone, np.nan, value) for name, value in vars(second).items() if np.ndim(value)}
    alone = Orbits(truth=(first, replace(second, **columns)), switch_s=orbits.switch_s, received=orbits.received)
    week = RECORDED_START[0]
    tow_s = orbits.switch_s[0] - week * 604_800.0
    state, own = alone.arc(week, tow_s)(np.array([tow_s])), satellite_state(first, week, tow_s, None)
    np.testing.assert_array_equal(state.position_m[:, gone], own.position_m[:, gone])
