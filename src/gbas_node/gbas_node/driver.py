"""Base of the nodes that drive time: they send epochs no faster than their readers take them.

A driver waits for all its readers, sends epochs (paced by wall time, or as fast as the readers go), waits until the
readers have finished with the last, says so in a ``finished`` event, and ends with exit code 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any, ClassVar, Final, Generic, Protocol, TypeVar

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event
from gbas_msgs_py.joining import ReceptionQueue
from gbas_msgs_py.tables import EPHEMERIS, ProgressEpoch
from gbas_node.node import STATUS_OK, STATUS_STALE, GbasNode
from gbas_node.pacing import Pacer, Playback
from gbas_node.params import DriverParams

_AT_ONCE_S = 0.0
_WHILE_WAITING_S = 0.01


class DrivenEpoch(Protocol):
    """What a driver sends at one epoch."""

    @property
    def key(self) -> int:
        """Epoch [ms since the start of GPS time]."""


E = TypeVar("E", bound=DrivenEpoch)


class EphemerisFeed:
    """Sends ephemerides a little before the epoch of their reception; readers use them from that epoch on.

    Parameters
    ----------
    node : GbasNode
        The driver.
    topic : str
    ephemerides : iterable of Ephemeris
        In any order.
    """

    LEAD_MS: Final = 60_000
    ACK_TIMEOUT_S: Final = 10.0

    def __init__(self, node: GbasNode, topic: str, ephemerides: Iterable[Ephemeris]) -> None:
        self._node = node
        self._publisher = node.table_publisher(topic, EPHEMERIS, readers=1)
        self._queue: ReceptionQueue[Ephemeris] = ReceptionQueue()
        for each in ephemerides:
            self._queue.add(epoch_key(each.gps_week, each.tow_s), each)

    def send(self, key: int) -> None:
        """Send what readers may need up to the epoch `key`, and wait until they have it."""
        due = self._queue.take(key + self.LEAD_MS)
        for ephemeris in due:
            self._publisher.publish(ephemeris)
        if due and not self._publisher.settled(self.ACK_TIMEOUT_S):
            self._node.problem("ephemerides not acknowledged", f"within {self.ACK_TIMEOUT_S:g} s")


class DriverNode(GbasNode, Generic[E]):
    """A node that drives time; subclasses make the epochs and send them."""

    params_type: ClassVar[type[Any]] = DriverParams

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.readers = (*self.params.wait_for_ground, *(self.params.wait_for if self.flies() else ()))
        self.pacer = Pacer(self.params.window_epochs, self.readers)
        self._playback = Playback(self.params.speed)
        self._epochs: Iterator[E] | None = None
        self._next: E | None = None
        self._started_s: float | None = None
        self._first_key = 0
        self._begun_s = self._progress_s = self.now_s()
        self._lacking: list[str] = []
        self.publish_schemas()
        self.set_clock = self.clock_publisher()
        for reader in self.readers:
            self.progress_subscription(reader, partial(self._on_progress, reader))

    # --- what a subclass provides

    def epochs(self) -> Iterator[E]:
        """The epochs to send, in order."""
        raise NotImplementedError

    def send(self, epoch: E) -> None:
        """Publish one epoch."""
        raise NotImplementedError

    def flies(self) -> bool:
        """Whether there are airborne observations at all; asked during construction."""
        return True

    def is_airborne(self, epoch: E) -> bool:
        """Whether the epoch has airborne observations, so that the readers of `wait_for` will report on it."""
        return True

    # --- driving

    def due(self, now_s: float) -> float:
        """Send what may be sent; returns seconds until there may be more."""
        if self._started_s is None and not self._readers_are_there(now_s):
            return _WHILE_WAITING_S
        if self.pacer.outstanding and now_s - self._progress_s > self.params.stall_s:
            self.fail(f"no progress of {', '.join(self.pacer.lagging)} for {self.params.stall_s:g} s")
        return self._pump()

    def _on_progress(self, reader: str, progress: ProgressEpoch) -> None:
        before = self.pacer.outstanding
        self.pacer.on_progress(reader, epoch_key(progress.gps_week, progress.tow_s))
        if self.pacer.outstanding < before:  # readers repeat what they said last, which is no progress
            self._progress_s = self.now_s()
        if self._started_s is not None:
            self._pump()

    def _pump(self) -> float:
        """Send at most a window of epochs, so that progress and signals are seen between."""
        for _ in range(self.params.window_epochs):
            if self.exit_code is not None or self._next is None:
                self._finish_when_done()
                return _WHILE_WAITING_S
            now_s = self.now_s()
            delay_s = self._playback.delay_s(self._next.key, now_s)
            if delay_s > 0.0 or not self.pacer.may_send():
                return delay_s or _WHILE_WAITING_S
            self._send(self._next)
        return _AT_ONCE_S

    def _send(self, epoch: E) -> None:
        readers = self.readers if self.is_airborne(epoch) else self.params.wait_for_ground
        if not self.pacer.outstanding:
            self._progress_s = self.now_s()
        self.set_clock(*from_epoch_key(epoch.key))
        self.send(epoch)
        self.pacer.sent(epoch.key, readers)
        self.processed += 1
        self.last_epoch = from_epoch_key(epoch.key)
        self._next = next(self._epochs, None) if self._epochs is not None else None

    def _readers_are_there(self, now_s: float) -> bool:
        self._lacking = self.gate.missing_readers()
        silent = [reader for reader in self.readers if not self.has_progress_publisher(reader)]
        self._lacking += [f"no node reports progress as {reader}" for reader in silent]
        if self._lacking:
            if now_s - self._begun_s > self.params.start_wait_s:
                self.fail(f"after {self.params.start_wait_s:g} s: {'; '.join(self._lacking)}")
            return False
        self._started_s = self._progress_s = now_s
        self._epochs = self.epochs()
        self._next = next(self._epochs, None)
        self._first_key = 0 if self._next is None else self._next.key
        return True

    def _finish_when_done(self) -> None:
        if self.exit_code is not None or self.pacer.outstanding:
            return
        self._say_finished()
        self.log(f"{self.processed} epochs at {self.achieved_speed(self.now_s()):.1f} times real time")
        self.end()

    def _say_finished(self) -> None:
        week, tow_s = self.last_epoch or (0, 0.0)
        event = Event(gps_week=week, tow_s=tow_s, kind=EventKind.FINISHED, subject=self.get_name(), cause="end_of_data",
                      value=float(self.processed), source=self.get_name())  # fmt: skip
        self.publish_events([event])

    # --- diagnostics

    def health(self, now_s: float) -> tuple[bytes, str]:
        """Level and text of the driver's own status."""
        if self._started_s is None:
            return STATUS_STALE, f"starting: {'; '.join(self._lacking)}"
        if self.exit_code is not None:
            return STATUS_OK, "finished"
        return STATUS_OK, f"running at {self.achieved_speed(now_s):.1f} times real time"

    def achieved_speed(self, now_s: float) -> float:
        """Data time over wall time since the start."""
        if self._started_s is None or self.last_epoch is None:
            return 0.0
        return (epoch_key(*self.last_epoch) - self._first_key) / 1000.0 / max(now_s - self._started_s, 1e-3)

    def details(self) -> dict[str, Any]:
        """Counts of the flow control."""
        return {"outstanding": self.pacer.outstanding, "waiting_for": ", ".join(self.pacer.lagging)}
