"""The simulated world through both ends of the suite: without noise, the corrected position is the truth."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import AirborneOutput, Chain
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.io.recording import RecordedEpoch
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ServiceType
from gbas_sim.scenario import scenario_from_mapping
from gbas_sim.world import World
from simulated_station import GROUND


def fly(refractivity=379.0, **sim):
    """Errors in the approach frame (epochs, 3) [m], services, levels and distances to the threshold of an approach."""
    ground = GROUND | {"atmosphere": GROUND["atmosphere"] | {"refractivity": refractivity}}
    flight = {"level_time_s": 220.0, "intercept_distance_m": 5000.0}
    world = World(scenario_from_mapping({"ground": ground, "sim": {"flight": flight, **sim}}))
    chain = Chain(
        GroundParams.from_mapping(ground),
        AirborneParams.from_mapping({"systems": "GE", "rpds": 0}),
        [world.ephemeris],
        [world.ephemeris],
    )
    truth = {}

    def epochs():
        for epoch in world:
            truth[epoch.key] = epoch.truth
            yield RecordedEpoch(key=epoch.key, ground=epoch.ground, user=epoch.airborne)

    outputs = [output for output in chain.run(epochs()) if isinstance(output, AirborneOutput)]
    approach = world.params.flight.approach
    true_m = np.array([truth[epoch_key(o.solution.gps_week, o.solution.tow_s)].position_m for o in outputs])
    found_m = np.array([[o.solution.x_m, o.solution.y_m, o.solution.z_m] for o in outputs])
    errors = (found_m - true_m) @ approach.rot_approach_ecef.T
    service = np.array([o.protection.service for o in outputs])
    levels = np.array([[o.protection.lpl_m, o.protection.vpl_m] for o in outputs])
    return errors, service, levels, approach.deviations(true_m).distance_m


@pytest.mark.parametrize(("refractivity", "reach_m", "bound_m"), [(16.0, 10_000.0, 0.01), (379.0, 1500.0, 0.02)])
def test_without_noise_the_position_is_the_truth(refractivity, reach_m, bound_m):
    """Below 1 cm once the filters have settled, whatever clocks, group delays, motion and height.

    The air is thinnest that a station can broadcast, or that of the site. The height difference is corrected exactly;
    what remains is that aircraft and station see a satellite at elevations which differ by their distance over the
    Earth's radius: with 379, at 1500 m and 5 degrees, 2.4e-4 rad x 3 m x cos E / sin^2 E = 9 cm on the lowest satellite
    and about a tenth of that in position.
    """
    quiet = {"noise_scale": 0.0}
    errors, service, _, distance = fly(refractivity, ground_receiver=quiet, airborne_receiver=quiet)
    near = (np.abs(distance) < reach_m) & (service == ServiceType.C)
    assert near.sum() > 30
    assert np.abs(errors[near]).max() < bound_m


def test_with_noise_the_protection_levels_hold():
    errors, service, levels, _ = fly()
    served = service == ServiceType.C
    # Corrections begin 230 s after the start.
    assert served.mean() > 0.2
    assert (np.abs(errors[served][:, 1]) < levels[served, 0]).all()
    assert (np.abs(errors[served][:, 2]) < levels[served, 1]).all()
    # Thermal noise smoothed over 100 s: 0.5 m x sqrt(0.5 / 200) = 2.5 cm a range at the lowest satellites, and less
    # than that in position with 15 satellites and a dilution of about 1; five times that.
    assert np.abs(errors[served]).max() < 0.15
