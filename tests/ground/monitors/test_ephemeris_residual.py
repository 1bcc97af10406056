"""Ephemeris residual: displaced orbits against exact ranges, P against brute force, following, and data missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_core.gnss.frames import azimuth_elevation, ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5, WAVELENGTH_M
from gbas_ground.channels.predicted_ranges import site_of
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import (
    DoubleDifferences,
    Troposphere,
    baselines_of,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.ephemeris_residual import (
    EphemerisResidualParams,
    Orbits,
    decorrelation,
    ephemeris_residual_step,
    initial_ephemeris_residual,
    site_decorrelation,
)
from loop_decorrelation import scanned_decorrelation
from monitor_scenes import BRAUNSCHWEIG_M, STATION, recorded_pair
from synthetic_ranges import LATITUDE_RAD, LONGITUDE_RAD, TOW_S, WEEK, constellation

PARAMS = STATION.ephemeris_monitor()
NOISE = CarrierNoise()
SITE = baselines_of(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0])
HERE = np.arange(N_SATS) < 9
SHAPE = (len(SITE), 2, N_SATS)


def given(residual_m, sigma_m=0.005):
    """Double differences with a sigma, wrapped as they come."""
    wavelength = WAVELENGTH_M[[L1, L5]][:, np.newaxis]
    wrapped = residual_m - wavelength * np.rint(residual_m / wavelength)
    value = np.where(HERE, wrapped, np.nan)
    sigma = np.where(np.isnan(value), np.nan, sigma_m)
    return DoubleDifferences(
        residual_m=value, sigma_m=sigma, nominal_sigma_m=sigma, reference=np.zeros(SHAPE, dtype=np.int64)
    )


def run(series, *, params=PARAMS, dt_s=0.5, shift=None, site=SITE):
    state, results = initial_ephemeris_residual(len(site), params), []
    for number, each in enumerate(series):
        seen = Orbits(each, HERE, None if shift is None else shift[number])
        state, result = ephemeris_residual_step(state, seen, site, np.nan if number == 0 else dt_s, params)
        results.append(result)
    return state, results


def sky():
    """Satellites up at Braunschweig: places, unit vectors and ranges of the reference receiver."""
    ephemeris = constellation()
    state = predicted_state(ephemeris, WEEK, TOW_S, BRAUNSCHWEIG_M[0])
    range_m, los = rotated_range(BRAUNSCHWEIG_M[0], state.position_m)
    latitude, longitude, _ = geodetic_from_ecef(BRAUNSCHWEIG_M[0])
    rot = rot_enu_ecef(latitude, longitude)
    azimuth, elevation = azimuth_elevation(rot @ los)
    return state.position_m, range_m, rot, rot @ los, azimuth, elevation


def displaced_ranges(positions_m, satellites_m, moved_m):
    """Range with the orbit as it is less that with the orbit as broadcast, (places, N)."""
    truth = rotated_range(positions_m, satellites_m + moved_m)[0]
    return truth - rotated_range(positions_m, satellites_m)[0]


def test_an_undetected_orbit_error_hurts_no_more_than_p_says():
    """Exact ranges: orbit errors at the edge of detection in many directions, users at 5 km all around.

    The check knows nothing of polygons: it computes double differences and user errors from positions.
    """
    rng = np.random.default_rng(1)
    satellites_m, range_m, rot, los_enu, _, elevation = sky()
    up = elevation > np.radians(6.0)
    threshold = np.full((len(SITE), N_SATS), 0.05)
    p = decorrelation(SITE.vector_m, threshold, los_enu)
    worst = np.zeros(N_SATS)
    angle = np.linspace(0.0, 2.0 * np.pi, 37)
    users_m = BRAUNSCHWEIG_M[0] + 5000.0 * np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=1) @ rot
    for _ in range(150):
        across = rng.normal(size=(3, N_SATS))
        across -= (across * (rot.T @ los_enu)).sum(axis=0) * (rot.T @ los_enu)
        across *= 1000.0 / np.linalg.norm(across, axis=0)
        change = displaced_ranges(BRAUNSCHWEIG_M, satellites_m, across)
        seen = np.abs(change[SITE.second] - change[SITE.first]).max(axis=0)
        edge = 0.05 / seen  # all of it is linear in the displacement, to its size over the range
        error = displaced_ranges(users_m, satellites_m, across) - change[0]
        worst = np.maximum(worst, edge * np.abs(error).max(axis=0) / 5000.0)
    # Directions at random come within a few percent of the worst one, and never beyond it: 1000 m at 20 000 km and
    # 5 km are linear to 3e-4.
    assert (worst[up] <= p[up] * 1.002).all()
    assert (worst[up] >= 0.8 * p[up]).all()
    assert (p[up] * range_m[up] > 500.0).all()


@pytest.mark.parametrize("descent_deg", [0.0, 3.0])
def test_corners_of_the_polygon_are_the_worst_of_all_angles(descent_deg):
    rng = np.random.default_rng(2)
    for receivers in (3, 4):
        baselines = baselines_of(BRAUNSCHWEIG_M[:receivers], BRAUNSCHWEIG_M[0])
        _, _, _, los_enu, _, elevation = sky()
        threshold = rng.uniform(0.03, 0.15, (len(baselines), N_SATS))
        threshold[0, ::3] = np.nan
        found = decorrelation(baselines.vector_m, threshold, los_enu, descent_rad=np.radians(descent_deg))
        for satellite in np.flatnonzero(elevation > np.radians(5.0))[:12]:
            scanned = scanned_decorrelation(
                baselines.vector_m, threshold[:, satellite], los_enu[:, satellite],
                descent_rad=np.radians(descent_deg), steps=3600,
            )  # fmt: skip
            # A corner lies up to half a step of 0.1 degrees beside an angle of the scan; some are sharp.
            assert scanned <= found[satellite] * (1.0 + 1e-9)
            assert found[satellite] == pytest.approx(scanned, rel=0.03)


def test_one_direction_bounds_nothing():
    _, _, _, los_enu, _, elevation = sky()
    up = elevation > np.radians(5.0)
    line = np.array([[700.0, 10.0, 0.0], [350.0, 5.0, 0.0], [-140.0, -2.0, 0.0]])
    assert np.isinf(decorrelation(line, np.full((3, N_SATS), 0.05), los_enu)[up]).all()
    assert np.isinf(decorrelation(line[:1], np.full((1, N_SATS), 0.05), los_enu)[up]).all()
    across = np.concatenate([line, [[0.0, 500.0, 0.0]]])
    assert np.isfinite(decorrelation(across, np.full((4, N_SATS), 0.05), los_enu)[up]).all()
    blind = np.full((4, N_SATS), 0.05)
    blind[3] = np.nan
    assert np.isinf(decorrelation(across, blind, los_enu)[up]).all()


def test_zenith_and_two_baselines_by_hand():
    """East and north baselines of 1 km and 500 m, thresholds of 50 mm, satellite in the zenith: 5e-5 and 1e-4 rad."""
    p = decorrelation(
        np.array([[1000.0, 0.0, 0.0], [0.0, 500.0, 0.0]]), np.full((2, 1), 0.05), np.array([[0.0], [0.0], [1.0]])
    )
    assert p[0] == pytest.approx(np.hypot(5e-5, 1e-4), rel=1e-12)


def test_what_the_four_receiver_site_can_claim():
    """With the noise of roof antennas: below 1.5e-4 above 25 degrees, not at the mask; two receivers claim nothing."""
    azimuth = np.radians(np.arange(0.0, 360.0, 10.0))

    def at(baselines, degrees):
        elevation = np.full(azimuth.shape, np.radians(degrees))
        return site_decorrelation(baselines, elevation, azimuth, NOISE, PARAMS)

    assert at(SITE, 25.0).max() < 1.5e-4 < at(SITE, 10.0).max() < at(SITE, 5.0).max() < 1.275e-3
    assert np.isinf(at(baselines_of(BRAUNSCHWEIG_M[:2], BRAUNSCHWEIG_M[0]), 45.0)).all()


def test_a_slow_orbit_error_is_followed_beyond_half_a_wavelength():
    """4 mm/s for two minutes, faster than any orbit: the wrapped value comes back to zero, the monitor's does not."""
    rng = np.random.default_rng(3)
    series = []
    for number in range(240):
        value = 0.003 * rng.normal(size=SHAPE)
        value[2, :, 4] += 0.002 * number
        series.append(given(value))
    state, results = run(series)
    failed = np.array([each.failed for each in results])
    threshold = PARAMS.multiplier(len(SITE)) * 0.005
    first = failed[:, 4].argmax()
    assert first * 0.002 == pytest.approx(threshold, abs=5 * 0.003)
    # L5 through 1.9, L1 through 2.5 wavelengths
    assert failed[first + 20 :, 4].all()
    assert not np.delete(failed, 4, axis=1).any()
    assert state.followed[0, 2, :, 4] == pytest.approx([0.478, 0.478], abs=5 * 0.003)


