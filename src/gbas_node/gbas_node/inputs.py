"""When a node heard something, when what others still owe it is given up, and what it must have heard first."""

from __future__ import annotations

import time
from typing import Any, Final

from rclpy.subscription import Subscription

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_msgs_py.joining import ReceptionQueue

_POLL_S: Final = 0.1
_GRACE_S: Final = 0.005


class InputWatch:
    """Wall time of a node's inputs.

    Attributes
    ----------
    activity : int
        Messages received so far, whatever they are.
    """

    def __init__(self) -> None:
        self.activity = 0
        self._heard_s = time.monotonic()
        self._first_heard_s: float | None = None
        self._overdue_at: int | None = None

    def heard(self) -> None:
        """Note an input whose absence would be reported."""
        self._heard_s = time.monotonic()
        self._first_heard_s = self._first_heard_s or self._heard_s

    def silent_s(self, now_s: float) -> float:
        """Time since the last input [s]."""
        return now_s - self._heard_s

    def wait_s(self, joiner: Any, now_s: float, start_wait_s: float) -> float:
        """Seconds until a joiner may give up on what is overdue; 0 is now.

        Inputs that were never heard get the time of the start. What is overdue is given one more chance to be received:
        the deadline may have passed while this process did not run.
        """
        deadline_s = joiner.deadline_s
        first_s = self._first_heard_s
        if deadline_s is None or first_s is None:
            return _POLL_S
        if not joiner.heard_all:
            deadline_s = max(deadline_s, first_s + start_wait_s)
        if now_s < deadline_s:
            return float(deadline_s - now_s)
        if self._overdue_at != self.activity:
            self._overdue_at = self.activity
            return _GRACE_S
        return 0.0


class EphemerisInput:
    """Ephemerides as a node receives them.

    An executor may hand an epoch's observations over before ephemerides that came earlier on a topic of their own
    (always possible with what came before it began). Drivers send an epoch when its ephemerides have been acknowledged,
    so that they wait in the subscription by then: it is emptied at each epoch.
    """

    def __init__(self, queue: ReceptionQueue[Ephemeris], subscription: Subscription) -> None:
        self._queue = queue
        self._subscription = subscription

    def take(self, key: int) -> tuple[Ephemeris, ...]:
        """All that were received at or before the epoch `key` and have not been taken."""
        handle, message_type = self._subscription.handle, self._subscription.msg_type
        with handle:
            while (taken := handle.take_message(message_type, True)) is not None:
                self._subscription.callback(taken[0])
        return self._queue.take(key)
