"""The world as a whole: truth recovered by our chain and by RTKLIB, files repeated bit for bit, threats that show."""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import tracemalloc
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gbas_airborne.params import AirborneParams
from gbas_bringup.resources import config_path, resources
from gbas_bringup.run_config import read_run_config
from gbas_chain.chain import AirborneOutput, Chain
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.io.recording import RecordedEpoch
from gbas_core.io.rinex import read_navigation, read_observations
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.params import GroundParams
from gbas_msgs_py.records import SolutionEpoch
from gbas_sim.batches import observed
from gbas_sim.rinex_files import LABEL, export
from gbas_sim.scenario import ScenarioError, open_world, read_sections, scenario_from_mapping, world_from_yaml
from gbas_sim.world import World

SCENARIOS = resources("config/scenarios", "*.yaml")
IDEAL = {"ground_receiver": {"preset": "ideal"}, "airborne_receiver": {"preset": "ideal"}}
NOTHING = {"troposphere": {"refractivity": 0.0}, **IDEAL}
FIELDS = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")


def sections(*, threats=None, ground=None, **sim):
    """Sections of the site of Braunschweig with some of the simulation's changed."""
    site = read_sections(config_path("braunschweig.yaml"))
    own = {**site["sim"], **sim} | ({} if threats is None else {"threats": threats})
    return {**site, "ground": {**site["ground"], **(ground or {})}, "sim": own}


def opened(**changes) -> World:
    return open_world(scenario_from_mapping(sections(**changes)), source="here.yaml")


def values(world: World, number: int, name: str = "carrier_m") -> np.ndarray:
    """One kind of observations of all receivers at an epoch, (R, N_BANDS, N_SATS)."""
    epoch = world.epoch(number)
    return np.array([getattr(each, name) for each in (*epoch.ground, epoch.airborne)])


# --- the truth comes back


@dataclass(frozen=True)
class Flown:
    """An approach through the whole chain, at the epochs with a solution from 20 km to the threshold."""

    world: World
    solutions: tuple[SolutionEpoch, ...]
    error_m: np.ndarray
    distance_m: np.ndarray


def flown(whole: dict) -> Flown:
    """The chain over a scenario; errors are in the approach frame, (epochs, 3)."""
    world = open_world(scenario_from_mapping(whole))
    chain = Chain(
        GroundParams.from_mapping(whole["ground"]),
        AirborneParams.from_mapping(whole["airborne"]),
        world.ephemerides,
        world.ephemerides,
    )
    truth = {}

    def epochs():
        for epoch in world:
            truth[epoch.key] = epoch.truth.position_m
            yield RecordedEpoch(key=epoch.key, ground=epoch.ground, user=epoch.airborne)

    solutions = [each.solution for each in chain.run(epochs()) if isinstance(each, AirborneOutput)]
    solved = [each for each in solutions if np.isfinite(each.x_m)]
    found = np.array([(each.x_m, each.y_m, each.z_m) for each in solved])
    true = np.array([truth[epoch_key(each.gps_week, each.tow_s)] for each in solved])
    approach = world.params.flight.approach
    error_m = (found - true) @ approach.rot_approach_ecef.T
    distance_m = np.asarray(approach.deviations(true).distance_m)
    near = distance_m <= 20_000.0
    assert near.sum() > 280  # 20 km at 70 m/s, one a second
    assert distance_m[near].min() < 100.0
    solutions = tuple(each for each, there in zip(solved, near, strict=True) if there)
    return Flown(world=world, solutions=solutions, error_m=error_m[near], distance_m=distance_m[near])


def in_air(refractivity: float, **changes) -> dict:
    """The site with this air in its messages, receivers without errors, an epoch a second."""
    air = sections()["ground"]["atmosphere"] | {"refractivity": refractivity, **changes.pop("air", {})}
    return sections(ground={"atmosphere": air}, interval_s=1.0, **IDEAL, **changes)


