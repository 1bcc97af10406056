"""The simulated world: exact without noise, as noisy as asked, and the same bits whatever the order."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gbas_core.gnss.frames import ecef_from_geodetic, rot_enu_ecef
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.gnss.orbits import predicted_state, rotated_range, satellite_clock_s, transmit_state
from gbas_core.models.error_models import tropo_correction_m
from gbas_core.positioning.approach import FinalApproach
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS
from gbas_core.signals import BANDS, L1, L2, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.atmosphere.troposphere import Troposphere
from gbas_sim.flight.straight_in import StraightIn
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, ReceiverParams, cn0_dbhz, noise_sigmas
from gbas_sim.simulated_epochs import SimulatedEpoch
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams

SITES = (
    (3840619.039, 715604.228, 5024909.863),
    (3840835.113, 714861.969, 5024848.587),
    (3841202.939, 715429.959, 5024488.675),
)
APPROACH = FinalApproach.from_course(
    ltp_lat_rad=math.radians(52.3209),
    ltp_lon_rad=math.radians(10.567),
    ltp_height_m=133.0,
    course_rad=math.radians(264.73),
    fpap_distance_m=2300.0,
    tch_m=15.0,
    gpa_rad=math.radians(3.0),
)
FIELDS = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")


def params(**changes) -> WorldParams:
    return dataclasses.replace(WorldParams(receiver_ecef_m=SITES, flight=StraightIn(approach=APPROACH)), **changes)


def quiet(receiver: ReceiverParams) -> ReceiverParams:
    return dataclasses.replace(receiver, noise_scale=0.0)


@pytest.fixture(scope="module")
def world() -> World:
    return World(params())


@pytest.fixture(scope="module")
def silent() -> World:
    return World(params(ground=quiet(GROUND_RECEIVER), airborne=quiet(AIRBORNE_RECEIVER)))


def receivers(epoch: SimulatedEpoch):
    """Observations and true positions of all receivers of an epoch."""
    positions = [np.array(site) for site in SITES] + [epoch.truth.position_m]
    return zip((*epoch.ground, epoch.airborne), positions, strict=True)


# --- geometry


def test_visible_satellites_and_dilution(world):
    for number in range(0, len(world), 200):
        epoch = world.epoch(number)
        for observation, position in receivers(epoch):
            seen = np.isfinite(observation.code_m[L1])
            # Each plan is made to show at least 4 satellites above 5 degrees everywhere; the cap seen from its edge
            # at 3 degrees holds some 40 % of a shell at these radii, so not more than half of 24.
            assert 4 <= (seen & IS_GPS).sum() <= 12
            assert 4 <= (seen & IS_GALILEO).sum() <= 12
            state = predicted_state(world.ephemeris, observation.gps_week, observation.tow_s, position)
            _, los = rotated_range(position, state.position_m)
            design = np.column_stack([-los[:, seen].T, (seen & IS_GPS)[seen], (seen & IS_GALILEO)[seen]])
            cofactor = np.linalg.inv(design.T @ design)
            # SPS Performance Standard: PDOP of 6 or less for 98 % of the day with GPS alone; two systems do better.
            assert math.sqrt(np.trace(cofactor[:3, :3])) < 3.0


def test_no_satellite_below_the_mask(world):
    for observation, position in receivers(world.epoch(700)):
        state = predicted_state(world.ephemeris, observation.gps_week, observation.tow_s, position)
        latitude, longitude = np.arcsin(position[2] / np.linalg.norm(position)), np.arctan2(position[1], position[0])
        up = rot_enu_ecef(latitude, longitude)[2]  # geocentric: 0.2 degrees from the vertical
        _, los = rotated_range(position, state.position_m)
        elevation_deg = np.degrees(np.arcsin(up @ los))
        seen = np.isfinite(observation.code_m[L1])
        assert (elevation_deg[seen] > 2.75).all()
        assert (elevation_deg[~seen & np.isfinite(elevation_deg)] < 3.25).all()


def test_bands(world):
    observation = world.epoch(0).airborne
    for name in FIELDS:
        values = getattr(observation, name)
        assert values.shape == (len(BANDS), N_SATS)
        assert not np.isfinite(values[L2]).any()
        np.testing.assert_array_equal(np.isfinite(values[L1]), np.isfinite(values[L5]))
        np.testing.assert_array_equal(np.isfinite(values[L1]), np.isfinite(observation.code_m[L1]))
    assert observation.simulated == 1.0


# --- exactness without noise


def test_codes_are_ranges_and_clocks(silent):
    """Geometry from the suite's orbit code at the true time of reception, to 0.1 mm; also over the pseudorange."""
    for number in (0, 333, len(silent) - 1):
        epoch = silent.epoch(number)
        for observation, position in receivers(epoch):
            week, tow = observation.gps_week, observation.tow_s
            seen = np.isfinite(observation.code_m[L1])
            # The receiver's clock is not told: it is what all ranges of the epoch have in common.
            for band in (L1, L5):
                guess = transmit_state(silent.ephemeris, week, tow, observation.code_m[band], band)
                geometric, _ = rotated_range(position, guess.position_m)
                clock_m = observation.code_m[band] - geometric + SPEED_OF_LIGHT_MPS * guess.clock_s
                np.testing.assert_allclose(clock_m[seen], clock_m[seen].mean(), rtol=0.0, atol=1e-4)
                clock_s = clock_m[seen].mean() / SPEED_OF_LIGHT_MPS
                assert abs(clock_s) < 2.0e-6  # 1 microsecond, and a drift of 1e-9 for ten minutes
                state = predicted_state(silent.ephemeris, week, tow - clock_s, position, band)
                expected, _ = rotated_range(position, state.position_m)
                expected = expected + SPEED_OF_LIGHT_MPS * (clock_s - state.clock_s)
                np.testing.assert_allclose(observation.code_m[band][seen], expected[seen], rtol=0.0, atol=1e-4)


