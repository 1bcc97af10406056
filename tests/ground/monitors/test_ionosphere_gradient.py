"""The gradient monitor: what it measures, what it detects and is blind to, whom it blames, and when it cannot look."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.channels.predicted_ranges import site_of
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import (
    NO_REFERENCE,
    Troposphere,
    baselines_of,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.false_alarm import false_alarm_multiplier
from gbas_ground.monitors.gradient_coverage import blind_gradients, coverage_at, gradient_site
from gbas_ground.monitors.gradient_detectability import (
    BaselineMonitor,
    blind_intervals,
    coverage_percent,
    double_difference_sigma_m,
)
from gbas_ground.monitors.gradient_estimates import gradient_set
from gbas_ground.monitors.ionosphere_gradient import (
    IonosphereGradientParams,
    by_baseline,
    check_ionosphere_gradient,
)
from gbas_ground.params import GroundParams
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.troposphere import Troposphere as SimulatedTroposphere
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.world import World, open_orbits
from gbas_sim.world_params import WorldParams
from loop_double_difference import dense, loop_double_differences
from monitor_scenes import BRAUNSCHWEIG_M, RUNWAY_RAD, recorded_pair, simulated, station_gradient, station_of

AIR = Troposphere(refractivity=330.0, scale_height_m=7900.0)
PARAMS = station_gradient()
SITE = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], PARAMS)
HERE = np.isin(np.arange(N_SATS), [0, 5, 7, 11, 15, 17, 20, 21, 32, 37, 38, 39, 45, 46, 48, 54])
ELEVATION = np.where(HERE, np.radians(40.0 + 0.7 * np.arange(N_SATS)), np.nan)


def differences_of(epoch, site, params, usable=None):
    """Double differences of what a station hands over."""
    delay = AIR.delay_m(epoch.elevation_rad, epoch.azimuth_rad, site.baselines.place_m)
    residual = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, delay, params.bands)
    high = epoch.elevation_rad >= np.radians(5.0)
    due = high & np.isfinite(residual[:, 0]).all(axis=0) & (True if usable is None else usable)
    references = reference_satellites(due, epoch.elevation_rad, params.references)
    return double_differences(
        residual, site.baselines, references, epoch.elevation_rad, params.noise, params.bands
    ), due


def made_up(rng, gradients, *, noise=1.0, receivers=4, params=PARAMS):
    """Residuals with clocks, ambiguities, noise of the model's sigma and gradients along the runway ``{sat: g}``."""
    place = (BRAUNSCHWEIG_M - BRAUNSCHWEIG_M[0])[:receivers]
    site = gradient_site(BRAUNSCHWEIG_M[:receivers], BRAUNSCHWEIG_M[0], params)
    along = np.concatenate([[0.0], site.length_m[0][: receivers - 1]])  # the first baselines start at receiver 1
    bands, shape = list(params.bands), (receivers, len(params.bands), N_SATS)
    value = rng.integers(-1000, 1000, shape) * WAVELENGTH_M[bands][:, np.newaxis] + rng.normal(
        0.0, 1e4, (len(place), 1, 1)
    )
    value += noise * params.noise.sigma_m(ELEVATION, params.bands) * rng.normal(size=shape)
    for satellite, gradient in gradients.items():
        value[..., satellite] -= gradient * along[:, np.newaxis] * IONO_RATIO[bands]
    return np.where(HERE, value, np.nan), site


def verdict(residual, site, *, params=PARAMS, may_refer=HERE, due=HERE):
    references = reference_satellites(may_refer, ELEVATION, params.references)
    made = double_differences(residual, site.baselines, references, ELEVATION, params.noise, params.bands)
    return made, check_ionosphere_gradient(made, due, site, params)