def test_slips_of_whole_wavelengths_are_none():
    rng = np.random.default_rng(4)
    wavelength = WAVELENGTH_M[[L1, L5]][:, np.newaxis]
    series = [given(0.003 * rng.normal(size=SHAPE) + wavelength * rng.integers(-9, 9, SHAPE)) for _ in range(50)]
    _, results = run(series)
    assert not np.array([each.failed for each in results]).any()


def test_gaps_and_new_ephemerides():
    rng = np.random.default_rng(5)
    before, after = np.zeros(SHAPE), np.zeros(SHAPE)
    before[..., 4] = 0.08
    after[..., 4] = 0.16
    noise = 0.002 * rng.normal(size=(2, *SHAPE))
    state, _ = run([given(before + noise[0]), given(after + noise[1])], dt_s=50.0)
    assert state.followed[0, 0, 0, 4] == pytest.approx(0.16, abs=0.01)  # followed
    state, _ = run([given(before + noise[0]), given(after + noise[1])], dt_s=70.0)
    assert state.followed[0, 0, 0, 4] == pytest.approx(0.16 - WAVELENGTH_M[L1], abs=0.01)  # began anew
    # A new ephemeris takes the error away at once: a jump of more than half a wavelength, which the shift tells.
    shift = np.zeros((2, 4, N_SATS))
    shift[1, 1, 4] = -0.16
    bad = np.zeros(SHAPE)
    mine = (SITE.second == 1) * 1.0 - (SITE.first == 1)
    bad[..., 4] = 0.16 * mine[:, np.newaxis]
    steps = [given(bad * part) for part in (0.0, 0.5, 1.0)]
    state, results = run([*steps, given(np.zeros(SHAPE))], shift=[None, None, None, shift[1]])
    assert results[2].failed[4]
    assert not results[3].failed[4]
    assert np.abs(state.followed[0, ..., 4]).max() < 1e-12


