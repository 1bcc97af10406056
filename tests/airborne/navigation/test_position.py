"""The differential position against a world that is known, from bits to metres."""

from __future__ import annotations

import math

import numpy as np
import pytest

import protection_loops
from airborne_world import (
    REFERENCE_ECEF_M,
    WEEK,
    Flight,
    World,
    above,
    constellation,
    elevation_of,
    fas_data_set,
    position_of,
    station_data,
)
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.kernels.corrected_ranges import settling_factor
from gbas_airborne.reception.station_data import final_approach
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import ServiceType

# Short enough for a test, long enough for every satellite's CRC to have come round.
PARAMS = AirborneParams(settle_s=9.0)
DURATION_S = 12.0


def level(height_m: float = 0.0, *, east_m: float = 3000.0) -> np.ndarray:
    """A place at the ellipsoidal height of the reference point plus `height_m`."""
    place = above(0.0, east_m=east_m)
    lat, lon, height = geodetic_from_ecef(place)
    rot_up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    return place + (130.0 + height_m - float(height)) * rot_up


def test_position_without_atmosphere_is_exact() -> None:
    """The acceptance is 1 cm. What is left is rounding of ranges of 2e7 m, and 1e-12 of the sampled flight time."""
    world = World(path=lambda t: level(), troposphere=False)
    flight = Flight(world, PARAMS)
    solution, protection, _ = flight.run(0.0, DURATION_S)
    assert solution.n_sats == len(world.satellites) >= 12
    assert np.linalg.norm(position_of(solution) - level()) < 1e-3
    assert protection.service == ServiceType.C
    assert protection.alert == 0.0


@pytest.mark.parametrize("height_m", [-80.0, 50.0, 1500.0, 10_000.0])
def test_tropospheric_correction_is_exact_for_exponential_refractivity(height_m: float) -> None:
    """The world integrates the refractivity numerically; the correction is the closed form of the same model."""
    world = World(path=lambda t: level(height_m))
    flight = Flight(world, PARAMS)
    solution, _, _ = flight.run(0.0, DURATION_S)
    assert np.linalg.norm(position_of(solution) - level(height_m)) < 1e-3


def test_without_the_correction_the_position_would_be_metres_off() -> None:
    """Guards the test above: the troposphere it removes is there."""
    world = World(path=lambda t: level(1500.0), troposphere=False)
    solution, _, _ = Flight(world, PARAMS).run(0.0, DURATION_S)
    assert np.linalg.norm(position_of(solution) - level(1500.0)) > 1.0


def test_an_approaching_aircraft_is_followed() -> None:
    """70 m/s along the path: a smoothing or timing error of 10 ms would be 0.7 m."""
    approach = final_approach(fas_data_set())

    def path(t: float) -> np.ndarray:
        return approach.position_on_path(6000.0 - 70.0 * t)

    world = World(path=path, approaches=(fas_data_set(),))
    flight = Flight(world, AirborneParams(settle_s=9.0, rpds=5))
    solution, protection, _ = flight.run(0.0, DURATION_S)
    t = DURATION_S - 0.5
    late_s = world.clock_m(t) / SPEED_OF_LIGHT_MPS  # where the aircraft was when the receiver's clock showed t
    assert np.linalg.norm(position_of(solution) - path(t - late_s)) < 1e-3
    assert solution.distance_to_ltp_m == pytest.approx(6000.0 - 70.0 * t, abs=0.01)
    # The message has the LTP's place to 0.0005 arc seconds and its height to 0.1 m.
    assert abs(solution.lateral_m) < 0.02
    assert abs(solution.vertical_m) < 0.05
    assert protection.state == 4.0
    # FASLAL 40 m grows with distance, FASVAL 10 m with height (Annex 10, tables B-68 and B-69).
    distance = solution.distance_to_ltp_m
    height_ft = (solution.height_above_ltp_m - solution.vertical_m) / 0.3048  # projected on the path
    assert protection.lal_m == pytest.approx(0.0044 * distance + 40.0 - 3.85, abs=1e-6)
    assert protection.val_m == pytest.approx(0.02925 * height_ft + 10.0 - 5.85, abs=1e-6)


