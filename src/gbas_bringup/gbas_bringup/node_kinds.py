"""The programs of the suite that can be started, and in which order they are ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from gbas_msgs_py.topics import DEFAULT_NAMESPACE


class Stage(IntEnum):
    """Place in the flow of data; nodes are ended in this order, so that nothing is left on its way."""

    DRIVER = 0
    GROUND = 1
    AIRBORNE = 2
    RECORDER = 3


@dataclass(frozen=True, kw_only=True)
class NodeKind:
    """A program: its node name, where its class is, and its stage."""

    name: str
    module: str
    class_name: str
    stage: Stage
    needs: str = ""
    """Section of the parameters without which it has nothing to do."""


NODE_KINDS: Final[dict[str, NodeKind]] = {
    kind.name: kind
    for kind in (
        NodeKind(
            name="receiver_replay",
            module="gbas_ground.nodes.receiver_replay",
            class_name="ReceiverReplay",
            stage=Stage.DRIVER,
        ),
        NodeKind(
            name="simulator",
            module="gbas_sim.nodes.simulator",
            class_name="Simulator",
            stage=Stage.DRIVER,
            needs="sim",
        ),
        NodeKind(name="player", module="gbas_bags.player", class_name="Player", stage=Stage.DRIVER),
        NodeKind(
            name="integrity_monitor",
            module="gbas_ground.nodes.integrity_monitor",
            class_name="IntegrityMonitor",
            stage=Stage.GROUND,
            needs="ground",
        ),
        NodeKind(
            name="correction_broadcast",
            module="gbas_ground.nodes.correction_broadcast",
            class_name="CorrectionBroadcast",
            stage=Stage.GROUND,
            needs="ground",
        ),
        NodeKind(
            name="positioning",
            module="gbas_airborne.nodes.positioning",
            class_name="Positioning",
            stage=Stage.AIRBORNE,
            needs="airborne",
        ),
        NodeKind(
            name="protection_level",
            module="gbas_airborne.nodes.protection_level",
            class_name="ProtectionLevel",
            stage=Stage.AIRBORNE,
            needs="airborne",
        ),
        NodeKind(name="recorder", module="gbas_bags.recorder", class_name="Recorder", stage=Stage.RECORDER),
    )
}


@dataclass(frozen=True, kw_only=True)
class NodeInstance:
    """A node to start."""

    kind: NodeKind
    namespace: str = DEFAULT_NAMESPACE

    @property
    def full_name(self) -> str:
        """Name with namespace, as in a parameter file."""
        return f"{self.namespace}/{self.kind.name}"

    @property
    def label(self) -> str:
        """Short name for people: without the usual namespace."""
        inside = self.namespace.removeprefix(DEFAULT_NAMESPACE).strip("/")
        return f"{inside}/{self.kind.name}" if inside else self.kind.name

    @property
    def progress(self) -> str:
        """Its progress as a driver's ``wait_for`` names it."""
        if self.namespace == DEFAULT_NAMESPACE:
            return self.kind.name
        return f"{self.namespace}/progress/{self.kind.name}"