def test_false_alarms_and_missed_detections_by_simulation():
    rng = np.random.default_rng(6)
    params = replace(PARAMS, p_false_alarm=0.3, p_missed_detection=0.02)
    _, results = run([given(0.005 * rng.normal(size=SHAPE)) for _ in range(600)], params=params)
    rate = np.array([each.failed for each in results])[:, HERE].mean()
    # 0.01 an epoch, shared by twelve values, here independent: the bound is reached. 5400 samples: 14 % (1 sigma).
    assert rate == pytest.approx(0.01, rel=0.4)
    assert rate < 0.0145
    edge = (params.multiplier(len(SITE)) + params.k_md) * 0.005
    missed = 0
    for _ in range(400):
        value = np.zeros(SHAPE)
        value[0, 0, 4] = edge
        value = value + 0.005 * rng.normal(size=SHAPE)
        missed += not run([given(value)], params=params)[1][0].failed[4]
    assert missed <= 400 * 0.02 + 3 * np.sqrt(400 * 0.02)


def test_missing_is_not_good():
    rng = np.random.default_rng(7)
    one = given(0.003 * rng.normal(size=SHAPE))
    value = one.residual_m.copy()
    value[..., 3] = np.nan
    value[1:, :, 5] = np.nan  # one baseline left: looked at
    value[:, 1, 6] = np.nan  # L1 alone: looked at
    gone = one._replace(residual_m=value, sigma_m=np.where(np.isnan(value), np.nan, 0.005))
    _, results = run([one, gone])
    assert np.flatnonzero(HERE & np.isnan(results[1].statistic)).tolist() == [3]
    assert not results[1].failed.any()
    nothing = one._replace(residual_m=np.full(SHAPE, np.nan), sigma_m=np.full(SHAPE, np.nan))
    _, results = run([nothing])
    assert np.isnan(results[0].statistic).all()
    single = baselines_of(BRAUNSCHWEIG_M[:1], BRAUNSCHWEIG_M[0])
    empty = np.zeros((0, 2, N_SATS))
    none = DoubleDifferences(
        residual_m=empty, sigma_m=empty, nominal_sigma_m=empty, reference=np.zeros(empty.shape, dtype=np.int64)
    )
    _, results = run([none], site=single)
    assert np.isnan(results[0].statistic).all()


