"""The simulated world through both ends with two bands: every way of processing finds the truth, over the real bits."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import AirborneOutput, Chain
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.io.recording import RecordedEpoch
from gbas_ground.params import GroundParams
from gbas_msgs_py.modes import mode_of
from gbas_msgs_py.products import L5_100
from gbas_sim.scenario import scenario_from_mapping
from gbas_sim.world import World
from simulated_station import GROUND

TWO_BANDS = GROUND | {
    "second_band": {"products": ["l5_100", "l5_30"]}, "gast_d": {"enabled": True}, "vdb": {"slots": "ABCD"},
}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    """Errors of each mode in the approach frame within 1.5 km of the threshold, and the last integrity."""
    quiet = {"noise_scale": 0.0}
    flight = {"level_time_s": 220.0, "intercept_distance_m": 4000.0}
    sim = {"interval_s": 1.0, "flight": flight, "ground_receiver": quiet, "airborne_receiver": quiet}
    world = World(scenario_from_mapping({"ground": TWO_BANDS, "sim": sim}))
    airborne = AirborneParams.from_mapping({"systems": "GE", "rpds": 0, "modes": ["all"]})
    chain = Chain(GroundParams.from_mapping(TWO_BANDS), airborne, [world.ephemeris], [world.ephemeris])
    truth, integrity = {}, None

    def epochs():
        for epoch in world:
            truth[epoch.key] = epoch.truth
            yield RecordedEpoch(key=epoch.key, ground=epoch.ground, user=epoch.airborne)

    approach, errors = world.params.flight.approach, {}
    for output in chain.run(epochs()):
        if not isinstance(output, AirborneOutput):
            integrity = output.integrity
            continue
        modes = output.modes
        true_m = truth[epoch_key(modes.gps_week, modes.tow_s)].position_m
        if abs(float(approach.deviations(true_m[np.newaxis]).distance_m[0])) > 1500.0:
            continue
        for number, *place_m in zip(modes.mode, modes.x_m, modes.y_m, modes.z_m, strict=True):
            name = mode_of(float(number)).name
            errors.setdefault(name, []).append((np.array(place_m) - true_m) @ approach.rot_approach_ecef.T)
    return {name: np.array(each) for name, each in errors.items()}, integrity


@pytest.mark.parametrize(
    ("way", "bound_m"), [("l1_100", 0.02), ("l5_100", 0.02), ("l5_30", 0.02), ("if_100", 0.06), ("if_30", 0.06)]
)
@pytest.mark.parametrize("systems", ["", "_g", "_e"])
def test_without_noise_every_way_finds_the_truth(flown, way, systems, bound_m):
    """2 cm as test_chain.py derives it. Free of ionosphere the messages' rounding of 0.5 cm a band counts 2.26 and 1.26
    times, 1.8 cm a range at most and 0.75 cm rms, through vertical dilutions of 2 to 4 for a single constellation."""
    errors = flown[0][way + systems]
    scale = 1.0 if not systems else 2.0
    assert len(errors) > 20
    assert np.isfinite(errors).all()
    assert np.abs(errors).max() < scale * bound_m


def test_every_satellite_has_both_bands(flown):
    """The world's satellites send both; nothing is lost to room with four slots."""
    integrity = flown[1]
    assert np.isfinite(integrity.prc_m[L5_100]).sum() == (integrity.state == 2.0).sum() >= 10
