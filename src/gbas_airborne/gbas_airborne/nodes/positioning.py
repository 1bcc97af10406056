"""Node: airborne observations, VDB bursts and ephemerides in, position solutions out."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

from gbas_airborne.modes import configured_modes
from gbas_airborne.nodes.configuration import receiver_params
from gbas_airborne.receiver import AirborneReceiver, PositionState
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_msgs_py import tables, topics
from gbas_msgs_py.joining import AirborneInput, AirborneJoiner
from gbas_node.node import GbasNode
from gbas_node.params import JoiningParams
from gbas_node.serving import run
from gbas_vdb.transmission.burst import Burst


class Positioning(GbasNode):
    """Joins observations with bursts and runs :meth:`AirborneReceiver.position`."""

    params_type = JoiningParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("positioning", **kwargs)
        self.receiver = receiver_params(self, self.params.config)
        self.state = PositionState()
        self.joiner: AirborneJoiner[ObservationEpoch] = AirborneJoiner(
            correction_wait_s=self.receiver.correction_wait_s, timeout_s=self.params.join_timeout_s
        )
        self.solution = self.table_publisher(topics.AIRBORNE_SOLUTION, tables.SOLUTION, readers=1)
        self.modes = (
            self.table_publisher(topics.AIRBORNE_MODES, tables.MODES)
            if len(configured_modes(self.receiver)) > 1
            else None
        )
        self.publish_schemas()
        self.ephemerides = self.ephemeris_input()
        self.burst_subscription(topics.VDB, self.on_burst)
        self.table_subscription(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, self.on_observations)

    def on_burst(self, burst: Burst) -> None:
        self.steps(self.joiner.add_burst(burst))
        self.note_counts("repeated burst", self.joiner.dropped_bursts)

    def on_observations(self, observations: ObservationEpoch) -> None:
        key = epoch_key(observations.gps_week, observations.tow_s)
        self.steps(self.joiner.add_observation(key, observations, self.now_s()))
        self.note_counts("late or repeated epoch", self.joiner.dropped)

    def due(self, now_s: float) -> float:
        return self.enforce(self.joiner, now_s, self.steps)

    def steps(self, inputs: Iterable[AirborneInput[ObservationEpoch]]) -> None:
        for each in inputs:
            self.when_ready(partial(self.step, each))

    def step(self, joined: AirborneInput[ObservationEpoch]) -> None:
        """One epoch: position from the observations and the bursts that came with them."""
        if joined.timed_out:
            self.problem("no VDB frame in time")
        week, tow_s = from_epoch_key(joined.key)
        epoch = AirborneEpoch(
            gps_week=week,
            tow_s=tow_s,
            observations=None if joined.item.empty else joined.item,
            bursts=joined.bursts,
            ephemerides=self.ephemerides.take(joined.key),
        )
        self.state, selected = AirborneReceiver.position(self.state, epoch, self.receiver)
        self.solution.publish(selected.solutions[0])
        if self.modes is not None and selected.modes is not None:
            self.modes.publish(selected.modes)
        self.publish_events(selected.events)
        self.finished_epoch(week, tow_s)

    def details(self) -> dict[str, Any]:
        return {"epochs_waiting": len(self.joiner)}

    def finish(self) -> None:
        self.steps(self.joiner.flush())


def main() -> None:
    """Console script."""
    run(Positioning)


if __name__ == "__main__":
    main()
