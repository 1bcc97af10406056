"""Nodes that a test starts, as the launcher does, with their output in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from gbas_bringup.node_process import NodeProcess

END_S = 60.0


class LoggedNode(NodeProcess):
    """A node as a process."""

    def __init__(self, module: str, arguments: Sequence[str], environment: Mapping[str, str], log: Path) -> None:
        self.module = module
        self._log = log
        with log.open("wb") as out:
            super().__init__(module, arguments, environment, out.fileno())

    @property
    def output(self) -> str:
        return self._log.read_text(errors="replace")

    @property
    def running(self) -> bool:
        return self.poll() is None

    def end(self, number: int | None = None, timeout_s: float = END_S) -> tuple[int, str]:
        """Exit code and output, after a signal or by itself."""
        if number is not None:
            self.send_signal(number)
        return self.wait(timeout_s), self.output

    def wait(self, timeout_s: float | None = END_S) -> int:
        """Exit code; the process must end by itself."""
        code = super().wait(timeout_s)
        if code is None:
            pytest.fail(f"{self.module} did not end within {timeout_s} s\n{self.output}")
        return code
