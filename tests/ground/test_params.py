"""Parameters of the ground station: refusals, files, and that leaving something out is never optimistic."""

from __future__ import annotations

import array
import math

import numpy as np
import pytest
import yaml

from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.parameters import ParameterError, declared
from gbas_ground.params import GroundParams
from gbas_ground.sections import GCID_UNHEALTHY
from gbas_vdb.messages.types import Type2
from ground_runs import params

RR1 = [3840619.039, 715604.228, 5024909.863]
MINIMAL = {
    "station": {"id": "EDVE", "latitude_deg": 52.32, "longitude_deg": 10.55, "height_m": 130.0},
    "receivers": {"rr1_ecef_m": RR1, "minimum": 1},
}


def changed(**sections):
    mapping = {name: dict(values) for name, values in MINIMAL.items()}
    for name, values in sections.items():
        mapping.setdefault(name, {}).update(values)
    return mapping


def test_smallest_configuration_claims_nothing():
    station = GroundParams.from_mapping(MINIMAL)
    message = station.station_message()
    assert message.gcid == GCID_UNHEALTHY
    # the largest values the fields can carry: ICAO Annex 10 vol. I, tables B-62 to B-66
    assert message.sigma_vert_iono_gradient == 25.5e-6
    assert message.refractivity_uncertainty == 255.0
    assert message.adb1.k_md_e_c_gps == 12.75
    assert (
        station.ephemeris.p == station.ephemeris.p_d == 0.0
    )  # no claim: one receiver's is the largest, test_orbit_claim
    assert station.accuracy.designator == "A"
    assert message.n_reference_receivers is None


def test_angles_are_degrees_in_files_only():
    station = GroundParams.from_mapping(changed(monitors={"elevation_mask_deg": 7.5}))
    assert station.station.latitude_rad == pytest.approx(math.radians(52.32), abs=1e-15)
    assert station.monitors.elevation_mask_rad == pytest.approx(math.radians(7.5), abs=1e-15)
    assert GroundParams.from_mapping(MINIMAL).monitors.elevation_mask_rad == pytest.approx(math.radians(5.0), abs=1e-15)


