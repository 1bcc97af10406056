"""``gbas sim export``: files where they are said to be, labelled, and refusals in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gbas_bringup.resources import config_path
from gbas_bringup.run_config import read_run_config
from gbas_chain.process import ProcessRequest, process
from gbas_cli.main import app

RUNNER = CliRunner()
SHORT = "base: {base}\n/**:\n  ros__parameters:\n    sim: {{interval_s: 5.0, duration_s: 60.0{more}}}\n"


def gbas(*arguments: object) -> Any:
    return RUNNER.invoke(app, [str(each) for each in arguments], prog_name="gbas")


def scenario(folder: Path, more: str = "") -> Path:
    path = folder / "short.yaml"
    path.write_text("# A minute.\n" + SHORT.format(base=config_path("braunschweig.yaml"), more=more))
    return path


def test_files_are_where_it_says(tmp_path: Path) -> None:
    result = gbas("sim", "export", scenario(tmp_path), "--rinex", tmp_path / "rinex", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["simulated"] is True
    assert sorted(document["files"]) == ["airborne", "navigation", "rr1", "rr2", "rr3", "rr4", "truth"]
    assert all(Path(each).stat().st_size > 1000 for each in document["files"].values())
    truth = Path(document["files"]["truth"]).read_text().splitlines()
    assert len(truth) == 2 + 13  # label and names; epochs of 5 s in a minute, both ends


def test_exported_files_go_through_gbas_process(tmp_path: Path) -> None:
    gbas("sim", "export", scenario(tmp_path), "--rinex", tmp_path, "--json")
    ground = tuple(tmp_path / f"rr{number}.obs" for number in (1, 2, 3, 4))
    request = ProcessRequest(ground=ground, user=tmp_path / "airborne.obs", navigation=(tmp_path / "broadcast.nav",))
    result = process(request)
    assert len(result.rows) == 13
    assert result.summary()["simulated"] is True


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (", threats: {a: {kind: frozen, receiver: rr1}}", "short.yaml: sim.threats.a.start_s is missing"),
        (
            ", threats: {a: {kind: clock, satellite: G30, step_s: 1.0e-6, start_s: 0.0}}",
            "short.yaml: fault clock: satellite = 'G30' is not up between 0 and 60 s",
        ),
    ],
)
def test_bad_scenarios_are_one_line(tmp_path: Path, more: str, message: str) -> None:
    result = gbas("sim", "export", scenario(tmp_path, more), "--rinex", tmp_path / "rinex")
    assert result.exit_code == 2
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "rinex").exists()


def test_nothing_to_write_is_refused(tmp_path: Path) -> None:
    result = gbas("sim", "export", scenario(tmp_path))
    assert result.exit_code == 2
    assert "--rinex DIR, --bag, or both" in result.stderr


def test_a_run_has_everything_in_one_file(tmp_path: Path) -> None:
    config = read_run_config(scenario(tmp_path))
    assert "base" not in config.parameters
    written = config.written(tmp_path / "run")
    assert written.path == tmp_path / "run" / "short.yaml"
    again = read_run_config(written.path)
    assert again.parameters == config.parameters
    assert [node.kind.name for node in again.nodes] == [node.kind.name for node in config.nodes]
    assert written.path.read_text().startswith("# A minute.\n")
    assert again.written(tmp_path / "other") is again