def vertical_and_lateral(result: Flown) -> np.ndarray:
    """Errors (epochs, 2) that s_vert and s_lat are for: above the path, with those along it, and to the left [m]."""
    slope = math.tan(result.world.params.flight.approach.gpa_rad)
    return np.stack([result.error_m[:, 2] + slope * result.error_m[:, 0], result.error_m[:, 1]], axis=-1)


def projected(solution: SolutionEpoch, range_m: np.ndarray) -> np.ndarray:
    """Vertical and lateral error (2,) of errors of ranges [m]."""
    used = np.isfinite(solution.s_vert)
    return np.array([np.sum((each * range_m)[used]) for each in (solution.s_vert, solution.s_lat)])


def slant(elevation_rad: np.ndarray) -> np.ndarray:
    """Obliquity of the troposphere, ICAO Annex 10."""
    return 1.0 / np.sqrt(0.002 + np.sin(elevation_rad) ** 2)


def test_with_all_errors_off_the_chain_gives_the_truth_along_the_whole_approach():
    """Below 1 cm from the intercept at 20 km to the threshold, with no air at all.

    A station has to broadcast some: the least are 16 N over a scale height of 100 m, which the aircraft corrects though
    they are not there: 1.6 mm at the zenith, 16 mm at 5 degrees. Without that, less than a millimetre is left.
    """
    result = flown(in_air(16.0, air={"scale_height_m": 100.0}, troposphere={"refractivity": 0.0}))
    assert np.abs(result.error_m).max() < 0.01
    station_m = result.world.params.station.ecef_m
    height_m = [geodetic_from_ecef(np.array((each.x_m, each.y_m, each.z_m)))[2] for each in result.solutions]
    above = -np.expm1(-(np.array(height_m) - geodetic_from_ecef(np.array(station_m))[2]) / 100.0)
    zenith_m = 16e-6 * 100.0 * above
    corrected = [
        projected(each, zenith * slant(each.elevation_rad))
        for each, zenith in zip(result.solutions, zenith_m, strict=True)
    ]
    # Corrections stand still, and so does their rounding.
    np.testing.assert_allclose(vertical_and_lateral(result), corrected, atol=0.001)


def test_in_air_what_remains_is_the_difference_of_elevations():
    """In the air of the site errors are centimetres; the elevations explain them to the rounding of the messages.

    Station and aircraft see a satellite at elevations that differ by their distance over the Earth's radius; for that
    the standard has no correction.
    """
    result = flown(in_air(379.0))
    errors = vertical_and_lateral(result)
    assert 0.03 < np.abs(errors[:, 0]).max() < 0.15
    expected, rounding = [], []
    air = result.world.params.troposphere
    for each in result.solutions:
        seen = result.world.elevations_rad(round(each.tow_s - result.world.params.start_tow_s))[:4]
        difference = slant(each.elevation_rad) - slant(seen).mean(axis=0)
        expected.append(projected(each, 1e-6 * air.refractivity * air.scale_height_m * difference))
        rounding.append([np.sqrt(np.nansum(weights**2)) for weights in (each.s_vert, each.s_lat)])
    # Corrections come in steps of 1 cm: 0.01 / sqrt(12) each, 3 mm in the vertical. Five times that.
    left = (errors - expected) / (0.01 / np.sqrt(12.0) * np.array(rounding))
    assert np.abs(left).max() < 5.0
    assert np.sqrt((left**2).mean()) < 1.3  # rounding of neighbours in time is alike


def test_rtklib_finds_the_aircraft_from_exported_files(tmp_path):
    """Single point, codes alone, no models: within 5 cm; the files hold millimetres."""
    rtklib = pytest.importorskip("rtklib_dgnss")
    world = opened(interval_s=10.0, **NOTHING)
    files = export(world, tmp_path / "files")
    positions = rtklib.rtklib_positions(
        None, files.observations[-1], [files.navigation], tmp_path, systems="GE", troposphere=False, ionosphere=False
    )
    truth = {epoch.key: epoch.truth.position_m for epoch in world}
    assert len(positions["key"]) == len(world)
    errors = np.array([xyz - truth[int(key)] for key, xyz in zip(positions["key"], positions["xyz_m"], strict=True)])
    assert np.abs(errors).max() < 0.05
    assert np.median(positions["n_sats"]) >= 16  # both systems


