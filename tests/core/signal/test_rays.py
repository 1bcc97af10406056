"""Rays in a scene: paths by the paper's geometry with a satellite far away, Fresnel's limits, shadows by sampling."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.satellites import N_SATS
from gbas_core.signal.antenna import ANTENNAS, AntennaPattern
from gbas_core.signal.rays import Scene, ray_errors
from gbas_core.signal.surfaces import MATERIALS, Facet, box, circular_reflection, mesh_facets
from gbas_core.signals import FREQUENCY_HZ, L1, L2, L5, WAVELENGTH_M

# As strong in both polarisations from everywhere: what reflects is all that makes a difference.
ALIKE = AntennaPattern(name="alike", elevation_deg=(-90.0, 90.0), gain_dbic=(0.0, 0.0), cross_dbic=(0.0, 0.0))
ONLY_RIGHT = ANTENNAS["isotropic"]
SPACING = (0.1, 0.1, 1.0)


def towards(azimuth_deg, elevation_deg) -> np.ndarray:
    """Unit vectors (3, S), east, north, up."""
    azimuth, elevation = np.broadcast_arrays(np.radians(azimuth_deg), np.radians(elevation_deg))
    return np.stack([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])


def on_axis(los: np.ndarray) -> np.ndarray:
    """Directions (3, S) in the first places of the satellite axis, for one receiver."""
    placed = np.full((1, 3, N_SATS), np.nan)
    placed[0, :, : los.shape[1]] = los
    return placed


# --- the ground


def test_ground_reflection_is_late_by_twice_the_height_times_the_sine():
    elevation = np.array([5.0, 20.0, 60.0, 90.0])
    rays = Scene(ground="metal").trace(np.array([[10.0, 20.0, 3.0]]), towards(30.0, elevation)[np.newaxis], ALIKE)
    assert rays.visible.all()
    np.testing.assert_allclose(rays.delay_m[0, 0], 2.0 * 3.0 * np.sin(np.radians(elevation)), rtol=1e-12)
    # A metal turns right-handed waves into left-handed ones of the same strength.
    np.testing.assert_allclose(np.abs(rays.amplitude[0, 0, [L1, L5]]), 1.0, atol=2e-3)
    assert (rays.amplitude[0, 0, L2] == 0.0).all()
    right = Scene(ground="metal").trace(np.array([[0.0, 0.0, 3.0]]), towards(30.0, elevation)[np.newaxis], ONLY_RIGHT)
    assert np.abs(right.amplitude[0, 0, L1, 1:]).max() < 2e-3


def test_below_the_horizon_is_the_ground():
    rays = Scene().trace(np.array([[0.0, 0.0, 3.0]]), towards(0.0, np.array([-5.0, 5.0]))[np.newaxis], ALIKE)
    np.testing.assert_array_equal(rays.visible, [[False, True]])
    open_sky = Scene(ground=None).trace(np.array([[0.0, 0.0, 3.0]]), towards(0.0, np.array([-5.0]))[np.newaxis], ALIKE)
    assert open_sky.visible.all()
    assert open_sky.delay_m.shape == (0, 1, 1)


@pytest.mark.parametrize("name", sorted(MATERIALS))
def test_reflection_coefficients_at_their_limits(name):
    material = MATERIALS[name]
    l1 = float(FREQUENCY_HZ[L1])

    def parts(sine: float) -> tuple[complex, complex]:
        right, left = circular_reflection(material.permittivity, material.conductivity_spm, 0.0, np.array([sine]), l1)
        return complex(right[0]), complex(left[0])

    # At grazing incidence everything comes back upside down, and right-handed.
    right, left = parts(1e-9)
    assert right == pytest.approx(-1.0, abs=1e-3)
    assert abs(left) < 1e-3
    # From the zenith both linear parts come back alike: left-handed, by (n - 1) / (n + 1).
    right, left = parts(1.0)
    index = np.sqrt(material.permittivity - 1j * material.conductivity_spm / (2 * math.pi * l1 * 8.8541878128e-12))
    assert abs(right) < 1e-9
    assert left == pytest.approx((index - 1.0) / (index + 1.0), abs=1e-9)
    # No more comes back than came.
    for sine in (0.05, 0.2, 0.5, 0.8):
        right, left = parts(sine)
        assert abs(right) ** 2 + abs(left) ** 2 <= 1.0 + 1e-12


def test_at_brewsters_angle_only_the_horizontal_part_comes_back():
    """Grazing angle of tan = 1 / n: both circular parts are half of it, and equal but for their sign."""
    sine = math.sin(math.atan(1.0 / math.sqrt(4.0)))
    right, left = circular_reflection(4.0, 0.0, 0.0, np.array([sine]), float(FREQUENCY_HZ[L1]))
    assert right[0] == pytest.approx(-left[0], abs=1e-12)
    assert right[0].real == pytest.approx(-0.5 * (4.0 - 1.0) / (4.0 + 1.0), abs=1e-12)


def test_rough_ground_reflects_less():
    """Ament: exp(-2 (2 pi s sin / wavelength)^2); Rayleigh's s = wavelength / (8 sin) leaves exp(-pi^2 / 8) = 0.29."""
    sine = np.array([0.5])
    height_m = float(WAVELENGTH_M[L1]) / (8.0 * 0.5)
    smooth, rough = (circular_reflection(15.0, 0.1, s, sine, float(FREQUENCY_HZ[L1]))[1] for s in (0.0, height_m))
    assert abs(rough[0] / smooth[0]) == pytest.approx(math.exp(-(math.pi**2) / 8.0), rel=1e-9)


