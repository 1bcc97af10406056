"""Node: observations of the reference receivers and ephemerides in, monitored corrections out."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_ground.nodes.configuration import station_params
from gbas_ground.station import GroundEpoch, GroundStation
from gbas_msgs_py import tables, topics
from gbas_msgs_py.joining import EpochJoiner, JoinedEpoch
from gbas_node.node import GbasNode
from gbas_node.params import JoiningParams
from gbas_node.serving import run


class IntegrityMonitor(GbasNode):
    """Joins the receivers by epoch and runs :meth:`GroundStation.monitor`."""

    params_type = JoiningParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("integrity_monitor", **kwargs)
        params = station_params(self, self.params.config)
        self.station = GroundStation(params)
        self.state = self.station.initial_integrity()
        self.receivers = tuple(f"rr{j}" for j in range(1, params.n_receivers + 1))
        self.joiner: EpochJoiner[ObservationEpoch] = EpochJoiner(self.receivers, timeout_s=self.params.join_timeout_s)
        self.integrity = self.table_publisher(topics.GROUND_INTEGRITY, tables.INTEGRITY, readers=1)
        self.statistics = self.table_publisher(topics.GROUND_MONITORS, tables.MONITORS)
        self.monitor_details = self.table_publisher(topics.GROUND_MONITOR_DETAILS, tables.MONITOR_DETAILS)
        self.channels = self.table_publisher(topics.GROUND_CHANNELS, tables.CHANNELS)
        self.publish_schemas()
        self.ephemerides = self.ephemeris_input()
        for receiver, topic in zip(self.receivers, topics.GROUND_OBSERVATIONS, strict=False):
            self.table_subscription(topic, tables.OBSERVATIONS, partial(self.on_observations, receiver))

    def on_observations(self, receiver: str, observations: ObservationEpoch) -> None:
        key = epoch_key(observations.gps_week, observations.tow_s)
        self.steps(self.joiner.add(receiver, key, observations, self.now_s()))
        self.note_counts(f"late or repeated epoch of {receiver}", self.joiner.dropped(receiver))

    def due(self, now_s: float) -> float:
        return self.enforce(self.joiner, now_s, self.steps)

    def steps(self, epochs: Iterable[JoinedEpoch[ObservationEpoch]]) -> None:
        for epoch in epochs:
            self.when_ready(partial(self.step, epoch))

    def step(self, joined: JoinedEpoch[ObservationEpoch]) -> None:
        """One epoch: corrections and monitors from the observations of all receivers that came in time."""
        for receiver in joined.timed_out:
            self.problem(f"no epoch from {receiver} in time")
        week, tow_s = from_epoch_key(joined.key)
        seen = [joined.items.get(receiver) for receiver in self.receivers]
        epoch = GroundEpoch(
            gps_week=week,
            tow_s=tow_s,
            observations=tuple(None if each is None or each.empty else each for each in seen),
            ephemerides=self.ephemerides.take(joined.key),
        )
        self.state, report = self.station.monitor(self.state, epoch)
        self.integrity.publish(report.integrity)
        self.statistics.publish(report.statistics)
        self.monitor_details.publish(report.details)
        self.channels.publish(report.channels)
        self.publish_events(report.events)
        self.finished_epoch(week, tow_s)

    def details(self) -> dict[str, Any]:
        return {"epochs_waiting": len(self.joiner), "receivers": len(self.receivers)}

    def finish(self) -> None:
        self.steps(self.joiner.flush())


def main() -> None:
    """Console script."""
    run(IntegrityMonitor)


if __name__ == "__main__":
    main()