def test_as_written_out_in_loops():
    rng = np.random.default_rng(1)
    params = IonosphereGradientParams(
        runway_bearing_rad=(0.0,), noise=CarrierNoise(receiver_factor=(1.0, 0.5, 2.0, 1.2))
    )
    residual, site = made_up(rng, {}, noise=20.0, params=params)
    residual[rng.random(residual.shape) < 0.3] = np.nan
    references = reference_satellites(HERE, ELEVATION, 5)
    made = double_differences(residual, site.baselines, references, ELEVATION, params.noise, params.bands)
    pairs = list(zip(site.baselines.first.tolist(), site.baselines.second.tolist(), strict=True))
    assert pairs == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    highest = [satellite for group in (references[0], references[40]) for satellite in group.tolist()]
    sigma = params.noise.sigma_m(ELEVATION, params.bands)
    expected = dense(
        loop_double_differences(residual, pairs, highest, sigma, params.bands, params.noise.receiver_factor),
        made.residual_m.shape,
    )
    # Clocks of 1e4 m are differenced in another order: 1e4 eps, some times.
    np.testing.assert_allclose(made.residual_m, expected[0], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(made.sigma_m, expected[1], rtol=1e-12)
    assert ((made.reference == NO_REFERENCE) == np.isnan(made.residual_m)).all()
    # A gradient larger than all noise, less than half a wavelength everywhere: the middle one is the nominal one.
    residual, site = made_up(rng, {20: 60e-6}, noise=1e-6, params=params)
    made = double_differences(residual, site.baselines, references, ELEVATION, params.noise, params.bands)
    np.testing.assert_allclose(made.sigma_m[..., 20], made.nominal_sigma_m[..., 20], rtol=1e-12)


def test_paper_baselines_and_signs():
    """Table 1 of the paper; lengths to its printed digits, projections with the runway outside the wedge."""
    baselines = baselines_of(BRAUNSCHWEIG_M[:3], BRAUNSCHWEIG_M[0], "star")
    assert np.linalg.norm(baselines.vector_m, axis=1) == pytest.approx([775.494, 740.748], abs=5e-4)
    star = gradient_site(
        BRAUNSCHWEIG_M[:3],
        BRAUNSCHWEIG_M[0],
        IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), pairing="star"),
    )
    # Receiver 2 lies against the bearing. 1.99 and 62.67 degrees are those of the recomputation, to 0.005 degrees.
    angle = np.degrees(np.arccos(np.abs(star.length_m[0]) / np.linalg.norm(baselines.vector_m, axis=1)))
    assert angle == pytest.approx([1.99, 62.67], abs=0.02)
    assert star.length_m[0][0] < 0.0


@pytest.mark.parametrize(
    ("name", "carriers", "length_m"), [("upc1_upc2", ("L1", "L2"), 37.946), ("mosaic_base_rover", ("L1", "L5"), 0.991)]
)
def test_quiet_pairs_are_centred(data_dir, name, carriers, length_m):
    """Two receivers on known antennas: no gradient, so the statistic is noise and multipath that sigma bounds."""
    station, epochs = recorded_pair(name, data_dir, 900)
    params = IonosphereGradientParams(runway_bearing_rad=(0.3,), carriers=carriers)
    where = site_of(station).positions_m
    site = gradient_site(where[:2], where[2], params)
    assert np.linalg.norm(site.baselines.vector_m) == pytest.approx(length_m, abs=0.02)  # as the surveys agree
    statistic, sigma, elevation = [], [], []
    for epoch in epochs:
        made, due = differences_of(epoch, site, params)
        result = check_ionosphere_gradient(made, due, site, params)
        assert not result.verdict.failed.any()
        statistic.append(np.where(due, made.residual_m[0], np.nan))
        sigma.append(made.sigma_m[0])
        elevation.append(epoch.elevation_rad)
    value, spread, degrees = np.array(statistic), np.array(sigma), np.degrees(np.array(elevation))
    for band in range(2):
        for low, high in ((5, 15), (15, 30), (30, 90)):
            inside = np.isfinite(value[:, band]) & (degrees >= low) & (degrees < high)
            if not inside.any():
                continue
            # Multipath of few satellites does not average out in minutes: the mean is within one sigma, not zero.
            normalised = (value[:, band] / spread[:, band])[inside]
            assert abs(normalised.mean()) < 1.0
            assert normalised.std() < 1.0
            # Half the sigma would not bound it; it is not idle either.
            assert normalised.std() > 0.2
            assert np.abs(normalised).max() < 4.0


@pytest.fixture(scope="module")
def orbits():
    base = {
        "receiver_ecef_m": tuple(map(tuple, BRAUNSCHWEIG_M.tolist())),
        "flight": None,
        "duration_s": 10.0,
        "troposphere": SimulatedTroposphere(
            refractivity=AIR.refractivity, scale_height_m=AIR.scale_height_m,
            reference_height_m=float(geodetic_from_ecef(BRAUNSCHWEIG_M[0])[2]),
        ),
    }  # fmt: skip
    return base, open_orbits(WorldParams(**base))


