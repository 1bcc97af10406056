"""Our aircraft: published dimensions, antennas on the skin, what they hide, and how fast and good the tables are."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from gbas_airborne.abia.airframe.aircraft import AIRCRAFT, aircraft_of, fighter
from gbas_airborne.abia.airframe.mask_table import AntennaMasks, MaskTable, body_direction, share_unlike_rays
from gbas_airborne.abia.airframe.mesh import AirframeError

ANTENNAS = [(name, antenna) for name in AIRCRAFT for antenna in aircraft_of(name).antennas]


def size_m(name: str) -> np.ndarray:
    return np.ptp(aircraft_of(name).airframe.vertices_m, axis=0)


@pytest.mark.parametrize(("name", "span_m"), [("fighter", 13.91), ("fighter_swept", 8.60)])
def test_fighter_is_of_table_1(name, span_m):
    """Sabatini et al., Table I; height is from the ground, so the fin and the place of the antennas give it."""
    length, span, height = size_m(name)
    assert length == pytest.approx(16.72, abs=5e-3)
    assert span == pytest.approx(span_m, abs=5e-3)
    assert height < 5.95  # without landing gear


def test_fighter_wing_area():
    """26.6 m^2 between the tips: the trapezoid of the outer wing, continued to the centreline."""
    vertices = aircraft_of("fighter").airframe.vertices_m
    tip = vertices[np.isclose(vertices[:, 1], 13.91 / 2)]
    tip_chord = np.ptp(tip[:, 0])
    assert 0.5 * (tip_chord / 0.35 + tip_chord) * 13.91 == pytest.approx(26.6, rel=1e-3)


def test_airliner_and_uav_dimensions():
    """Airbus: 37.57 x 34.10 m; the wing's tip is 0.1 % farther out, for its section stands across the dihedral."""
    assert size_m("airliner")[:2] == pytest.approx([37.57, 34.10], rel=1e-3)
    assert size_m("small_uav")[:2] == pytest.approx([1.7, 2.9], rel=1e-3)


@pytest.mark.parametrize(("name", "antenna"), ANTENNAS, ids=lambda each: str(getattr(each, "name", each)))
def test_antennas_are_a_few_centimetres_off_the_skin(name, antenna):
    airframe = aircraft_of(name).airframe
    assert not airframe.inside(antenna.place_m)
    assert 0.015 < airframe.distance_m(antenna.place_m) < 0.06


def test_antennas_of_the_paper():
    """Eq (2), (3): 0.88 m behind the origin, 0.74 m above and 2.13 m below it, 5 cm off the skin."""
    upper, lower = fighter().antennas
    assert (upper.place_m, lower.place_m) == ((-0.88, 0.0, -0.74), (-0.88, 0.0, 2.13))
    for each in (upper, lower):
        assert fighter().airframe.distance_m(each.place_m) == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize(("name", "antenna"), ANTENNAS, ids=lambda each: str(getattr(each, "name", each)))
def test_table_against_direct_rays(name, antenna):
    """At most 0.3 % of directions."""
    airframe = aircraft_of(name).airframe
    table = MaskTable.of_mesh(airframe, antenna.place_m, axis=antenna.axis)
    assert share_unlike_rays(table, airframe, antenna.place_m) < 0.003


def test_what_the_fighter_hides():
    """Of the upper hemisphere about 0.4 % (ours has the whole canopy): fin behind, canopy ahead, nothing else."""
    upper = fighter().antenna("upper")
    table = MaskTable.of_mesh(fighter().airframe, upper.place_m)
    assert 0.003 < table.blocked_share() < 0.007
    # The fin's top is 2.21 m above the antenna and its leading edge there 6.52 m behind.
    top = math.atan2(2.95 - 0.74, 7.4 - 0.88)
    behind = table.masked(math.pi, top + np.radians([-0.3, 0.3]))
    assert behind.tolist() == [True, False]
    mirror = np.radians(np.arange(0.5, 180.0))
    grid = np.radians(np.arange(-85.0, 86.0, 2.0))[:, np.newaxis]
    unlike = table.masked(mirror, grid) != table.masked(-mirror, grid)
    assert unlike.mean() < 0.01  # cells at edges


def test_both_antennas_see_almost_everything():
    aircraft = fighter()
    masks = AntennaMasks(
        tables=tuple(MaskTable.of_mesh(aircraft.airframe, a.place_m, axis=a.axis) for a in aircraft.antennas)
    )
    assert not masks.masked(1.0, math.radians(-40.0))
    assert not masks.masked(1.0, math.radians(40.0))
    assert masks.masked(1.0, 0.0)  # in the plane of both
    np.testing.assert_allclose(masks.elevation_rad(1.0, np.radians([-40.0, 40.0])), np.radians([40.0, 40.0]))
    assert math.isnan(float(masks.elevation_rad(1.0, 0.0)))


def test_65_thousand_rays_take_less_than_50_ms():
    """The best of five: the machine may be busy."""
    airframe, place = fighter().airframe, (-0.88, 0.0, -0.74)
    azimuth, elevation = np.meshgrid(np.radians(np.arange(0.5, 360.0)), np.radians(np.arange(-90.0, 91.5)))
    along = body_direction(azimuth, elevation).reshape(-1, 3)
    assert len(along) >= 65_000
    airframe.stops(place, along[:10])
    times = []
    for _ in range(5):
        start = time.perf_counter()
        airframe.stops(place, along)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.05


def test_what_is_not_there_is_refused():
    with pytest.raises(AirframeError, match="'glider' is not one of fighter"):
        aircraft_of("glider")
    with pytest.raises(AirframeError, match="antenna 'side' is not one of upper, lower"):
        fighter().antenna("side")
    with pytest.raises(AirframeError, match="sweep_deg = 70.0 is not within 25 to 67"):
        fighter(70.0)
