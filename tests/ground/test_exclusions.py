"""Latches: what sets them, what opens them, and what does not count."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_ground.exclusions import advance, exclude, initial_latch, release
from gbas_msgs_py.codes import FIRST_LATCHED, ExclusionCause

YES, NO = np.array([True]), np.array([False])


def held(passes, dt_s=0.5, readmission_s=2.0, max_gap_s=3.5):
    """Epochs a thing is excluded for, given what its monitors say after the epoch that failed."""
    latch = exclude(initial_latch(1), YES, ExclusionCause.B_VALUE)
    latch = advance(latch, NO, dt_s, max_gap_s)
    epochs = 1
    for passed in passes:
        latch, _ = release(latch, readmission_s, readmission_s)
        if not latch.excluded[0]:
            return epochs
        epochs += 1
        latch = advance(latch, np.array([passed]), dt_s, max_gap_s)
    return epochs


def test_readmission_time_counts_from_the_last_failure():
    # failed at 0; passes at 0.5, 1.0, 1.5, 2.0: clear for 2 s, so back in use at 2.5, the sixth epoch
    assert held([True] * 20) == 5
    assert held([True, True, False] + [True] * 20) == 8


def test_unknown_does_not_count():
    assert held([False] * 50) == 51


@pytest.mark.parametrize("dt_s", [float("nan"), 0.0, -1.0, 100.0])
def test_gaps_do_not_count(dt_s):
    assert held([True] * 50, dt_s=dt_s) == 51


def test_first_cause_stays():
    latch = exclude(initial_latch(2), np.array([True, False]), ExclusionCause.PRC_LIMIT)
    latch = advance(latch, np.array([True, True]), 0.5, 3.5)
    assert latch.clear_s.tolist() == [0.5, 0.0]
    latch = exclude(latch, np.array([True, True]), ExclusionCause.B_VALUE)
    assert latch.cause.tolist() == [ExclusionCause.PRC_LIMIT, ExclusionCause.B_VALUE]
    assert latch.clear_s.tolist() == [0.0, 0.0]


def test_release_tells_what_ended():
    latch = exclude(initial_latch(3), np.array([True, True, False]), ExclusionCause.B_VALUE)
    latch = advance(latch, np.array([True, False, True]), 2.0, 3.5)
    latch, ended = release(latch, 2.0, 2.0)
    assert ended.tolist() == [True, False, False]
    assert latch.excluded.tolist() == [False, True, False]


def test_causes_are_words_and_latched_ones_are_told_apart():
    assert ExclusionCause.B_VALUE.word == "b_value"
    affairs = {
        "NONE", "NOT_TRACKED", "SETTLING", "BELOW_MASK", "NO_EPHEMERIS", "TOO_FEW_RECEIVERS",
        "TOO_FEW_COMMON_SATELLITES", "SIGMA_TOO_LARGE", "NO_RATE", "UNMONITORED", "IONOSPHERE_UNPROTECTED",
    }  # fmt: skip
    assert {cause.name for cause in ExclusionCause if cause < FIRST_LATCHED} == affairs


def times_excluded(free_s, rounds, readmission_s=2.0, longest_s=10.0):
    """Clear times that a thing waits for when it fails again each time it has been free for `free_s`."""
    latch, waited = initial_latch(1), []
    for _ in range(rounds):
        latch = exclude(latch, YES, ExclusionCause.B_VALUE)
        count = 0
        while latch.excluded[0]:
            latch = advance(latch, YES, 0.5, 3.5)
            latch, _ = release(latch, readmission_s, longest_s)
            count += 1
        waited.append(0.5 * count)
        for _ in range(round(free_s / 0.5)):
            latch, _ = release(advance(latch, YES, 0.5, 3.5), readmission_s, longest_s)
    return waited


def test_what_fails_again_waits_twice_as_long_up_to_the_longest_time():
    assert times_excluded(1.0, 5) == [2.0, 4.0, 8.0, 10.0, 10.0]


def test_what_was_free_for_the_longest_time_is_new():
    assert times_excluded(10.0, 3) == [2.0, 2.0, 2.0]
    assert times_excluded(9.5, 3) == [2.0, 4.0, 8.0]


def test_the_longest_time_is_no_less_than_the_first():
    assert times_excluded(1.0, 3, longest_s=0.0) == [2.0, 2.0, 2.0]