ORBITS = {
    "YUMA": ({"almanac": "almanacs/test_input_yuma377.txt"}, "G", None, 0.05),
    "SEM": ({"almanac": "almanacs/test_input_sem387.txt"}, "G", None, 0.05),
    # Recorded records follow one another, decimetres apart, and RTKLIB may take the one before or after the truth.
    "RINEX 2": ({"navigation": "static_pair_L1L2_1h_2010/brdc0770.10n.gz"}, "G", (1575, 363_600.0), 1.0),
    "RINEX 3": ({"navigation": "static_pair_L1L5_2024/base.nav.gz"}, "GE", (2320, 116_400.0), 1.0),
    "RINEX 4": ({"navigation": "nav_rinex4_2026/BRD400DLR_S_20260680000_01D_MN.rnx.gz"}, "GE", (2409, 129_600.0), 1.0),
}


@pytest.mark.parametrize("source", ORBITS)
def test_rtklib_finds_the_aircraft_with_any_source_of_orbits(tmp_path, data_dir, source):
    rtklib = pytest.importorskip("rtklib_dgnss")
    files, systems, start, bound_m = ORBITS[source]
    start = {} if start is None else {"start_week": start[0], "start_tow_s": start[1]}
    orbits = {key: str(data_dir / name) for key, name in files.items()}
    world = opened(constellation=orbits, systems=systems, interval_s=10.0, duration_s=40.0, **start, **NOTHING)
    made = export(world, tmp_path / "files")
    positions = rtklib.rtklib_positions(
        None, made.observations[-1], [made.navigation], tmp_path, systems=systems, troposphere=False, ionosphere=False
    )
    truth = {epoch.key: epoch.truth.position_m for epoch in world}
    errors = np.array([xyz - truth[int(key)] for key, xyz in zip(positions["key"], positions["xyz_m"], strict=True)])
    assert len(errors) == len(world)
    assert np.abs(errors).max() < bound_m
    assert np.median(positions["n_sats"]) >= 7


# --- files


def test_files_read_back_to_the_digit(tmp_path):
    slip = {"kind": "cycle_slip", "satellite": "G08", "start_s": 4.0, "cycles_l1": 7, "flagged": True}
    world = opened(duration_s=10.0, threats={"slip": slip})
    files = export(world, tmp_path)
    assert [path.name for path in files.observations] == ["rr1.obs", "rr2.obs", "rr3.obs", "rr4.obs", "airborne.obs"]
    digits = np.vectorize(lambda value: float(f"{value:.3f}"))
    wavelength = WAVELENGTH_M[:, np.newaxis]
    for row, path in enumerate(files.observations):
        read = read_observations(path)
        assert not read.notes
        assert len(read) == len(world)
        for number in (0, 8, 20):
            own, back = world.epoch(number), read.epoch(number)
            made = (*own.ground, own.airborne)[row]
            for name in ("code_m", "doppler_hz", "cn0_dbhz"):
                np.testing.assert_array_equal(getattr(back, name), digits(getattr(made, name)), err_msg=name)
            np.testing.assert_array_equal(back.carrier_m, digits(made.carrier_m / wavelength) * wavelength)
            np.testing.assert_array_equal(back.lli, made.lli)
    assert made.lli.shape == back.lli.shape
    assert world.epoch(8).airborne.lli[L1, SAT_INDEX["G08"]] == 1.0


def test_navigation_reads_back(tmp_path):
    world = opened(duration_s=10.0)
    files = export(world, tmp_path)
    (back,) = read_navigation([files.navigation]).received(world.params.start_week, world.params.start_tow_s)
    assert (back.gps_week, back.tow_s) == (world.ephemeris.gps_week, world.ephemeris.tow_s)
    for name in ("iod", "toe_tow_s", "sqrt_a", "m0_rad", "omega0_rad", "af0_s", "af1_sps", "group_delay_s", "health"):
        # Thirteen digits: D19.12.
        np.testing.assert_allclose(getattr(back, name), getattr(world.ephemeris, name), rtol=1e-12, err_msg=name)


