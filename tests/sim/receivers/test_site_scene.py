"""The scene of a site in the world: what rays say is in the observations of the reference receivers, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.positioning.approach import FinalApproach
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.rays import Scene, ray_errors
from gbas_core.signal.tracking_loops import TrackingParams
from gbas_core.signals import L1, L5
from gbas_sim.flight.straight_in import StraightIn
from gbas_sim.receivers.oscillators import OSCILLATORS
from gbas_sim.receivers.receiver_model import IDEAL
from gbas_sim.receivers.site_scene import Building, SceneParams
from gbas_sim.scenario import ScenarioError, scenario_from_mapping
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams

SITES = ((3840619.039, 715604.228, 5024909.863), (3840835.113, 714861.969, 5024848.587))
APPROACH = FinalApproach.from_course(
    ltp_lat_rad=math.radians(52.3209),
    ltp_lon_rad=math.radians(10.567),
    ltp_height_m=133.0,
    course_rad=math.radians(264.73),
    fpap_distance_m=2300.0,
    tch_m=15.0,
    gpa_rad=math.radians(3.0),
)
SCENE = SceneParams(ground="wet_ground", antenna="patch", antenna_height_m=2.0)


def params(**changes) -> WorldParams:
    flight = StraightIn(approach=APPROACH, intercept_distance_m=12_000.0, level_time_s=20.0)
    values = {"receiver_ecef_m": SITES, "flight": flight, "ground": IDEAL, "airborne": IDEAL}
    return WorldParams(**(values | changes))


@pytest.fixture(scope="module")
def plain() -> World:
    return World(params())


def local_directions(world: World, number: int) -> np.ndarray:
    """Unit vectors (1, 3, N_SATS) from the first receiver, east, north, up, by the suite's orbit code."""
    epoch = world.epoch(number).ground[0]
    position = np.array(SITES[0])
    state = predicted_state(world.ephemeris, epoch.gps_week, epoch.tow_s, position)
    _, los = rotated_range(position, state.position_m)
    latitude, longitude, _ = geodetic_from_ecef(position)
    return (rot_enu_ecef(latitude, longitude) @ los)[np.newaxis]


def test_ground_reflections_are_in_the_reference_receivers_observations(plain):
    world = World(params(scene=SCENE))
    with_scene, without = world.epoch(20), plain.epoch(20)
    rays = Scene(ground="wet_ground").trace(np.array([[0.0, 0.0, 2.0]]), local_directions(plain, 20), ANTENNAS["patch"])
    expected = ray_errors(rays, TrackingParams().spacing_chips)
    observed, clean = with_scene.ground[0], without.ground[0]
    seen = np.isfinite(clean.code_m[L1]) & np.isfinite(observed.code_m[L1])
    assert seen.sum() > 10
    for band in (L1, L5):
        # Directions differ by microradians, paths of 4 m by 1e-5 m, phases by 1e-4 cycles.
        change = (observed.code_m - clean.code_m)[band, seen]
        np.testing.assert_allclose(change, expected.code_m[0, band, seen], atol=2e-3)
        carrier = (observed.carrier_m - clean.carrier_m)[band, seen]
        np.testing.assert_allclose(carrier, expected.carrier_m[0, band, seen], atol=1e-4)
        power = (observed.cn0_dbhz - clean.cn0_dbhz)[band, seen]
        np.testing.assert_allclose(power, expected.cn0_db[0, band, seen], atol=0.01)
    assert np.abs(expected.code_m[0, L1, seen]).max() > 0.05
    for name in ("code_m", "carrier_m", "cn0_dbhz"):
        np.testing.assert_array_equal(getattr(with_scene.airborne, name), getattr(without.airborne, name))


def test_errors_stay_with_the_satellites_and_come_back_in_any_order(plain):
    world = World(params(scene=SCENE))
    first, later = world.epoch(10), world.epoch(12)
    seen = np.isfinite(first.ground[0].code_m[L1]) & np.isfinite(later.ground[0].code_m[L1])
    changes = [
        each.ground[0].carrier_m[L1, seen] - plain.epoch(number).ground[0].carrier_m[L1, seen]
        for number, each in ((10, first), (12, later))
    ]
    # The sine of the elevation changes by 1e-4 in a second, the path by 0.5 mm, the carrier's error by less.
    assert np.abs(changes[1] - changes[0]).max() < 5e-4
    again = World(params(scene=SCENE))
    again.epoch(25)
    np.testing.assert_array_equal(again.epoch(10).ground[1].code_m, first.ground[1].code_m)


