"""Scenarios from configuration files: what is read, and what is refused with one clear line."""

from __future__ import annotations

import copy
import math

import pytest
import yaml

from gbas_sim.scenario import ScenarioError, scenario_from_mapping, scenario_from_yaml

SITE = {
    "ground": {
        "station": {"id": "EDVE"},
        "receivers": {
            "rr1_ecef_m": [3840619.039, 715604.228, 5024909.863],
            "rr2_ecef_m": [3840835.113, 714861.969, 5024848.587],
            "minimum": 2,
        },
        "approaches": {
            "rwy26": {
                "ltp_latitude_deg": 52.3209, "ltp_longitude_deg": 10.567, "ltp_height_m": 133.0, "course_deg": 264.73,
                "fpap_distance_m": 2300.0, "tch_m": 15.0, "gpa_deg": 3.0, "fasval_m": 10.0, "faslal_m": 40.0,
            }
        },
    }
}  # fmt: skip


def site(**sim):
    return copy.deepcopy(SITE) | ({"sim": sim} if sim else {})


def test_a_site_alone_is_a_scenario():
    world = scenario_from_mapping(SITE)
    assert world.receiver_ecef_m[1] == (3840835.113, 714861.969, 5024848.587)
    assert math.degrees(world.flight.approach.gpa_rad) == pytest.approx(3.0)
    assert world.systems == "GE"
    assert world.troposphere.refractivity == 0.0


def test_the_air_is_the_stations_unless_told_otherwise():
    station = site()
    station["ground"]["atmosphere"] = {"refractivity": 379.0, "scale_height_m": 8000, "refractivity_uncertainty": 20.0}
    station["ground"]["station"]["height_m"] = 130.0
    air = scenario_from_mapping(station).troposphere
    assert (air.refractivity, air.scale_height_m, air.reference_height_m) == (379.0, 8000.0, 130.0)
    other = scenario_from_mapping({**station, "sim.troposphere.refractivity": 300.0}).troposphere
    assert (other.refractivity, other.scale_height_m) == (300.0, 8000.0)


def test_everything_under_sim_is_read():
    world = scenario_from_mapping(
        site(
            systems="G",
            start_week=2401,
            start_tow_s=10,
            interval_s=1.0,
            seed=7,
            approach="rwy26",
            flight={"speed_mps": 60.0, "level_time_s": 10.0, "intercept_distance_m": 9000.0, "pushover_time_s": 15.0},
            ground_receiver={"elevation_mask_deg": 4.0, "cn0_zenith_dbhz": [51, 53.0], "noise_scale": 0},
            airborne_receiver={"clock_drift": 0.0},
        )
    )
    assert (world.systems, world.start_week, world.start_tow_s, world.interval_s, world.seed) == (
        "G",
        2401,
        10.0,
        1.0,
        7,
    )
    assert (world.flight.speed_mps, world.flight.level_time_s) == (60.0, 10.0)
    assert (world.flight.intercept_distance_m, world.flight.pushover_time_s) == (9000.0, 15.0)
    assert world.ground.elevation_mask_rad == pytest.approx(math.radians(4.0))
    assert (world.ground.cn0_zenith_dbhz, world.ground.noise_scale) == ((51.0, 53.0), 0.0)
    assert world.airborne.clock_drift == 0.0
    assert world.airborne.cn0_zenith_dbhz == (48.0, 50.0)  # the airborne receiver's own default


def test_dotted_keys_and_files_say_the_same(tmp_path):
    nested = site(seed=3, flight={"speed_mps": 65.0})
    file = tmp_path / "site.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": nested}}))
    plain = tmp_path / "plain.yaml"
    plain.write_text(yaml.safe_dump(nested))

    def flat(mapping, prefix=""):
        for key, value in mapping.items():
            if isinstance(value, dict):
                yield from flat(value, f"{prefix}{key}.")
            else:
                yield f"{prefix}{key}", value

    worlds = [
        scenario_from_mapping(nested),
        scenario_from_mapping(dict(flat(nested))),
        scenario_from_yaml(file),
        scenario_from_yaml(plain),
    ]
    assert all(world == worlds[0] for world in worlds)
    assert worlds[0].seed == 3


@pytest.mark.parametrize(
    ("sim", "message"),
    [
        ({"sead": 1}, r"sim\.sead is unknown; did you mean 'seed'\?"),
        ({"seed": 1.5}, r"sim\.seed = 1\.5 is not a whole number"),
        ({"seed": True}, r"sim\.seed = True is not a whole number"),
        ({"flight": {"sped": 1.0}}, r"sim\.flight\.sped is unknown"),
        ({"flight": {"speed_mps": "fast"}}, r"sim\.flight\.speed_mps = 'fast' is not a number"),
        ({"flight": {"speed_mps": 500.0}}, r"sim\.flight\.speed_mps = 500 is not within 10 to 200 m/s"),
        (
            {"ground_receiver": {"noise_scale": -1.0}},
            r"sim\.ground_receiver\.noise_scale = -1 is not within 0 to 100",
        ),
        (
            {"airborne_receiver": {"spacing_chips": [0.1]}},
            r"sim\.airborne_receiver\.spacing_chips = \(0\.1,\) has not the right number of values",
        ),
        ({"airborne_receiver": {"elevation_mask_rad": 0.1}}, r"elevation_mask_rad is unknown"),
        ({"troposphere": {"humidity": 1.0}}, r"sim\.troposphere\.humidity is unknown"),
        (
            {"troposphere": {"refractivity": -1.0}},
            r"sim\.troposphere\.refractivity = -1 is not within 0 to 800 N units",
        ),
        ({"approach": "rwy08"}, r"sim\.approach = 'rwy08' is not one of rwy26"),
    ],
)
def test_refused(sim, message):
    with pytest.raises(ScenarioError, match=f"parameters: .*{message}"):
        scenario_from_mapping(site(**sim))


def test_sites_that_cannot_be_flown():
    several = site()
    several["ground"]["approaches"]["rwy08"] = SITE["ground"]["approaches"]["rwy26"]
    with pytest.raises(ScenarioError, match=r"sim\.approach is missing; the station has rwy08, rwy26"):
        scenario_from_mapping(several)
    without = site()
    del without["ground"]["approaches"]
    with pytest.raises(ScenarioError, match=r"ground\.approaches is missing"):
        scenario_from_mapping(without)
    bad = site()
    bad["ground"]["approaches"]["rwy26"]["gpa_deg"] = "steep"
    with pytest.raises(ScenarioError, match=r"ground\.approaches\.rwy26: gpa_deg = 'steep' is not a number"):
        scenario_from_mapping(bad)
    nobody = site()
    nobody["ground"]["receivers"] = {"minimum": 2}
    with pytest.raises(ScenarioError, match=r"ground\.receivers\.rr1_ecef_m is missing"):
        scenario_from_mapping(nobody)
    words = site()
    words["ground"]["receivers"]["rr1_ecef_m"] = "here"
    with pytest.raises(ScenarioError, match=r"ground\.receivers\.rr1_ecef_m = 'here' is not a list"):
        scenario_from_mapping(words)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ScenarioError, match="missing.yaml: cannot be read"):
        scenario_from_yaml(tmp_path / "missing.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("a: [1")
    with pytest.raises(ScenarioError, match="broken.yaml: is not YAML"):
        scenario_from_yaml(broken)
    empty = tmp_path / "empty.yaml"
    empty.write_text("")
    with pytest.raises(ScenarioError, match="empty.yaml: holds no sections of parameters"):
        scenario_from_yaml(empty)