def test_errors_of_a_ground_reflection():
    """Van Nee: a reflection closer than half the spacing moves the code by a delay / (1 + a) in phase."""
    height_m, spacing = 2.0, 0.5
    elevation = np.linspace(20.0, 80.0, N_SATS)
    los = towards(0.0, elevation)[np.newaxis]
    rays = Scene(ground="metal").trace(np.array([[0.0, 0.0, height_m]]), los, ALIKE)
    weaker = rays._replace(amplitude=0.3 * rays.amplitude)
    errors = ray_errors(weaker, (spacing, 0.3, spacing))
    delay_m = 2.0 * height_m * np.sin(np.radians(elevation))
    amplitude = weaker.amplitude[0, 0, L1] * np.exp(-2j * np.pi * delay_m / WAVELENGTH_M[L1])
    # Real part of a / (1 + a): the delay's share in the sum of both phasors, as long as all is linear.
    expected = (amplitude / (1.0 + amplitude)).real * delay_m
    np.testing.assert_allclose(errors.code_m[0, L1, :32], expected[:32], rtol=0.05, atol=5e-3)
    # The carrier's phase is that of the sum; range grows when it falls behind. 4 m late, a copy's correlation is less
    # than 1 by 1.4 % (C/A) and 4 % (E1).
    phase = np.angle(1.0 + amplitude)
    np.testing.assert_allclose(errors.carrier_m[0, L1], -phase * WAVELENGTH_M[L1] / (2 * np.pi), rtol=0.06, atol=1e-5)
    np.testing.assert_allclose(errors.cn0_db[0, L1], 20.0 * np.log10(np.abs(1.0 + amplitude)), atol=0.15)
    assert (errors.code_m[0, L2] == 0.0).all()


def test_limiting_antenna_has_less_of_it():
    los = on_axis(towards(0.0, np.array([7.0, 10.0, 20.0, 40.0])))
    antenna = np.array([[0.0, 0.0, 3.0]])
    errors = [ray_errors(Scene().trace(antenna, los, ANTENNAS[name]), SPACING) for name in ("mla", "patch")]
    largest = [np.abs(each.code_m[0, L1]).max() for each in errors]
    assert largest[0] < 0.05  # 2 a h sin(E) at most: 30 dB down, 0.03 x 4 m
    assert largest[1] > 3.0 * largest[0]


# --- facets


def far_away(
    antenna: np.ndarray, direction: np.ndarray, corner: np.ndarray, normal: np.ndarray
) -> tuple[float, np.ndarray]:
    """Extra path and point of reflection by Sabatini et al., eq (25) to (28), corrected, satellite at 2e7 m."""
    satellite = antenna + 2.0e7 * direction
    image = antenna - 2.0 * normal * float(normal @ (antenna - corner))
    share = float(normal @ (corner - satellite)) / float(normal @ (image - satellite))
    point = satellite + share * (image - satellite)
    way = np.linalg.norm(satellite - point) + np.linalg.norm(antenna - point) - np.linalg.norm(antenna - satellite)
    return float(way), point


