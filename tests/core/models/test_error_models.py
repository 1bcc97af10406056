"""Error models against the published tables, and against the physics they come from."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import quad

from gbas_core.models import error_models as models

TABLE = yaml.safe_load((Path(__file__).parents[2] / "tables" / "accuracy_designators.yaml").read_text(encoding="utf-8"))
SOME_ELEVATIONS_DEG = (5.0, 12.5, 35.0, 36.0, 90.0)
ZENITH = math.pi / 2


def published_ground(designator, elevation_deg, receivers):
    part = next(p for p in TABLE["ground"][designator] if p["from_deg"] <= elevation_deg <= p["to_deg"])
    single = part["a0"] + part["a1"] * math.exp(-elevation_deg / part["theta0"])
    return math.sqrt(single**2 / receivers + part["a2"] ** 2)


def published_curve(part, elevation_deg):
    return part["a0"] + part["a1"] * math.exp(-elevation_deg / part["theta0"])


@pytest.mark.parametrize("designator", ["A", "B", "C"])
@pytest.mark.parametrize("receivers", [1, 2, 3, 4])
@pytest.mark.parametrize("elevation_deg", SOME_ELEVATIONS_DEG)
def test_ground_designators(designator, receivers, elevation_deg):
    expected = published_ground(designator, elevation_deg, receivers)
    assert models.sigma_pr_gnd(designator, math.radians(elevation_deg), receivers) == pytest.approx(expected, rel=1e-12)


def test_ground_designator_c_by_hand():
    """Low: sqrt(0.24^2 / 4 + 0.04^2) = sqrt(0.016) m."""
    assert models.sigma_pr_gnd("C", math.radians(20.0), 4) == pytest.approx(math.sqrt(0.016), rel=1e-12)


def test_designator_c_steps_above_35_degrees():
    """The lower part holds up to and including 35 degrees, and is the larger of the two there by less than 3 mm."""
    at, above = models.sigma_pr_gnd("C", np.deg2rad([35.0, 35.001]), 1)
    assert 0.0 < at - above < 0.003


@pytest.mark.parametrize("designator", ["A", "B"])
@pytest.mark.parametrize("elevation_deg", SOME_ELEVATIONS_DEG)
def test_airborne_designators(designator, elevation_deg):
    noise = published_curve(TABLE["noise"][designator], elevation_deg)
    multipath = published_curve(TABLE["multipath"], elevation_deg)
    elevation = math.radians(elevation_deg)
    assert models.sigma_noise_air(designator, elevation) == pytest.approx(noise, rel=1e-12)
    assert models.sigma_multipath_air(elevation) == pytest.approx(multipath, rel=1e-12)
    assert models.sigma_air(designator, elevation) == pytest.approx(math.sqrt(noise**2 + multipath**2), rel=1e-12)


def test_designators_order():
    """At every elevation A is worse than B, and B worse than C."""
    elevation = np.deg2rad(np.linspace(5.0, 90.0, 500))
    ground = [models.sigma_pr_gnd(designator, elevation, 3) for designator in ("A", "B", "C")]
    assert (ground[0] > ground[1]).all()
    assert (ground[1] > ground[2]).all()
    assert (models.sigma_air("A", elevation) > models.sigma_air("B", elevation)).all()


ALL_MODELS = [
    lambda elevation: models.sigma_pr_gnd("A", elevation, 2),
    lambda elevation: models.sigma_pr_gnd("C", elevation, 2),
    lambda elevation: models.sigma_air("B", elevation),
    models.sigma_multipath_air,
    lambda elevation: models.tropo_correction_m(320.0, 7000.0, elevation, 500.0),
    lambda elevation: models.sigma_tropo_m(20.0, 7000.0, elevation, 500.0),
    lambda elevation: models.sigma_iono_m(4e-6, elevation, 5000.0, 70.0, 100.0),
]


@pytest.mark.parametrize("model", ALL_MODELS)
def test_below_the_mask_there_is_no_sigma(model):
    elevation = np.deg2rad([-90.0, 0.0, 4.999, 5.0, 90.0, np.nan])
    np.testing.assert_array_equal(np.isfinite(model(elevation)), [False, False, False, True, True, False])


def test_the_mask_is_a_parameter():
    assert np.isfinite(models.sigma_air("B", math.radians(3.0), mask_rad=0.0))
    assert np.isnan(models.sigma_air("B", math.radians(8.0), mask_rad=math.radians(10.0)))


@pytest.mark.parametrize("receivers", [0, -1, np.nan])
def test_no_receiver_no_sigma(receivers):
    assert np.isnan(models.sigma_pr_gnd("B", ZENITH, receivers))


def test_receivers_may_differ_by_satellite():
    sigma = models.sigma_pr_gnd("B", np.full(3, ZENITH), np.array([4.0, 1.0, 0.0]))
    assert sigma[0] < sigma[1]
    assert np.isnan(sigma[2])


def test_unknown_designators():
    with pytest.raises(ValueError, match="'D'"):
        models.sigma_pr_gnd("D", ZENITH, 2)
    with pytest.raises(ValueError, match="'C'"):
        models.sigma_air("C", ZENITH)


def test_tropo_correction_is_the_integral_of_the_refractivity():
    """Second formulation: refractivity N exp(-h/h0) integrated from the ground to the aircraft, slanted."""
    refractivity, scale_m, height_m, elevation = 350.0, 7949.0, 1800.0, math.radians(17.0)
    vertical_m, _ = quad(lambda height: 1e-6 * refractivity * math.exp(-height / scale_m), 0.0, height_m)
    expected = vertical_m / math.sqrt(0.002 + math.sin(elevation) ** 2)
    assert models.tropo_correction_m(refractivity, scale_m, elevation, height_m) == pytest.approx(expected, rel=1e-10)


def test_tropo_below_the_reference_point():
    """The correction changes sign with the height, its uncertainty does not."""
    assert models.tropo_correction_m(320.0, 7000.0, ZENITH, -100.0) < 0.0
    assert models.sigma_tropo_m(20.0, 7000.0, ZENITH, -100.0) > 0.0
    assert models.tropo_correction_m(320.0, 7000.0, ZENITH, 0.0) == 0.0


@pytest.mark.parametrize("scale_height_m", [0.0, -7000.0, np.nan])
def test_no_scale_height_no_correction(scale_height_m):
    assert np.isnan(models.tropo_correction_m(320.0, scale_height_m, ZENITH, 100.0))
    assert np.isnan(models.sigma_tropo_m(20.0, scale_height_m, ZENITH, 100.0))


@pytest.mark.parametrize("elevation_deg", [0.0, 5.0, 30.0, 75.0])
def test_obliquity_by_construction(elevation_deg):
    """Second formulation: the ray meets the shell; the factor is one over the cosine of its zenith angle there."""
    radius, shell = 6_378_136.3, 6_378_136.3 + 350_000.0
    sine, cosine = math.sin(math.radians(elevation_deg)), math.cos(math.radians(elevation_deg))
    length = -radius * sine + math.sqrt(shell**2 - (radius * cosine) ** 2)
    pierce = np.array([length * cosine, radius + length * sine])
    factor = 1.0 / (pierce @ [cosine, sine] / np.linalg.norm(pierce))
    assert models.iono_obliquity(math.radians(elevation_deg)) == pytest.approx(factor, rel=1e-12)


def test_obliquity_at_the_ends():
    assert models.iono_obliquity(ZENITH) == pytest.approx(1.0, rel=1e-15)
    assert np.isnan(models.iono_obliquity(-1e-6))


def test_iono_residual_published_example():
    """300 mm/km, 5 km from the threshold at 70 m/s with 30 s smoothing: 2.76 m (5.7 m with 100 s) at the zenith."""
    assert models.sigma_iono_m(300e-6, ZENITH, 5000.0, 70.0, 30.0) == pytest.approx(2.76, abs=1e-9)
    assert models.sigma_iono_m(300e-6, ZENITH, 5000.0, 70.0, 100.0) == pytest.approx(5.7, abs=1e-9)


@pytest.mark.parametrize("position", range(4))
@pytest.mark.parametrize("bad", [-1.0, np.nan])
def test_iono_residual_refuses_what_makes_it_smaller(position, bad):
    arguments = [4e-6, 5000.0, 70.0, 100.0]
    arguments[position] = bad
    gradient, distance, speed, tau = arguments
    assert np.isnan(models.sigma_iono_m(gradient, ZENITH, distance, speed, tau))


def test_shapes_broadcast():
    elevation = np.deg2rad(np.linspace(10.0, 80.0, 68))
    assert models.sigma_iono_m(4e-6, elevation, 5000.0, 70.0, np.array([[100.0], [30.0]])).shape == (2, 68)
    assert models.sigma_pr_gnd("C", elevation, np.full((4, 68), 3.0)).shape == (4, 68)