def test_own_speed_goes_into_the_ionospheric_sigma() -> None:
    """sigma_iono = F sigma_vig (x + 2 tau v); at rest v is 0, before the first position the assumed maximum."""
    flight = Flight(World(path=lambda t: level(), troposphere=False), PARAMS)
    flight.run(0.0, DURATION_S)
    solutions = [s for s in flight.solutions if np.isfinite(s.x_m)]
    first, last = solutions[0], solutions[-1]
    used = np.isfinite(last.sigma_iono_m) & np.isfinite(first.sigma_iono_m)
    distance = float(np.linalg.norm(level() - REFERENCE_ECEF_M))
    ratio = first.sigma_iono_m[used] / last.sigma_iono_m[used]
    # Elevations move by 1e-4 rad in the seconds between.
    np.testing.assert_allclose(ratio, (distance + 2 * 100.0 * 82.0) / distance, rtol=1e-3)
    i = int(np.flatnonzero(used)[0])
    obliquity = 1.0 / math.sqrt(1.0 - (6378.1363 * math.cos(last.elevation_rad[i]) / (6378.1363 + 350.0)) ** 2)
    assert last.sigma_iono_m[i] == pytest.approx(4e-6 * obliquity * distance, rel=1e-4)


def test_a_moving_aircraft_has_its_true_speed() -> None:
    start, velocity = level(), np.array([30.0, -50.0, 20.0])
    flight = Flight(World(path=lambda t: start + velocity * t, troposphere=False), PARAMS)
    solution, _, _ = flight.run(0.0, DURATION_S)
    place = position_of(solution)
    up = place / np.linalg.norm(place)
    horizontal = np.linalg.norm(velocity - (velocity @ up) * up)
    distance = float(np.linalg.norm(place - REFERENCE_ECEF_M))
    i = int(np.flatnonzero(np.isfinite(solution.sigma_iono_m))[0])
    obliquity = 1.0 / math.sqrt(1.0 - (6378.1363 * math.cos(solution.elevation_rad[i]) / (6378.1363 + 350.0)) ** 2)
    # The geocentric vertical differs from the geodetic one by 3 mrad.
    assert solution.sigma_iono_m[i] == pytest.approx(4e-6 * obliquity * (distance + 200.0 * horizontal), rel=5e-3)


def test_projection_and_levels_agree_with_loops_end_to_end() -> None:
    """From the record alone a second formulation must reach the same protection levels."""

    def b_values(satellite: int) -> tuple[float, float, float, float]:
        return tuple(np.round(np.random.default_rng(satellite).normal(0.0, 0.3, 4) / 0.05) * 0.05)  # the message's step

    flight = Flight(World(b_values_m=b_values), PARAMS)
    solution, protection, _ = flight.run(0.0, DURATION_S)
    distance = float(np.linalg.norm(position_of(solution) - REFERENCE_ECEF_M))
    satellites = []
    for i in np.flatnonzero(np.isfinite(solution.s_vert)):
        assert solution.b_m[:, i] == pytest.approx(b_values(int(i)), abs=1e-9)
        satellites.append(
            protection_loops.Satellite(
                azimuth_rad=-solution.azimuth_rad[i],  # forward is north, and to the left is west
                elevation_rad=solution.elevation_rad[i],
                clock=0 if IS_GPS[i] else 1,
                sigma_gnd_m=0.2,
                sigma_air_m=solution.sigma_air_m[i],
                sigma_tropo_m=solution.sigma_tropo_m[i],
                sigma_iono_m=solution.sigma_iono_m[i],
                b_m=b_values(int(i)),
                ephemeris_error_m=2e-4 * distance,
            )
        )
    s_vert, s_lat = protection_loops.vertical_and_lateral(satellites, 0.0)
    # The published table has three decimals: 1e-4 relative.
    for s, h0, h1, bound in (
        (s_vert, protection.vpl_h0_m, protection.vpl_h1_m, protection.veb_m),
        (s_lat, protection.lpl_h0_m, protection.lpl_h1_m, protection.leb_m),
    ):
        assert h0 == pytest.approx(protection_loops.h0(s, satellites, protection_loops.K_FFMD), rel=1e-4)
        assert h1 == pytest.approx(protection_loops.h1(s, satellites, protection_loops.K_MD), rel=1e-4)
        assert bound == pytest.approx(protection_loops.ephemeris_bound(s, satellites, 5.0), rel=1e-5)