def test_group_delays_differ_between_bands(silent):
    observation = silent.epoch(10).airborne
    seen = np.isfinite(observation.code_m[L1])
    week, tow = observation.gps_week, observation.tow_s
    clocks = [satellite_clock_s(silent.ephemeris, week, tow, band) for band in (L1, L5)]
    between = observation.code_m[L5] - observation.code_m[L1]
    # Clock differences between bands do not depend on time; a pseudorange of 2e7 m keeps 4 nm.
    np.testing.assert_allclose(between[seen], SPEED_OF_LIGHT_MPS * (clocks[0] - clocks[1])[seen], rtol=0.0, atol=1e-6)
    assert np.abs(between[seen]).max() > 0.5


def test_carrier_follows_code(silent):
    """No divergence: carrier less code is whole wavelengths, and stays so."""
    epochs = [silent.epoch(number) for number in (0, 1, 600, 1100)]
    for row in range(len(SITES) + 1):
        observations = [(*epoch.ground, epoch.airborne)[row] for epoch in epochs]
        cycles = np.array([(o.carrier_m - o.code_m) / WAVELENGTH_M[:, np.newaxis] for o in observations])
        known = np.isfinite(cycles).all(axis=0)
        assert known.sum() > 10
        # 2e7 m keep 4e-9 m: 2e-8 cycles.
        np.testing.assert_allclose(cycles[:, known], np.rint(cycles[:, known]), rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(cycles[:, known] - cycles[0, known], 0.0, atol=1e-6)


@pytest.mark.parametrize("middle", [1, 598, 615, 1000])
def test_doppler_is_the_rate_of_the_carrier(middle):
    """Central differences over 2 x 0.1 s; 598 to 618 is the push-over, where the aircraft accelerates."""
    fast = World(params(ground=quiet(GROUND_RECEIVER), airborne=quiet(AIRBORNE_RECEIVER), interval_s=0.1))
    number = 5 * middle
    before, here, after = (fast.epoch(number + step) for step in (-1, 0, 1))
    for first, now, last in zip(
        (*before.ground, before.airborne), (*here.ground, here.airborne), (*after.ground, after.airborne), strict=True
    ):
        rate = (last.carrier_m - first.carrier_m) / 0.2
        expected = -rate / WAVELENGTH_M[:, np.newaxis]
        known = np.isfinite(expected)
        # The difference's own error: jerk/6 x 0.01 s^2 with at most 0.05 m/s^3 is 0.1 mm/s, 0.4 mHz on L1; rounding of
        # 2e7 m gives 4e-9 m / 0.2 s. Flight time and Sagnac terms left out would be mm/s.
        np.testing.assert_allclose(now.doppler_hz[known], expected[known], rtol=0.0, atol=1e-3)


def test_truth_is_where_the_airborne_ranges_meet(silent):
    epoch = silent.epoch(900)
    along = APPROACH.deviations(epoch.truth.position_m)
    flight = silent.params.flight
    expected = flight.ground_speed_mps * (flight.duration_s - 450.0)
    assert along.distance_m == pytest.approx(expected, abs=1e-3)  # the clock's microseconds at 70 m/s
    assert along.lateral_m == pytest.approx(0.0, abs=1e-6)
    assert along.vertical_m == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(epoch.truth.velocity_mps) == pytest.approx(70.0, abs=1e-9)
    assert (epoch.truth.gps_week, epoch.truth.tow_s) == from_epoch_key(epoch.key) == (2400, 216_450.0)


# --- troposphere


def test_troposphere_between_two_heights_is_what_the_airborne_correction_says():
    # The correction is the standard's formula, written elsewhere and tested against published values there.
    air = Troposphere(refractivity=379.0, scale_height_m=7900.0, reference_height_m=130.0)
    elevation = np.full(N_SATS, np.nan)
    elevation[:4] = np.radians([5.0, 20.0, 50.0, 90.0])
    low, high = air.delay_m(np.array([130.0, 1130.0]), elevation)
    expected = tropo_correction_m(379.0, 7900.0, elevation, 1000.0)
    np.testing.assert_allclose((low - high)[:4], expected[:4], rtol=1e-12)
    # 379e-6 x 7900 m = 2.994 m at the zenith; 1 / sin(20 deg) = 2.924 times that, less a little, at 20 degrees.
    assert low[3] == pytest.approx(2.994 / math.sqrt(1.002), abs=1e-3)
    assert low[1] == pytest.approx(2.994 * 2.924, rel=0.01)
    assert not np.isfinite(low[4:]).any()


def test_troposphere_delays_code_and_carrier_alike(silent):
    air = Troposphere(refractivity=379.0, reference_height_m=130.0)
    wet = World(dataclasses.replace(silent.params, troposphere=air))
    for number in (0, 900):
        with_air, without = wet.epoch(number).airborne, silent.epoch(number).airborne
        delay = with_air.code_m - without.code_m
        known = np.isfinite(delay)
        np.testing.assert_allclose((with_air.carrier_m - without.carrier_m)[known], delay[known], rtol=0.0, atol=1e-6)
        assert (delay[known] > 2.0).all()  # 3 m at the zenith, 1 km up at most
        assert (delay[known] < 50.0).all()
        # The Doppler has the rate of the delay since the epoch before; over the next it differs by 0.1 mm/s.
        after = wet.epoch(number + 1).airborne.carrier_m - silent.epoch(number + 1).airborne.carrier_m
        rate = (after - (with_air.carrier_m - without.carrier_m)) / 0.5
        doppler = with_air.doppler_hz - without.doppler_hz
        both = known & np.isfinite(rate)
        np.testing.assert_allclose(
            doppler[both], (-rate / WAVELENGTH_M[:, np.newaxis])[both], rtol=0.0, atol=1e-4 / WAVELENGTH_M[L1]
        )


# --- flight


def test_flight_is_smooth_and_ends_at_the_threshold():
    flight = StraightIn(approach=APPROACH)
    position, velocity = flight.state(np.array([flight.duration_s]))
    threshold = APPROACH.approach_from_ecef(position[0])
    np.testing.assert_allclose(threshold, [0.0, 0.0, 15.0], atol=1e-6)
    time = np.arange(0.0, flight.duration_s, 0.1)
    position, velocity = flight.state(time)
    numeric = (position[2:] - position[:-2]) / 0.2
    # Jerk of at most 0.05 m/s^3 (3.7 m/s over 20 s along half a cosine): 0.1 mm/s at 0.1 s; rounding 1e-8 m/s.
    np.testing.assert_allclose(velocity[1:-1], numeric, atol=2e-4)
    acceleration = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / 0.1
    # pi/2 x 3.66 m/s / 20 s
    assert acceleration.max() == pytest.approx(math.pi / 2.0 * 70.0 * math.sin(math.radians(3.0)) / 20.0, rel=0.01)
    heights = APPROACH.approach_from_ecef(position)[:, 2]
    assert heights[0] == pytest.approx(15.0 + 20_000.0 * math.tan(math.radians(3.0)), abs=1e-6)
    assert (np.diff(heights) <= 1e-6).all()


# --- noise


def residuals(world: World, silent: World, count: int):
    """Noise of every observation of `count` epochs over its asked-for sigma: (3, values)."""
    collected: list[list[np.ndarray]] = [[], [], []]
    for number in range(count):
        noisy, exact = world.epoch(number), silent.epoch(number)
        pairs = [(n, e, GROUND_RECEIVER) for n, e in zip(noisy.ground, exact.ground, strict=True)]
        for with_noise, without, kind in [*pairs, (noisy.airborne, exact.airborne, AIRBORNE_RECEIVER)]:
            sigmas = noise_sigmas(kind, without.cn0_dbhz)
            for index, name in enumerate(("code_m", "carrier_m", "doppler_hz")):
                normal = (getattr(with_noise, name) - getattr(without, name)) / sigmas[index]
                collected[index].append(normal[np.isfinite(normal)])
    return [np.concatenate(each) for each in collected]


def test_noise_is_as_asked(world, silent):
    for normal in residuals(world, silent, 100):
        n = normal.size
        assert n > 10_000
        # Five standard deviations of the estimates of mean, variance and of the share beyond two sigma (4.55 %).
        assert abs(normal.mean()) < 5.0 / math.sqrt(n)
        assert abs(normal.var() - 1.0) < 5.0 * math.sqrt(2.0 / n)
        assert abs((np.abs(normal) > 2.0).mean() - 0.0455) < 5.0 * math.sqrt(0.0455 / n)


def test_noise_is_independent(world, silent):
    """Between epochs, receivers, bands and quantities."""
    epochs = 300
    samples = np.empty((epochs, 4, 3, 2, N_SATS))
    for number in range(epochs):
        noisy, exact = world.epoch(number), silent.epoch(number)
        rows = zip((*noisy.ground, noisy.airborne), (*exact.ground, exact.airborne), strict=True)
        for row, (with_noise, without) in enumerate(rows):
            for index, name in enumerate(("code_m", "carrier_m", "doppler_hz")):
                samples[number, row, index] = (getattr(with_noise, name) - getattr(without, name))[[L1, L5]]
    known = np.isfinite(samples).all(axis=(0, 1, 2, 3))
    # Each series to unit variance: sigma changes little over 150 s.
    normal = samples[..., known]
    normal = (normal / normal.std(axis=0)).reshape(epochs, -1)
    limit = 5.5 / math.sqrt(epochs)  # one in 5e7; there are some 1e5 correlations
    lagged = (normal[1:] * normal[:-1]).mean(axis=0)
    assert np.abs(lagged).max() < limit
    cross = normal.T @ normal / epochs
    np.fill_diagonal(cross, 0.0)
    assert np.abs(cross).max() < limit


def test_noise_formulas():
    # Kaplan and Hegarty's formulas by hand at round numbers: C/N0 = 40 dB-Hz = 1e4, T = 20 ms, so T C/N0 = 200.
    cn0 = np.full((3, N_SATS), 40.0)
    kind = ReceiverParams(carrier_bandwidth_hz=16.0, code_bandwidth_hz=2.0, spacing_chips=(1.0, 1.0))
    code, carrier, doppler = noise_sigmas(kind, cn0)
    chips = math.sqrt(2.0 * 1.0 / (2.0 * 1e4) * (1.0 + 2.0 / (1.0 * 200.0)))
    gps, galileo = 0, N_SATS - 1
    assert code[L1, gps] == pytest.approx(chips * 293.0522561, rel=1e-9)  # C/A chip: c / 1.023 MHz
    assert code[L1, galileo] == pytest.approx(chips * 293.0522561 / math.sqrt(3.0), rel=1e-9)
    assert code[L5, gps] == pytest.approx(chips * 29.30522561, rel=1e-9)
    assert carrier[L1, gps] == pytest.approx(0.190293673 / (2.0 * math.pi) * 0.04 * math.sqrt(1.0025), rel=1e-8)
    assert doppler[L1, gps] == pytest.approx(math.sqrt(4.0 * 2.0 / 1e4 * 1.005) / (2.0 * math.pi * 0.02), rel=1e-9)


def test_cn0_goes_with_elevation():
    kind = ReceiverParams(cn0_zenith_dbhz=(50.0, 52.0), cn0_horizon_dbhz=(37.0, 39.0))
    elevation = np.full(N_SATS, np.nan)
    elevation[:3] = 0.0, math.radians(30.0), math.radians(90.0)
    cn0 = cn0_dbhz(kind, elevation)
    np.testing.assert_allclose(cn0[[L1, L5], :3], [[37.0, 43.5, 50.0], [39.0, 45.5, 52.0]], rtol=1e-12)
    assert not np.isfinite(cn0[L2]).any()


# --- determinism


def same(first: SimulatedEpoch, second: SimulatedEpoch) -> bool:
    pairs = zip((*first.ground, first.airborne), (*second.ground, second.airborne), strict=True)
    observations = all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for a, b in pairs for name in FIELDS
    )
    return observations and np.array_equal(first.truth.position_m, second.truth.position_m)


