"""Node: a simulated world in the place of receivers; it drives time for all the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.parameters import Parameter, merged, nested, parameters
from gbas_msgs_py import tables, topics
from gbas_msgs_py.joining import ReceptionQueue
from gbas_msgs_py.tables import TruthEpoch
from gbas_node.driver import DriverNode
from gbas_node.params import DriverParams
from gbas_node.serving import run
from gbas_sim.params import TroposphereSection
from gbas_sim.scenario import SECTION, open_world, read_sections, scenario_from_mapping, sim_params
from gbas_sim.simulated_epochs import SimulatedEpoch, Truth
from gbas_sim.world import World

ACK_TIMEOUT_S = 10.0
EPHEMERIS_LEAD_S = 60.0
"""How long before they take effect ephemerides are sent [s]; nothing uses them for 120 s after."""


@parameters
class SimulatorParams(DriverParams):
    """Parameters of the node beside those of every driver; the world's are in the file and in ``sim.*``."""

    config: Annotated[
        str, Parameter("site file (gbas_sim.scenario); ROS parameters ground.* and sim.* count more than it does")
    ] = ""


class Simulator(DriverNode[SimulatedEpoch]):
    """Sends a :class:`gbas_sim.world.World`, epoch by epoch, and where the aircraft really is."""

    params_type = SimulatorParams

    def __init__(self, **kwargs: Any) -> None:
        self._world: World | None = None
        super().__init__("simulator", **kwargs)
        sections, source = self._sections()
        sim, world = sim_params(sections, source=source), self.world.params
        in_use = replace(sim, duration_s=world.length_s, troposphere=TroposphereSection(**vars(world.troposphere)))
        self.show_parameters(in_use, f"{SECTION}.")
        self.ephemerides: ReceptionQueue[Ephemeris] = ReceptionQueue()
        for each in self.world.ephemerides:
            self.ephemerides.add(epoch_key(each.gps_week, each.tow_s), each)
        self.ephemeris = self.table_publisher(topics.EPHEMERIS, tables.EPHEMERIS, readers=1)
        self.receivers = [
            self.table_publisher(topic, tables.OBSERVATIONS, readers=1)
            for topic in topics.GROUND_OBSERVATIONS[: len(self.world.params.receiver_ecef_m)]
        ]
        if self.flies():
            self.aircraft = self.table_publisher(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, readers=1)
            self.truth = self.table_publisher(topics.TRUTH_AIRBORNE, tables.TRUTH)

    @property
    def world(self) -> World:
        """The world of the parameters, made when it is first asked for."""
        if self._world is None:
            self._world = self.make_world()
        return self._world

    def make_world(self) -> World:
        """A world of the parameters."""
        sections, source = self._sections()
        return open_world(scenario_from_mapping(sections, source=source), source=source)

    def _sections(self) -> tuple[dict[str, Any], str]:
        config = self.params.config
        given = {key: value for key, value in self.overrides().items() if key.startswith(("ground.", f"{SECTION}."))}
        return merged(read_sections(config) if config else {}, nested(given)), config or "ROS parameters"

    def flies(self) -> bool:
        return self.world.params.flight is not None

    def epochs(self) -> Iterator[SimulatedEpoch]:
        return iter(self.world)

    def send(self, epoch: SimulatedEpoch) -> None:
        self._send_ephemerides(epoch.key + round(EPHEMERIS_LEAD_S * 1000.0))
        for publisher, observations in zip(self.receivers, epoch.ground, strict=True):
            publisher.publish(observations)
        if epoch.airborne is not None and epoch.truth is not None:
            self.truth.publish(_truth_record(epoch.truth))
            self.aircraft.publish(epoch.airborne)

    def _send_ephemerides(self, key: int) -> None:
        due = self.ephemerides.take(key)
        for ephemeris in due:
            self.ephemeris.publish(ephemeris)
        if due and not self.ephemeris.settled(ACK_TIMEOUT_S):
            self.problem("ephemerides not acknowledged", f"within {ACK_TIMEOUT_S:g} s")


def _truth_record(truth: Truth) -> TruthEpoch:
    names = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps")
    values = (*truth.position_m.tolist(), *truth.velocity_mps.tolist())
    return TruthEpoch(
        gps_week=truth.gps_week,
        tow_s=truth.tow_s,
        roll_rad=truth.roll_rad,
        pitch_rad=truth.pitch_rad,
        heading_rad=truth.heading_rad,
        **dict(zip(names, values, strict=True)),
    )


def main() -> None:
    """Console script."""
    run(Simulator)


if __name__ == "__main__":
    main()
