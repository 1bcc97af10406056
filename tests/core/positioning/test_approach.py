"""The final approach: geometry by a second construction, deviations, and the published alert limits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.positioning.approach import APD_AB, FinalApproach, alert_limits
from gbas_core.positioning.kernels.approach import FOOT_M

TABLE = yaml.safe_load((Path(__file__).parents[2] / "tables" / "alert_limits.yaml").read_text(encoding="utf-8"))
GPA_RAD = math.radians(3.0)
# ECEF coordinates of 6.4e6 m have a spacing of 9e-10 m; a few operations.
ROUNDING_M = 1e-8


def braunschweig_26(**changes):
    """Runway 26 of Braunschweig-Wolfsburg: true course 264.73 degrees (08 is 84.73); the rest is plausible."""
    values = {
        "ltp_lat_rad": math.radians(52.3202),
        "ltp_lon_rad": math.radians(10.5679),
        "ltp_height_m": 132.0,
        "course_rad": math.radians(264.73),
        "fpap_distance_m": 2300.0,
        "tch_m": 15.0,
        "gpa_rad": GPA_RAD,
        "course_width_m": 105.0,
        "runway": "26",
    }
    return FinalApproach.from_course(**(values | changes))


def toulouse(**changes):
    """The two FAS data blocks of the message type 4 example in ICAO Annex 10 Vol. I, att. D."""
    values = {
        "ltp_lat_rad": math.radians(43.6441075),
        "ltp_lon_rad": math.radians(1.34594),
        "ltp_height_m": 197.3,
        "delta_fpap_lat_rad": math.radians(-0.025145),
        "delta_fpap_lon_rad": math.radians(0.026175),
        "tch_m": 17.05,
        "gpa_rad": GPA_RAD,
    }
    return FinalApproach(**(values | changes))


TOULOUSE_33R = {
    "ltp_lat_rad": math.radians(43.615635),
    "ltp_lon_rad": math.radians(1.380235),
    "ltp_height_m": 200.2,
    "delta_fpap_lat_rad": math.radians(0.02172375),
    "delta_fpap_lon_rad": math.radians(-0.022605),
    "tch_m": 15.25,
    "gpa_rad": math.radians(3.01),
}


def axes_by_vectors(fas):
    """Second construction, without east and north: up is the normal of the ellipsoid, forward points to the FPAP."""
    ltp = ecef_from_geodetic(fas.ltp_lat_rad, fas.ltp_lon_rad, fas.ltp_height_m)
    surface = ecef_from_geodetic(fas.ltp_lat_rad, fas.ltp_lon_rad, 0.0)
    gradient = surface / np.array([6378137.0, 6378137.0, 6356752.314245]) ** 2
    up = gradient / np.linalg.norm(gradient)
    fpap = ecef_from_geodetic(
        fas.ltp_lat_rad + fas.delta_fpap_lat_rad, fas.ltp_lon_rad + fas.delta_fpap_lon_rad, fas.ltp_height_m
    )
    forward = fpap - ltp - up * ((fpap - ltp) @ up)
    length = np.linalg.norm(forward)
    return ltp, forward / length, np.cross(up, forward / length), up, length


def angle(first, second):
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


@pytest.mark.parametrize("fas", [braunschweig_26(), toulouse(), toulouse(**TOULOUSE_33R)], ids=["26", "15R", "33R"])
def test_axes(fas):
    ltp, forward, left, up, length = axes_by_vectors(fas)
    # Directions over 2.3 km with 1e-9 m of rounding.
    np.testing.assert_allclose(fas.rot_approach_ecef, [forward, left, up], atol=1e-11)
    np.testing.assert_allclose(fas.ltp_ecef_m, ltp, atol=ROUNDING_M)
    assert fas.runway_to_fpap_m == pytest.approx(length, abs=ROUNDING_M)
    assert np.linalg.det(fas.rot_approach_ecef) == pytest.approx(1.0, abs=1e-14)


def test_course_of_braunschweig():
    assert math.degrees(braunschweig_26().course_rad) == pytest.approx(264.73, abs=1e-6)


def test_parallel_runways_of_toulouse():
    """15R and 33R are opposite ends of two parallel runways; meridians converge by 0.02 degrees between them."""
    ahead, back = toulouse().course_rad, toulouse(**TOULOUSE_33R).course_rad
    assert math.degrees(back - ahead) == pytest.approx(180.0, abs=0.1)
    assert math.degrees(ahead) == pytest.approx(143.0, abs=1.0)


def test_distance_to_the_fpap_by_radii_of_curvature():
    """Arcs along meridian and parallel: of 3.5 km to a centimetre."""
    fas, e2 = toulouse(), 0.00669437999014
    middle = fas.ltp_lat_rad + fas.delta_fpap_lat_rad / 2
    root = math.sqrt(1.0 - e2 * math.sin(middle) ** 2)
    north = (6378137.0 * (1.0 - e2) / root**3 + 198.0) * fas.delta_fpap_lat_rad
    east = (6378137.0 / root + 198.0) * math.cos(middle) * fas.delta_fpap_lon_rad
    assert fas.runway_to_fpap_m == pytest.approx(math.hypot(north, east), abs=0.01)


def test_reference_points():
    """GARP 305 m beyond the FPAP, DCP at TCH above the LTP, GPIP where the path meets the ground, GERP 150 m beside."""
    fas = braunschweig_26()
    np.testing.assert_allclose(fas.garp_m, [fas.runway_to_fpap_m + 305.0, 0.0, 0.0])
    np.testing.assert_allclose(fas.dcp_m, [0.0, 0.0, 15.0])
    np.testing.assert_allclose(fas.gpip_m, [15.0 / math.tan(GPA_RAD), 0.0, 0.0])
    assert math.dist(fas.gerp_m, fas.gpip_m) == pytest.approx(150.0, abs=1e-12)
    to_fpap = fas.approach_from_ecef(fas.fpap_ecef_m)
    # At the LTP's ellipsoidal height the FPAP is d^2 / 2R = 0.41 m below the tangent plane.
    np.testing.assert_allclose(to_fpap, [2300.0, 0.0, -(2300.0**2) / 2 / 6.375e6], atol=0.005)


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-80.0, 80.0), st.floats(-179.9, 179.9), st.floats(0.0, 359.9), st.floats(2.0, 6.0), st.floats(-500.0, 4e4)
)
def test_the_path_has_no_deviation(latitude_deg, longitude_deg, course_deg, gpa_deg, distance_m):
    fas = braunschweig_26(
        ltp_lat_rad=math.radians(latitude_deg),
        ltp_lon_rad=math.radians(longitude_deg),
        course_rad=math.radians(course_deg),
        gpa_rad=math.radians(gpa_deg),
    )
    deviation = fas.deviations(fas.position_on_path(distance_m))
    assert abs(deviation.lateral_m) < ROUNDING_M
    assert abs(deviation.vertical_m) < ROUNDING_M
    assert deviation.distance_m == pytest.approx(distance_m, abs=ROUNDING_M)
    assert deviation.height_m == pytest.approx(15.0 + distance_m * math.tan(math.radians(gpa_deg)), abs=ROUNDING_M)
    assert deviation.path_height_m == pytest.approx(float(deviation.height_m), abs=2 * ROUNDING_M)
    assert abs(math.remainder(fas.course_rad - math.radians(course_deg), 2 * math.pi)) < 1e-9


def test_an_approach_across_the_date_line():
    fas = braunschweig_26(ltp_lat_rad=0.0, ltp_lon_rad=math.radians(-179.99), course_rad=math.radians(270.0))
    assert fas.delta_fpap_lon_rad == pytest.approx(-2300.0 / 6378137.0, rel=1e-3)


@pytest.mark.parametrize("distance_m", [0.0, 900.0, 5000.0, 20000.0])
@pytest.mark.parametrize("side_m", [-60.0, 0.0, 35.0])
@pytest.mark.parametrize("above_m", [-12.0, 8.0])
def test_deviations_by_vectors(distance_m, side_m, above_m):
    """Second construction: angles between ECEF vectors from the reference points."""
    fas = braunschweig_26()
    ltp, forward, left, up, length = axes_by_vectors(fas)
    position = ltp - distance_m * forward + side_m * left + (15.0 + distance_m * math.tan(GPA_RAD) + above_m) * up
    deviation = fas.deviations(position)
    assert deviation.lateral_m == pytest.approx(side_m, abs=ROUNDING_M)
    assert deviation.vertical_m == pytest.approx(above_m, abs=ROUNDING_M)

    garp = ltp + (length + 305.0) * forward
    flat = position - up * ((position - ltp) @ up)
    lateral_rad = math.copysign(angle(ltp - garp, flat - garp), side_m)
    full_scale_rad = angle(ltp - garp, ltp + 105.0 * left - garp)
    # An angle between vectors of kilometres, from coordinates good to 1e-9 m.
    assert deviation.lateral_ddm == pytest.approx(0.155 * lateral_rad / full_scale_rad, abs=1e-9)

    gerp = ltp + 15.0 / math.tan(GPA_RAD) * forward + 150.0 * left
    elevation_rad = math.pi / 2 - angle(up, position - gerp)
    assert deviation.vertical_ddm == pytest.approx(0.175 * (elevation_rad - GPA_RAD) / (0.25 * GPA_RAD), abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_full_scale(sign):
    """A course width beside the threshold is 0.155; 0.25 GPA above the path, seen from the GPIP, is 0.175."""
    fas = braunschweig_26(gerp_offset_m=0.0)
    beside = fas.ecef_from_approach([0.0, sign * 105.0, 15.0])
    assert fas.deviations(beside).lateral_ddm == pytest.approx(sign * 0.155, abs=1e-9)
    distance_m, elevation_rad = 3000.0, GPA_RAD * (1.0 + sign * 0.25)
    point = fas.gpip_m + distance_m * np.array([-math.cos(elevation_rad), 0.0, math.sin(elevation_rad)])
    assert fas.deviations(fas.ecef_from_approach(point)).vertical_ddm == pytest.approx(sign * 0.175, abs=1e-9)


def test_the_offset_of_the_gerp_bends_the_zero_line():
    """On the straight path an offset GERP shows 'below': at the 200 ft point by less than a tenth of full scale."""
    fas, straight = braunschweig_26(), braunschweig_26(gerp_offset_m=0.0)
    distance_m = np.array([878.0, 2000.0, 10000.0])
    on_path = fas.position_on_path(distance_m)
    np.testing.assert_allclose(straight.deviations(on_path).vertical_ddm, 0.0, atol=1e-9)
    bent = fas.deviations(on_path).vertical_ddm
    assert (bent < 0.0).all()
    assert (np.diff(bent) > 0.0).all()
    assert (np.abs(bent) < 0.1 * 0.175).all()


@settings(max_examples=60, deadline=None)
@given(st.floats(300.0, 3e4), st.floats(0.1, 500.0), st.floats(0.1, 100.0))
def test_signs_and_symmetry(distance_m, side_m, off_m):
    """Left and above are positive, right and below negative, and left and right mirror each other."""
    fas = braunschweig_26(gerp_offset_m=0.0)
    height_m = 15.0 + distance_m * math.tan(GPA_RAD)
    beside = fas.deviations(fas.ecef_from_approach([[-distance_m, side_m, height_m], [-distance_m, -side_m, height_m]]))
    assert beside.lateral_m[0] > 0.0
    assert beside.lateral_ddm[0] > 0.0
    assert beside.lateral_ddm[1] == pytest.approx(-beside.lateral_ddm[0], abs=1e-9)
    assert beside.vertical_ddm[1] == pytest.approx(beside.vertical_ddm[0], abs=1e-9)
    off = fas.deviations(fas.ecef_from_approach([[-distance_m, 0.0, height_m + sign * off_m] for sign in (1, -1)]))
    np.testing.assert_array_equal(np.sign(off.vertical_m), [1.0, -1.0])
    np.testing.assert_array_equal(np.sign(off.vertical_ddm), [1.0, -1.0])


def test_beyond_the_reference_points_there_is_no_angle():
    fas = braunschweig_26()
    beyond = fas.ecef_from_approach([[fas.gpip_m[0] + 1.0, 0.0, 0.0], [fas.garp_m[0] + 1.0, 3.0, 0.0]])
    deviation = fas.deviations(beyond)
    assert np.isnan(deviation.vertical_ddm).all()
    np.testing.assert_array_equal(np.isnan(deviation.lateral_ddm), [False, True])
    np.testing.assert_allclose(deviation.lateral_m, [0.0, 3.0], atol=ROUNDING_M)


def test_shapes_and_missing_positions():
    fas = braunschweig_26()
    positions = np.full((2, 5, 3), np.nan)
    positions[0, 0] = fas.ltp_ecef_m
    deviation = fas.deviations(positions)
    assert deviation.lateral_ddm.shape == (2, 5)
    assert np.count_nonzero(np.isfinite(deviation.distance_m)) == 1
    assert fas.position_on_path(np.zeros((2, 5))).shape == (2, 5, 3)
    round_trip = fas.approach_from_ecef(fas.ecef_from_approach([[1.0, -2.0, 3.0]]))
    np.testing.assert_allclose(round_trip, [[1.0, -2.0, 3.0]], atol=ROUNDING_M)


def published(part, value):
    row = next(row for row in TABLE[part] if row["above"] < value <= row["to"])
    return row["slope"] * value + row["offset"]


@pytest.mark.parametrize("distance_m", [292.0, 873.0, 873.001, 3000.0, 7500.0, 7500.1, 30000.0])
@pytest.mark.parametrize("height_ft", [101.0, 200.0, 200.1, 700.0, 1340.0, 1340.1, 5000.0])
def test_alert_limits_as_published(distance_m, height_ft):
    val_m, lal_m = alert_limits(10.0, 40.0, distance_m, height_ft * FOOT_M)
    assert lal_m == pytest.approx(40.0 + published("lateral", distance_m), abs=1e-9)
    assert val_m == pytest.approx(10.0 + published("vertical", height_ft), abs=1e-9)


def test_largest_alert_limits():
    val_m, lal_m = alert_limits(10.0, 40.0, np.inf, np.inf)
    assert (val_m, lal_m) == (TABLE["printed"]["largest_val_m"], TABLE["printed"]["largest_lal_m"])


def test_alert_limits_hold_below_the_lowest_breakpoint():
    """Beyond the threshold, on and under the ground too."""
    val_m, lal_m = alert_limits(10.0, 40.0, np.array([291.0, 0.0, -2000.0]), np.array([30.0, 0.0, -5.0]))
    np.testing.assert_array_equal(val_m, 10.0)
    np.testing.assert_array_equal(lal_m, 40.0)


def test_alert_limits_are_continuous():
    """The segments meet within a centimetre."""
    for at_m in (873.0, 7500.0):
        _, lal_m = alert_limits(10.0, 40.0, np.array([at_m, at_m + 1e-6]), 100.0)
        assert abs(np.diff(lal_m)[0]) < 0.01
    for at_ft in (200.0, 1340.0):
        val_m, _ = alert_limits(10.0, 40.0, 5000.0, np.array([at_ft, at_ft + 1e-6]) * FOOT_M)
        assert abs(np.diff(val_m)[0]) < 0.01


@given(st.floats(-1e3, 5e4), st.floats(-1e3, 5e4), st.floats(-100.0, 3e3), st.floats(-100.0, 3e3))
def test_alert_limits_grow_with_distance_and_height(distance_a, distance_b, height_a, height_b):
    """Up to the 9 mm by which the published lateral segment starts too low."""
    val_m, lal_m = alert_limits(10.0, 40.0, np.sort([distance_a, distance_b]), np.sort([height_a, height_b]))
    assert np.diff(lal_m)[0] > -0.009
    assert np.diff(val_m)[0] >= 0.0


@pytest.mark.parametrize("place", range(4))
def test_no_limit_known_is_not_a_limit(place):
    arguments = [10.0, 40.0, 1000.0, 100.0]
    arguments[place] = np.nan
    val_m, lal_m = alert_limits(*arguments)
    assert np.isnan(val_m) == (place in (0, 3))
    assert np.isnan(lal_m) == (place in (1, 2))
    constant_val_m, constant_lal_m = alert_limits(*arguments, constant=True)
    assert np.isnan(constant_val_m) == (place in (0, 3))
    assert np.isnan(constant_lal_m) == (place in (1, 2))


def test_limits_of_an_approach_follow_its_path():
    """The height is that of the path at the aircraft's distance, not the aircraft's; designator A and B is constant."""
    fas = braunschweig_26()
    low = fas.ecef_from_approach([[-8000.0, 0.0, 50.0], [-600.0, 0.0, 500.0]])
    val_m, lal_m = fas.limits(fas.deviations(low))
    np.testing.assert_allclose(lal_m, [69.15, 40.0])
    path_ft = (15.0 + np.array([8000.0, 600.0]) * math.tan(GPA_RAD)) / FOOT_M
    np.testing.assert_allclose(val_m, [10.0 + published("vertical", path_ft[0]), 10.0])
    approach_with_vertical_guidance = braunschweig_26(apd=APD_AB, fasval_m=20.0)
    val_m, lal_m = approach_with_vertical_guidance.limits(fas.deviations(low))
    np.testing.assert_array_equal(val_m, 20.0)
    np.testing.assert_array_equal(lal_m, 40.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ltp_lat_rad", 2.0),
        ("ltp_lon_rad", math.nan),
        ("ltp_height_m", 7000.0),
        ("tch_m", -1.0),
        ("gpa_rad", 0.0),
        ("gpa_rad", math.nan),
        ("course_width_m", 10.0),
        ("gerp_offset_m", math.inf),
        ("fasval_m", -1.0),
        ("faslal_m", -0.2),
        ("fasval_m", 100.0),
        ("apd", 8),
        ("rpds", 49),
    ],
)
def test_a_bad_field_is_named(name, value):
    with pytest.raises(ValueError, match=name):
        toulouse(**{name: value})


def test_an_approach_without_a_course_is_refused():
    with pytest.raises(ValueError, match="FPAP"):
        toulouse(delta_fpap_lat_rad=0.0, delta_fpap_lon_rad=0.0)


def test_no_vertical_guidance_is_no_limit():
    fas = toulouse(fasval_m=math.nan)
    val_m, lal_m = fas.limits(fas.deviations(fas.position_on_path(1000.0)))
    assert np.isnan(val_m)
    assert np.isfinite(lal_m)
