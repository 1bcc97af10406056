"""Carriers that are lost and found: another number of whole wavelengths, and the receiver says so."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_bringup.resources import config_path
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import L1, L5, N_BANDS, WAVELENGTH_M
from gbas_sim.receivers.arcs import LARGEST_JUMP, Breaks, Passes, arc_numbers, jumps
from gbas_sim.scenario import open_world, read_sections, scenario_from_mapping
from gbas_sim.world import World

SHAPE = (2, N_BANDS, N_SATS)
WAVELENGTH = WAVELENGTH_M[:, np.newaxis]
IDEAL = {"ground_receiver": {"preset": "ideal"}, "airborne_receiver": {"preset": "ideal"}}


def opened(**changes) -> World:
    """The site of Braunschweig without errors: a carrier less its code is whole wavelengths."""
    site = read_sections(config_path("braunschweig.yaml"))
    return open_world(scenario_from_mapping({**site, "sim": {**site["sim"], **IDEAL, **changes}}))


def cycles(epoch) -> np.ndarray:
    """Whole wavelengths of all carriers (R, N_BANDS, N_SATS); NaN where there is none."""
    each = [*epoch.ground, *(() if epoch.airborne is None else (epoch.airborne,))]
    counted = np.array([(one.carrier_m - one.code_m) / WAVELENGTH for one in each])
    known = np.isfinite(counted)
    # 4 nm of rounding of 2e7 m.
    np.testing.assert_allclose(counted[known], np.rint(counted[known]), atol=1e-6)
    return np.rint(counted)


def flags(epoch) -> np.ndarray:
    return np.array([one.lli for one in (*epoch.ground, *(() if epoch.airborne is None else (epoch.airborne,)))])


def found_again(world: World, numbers: range) -> tuple[int, list[bool]]:
    """Follow all carriers: how many were found again, and whether each then had another number.

    While held, numbers stay and nothing is flagged; when found, everything is flagged.
    """
    last, held, changed = None, None, []
    for number in numbers:
        epoch = world.epoch(number)
        now, lli = cycles(epoch), flags(epoch)
        here = np.isfinite(now)
        if held is not None:
            going_on = here & held
            np.testing.assert_array_equal(now[going_on], last[going_on])
            assert not lli[going_on].any()
            back = here & ~held
            assert (lli[back] == 1.0).all()
            changed += (now[back & np.isfinite(last)] != last[back & np.isfinite(last)]).tolist()
            last = np.where(here, now, last)
        else:
            last = now
        held = here
    return len(changed), changed


# --- the parts


def test_breaks_are_the_last_epochs_without():
    held = np.random.default_rng(1).uniform(size=(400, *SHAPE)) > 0.02
    breaks = Breaks(held.__getitem__, first=10)
    for number in (3, 12, 40, 11, 399, 8, 260, 20, 398, *range(397, 350, -1), 9, 10):  # any order
        expected = np.zeros(SHAPE, dtype=int)
        for each in range(10, number + 1):
            expected[~held[each]] = each - 9
        np.testing.assert_array_equal(np.broadcast_to(breaks.at(number), SHAPE), expected)


def test_passes_are_counted_on_a_grid():
    above = np.random.default_rng(2).uniform(size=(100, 2, N_SATS)) > 0.5
    passes = Passes(above.__getitem__, 7)
    for number in (99, 0, 6, 7, 50):
        np.testing.assert_array_equal(passes.at(number), (~above[: number + 1 : 7]).sum(axis=0))


def test_jumps():
    """None for the first arc; else spread evenly, without regard to which other receivers there are."""
    receivers = tuple(range(100))
    arcs = np.broadcast_to(np.arange(5)[:, np.newaxis, np.newaxis, np.newaxis], (5, 100, N_BANDS, N_SATS))
    drawn = np.array([jumps(7, receivers, each) for each in arcs])
    assert not drawn[0].any()
    assert drawn[1:].all()
    assert np.abs(drawn).max() <= LARGEST_JUMP
    later = drawn[1:] / LARGEST_JUMP
    # Uniform from -1 to 1: variance 1/3, that of the square 4/45; five standard errors.
    assert abs(later.mean()) < 5.0 * np.sqrt(1.0 / 3.0 / later.size)
    assert abs((later**2).mean() - 1.0 / 3.0) < 5.0 * np.sqrt(4.0 / 45.0 / later.size)
    assert len(np.unique(drawn[1:])) > 0.95 * drawn[1:].size  # of 2e6
    np.testing.assert_array_equal(jumps(7, (3, 50), arcs[2][[3, 50]]), drawn[2][[3, 50]])
    assert (jumps(8, receivers, arcs[1]) != drawn[1]).mean() > 0.99


def test_numbers_of_passes_and_breaks_do_not_meet():
    passes = np.zeros((2, N_SATS), dtype=np.int64)
    breaks = np.ones(SHAPE, dtype=np.int64)
    numbers = {int(arc_numbers(passes + p, breaks * b)[0, 0, 0]) for p in range(4) for b in range(4)}
    assert len(numbers) == 16
    assert not arc_numbers(passes, None).any()


def test_going_backwards_is_not_from_the_start_each_time():
    asked = []

    def held(number: int) -> np.ndarray:
        asked.append(number)
        return np.ones(SHAPE, dtype=bool)

    breaks = Breaks(held, first=0)
    for number in range(999, 899, -1):
        breaks.at(number)
    assert len(asked) < 1000 + 100 * 128
    asked.clear()
    for number in range(2000, 2100):
        breaks.at(number)
        breaks.at(1990)  # as a frozen receiver does
    assert len(asked) <= 2100


# --- the world


def test_scintillation_leaves_other_ambiguities():
    """Every carrier that comes back is flagged and counts from elsewhere; none that stays changes."""
    storm = {"equatorial_s4": 1.0, "crest_latitude_deg": 48.0, "crest_width_deg": 5.0, "loss_rate_hz": 0.1}
    world = opened(start_tow_s=246_600.0, scintillation=storm)
    count, changed = found_again(world, range(200))
    assert count > 100
    assert all(changed)


def test_a_satellite_that_was_too_weak_counts_from_elsewhere():
    weak = {"kind": "low_power", "satellite": "G08", "drop_db": 40.0, "start_s": 10.0, "end_s": 15.0, "bands": ["L5"]}
    world = opened(threats={"weak": weak})
    count, changed = found_again(world, range(15, 40))
    assert count == 5
    assert all(changed)
    before, after = cycles(world.epoch(15)), cycles(world.epoch(39))
    lost = np.zeros(before.shape, dtype=bool)
    lost[:, L5, SAT_INDEX["G08"]] = True
    np.testing.assert_array_equal((before != after) & np.isfinite(before), lost)


def test_a_loss_of_lock_says_itself_what_comes_of_it():
    """Also where other signals are lost."""
    fault = {"satellite": "G08", "start_s": 10.0, "end_s": 15.0}
    lost = {"kind": "loss_of_lock", "cycles": 12, **fault}
    weak = {"kind": "low_power", "drop_db": 40.0, **fault, "satellite": "G01"}
    world = opened(threats={"lost": lost, "weak": weak})
    change = cycles(world.epoch(39)) - cycles(world.epoch(15))
    np.testing.assert_array_equal(change[:, [L1, L5], SAT_INDEX["G08"]], 12.0)
    assert (np.abs(change[:, [L1, L5], SAT_INDEX["G01"]]) > 0.0).all()


def test_a_satellite_that_rises_again_counts_from_elsewhere():
    """Within a day, from five minutes below the mask on."""
    world = opened(aircraft=False, duration_s=86_400.0, interval_s=60.0)
    count, changed = found_again(world, range(len(world)))
    assert count > 40
    assert sum(changed) >= count - 2  # the grid may miss one that only grazes the mask


@pytest.mark.parametrize("number", [150, 30, 149, 0])
def test_any_order(number):
    storm = {"equatorial_s4": 1.0, "crest_latitude_deg": 48.0, "crest_width_deg": 5.0, "loss_rate_hz": 0.1}
    frozen = {"kind": "frozen", "receiver": "rr2", "start_s": 20.0, "end_s": 60.0}
    changes = {"start_tow_s": 246_600.0, "scintillation": storm, "threats": {"frozen": frozen}}
    inorder, alone = opened(**changes), opened(**changes).epoch(number)
    for each in range(number + 1):
        epoch = inorder.epoch(each)
    for first, second in zip((*epoch.ground, epoch.airborne), (*alone.ground, alone.airborne), strict=True):
        np.testing.assert_array_equal(first.carrier_m, second.carrier_m)
        np.testing.assert_array_equal(first.lli, second.lli)
