"""Flow control and playback speed of a driver, without a clock and without ROS.

A driver (receiver replay, simulator, player) may have at most `window_epochs` epochs under way: an epoch is under way
from its sending until every reader that matters has said that it has finished with it. So queues are finite and nothing
is lost at any speed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence


class Pacer:
    """Counts the epochs under way.

    Parameters
    ----------
    window_epochs : int
        Most epochs under way.
    wait_for : sequence of str
        Readers whose progress counts; empty means that none is waited for.
    """

    def __init__(self, window_epochs: int, wait_for: Sequence[str]) -> None:
        if window_epochs < 1:
            raise ValueError(f"window_epochs is {window_epochs}, expected 1 or more")
        self._window = window_epochs
        self._sent: deque[tuple[int, tuple[str, ...]]] = deque()
        self._progress: dict[str, int | None] = dict.fromkeys(wait_for)
        self.n_sent = 0

    def may_send(self) -> bool:
        """Whether another epoch may be sent now."""
        return len(self._sent) < self._window

    def sent(self, key: int, readers: Sequence[str] | None = None) -> None:
        """An epoch has been sent, of which `readers` (all, unless given) will report; keys must grow."""
        names = tuple(self._progress) if readers is None else tuple(name for name in readers if name in self._progress)
        self.n_sent += 1
        if names:
            self._sent.append((key, names))

    def on_progress(self, name: str, key: int) -> bool:
        """A reader has finished with all epochs up to `key`; True when that lets another epoch be sent."""
        if name not in self._progress:
            return False
        before = self._progress[name]
        self._progress[name] = key if before is None else max(before, key)
        was_full = not self.may_send()
        while self._sent and not self._awaited(*self._sent[0]):
            self._sent.popleft()
        return was_full and self.may_send()

    @property
    def outstanding(self) -> int:
        """Epochs under way."""
        return len(self._sent)

    @property
    def lagging(self) -> tuple[str, ...]:
        """Readers that have not finished with the oldest epoch under way."""
        return self._awaited(*self._sent[0]) if self._sent else ()

    def _awaited(self, key: int, names: tuple[str, ...]) -> tuple[str, ...]:
        marks = [(name, self._progress[name]) for name in names]
        return tuple(name for name, mark in marks if mark is None or mark < key)


class Playback:
    """When each epoch is due on the caller's monotonic clock.

    Parameters
    ----------
    speed : float
        Multiple of real time; 0 for as fast as the readers go.
    """

    def __init__(self, speed: float) -> None:
        if not 0.0 <= speed < float("inf"):
            raise ValueError(f"speed is {speed!r}, expected 0 (as fast as possible) or a finite multiple of real time")
        self._speed = speed
        self._origin: tuple[int, float] | None = None

    def delay_s(self, key: int, now_s: float) -> float:
        """Seconds from `now_s` until the epoch is due; 0 when it is due. The first epoch asked for is due at once."""
        if self._speed == 0.0:
            return 0.0
        if self._origin is None:
            self._origin = (key, now_s)
        first_key, first_s = self._origin
        return max(0.0, first_s + (key - first_key) / 1000.0 / self._speed - now_s)
