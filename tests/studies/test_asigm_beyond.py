"""Beyond the paper: projected baselines over all directions, coverage of a day's satellites, and recorded pairs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from gbas_bringup.resources import config_path
from gbas_core.signals import L1, L5, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE, BaselineMonitor, coverage_percent
from gbas_ground.params import GroundParams
from gbas_sim.scenario import read_sections, scenario_from_yaml
from gbas_studies.asigm import coverage, projection, testbed
from gbas_studies.asigm.noise import Star, silent_probability
from gbas_studies.asigm.recorded import SETS, pair_series, recorded_section, spreads
from gbas_studies.reproduction.items import Verdict
from gbas_studies.reproduction.registry import Options

BED = testbed.braunschweig()
PSI_RAD = BED.angle_rad(1, 3)

# --- projection


@pytest.mark.parametrize("size", [100e-6, 140e-6, 250e-6, 299e-6, 350e-6, 425e-6, 1000e-6, 2000e-6])
def test_shares_of_directions_against_a_dense_circle(size):
    """Closed form, against counting a hundred thousand directions; each end of a set is known to one of them."""
    angle = (np.arange(100_000) + 0.5) / 100_000 * 2.0 * np.pi
    real = np.abs(size * np.cos(angle)) >= 300e-6
    projected = np.abs(size * np.cos(angle - PSI_RAD) / np.cos(PSI_RAD)) >= 300e-6
    found = projection.shares(size, PSI_RAD)
    expected = (real.mean(), (real & ~projected).mean(), (projected & ~real).mean())
    np.testing.assert_allclose(found, expected, atol=8e-5)
    if size < 300e-6:
        assert found[2] == pytest.approx(projection.false_alarm_share(size, PSI_RAD), abs=1e-12)


def test_a_baseline_along_the_runway_neither_misses_nor_alarms():
    for size in (250e-6, 500e-6, 1500e-6):
        _, missed, false = projection.shares(size, 0.0)
        assert missed == 0.0
        assert false == 0.0
    # 300 cos(62.66) = 137.8 mm/km: less than that is never projected to 300
    assert projection.false_alarm_share(137e-6, PSI_RAD) == 0.0
    assert projection.false_alarm_share(139e-6, PSI_RAD) > 0.0


def test_coverage_along_the_runway_is_that_of_the_projected_lengths():
    vector_m = BED.enu_m[1:]
    (along,) = projection.coverage_by_direction(vector_m, np.array([BED.bearing_rad]), 0.002)
    monitors = [BaselineMonitor(length_m=BED.along_m(1, other), sigma_m=0.002) for other in (2, 3)]
    assert along == pytest.approx(coverage_percent(monitors, projection.K), abs=1e-9)
    # The other way round it is the same gradient with another sign.
    (back,) = projection.coverage_by_direction(vector_m, np.array([BED.bearing_rad + np.pi]), 0.002)
    assert back == pytest.approx(along, abs=1e-9)


def test_the_papers_fourth_receiver():
    """77 m from RR1, on the line to RR2, and where a shipped configuration has it; the demo has it off that line."""
    towards = testbed.RECEIVERS_ECEF_M[1] - testbed.RECEIVERS_ECEF_M[0]
    place = testbed.FOURTH_ECEF_M - testbed.RECEIVERS_ECEF_M[0]
    assert np.linalg.norm(place) == pytest.approx(77.0, abs=1e-3)  # positions are rounded to millimetres
    assert np.linalg.norm(np.cross(place, towards)) / np.linalg.norm(towards) < 1e-3
    paper, demo = (
        GroundParams.from_mapping(read_sections(config_path(name))["ground"]).receiver_positions_m()
        for name in ("scenarios/paper_site.yaml", "braunschweig.yaml")
    )
    for positions_m in (paper, demo):
        np.testing.assert_array_equal(positions_m[:3], testbed.RECEIVERS_ECEF_M)
    np.testing.assert_array_equal(paper[3], testbed.FOURTH_ECEF_M)
    off_line_m = np.linalg.norm(np.cross(demo[3] - demo[0], towards)) / np.linalg.norm(towards)
    assert off_line_m > 200.0  # no three in a line: a wrong receiver is no gradient


def test_projection_section():
    section = projection.projection_section(BED, quick=True, seed=1)
    claims = {item.name: item for item in section.items}
    assert claims["Projecting RR1-RR3 makes many false alarms"].verdict is Verdict.REPRODUCED
    (agrees,) = (item for name, item in claims.items() if name.endswith("Monte Carlo agrees"))
    assert agrees.holds
    # What is stated of the direction is what the errors are: 200 of them are good to 5 %, three of that.
    for name, item in claims.items():
        if name.startswith("Direction"):
            stated = float(item.definition.split("stated ")[1].split()[0])
            assert item.ours == pytest.approx(stated, rel=0.15)


# --- coverage


@pytest.fixture(scope="module")
def day():
    path = config_path("braunschweig.yaml")
    station = GroundParams.from_mapping(read_sections(path)["ground"], source=str(path))
    return station, coverage.elevations_of_a_day(station, scenario_from_yaml(path), 3600.0)


def test_a_day_of_satellites(day):
    station, elevation = day
    assert elevation.shape[0] == 24
    seen = np.isfinite(elevation).sum(axis=1)
    # GPS and Galileo, 24 each, at 52 degrees and above 5: about a third, 14 to 20 of 48.
    assert seen.min() >= 10
    assert seen.max() <= 24
    assert np.nanmin(elevation) >= station.monitors.elevation_mask_rad


@pytest.mark.parametrize("bands", [(L1,), (L1, L5)])
@pytest.mark.parametrize("receivers", [4, 2])
def test_stated_coverage_holds_in_noise(day, receivers, bands):
    """With P_md of 0.05, large enough to be counted: covered gradients are missed no more often, and what is detected
    of all is no less than what is covered."""
    station, elevation = day
    site, params = coverage.site_with(station, receivers, bands)
    params = coverage.replace(params, p_missed_detection=0.05, p_false_alarm=1e-3)
    site = coverage.gradient_site(station.receiver_positions_m()[:receivers], station.reference_point_m(), params)
    seen = coverage.Day(elevation_rad=elevation, stations={"here": (site, params)}, repetitions=4)
    rows = coverage.study(seen, seed=1)["here"]
    covered, missed = sum(row.covered for row in rows), sum(row.missed for row in rows)
    assert covered > 200
    assert missed <= 0.05 * covered + 4.0 * np.sqrt(0.05 * covered)
    for row in rows:
        if row.trials >= 50:
            # Coverage is a share of the gradients, detection a count of random ones: four standard deviations.
            assert row.detected_percent >= 0.95 * row.coverage_percent - 400.0 * 0.5 / np.sqrt(row.trials)
    # Far fewer tests than the budget of 1e-3 in 15 s would need for one false alarm.
    assert sum(row.false_alarms for row in rows) <= 1


def test_one_baseline_and_one_reference_against_the_integral(day):
    """The Monte Carlo run of two receivers, against the probability of a Gaussian to be beyond the threshold."""
    station, _ = day
    site, params = coverage.site_with(station, 2, (L1,))
    params = coverage.replace(params, references=1, p_missed_detection=0.01)
    site = coverage.gradient_site(station.receiver_positions_m()[:2], station.reference_point_m(), params)
    elevation = np.full((1, coverage.N_SATS), np.nan)
    elevation[0, :8] = np.radians([80.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0])
    seen = coverage.Day(elevation_rad=elevation, stations={"here": (site, params)}, repetitions=700)
    (row,) = coverage.study(seen, seed=3, bins_deg=(29.0, 31.0))["here"]
    sigma = float(np.sqrt(2.0) * np.hypot(*params.noise.sigma_m(np.radians([30.0, 80.0]), (L1,))[0]))
    length_m = abs(float(site.length_m[0, 0]))
    star = Star(lengths_m=(length_m,), sigma_m=sigma, p_false_alarm=float(2.0 * norm.sf(site.k_ffd)))
    gradients = np.linspace(*GRADIENT_RANGE, 8001)
    expected = 100.0 * (1.0 - float(silent_probability(star, gradients).mean()))
    deviation = 100.0 * 0.5 / np.sqrt(row.trials)
    assert row.detected_percent == pytest.approx(expected, abs=4.0 * deviation)
    assert row.trials == 700 * 7


def test_the_papers_multiplier(day):
    site, _ = coverage.site_with(day[0], 4, (L1, L5))
    # 3.8906: two-sided 1e-4; the paper's k is the sum with 3.7190.
    assert [each.k_ffd for each in coverage.papers_multiplier(site).tests] == pytest.approx([3.8906] * 3, abs=5e-5)
    assert site.k_md == pytest.approx(3.7190, abs=5e-5)


# --- recorded pairs


def test_recorded_pairs_keep_their_model(data_dir):
    for chosen, length_m in zip(SETS, (37.946, 0.991), strict=True):
        seen = pair_series(chosen, data_dir, 300)
        assert seen.length_m == pytest.approx(length_m, abs=0.02)  # as the surveys agree
        assert not seen.failed.any()
        assert float(np.nanmax(seen.statistic / seen.threshold)) < 1.0
        found = spreads(seen)
        assert len(found) >= 6
        assert all(0.1 < each.normalised <= 1.0 for each in found)
        # Nothing is beyond half a wavelength: it is the distance to the nearest multiple.
        for place, band in enumerate(seen.bands):
            assert np.nanmax(np.abs(seen.residual_m[:, place])) <= 0.5 * WAVELENGTH_M[band]


def test_recorded_section_says_what_is_missing(tmp_path):
    for options in (Options(), Options(data=tmp_path)):
        (item,) = recorded_section(options).items
        assert item.verdict is Verdict.LEFT_OUT
        assert item.why