def front_epoch(orbits, gradient, satellite, preset, *, seed=1, receivers=4):
    """One epoch with the middle of a front over the station on one satellite."""
    base, truth = orbits
    front = WedgeFront(
        gradient=gradient, width_m=25_000.0, direction_rad=float(RUNWAY_RAD), reference="baseline", start_m=-12_500.0,
        satellites=(satellite,),
    )  # fmt: skip
    base = base | {"receiver_ecef_m": base["receiver_ecef_m"][:receivers]}
    world = World(WorldParams(**base, ground=receiver_preset(preset), fronts=(front,), seed=seed), orbits=truth)
    return simulated([world.epoch(0)], world.ephemeris, station_of(BRAUNSCHWEIG_M[:receivers], "GE"))[0]


def test_troposphere_of_a_site_is_no_gradient(orbits):
    """Receivers 770 m apart see low satellites through different air: 14 mm at 8 degrees, unless it is taken off."""
    epoch = front_epoch(orbits, 1e-9, "G06", "ideal")
    made, due = differences_of(epoch, SITE, PARAMS)
    residual = made.residual_m[:, 0, due]
    # What is left: the simulated air's own mapping of curvature, and orbits good to micrometres.
    assert np.abs(residual).max() < 0.3e-3
    none = Troposphere(refractivity=0.0, scale_height_m=7900.0)
    raw = none.delay_m(epoch.elevation_rad, epoch.azimuth_rad, SITE.baselines.place_m)
    plain = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, raw, PARAMS.bands)
    references = reference_satellites(due, epoch.elevation_rad, 5)
    left = double_differences(plain, SITE.baselines, references, epoch.elevation_rad, PARAMS.noise, PARAMS.bands)
    assert 5e-3 < np.abs(left.residual_m[:, 0, due]).max() < 30e-3


def is_in(gradient, intervals):
    return bool(((gradient >= intervals[:, 0]) & (gradient <= intervals[:, 1])).any())


@pytest.mark.parametrize("receivers", [4, 3, 2])
def test_fronts_over_the_site_match_the_analytic_blind_gradients(orbits, receivers):
    """300 to 2000 mm/km on a satellite, without noise: detected exactly where the tents of the baselines say so.

    With one reference satellite, so that all statistics have one sigma.
    """
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), carriers=("L1",), references=1)
    site = gradient_site(BRAUNSCHWEIG_M[:receivers], BRAUNSCHWEIG_M[0], params)
    satellite = SAT_INDEX["G06"]
    gradients = np.arange(305e-6, 2000e-6, 10e-6)
    found = np.zeros(gradients.size, dtype=bool)
    for number, gradient in enumerate(gradients):
        epoch = front_epoch(orbits, gradient, "G06", "ideal", receivers=receivers)
        made, due = differences_of(epoch, site, params)
        result = check_ionosphere_gradient(made, due, site, params)
        found[number] = result.verdict.failed[satellite]
        alarms = np.flatnonzero(result.verdict.failed & result.monitored)
        assert alarms.tolist() == ([satellite] if found[number] else [])
    sigma = made.sigma_m[:, 0, satellite]
    assert np.ptp(sigma) < 1e-12
    monitors = [BaselineMonitor(length_m=abs(float(each)), sigma_m=float(sigma[0])) for each in site.length_m[0]]
    blind = blind_intervals(monitors, site.k_ffd)
    # The simulated front is measured in the plane of the first receiver, heights and curvature included: 1e-4 of it.
    near = np.abs(gradients[:, np.newaxis] - blind.ravel()).min(axis=1, initial=np.inf) < 1e-4 * gradients
    expected = np.array([not is_in(each, blind) for each in gradients])
    np.testing.assert_array_equal(found[~near], expected[~near])
    assert near.mean() < 0.05
    # Each end of a blind interval is known to half a step of the sweep.
    steps = 2 * len(blind) * 0.5 / gradients.size
    assert found.mean() == pytest.approx(coverage_percent(monitors, site.k_ffd) / 100.0, abs=steps)


