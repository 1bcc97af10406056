"""Node: a simulated world in the place of receivers; it drives time for all the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from gbas_msgs_py import tables, topics
from gbas_msgs_py.driver import DriverNode, DriverParams
from gbas_msgs_py.node import run
from gbas_msgs_py.tables import TruthEpoch
from gbas_sim.scenario import read_sections, scenario_from_mapping, scenario_values
from gbas_sim.world import SimulatedEpoch, Truth, World

ACK_TIMEOUT_S = 10.0


@dataclass(frozen=True, kw_only=True)
class SimulatorParams(DriverParams):
    """Parameters of the node beside those of every driver; the world's are in the file and in ``sim.*``.

    Attributes
    ----------
    config : str
        Site file, see :mod:`gbas_sim.scenario`; ROS parameters ``ground.*`` and ``sim.*`` count more than it does.
    """

    config: str = ""


class Simulator(DriverNode[SimulatedEpoch]):
    """Sends a :class:`gbas_sim.world.World`, epoch by epoch, and where the aircraft really is."""

    params_type = SimulatorParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("simulator", self.params_type, **kwargs)
        config = self.params.config
        given = {key: value for key, value in self.overrides().items() if key.startswith(("ground.", "sim."))}
        sections = {**(read_sections(config) if config else {}), **given}
        scenario = scenario_from_mapping(sections, source=config or "ROS parameters")
        for key, value in scenario_values(scenario).items():
            self.declare_read_only(key, value, "simulated world")
        self.world = World(scenario)
        self.ephemeris = self.table_publisher(topics.EPHEMERIS, tables.EPHEMERIS, readers=1)
        self.receivers = [
            self.table_publisher(topic, tables.OBSERVATIONS, readers=1)
            for topic in topics.GROUND_OBSERVATIONS[: len(scenario.receiver_ecef_m)]
        ]
        self.aircraft = self.table_publisher(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, readers=1)
        self.truth = self.table_publisher(topics.TRUTH_AIRBORNE, tables.TRUTH)

    def epochs(self) -> Iterator[SimulatedEpoch]:
        self.ephemeris.publish(self.world.ephemeris)
        if not self.ephemeris.settled(ACK_TIMEOUT_S):
            self.problem("ephemerides not acknowledged", f"within {ACK_TIMEOUT_S:g} s")
        return iter(self.world)

    def send(self, epoch: SimulatedEpoch) -> None:
        for publisher, observations in zip(self.receivers, epoch.ground, strict=True):
            publisher.publish(observations)
        self.truth.publish(_truth_record(epoch.truth))
        self.aircraft.publish(epoch.airborne)


def _truth_record(truth: Truth) -> TruthEpoch:
    names = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps")
    values = (*truth.position_m.tolist(), *truth.velocity_mps.tolist())
    return TruthEpoch(gps_week=truth.gps_week, tow_s=truth.tow_s, **dict(zip(names, values, strict=True)))


def main() -> None:
    """Console script."""
    run(Simulator)


if __name__ == "__main__":
    main()