def test_a_building_hides_satellites_from_the_receiver_beside_it(plain):
    """A wall 200 m long and 60 m high, 20 m south of the first receiver: up to 55 degrees within 60 of the south."""
    building = Building(east_m=0.0, north_m=-30.0, length_m=20.0, width_m=200.0, height_m=60.0)
    world = World(params(buildings=(building,)))
    east, north, up = local_directions(plain, 20)[0]
    azimuth = np.arctan2(east, north)
    hidden = (np.abs(azimuth) > math.radians(120.0)) & (up < math.sin(math.radians(55.0))) & (up > 0.1)
    free = (np.abs(azimuth) < math.radians(80.0)) & (up > 0.1)
    observed = world.epoch(20)
    assert hidden.sum() >= 2
    assert free.sum() > 2
    assert np.isnan(observed.ground[0].code_m[:, hidden]).all()
    assert np.isfinite(plain.epoch(20).ground[0].code_m[L1, hidden]).all()
    assert np.isfinite(observed.ground[0].code_m[L1, free]).all()
    # 750 m away it is a small thing on the horizon.
    second = np.isfinite(observed.ground[1].code_m[L1]) == np.isfinite(plain.epoch(20).ground[1].code_m[L1])
    assert second.all()


# --- keys


BASE = yaml.safe_load("""
ground:
  receivers: {rr1_ecef_m: [3840619.039, 715604.228, 5024909.863]}
sim:
  aircraft: false
  duration_s: 5.0
""")


def scenario(**sim) -> WorldParams:
    return scenario_from_mapping({**BASE, "sim": {**BASE["sim"], **sim}})


def test_scene_and_buildings_from_keys():
    hangar = {"kind": "building", "east_m": 90, "north_m": 40.0, "length_m": 60.0, "width_m": 40.0, "height_m": 15.0}
    world = scenario(
        scene={"ground": "wet_ground", "antenna_height_m": 4.0}, threats={"hangar": hangar | {"heading_deg": 30.0}}
    )
    assert world.scene == SceneParams(ground="wet_ground", antenna_height_m=4.0)
    (building,) = world.buildings
    assert building.east_m == 90.0
    assert building.heading_rad == pytest.approx(math.radians(30.0))
    assert world.scene.antenna == "mla"
    assert scenario().scene is None
    assert scenario(scene={}).scene is None  # a section without keys is as if it were left out
    assert len(World(world)) == 11


def test_preset_with_loops_and_clock_of_ones_own():
    world = scenario(
        ground_receiver={"preset": "gad_b", "tracking": {"spacing_chips": [0.2, 0.2, 1.0]}, "oscillator": "rubidium"}
    )
    assert world.ground.tracking.spacing_chips == (0.2, 0.2, 1.0)  # type: ignore[union-attr]
    assert world.ground.tracking.code_bandwidth_hz == TrackingParams().code_bandwidth_hz  # type: ignore[union-attr]
    assert world.ground.oscillator == OSCILLATORS["rubidium"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("sim", "message"),
    [
        ({"scene": {"ground": "marble"}}, "sim.scene.ground = 'marble' is not one of metal, concrete"),
        ({"scene": {"grass": 1}}, "sim.scene.grass is unknown; known are antenna, antenna_height_m, ground"),
        ({"scene": {"antenna_height_m": 0.0}}, "sim.scene.antenna_height_m = 0 is not within 0.1 to 100 m"),
        (
            {"threats": {"a": {"kind": "building", "east_m": 0.0, "north_m": 0.0, "length_m": 1.0, "width_m": 1.0}}},
            "sim.threats.a.height_m is missing",
        ),
        (
            {"ground_receiver": {"preset": "gad_b", "oscillator": "sundial"}},
            "sim.ground_receiver.oscillator = 'sundial' is not one of steady, tcxo",
        ),
        (
            {"ground_receiver": {"preset": "gad_b", "tracking": {"spacing": 0.1}}},
            "sim.ground_receiver.tracking.spacing is unknown",
        ),
    ],
)
def test_bad_keys_are_refused(sim, message):
    with pytest.raises(ScenarioError) as error:
        scenario(**sim)
    assert message in str(error.value)
