"""Gradient vectors: the truth is among them, with the scatter that is stated, and fronts have direction and speed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.monitors.double_difference import Troposphere, baselines_of, carrier_residual_m
from gbas_ground.monitors.gradient_estimates import LEAST_ANGLE_RAD, front_speed_mps, gradient_vectors
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.troposphere import Troposphere as SimulatedTroposphere
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams
from monitor_scenes import BRAUNSCHWEIG_M, simulated, station_of

PLACE_M = baselines_of(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0]).place_m
BANDS = (L1, L5)
SIGMA_M = np.array([0.003, 0.005])


def vector_of(size, azimuth_deg):
    return size * np.array([np.sin(np.radians(azimuth_deg)), np.cos(np.radians(azimuth_deg))])


def carriers(vector, *, place_m=PLACE_M, bands=BANDS, sigma_m=SIGMA_M, factor=None, rng=None):
    """Satellite less reference at each receiver: gradient, whole wavelengths, what receivers share, and noise."""
    count = len(place_m)
    value = -np.outer(place_m[:, :2] @ vector, IONO_RATIO[list(bands)])
    if rng is not None:
        value += rng.integers(-100, 100, value.shape) * WAVELENGTH_M[list(bands)] + rng.normal(0.0, 10.0, len(bands))
        value += np.outer(np.ones(count) if factor is None else factor, sigma_m) * rng.normal(size=value.shape)
    return value


def explained(value, *, place_m=PLACE_M, bands=BANDS, sigma_m=SIGMA_M, factor=None):
    factor = np.ones(len(place_m)) if factor is None else factor
    return gradient_vectors(value, sigma_m, factor, place_m, bands)


def test_truth_is_among_the_candidates_with_the_stated_scatter():
    """Four receivers of different noise, two bands: lost with 1e-4, so never in 400; errors have the covariance."""
    rng = np.random.default_rng(1)
    factor, normalised, best, guessed = np.array([1.0, 2.0, 0.7, 1.5]), [], 0, 0.0
    for _ in range(400):
        truth = vector_of(rng.uniform(50e-6, 1900e-6), rng.uniform(0.0, 360.0))
        found = explained(carriers(truth, factor=factor, rng=rng), factor=factor)
        errors = found.vector - truth
        number = int(np.argmin(np.hypot(*errors.T)))
        normalised.append(errors[number] @ np.linalg.solve(found.covariance, errors[number]))
        best += number == 0
        guessed += 1.0 / len(found.size)
    # Chi-square of 2 degrees of freedom: mean 2, standard deviation 2 / sqrt(400) = 0.1; four of them.
    assert np.mean(normalised) == pytest.approx(2.0, abs=0.4)
    assert max(normalised) < chi2.isf(1e-4 / 400, 2)
    assert best > guessed  # what fits best is the truth more often than any candidate would be


def test_candidates_are_those_of_a_search_over_all_gradients():
    """Second formulation: wrapped residuals on a dense grid of vectors; wherever they fit, there is a candidate."""
    truth = vector_of(420e-6, 30.0)
    value = carriers(truth, bands=(L1,), sigma_m=SIGMA_M[:1])
    found = explained(value, bands=(L1,), sigma_m=SIGMA_M[:1])
    axis = np.arange(-2000e-6, 2000e-6, 4e-6)
    east, north = (each.ravel() for each in np.meshgrid(axis, axis))
    inside = np.hypot(east, north) < 1950e-6
    grid = np.stack([east[inside], north[inside]], axis=-1)
    predicted = -grid @ (PLACE_M[1:, :2] - PLACE_M[0, :2]).T
    left = (value[1:, 0] - value[0, 0]) - predicted
    left -= WAVELENGTH_M[L1] * np.rint(left / WAVELENGTH_M[L1])
    weight = np.linalg.inv(SIGMA_M[0] ** 2 * (np.eye(3) + 1.0))
    fits = np.einsum("ni,ij,nj->n", left, weight, left) < chi2.isf(1e-4, 1)
    assert fits.any()
    nearest = np.hypot(*(grid[fits][:, np.newaxis] - found.vector).T).min(axis=0)
    # A fit within 3.9 sigma lies within that of its candidate, and of the grid's steps.
    reach = 3.9 * np.sqrt(np.linalg.eigvalsh(found.covariance).max()) + 4e-6
    assert nearest.max() < reach
    # and every candidate has grid points that fit: none is made up
    at = np.hypot(*(found.vector[np.hypot(*found.vector.T) < 1940e-6][:, np.newaxis] - grid[fits]).T).min(axis=0)
    assert at.max() < reach


def test_two_baselines_have_every_pair_of_wavelengths():
    """Three receivers, one band: area of the disc over the area of one pair of wavelengths."""
    place = PLACE_M[:3]
    found = explained(carriers(vector_of(500e-6, 70.0), place_m=place, bands=(L1,), sigma_m=SIGMA_M[:1]),
                      place_m=place, bands=(L1,), sigma_m=SIGMA_M[:1])  # fmt: skip
    cell = WAVELENGTH_M[L1] ** 2 / abs(np.linalg.det(place[1:, :2] - place[0, :2]))
    # Points of a lattice in a disc: the area, give or take its rim (Gauss's circle problem), here of 17 cells across.
    assert len(found.size) == pytest.approx(np.pi * 2000e-6**2 / cell, rel=0.1)
    assert (found.misfit < 1e-12).all()


def test_one_direction_of_baselines_tells_no_direction():
    along = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [700.0, 700.0 * np.tan(0.5 * LEAST_ANGLE_RAD), 0.0]])
    found = explained(carriers(vector_of(400e-6, 90.0), place_m=along), place_m=along)
    assert found.vector.shape == (0, 2)
    assert np.isnan(found.covariance).all()
    missing = carriers(vector_of(400e-6, 90.0))
    missing[1:] = np.nan
    assert explained(missing).vector.shape == (0, 2)
    missing[:] = np.nan
    assert explained(missing).vector.shape == (0, 2)


def test_direction_and_component_have_the_scatter_of_the_vector():
    """First order, against random vectors of the covariance."""
    rng = np.random.default_rng(2)
    found = explained(carriers(vector_of(600e-6, 40.0)))
    assert found.azimuth_rad[0] == pytest.approx(np.radians(40.0), abs=1e-9)
    assert found.size[0] == pytest.approx(600e-6, rel=1e-9)
    drawn = rng.multivariate_normal(found.vector[0], found.covariance, 40_000)
    # A standard deviation of 40,000 draws is good to 0.35 %; four of that.
    assert np.std(np.arctan2(drawn[:, 0], drawn[:, 1])) == pytest.approx(found.azimuth_sigma_rad[0], rel=0.015)
    component, sigma = found.along(np.radians(84.73))
    assert component[0] == pytest.approx(600e-6 * np.cos(np.radians(44.73)), rel=1e-9)
    turned = drawn @ np.array([np.sin(np.radians(84.73)), np.cos(np.radians(84.73))])
    assert np.std(turned) == pytest.approx(sigma, rel=0.015)


def test_speed_by_hand():
    """400 mm/km, a delay that grows by 28 mm/s: 70 m/s; sigma of a quotient."""
    speed, sigma = front_speed_mps(np.array([400e-6, 0.0]), np.diag([4e-6**2, 1.0]), 0.028, 0.0007)
    assert speed == pytest.approx(70.0)
    assert sigma == pytest.approx(70.0 * np.hypot(0.01, 0.025))
    with pytest.raises(ValueError, match="zero"):
        front_speed_mps(np.zeros(2), np.eye(2), 0.03, 1e-3)


@pytest.mark.parametrize(("azimuth_deg", "speed_mps"), [(20.0, 70.0), (130.0, 300.0), (264.73, 100.0)])
def test_front_of_a_simulated_world(azimuth_deg, speed_mps):
    """Its slope over the station, from the carriers that four receivers record, against what was asked for."""
    gradient, width, seconds = 400e-6, 25_000.0, 4.0
    base = WorldParams(
        receiver_ecef_m=tuple(map(tuple, BRAUNSCHWEIG_M.tolist())),
        flight=None,
        duration_s=seconds + 1.0,
        ground=receiver_preset("ideal"),
        troposphere=SimulatedTroposphere(
            refractivity=330.0, scale_height_m=7900.0,
            reference_height_m=float(geodetic_from_ecef(BRAUNSCHWEIG_M[0])[2]),
        ),
        fronts=(
            WedgeFront(
                gradient=gradient, width_m=width, direction_rad=np.radians(azimuth_deg), speed_mps=speed_mps,
                reference="baseline", start_m=-0.5 * width, satellites=("G06",),
            ),
        ),
    )  # fmt: skip
    world = World(base)
    count = round(seconds / base.interval_s)
    epochs = simulated([world.epoch(n) for n in range(count)], world.ephemeris, station_of(BRAUNSCHWEIG_M, "GE"))
    air, rows = Troposphere(refractivity=330.0, scale_height_m=7900.0), []
    for epoch in epochs:
        delay = air.delay_m(epoch.elevation_rad, epoch.azimuth_rad, PLACE_M)
        residual = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, delay, BANDS)
        reference = int(np.nanargmax(np.where(np.isfinite(residual[0, 0, :32]), epoch.elevation_rad[:32], np.nan)))
        rows.append(residual[..., 5] - residual[..., reference])
    found = explained(rows[-1])
    # Heights and curvature are 1e-3 of the gradient; three of the receivers are in one line.
    towards = vector_of(1.0, azimuth_deg)
    nearest = found.vector[np.argmin(np.minimum(
        np.hypot(*(found.vector - gradient * towards).T), np.hypot(*(found.vector + gradient * towards).T)
    ))]  # fmt: skip
    off = np.degrees(np.arccos(abs(nearest @ towards) / np.hypot(*nearest)))
    assert off < 0.5
    assert np.hypot(*nearest) == pytest.approx(gradient, rel=5e-3)
    rate = -float((rows[-1] - rows[0])[0, 0]) / ((len(rows) - 1) * base.interval_s)
    speed, _ = front_speed_mps(nearest, found.covariance, rate, 1e-3)
    assert abs(speed) == pytest.approx(speed_mps, rel=0.02)  # what the reference and the path do is some mm/s
