"""Joining streams by epoch, without a clock and without ROS.

Epochs are keys: milliseconds since the start of GPS time (:func:`gbas_core.gnss.gpstime.epoch_key`). Data decide when
an epoch is complete; wall-clock deadlines, whose times the caller passes in, decide only when something is missing.
What is given out depends on the data alone as long as no deadline passes, whatever the order in which streams
interleave: that is why live, accelerated and offline runs, which all join through this module, agree bit for bit.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from gbas_core.gnss.epoch_order import RefusedEpochs
from gbas_core.gnss.gpstime import epoch_key
from gbas_vdb.transmission.burst import Burst

T = TypeVar("T")

FRAME_MS: Final = 500
MAX_WAITING_BURSTS: Final = 4096
"""Bursts kept while no observation comes (more than ten minutes of a full schedule); beyond it the oldest are lost."""


@dataclass(frozen=True, kw_only=True)
class JoinedEpoch(Generic[T]):
    """One epoch of several sources.

    Attributes
    ----------
    key : int
        Epoch [ms since the start of GPS time].
    items : dict
        What each source delivered; a source that did not deliver is not in it.
    timed_out : tuple of str
        Sources that were still awaited when the deadline passed; empty when the data completed the epoch.
    """

    key: int
    items: dict[str, T]
    timed_out: tuple[str, ...] = ()


class EpochJoiner(Generic[T]):
    """Collects one item a source and epoch and gives out epochs in order.

    An epoch is complete when every source has delivered it or a later one (each stream is in order). It is given up
    `timeout_s` after its first item arrived. An item for an epoch already given out is late: dropped and counted. When
    nothing comes but late epochs, one after the other, the joiner begins anew with them.

    Parameters
    ----------
    sources : sequence of str
        Names of the streams.
    timeout_s : float
        Longest wait for the rest of an epoch after its first item.
    """

    def __init__(self, sources: Sequence[str], *, timeout_s: float) -> None:
        if not sources:
            raise ValueError("sources is empty, expected at least one")
        _check_timeout(timeout_s)
        self._watermark: dict[str, int | None] = dict.fromkeys(sources)
        self._timeout_s = timeout_s
        self._pending: dict[int, tuple[float, dict[str, T]]] = {}
        self._late = RefusedEpochs()
        self.last_key: int | None = None
        self.late = dict.fromkeys(sources, 0)
        self.duplicate = dict.fromkeys(sources, 0)
        self.timed_out = dict.fromkeys(sources, 0)

    def add(self, source: str, key: int, item: T, now_s: float) -> list[JoinedEpoch[T]]:
        """Deliver an item; returns the epochs it completes, in order. `now_s` is a monotonic time."""
        if self.last_key is not None and key <= self.last_key:
            self.late[source] += 1
            self._late = self._late.then(key)
            if not self._late.restart:
                return []
            self._begin_anew()
        self._late = RefusedEpochs()
        _, items = self._pending.setdefault(key, (now_s, {}))
        if source in items:
            self.duplicate[source] += 1
            return []
        items[source] = item
        mark = self._watermark[source]
        self._watermark[source] = key if mark is None else max(mark, key)
        marks = [m for m in self._watermark.values() if m is not None]
        return self._release_through(min(marks)) if len(marks) == len(self._watermark) else []

    def _begin_anew(self) -> None:
        self._pending.clear()
        self._watermark = dict.fromkeys(self._watermark)
        self.last_key = None

    def expire(self, now_s: float) -> list[JoinedEpoch[T]]:
        """Give up waiting where the deadline has passed; returns those epochs, and any before them, in order."""
        overdue = [key for key, (arrival, _) in self._pending.items() if arrival + self._timeout_s <= now_s]
        return self._release_through(max(overdue)) if overdue else []

    def flush(self) -> list[JoinedEpoch[T]]:
        """Give out all that is pending, at the end of the data."""
        return self._release_through(max(self._pending)) if self._pending else []

    @property
    def deadline_s(self) -> float | None:
        """Earliest deadline; None when nothing is pending."""
        if not self._pending:
            return None
        return min(arrival for arrival, _ in self._pending.values()) + self._timeout_s

    @property
    def heard_all(self) -> bool:
        """Whether every source has delivered something."""
        return None not in self._watermark.values()

    def __len__(self) -> int:
        return len(self._pending)

    def dropped(self, source: str) -> int:
        """Items of a source that were late or repeated."""
        return self.late[source] + self.duplicate[source]

    def _release_through(self, key: int) -> list[JoinedEpoch[T]]:
        joined = []
        for due in sorted(k for k in self._pending if k <= key):
            _, items = self._pending.pop(due)
            awaited = tuple(s for s, mark in self._watermark.items() if mark is None or mark < due)
            for source in awaited:
                self.timed_out[source] += 1
            joined.append(JoinedEpoch(key=due, items=items, timed_out=awaited))
            self.last_key = due
        return joined


class ReceptionQueue(Generic[T]):
    """Items that may be used from their own epoch on, such as ephemerides: given out once, in order of that epoch.

    A driver may deliver them as early as it likes: what an epoch sees depends on the data alone.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, T]] = []
        self._count = 0

    def add(self, key: int, item: T) -> None:
        """Deliver an item that is received at `key`; equal keys keep the order of delivery."""
        insort(self._waiting, (key, self._count, item), key=lambda entry: entry[:2])
        self._count += 1

    def take(self, key: int) -> tuple[T, ...]:
        """All items received at or before `key` that have not been given out."""
        due = 0
        while due < len(self._waiting) and self._waiting[due][0] <= key:
            due += 1
        taken, self._waiting = self._waiting[:due], self._waiting[due:]
        return tuple(item for _, _, item in taken)

    def __len__(self) -> int:
        return len(self._waiting)


