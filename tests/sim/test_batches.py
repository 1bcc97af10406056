"""Observations as arrays: those of the epochs, in any batches."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_bringup.resources import config_path
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import L1, L5
from gbas_sim.batches import QUANTITIES, batches, observed
from gbas_sim.faults.kinds import FAULT_MODES
from gbas_sim.scenario import open_world, read_sections, scenario_from_mapping
from gbas_sim.world import World

IDEAL = {"ground_receiver": {"preset": "ideal"}, "airborne_receiver": {"preset": "ideal"}}


def opened(**changes) -> World:
    site = read_sections(config_path("braunschweig.yaml"))
    return open_world(scenario_from_mapping({**site, "sim": {**site["sim"], **changes}}))


def test_batches_are_the_epochs():
    world = opened(duration_s=10.0)
    made = list(batches(world, QUANTITIES, length=8))
    assert [each.numbers.tolist() for each in made] == [list(range(8)), list(range(8, 16)), list(range(16, 21))]
    assert made[0].receivers == ("rr1", "rr2", "rr3", "rr4", "airborne")
    for batch in made:
        for row, number in enumerate(batch.numbers.tolist()):
            epoch = world.epoch(number)
            for place, receiver in enumerate((*epoch.ground, epoch.airborne)):
                for name in QUANTITIES:
                    np.testing.assert_array_equal(getattr(batch, name)[row, place], getattr(receiver, name))
            np.testing.assert_array_equal(batch.elevation_rad[row], world.elevations_rad(number))
    np.testing.assert_array_equal(made[1].since_start_s, 0.5 * np.arange(8, 16))


def test_only_what_is_asked_for():
    world = opened(aircraft=False, duration_s=100.0)
    batch = observed(world, range(0, 200, 50), ("cn0_dbhz",))
    assert batch.code_m is None
    assert batch.cn0_dbhz.shape == (4, 4, 3, 68)
    with pytest.raises(ValueError, match="quantity 'phase' is not one of code_m, "):
        observed(world, range(3), ("phase",))
    with pytest.raises(IndexError, match="epoch 201 is not within 0 to 200"):
        observed(world, [201])


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_each_mode_of_divergence_reaches_all_receivers(mode):
    """Rates of codes and carriers, of all five receivers, against a world without the fault."""
    rate_mps = 0.03
    fault = {"kind": "divergence", "satellite": "G08", "mode": mode, "ramp_mps": rate_mps, "start_s": 5.0}
    with_fault, without = (
        observed(opened(duration_s=30.0, **threats, **IDEAL), (9, 60)) for threats in ({"threats": {"f": fault}}, {})
    )
    factors = FAULT_MODES[mode]
    for place, (name, band) in enumerate((("code_m", L1), ("code_m", L5), ("carrier_m", L1), ("carrier_m", L5))):
        grown = getattr(with_fault, name) - getattr(without, name)
        sign = 1.0 if name == "code_m" else -1.0
        expected = sign * rate_mps * 25.0 * factors[place]
        np.testing.assert_allclose(grown[1, :, band, SAT_INDEX["G08"]], expected, atol=1e-7)  # 4 nm of rounding twice
        assert not np.nan_to_num(grown[0]).any()
        grown[..., SAT_INDEX["G08"]] = 0.0
        assert not np.nan_to_num(grown).any()
