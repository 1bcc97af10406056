"""What is kept of compiled functions is used by the next process, and only while it is right."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FORMULA = "from gbas_core.compiled import compiled\n\n@compiled\ndef twice(x):\n    return {factor} * x\n"
BETWEEN = """from formula import twice
from gbas_core.compiled import compiled

@compiled
def same(x):
    return twice(x)
"""
CONSTANT = "OFFSET = {offset}\n"
KERNEL = """
import elsewhere
from constant import OFFSET
from gbas_core.compiled import compiled, load_ahead

@compiled
def total(values):
    result = OFFSET
    for each in values:
        result += below(each)
    return result

@compiled
def below(x):  # what stands below its caller counts too
    return elsewhere.same(x)

def main():
    import numpy as np
    loaded = load_ahead()
    value = total(np.ones(3))
    counts = getattr(total, "stats", None)
    misses, hits = (sum(each.values()) for each in (counts.cache_misses, counts.cache_hits)) if counts else (0, 0)
    print(value, loaded, misses, hits)
"""


def run(folder: Path, **environment: str) -> tuple[list[str], str]:
    done = subprocess.run(
        [sys.executable, "-c", "import kernel; kernel.main()"],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder), **environment},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.split(), done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "formula.py").write_text(FORMULA.format(factor="2.0"))
    (tmp_path / "elsewhere.py").write_text(BETWEEN)
    (tmp_path / "constant.py").write_text(CONSTANT.format(offset="1.0"))
    (tmp_path / "kernel.py").write_text(KERNEL)
    return tmp_path


def test_the_next_process_compiles_nothing(folder: Path) -> None:
    assert run(folder)[0] == ["7.0", "0", "1", "0"]
    (value, loaded, misses, _), said = run(folder)
    assert (value, misses) == ("7.0", "0")
    assert loaded == "1"  # the loop, which has the formula within itself
    assert not said


def test_a_formula_or_a_constant_of_another_module_that_changes_counts(folder: Path) -> None:
    run(folder)
    (folder / "formula.py").write_text(FORMULA.format(factor="5.0"))
    assert run(folder)[0][0] == "16.0"
    (folder / "constant.py").write_text(CONSTANT.format(offset="3.0"))
    assert run(folder)[0][0] == "18.0"
    assert run(folder)[0][2] == "0"


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_what_cannot_be_read_is_compiled_anew_and_said_once(folder: Path, kind: str) -> None:
    run(folder)
    for path in (folder / "__pycache__").glob(f"*.{kind}"):
        path.write_bytes(path.read_bytes()[:40])
    result, said = run(folder)
    assert result[0] == "7.0"
    assert said.count("RuntimeWarning") == 1
    assert "cannot be read" in said
    result, said = run(folder)
    assert result[2] == "0"  # put right
    assert not said


def test_what_cannot_be_written_is_said_once(folder: Path) -> None:
    for name in ("__pycache__", "nowhere"):
        (folder / name).write_text("a file where a folder should be")
    nowhere = str(folder / "nowhere")
    result, said = run(folder, HOME=nowhere, XDG_CACHE_HOME=nowhere, PYTHONDONTWRITEBYTECODE="1")
    assert result[0] == "7.0"
    assert said.count("RuntimeWarning") == 1
    assert "every process compiles them anew" in said


def test_without_the_compiler_it_is_python(folder: Path) -> None:
    assert run(folder, NUMBA_DISABLE_JIT="1")[0] == ["7.0", "0", "0", "0"]
