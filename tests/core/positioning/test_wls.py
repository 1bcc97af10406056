"""Weighted least squares: the projection matrix and positions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gbas_core.gnss.frames import EARTH_RATE_RADPS, ecef_from_geodetic, rot_enu_ecef
from gbas_core.positioning.wls import (
    MAX_CONDITION,
    projection_matrix,
    solve_position,
    used_satellites,
    vertical_lateral,
)
from gbas_core.signals import SPEED_OF_LIGHT_MPS


def sky(seed, n_sats, lowest_deg=5.0):
    """Unit vectors (3, n_sats) to satellites above a mask, z up."""
    rng = np.random.default_rng(seed)
    sine = rng.uniform(math.sin(math.radians(lowest_deg)), 1.0, n_sats)
    azimuth = rng.uniform(0.0, 2.0 * math.pi, n_sats)
    cosine = np.sqrt(1.0 - sine**2)
    return np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine])


def two_groups(n_sats):
    return np.arange(n_sats) % 2 == np.arange(2)[:, None]


def design_of(los, groups):
    return np.concatenate([-los, groups]).T


@pytest.mark.parametrize("groups", [1, 2])
def test_against_lstsq_on_whitened_rows(groups):
    rng, los = np.random.default_rng(1), sky(1, 12)
    clocks = np.ones((1, 12), dtype=bool) if groups == 1 else two_groups(12)
    sigma_m, values = rng.uniform(0.3, 3.0, 12), rng.normal(size=12)
    projection = projection_matrix(los, sigma_m, clocks)
    design = design_of(los, clocks)
    expected, *_ = np.linalg.lstsq(design / sigma_m[:, None], values / sigma_m, rcond=None)
    # Both are good to the condition number (about 10) times the rounding of doubles.
    np.testing.assert_allclose(projection @ values, expected, rtol=0, atol=1e-13)


def test_against_the_normal_equations():
    """The definition, (G^T W G)^-1 G^T W, written out."""
    rng, los, clocks = np.random.default_rng(2), sky(2, 9), two_groups(9)
    sigma_m = rng.uniform(0.3, 3.0, 9)
    design, weight = design_of(los, clocks), np.diag(sigma_m**-2.0)
    expected = np.linalg.inv(design.T @ weight @ design) @ design.T @ weight
    np.testing.assert_allclose(projection_matrix(los, sigma_m, clocks), expected, atol=1e-12)


def test_four_satellites_by_hand():
    """Zenith and three on the horizon 120 degrees apart: exactly solvable, up is their mean less the zenith's range."""
    angles = np.deg2rad([0.0, 120.0, 240.0])
    los = np.concatenate([[[0.0], [0.0], [1.0]], [np.cos(angles), np.sin(angles), np.zeros(3)]], axis=1)
    projection = projection_matrix(los, np.ones(4), np.ones((1, 4), dtype=bool))
    np.testing.assert_allclose(projection[2], [-1.0, 1 / 3, 1 / 3, 1 / 3], atol=1e-15)
    np.testing.assert_allclose(projection[3], [0.0, 1 / 3, 1 / 3, 1 / 3], atol=1e-15)
    np.testing.assert_allclose(projection[0], [0.0, -2 / 3, 1 / 3, 1 / 3], atol=1e-15)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(5, 30), st.lists(st.floats(0.1, 10.0), min_size=30, max_size=30))
def test_left_inverse(seed, n_sats, sigmas):
    los, sigma_m, clocks = sky(seed, n_sats), np.array(sigmas[:n_sats]), two_groups(n_sats)
    projection = projection_matrix(los, sigma_m, clocks)
    assume(projection is not None)
    # Rounding grows with the condition number, at most the bound of 1e4: 1e4 * 2.2e-16 * a few tens of terms.
    np.testing.assert_allclose(projection @ design_of(los, clocks), np.eye(5), atol=1e-10)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.permutations(range(10)))
def test_order_of_satellites_does_not_matter(seed, order):
    los, sigma_m, clocks = sky(seed, 10), np.linspace(0.5, 2.0, 10), two_groups(10)
    projection = projection_matrix(los, sigma_m, clocks)
    assume(projection is not None)
    permuted = projection_matrix(los[:, order], sigma_m[list(order)], clocks[:, order])
    np.testing.assert_allclose(permuted, projection[:, order], atol=1e-10)


def test_scale_of_the_weights_does_not_matter():
    los, clocks = sky(4, 8), np.ones((1, 8), dtype=bool)
    one = projection_matrix(los, np.linspace(0.5, 2.0, 8), clocks)
    np.testing.assert_allclose(projection_matrix(los, 1e3 * np.linspace(0.5, 2.0, 8), clocks), one, atol=1e-12)


