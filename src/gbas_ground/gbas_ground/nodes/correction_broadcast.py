"""Node: monitored corrections in, VDB bursts out."""

from __future__ import annotations

from functools import partial
from typing import Any

from gbas_ground.broadcast import BroadcastState
from gbas_ground.nodes.configuration import station_params
from gbas_ground.station import GroundStation
from gbas_msgs_py import tables, topics
from gbas_msgs_py.records import IntegrityEpoch
from gbas_msgs_py.ros import empty_frame
from gbas_node.node import GbasNode
from gbas_node.params import ConfiguredParams
from gbas_node.serving import run


class CorrectionBroadcast(GbasNode):
    """Runs :meth:`GroundStation.broadcast`; a frame without bursts is announced, so that nobody waits for it."""

    params_type = ConfiguredParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("correction_broadcast", **kwargs)
        self.station = GroundStation(station_params(self, self.params.config))
        self.state = BroadcastState()
        self.bursts_sent = 0
        self.send = self.burst_publisher(topics.VDB, readers=1)
        self.table_subscription(topics.GROUND_INTEGRITY, tables.INTEGRITY, self.on_integrity)

    def on_integrity(self, integrity: IntegrityEpoch) -> None:
        self.when_ready(partial(self.step, integrity))

    def step(self, integrity: IntegrityEpoch) -> None:
        self.state, bursts = self.station.broadcast(self.state, integrity)
        for burst in bursts or (empty_frame(integrity.gps_week, integrity.tow_s),):
            self.send(burst)
        self.bursts_sent += len(bursts)
        self.finished_epoch(integrity.gps_week, integrity.tow_s)

    def details(self) -> dict[str, Any]:
        return {"bursts": self.bursts_sent}


def main() -> None:
    """Console script."""
    run(CorrectionBroadcast)


if __name__ == "__main__":
    main()