def test_detectable_fronts_are_detected_in_noise(orbits):
    """Designator C receivers; what the blind gradients of the very epoch leave out must be found, nine times in ten
    thousand excepted (P_md 1e-4), so every time here."""
    satellite = SAT_INDEX["G06"]
    tried = 0
    for number, gradient in enumerate(np.arange(305e-6, 2000e-6, 40e-6)):
        epoch = front_epoch(orbits, gradient, "G06", "gad_c", seed=number + 1)
        made, due = differences_of(epoch, SITE, PARAMS)
        result = check_ionosphere_gradient(made, due, SITE, PARAMS)
        assert due[satellite]
        if not is_in(gradient, blind_gradients(made, satellite, SITE, PARAMS)):
            tried += 1
            assert result.verdict.failed[satellite]
            # the truth is one of the gradients that explain the epoch: P_lost 1e-4
            explained = gradient_set(
                made.residual_m[..., satellite], made.sigma_m[..., satellite], SITE.length_m[0], PARAMS.bands
            )
            assert np.abs(explained - gradient).min() < 20e-6
    assert tried > 20


def test_false_alarms_and_missed_detections_by_simulation():
    """Thresholds for rates a short simulation can count; 200 epochs of 16 satellites."""
    rng = np.random.default_rng(3)
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), p_false_alarm=0.3, p_missed_detection=0.05)
    false, epochs = 0, 200
    site = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], params)
    for _ in range(epochs):
        residual, _ = made_up(rng, {}, params=params)
        false += int(verdict(residual, site, params=params)[1].verdict.failed.sum())
    # The budget is per 15 s, 30 epochs; sharing it among correlated tests and the middle reference only lower the rate.
    tests = epochs * HERE.sum()
    assert false / tests <= 0.3 / 30
    assert false > 0  # the bound is not idle

    # At the edge of the detectable gradients the longest baseline misses one in twenty; others can only help.
    edge = site.k_ffd + site.k_md
    satellite, missed = 20, 0
    lengths = np.abs(site.length_m[0])
    longest = int(lengths.argmax())
    for _ in range(epochs):
        residual, _ = made_up(rng, {satellite: 0.0}, params=params)
        sigma = verdict(residual, site, params=params)[0].nominal_sigma_m[longest, 0, satellite]
        gradient = edge * sigma / lengths[longest]
        residual, _ = made_up(rng, {satellite: gradient}, params=params)
        missed += not verdict(residual, site, params=params)[1].verdict.failed[satellite]
    # 0.05 with 200 trials: 10 +- 3; three sigma above.
    assert missed <= 20


@pytest.mark.parametrize("bad", [1, 2])
def test_a_gradient_on_reference_satellites_is_not_blamed_on_others(bad):
    """The highest GPS satellites are references of all others."""
    rng = np.random.default_rng(4)
    highest = reference_satellites(HERE, ELEVATION, 5)[0][:bad]
    residual, site = made_up(rng, {int(each): 400e-6 for each in highest})
    _, result = verdict(residual, site)
    assert sorted(np.flatnonzero(result.verdict.failed)) == sorted(highest)
    # Sigma of the fit is 4 mm over 1 km or so of baselines; another gradient that explains all would be far off.
    assert result.gradient[highest] == pytest.approx([400e-6] * bad, abs=20e-6)
    assert np.isnan(np.delete(result.gradient, highest)).all()


def test_change_of_references_does_not_alarm():
    rng = np.random.default_rng(5)
    for _ in range(50):
        residual, site = made_up(rng, {})
        may_refer = HERE & (rng.random(N_SATS) < 0.7)
        _, result = verdict(residual, site, may_refer=may_refer)
        alarm = result.verdict.failed & result.monitored
        assert not alarm.any()


