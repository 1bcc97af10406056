"""gbas siting and gbas study gradient: JSON and for people, and errors that name option, value and bound."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from typer.testing import CliRunner

from gbas_cli.main import app

RUNNER = CliRunner()


def siting(*arguments: object) -> Any:
    return RUNNER.invoke(app, ["siting", *(str(each) for each in arguments)], prog_name="gbas")


def document(*arguments: object) -> dict[str, Any]:
    result = siting(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return dict(json.loads(result.stdout))


def test_three_receivers():
    best = document("--receivers", 3)
    assert best["sigma_m"] == pytest.approx(0.006981, abs=5e-7)  # the paper's optimum, worked out exactly
    assert best["length_m"] == pytest.approx(177.084, abs=5e-4)
    assert best["positions_m"][0] == [0.0, 0.0]
    assert best["positions_m"][2] == pytest.approx([best["length_m"], 0.0])
    assert best["detectability"] == 100.0
    assert best["certificate"]["closed"]
    assert 0.0 <= best["certificate"]["sigma_gap_m"] < 1e-8


def test_every_option_of_placing():
    best = document(
        "--receivers", 4, "--existing", "0,0", "-769.279,-97.965", "--runway-bearing", 84.73, "--gradients", "300,1500",
        "--k", 7.0, "--baselines", "all", "--tolerance-m", 1, "--max-length-m", 500, "--signal", "L5",
    )  # fmt: skip
    assert best["positions_m"][:2] == [[0.0, 0.0], [-769.279, -97.965]]
    assert len(best["baselines"]) == 6
    assert all(abs(place) <= 500.0 for place in best["along_runway_m"][2:])
    assert best["problem"] == {
        "receivers": 4, "existing": 2, "runway_bearing_deg": pytest.approx(84.73), "k": 7.0, "baselines": "all",
        "gradients_mm_per_km": [300.0, 1500.0], "tolerance_m": 1.0, "max_length_m": 500.0, "signal": "L5",
    }  # fmt: skip


def test_lists_may_repeat_the_option_instead():
    several = ("--receivers", 3, "--runway-bearing", 84.73)
    assert document(*several, "--existing", "0,0", "-769,-98") == document(
        *several, "--existing", "0,0", "--existing", "-769,-98"
    )


def test_given_baselines():
    seen = document("--baselines-m", "775.494,740.748", "--sigma-m", 0.001, "--fuse", "any")
    assert seen["coverage_percent"] == 100.0  # figure 4d: everything up to about 1 mm
    assert seen["blind_intervals_mm_per_km"] == []
    assert seen["sigma_for_full_coverage_m"][0] == pytest.approx(0.001, abs=2e-4)
    # Each blind interval of one baseline is 2 k sigma / b wide, around n lambda / b.
    both = document("--baselines-m", "775.494", "--sigma-m", 0.001)["blind_intervals_mm_per_km"]
    assert [last - first for first, last in both[:3]] == pytest.approx([2e6 * 7.609608 * 0.001 / 775.494] * 3, rel=1e-6)
    assert 0.5 * sum(both[0]) == pytest.approx(2e6 * 0.190294 / 775.494, rel=1e-5)
    assert document("--baselines-m", "775.494,740.748", "--sigma-m", 0.001, "--fuse", "all")["coverage_percent"] < 85.0


def test_angle_and_a_sigma_of_each():
    """A baseline at 60 degrees is one of half the length."""
    turned = document("--baselines-m", "200,100", "--angles-deg", "60,0", "--sigma-m", "0.002,0.003")
    straight = document("--baselines-m", "100,100", "--sigma-m", "0.002,0.003")
    assert turned["coverage_percent"] == pytest.approx(straight["coverage_percent"])
    assert turned["along_runway_m"] == pytest.approx([100.0, 100.0])


def test_output_for_people():
    lines = siting("--receivers", 3).stdout
    assert re.search(r"sigma, double difference +6\.981 mm", lines)
    assert "[m]" in lines  # units are not taken for markup
    assert "length limit binds" in siting("--receivers", 3, "--max-length-m", 100).stdout
    lines = siting("--baselines-m", "775.494", "--sigma-m", "0.001").stdout
    assert lines.startswith("91.92 % of 300 to 2000 mm/km")
    assert "blind from [mm/km]" in lines


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("", "--receivers N to place receivers, or --baselines-m"),
        ("--receivers 3 --baselines-m 5", "--receivers N to place receivers, or --baselines-m"),
        ("--receivers 1", "--receivers is 1: must be 2 to 12"),
        (
            "--receivers 2 --existing 0,0 1,1 2,2",
            "--receivers is 2: must be at least the number of --existing receivers, 3",
        ),
        ("--receivers 3 --existing 0;0", "--existing is 0;0: must be X,Y in metres"),
        ("--receivers 3 --existing 0,nan", "--existing is 0,nan: must be X,Y in metres"),
        ("--receivers 3 --runway-bearing 400", "--runway-bearing is 400.0: must be -360 to 360 degrees"),
        (
            "--receivers 3 --gradients 2000,300",
            "--gradients is 2000,300: must be LOW,HIGH in mm/km, with 0 < LOW < HIGH",
        ),
        ("--receivers 3 --gradients 300", "--gradients is 300: must be LOW,HIGH"),
        ("--receivers 3 --k nan", "--k is nan: must be above 0"),
        ("--receivers 3 --baselines ring", "--baselines is ring: must be star or all"),
        ("--receivers 3 --tolerance-m -1", "--tolerance-m is -1.0: must be 0 to 100 m"),
        ("--receivers 3 --max-length-m 0", "--max-length-m is 0.0: must be above 0"),
        ("--receivers 3 --signal L2", "--signal is L2: must be L1, L5 or L1+L5"),
        ("--receivers 3 --sigma-m 0.001", "--sigma-m has no meaning with --receivers"),
        ("--receivers 3 --tolerance-m 90", "no places within --tolerance-m and --max-length-m"),
        ("--baselines-m 775 --sigma-m 0.001 --tolerance-m 1", "--tolerance-m has no meaning with --baselines-m"),
        ("--baselines-m 775", "--sigma-m is missing"),
        ("--baselines-m 775,-1 --sigma-m 0.001", "--baselines-m is 775,-1: must be above 0"),
        ("--baselines-m 775 --sigma-m 0.001,0.002", "--sigma-m is 0.001,0.002: must be one number, or one for each"),
        ("--baselines-m 775 --sigma-m 0", "--sigma-m is 0: must be above 0"),
        ("--baselines-m 775 --sigma-m 0.001 --fuse most", "--fuse is most: must be any or all"),
    ],
)
def test_bad_input_is_one_line_that_names_it(arguments: str, text: str):
    result = siting(*arguments.split())
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("gbas: ")
    assert text in line


# --- gbas study gradient


def study(*arguments: object) -> Any:
    return RUNNER.invoke(app, ["study", "gradient", *(str(each) for each in arguments)], prog_name="gbas")


def test_study_of_the_optimum():
    """At the paper's optimum no gradient is missed with more than 1e-4, and the simulation says the same."""
    result = study("--baselines-m", "68.584,177.084", "--sigma-m", 0.00698, "--trials", 50_000, "--json")
    found = json.loads(result.stdout)
    assert found["worst_p_missed_detection"] <= 1e-4
    assert 1e-4 < found["p_false_alarm"] < 2e-4  # two baselines of 1e-4 each, that share noise
    assert found["simulated_percent"] == pytest.approx(
        found["detected_percent"], abs=5.0 * found["simulated_deviation_percent"]
    )
    assert len(found["p_missed_detection"]) == 1700