def test_any_order_gives_the_same_bits(world):
    forward = {number: world.epoch(number) for number in range(40)}
    other = World(params())
    for number in (39, 3, 17, 0, 28):
        assert same(forward[number], other.epoch(number))
    for number, epoch in zip(range(5), World(params()), strict=False):
        assert same(forward[number], epoch)


def test_seed_changes_noise_and_clocks_but_not_the_geometry(world):
    other = World(params(seed=2)).epoch(5)
    here = world.epoch(5)
    assert not same(other, here)
    np.testing.assert_array_equal(np.isfinite(other.airborne.code_m), np.isfinite(here.airborne.code_m))


def test_a_receiver_does_not_depend_on_the_others(world):
    alone = World(params(receiver_ecef_m=SITES[:1])).epoch(7)
    together = world.epoch(7)
    np.testing.assert_array_equal(alone.ground[0].code_m, together.ground[0].code_m)
    np.testing.assert_array_equal(alone.airborne.carrier_m, together.airborne.carrier_m)


def test_receivers_have_noise_and_clocks_of_their_own(world):
    epoch = world.epoch(0)
    here = World(params(receiver_ecef_m=(SITES[0],) * 4)).epoch(0)
    first, second = here.ground[:2]
    seen = np.isfinite(first.code_m[L1])
    difference = (first.code_m - second.code_m)[L1][seen]
    assert abs(difference.mean()) > 10.0  # clocks: two draws from +-300 m
    assert difference.std() > 0.05
    assert len(epoch.ground) == 3


