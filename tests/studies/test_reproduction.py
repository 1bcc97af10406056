"""The framework of reproductions: verdicts follow from printed digits, and the report holds what was computed."""

from __future__ import annotations

import base64
import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Reproduction, Section, Value, Verdict, agrees
from gbas_studies.reproduction.registry import MODULES, Options, UnknownStudy, run, studies
from gbas_studies.reproduction.report import write_report


def value(ours: float | None, **more: object) -> Value:
    return Value(name="item", ours=ours, unit="m", definition="as computed", **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("printed", "number", "same"),
    [
        ("0.1763", 0.17634, True),
        ("0.1763", 0.17636, False),
        ("0.111", 0.1110, True),
        ("0.111", 0.1116, False),
        ("7.153e-6", 7.1534e-6, True),
        ("7.153e-6", 7.151e-6, False),
        ("100", 100.4, True),
        ("100", 100.6, False),
        ("-2.5", -2.54, True),
        ("1e2", 140.0, True),  # one digit, of hundreds
        ("0.5", float("nan"), False),
        ("0.5", float("inf"), False),
    ],
)
def test_agreement_is_rounding_to_the_printed_digits(printed: str, number: float, same: bool) -> None:
    assert agrees(printed, number) is same


@pytest.mark.parametrize("printed", ["about 3", "", "nan", "inf"])
def test_what_is_printed_is_a_number(printed: str) -> None:
    with pytest.raises(ValueError, match="not a number"):
        agrees(printed, 3.0)


def test_verdicts() -> None:
    assert value(0.1763, paper="0.1763").verdict is Verdict.REPRODUCED
    assert value(0.1763).verdict is Verdict.NEW
    assert value(0.1277, paper="0.1299", point=0.12988, why="at 147 s").verdict is Verdict.POINT
    assert value(0.1277, paper="0.1299", point=0.1277, why="no point has it").verdict is Verdict.DIFFERS
    assert value(766.45, paper="766", tolerance=1.0, why="the paper truncates").verdict is Verdict.REPRODUCED
    assert value(766.6, paper="766", tolerance=1.0, why="the paper truncates").verdict is Verdict.CLOSE
    assert value(0.2, paper="0.1", comparable=False, why="our data").verdict is Verdict.OTHER
    assert value(None, why="no data").verdict is Verdict.LEFT_OUT
    assert value(float("nan"), paper="0.1", why="diverged").verdict is Verdict.DIFFERS


@pytest.mark.parametrize("bad", [{"ours": 0.2, "paper": "0.1"}, {"ours": None}, {"ours": None, "paper": "0.1"}])
def test_a_difference_needs_a_reason(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="why"):
        value(**bad)  # type: ignore[arg-type]


def claim(holds: bool | None, **more: object) -> Claim:
    return Claim(name="order", holds=holds, paper_text="a > b", ours_text="a > b", definition="rms", **more)  # type: ignore[arg-type]


def test_claims() -> None:
    assert claim(True).verdict is Verdict.REPRODUCED
    assert claim(True, new=True).verdict is Verdict.NEW
    assert claim(False, why="b is larger").verdict is Verdict.DIFFERS
    assert claim(None, why="no data").verdict is Verdict.LEFT_OUT
    with pytest.raises(ValueError, match="why"):
        claim(False)


def example() -> Reproduction:
    figure = new_figure()
    figure.axes[0].plot([0.0, 1.0], [0.0, 1.0])
    picture = Picture(
        name="fig-1", title="Figure 1", caption="A <line>.", figure=figure,
        data={"t_s": np.array([0.0, 1.0, 2.0]), "e_m": np.array([0.5, np.nan])},
    )  # fmt: skip
    section = Section(
        title="Table 1 & more", items=(value(0.2, paper="0.1", why="a < b"), claim(True)), pictures=(picture,)
    )
    return Reproduction(study="toy", title="A toy", source="Nobody, 2015", about="Nothing.", sections=(section,))


def test_report_holds_everything_and_needs_nothing_else(tmp_path: Path) -> None:
    written = write_report([example()], tmp_path / "out", command="gbas reproduce toy", notes=["a note"])
    page = written.report.read_text(encoding="utf-8")
    assert "a &lt; b" in page
    assert "A &lt;line&gt;." in page
    assert "Table 1 &amp; more" in page
    assert "a note" in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    embedded = base64.b64decode(re.findall(r"data:image/png;base64,([^\"]+)", page)[0])
    assert embedded == (tmp_path / "out/figures/toy-fig-1.png").read_bytes()
    rows = list(csv.reader((tmp_path / "out/figures/toy-fig-1.csv").open(encoding="utf-8")))
    assert rows == [["t_s", "e_m"], ["0.0", "0.5"], ["1.0", ""], ["2.0", ""]]
    document = json.loads(written.results.read_text(encoding="utf-8"))
    study = document["studies"][0]
    assert study["verdicts"]["differs"] == 1
    assert [item["verdict"] for item in study["sections"][0]["items"]] == ["differs", "reproduced"]
    assert study["sections"][0]["items"][0]["paper"] == pytest.approx(0.1)


def test_ticks_say_what_they_are() -> None:
    """Result values, statements, coefficients and inputs that are met are counted apart; what is not met is no tick."""
    met = {"paper": "0.2"}
    items = (
        value(0.2, **met), value(0.2, **met), value(0.2, **met, kind="coefficient"), value(0.2, **met, kind="input"),
        value(0.2), value(0.2, paper="0.1", why="no"), claim(True), claim(True, kind="coefficient"),
        claim(True, new=True),
    )  # fmt: skip
    section = Section(title="", items=items)
    study = Reproduction(study="toy", title="", source="", about="", sections=(section,))
    assert study.ticks() == {"result value": 2, "statement": 1, "coefficient": 2, "input": 1}
    assert sum(study.ticks().values()) == study.counts()[Verdict.REPRODUCED]
    assert study.headline(Verdict.REPRODUCED).endswith("2 result values, 1 statement, 2 coefficients, 1 input")
    assert study.headline(Verdict.DIFFERS) == Verdict.DIFFERS.words
    assert study.as_json()["reproduced"] == {"result_values": 2, "statements": 1, "coefficients": 2, "inputs": 1}
    with pytest.raises(ValueError, match="kind is 'guess'"):
        value(0.2, kind="guess")


def test_report_is_the_same_bits_each_time(tmp_path: Path) -> None:
    first, second = (write_report([example()], tmp_path / name) for name in ("a", "b"))
    assert first.report.read_bytes() == second.report.read_bytes()
    assert first.results.read_bytes() == second.results.read_bytes()


def test_picture_names_are_unique() -> None:
    section = example().sections[0]
    with pytest.raises(ValueError, match="fig-1"):
        Reproduction(study="toy", title="", source="", about="", sections=(section, section))


def test_only_existing_studies_are_offered() -> None:
    assert set(studies()) <= set(MODULES)
    with pytest.raises(UnknownStudy, match="study"):
        run("nothing", Options())