@dataclass(frozen=True, kw_only=True)
class AirborneInput(Generic[T]):
    """What the airborne receiver has at one of its observation epochs.

    Attributes
    ----------
    key : int
        Epoch of the observation [ms since the start of GPS time].
    item
        The observation.
    bursts : tuple of Burst
        Bursts that arrived since the last observation, in order of frame and slot.
    timed_out : bool
        Whether the frame was still awaited when the deadline passed.
    """

    key: int
    item: T
    bursts: tuple[Burst, ...]
    timed_out: bool = False


class BurstQueue:
    """Assigns bursts to observation epochs: each burst is given out once, in order of frame and slot.

    The observation at t sees the frames that start at or before ``t - 0.5 s + correction_wait_s``: with 0.5 s (the
    default of the receiver) the frame that starts with its own epoch, with 0 the one before. A burst that comes after
    its observation goes to the next.

    Parameters
    ----------
    correction_wait_s : float
        How long the receiver holds an observation back for corrections; 0 emulates equipment that outputs at once.
    """

    def __init__(self, correction_wait_s: float) -> None:
        if not correction_wait_s >= 0.0:
            raise ValueError(f"correction_wait_s is {correction_wait_s!r}, expected 0 or more")
        self._wait_ms = round(correction_wait_s * 1000) - FRAME_MS
        self._waiting: list[tuple[int, int, Burst]] = []
        self._seen: dict[int, set[int]] = {}
        self.passed: int | None = None
        self.duplicate = 0
        self.overflow = 0

    def limit(self, key: int) -> int:
        """Start of the last frame the observation at `key` may see, or the latest instant before it."""
        return key + self._wait_ms

    def add(self, bursts: Iterable[Burst]) -> None:
        """Deliver bursts; an empty frame is a burst without payload whose `bursts_in_frame` is 0."""
        for burst in bursts:
            frame = epoch_key(burst.gps_week, burst.tow_s)
            slots = self._seen.setdefault(frame, set())
            if burst.bursts_in_frame > 0:
                if burst.slot in slots:
                    self.duplicate += 1
                    continue
                slots.add(burst.slot)
                insort(self._waiting, (frame, burst.slot, burst), key=lambda entry: entry[:2])
            complete = len(slots) >= burst.bursts_in_frame
            passed = frame if complete else frame - 1
            self.passed = passed if self.passed is None else max(self.passed, passed)
        while len(self._waiting) > MAX_WAITING_BURSTS:
            del self._waiting[0]
            self.overflow += 1

    def begin_anew(self, key: int) -> None:
        """Forget frames that the observation at `key` may not see: their time was wrong."""
        limit = self.limit(key)
        self._waiting = [entry for entry in self._waiting if entry[0] <= limit]
        self._seen = {frame: slots for frame, slots in self._seen.items() if frame <= limit}
        self.passed = max(self._seen) - 1 if self._seen else None  # the last may not be whole yet

    def complete(self, key: int) -> bool:
        """Whether every frame the observation at `key` may see is over: seen whole, or followed by a later one."""
        return self.passed is not None and self.passed >= self.limit(key)

    def take(self, key: int) -> tuple[Burst, ...]:
        """Bursts for the observation at `key`: of all frames up to its limit, those not given out before."""
        limit = self.limit(key)
        due = 0
        while due < len(self._waiting) and self._waiting[due][0] <= limit:
            due += 1
        taken, self._waiting = self._waiting[:due], self._waiting[due:]
        if len(self._seen) > MAX_WAITING_BURSTS:
            self._seen = {frame: slots for frame, slots in self._seen.items() if frame > limit}
        return tuple(burst for _, _, burst in taken)


