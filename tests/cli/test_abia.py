"""``gbas abia``: what its commands print, in full where a document is promised, and what they refuse."""

from __future__ import annotations

import json
from typing import Any

import pytest
import trimesh
from typer.testing import CliRunner

from gbas_cli.main import app

RUNNER = CliRunner()


def abia(*arguments: object) -> Any:
    return RUNNER.invoke(app, ["abia", *(str(each) for each in arguments)], prog_name="gbas")


def test_link_budget_document():
    result = abia("link-budget", "--elevation-deg", "10,90", "--json")
    document = json.loads(result.stdout)
    assert list(document) == ["elevation_deg", "cn0_dbhz"]
    assert document["elevation_deg"] == [10.0, 90.0]
    assert document["cn0_dbhz"] == pytest.approx([38.1, 48.7], abs=0.05)  # recomputed from the paper, to a tenth


def test_link_budget_options():
    def cn0(*options: object) -> float:
        return json.loads(abia("link-budget", "--elevation-deg", 30, *options, "--json").stdout)["cn0_dbhz"][0]

    base = cn0()
    assert cn0("--eirp-dbw", 30.0) == pytest.approx(base + 3.2)
    assert cn0("--noise-figure-db", 5.0) == pytest.approx(base - 2.0)
    assert cn0("--beam", "flat") == pytest.approx(base + 2.5413 * 0.5)  # eq (14) at 30 degrees
    assert cn0("--antenna", "isotropic") == pytest.approx(base - (7.8659 * 0.5 - 4.3659), abs=1e-6)
    assert cn0("--orbit-radius-km", 26_559.7) == pytest.approx(base)
    assert cn0("--bank-deg", 20.0) < base
    assert cn0("--signal", "E5a") > base


def test_link_budget_terms_add_up():
    document = json.loads(abia("link-budget", "--elevation-deg", 45, "--terms", "--json").stdout)
    terms = {name: value if name == "noise_dbwphz" else value[0] for name, value in document["terms"].items()}
    losses = terms["spread_db"] + terms["oxygen_db"] + terms["scintillation_db"] + terms["noise_dbwphz"]
    assert terms["eirp_dbw"] + terms["beam_db"] + terms["antenna_dbic"] - losses == pytest.approx(
        document["cn0_dbhz"][0]
    )
    assert "C/N0, dB-Hz" in abia("link-budget", "--terms").stdout


def test_tracking_document():
    result = abia("tracking", "--bandwidth-hz", 18, "--integration-ms", 20, "--jerk-g-per-s", 10, "--json")
    document = json.loads(result.stdout)
    assert list(document) == ["vibration_deg", "allan_deg", "dynamic_stress_deg", "cn0_threshold_dbhz"]
    # As recomputed from the paper, each to its last digit.
    assert document["vibration_deg"] == pytest.approx(1.420, abs=5e-4)
    assert document["allan_deg"] == pytest.approx(1.400, abs=5e-4)
    assert document["dynamic_stress_deg"] == pytest.approx(15.35, abs=5e-3)
    assert document["cn0_threshold_dbhz"] == pytest.approx(28.16, abs=5e-3)


def test_tracking_loops_and_jamming():
    document = json.loads(abia("tracking", "--jerk-g-per-s", 10, "--loops", "--cn0-dbhz", 44, "--json").stdout)
    loops = [document[f"{name}cn0_threshold_dbhz"] for name in ("", "frequency_", "code_")]
    assert document["all_cn0_threshold_dbhz"] == max(loops)
    assert 25.0 < document["jamming_margin_db"] < 45.0
    broken = abia("tracking", "--jerk-g-per-s", 100)
    assert "holds at no C/N0" in broken.stdout
    assert json.loads(abia("tracking", "--jerk-g-per-s", 100, "--json").stdout)["cn0_threshold_dbhz"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("link-budget", "--elevation-deg", "10,x"), "--elevation-deg is 10,x: must be numbers"),
        (("link-budget", "--elevation-deg", "-1"), "--elevation-deg is -1: must be 0 to 90 degrees each"),
        (("link-budget", "--signal", "L2"), "--signal is L2: must be L1CA or L5 or E1 or E5a"),
        (("link-budget", "--antenna", "dish"), "antenna = 'dish' is not one of"),
        (("tracking", "--integration-ms", "0"), "--integration-ms is 0.0: must be 0.1 to 1000 ms"),
        (("tracking", "--bandwidth-hz", "0"), "phase_bandwidth_hz = 0 is not within 0.1 to 200 Hz"),
        (("tracking", "--order", "4"), "phase_order = 4 is not one of 2, 3"),
    ],
)
def test_bad_options_are_one_line(arguments, message):
    result = abia(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_mask_of_ours_and_of_a_file(tmp_path):
    picture = tmp_path / "new" / "fighter.png"
    document = json.loads(abia("mask", "fighter", "--out", picture, "--json").stdout)
    assert picture.stat().st_size > 10_000
    assert document["antenna_forward_right_down_m"] == [-0.88, 0.0, -0.74]
    assert document["table_unlike_rays_percent"] < 0.3
    trimesh.creation.box((10.0, 4.0, 2.0)).export(tmp_path / "block.stl")
    result = abia("mask", tmp_path / "block.stl", "--antenna", "1,0.5,1.05", "--out", tmp_path / "block.png", "--json")
    document = json.loads(result.stdout)
    assert document["antenna_forward_right_down_m"] == [1.0, -0.5, -1.05]  # from forward, left, up
    assert document["hidden_percent"] == 0.0  # all of the box is below the antenna's plane
    assert "% of the antenna's hemisphere" in abia("mask", "small_uav", "--out", tmp_path / "uav.png").stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--antenna", "0,0,0.5"), "is inside the body"),
        (("--antenna", "0,0,50"), "49.0 m off the body"),
        (("--antenna", "top"), "--antenna is top: must be X,Y,Z in metres"),
        (("--antenna", "0,0"), "--antenna is 0,0: must be X,Y,Z in metres"),
        (("--antenna", "0,0,1.1", "--out", "mask.txt"), "--out is mask.txt: must be a .png"),
        (("--antenna", "0,0,1.1", "--axes", "xyz"), "axes = 'xyz' is not three letters"),
        (("--antenna", "0,0,1.1", "--scale-m", "0.001"), "the mesh is 0.01 m across"),
        (("--antenna", "0,0,1.1", "--looks", "left"), "--looks is left: must be up or down"),
    ],
)
def test_bad_masks_are_one_line(tmp_path, arguments, message):
    trimesh.creation.box((10.0, 4.0, 2.0)).export(tmp_path / "block.stl")
    result = abia("mask", tmp_path / "block.stl", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
