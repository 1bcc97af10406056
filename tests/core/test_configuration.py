"""Configuration files: bases, the wrapping of ROS, where a value came from, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from gbas_core.configuration import read_configuration
from gbas_core.parameters import ParameterError


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_differs_from_its_base_and_says_where_a_value_is_from(tmp_path: Path) -> None:
    below = write(
        tmp_path / "site.yaml", "/**:\n  ros__parameters:\n    ground: {ccd: {tau_s: 30.0, exclude: true}, a: 1}\n"
    )
    above = write(
        tmp_path / "own.yaml", "base: site.yaml\n/**:\n  ros__parameters:\n    ground: {ccd.tau_s: 40.0, a: null}\n"
    )
    read = read_configuration(above)
    assert read.section("ground") == {"ccd": {"tau_s": 40.0, "exclude": True}}
    assert read.files == (above, below)
    assert read.origin("ground.ccd.tau_s") == above
    assert read.origin("ground.ccd.exclude") == below
    assert read.origin("ground.ccd.sigma") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: {b: 1, b: 2}\n", r"is not YAML: line 1, column 11: key 'b' stands twice in a section"),
        ("a: [1\n", r"is not YAML: line 2"),
        ("- 1\n", r"holds no sections"),
        ("base: 3\na: {}\n", r"base = 3 is not a file"),
        ("base: file.yaml\na: {}\n", r"files are based on each other"),
        ("base: gone.yaml\na: {}\n", r"gone\.yaml: cannot be read: No such file"),
        ("a: {}\n", r"file\.yaml: has no section 'ground'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path / "file.yaml", text)
    with pytest.raises(ParameterError, match=words):
        read_configuration(path).section("ground")