def test_files_say_that_they_are_simulated(tmp_path):
    files = export(opened(duration_s=1.0), tmp_path)
    for path in (*files.observations, files.navigation, files.truth):
        assert LABEL in path.read_text()
    _, names, *lines = files.truth.read_text().splitlines()
    assert names.endswith("height_m,roll_deg,pitch_deg,heading_deg,simulated")
    assert all(line.endswith(",1") and line.count(",") == names.count(",") for line in lines)
    # The course of the approach; meridians of the start, 40 km away, and of the threshold are half a degree apart.
    assert [float(each) for each in lines[0].split(",")[-4:-1]] == pytest.approx([0.0, 0.0, 264.73], abs=0.6)
    assert read_observations(files.observations[0]).epoch(0).simulated == 1.0
    assert all(each.simulated == 1.0 for each in read_navigation([files.navigation]).received(2400, 216_000.0))


def test_files_are_clean(tmp_path):
    """In the eyes of the parser's own inspection."""
    import sidereon

    files = export(opened(duration_s=5.0), tmp_path)
    assert not sidereon.lint_rinex_obs(files.observations[0].read_text()).findings
    assert not sidereon.lint_rinex_nav(files.navigation.read_text()).findings


def digests(scenario: str, folder: str) -> dict[str, str]:
    """Digests of a scenario's files; in the module, so that another process can make them."""
    whole = read_sections(scenario)
    world = World(scenario_from_mapping({**whole, "sim": {**whole["sim"], "duration_s": 20.0}}))
    export(world, Path(folder))
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(Path(folder).iterdir())}


@pytest.mark.parametrize("name", ["receiver_fault.yaml", "scintillation.yaml"])
def test_the_same_files_from_another_process(tmp_path, name):
    scenario = next(str(path) for path in SCENARIOS if path.name == name)
    here = digests(scenario, str(tmp_path / "here"))
    assert len(here) == 7
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        there = pool.starmap(digests, [(scenario, str(tmp_path / place)) for place in ("one", "two")])
    assert there == [here, here]


def test_epochs_do_not_depend_on_what_was_asked_before():
    """Of a world with everything in it; every other epoch, backwards, in a world that is new each time."""
    path = next(path for path in SCENARIOS if path.stem == "scintillation")
    frozen = {"kind": "frozen", "receiver": "rr2", "start_s": 6.0, "end_s": 9.0}
    whole = read_sections(path)
    params = scenario_from_mapping({**whole, "sim": {**whole["sim"], "threats": {"frozen": frozen}}})
    forward = [epoch for _, epoch in zip(range(24), World(params), strict=False)]
    for number in (23, 15, 13, 2, 0):
        alone = World(params).epoch(number)
        pairs = zip((*alone.ground, alone.airborne), (*forward[number].ground, forward[number].airborne), strict=True)
        for first, second in pairs:
            for name in FIELDS:
                np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


# --- the library


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_library(path):
    """Every scenario is read by all its nodes, and its first seconds are as they should be."""
    config = read_run_config(path)
    assert len(config.drivers) == 1
    whole = read_sections(path)
    GroundParams.from_mapping(whole["ground"])
    world = world_from_yaml(path)
    assert (world.params.flight is None) == ("airborne" not in whole)
    for number in range(6):
        epoch = world.epoch(number)
        assert len(epoch.ground) == 4
        for observations in (*epoch.ground, *(() if epoch.airborne is None else (epoch.airborne,))):
            assert observations.simulated == 1.0
            assert np.isfinite(observations.code_m[L1]).sum() >= 5


def test_eleven_scenarios():
    assert len(SCENARIOS) == 11


# --- threats show in the output


