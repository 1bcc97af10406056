"""Availability against the number of L5 satellites: closed form against choices drawn, geometry against a cap."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gbas_studies.ccd.availability import MASK_RAD, SLOTS, availability, lines_of_sight, protected, section
from gbas_studies.reproduction.items import Verdict


def test_choices_drawn_give_the_closed_form():
    rng = np.random.default_rng(4)
    up = lines_of_sight()[0] >= MASK_RAD
    for count in (6, 8, 12):
        in_view = monitored = times = positions = 0
        for _ in range(4000):
            has = np.zeros(SLOTS, dtype=bool)
            has[rng.choice(SLOTS, count, replace=False)] = True
            number = (up & has).sum(axis=1)
            in_view += number.sum()
            monitored += number[number - 1 >= 3].sum()  # three others for the clock
            positions += (number >= 4).sum()
            times += len(number)
        found = availability(count)
        # 4000 choices: the share of one choice spreads by some 0.25, so that three deviations of the mean are 0.012.
        assert found.in_view == pytest.approx(in_view / times, abs=0.05)
        assert found.monitored == pytest.approx(monitored / in_view, abs=0.012)
        assert found.position == pytest.approx(positions / times, abs=0.012)


def test_geometry_is_a_sphere_cap():
    """Mean number in view of satellites spread over a sphere: the cap seen above 5 degrees; orbits of 55 degrees lean
    it towards middle latitudes by some per cent."""
    ratio = 6371.0 / 26559.7
    nadir = np.arcsin(ratio * np.cos(MASK_RAD))
    cap = 0.5 * (1.0 - np.cos(np.pi / 2 - MASK_RAD - nadir))
    assert availability(SLOTS).in_view == pytest.approx(SLOTS * cap, rel=0.12)
    elevation, units = lines_of_sight()
    assert np.sin(elevation) == pytest.approx(units[..., 2], abs=1e-12)
    assert np.linalg.norm(units, axis=-1) == pytest.approx(1.0)


def test_limits():
    assert availability(3).monitored == 0.0 == availability(3).position
    assert np.isnan(availability(3).carrier_sigma)
    assert availability(0).in_view == 0.0
    everything = availability(SLOTS)
    # never fewer than four of the 24 in view here, so that all are monitored at all times
    assert everything.monitored == everything.position == pytest.approx(1.0)
    counts = [availability(count) for count in range(4, SLOTS + 1)]
    for fewer, more in pairwise(counts):
        assert fewer.monitored <= more.monitored + 1e-12
        assert fewer.carrier_sigma >= more.carrier_sigma - 1e-12
    # n = 3 others: sqrt(4/3) is the widest there is
    assert counts[0].carrier_sigma == pytest.approx(np.sqrt(4.0 / 3.0))
    assert protected(4, choices=5) <= protected(12, choices=5) <= protected(SLOTS, choices=1)


def test_section():
    items = section(quick=True).items
    assert items[-1].verdict is Verdict.REPRODUCED