def test_missing_is_not_good():
    rng = np.random.default_rng(6)
    residual, site = made_up(rng, {})
    residual[..., 5] = np.nan  # not measured at all
    residual[1:, :, 7] = np.nan  # one receiver only
    residual[:, 1, 11] = np.nan  # L1 only: monitored all the same
    _, result = verdict(residual, site)
    assert np.flatnonzero(HERE & ~result.monitored).tolist() == [5, 7]
    assert result.monitored[11]
    assert not result.verdict.failed.any()
    _, result = verdict(np.full_like(residual, np.nan), site)
    assert not result.monitored.any()
    assert (result.coverage == 0.0).all()
    # A constellation with one satellite has nothing to compare it with.
    alone = HERE & ((np.arange(N_SATS) < 32) | (np.arange(N_SATS) == 37))
    _, result = verdict(np.where(alone, made_up(rng, {})[0], np.nan), site, due=alone)
    assert np.flatnonzero(alone & ~result.monitored).tolist() == [37]


def test_two_receivers_and_one():
    rng = np.random.default_rng(7)
    residual, site = made_up(rng, {20: 500e-6}, receivers=2)
    _, result = verdict(residual, site, may_refer=HERE)
    assert len(site.baselines) == 1
    assert np.flatnonzero(result.verdict.failed).tolist() == [20]
    residual, site = made_up(rng, {}, receivers=1)
    _, result = verdict(residual, site)
    assert not result.monitored.any()


def test_a_threshold_beyond_half_a_wavelength_does_not_count_as_monitoring():
    """Noise so large that the statistic cannot reach its threshold."""
    rng = np.random.default_rng(8)
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), noise=CarrierNoise(floor_m=(0.02,) * 3))
    residual, site = made_up(rng, {}, params=params)
    _, result = verdict(residual, site, params=params)
    assert not result.monitored.any()


def test_baselines_that_see_no_gradient_of_the_range_do_not_count():
    """Two antennas a metre apart: 2000 mm/km make 2 mm."""
    rng = np.random.default_rng(9)
    near = np.stack([BRAUNSCHWEIG_M[0], BRAUNSCHWEIG_M[0] + [0.0, 1.0, 0.0]])
    site = gradient_site(near, near[0], PARAMS)
    residual, _ = made_up(rng, {}, receivers=2)
    _, result = verdict(residual, site)
    assert not result.monitored.any()


@pytest.mark.parametrize("fuse", ["any", "all"])
def test_coverage_is_that_of_the_siting_functions_and_never_more(fuse):
    rng = np.random.default_rng(10)
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), carriers=("L1",), fuse=fuse)
    residual, _ = made_up(rng, {}, params=params)
    site = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], params)
    made, result = verdict(residual, site, params=params)

    def exact(sigma_m):
        monitors = [BaselineMonitor(length_m=abs(float(each)), sigma_m=sigma_m) for each in site.length_m[0]]
        return coverage_percent(monitors, site.k_ffd + site.k_md, fuse=fuse) / 100.0

    for satellite in np.flatnonzero(HERE):
        largest = float(made.nominal_sigma_m[:, 0, satellite].max())
        # sigmas are rounded up by at most 5 %
        assert exact(1.05 * largest) - 1e-12 <= result.coverage[satellite] <= exact(largest) + 1e-12


def test_second_band_and_all_fusion():
    """Bands together are blind only where each is; "all" detects no more than "any"."""
    rng = np.random.default_rng(11)
    residual, site = made_up(rng, {20: 700e-6})
    both = verdict(residual, site)[1]
    single = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), carriers=("L1",))
    one = verdict(residual[:, :1], gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], single), params=single)[1]
    assert (both.coverage[HERE] >= one.coverage[HERE]).all()
    assert (both.coverage[HERE] > one.coverage[HERE]).any()
    every = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), fuse="all")
    its_site = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], every)
    made, strict = verdict(residual, its_site, params=every)
    assert (strict.coverage <= both.coverage).all()
    assert both.verdict.failed[20]
    each = by_baseline(strict, made, its_site, every)
    ratio = (each.statistic / each.threshold)[..., HERE]
    decided = (strict.verdict.statistic / strict.verdict.threshold)[HERE]
    np.testing.assert_allclose(decided, np.nanmax(ratio.min(axis=0), axis=0), rtol=1e-12)  # NaN: a band not tested