def test_divergence_shows():
    """Code less carrier of the satellite grows at the rate asked for, on L1 alone; the others' does not."""
    fault = {"kind": "divergence", "satellite": "G08", "mode": "Code L1", "ramp_mps": 0.02, "start_s": 10.0}
    world = opened(threats={"fault": fault}, **NOTHING)
    before, after = (values(world, number, "code_m") - values(world, number) for number in (20, 120))  # 50 s apart
    grown = after - before
    expected = np.zeros_like(grown)
    expected[:, L1, SAT_INDEX["G08"]] = 0.02 * 50.0
    known = np.isfinite(grown)
    np.testing.assert_allclose(grown[known], expected[known], atol=1e-6)  # 2e7 m keep 4 nm


def test_gradient_of_a_front_shows_between_two_receivers():
    """Single difference of carriers with the front less that without it: the gradient times the distance."""
    wedge = {
        "kind": "front", "gradient": 400e-6, "width_m": 100_000.0, "direction_deg": 90.0, "start_m": -50_000.0,
        "reference": "baseline",
    }  # fmt: skip
    with_front, without = opened(threats={"wedge": wedge}, **NOTHING), opened(**NOTHING)
    delay = -(values(with_front, 0) - values(without, 0))  # the carrier is advanced
    station = with_front.params.station
    east_m = (np.array(with_front.params.receiver_ecef_m) - station.position_m) @ station.axes[0]
    for band in (L1, L5):
        seen = np.isfinite(delay[:4, band]).all(axis=0)
        for first, second in ((0, 1), (0, 2), (1, 3)):
            difference = (delay[first, band] - delay[second, band])[seen]
            expected = 400e-6 * IONO_RATIO[band] * (east_m[first] - east_m[second])
            np.testing.assert_allclose(difference, expected, atol=1e-6)  # 2e7 m keep 4 nm
            assert abs(expected) > 0.05
    codes = values(with_front, 0, "code_m") - values(without, 0, "code_m")
    known = np.isfinite(codes)
    np.testing.assert_allclose(codes[known], delay[known], atol=1e-6)


def smoothed(code_m: np.ndarray, carrier_m: np.ndarray, weight: float) -> np.ndarray:
    """Carrier-smoothed codes, the filter written out; time is the first axis."""
    result = np.empty_like(code_m)
    result[0] = code_m[0]
    for now in range(1, len(code_m)):
        predicted = result[now - 1] + carrier_m[now] - carrier_m[now - 1]
        result[now] = weight * code_m[now] + (1.0 - weight) * predicted
    return result


def test_a_stationary_front_and_an_approaching_aircraft():
    """Observations of both ends: g (x + 2 tau v) after 100 s and 30 s of smoothing, 2 g v between code and carrier."""
    gradient, interval_s = 300e-6, 1.0
    front = {"kind": "front", "gradient": gradient, "width_m": 160_000.0, "direction_deg": 264.73, "start_m": -90_000.0,
             "reference": "baseline"}  # fmt: skip
    with_front, without = (opened(interval_s=interval_s, **more, **NOTHING) for more in ({"threats": {"a": front}}, {}))
    numbers = range(len(without))
    there, quiet = (observed(world, numbers) for world in (with_front, without))
    satellite = SAT_INDEX["G08"]
    code_m, carrier_m = (
        (getattr(there, name) - getattr(quiet, name))[:, :, L1, satellite] for name in ("code_m", "carrier_m")
    )
    flight, station = without.params.flight, without.params.station
    towards = station.towards(math.radians(264.73))
    position_m, velocity_mps = flight.state(there.since_start_s)
    away_m = (np.array(without.params.receiver_ecef_m[0]) - position_m) @ towards
    speed_mps = velocity_mps @ towards
    divergence_mps = np.diff(code_m[:, -1] - carrier_m[:, -1]) / interval_s
    # A micrometre from the rounding of 2e7 m.
    np.testing.assert_allclose(divergence_mps, 2.0 * gradient * 0.5 * (speed_mps[1:] + speed_mps[:-1]), atol=1e-6)
    assert abs(divergence_mps[-1] - 0.042) < 1e-4
    errors = {}
    for tau_s in (100.0, 30.0):
        weight = interval_s / tau_s
        errors[tau_s] = np.diff(smoothed(code_m, carrier_m, weight)[:, [0, -1]], axis=1)[:, 0]
        filled = 1.0 - (1.0 - weight) ** np.arange(len(away_m))
        expected = -gradient * (away_m + 2.0 * (tau_s - interval_s) * speed_mps * filled)
        # Over the length of the filter the speed changes by the descent's 0.14 %, and the plane turns under it.
        np.testing.assert_allclose(errors[tau_s][200:], expected[200:], atol=0.01)
    separation_m = errors[30.0][-1] - errors[100.0][-1]
    assert separation_m == pytest.approx(2.0 * 70.0 * gradient * 70.0, abs=0.02)  # 2.94 m