def test_study_for_people():
    lines = study("--baselines-m", "775.494,740.748", "--sigma-m", 0.002, "--trials", 1000, "--step", 10).stdout
    assert "threshold               7.781 mm" in lines  # 3.8906 times 2 mm
    assert "of 300 to 2000 mm/km" in lines


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("--baselines-m 0 --sigma-m 0.001", "--baselines-m is 0: must be above 0"),
        ("--baselines-m 9 --sigma-m 1", "--sigma-m is 1.0: must be above 0, at most 0.02 m"),
        ("--baselines-m 9 --sigma-m 0.001 --step 0", "--step is 0.0: must be above 0"),
        ("--baselines-m 9 --sigma-m 0.001 --trials 1", "--trials is 1: must be 1000 to"),
        ("--baselines-m 9 --sigma-m 0.001 --p-false-alarm 1", "--p-false-alarm is 1.0: must be between 0 and 1"),
        (
            "--baselines-m 9 --sigma-m 0.001 --angles-deg 1,2",
            "--angles-deg is 1,2: must be one number, or one for each",
        ),
    ],
)
def test_bad_study_is_one_line_that_names_it(arguments: str, text: str):
    result = study(*arguments.split())
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("gbas: ")
    assert text in line


# --- gbas study coverage


def coverage(*arguments: object) -> Any:
    return RUNNER.invoke(app, ["study", "coverage", *(str(each) for each in arguments)], prog_name="gbas")


def test_coverage_of_a_day():
    """Two receivers: more noise lower down, so less is covered; the second band never costs anything."""
    result = coverage("--receivers", 2, "--step", 10_800, "--repetitions", 1, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["k_md"] == pytest.approx(3.7190, abs=5e-5)
    assert [len(each) for each in found["k_ffd"].values()] == [1, 3]
    single, both = (
        [row["coverage_percent"] for row in found["tables"][f"2 receivers, {bands}"]] for bands in ("L1", "L1+L5")
    )
    assert single[0] == 0.0
    assert single[-1] > single[2]
    assert all(more >= less for less, more in zip(single, both, strict=True))
    again = coverage("--receivers", 2, "--step", 10_800, "--repetitions", 1, "--json")
    assert again.stdout == result.stdout


def test_coverage_for_people():
    result = coverage("--receivers", 2, "--step", 21_600, "--repetitions", 1, "--paper")
    assert result.exit_code == 0, result.output
    assert "2 receivers, L1; k_ffd 3.89, k_md 3.72" in result.stdout
    assert "failed without a gradient: " in result.stdout


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--receivers", "5"), "--receivers 5 is not within 2 to 4"),
        (("--receivers", "1"), "--receivers 1 is not within 2 to 4"),
        (("--receivers", "two"), "--receivers 'two' is not whole numbers"),
        (("--step", "1"), "--step 1 is not within 10 to 21600 s"),
    ],
)
def test_bad_coverage_is_one_line_that_names_it(arguments: tuple[str, ...], text: str):
    result = coverage(*arguments)
    assert result.exit_code != 0
    assert text in result.output + str(result.exception)
