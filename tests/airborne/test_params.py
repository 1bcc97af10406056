"""Airborne parameters: what is refused, and how it is said."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gbas_airborne.params import AirborneParams
from gbas_core.parameters import ParameterError


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"aad": "C"}, ["aad", "'C'", "A or B"]),
        ({"service": "D"}, ["service", "'D'", "C"]),
        ({"systems": ""}, ["systems", "''"]),
        ({"systems": "GR"}, ["systems", "'GR'"]),
        ({"systems": "GG"}, ["systems", "'GG'"]),
        ({"rpds": 49}, ["rpds", "49", "-1 to 48"]),
        ({"rpds": 5.0}, ["rpds", "5.0"]),
        ({"elevation_mask_deg": 4.9}, ["elevation_mask_deg", "4.9", "5 to 45"]),
        ({"elevation_mask_deg": math.nan}, ["elevation_mask_deg", "nan"]),
        ({"correction_timeout_s": 11.0}, ["correction_timeout_s", "11.0", "0 to 10"]),
        ({"mt1_timeout_s": math.inf}, ["mt1_timeout_s", "inf", "3.5"]),
        ({"smoothing_tau_s": "100"}, ["smoothing_tau_s", "'100'"]),
        ({"inflate_unsettled": 1}, ["inflate_unsettled", "1"]),
        ({"slot_group": "A"}, ["slot_group", "'A'", "authentication"]),
        ({"slot_group": "AA", "authentication": True}, ["slot_group", "'AA'"]),
        ({"slot_group": "AJ", "authentication": True}, ["slot_group", "'AJ'", "A to H"]),
        ({"station_id": "EDVEX"}, ["station_id", "'EDVEX'", "4"]),
        ({"elevation_mask": 5.0}, ["elevation_mask", "unknown", "elevation_mask_deg"]),
    ],
)
def test_bad_value_is_named(values: dict[str, object], named: list[str]) -> None:
    with pytest.raises(ParameterError) as error:
        AirborneParams.from_mapping(values)
    for part in named:
        assert part in str(error.value)


def test_direct_construction_checks_too() -> None:
    with pytest.raises(ParameterError, match="rpds"):
        AirborneParams(rpds=True)
    with pytest.raises(ParameterError, match="aad"):
        AirborneParams(aad="Z")


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
