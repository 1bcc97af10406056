"""The player node: a recorded bag as the driver of time.

In mode ``inputs`` it publishes what the receivers gave (observations, ephemerides, truth), so that running nodes
compute everything else anew; flow control is that of every driver. In mode ``all`` it publishes everything as it was
recorded and waits for nobody. The bytes of a message are not touched.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from gbas_bags import epochs
from gbas_bags.bags import BagReader
from gbas_bags.capture import message_class
from gbas_bags.mcap_scan import Message
from gbas_bags.topic_names import contract_name, is_ephemeris, is_observation, is_progress, is_truth
from gbas_core.errors import BagError
from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_msgs_py import topics
from gbas_msgs_py.qos import qos_of
from gbas_msgs_py.ros import qos_profile
from gbas_node.driver import DriverNode
from gbas_node.params import DriverParams
from gbas_node.serving import run

NODE_NAME: Final = "player"
ACK_TIMEOUT_S: Final = 10.0
_LOOK_AHEAD: Final = 32
"""Epochs read ahead: messages of one epoch lie at most a driver's window apart in a bag."""
_NOT_PLAYED: Final = frozenset({topics.CLOCK, "/rosout", "/parameter_events"})
"""The player has a clock of its own; the others are ROS' own business."""


def is_input(topic: str) -> bool:
    """Whether a topic carries what a driver sends, and no node computes."""
    return is_observation(topic) or is_ephemeris(topic) or is_truth(topic)


@dataclass(order=True)
class PlayedEpoch:
    """Messages that are sent together."""

    key: int
    messages: list[Message] = field(compare=False, default_factory=list)


def input_key(message: Message) -> int | None:
    """Epoch with which an input is sent; None for those that go with the next one (ephemerides)."""
    if is_ephemeris(message.channel.topic):
        return None
    return epochs.epoch_of(message.channel.schema.name, message.data)


def log_key(message: Message) -> int | None:
    """Time at which a recorded message is sent again, as an epoch key."""
    return epochs.key_of_ros_time(message.log_time_ns)


def by_epoch(messages: Iterator[Message], key_of: Callable[[Message], int | None]) -> Iterator[PlayedEpoch]:
    """Group messages into epochs, in order of time; within an epoch they keep the order of the bag.

    A message without an epoch goes with the earliest one that has not been sent.
    """
    waiting: dict[int, PlayedEpoch] = {}
    order: list[int] = []
    loose: list[Message] = []
    sent: int | None = None
    for message in messages:
        key = key_of(message)
        if key is None and not order:
            loose.append(message)
            continue
        if key is None:
            key = order[0]
        elif sent is not None and key <= sent:
            continue  # an epoch that came back: no node would take it
        if key not in waiting:
            waiting[key] = PlayedEpoch(key, loose)
            loose = []
            heapq.heappush(order, key)
        waiting[key].messages.append(message)
        if len(order) > _LOOK_AHEAD:
            sent = heapq.heappop(order)
            yield waiting.pop(sent)
    while order:
        yield waiting.pop(heapq.heappop(order))


@parameters
class PlayerParams(DriverParams):
    """Parameters of the player beside those of every driver."""

    bag: Annotated[str, Parameter("folder of a bag, or a .mcap file")]
    mode: Annotated[
        Literal["inputs", "all"], Parameter("what is sent: the inputs of the nodes, or everything recorded")
    ] = "inputs"
    discovery_s: Annotated[
        float,
        Parameter(
            "in mode 'all' nobody is waited for by name: the time in which readers that are there are found",
            "s", 0.0, 60.0,
        ),
    ] = 1.0  # fmt: skip

    def __post_init__(self) -> None:
        if not self.bag:
            raise ParameterError("bag = '' is not a bag")


class Player(DriverNode[PlayedEpoch]):
    """Sends a bag."""

    params_type = PlayerParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(NODE_NAME, **kwargs)
        self._path = Path(self.params.bag)
        self._made_s = self.now_s()
        self._inputs_only = self.params.mode == "inputs"
        self._outputs = {
            name: self._output(name, msgtype) for name, msgtype in self.recorded.items() if self._played(name)
        }
        if self._inputs_only and not any(is_observation(name) for name in self._outputs):
            raise BagError(self._path, "holds no observations, so there is nothing to replay")

    @cached_property
    def recorded(self) -> dict[str, str]:
        """Topics of the bag and their types; reads it through, so a damaged one is refused before the start."""
        found: dict[str, str] = {}
        for message in BagReader(Path(self.params.bag)).messages():
            found[message.channel.topic] = message.channel.schema.name
        return found

    def _played(self, topic: str) -> bool:
        if self._inputs_only:
            return is_input(topic)
        return topic not in _NOT_PLAYED and not is_progress(topic)

    def _output(self, name: str, msgtype: str) -> Publisher:
        try:
            kind = message_class(msgtype)
        except LookupError as error:
            raise BagError(self._path, f"{name}: {error}") from error
        needed = self._inputs_only and (is_observation(name) or is_ephemeris(name))
        publisher = self.create_publisher(kind, name, qos_profile(qos_of(contract_name(name))))
        self.gate.add(publisher, int(needed) + self.params.recorders)
        return publisher

    def due(self, now_s: float) -> float:
        """Send what may be sent."""
        wait_s = self._made_s + self.params.discovery_s - now_s
        if wait_s > 0.0 and not self._inputs_only:
            return wait_s
        return super().due(now_s)

    def flies(self) -> bool:
        """Whether the bag has observations of an aircraft."""
        return topics.resolve(topics.AIRBORNE_OBSERVATIONS) in self.recorded

    def is_airborne(self, epoch: PlayedEpoch) -> bool:
        """Whether an aircraft was observing at this epoch."""
        name = topics.resolve(topics.AIRBORNE_OBSERVATIONS)
        return any(message.channel.topic == name for message in epoch.messages)

    def epochs(self) -> Iterator[PlayedEpoch]:
        """The bag, epoch by epoch."""
        chosen = (message for message in BagReader(self._path).messages() if self._played(message.channel.topic))
        return by_epoch(chosen, input_key if self._inputs_only else log_key)

    def send(self, epoch: PlayedEpoch) -> None:
        """Publish one epoch; the ephemerides first, and not before everybody has them anything else."""
        first = [message for message in epoch.messages if is_ephemeris(message.channel.topic)]
        for message in first:
            self._outputs[message.channel.topic].publish(message.data)
        for name in {message.channel.topic for message in first} if self._inputs_only else ():
            if not self._outputs[name].wait_for_all_acked(Duration(seconds=ACK_TIMEOUT_S)):
                self.problem("ephemerides not acknowledged", f"within {ACK_TIMEOUT_S:g} s")
        for message in epoch.messages:
            if not is_ephemeris(message.channel.topic):
                self._outputs[message.channel.topic].publish(message.data)


def main() -> None:
    """Run the player."""
    run(Player)


if __name__ == "__main__":
    main()