@pytest.mark.parametrize(("name", "bands"), [("upc1_upc2", (L1, L2)), ("mosaic_base_rover", (L1, L5))])
def test_recorded_pairs_have_no_false_alarm(data_dir, name, bands):
    station, epochs = recorded_pair(name, data_dir, 400)
    params = replace(PARAMS, bands=bands)
    site = site_of(station).positions_m
    baselines, air = baselines_of(site[:2], site[2]), Troposphere(refractivity=330.0, scale_height_m=7900.0)
    state, largest = initial_ephemeris_residual(1, params), 0.0
    for number, epoch in enumerate(epochs):
        delay = air.delay_m(epoch.elevation_rad, epoch.azimuth_rad, baselines.place_m)
        residual = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, delay, bands)
        due = np.isfinite(residual[:, 0]).all(axis=0) & (epoch.elevation_rad >= np.radians(5.0))
        made = double_differences(
            residual, baselines, reference_satellites(due, epoch.elevation_rad, 5), epoch.elevation_rad, NOISE, bands
        )
        seen = Orbits(made, due, epoch.shift_m)
        state, result = ephemeris_residual_step(state, seen, baselines, np.nan if number == 0 else 1.0, params)
        assert not result.failed.any()
        largest = max(largest, float(np.max((result.statistic / result.threshold)[due])))
    assert largest > 0.15


def test_reference_point_is_where_it_is_thought():
    """The made-up constellation is over Braunschweig: without satellites up the tests above would test nothing."""
    *_, elevation = sky()
    assert np.count_nonzero(elevation > np.radians(5.0)) > 12
    away = np.linalg.norm(ecef_from_geodetic(LATITUDE_RAD, LONGITUDE_RAD, 130.0) - BRAUNSCHWEIG_M[0])
    assert away < 2000.0


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"bands": ()}, "bands"),
        ({"p_missed_detection": 0.6}, "p_missed_detection"),
        ({"max_gap_s": 0.0}, "max_gap_s"),
        ({"p_false_alarm": 1.0}, "p_false_alarm"),
    ],
)
def test_bad_parameters(changes, word):
    with pytest.raises(ValueError, match=word):
        EphemerisResidualParams(**changes)
