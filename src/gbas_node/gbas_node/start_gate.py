"""The start of a chain of processes: work waits until its readers are there, so that nothing is lost."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from rclpy.publisher import Publisher


class StartGate:
    """Keeps work, in order, until every output has its readers or the wait has been long enough.

    Parameters
    ----------
    wait_s : float
        Longest wait from the first work on [s].
    """

    def __init__(self, wait_s: float) -> None:
        self._wait_s = wait_s
        self._outputs: list[tuple[Publisher, int]] = []
        self._backlog: deque[Callable[[], None]] = deque()
        self._since_s: float | None = None
        self._open = False

    def add(self, output: Publisher, readers: int) -> None:
        """Wait for that many readers of an output, too."""
        self._outputs.append((output, readers))

    @property
    def backlog(self) -> int:
        """Work that waits."""
        return len(self._backlog)

    @property
    def waiting(self) -> bool:
        """Whether there has been work, and it has to wait."""
        return not self._open and self._since_s is not None

    @property
    def starting(self) -> bool:
        """Whether an output may still be waited for."""
        return self._since_s is None or time.monotonic() < self._since_s + self._wait_s

    def when_ready(self, work: Callable[[], None]) -> None:
        """Do the work now, or as soon as the outputs have their readers; work keeps its order."""
        if self._open:
            work()
            return
        self._backlog.append(work)
        if self._since_s is None:
            self._since_s = time.monotonic()

    def missing_readers(self) -> list[str]:
        """Outputs that have fewer readers than they need, with how many."""
        counts = [(each.topic_name, each.get_subscription_count(), needed) for each, needed in self._outputs]
        return [f"{name} has {count} of {needed} readers" for name, count, needed in counts if count < needed]

    def open(self) -> None:
        """Do what has waited."""
        self._open = True
        while self._backlog:
            self._backlog.popleft()()
