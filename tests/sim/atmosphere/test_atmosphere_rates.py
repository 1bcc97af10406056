"""All atmospheric effects over broadcast orbits and an approach: rates, instants together or one by one, and cost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from atmosphere_scene import STATION, ecef_of
from gbas_core.gnss.orbits import satellite_state
from gbas_core.positioning.approach import FinalApproach
from gbas_core.satellites import satellites_of
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import Ionosphere
from gbas_sim.atmosphere.paths import SignalPaths
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox
from gbas_sim.flight.straight_in import StraightIn
from gbas_sim.satellites.constellation import nominal_ephemeris

WEEK, START_S = 2400, 216_000.0
EPHEMERIS = nominal_ephemeris(WEEK, START_S, seed=1, systems=satellites_of("GE"))
FLIGHT = StraightIn(
    approach=FinalApproach.from_course(
        ltp_lat_rad=math.radians(52.3209),
        ltp_lon_rad=math.radians(10.567),
        ltp_height_m=133.0,
        course_rad=math.radians(264.73),
        fpap_distance_m=2300.0,
        tch_m=15.0,
        gpa_rad=math.radians(3.0),
    )
)
EFFECTS = {
    "troposphere": Troposphere(refractivity=379.0, reference_height_m=130.0),
    "weather": WeatherBox(top_m=5000.0, start_m=6000.0, thickness_m=50_000.0, speed_mps=10.0),
    "ionosphere": Ionosphere(seed=3),
    "front, ray": WedgeFront(gradient=300e-6, max_delay_m=40.0, start_m=-40_000.0, speed_mps=30.0),
    "front, pierce": WedgeFront(gradient=300e-6, max_delay_m=40.0, start_m=-40_000.0, reference="pierce"),
    "front, earth": WedgeFront(gradient=20e-6, width_m=2e6, start_m=-1e6, speed_mps=100.0, reference="earth"),
    "bubble": PlasmaBubble(depth_m=20.0, start_m=40_000.0),
}
GROUND = ecef_of([[0.0, 0.0, 0.0], [350.0, 120.0, 1.0], [-200.0, 400.0, -2.0], [100.0, -300.0, 0.0]])


def approach_paths(since_s) -> SignalPaths:
    """Paths of four receivers and the aircraft at times since the start ``(...)``."""
    since_s = np.asarray(since_s, dtype=float)
    state = satellite_state(EPHEMERIS, WEEK, (START_S + since_s)[..., np.newaxis] - 0.077, None)
    position_m, velocity_mps = FLIGHT.state(since_s)
    ground = np.broadcast_to(GROUND, (*since_s.shape, 4, 3))
    return SignalPaths(
        gps_week=WEEK,
        tow_s=START_S + since_s,
        since_start_s=since_s,
        station=STATION,
        position_m=np.concatenate([ground, position_m[..., np.newaxis, :]], axis=-2),
        velocity_mps=np.concatenate([np.zeros_like(ground), velocity_mps[..., np.newaxis, :]], axis=-2),
        satellite_m=state.position_m,
        satellite_mps=state.velocity_mps,
    )


@pytest.mark.parametrize("name", EFFECTS)
def test_rates_along_an_approach(name):
    """Central differences over 0.2 s: rounding of 1e-9 m in positions, five times as much in rates and eleven times at
    5 degrees along the ground; the aircraft's jerk is none at these times.

    Where a path crosses an edge within the steps, the rate is on one of its sides.
    """
    effect, step_s = EFFECTS[name], 0.1
    for since_s in (10.0, 320.0, 480.0, 570.0):
        now = approach_paths(since_s)
        high = now.sin_elevation > math.sin(math.radians(3.0))
        after, before = (effect.delay(approach_paths(since_s + sign * step_s)).delay_m for sign in (1.0, -1.0))
        middle = effect.delay(now).delay_m
        smooth = high & (np.abs(after - 2.0 * middle + before) < 1e-5)
        assert smooth.sum() >= 0.95 * high.sum()
        difference = (after - before) / (2.0 * step_s)
        np.testing.assert_allclose(effect.delay(now).rate_mps[smooth], difference[smooth], rtol=0, atol=5e-8)


@pytest.mark.parametrize("name", EFFECTS)
def test_instants_together(name):
    """An axis of instants in front gives what one by one does, to rounding: vector and scalar sines may differ."""
    times = np.array([0.0, 0.5, 400.0])
    together = EFFECTS[name].delay(approach_paths(times))
    for number, since_s in enumerate(times):
        single = EFFECTS[name].delay(approach_paths(since_s))
        np.testing.assert_allclose(together.delay_m[number], single.delay_m, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(together.rate_mps[number], single.rate_mps, rtol=1e-9, atol=1e-9)
