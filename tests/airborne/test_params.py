"""Airborne parameters: what is refused, and how it is said."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gbas_airborne.params import AirborneParams
from gbas_core.parameters import ParameterError


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"aad": "C"}, "airborne.aad = 'C' is not one of 'A', 'B'"),
        ({"service": "E"}, "airborne.service = 'E' is not one of 'C', 'D', 'L5-100', 'L5-30', 'IF-100', 'IF-30'"),
        ({"systems": ""}, "airborne.systems = '' is not one of 'G', 'E', 'GE', 'EG'"),
        ({"systems": "GR"}, "airborne.systems = 'GR' is not one of 'G', 'E', 'GE', 'EG'"),
        ({"systems": "GG"}, "airborne.systems = 'GG' is not one of 'G', 'E', 'GE', 'EG'"),
        ({"rpds": 49}, "airborne.rpds = 49 is not within -1 to 48"),
        ({"rpds": 5.0}, "airborne.rpds = 5.0 is not a whole number"),
        ({"elevation_mask_deg": 4.9}, "airborne.elevation_mask_deg = 4.9 is not within 5 to 45 deg"),
        ({"elevation_mask_deg": math.nan}, "airborne.elevation_mask_deg = nan is not a finite number"),
        ({"correction_timeout_s": 11.0}, "airborne.correction_timeout_s = 11 is not within 0 to 10 s"),
        ({"mt1_timeout_s": math.inf}, "airborne.mt1_timeout_s = inf is not a finite number"),
        ({"smoothing_tau_s": "100"}, "airborne.smoothing_tau_s = '100' is not a number"),
        ({"inflate_unsettled": 1}, "airborne.inflate_unsettled = 1 is not true or false"),
        ({"slot_group": "A"}, "airborne.slot_group = 'A' is given without authentication"),
        ({"slot_group": "AA", "authentication": True}, "airborne.slot_group = 'AA' is not of distinct letters A to H"),
        ({"slot_group": "AJ", "authentication": True}, "airborne.slot_group = 'AJ' is not of distinct letters A to H"),
        ({"station_id": "EDVEX"}, "airborne.station_id = 'EDVEX' has more than 4 characters"),
        ({"elevation_mask": 5.0}, "airborne.elevation_mask is unknown; did you mean 'elevation_mask_deg'?"),
    ],
)
def test_bad_value_is_named(values: dict[str, object], words: str) -> None:
    with pytest.raises(ParameterError) as error:
        AirborneParams.from_mapping(values, source="aircraft.yaml")
    assert str(error.value) == f"aircraft.yaml: {words}"


def test_direct_construction_checks_too() -> None:
    with pytest.raises(ParameterError, match="rpds"):
        AirborneParams(rpds=True)
    with pytest.raises(ParameterError, match="aad"):
        AirborneParams(aad="Z")


def test_the_mask_is_degrees_in_files_and_radians_inside() -> None:
    assert AirborneParams.from_mapping({"elevation_mask_deg": 7}).elevation_mask_rad == math.radians(7.0)
    assert AirborneParams.from_mapping({}) == AirborneParams()


def test_a_file_may_be_based_on_another(tmp_path: Path) -> None:
    (tmp_path / "fleet.yaml").write_text("airborne: {aad: B, rpds: 7}\n")
    path = tmp_path / "aircraft.yaml"
    path.write_text("base: fleet.yaml\nairborne: {rpds: 8}\n")
    assert AirborneParams.from_yaml(path) == AirborneParams(aad="B", rpds=8)


def test_integers_will_do_for_floats() -> None:
    assert AirborneParams.from_mapping({"settle_s": 30}).settle_s == 30.0


@pytest.mark.parametrize(
    "text",
    [
        "aad: B\nrpds: 7\n",
        "airborne:\n  aad: B\n  rpds: 7\n",
        "/**:\n  ros__parameters:\n    aad: B\n    rpds: 7\n",
        "/**:\n  ros__parameters:\n    airborne:\n      aad: B\n      rpds: 7\n",
    ],
)
def test_yaml_forms(tmp_path: Path, text: str) -> None:
    path = tmp_path / "airborne.yaml"
    path.write_text(text)
    assert AirborneParams.from_yaml(path) == AirborneParams(aad="B", rpds=7)


def test_empty_yaml_is_all_defaults(tmp_path: Path) -> None:
    path = tmp_path / "empty.yaml"
    path.write_text("airborne:\n")
    assert AirborneParams.from_yaml(path) == AirborneParams()


@pytest.mark.parametrize("text", ["- 1\n- 2\n", "airborne: [1]\n", "aad: {\n", "aad: Q\n", "\x00\xff"])
def test_bad_yaml_names_the_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ParameterError, match=r"bad\.yaml"):
        AirborneParams.from_yaml(path)


def test_missing_yaml_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"none\.yaml"):
        AirborneParams.from_yaml(tmp_path / "none.yaml")
