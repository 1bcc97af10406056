"""Corrections and B values: identities, published properties, and a second formulation by loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_core.satellites import CLOCK_GROUPS, IS_GPS, N_SATS
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_ground.corrections.formation import range_correction_m
from gbas_ground.corrections.kernels import formation as form
from loop_corrections import corrections as by_loops

# Values are metres of order 1e2; sums of tens of them round at about 1e-14 of that.
ROUNDING_M = 1e-11


CONSTELLATION = CLOCK_GROUPS.argmax(axis=0)


def common_satellites(candidate, *, min_common, min_receivers):
    return form.common_satellites(candidate, CONSTELLATION, len(CLOCK_GROUPS), min_common, min_receivers)


def clock_weights(common, elevation_rad=None):
    return form.clock_weights(
        common, np.zeros(N_SATS) if elevation_rad is None else elevation_rad, elevation_rad is None
    )


def receiver_clock_m(correction_m, weights):
    """Clock of each channel's receiver and constellation."""
    return correction_m - form.remove_clocks(correction_m, weights, CONSTELLATION)


average_m, b_values_m = form.average_m, form.b_values_m


def clock_removed_sigma_m(sigma_m, weights):
    return form.clock_removed_sigma_m(sigma_m, weights, CONSTELLATION)


def rate_mps(correction_m, previous_m, dt_s, weights, used):
    return form.rate_mps(correction_m, previous_m, dt_s, weights, used, CONSTELLATION)


def formed(pr_sc, used, **choice):
    """PRC and B from the functions under test, as the station calls them."""
    in_use, common = common_satellites(used, min_common=choice.get("min_common", 1), min_receivers=1)
    adjusted = pr_sc - receiver_clock_m(pr_sc, clock_weights(common))
    k = np.where(IS_GPS, 0, 1)
    used = used & in_use[k].T & np.isfinite(adjusted)
    return average_m(adjusted, used), b_values_m(adjusted, used), used


def scene(seed, receivers, density):
    """Random corrections with random channels missing."""
    rng = np.random.default_rng(seed)
    tracked = rng.random((receivers, N_SATS)) < density
    values = rng.normal(0.0, 100.0, (receivers, N_SATS)) + rng.normal(0.0, 1e5, (receivers, 1))
    return np.where(tracked, values, np.nan), tracked


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), receivers=st.integers(1, 4), density=st.floats(0.3, 1.0))
def test_agrees_with_loops(seed, receivers, density):
    pr_sc, tracked = scene(seed, receivers, density)
    prc, b, used = formed(pr_sc, tracked)
    in_use = [m for m in range(receivers) if used[m].any()]
    constellations = [list(np.flatnonzero(IS_GPS)), list(np.flatnonzero(~IS_GPS))]
    channels = [[bool(x) for x in (used[m] if m in in_use else used[m] & False)] for m in range(receivers)]
    expected_prc, expected_b = by_loops(pr_sc.tolist(), channels, constellations)
    assert set(np.flatnonzero(np.isfinite(prc))) == set(expected_prc)
    # clocks of 1e5 m are removed: rounding of 1e5 m
    for satellite, value in expected_prc.items():
        assert prc[satellite] == pytest.approx(value, abs=1e-9)
    assert {(int(i), int(m)) for m, i in np.argwhere(np.isfinite(b))} == {(int(i), m) for i, m in expected_b}
    for (satellite, receiver), value in expected_b.items():
        assert b[receiver, satellite] == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("receivers", [2, 3, 4])
def test_b_values_of_a_satellite_sum_to_zero(receivers):
    pr_sc, tracked = scene(3, receivers, 0.8)
    _, b, used = formed(pr_sc, tracked)
    two = used.sum(axis=0) >= 2
    assert two.sum() > 20
    assert np.abs(np.where(used, b, 0.0).sum(axis=0)[two]).max() < 1e-9  # rounding of 1e5 m


@pytest.mark.parametrize("receivers", [2, 3, 4])
def test_bias_of_one_receiver(receivers):
    """Facts: a bias b in one of M receivers gives B = b/M there and -b/(M(M-1)) at the others."""
    adjusted = np.zeros((receivers, N_SATS))
    adjusted[0, 5] = 3.0
    used = np.ones(adjusted.shape, dtype=bool)
    b = b_values_m(adjusted, used)
    assert b[0, 5] == pytest.approx(3.0 / receivers, abs=ROUNDING_M)
    assert b[1:, 5] == pytest.approx(-3.0 / (receivers * (receivers - 1)), abs=ROUNDING_M)
    assert np.abs(np.delete(b, 5, axis=1)).max() < ROUNDING_M


