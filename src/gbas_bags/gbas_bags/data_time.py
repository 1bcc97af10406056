"""The data's time of a recorded message: what a bag is laid out along, whatever speed it was made at.

rosbag2 does the same when it records with ``use_sim_time``. The wall clock of the publisher stays in the message's
publish time.
"""

from __future__ import annotations

import json
from typing import Final

from gbas_bags import epochs
from gbas_bags.topic_names import is_ephemeris, is_observation, split
from gbas_msgs_py import topics

_BESIDE_PROTECTION: Final = (
    topics.AIRBORNE_VPL,
    topics.AIRBORNE_LPL,
    topics.AIRBORNE_VAL,
    topics.AIRBORNE_LAL,
    topics.AIRBORNE_SERVICE,
)


class DataTime:
    """Follows the data's time as messages pass, and says to which time each belongs.

    Attributes
    ----------
    current : int or None
        Epoch key of the newest observation or clock; None before the first.
    """

    def __init__(self) -> None:
        self.current: int | None = None
        self._newest: dict[str, int] = {}
        self._partner: dict[str, str | None] = {}

    def key_of(self, topic: str, msgtype: str, data: bytes) -> int | None:
        """Epoch key of a message; that of the time at which it came if it carries none, None if that is unknown."""
        try:
            own = self._own(topic, msgtype, data)
        except epochs.PayloadError:
            own = None
        if own is None:
            return self._borrowed(topic)
        if is_observation(topic) or msgtype == epochs.CLOCK_TYPE:
            self.current = own if self.current is None else max(self.current, own)
        self._newest[topic] = own
        return own

    def _own(self, topic: str, msgtype: str, data: bytes) -> int | None:
        if is_ephemeris(topic):
            return None  # its epoch is the time of reception, which may lie well before the recording
        if msgtype == epochs.STRING_TYPE:
            return _event_epoch(data) if topic == topics.EVENTS else None
        return epochs.epoch_of(msgtype, data)

    def _borrowed(self, topic: str) -> int | None:
        if topic not in self._partner:
            namespace, name = split(topic)
            beside = name in _BESIDE_PROTECTION
            self._partner[topic] = f"{namespace}/{topics.AIRBORNE_PROTECTION}" if beside else None
        partner = self._partner[topic]
        if partner is None:
            return self.current
        return self._newest.get(partner, self.current)


def _event_epoch(data: bytes) -> int | None:
    try:
        key = json.loads(epochs.string_of(data)).get("epoch")
    except (ValueError, AttributeError):
        return None
    return key if isinstance(key, int) else None