def test_lock_indicator_marks_risen_satellites():
    # Coarse epochs of a long flight: satellites rise and set.
    slow = StraightIn(approach=APPROACH, speed_mps=20.0, level_time_s=1800.0)
    world = World(params(flight=slow, interval_s=30.0))
    risen = 0
    before = world.epoch(0).ground[0]
    assert np.nanmax(before.lli) == 0.0
    for number in range(1, len(world)):
        now = world.epoch(number).ground[0]
        new = np.isfinite(now.code_m[L1]) & ~np.isfinite(before.code_m[L1])
        np.testing.assert_array_equal(now.lli[L1] == 1.0, new)
        risen += int(new.sum())
        before = now
    assert risen > 0


def test_weeks_run_on():
    world = World(params(start_week=2400, start_tow_s=604_790.0))
    last, first = world.epoch(19), world.epoch(20)
    assert (last.airborne.gps_week, last.airborne.tow_s) == (2400, 604_799.5)
    assert (first.airborne.gps_week, first.airborne.tow_s) == (2401, 0.0)
    rate = (first.airborne.carrier_m - last.airborne.carrier_m) / 0.5
    mean_doppler = 0.5 * (first.airborne.doppler_hz + last.airborne.doppler_hz)
    known = np.isfinite(rate)
    # Carrier noise of 2 mm over 0.5 s and Doppler noise of 0.3 Hz x 0.2 m, five sigma.
    np.testing.assert_allclose(rate[known], (-mean_doppler * WAVELENGTH_M[:, np.newaxis])[known], rtol=0.0, atol=0.4)