def test_noise_ratio_of_a_station_file():
    """The paper's eq (1), sqrt(2 (1 + r^2)) sigma_i, from the file's factors; what is detected follows them."""
    sections = {
        "station": {"id": "EDVE", "latitude_deg": 52.32, "longitude_deg": 10.55, "height_m": 130.0},
        "receivers": {f"rr{number + 1}_ecef_m": place.tolist() for number, place in enumerate(BRAUNSCHWEIG_M)},
        "ionosphere_gradient": {"runway_bearing_deg": [84.73]},
    }
    high = np.full(N_SATS, np.radians(60.0))
    coverage = {}
    for factors in ((1.0,), (2.0, 0.5, 1.0, 4.0), (4.0,)):
        station = GroundParams.from_mapping(sections | {"carrier_noise": {"receiver_factor": list(factors)}})
        noise, params = station.carrier_noise, station.gradient_monitor()
        site = gradient_site(station.receiver_positions_m(), station.reference_point_m(), params)
        coverage[factors] = float(coverage_at(high[:1], high[:1], site, params)[0])
        made = double_differences(
            np.zeros((4, 2, N_SATS)), site.baselines, reference_satellites(HERE, high, 1), high, noise, params.bands
        )
        each = noise.factors(4)
        for row, (i, j) in enumerate(zip(site.baselines.first, site.baselines.second, strict=True)):
            sigma_i = each[i] * float(noise.sigma_m(high, (L1,))[0, 0])
            expected = double_difference_sigma_m(sigma_i, each[j] / each[i])
            assert made.sigma_m[row, 0, 20] == pytest.approx(float(expected), rel=1e-12)
        acceleration = station.carrier_acceleration_monitor()
        np.testing.assert_array_equal(acceleration.noise.factors(4), each)
    assert coverage[(1.0,)] > coverage[(2.0, 0.5, 1.0, 4.0)] > coverage[(4.0,)]


@given(
    receivers=st.lists(st.tuples(st.floats(-800.0, 800.0), st.floats(-800.0, 800.0)), min_size=2, max_size=4),
    bearing_deg=st.floats(0.0, 180.0),
    elevation_deg=st.lists(st.floats(5.0, 90.0), min_size=1, max_size=8),
    reference_deg=st.floats(40.0, 90.0),
    factor=st.sampled_from([(1.0,), (0.5, 2.0, 1.0, 1.3)]),
    fuse=st.sampled_from(["any", "all"]),
)
def test_a_second_band_never_lowers_coverage(receivers, bearing_deg, elevation_deg, reference_deg, factor, fuse):
    """Over sites, elevations and receivers: L1 with L5 detects at least what either detects alone."""
    latitude, longitude, _ = geodetic_from_ecef(BRAUNSCHWEIG_M[0])
    places = np.column_stack([np.array(receivers), np.zeros(len(receivers))])
    where = BRAUNSCHWEIG_M[0] + places @ rot_enu_ecef(latitude, longitude)
    noise = CarrierNoise(receiver_factor=factor[: len(receivers)] if len(factor) > 1 else factor)
    elevation, found = np.radians(elevation_deg), {}
    for carriers in (("L1",), ("L5",), ("L1", "L5"), ("L5", "L1")):
        params = IonosphereGradientParams(
            runway_bearing_rad=(np.radians(bearing_deg), 0.3), carriers=carriers, noise=noise, fuse=fuse
        )
        site = gradient_site(where, BRAUNSCHWEIG_M[0], params)
        found[carriers] = coverage_at(elevation, np.radians(reference_deg), site, params)
    assert (found["L1", "L5"] >= np.maximum(found[("L1",)], found[("L5",)])).all()
    np.testing.assert_array_equal(found["L1", "L5"], found["L5", "L1"])


def test_bands_under_one_budget_would_lower_it():
    """Why bands are chosen: tested always together, L5 costs a station of two receivers gradients at 17 degrees."""
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,))
    site = gradient_site(BRAUNSCHWEIG_M[:2], BRAUNSCHWEIG_M[0], params)
    elevation = np.radians(np.arange(5.0, 40.0, 0.5))
    sigma = np.hypot(params.noise.sigma_m(elevation, (L1, L5)), params.noise.sigma_m(np.full(70, 1.2), (L1, L5)))
    sigma *= np.sqrt(2.0)
    length = abs(float(site.length_m[0, 0]))

    def covered(row, bands, test):
        monitors = [BaselineMonitor(length_m=length, sigma_m=s, band=b) for s, b in zip(row, bands, strict=True)]
        return coverage_percent(monitors, site.tests[test].k_ffd + site.k_md)

    together = np.array([covered(row, (L1, L5), 0) for row in sigma.T])
    alone = np.array([covered(row[:1], (L1,), 1) for row in sigma.T])
    assert (together < alone - 0.1).any()
    chosen = 100.0 * coverage_at(elevation, 1.2, site, params)
    single = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), carriers=("L1",))
    l1_only = 100.0 * coverage_at(elevation, 1.2, gradient_site(BRAUNSCHWEIG_M[:2], BRAUNSCHWEIG_M[0], single), single)
    assert (chosen >= l1_only).all()


