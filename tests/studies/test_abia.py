"""Avionics based augmentation, the study: what is reproduced, what is not and why, and every picture there."""

from __future__ import annotations

from pathlib import Path

import pytest

from gbas_studies.abia.airframe_items import airframe_section
from gbas_studies.abia.echo_items import echo_section
from gbas_studies.abia.link_items import link_section
from gbas_studies.abia.loop_items import loop_section
from gbas_studies.abia.recorded_items import recorded_section
from gbas_studies.abia.requirement_items import requirement_section
from gbas_studies.reproduction.items import Section, Verdict
from gbas_studies.reproduction.registry import Options, run
from gbas_studies.reproduction.report import write_report


def verdicts(section: Section) -> dict[str, Verdict]:
    return {item.name: item.verdict for item in section.items}


def test_closed_forms():
    """Verdicts as recomputed independently; every misprint is told with its reason."""
    found = verdicts(link_section()) | verdicts(loop_section())
    differs = {name for name, verdict in found.items() if verdict is Verdict.DIFFERS}
    assert {
        "eq (12) as printed",
        "eq (14), satellites' beam",
        "eq (16), branches",
        "eq (17), exponent",
        "C/N0 below 25 and 27 dB-Hz",
        "eq (47), (48) in radians",
        "caution of the phase loop",
        "25 to 28 dB-Hz for 15 to 18 Hz and 5 to 20 ms",
        "15 to 18 dB-Hz with velocity aiding",
    } == differs
    for name in ("eq (15), 10°", "eq (15), 90°", "eq (18), constant", "10 g/s on L1", "eq (49), factor"):
        assert found[name] is Verdict.REPRODUCED, name
    sections = link_section(), loop_section()
    assert all(item.why for each in sections for item in each.items if item.verdict is Verdict.DIFFERS)


def test_numbers_of_the_loops():
    """The hand-computed values of tests/tables/abia_paper.yaml."""
    values = {item.name: item.ours for item in loop_section().items if hasattr(item, "ours")}
    assert values["threshold, 18 Hz, 20 ms, 10 g/s"] == pytest.approx(28.16, abs=0.005)
    assert values["threshold, 18 Hz, 5 ms, no jerk"] == pytest.approx(25.38, abs=0.005)
    assert values["dynamic stress"] == pytest.approx(15.35, abs=0.005)


def test_airframe_and_requirements():
    found = verdicts(airframe_section()) | verdicts(requirement_section())
    assert found["Table I, span at 67°"] is Verdict.REPRODUCED
    assert found["table against direct rays"] is Verdict.NEW
    assert found["precision approaches can be flown with the paper's range error"] is Verdict.DIFFERS


def test_multipath():
    section = echo_section(Options())
    found = verdicts(section)
    assert found["figure 21: detection at 0.1 rad"] in (Verdict.REPRODUCED, Verdict.CLOSE)
    assert found["figure 22: false alarms at 0.1 rad, 42 dB-Hz"] is Verdict.CLOSE
    assert found["early-late phase sees echoes of the airframe"] is Verdict.DIFFERS
    assert found["delay of the fuselage's echo at the zenith"] is Verdict.DIFFERS
    assert {picture.name for picture in section.pictures} == {"fig-14", "fig-21", "fig-22"}


def test_recorded_receiver(data_dir: Path):
    section = recorded_section(Options(data=data_dir))
    assert len(section.items) == 8
    assert {item.verdict for item in section.items} == {Verdict.NEW}
    (left_out,) = recorded_section(Options()).items
    assert left_out.verdict is Verdict.LEFT_OUT


@pytest.mark.campaign
def test_whole_study(tmp_path: Path):
    (study,) = run("abia", Options())
    assert write_report([study], tmp_path, command="gbas reproduce abia", notes=[]).report.is_file()
    names = {picture.name for section in study.sections for picture in section.pictures}
    assert {f"fig-{number}" for number in (7, 8, 9, 11, 12, 14, 17, 18, 19, 21, 22)} <= names
    assert study.item("no system masking straight and level").verdict is Verdict.REPRODUCED
    assert study.item("onsets are a turn apart").verdict is Verdict.REPRODUCED
