"""GAST-D over the real bits: a station that claims it, and an approach with noise down to the threshold."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import AirborneOutput, Chain
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.io.recording import RecordedEpoch
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ServiceType
from gbas_msgs_py.modes import mode_of
from gbas_sim.scenario import scenario_from_mapping
from gbas_sim.world import World
from simulated_station import GROUND

STATION = GROUND | {
    "station": GROUND["station"] | {"gcid": 2},
    "atmosphere": GROUND["atmosphere"] | {"sigma_vert_iono_gradient_d": 4e-6},
    "ephemeris": {"k_md_e_c": 5.0, "k_md_e_d": 5.0},
    "gast_d": {"enabled": True},
    "vdb": {"slots": "ABC", "authentication": True},
    "approaches": {"rwy26": GROUND["approaches"]["rwy26"] | {"apd": 2, "rpi": "A26A"}},
}
RECEIVER = {"systems": "GE", "rpds": 0, "service": "D", "authentication": True, "aad": "B"}
FLIGHT = {"level_time_s": 300.0, "intercept_distance_m": 9000.0}


def fly() -> Iterator[tuple[AirborneOutput, np.ndarray]]:
    """Outputs with the errors of their positions in the approach frame (3,) [m]."""
    world = World(scenario_from_mapping({"ground": STATION, "sim": {"flight": FLIGHT}}))
    receiver = AirborneParams.from_mapping(RECEIVER)
    chain = Chain(GroundParams.from_mapping(STATION), receiver, [world.ephemeris], [world.ephemeris])
    truth = {}

    def epochs() -> Iterator[RecordedEpoch]:
        for epoch in world:
            truth[epoch.key] = epoch.truth
            yield RecordedEpoch(key=epoch.key, ground=epoch.ground, user=epoch.airborne)

    rotation = world.params.flight.approach.rot_approach_ecef
    for output in chain.run(epochs()):
        if isinstance(output, AirborneOutput):
            found = output.solution
            true_m = truth[epoch_key(found.gps_week, found.tow_s)].position_m
            yield output, rotation @ (np.array([found.x_m, found.y_m, found.z_m]) - true_m)


@pytest.mark.campaign
def test_an_approach_is_flown_with_gast_d() -> None:
    """C comes first, D when its satellites have been usable for 50 s, and stays to the threshold."""
    flown = list(fly())
    services = [ServiceType(int(output.protection.service)) for output, _ in flown]
    order = [each for k, each in enumerate(services) if k == 0 or each != services[k - 1]]
    assert order == [ServiceType.NONE, ServiceType.C, ServiceType.D]
    of_d = [(output, error) for output, error in flown if output.protection.service == ServiceType.D]
    assert len(of_d) > 200
    for output, error in of_d:
        solution, protection = output.solution, output.protection
        assert mode_of(solution.mode).name == "l1_30"
        assert abs(error[2]) <= protection.vpl_m
        assert abs(error[1]) <= protection.lpl_m
        assert solution.d_vert_m < 0.6  # quiet conditions, as Circiu et al. found
        assert protection.vpl_m < protection.val_m
    assert of_d[-1][0].solution.distance_to_ltp_m < 500.0
    # the errors are those of noise, not of nothing
    assert 0.01 < np.std([error[2] for _, error in of_d]) < 0.5