def test_tests_that_are_run_are_those_that_coverage_is_of():
    """Thresholds, bands and coverage belong together: a band that is not chosen is not looked at, and k is the one of
    as many tests as are run."""
    rng = np.random.default_rng(12)
    residual, site = made_up(rng, {}, receivers=2)
    low = np.where(HERE, np.radians(12.0 + 1.2 * np.arange(N_SATS)), np.nan)
    references = reference_satellites(HERE, low, PARAMS.references)
    made = double_differences(residual, site.baselines, references, low, PARAMS.noise, PARAMS.bands)
    result = check_ionosphere_gradient(made, HERE, site, PARAMS)
    each = by_baseline(result, made, site, PARAMS)
    looked = np.isfinite(each.statistic).any(axis=0)
    tested = site.masks[result.chosen].T
    assert not (looked & ~tested).any()
    number = tested.sum(axis=0)
    assert set(number[HERE].tolist()) == {1, 2}  # both happen
    for satellite in np.flatnonzero(looked.any(axis=0)):
        k = false_alarm_multiplier(PARAMS.p_false_alarm, tests=int(number[satellite]))
        limit = k * made.sigma_m[0, :, satellite]
        np.testing.assert_allclose(each.threshold[0, :, satellite], limit, rtol=1e-12)
        own = IonosphereGradientParams(
            runway_bearing_rad=(RUNWAY_RAD,),
            carriers=tuple(np.array(PARAMS.carriers)[tested[:, satellite]].tolist()),
        )
        monitors = [
            BaselineMonitor(length_m=abs(float(site.length_m[0, 0])), sigma_m=float(sigma), band=band)
            for sigma, band in zip(made.nominal_sigma_m[0, tested[:, satellite], satellite], own.bands, strict=True)
            if k * sigma < 0.5 * WAVELENGTH_M[band]
        ]
        exact = coverage_percent(monitors, k + site.k_md) / 100.0
        assert result.coverage[satellite] <= exact + 1e-12  # sigmas are rounded up by at most 5 %
        assert result.coverage[satellite] > exact - 0.1


def test_gradient_set_of_one_baseline_is_every_multiple():
    length, gradient = 775.494, 900e-6
    wavelength = float(WAVELENGTH_M[L1])
    delay = gradient * length
    residual = np.array([[-(delay - wavelength * np.rint(delay / wavelength))]])
    found = gradient_set(residual, np.array([[1e-3]]), np.array([length]), (L1,))
    assert np.abs(found - gradient).min() < 1e-12
    assert np.diff(np.sort(found)) == pytest.approx(wavelength / length)
    assert np.abs(found).max() <= 2000e-6
    assert abs(found.size - 4000e-6 / (wavelength / length)) <= 1.0  # nothing left out


def test_multiplier_is_the_budget():
    """One test, one epoch, two sides: 1e-4 is 3.8906 (the paper's k_ffd)."""
    assert false_alarm_multiplier(1e-4, interval_s=15.0) == pytest.approx(3.8906, abs=5e-5)
    with pytest.raises(ValueError, match="probability"):
        false_alarm_multiplier(0.0)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"runway_bearing_rad": (7.0,)}, "runway_bearing_deg"),
        ({"carriers": ()}, "carriers"),
        ({"fuse": "some"}, "fuse"),
        ({"references": 0}, "references"),
        ({"p_false_alarm": 0.0}, "p_false_alarm"),
        ({"min_coverage": 1.1}, "min_coverage"),
        ({"gradient_range": (2e-3, 3e-4)}, "gradient range"),
    ],
)
def test_bad_parameters(changes, word):
    with pytest.raises(ValueError, match=word):
        IonosphereGradientParams(**({"runway_bearing_rad": (0.0,)} | changes))