def test_airborne_sigma_is_the_published_curve_once_settled() -> None:
    flight = Flight(
        World(path=lambda t: level(), troposphere=False), AirborneParams(settle_s=9.0, inflate_unsettled=False)
    )
    solution, _, _ = flight.run(0.0, DURATION_S)
    i = int(np.flatnonzero(np.isfinite(solution.sigma_air_m))[0])
    theta = math.degrees(solution.elevation_rad[i])
    noise = 0.15 + 0.43 * math.exp(-theta / 6.9)
    multipath = 0.13 + 0.53 * math.exp(-theta / 10.0)
    assert solution.sigma_air_m[i] == pytest.approx(math.hypot(noise, multipath), rel=1e-12)


def test_settling_factor_is_the_variance_of_the_filter() -> None:
    """Against the sum of squared weights of the filter itself, run on an impulse at every epoch."""
    interval, tau = 0.5, 100.0
    n_steady = int(tau / interval)
    weights = np.zeros(0)
    for n in range(1, 1401):
        new = max(1.0 / n, 1.0 / n_steady)
        weights = np.append(weights * (1.0 - new), new)
        if n in (20, 100, 200, 300, 600, 1400):
            exact = math.sqrt((weights**2).sum() * 2.0 * tau / interval)
            factor = float(settling_factor(n * interval, tau, 100.0))
            # The steady filter of discrete steps has T/(2 tau - T) for T/(2 tau): 0.25 % in variance.
            assert factor == pytest.approx(exact, rel=3e-3)


def test_smoothing_switched_off_takes_raw_code() -> None:
    """A common code error on one satellite appears at once, in full."""
    error = np.zeros(N_SATS)
    world = World(code_error_m=lambda t: error * (t > 10.0))
    error[world.satellites[0]] = 5.0
    flight = Flight(world, AirborneParams(smoothing_tau_s=0.0, settle_s=0.0))
    solution, _, _ = flight.run(0.0, DURATION_S)
    place = world.path(DURATION_S - 0.5)
    moved = position_of(solution) - place
    lat, lon, _ = geodetic_from_ecef(place)
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    # Frames are linearised: 5 m along 2e7 m.
    assert moved @ up == pytest.approx(5.0 * solution.s_vert[world.satellites[0]], abs=1e-3)


def test_single_constellation_and_mixed_agree() -> None:
    mixed = Flight(World(), PARAMS).run(0.0, DURATION_S)[0]
    alone = Flight(World(), AirborneParams(settle_s=9.0, systems="G")).run(0.0, DURATION_S)[0]
    assert alone.n_sats < mixed.n_sats
    assert np.linalg.norm(position_of(alone) - position_of(mixed)) < 1e-3
    assert not np.isfinite(alone.s_vert[~IS_GPS]).any()


def test_week_rollover_is_passed_without_a_trace() -> None:
    """Six seconds before the end of the week to six after; the ephemerides' time lies in the next week."""
    truth = constellation(gps_week=WEEK + 1, toe_tow_s=0.0)
    world = World(truth=truth, start_s=604_794.0)
    flight = Flight(world, PARAMS)
    solution, protection, _ = flight.run(0.0, DURATION_S)
    assert (solution.gps_week, solution.tow_s) == (WEEK + 1, 5.5)
    assert np.linalg.norm(position_of(solution) - world.path(0.0)) < 1e-3
    assert protection.alert == 0.0
    assert solution.message_age_s == solution.correction_age_s == 0.0