def test_the_ionosphere_is_opposite_on_code_and_carrier_and_scaled_by_frequency():
    quiet, without = opened(ionosphere={"sigma_vig": 4e-6}, **NOTHING), opened(**NOTHING)
    code = values(quiet, 100, "code_m") - values(without, 100, "code_m")
    carrier = values(quiet, 100) - values(without, 100)
    known = np.isfinite(code)
    assert known[:, L1].sum() > 60
    np.testing.assert_allclose(code[known], -carrier[known], atol=1e-7)
    seen = known[:, L1] & known[:, L5]
    ratio = (1575.42 / 1176.45) ** 2
    np.testing.assert_allclose(code[:, L5][seen], ratio * code[:, L1][seen], atol=1e-7)
    # 1.5 to 6 m at the zenith, up to three times that at the horizon.
    assert 1.0 < code[:, L1][seen].min() < code[:, L1][seen].max() < 20.0


def test_dopplers_are_rates_of_carriers_with_everything_on():
    threats = {
        "wedge": {"kind": "front", "gradient": 300e-6, "width_m": 200_000.0, "direction_deg": 45.0, "speed_mps": 300.0,
                  "start_m": -100_000.0},
        "ramp": {"kind": "divergence", "satellite": "G08", "mode": "Carrier L1", "ramp_mps": 0.5, "start_s": 0.0},
        "clock": {"kind": "clock", "satellite": "G01", "ramp_sps": 1e-9, "start_s": 0.0},
        "orbit": {"kind": "orbit", "satellite": "G21", "along_mps": 20.0, "start_s": 0.0},
        "wall": {"kind": "weather", "excess_refractivity": 30.0, "start_m": 100_000.0, "speed_mps": 20.0},
    }  # fmt: skip
    air = {"refractivity": 379.0, "reference_height_m": 130.0}
    world = opened(threats=threats, ionosphere={"sigma_vig": 4e-6}, troposphere=air, interval_s=0.1, **IDEAL)
    before, after = values(world, 499), values(world, 501)
    doppler = values(world, 500, "doppler_hz")
    expected = -(after - before) / 0.2 / WAVELENGTH_M[:, np.newaxis]
    known = np.isfinite(expected)
    # Third derivatives times 0.01 s^2 / 6 and 4 nm of rounding over 0.2 s; the orbit's own axes turn: 1 mm/s.
    np.testing.assert_allclose(doppler[known], expected[known], atol=5e-3)


def test_an_outage_of_l5_shows_as_lost_and_found():
    lost = {"kind": "loss_of_lock", "satellite": "G08", "bands": ["L5"], "start_s": 5.0, "end_s": 8.0}
    world = opened(threats={"lost": lost})
    place = SAT_INDEX["G08"]
    for number in range(8, 20):
        observations = world.epoch(number).ground[1]
        there = not 10 <= number < 16
        assert np.isfinite(observations.code_m[L5, place]) == there
        assert np.isfinite(observations.code_m[L1, place])
        assert np.isnan(observations.lli[L5, place]) == (not there)
        if there:
            assert observations.lli[L5, place] == float(number == 16)