def test_wall_reflection_by_the_papers_geometry():
    """A wall in the north that looks south; from far away, plane waves: the difference is h^2 / 2e7 m."""
    wall = Facet(corner_m=(-60.0, 40.0, 0.0), first_m=(120.0, 0.0, 0.0), second_m=(0.0, 0.0, 30.0), material="metal")
    scene = Scene(facets=(wall,), ground=None)
    antenna = np.array([5.0, -3.0, 3.0])
    normal = np.array([0.0, -1.0, 0.0])
    met = 0
    for azimuth_deg in range(90, 271, 10):
        for elevation_deg in range(5, 90, 9):
            direction = towards(float(azimuth_deg), float(elevation_deg))
            rays = scene.trace(antenna[np.newaxis], direction[np.newaxis, :, np.newaxis], ALIKE)
            way_m, point = far_away(antenna, direction, np.array(wall.corner_m), normal)
            on_wall = direction[1] < -1e-9 and abs(point[0]) < 60.0 and 0.0 < point[2] < 30.0
            assert rays.delay_m.any() == on_wall, (azimuth_deg, elevation_deg, point)
            if on_wall:
                met += 1
                assert rays.delay_m[0, 0, 0] == pytest.approx(way_m, abs=1e-3)
    assert met > 20


def test_wall_looks_to_one_side_and_hides_from_both():
    wall = Facet(corner_m=(-60.0, 40.0, 0.0), first_m=(120.0, 0.0, 0.0), second_m=(0.0, 0.0, 30.0), material="metal")
    scene = Scene(facets=(wall,), ground=None)
    north, south = towards(0.0, np.array([20.0])), towards(180.0, np.array([20.0]))
    los = np.concatenate([north, south], axis=1)[np.newaxis]
    before = scene.trace(np.array([[0.0, 0.0, 3.0]]), los, ALIKE)
    np.testing.assert_array_equal(before.visible, [[False, True]])
    np.testing.assert_array_equal(before.delay_m[0] > 0.0, [[False, True]])
    behind = scene.trace(np.array([[0.0, 80.0, 3.0]]), los, ALIKE)
    np.testing.assert_array_equal(behind.visible, [[True, False]])
    assert not behind.delay_m.any()


def test_shadows_of_a_box_by_sampling():
    """A second way to know: whether any point along the ray is inside the box."""
    size, heading = (80.0, 30.0, 15.0), 0.4
    scene = Scene(facets=box(center_m=(60.0, 40.0), size_m=size, heading_rad=heading), ground=None)
    generator = np.random.default_rng(3)
    los = towards(generator.uniform(0.0, 360.0, 400), generator.uniform(0.0, 60.0, 400))
    antenna = np.array([[0.0, 0.0, 3.0], [60.0, -20.0, 8.0]])
    visible = scene.trace(antenna, np.broadcast_to(los, (2, 3, 400)), ALIKE).visible
    along = np.arange(0.0, 300.0, 0.02)
    ahead, left = np.array([math.sin(heading), math.cos(heading)]), np.array([-math.cos(heading), math.sin(heading)])
    for row in range(2):
        for place in range(0, 400, 4):
            points = antenna[row] + along[:, np.newaxis] * los[:, place]
            flat = points[:, :2] - np.array([60.0, 40.0])
            inside = (np.abs(flat @ ahead) < 40.0) & (np.abs(flat @ left) < 15.0) & (points[:, 2] < 15.0)
            # Rays that cut a corner over less than a few samples may differ.
            if 0 < inside.sum() < 5:
                continue
            assert visible[row, place] == (not inside.any())
    assert 0.8 < visible.mean() < 0.98