def test_dotted_keys_and_ros_arrays_mean_the_same():
    """A node gets flat names, and rclpy gives arrays as array.array."""
    nested = GroundParams.from_mapping(changed(smoothing={"tau_s": [50.0, 20.0]}))
    flat = {f"{section}.{key}": value for section, values in MINIMAL.items() for key, value in values.items()}
    flat |= {"receivers.rr1_ecef_m": array.array("d", RR1), "smoothing.tau_s": array.array("d", [50.0, 20.0])}
    assert GroundParams.from_mapping(flat) == nested


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        ({"station": {"id": "edve"}}, "station.id = 'edve'"),
        ({"power": {"exclude": False}}, "power is now called signal_power"),
        ({"gradient": {"range": [3e-4, 2e-3]}}, "gradient.range is now called ionosphere_gradient.gradient_range"),
        (
            {"expected_power": {"minimum_l1_dbhz": [30.0]}},
            "expected_power.minimum_l1_dbhz = (30.0,) is not one number a",
        ),
        ({"station": {"gcid": 5}}, "station.gcid = 5 is not one of 1, 2, 3, 4, 7"),
        ({"station": {"gcid": True}}, "station.gcid = True"),
        ({"station": {"latitude_deg": 91.0}}, "station.latitude_deg = 91 is not within -90 to 90 deg"),
        ({"station": {"latitude_deg": float("nan")}}, "station.latitude_deg = nan"),
        ({"station": {"height_m": "130 m"}}, "station.height_m = '130 m' is not a number"),
        ({"station": {"systems": "GR"}}, "station.systems = 'GR'"),
        ({"station": {"rsds": 49}}, "station.rsds = 49"),
        ({"accuracy": {"designator": "D"}}, "accuracy.designator = 'D'"),
        ({"accuracy": {"inflation": 0.9}}, "accuracy.inflation = 0.9 is not within 1 to 100"),
        ({"accuracy": {"sigma_m": [0.3]}}, "accuracy.sigma_elevation_deg and sigma_m are not lists of one length"),
        ({"accuracy": {"sigma_m": [0.3, 0.2], "sigma_elevation_deg": [5.0, 5.0]}}, "does not rise"),
        ({"accuracy": {"sigma_m": [0.3], "sigma_elevation_deg": [10.0]}}, "starts above monitors.elevation_mask_deg"),
        ({"ephemeris": {"p": "1e-4"}}, "ephemeris.p = '1e-4' is not a number"),
        ({"ephemeris": {"settle_s": 200.0}}, "ephemeris.settle_s = 200 is not within 0 to 180 s"),
        ({"correction_limits": {"max_prc_m": 400.0}}, "correction_limits.max_prc_m = 400 is not within 1 to 327.67 m"),
        ({"monitors": {"elevation_mask_deg": 4.9}}, "monitors.elevation_mask_deg = 4.9 is not within 5 to 60 deg"),
        ({"signal_power": {"require_cn0": 1}}, "signal_power.require_cn0 = 1 is not true or false"),
        (
            {"monitors": {"receiver_fault_channels": 2.5}},
            "monitors.receiver_fault_channels = 2.5 is not a whole number",
        ),
        ({"monitors": {"clock_weighting": "median"}}, "monitors.clock_weighting = 'median'"),
        ({"smoothing": {"tau_s": 100.0}}, "smoothing.tau_s = 100.0 is not a list"),
        ({"vdb": {"slots": "BA"}}, "vdb.slots = 'BA'"),
        ({"vdb": {"slots": ""}}, "vdb.slots = ''"),
        ({"receivers": {"minimum": 2}}, "receivers.minimum = 2 is more than the 1 receivers there are"),
        ({"receivers": {"rr3_ecef_m": RR1}}, "receivers.rr3_ecef_m has no place"),
        (
            {"receivers": {"rr2_ecef_m": [1.0, 2.0]}},
            "receivers.rr2_ecef_m = (1.0, 2.0) has not the right number of values",
        ),
        ({"receivers": {"rr2_ecef_m": [3840619.039, 715604.228, 5124909.863]}}, "from the reference point"),
        ({"receivers": {"rr2_ecef_m": [float("nan")] * 3}}, "receivers.rr2_ecef_m"),
        ({"carrier_noise": {"receiver_factor": [1.0, 2.0]}}, "one for each of the 1 receivers"),
        ({"carrier_noise": {"receiver_factor": []}}, "carrier_noise.receiver_factor = ()"),
        (
            {"carrier_noise": {"receiver_factor": [0.05]}},
            "carrier_noise.receiver_factor = 0.05 is not within 0.1 to 10",
        ),
        ({"carrier_noise": {"receiver_factor": [11.0]}}, "carrier_noise.receiver_factor = 11 is not within 0.1 to 10"),
        ({"carrier_noise": {"receiver_factor": [float("nan")]}}, "carrier_noise.receiver_factor = nan"),
        (
            {"carrier_noise": {"floor_m": [0.001]}},
            "carrier_noise.floor_m = (0.001,) has not the right number of values",
        ),
        ({"b_value": {"k_bb": 5.0}}, "b_value.k_bb is unknown; did you mean 'k_b'?"),
        ({"monitors": {"k_b": 5.0}}, "monitors.k_b is now called b_value.k_b"),
        ({"approaches": {"rwy": {"gpa_deg": 3.0}}}, "approaches.rwy: the course needs"),
    ],
)
def test_refusals_name_key_value_and_bound(sections, expected):
    with pytest.raises(ParameterError) as caught:
        GroundParams.from_mapping(changed(**sections), source="site.yaml")
    assert str(caught.value).startswith("site.yaml: ")
    assert expected in str(caught.value)


def test_missing_required_key_is_named():
    with pytest.raises(ParameterError, match=r"station\.latitude_deg is missing"):
        GroundParams.from_mapping({"station": {"id": "EDVE"}, "receivers": MINIMAL["receivers"]})
    with pytest.raises(ParameterError, match=r"receivers\.rr1_ecef_m is missing"):
        GroundParams.from_mapping({"station": MINIMAL["station"]})


