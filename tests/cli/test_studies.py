"""``gbas reproduce`` and ``gbas study`` as a person types them."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from gbas_cli.main import app
from gbas_studies.reproduction import registry
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Picture, Reproduction, Section, Value

RUNNER = CliRunner()


def gbas(*arguments: str):
    return RUNNER.invoke(app, list(arguments))


def toy(options: registry.Options) -> Reproduction:
    value = Value(name="a length", paper="0.1763", ours=0.17629, unit="m", definition=f"quick {options.quick}")
    other = Value(name="another", paper="0.2", ours=0.4, unit="m", definition="as printed", why="twice as much")
    picture = Picture(name="fig-1", title="Figure 1", caption="Nothing.", figure=new_figure())
    section = Section(title="Table 1", items=(value, other), pictures=(picture,))
    return Reproduction(study="ccd", title="A toy", source="Nobody, 2015", about="Nothing.", sections=(section,))


@pytest.fixture
def toy_study(monkeypatch):
    monkeypatch.setattr(registry, "_study", lambda name: toy)
    monkeypatch.delenv("GBAS_DATA", raising=False)


def test_reproduce_writes_report_results_and_pictures(toy_study, tmp_path):
    result = gbas("reproduce", "ccd", "--out", str(tmp_path), "--quick")
    assert result.exit_code == 0, result.output
    assert "✓" in result.stdout
    assert "twice as much" in result.stdout
    assert "Quick run" in result.stdout
    assert "left out" in result.stdout  # there is no folder of recorded data
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert document["schema"] == "gbas/reproduction/1"
    assert [item["verdict"] for item in document["studies"][0]["sections"][0]["items"]] == ["reproduced", "differs"]
    assert "A toy" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "figures" / "ccd-fig-1.png").read_bytes().startswith(b"\x89PNG")


def test_reproduce_as_json(toy_study, tmp_path):
    result = gbas("reproduce", "ccd", "--out", str(tmp_path), "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))


def test_unknown_study_and_folder_are_errors(tmp_path):
    result = gbas("reproduce", "everything", "--out", str(tmp_path))
    assert result.exit_code == 2
    assert "everything" in result.stderr
    result = gbas("reproduce", "ccd", "--data", str(tmp_path / "none"))
    assert result.exit_code == 2
    assert "no such folder" in result.stderr


def test_study_of_the_issue():
    result = gbas(
        "study", "ccd", "--variant", "variant", "--mode", "Code L5", "--monitor", "gast-f-paper", "--d-step", "0.001",
        "--d-max", "0.1", "--onset-step", "0.5", "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert {"max_error_m", "d_mps", "onset_s", "min_mapping"} <= set(document)
    # On this grid: between the coarse grid's 0.0620 m and the exact 0.0633 m over all rates.
    assert 0.0620 < document["max_error_m"] <= document["max_error_any_rate_m"]
    assert document["min_mapping"] == pytest.approx(70.05, abs=0.01)


@pytest.mark.parametrize(("mode", "expected"), [("Code L1", 0.1763), ("Code+Carrier L1", 0.1524)])
def test_study_of_table_3(mode, expected):
    document = json.loads(gbas("study", "ccd", "--mode", mode, "--monitor", "gast-d", "--json").stdout)
    assert document["max_error_m"] == pytest.approx(expected, abs=5e-5)


def test_study_for_people():
    result = gbas("study", "ccd")
    assert result.exit_code == 0
    assert "largest undetected error" in result.stdout
    assert "0.176291 m at 0.03 m/s, +34 s" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--mode", "Code L2"], "Code L2"),
        (["--monitor", "gast-e"], "gast-e"),
        (["--variant", "other"], "other"),
        (["--d-step", "0"], "d_step_mps"),
        (["--onset-step", "0.3"], "multiple"),
        (["--error-on", "L7"], "L7"),
    ],
)
def test_study_refuses_with_one_line(arguments, word):
    result = gbas("study", "ccd", *arguments, "--json")
    assert result.exit_code == 2
    assert word in json.loads(result.stdout)["error"]
    assert result.stderr.count("\n") == 1


def test_campaigns_of_the_command_line(tmp_path):
    """One gradient study in one process; its file is continued, and refused with another seed."""
    out = tmp_path / "new" / "gradient.jsonl"
    study = ("study", "gradient", "--baselines-m", "100,200", "--sigma-m", "0.002", "--trials", "600000", "--json")
    first = gbas(*study, "--out", str(out))
    assert first.exit_code == 0, first.output
    header, *lines = out.read_text(encoding="utf-8").splitlines()
    assert json.loads(header)["study"] == "gradient"
    assert [json.loads(line)["trial"] for line in lines] == [0, 1, 2]  # blocks of 250,000
    detected = sum(json.loads(line)["result"] for line in lines)
    assert json.loads(first.stdout)["simulated_percent"] == pytest.approx(100.0 * detected / 600_000, rel=1e-12)
    assert gbas(*study, "--out", str(out)).stdout == first.stdout
    refused = gbas(*study, "--out", str(out), "--seed", "2")
    assert refused.exit_code == 2
    assert "its seed is 1, and that of this campaign 2" in json.loads(refused.stdout)["error"]


def test_workers_here_and_a_scheduler_elsewhere_are_one_too_many():
    result = gbas("study", "faults", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1", "--kind", "power", "--json")
    assert result.exit_code == 2
    assert "give one" in json.loads(result.stdout)["error"]


def test_dask_is_imported_only_where_it_is_used():
    """It takes half a second: not for help, nor for a campaign in this process."""
    code = (
        "import sys, gbas_cli.main, gbas_cli.study_faults, gbas_studies.campaign, gbas_studies.faults.campaign\n"
        "sys.exit(any(name in sys.modules for name in ('dask', 'distributed', 'tornado')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
