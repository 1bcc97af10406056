"""What a check of a bag finds: problems by file, topic and index, and notes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

MAX_PROBLEMS: Final = 1000
"""More are counted but not listed."""


@dataclass(frozen=True)
class Problem:
    """Something that is wrong with a bag, and where."""

    what: str
    file: str
    topic: str | None = None
    index: int | None = None

    def __str__(self) -> str:
        place = self.file
        if self.topic is not None:
            place += f": {self.topic}"
        if self.index is not None:
            place += f" message {self.index}"
        return f"{place}: {self.what}"


@dataclass
class CheckResult:
    """What a check found."""

    bag: Path
    messages: int = 0
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unlisted: int = 0
    checked: Counter[str] = field(default_factory=Counter)

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problems

    def problem(self, problem: Problem) -> None:
        """Note a problem."""
        if len(self.problems) < MAX_PROBLEMS:
            self.problems.append(problem)
        else:
            self.unlisted += 1

    def as_json(self) -> dict[str, Any]:
        """The result as JSON-able data."""
        return {
            "bag": str(self.bag),
            "ok": self.ok,
            "messages": self.messages,
            "checked": dict(self.checked),
            "problems": [
                {"file": each.file, "topic": each.topic, "index": each.index, "what": each.what}
                for each in self.problems
            ],
            "problems_not_listed": self.unlisted,
            "notes": self.notes,
        }


def text_of(error: Exception) -> str:
    return str(error) or type(error).__name__


def problems_of(result: CheckResult) -> Iterator[str]:
    """The problems as lines."""
    yield from (str(problem) for problem in result.problems)
    if result.unlisted:
        yield f"and {result.unlisted} more"