@pytest.mark.parametrize("wrapped", [True, False])
def test_yaml_file(tmp_path, wrapped):
    document = {"ground": MINIMAL}
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": document}} if wrapped else document))
    assert GroundParams.from_yaml(path) == GroundParams.from_mapping(MINIMAL)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("ground: [", "is not YAML"), ("other: 1\n", "has no section 'ground'"), ("", "holds no sections"),
     ("ground: 5\n", "has no section 'ground'")],
)  # fmt: skip
def test_bad_files(tmp_path, text, expected):
    path = tmp_path / "site.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=expected) as caught:
        GroundParams.from_yaml(path)
    assert str(path) in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(ParameterError, match="cannot be read"):
        GroundParams.from_yaml(tmp_path / "none.yaml")


def test_what_does_not_fit_the_slots_is_refused_at_the_start():
    approach = {
        "ltp_latitude_deg": 52.32, "ltp_longitude_deg": 10.57, "ltp_height_m": 120.0, "course_deg": 265.0,
        "fpap_distance_m": 2300.0, "tch_m": 15.0, "gpa_deg": 3.0, "fasval_m": 10.0, "faslal_m": 40.0,
        "airport_id": "EDVE", "runway": "26", "rpi": "G26A",
    }  # fmt: skip
    station = GroundParams.from_mapping(changed(approaches={"rwy26": approach}))
    assert station.approaches[0].course_rad == pytest.approx(math.radians(265.0), abs=1e-9)  # of a 2300 m course
    with pytest.raises(ParameterError, match=r"approaches\.rwy26\.fasval_m = 99 is not within 0 to 50.8 m"):
        GroundParams.from_mapping(changed(approaches={"rwy26": approach | {"fasval_m": 99.0}}))
    with pytest.raises(ParameterError, match=r"approaches\.rwy26: runway"):
        GroundParams.from_mapping(changed(approaches={"rwy26": approach | {"runway": "26X"}}))


def test_every_value_is_described_once():
    found = list(declared(GroundParams.from_mapping(MINIMAL)))
    assert len({each.key for each in found}) == len(found)
    assert all(each.parameter.doc and each.parameter.unit for each in found)


def test_messages_of_a_full_station():
    station = params(
        4,
        gast_d__enabled=True,
        vdb__authentication=True,
        vdb__slots="AC",
        station__max_use_distance_m=0.0,
        station__rsds=3,
    )
    message = station.station_message()
    assert isinstance(message, Type2)
    assert message.n_reference_receivers == 4
    assert message.adb1.d_max_m == math.inf
    assert message.adb1.reference_station_data_selector == 3
    assert message.adb3.k_md_e_d_gps == 12.75
    assert message.adb4.slot_group == 0b101


def test_reference_point_and_receivers():
    station = params(3)
    latitude, longitude, height = geodetic_from_ecef(station.reference_point_m())
    place = (station.station.latitude_rad, station.station.longitude_rad)
    assert (latitude, longitude) == pytest.approx(place, abs=1e-12)
    assert height == pytest.approx(station.station.height_m, abs=1e-6)  # rounding of 6e6 m through the transformation
    assert station.receiver_positions_m().shape == (3, 3)
    assert np.linalg.norm(station.receiver_positions_m() - station.reference_point_m(), axis=1).max() < 600.0


@pytest.mark.parametrize("gcid", [1, 2])
def test_gast_d_without_its_monitors_only_from_a_station_that_claims_nothing(gcid):
    bare = {"enabled": True, "required": False}
    station = {**MINIMAL["station"], "systems": "G"}
    allowed = GroundParams.from_mapping(changed(gast_d=bare, vdb={"slots": "ABC"}))
    assert allowed.station_message().gcid == GCID_UNHEALTHY
    assert not allowed.gast_d.demands_monitors
    with pytest.raises(ParameterError, match=rf"gast_d.required = false with station.gcid = {gcid}, expected 7"):
        GroundParams.from_mapping(changed(station=station | {"gcid": gcid}, gast_d=bare, vdb={"slots": "ABC"}))