class AirborneJoiner(Generic[T]):
    """Joins the airborne observations with the bursts; offline and live code both use it.

    Parameters
    ----------
    correction_wait_s : float
        See :class:`BurstQueue`.
    timeout_s : float
        An observation is processed without its frame this long after it arrived.
    """

    def __init__(self, *, correction_wait_s: float, timeout_s: float) -> None:
        _check_timeout(timeout_s)
        self._bursts = BurstQueue(correction_wait_s)
        self._timeout_s = timeout_s
        self._pending: list[tuple[int, float, T]] = []
        self._late = RefusedEpochs()
        self.last_key: int | None = None
        self.late = 0
        self.duplicate = 0
        self.timed_out = 0

    @property
    def heard_all(self) -> bool:
        """Whether any burst has been delivered."""
        return self._bursts.passed is not None

    def __len__(self) -> int:
        return len(self._pending)

    @property
    def dropped(self) -> int:
        """Observations that were late or repeated."""
        return self.late + self.duplicate

    @property
    def dropped_bursts(self) -> int:
        """Bursts of a frame and slot that was there before, and bursts for which no observation came."""
        return self._bursts.duplicate + self._bursts.overflow

    def add_observation(self, key: int, item: T, now_s: float) -> list[AirborneInput[T]]:
        """Deliver an observation; returns what can be processed, in order."""
        if self.last_key is not None and key <= self.last_key:
            self.late += 1
            self._late = self._late.then(key)
            if not self._late.restart:
                return []
            self._pending, self.last_key = [], None
            self._bursts.begin_anew(key)
        self._late = RefusedEpochs()
        if any(key == pending for pending, _, _ in self._pending):
            self.duplicate += 1
        else:
            insort(self._pending, (key, now_s, item), key=lambda entry: entry[0])
        return self._release_complete()

    def add_burst(self, burst: Burst) -> list[AirborneInput[T]]:
        """Deliver a burst; returns what can be processed, in order."""
        self._bursts.add((burst,))
        return self._release_complete()

    def expire(self, now_s: float) -> list[AirborneInput[T]]:
        """Give up waiting where the deadline has passed; returns those observations, and any before them."""
        overdue = [place for place, (_, arrival, _) in enumerate(self._pending) if arrival + self._timeout_s <= now_s]
        return self._release(max(overdue) + 1) if overdue else []

    def flush(self) -> list[AirborneInput[T]]:
        """Give out all pending observations, at the end of the data."""
        return self._release(len(self._pending))

    @property
    def deadline_s(self) -> float | None:
        """Earliest deadline; None when nothing is pending."""
        return min(arrival for _, arrival, _ in self._pending) + self._timeout_s if self._pending else None

    def _release_complete(self) -> list[AirborneInput[T]]:
        count = 0
        while count < len(self._pending) and self._bursts.complete(self._pending[count][0]):
            count += 1
        return self._release(count)

    def _release(self, count: int) -> list[AirborneInput[T]]:
        due, self._pending = self._pending[:count], self._pending[count:]
        released = []
        for key, _, item in due:
            timed_out = not self._bursts.complete(key)
            self.timed_out += timed_out
            released.append(AirborneInput(key=key, item=item, bursts=self._bursts.take(key), timed_out=timed_out))
            self.last_key = key
        return released


def _check_timeout(timeout_s: float) -> None:
    if not timeout_s > 0.0:
        raise ValueError(f"timeout_s is {timeout_s!r}, expected more than 0")