@pytest.mark.parametrize("start_s", [1194.0, 86_394.0])
def test_modified_z_count_reset_is_passed(start_s: float) -> None:
    """The Z-count starts again every 20 minutes."""
    truth = constellation(toe_tow_s=7200.0 if start_s < 7200.0 else 86_400.0)
    world = World(truth=truth, start_s=start_s)
    world.aircraft = world.station = truth
    flight = Flight(world, PARAMS)
    flight.run(0.0, DURATION_S)
    ages = {s.correction_age_s for s in flight.solutions[1:]}
    assert ages == {0.0}
    assert flight.protections[-1].alert == 0.0


def test_output_at_once_uses_the_frame_before() -> None:
    """correction_wait_s 0: corrections are 0.5 s old, and the rate carries them to the epoch exactly."""
    world = World()
    flight = Flight(world, AirborneParams(settle_s=9.0, correction_wait_s=0.0))
    solution, protection, _ = flight.run(0.0, DURATION_S)
    assert solution.correction_age_s == 0.5
    assert np.linalg.norm(position_of(solution) - world.path(0.0)) < 1e-3
    assert protection.alert == 0.0


def test_single_receiver_station_has_the_multiplier_of_one() -> None:
    flight = Flight(World(n_receivers=1), PARAMS)
    solution, protection, _ = flight.run(0.0, DURATION_S)
    assert solution.n_receivers == 1.0
    assert math.isnan(protection.vpl_h1_m)
    variance = solution.sigma_gnd_m**2 + solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2
    expected = 6.86 * math.sqrt(np.nansum(solution.s_vert**2 * variance))
    assert protection.vpl_m == pytest.approx(expected, rel=1e-12)


def test_station_of_height_and_place_of_its_message() -> None:
    """The reference point is where the message says; the tropospheric difference counts from there."""
    message = station_data(ellipsoid_height_m=430.0)
    world = World(path=lambda t: level(500.0), station_message=message)
    solution, _, _ = Flight(world, PARAMS).run(0.0, DURATION_S)
    assert np.linalg.norm(position_of(solution) - level(500.0)) < 1e-3


def test_elevations_are_the_worlds() -> None:
    world = World()
    solution, _, _ = Flight(world, PARAMS).run(0.0, DURATION_S)
    week, tow_s = world.time(DURATION_S - 0.5)
    elevation = elevation_of(world.truth, week, tow_s, world.path(0.0))
    used = np.isfinite(solution.elevation_rad)
    np.testing.assert_allclose(solution.elevation_rad[used], elevation[used], atol=1e-8)  # 4 us of satellite motion


def test_identical_inputs_give_identical_bits() -> None:
    first, second = Flight(World(), PARAMS), Flight(World(), PARAMS)
    first.run(0.0, DURATION_S)
    second.run(0.0, DURATION_S)
    for a, b in zip(first.solutions + first.protections, second.solutions + second.protections, strict=True):
        for name in a.__dataclass_fields__:
            left, right = np.asarray(getattr(a, name)), np.asarray(getattr(b, name))
            assert left.tobytes() == right.tobytes(), name
    assert [e.to_json() for e in first.events] == [e.to_json() for e in second.events]


def test_how_bursts_are_handed_over_does_not_matter() -> None:
    """Early, late within the limit, in any order: the frame times decide."""
    world = World()
    orderly, messy = Flight(world, PARAMS), Flight(world, PARAMS)
    for k in range(24):
        t = 0.5 * k
        orderly.step(t)
        # Two frames at once, the second before its time, all backwards.
        messy.step(t, bursts=tuple(reversed(world.bursts(t) + world.bursts(t + 0.5))) if k % 2 == 0 else ())
    a, b = orderly.solutions[-1], messy.solutions[-1]
    np.testing.assert_array_equal(position_of(a), position_of(b))