def test_a_frozen_receiver_repeats_itself():
    world = opened(threats={"stuck": {"kind": "frozen", "receiver": "rr3", "start_s": 5.0, "end_s": 7.0}})
    last = world.epoch(9).ground[2]
    for number in range(10, 14):
        now = world.epoch(number)
        np.testing.assert_array_equal(now.ground[2].code_m, last.code_m)
        assert now.ground[2].tow_s == now.ground[0].tow_s
        assert not np.array_equal(now.ground[0].code_m, world.epoch(9).ground[0].code_m)
    assert not np.array_equal(world.epoch(14).ground[2].code_m, last.code_m)


def test_a_clock_jump_moves_all_of_one_receiver():
    jump = {"kind": "clock_jump", "receiver": "rr2", "milliseconds": 1, "start_s": 5.0}
    jumped, steady = opened(threats={"jump": jump}, **NOTHING), opened(**NOTHING)
    moved = values(jumped, 20) - values(steady, 20)
    assert np.nanmax(np.abs(moved[[0, 2, 3, 4]])) == 0.0
    # A millisecond of light less what the satellites (at most 900 m/s) moved meanwhile.
    np.testing.assert_allclose(moved[1][np.isfinite(moved[1])], 299_792.458, atol=1.0)


def test_an_ephemeris_fault_is_broadcast():
    fault = {"kind": "broadcast", "satellite": "G06", "field": "m0_rad", "change": 1e-4, "start_s": 60.0}
    world = opened(threats={"upload": fault})
    first, second = world.ephemerides
    place = SAT_INDEX["G06"]
    assert second.m0_rad[place] == first.m0_rad[place] + 1e-4
    assert second.iod[place] != first.iod[place]
    assert np.isnan(second.iod[SAT_INDEX["G08"]])
    np.testing.assert_array_equal(values(world, 200), values(opened(), 200))


# --- bad scenarios


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"threats": {"a": {"kind": "fron"}}},
            r"sim\.threats\.a\.kind = 'fron' is not one of front, bubble, weather, building, ",
        ),
        (
            {"threats": {"a": {"kind": "front", "gradient": 3e-4, "width_m": -1.0}}},
            r"sim\.threats\.a\.width_m = -1 is not within",
        ),
        ({"threats": {"a": {"kind": "front", "width_m": 5e4}}}, r"sim\.threats\.a\.gradient is missing"),
        (
            {"threats": {"a": {"kind": "front", "gradient": 3e-4, "width": 1.0}}},
            r"sim\.threats\.a\.width is unknown; did you mean 'width_m'\?",
        ),
        (
            {"threats": {"a": {"kind": "low_power", "satellite": "G30", "drop_db": 9.0, "start_s": 5.0}}},
            r"fault low_power: satellite = 'G30' is not up between 5 and 586\.",
        ),
        (
            {"threats": {"a": {"kind": "low_power", "satellite": "G08", "drop_db": 9.0, "start_s": 900.0}}},
            r"fault low_power: start_s = 900 is after the end of the run",
        ),
        (
            {"threats": {"a": {"kind": "frozen", "receiver": "rr9", "start_s": 5.0}}},
            r"sim\.threats\.a\.receiver = 'rr9' is not one of rr1, rr2, rr3, rr4, airborne",
        ),
        (
            {"threats": {"a": {"kind": "frozen", "receiver": "airborne", "start_s": 5.0}}, "aircraft": False,
             "duration_s": 60.0},
            r"fault frozen: receiver 'airborne' is not there; there are rr1, rr2, rr3, rr4",
        ),
        ({"systems": "R"}, r"sim\.systems = 'R' is not one of G, E, GE, EG"),
        ({"threats": 3}, r"sim\.threats = 3 is not a section"),
        ({"flight": ["climb"]}, r"sim\.flight = \['climb'\] is not a section"),
        ({"ionosphere": {"sigma": 1.0}}, r"sim\.ionosphere\.sigma is unknown"),
        ({"ionosphere": {"sigma_vig": -1.0}}, r"sim\.ionosphere\.sigma_vig = -1 is not within"),
        ({"scintillation": {"equatorial_s4": 2.0}}, r"sim\.scintillation\.equatorial_s4 = 2 is not within 0 to 1"),
        (
            {"ground_receiver": {"preset": "gad_z"}},
            r"sim\.ground_receiver\.preset = 'gad_z' is not one of gad_a, .*aad_b, ideal",
        ),
        (
            {"airborne_receiver": {"preset": "aad_b", "cn0": {"antena": "patch"}}},
            r"sim\.airborne_receiver\.cn0\.antena is unknown; did you mean 'antenna'",
        ),
        (
            {"airborne_receiver": {"preset": "aad_b", "cn0": {"antenna": "dish"}}},
            r"sim\.airborne_receiver.*antenna = 'dish' is not one of isotropic, mla, patch, fighter",
        ),
        (
            {"ground_receiver": {"preset": "gad_c", "noise_scale": 0.0}},
            r"sim\.ground_receiver\.noise_scale is unknown; known are .*preset",
        ),
        ({"constellation": {"rinex": "a"}}, r"sim\.constellation\.rinex is unknown; known are almanac, navigation"),
        ({"constellation": {"almanac": "none.alm"}}, r"none\.alm"),
        ({"aircraft": False}, r"duration_s is missing, and there is no flight"),
        ({"duration_s": 5000.0}, r"duration_s = 5000 is longer than the flight"),
        (
            {"ground": {"receivers": {"rr1_ecef_m": [3840619.0, 815604.0, 5024909.0]}}},
            r"receiver_ecef_m of receiver 1 is 100\d\d\d m from the station, more than 20000",
        ),
    ],
)  # fmt: skip
def test_refused(changes, message):
    with pytest.raises(ScenarioError, match=rf"^here\.yaml: .*{message}") as refusal:
        open_world(scenario_from_mapping(sections(**changes), source="here.yaml"), source="here.yaml")
    assert "\n" not in str(refusal.value)