# --- parameters


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"systems": "GR"}, "R"),
        ({"systems": ""}, "systems = '' is not one of G, E, GE"),
        ({"seed": -1}, "seed = -1 is not within 0"),
        ({"interval_s": 0.0}, "interval_s = 0 is not within 0.01 to 60 s"),
        ({"interval_s": 0.3333333}, "interval_s = 0.3333333 is not a whole number of milliseconds"),
        ({"start_tow_s": 604_800.0}, "start_tow_s = 604800 is not within 0 to 604799.999 s"),
        ({"start_week": 0}, "start_week = 0 is not within 1024 to 8191"),
        ({"receiver_ecef_m": ()}, "receiver_ecef_m has 0 positions, not 1 to 4"),
        ({"receiver_ecef_m": ((1.0, 2.0, 3.0),)}, "receiver 1 = .* is not on the Earth"),
        ({"start_tow_s": math.nan}, "start_tow_s = nan is not a finite number"),
    ],
)
def test_bad_world(changes, message):
    with pytest.raises(ValueError, match=message):
        params(**changes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: StraightIn(approach=APPROACH, speed_mps=5.0), "speed_mps = 5 is not within 10 to 200 m/s"),
        (lambda: StraightIn(approach=APPROACH, level_time_s=math.nan), "level_time_s = nan is not a finite number"),
        (
            lambda: StraightIn(approach=APPROACH, intercept_distance_m=500.0, pushover_time_s=60.0),
            "flight: pushover_time_s = 60.0 is more than the descent",
        ),
        (lambda: Troposphere(refractivity=900.0), "refractivity = 900 is not within 0 to 800 N units"),
        (lambda: ReceiverParams(noise_scale=-1.0), "noise_scale = -1 is not within 0 to 100"),
        (lambda: ReceiverParams(cn0_zenith_dbhz=(50.0, math.nan)), "cn0_zenith_dbhz = nan is not a finite number"),
        (lambda: ReceiverParams(spacing_chips=0.1), "spacing_chips = 0.1 is not a list"),
    ],
)
def test_bad_parts(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_epochs_outside_the_run(world):
    for number in (-1, len(world)):
        with pytest.raises(IndexError, match=f"epoch {number} is not within 0 to"):
            world.epoch(number)


def test_longest_flight_is_within_the_validity_of_its_ephemerides():
    longest = StraightIn(approach=APPROACH, speed_mps=10.0, intercept_distance_m=50_000.0, level_time_s=1800.0)
    assert longest.duration_s + 120.0 < 7200.0  # time of ephemeris within 120 s of the start, GPS valid for 2 h


def test_site_is_on_the_ground():
    # Guards the table above: the sites lie within 2 km of the threshold.
    threshold = ecef_from_geodetic(APPROACH.ltp_lat_rad, APPROACH.ltp_lon_rad, APPROACH.ltp_height_m)
    assert all(np.linalg.norm(np.array(site) - threshold) < 2000.0 for site in SITES)