def test_one_receiver_has_no_b_values():
    pr_sc, tracked = scene(1, 1, 0.9)
    prc, b, used = formed(pr_sc, tracked)
    assert np.isnan(b).all()
    assert np.isfinite(prc).sum() == used.sum() > 0


def test_correction_is_added_by_the_user():
    """A range that is 7 m too long needs -7 m; a satellite clock that is ahead makes ranges short."""
    geometric = np.array([[2.0e7, 2.0e7]])
    clock = np.array([[0.0, 1e-6]])
    measured = geometric + 7.0 - SPEED_OF_LIGHT_MPS * clock
    assert range_correction_m(geometric, measured, clock) == pytest.approx(-7.0, abs=1e-8)  # rounding of 2e7 m


def test_common_set_of_each_constellation():
    tracked = np.zeros((3, N_SATS), dtype=bool)
    tracked[:, [0, 1, 2, 3]] = True
    tracked[2, 3] = False
    tracked[0, [40, 41, 42]] = True
    in_use, common = common_satellites(tracked, min_common=3, min_receivers=1)
    assert in_use.tolist() == [[True, True, True], [True, False, False]]
    assert np.flatnonzero(common[0]).tolist() == [0, 1, 2]
    assert np.flatnonzero(common[1]).tolist() == [40, 41, 42]


def test_receiver_that_lost_its_satellites_does_not_take_the_station_with_it():
    tracked = np.zeros((3, N_SATS), dtype=bool)
    tracked[:2, :10] = True
    tracked[2, 8:13] = True  # only two in common with the others
    in_use, common = common_satellites(tracked, min_common=3, min_receivers=2)
    assert in_use[0].tolist() == [True, True, False]
    assert np.flatnonzero(common[0]).tolist() == list(range(10))
    in_use, common = common_satellites(tracked, min_common=3, min_receivers=3)
    assert not in_use.any()
    assert not common.any()


def test_missing_common_satellite_gives_no_clock():
    """Two receivers' clocks must be means over the same satellites, or they do not compare."""
    values = np.ones((2, N_SATS))
    values[1, 3] = np.nan
    weights = clock_weights(np.stack([np.arange(N_SATS) < 5, np.zeros(N_SATS, dtype=bool)]))
    clock = receiver_clock_m(values, weights)
    assert clock[0, :32] == pytest.approx(1.0, abs=ROUNDING_M)
    assert np.isnan(clock[1]).all()
    assert np.isnan(clock[0, 32:]).all()


def test_elevation_weights():
    common = np.stack([np.arange(N_SATS) < 3, np.zeros(N_SATS, dtype=bool)])
    elevation = np.full(N_SATS, np.nan)
    elevation[:3] = np.radians([30.0, 90.0, 30.0])
    weights = clock_weights(common, elevation)
    assert weights[0, :3] == pytest.approx([1 / 6, 4 / 6, 1 / 6], abs=ROUNDING_M)  # sin^2: 1/4, 1, 1/4
    assert weights.sum(axis=1).tolist() == pytest.approx([1.0, 0.0])


def test_rate_is_the_difference_of_the_corrections_while_nothing_changes():
    """Textbook: RRC = (PRC_k - PRC_{k-1}) / T."""
    now, tracked = scene(5, 3, 1.0)
    before = now + np.random.default_rng(6).normal(size=now.shape)
    rate = rate_mps(
        now, before, 0.5, clock_weights(common_satellites(tracked, min_common=1, min_receivers=1)[1]), tracked
    )
    assert rate == pytest.approx((formed(now, tracked)[0] - formed(before, tracked)[0]) / 0.5, abs=1e-8)


def test_rate_does_not_jump_when_the_common_set_changes():
    now, tracked = scene(5, 3, 1.0)
    fewer = tracked.copy()
    fewer[1, 7] = False
    weights = clock_weights(common_satellites(fewer, min_common=1, min_receivers=1)[1])
    assert np.nanmax(np.abs(rate_mps(now, now, 0.5, weights, fewer))) < 1e-8  # nothing moved; rounding of 1e5 m


def test_sigma_after_clock_removal_against_a_simulation():
    rng = np.random.default_rng(11)
    sigma = np.where(np.arange(N_SATS) < 8, 0.2 + 0.1 * np.arange(N_SATS), np.nan)
    common = np.stack([np.arange(N_SATS) < 6, np.zeros(N_SATS, dtype=bool)])
    weights = clock_weights(common)
    n = 40_000
    noise = rng.normal(size=(n, N_SATS)) * sigma  # as many receivers
    rest = noise - receiver_clock_m(noise, weights)
    # the standard error of a sample sigma is 1/sqrt(2n) = 0.35 %; five of those
    assert rest[:, :8].std(axis=0) == pytest.approx(clock_removed_sigma_m(sigma, weights)[:8], rel=5 / np.sqrt(2 * n))