def test_a_reflection_that_is_hidden_is_none():
    """A screen between antenna and wall: the sky in the south is free, the wall's reflection is not."""
    wall = Facet(corner_m=(-200.0, 40.0, 0.0), first_m=(400.0, 0.0, 0.0), second_m=(0.0, 0.0, 100.0), material="metal")
    screen = Facet(corner_m=(-200.0, 20.0, 0.0), first_m=(400.0, 0.0, 0.0), second_m=(0.0, 0.0, 20.0))
    antenna, los = np.array([[0.0, 0.0, 3.0]]), towards(180.0, np.array([30.0, 30.0]))[np.newaxis]
    free = Scene(facets=(wall,), ground=None).trace(antenna, los, ALIKE)
    assert (free.delay_m > 0.0).all()
    hidden = Scene(facets=(wall, screen), ground=None).trace(antenna, los, ALIKE)
    # What is left is the screen's own reflection, of 20 m rather than 40 m.
    assert hidden.delay_m.shape[0] == 1
    np.testing.assert_allclose(hidden.delay_m[0], 2.0 * 20.0 * math.cos(math.radians(30.0)))


def test_a_triangle_is_half_a_rectangle():
    corner, first, second = (-30.0, 40.0, 0.0), (60.0, 0.0, 0.0), (0.0, 0.0, 60.0)
    whole = Scene(facets=(Facet(corner_m=corner, first_m=first, second_m=second),), ground=None)
    vertices = np.array([[-30.0, 40.0, 0.0], [30.0, 40.0, 0.0], [-30.0, 40.0, 60.0], [30.0, 40.0, 60.0]])
    halves = mesh_facets(vertices, [[0, 1, 2], [3, 2, 1]], material="concrete")
    both, lower = Scene(facets=halves, ground=None), Scene(facets=halves[:1], ground=None)
    generator = np.random.default_rng(4)
    los = towards(generator.uniform(90.0, 270.0, 300), generator.uniform(0.0, 80.0, 300))[np.newaxis]
    antenna = np.array([[2.0, 1.0, 3.0]])
    one, two, half = (scene.trace(antenna, los, ALIKE) for scene in (whole, both, lower))
    np.testing.assert_allclose(two.delay_m, one.delay_m)
    np.testing.assert_allclose(two.amplitude, one.amplitude)
    assert 0 < (half.delay_m > 0.0).sum() < (one.delay_m > 0.0).sum()


def test_receivers_and_satellites_do_not_matter_to_each_other():
    scene = Scene(facets=box(center_m=(40.0, 40.0), size_m=(60.0, 20.0, 15.0), heading_rad=0.3, material="metal"))
    generator = np.random.default_rng(8)
    los = towards(generator.uniform(0.0, 360.0, N_SATS), generator.uniform(3.0, 85.0, N_SATS))
    antenna = np.array([[0.0, 0.0, 3.0], [10.0, 5.0, 3.0], [-30.0, 10.0, 30.0]])
    together = ray_errors(scene.trace(antenna, np.broadcast_to(los, (3, 3, N_SATS)), ANTENNAS["patch"]), SPACING)
    alone = ray_errors(scene.trace(antenna[1:2], los[np.newaxis], ANTENNAS["patch"]), SPACING)
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one[0], other[1])
    assert np.abs(together.code_m[1]).max() > 0.01


def test_missing_satellites():
    rays = Scene().trace(np.array([[0.0, 0.0, 3.0]]), np.full((1, 3, N_SATS), np.nan), ALIKE)
    assert not rays.visible.any()
    errors = ray_errors(rays, SPACING)
    assert all((each == 0.0).all() for each in errors)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Scene(ground="marble"),
            "ground = 'marble' is not one of metal, concrete, glass, ",
        ),
        (lambda: Facet(corner_m=(0.0,) * 3, first_m=(1.0, 0.0, 0.0), second_m=(2.0, 0.0, 0.0)), "span no area"),
        (
            lambda: box(center_m=(0.0, 0.0), size_m=(1.0, 0.0, 1.0), heading_rad=0.0),
            "size_m = (1.0, 0.0, 1.0) is not above",
        ),
        (
            lambda: ray_errors(Scene().trace(np.zeros((1, 3)), np.zeros((1, 3, N_SATS)), ALIKE), (0.1, 0.1)),
            "spacing_chips = (0.1, 0.1) is not three numbers",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)