def test_frames_turn_the_projection():
    """S in another frame is the rotation times S: positions turn with the frame, clocks do not."""
    los, clocks = sky(5, 8), np.ones((1, 8), dtype=bool)
    rot = rot_enu_ecef(0.9, 0.2)
    turned, plain = projection_matrix(rot @ los, np.ones(8), clocks), projection_matrix(los, np.ones(8), clocks)
    np.testing.assert_allclose(turned[:3], rot @ plain[:3], atol=1e-13)
    np.testing.assert_allclose(turned[3], plain[3], atol=1e-13)


@pytest.mark.parametrize("sigma", [np.nan, np.inf, 0.0, -1.0])
def test_unused_satellites_have_no_part(sigma):
    los, clocks, sigma_m = sky(6, 10), two_groups(10), np.ones(10)
    sigma_m[[2, 7]] = sigma
    projection = projection_matrix(los, sigma_m, clocks)
    np.testing.assert_array_equal(projection[:, [2, 7]], 0.0)
    rest = np.setdiff1d(np.arange(10), [2, 7])
    alone = projection_matrix(los[:, rest], np.ones(8), clocks[:, rest])
    np.testing.assert_array_equal(projection[:, rest], alone)


def test_a_satellite_without_line_of_sight_or_group_is_unused():
    los, clocks = sky(7, 10), two_groups(10)
    los[1, 3] = np.nan
    clocks[:, 4] = False
    used = used_satellites(los, np.ones(10), clocks)
    np.testing.assert_array_equal(np.nonzero(~used)[0], [3, 4])
    np.testing.assert_array_equal(projection_matrix(los, np.ones(10), clocks)[:, [3, 4]], 0.0)


def test_a_group_without_satellites_is_dropped():
    los, sigma_m = sky(8, 8), np.ones(8)
    clocks = np.array([np.ones(8, dtype=bool), np.zeros(8, dtype=bool)])
    projection = projection_matrix(los, sigma_m, clocks)
    np.testing.assert_array_equal(projection[4], 0.0)
    np.testing.assert_array_equal(projection[:4], projection_matrix(los, sigma_m, clocks[:1]))


def test_one_satellite_of_a_second_group_leaves_the_position():
    """It only determines its own clock."""
    los = sky(9, 7)
    clocks = np.array([np.arange(7) < 6, np.arange(7) == 6])
    projection = projection_matrix(los, np.ones(7), clocks)
    np.testing.assert_allclose(projection[:3, 6], 0.0, atol=1e-14)
    assert projection[4, 6] == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(("n_sats", "groups"), [(3, 1), (0, 1), (4, 2)])
def test_too_few_satellites(n_sats, groups):
    clocks = np.ones((1, n_sats), dtype=bool) if groups == 1 else two_groups(n_sats)
    assert projection_matrix(sky(10, n_sats), np.ones(n_sats), clocks) is None


def test_enough_satellites_of_which_too_few_are_used():
    sigma_m = np.full(20, np.nan)
    sigma_m[:3] = 1.0
    assert projection_matrix(sky(11, 20), sigma_m, np.ones((1, 20), dtype=bool)) is None


def test_satellites_on_a_cone_are_refused():
    """All at one elevation: height and clock cannot be told apart."""
    azimuth = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    los = np.stack([0.8 * np.cos(azimuth), 0.8 * np.sin(azimuth), np.full(8, 0.6)])
    clocks = np.ones((1, 8), dtype=bool)
    assert projection_matrix(los, np.ones(8), clocks) is None
    # A hair's breadth off the cone: the bound decides.
    los = np.stack([los[0], los[1], 0.6 + 1e-6 * np.cos(2 * azimuth)])
    assert projection_matrix(los, np.ones(8), clocks) is None
    assert projection_matrix(los, np.ones(8), clocks, max_condition=1e9) is not None


def test_usual_geometries_are_far_from_the_bound():
    """The bound refuses no geometry one would use: ten satellites over the sky are better than a hundredth of it."""
    for seed in range(50):
        los, clocks = sky(seed, 10), np.ones((1, 10), dtype=bool)
        assert projection_matrix(los, np.ones(10), clocks, max_condition=0.01 * MAX_CONDITION) is not None


def test_wrong_shapes_and_double_membership_are_named():
    los = sky(12, 6)
    with pytest.raises(ValueError, match="expected"):
        projection_matrix(los, np.ones(5), np.ones((1, 6), dtype=bool))
    with pytest.raises(ValueError, match="expected"):
        projection_matrix(los.T, np.ones(6), np.ones((1, 6), dtype=bool))
    with pytest.raises(ValueError, match="more than one group"):
        projection_matrix(los, np.ones(6), np.ones((2, 6), dtype=bool))


