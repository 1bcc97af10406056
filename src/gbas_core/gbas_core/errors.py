"""Errors a person sees: one line that names the file, the field, the value and the bound.

Exit codes of the ``gbas`` command: 2 for bad input, 1 for a failure of our own, 130 on Ctrl-C.
"""

from __future__ import annotations

from pathlib import Path

EXIT_INTERNAL = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


class GbasError(RuntimeError):
    """Something a person can put right; the text is one line and complete."""

    exit_code = EXIT_BAD_INPUT


class BagError(GbasError):
    """A bag that is missing, damaged or not ours."""

    def __init__(self, path: Path | str, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = Path(path)
        self.problem = problem


class ConfigError(GbasError):
    """A configuration file, or a field in it, that cannot be used."""

    def __init__(self, path: Path | str, problem: str, field: str | None = None) -> None:
        where = f"{path}: {field}" if field else str(path)
        super().__init__(f"{where}: {problem}")
        self.path = Path(path)
        self.field = field
        self.problem = problem


class NodeDied(GbasError):
    """A node that ended by itself; carries its last lines."""

    exit_code = EXIT_INTERNAL

    def __init__(self, name: str, returncode: int, last_lines: tuple[str, ...]) -> None:
        how = f"was killed by signal {-returncode}" if returncode < 0 else f"exited with code {returncode}"
        tail = "".join(f"\n    {line}" for line in last_lines)
        super().__init__(f"node {name} {how}{'; its last lines:' if tail else ', without a word'}{tail}")
        self.name = name
        self.returncode = returncode
        self.last_lines = last_lines