def test_files_based_on_others(tmp_path):
    (tmp_path / "low.yaml").write_text("ground: {station: {id: AAAA, gcid: 1}}\nsim: {seed: 1, systems: G}\n")
    (tmp_path / "middle.yaml").write_text("base: low.yaml\nsim: {seed: 2}\nairborne: {service: C}\n")
    (tmp_path / "top.yaml").write_text("base: middle.yaml\nground: {station: {id: BBBB}}\nsim: {systems: null}\n")
    assert read_sections(tmp_path / "top.yaml") == {
        "ground": {"station": {"id": "BBBB", "gcid": 1}},
        "sim": {"seed": 2},
        "airborne": {"service": "C"},
    }
    (tmp_path / "low.yaml").write_text("base: top.yaml\n")
    with pytest.raises(ScenarioError, match="files are based on each other"):
        read_sections(tmp_path / "top.yaml")
    (tmp_path / "top.yaml").write_text("base: none.yaml\n")
    with pytest.raises(ScenarioError, match="none.yaml: cannot be read"):
        read_sections(tmp_path / "top.yaml")


# --- long runs


@pytest.mark.campaign
def test_a_day_takes_no_more_memory_than_an_hour():
    """Allocations after 300 epochs and after as many more, spread over the day; less than 1 MB is kept between."""
    path = next(path for path in SCENARIOS if path.stem == "station_day")
    world = world_from_yaml(path)
    step = len(world) // 600
    tracemalloc.start()
    for number in range(0, 300 * step, step):
        world.epoch(number)
    before, _ = tracemalloc.get_traced_memory()
    for number in range(300 * step, 600 * step, step):
        world.epoch(number)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 1e6


def test_satellites_rise_and_set_in_a_day():
    path = next(path for path in SCENARIOS if path.stem == "station_day")
    world = world_from_yaml(path)
    seen = np.array([np.isfinite(world.epoch(number).ground[0].code_m[L1]) for number in range(0, len(world), 900)])
    assert len(seen) == 49  # one each half hour, both ends
    assert seen.any(axis=0).sum() >= 44  # nearly all of 48 pass over a place at 52 degrees within a day
    assert not seen.all(axis=0).any()
    assert seen.sum(axis=1).min() >= 10
