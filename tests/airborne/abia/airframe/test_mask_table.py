"""Masking table: which cell a direction is in, horizons of antennas on both sides, and unknown directions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_airborne.abia.airframe.mask_table import MaskTable, antenna_elevation_rad


def test_open_sky_ends_at_the_horizon():
    table = MaskTable.open_sky(math.radians(5.0))
    elevation = np.radians([-90.0, 4.999, 5.001, 90.0])
    assert table.masked(1.0, elevation).tolist() == [True, True, False, False]


def test_antenna_below_sees_the_ground():
    """Axis down: elevations in its frame are those of the body with the sign changed."""
    table = MaskTable.open_sky(math.radians(5.0), axis=(0.0, 0.0, 1.0))
    assert table.masked(np.zeros(3), np.radians([-30.0, -4.9, 30.0])).tolist() == [False, True, True]
    azimuth = np.linspace(0.0, 6.0, 7)
    np.testing.assert_allclose(antenna_elevation_rad(azimuth, 0.3, (0.0, 0.0, 1.0)), -0.3, atol=1e-12)


def test_axis_to_the_right_counts_from_the_right_wing():
    assert antenna_elevation_rad(0.5 * math.pi, 0.0, (0.0, 1.0, 0.0)) == pytest.approx(0.5 * math.pi)
    assert antenna_elevation_rad(1.5 * math.pi, 0.0, (0.0, 1.0, 0.0)) == pytest.approx(-0.5 * math.pi)


def test_cells_and_turns_of_the_circle():
    blocked = np.zeros((4, 2), dtype=bool)
    blocked[1, 1] = True  # to the right and up: azimuth 90 to 180 degrees, elevation 0 to 90
    table = MaskTable(blocked=blocked, horizon_rad=-0.5 * math.pi)
    azimuth = np.radians([89.9, 90.1, 179.9, 180.1, 90.1 - 360.0, 90.1 + 720.0, 90.1, 90.1])
    elevation = np.radians([10.0, 10.0, 10.0, 10.0, 10.0, 10.0, -10.0, 90.0])
    assert table.masked(azimuth, elevation).tolist() == [False, True, True, False, True, True, False, True]


def test_what_is_not_known_is_masked():
    table = MaskTable.open_sky(-0.5 * math.pi)
    assert table.masked([math.nan, 0.0, math.inf, 0.0], [0.5, math.nan, 0.5, 2.0]).all()
    assert table.masked(0.0, 0.5).shape == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"horizon_rad": math.nan}, "horizon_rad"),
        ({"axis": (0.0, 0.0, -2.0)}, "unit vector"),
        ({"blocked": np.zeros(3, dtype=bool)}, "blocked"),
    ],
)
def test_bad_tables_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        MaskTable(**({"blocked": np.zeros((2, 2), dtype=bool), "horizon_rad": 0.0} | changes))