def test_inputs_are_left_alone():
    los, sigma_m, clocks = sky(13, 8), np.ones(8), two_groups(8)
    copies = los.copy(), sigma_m.copy(), clocks.copy()
    projection_matrix(los, sigma_m, clocks)
    for given_array, copy in zip((los, sigma_m, clocks), copies, strict=True):
        np.testing.assert_array_equal(given_array, copy)


def test_vertical_and_lateral_projection():
    """An error that moves the position forward along the glide path is no vertical error."""
    projection = projection_matrix(sky(14, 8), np.ones(8), np.ones((1, 8), dtype=bool))
    gpa_rad = math.radians(3.0)
    s_vert, s_lat = vertical_lateral(projection, gpa_rad)
    np.testing.assert_allclose(s_vert, projection[2] + math.tan(gpa_rad) * projection[0], atol=1e-15)
    np.testing.assert_array_equal(s_lat, projection[1])
    down_the_path = design_of(sky(14, 8), np.ones((1, 8))) @ [math.cos(gpa_rad), 0.0, -math.sin(gpa_rad), 0.0]
    assert s_vert @ down_the_path == pytest.approx(0.0, abs=1e-14)


TRUE_M = ecef_from_geodetic(math.radians(52.3), math.radians(10.55), 130.0)


def orbits_above(seed, n_sats):
    """Satellites (3, n_sats) 20 200 km away, above the horizon of TRUE_M, ECEF at transmission."""
    rot = rot_enu_ecef(math.radians(52.3), math.radians(10.55))
    return TRUE_M[:, None] + 2.02e7 * (rot.T @ sky(seed, n_sats))


def flight_range_m(satellite_m):
    """Second formulation: in the inertial frame of reception, when a sphere of light about the satellite meets us."""
    result = []
    for position in satellite_m.T:
        flight_s = 0.0
        for _ in range(6):
            angle = EARTH_RATE_RADPS * flight_s
            turn = np.array([[math.cos(angle), math.sin(angle), 0], [-math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
            flight_s = float(np.linalg.norm(turn @ position - TRUE_M)) / SPEED_OF_LIGHT_MPS
        result.append(flight_s * SPEED_OF_LIGHT_MPS)
    return np.array(result)


@pytest.mark.parametrize("start", ["centre of the Earth", "near"])
def test_position_and_clocks_are_recovered(start):
    satellite_m, clocks = orbits_above(15, 12), two_groups(12)
    range_m = flight_range_m(satellite_m) + np.array([1.5e5, -3.0e4]) @ clocks
    range_m[5] = np.nan
    approximate = np.zeros(3) if start == "centre of the Earth" else TRUE_M + 100.0
    solution = solve_position(approximate, satellite_m, range_m, np.linspace(0.5, 2.0, 12), clocks)
    # Ranges of 2e7 m in doubles are good to 4e-9 m; the dilution is about 2.
    np.testing.assert_allclose(solution.position_m, TRUE_M, atol=1e-6)
    np.testing.assert_allclose(solution.clock_m, [1.5e5, -3.0e4], atol=1e-6)
    assert np.isnan(solution.residual_m[5])
    np.testing.assert_allclose(np.delete(solution.residual_m, 5), 0.0, atol=1e-6)
    np.testing.assert_array_equal(solution.projection[:, 5], 0.0)


def test_range_errors_move_the_position_by_the_projection():
    satellite_m, clocks = orbits_above(16, 10), np.ones((1, 10), dtype=bool)
    range_m, error_m = flight_range_m(satellite_m), np.random.default_rng(3).normal(size=10)
    sigma_m = np.linspace(0.5, 2.0, 10)
    plain = solve_position(TRUE_M, satellite_m, range_m, sigma_m, clocks)
    moved = solve_position(TRUE_M, satellite_m, range_m + error_m, sigma_m, clocks)
    # Metres of displacement turn the lines of sight by 1e-7, which a linear relation leaves out.
    np.testing.assert_allclose(moved.position_m - plain.position_m, plain.projection[:3] @ error_m, atol=1e-5)


def test_a_group_without_satellites_has_no_clock():
    satellite_m = orbits_above(17, 8)
    clocks = np.array([np.ones(8, dtype=bool), np.zeros(8, dtype=bool)])
    solution = solve_position(np.zeros(3), satellite_m, flight_range_m(satellite_m), np.ones(8), clocks)
    assert np.isfinite(solution.clock_m[0])
    assert np.isnan(solution.clock_m[1])


def test_no_position_from_three_ranges():
    satellite_m = orbits_above(18, 6)
    range_m = flight_range_m(satellite_m)
    range_m[3:] = np.nan
    assert solve_position(TRUE_M, satellite_m, range_m, np.ones(6), np.ones((1, 6), dtype=bool)) is None
