"""Range errors in ionospheric fronts: closed forms, and the bound against fronts through filters and monitor."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_ground.ionosphere.range_error import DivergenceCredit, TracedPoint, away_s, worst_range_error_m
from gbas_ground.ionosphere.threat import THREATS, FrontThreat
from gbas_sim.atmosphere.fronts import THREAT_SPACES

CONUS = THREATS["conus"]
CREDIT = DivergenceCredit(threshold_mps=0.0233, margin_mps=3.719 * 0.00399, tau_s=30.0, readmission_s=60.0)


def worst(x_m, v_mps, gradient=375e-6, tau_s=100.0, credit=None, threat=CONUS):
    return float(
        worst_range_error_m(
            np.array(gradient), TracedPoint(np.array([x_m, 0.0]), np.array([-v_mps, 0.0])), tau_s, threat, credit
        )
    )


@pytest.mark.parametrize("name", ["conus", "germany"])
def test_the_models_are_those_of_the_simulator(name):
    """Two declarations of the same published bounds: neither package imports the other."""
    ours, theirs = THREATS[name], THREAT_SPACES[name]
    elevation = np.deg2rad([0.0, 5.0, 15.0, 40.0, 65.0, 90.0])
    np.testing.assert_allclose(ours.largest_gradient(elevation), theirs.largest_gradient(0.0, elevation), rtol=1e-12)
    assert (ours.min_width_m, ours.max_speed_mps) == (theirs.width_m[0], theirs.speed_mps[1])
    assert ours.max_delay_m == theirs.max_delay_m


def test_published_slopes_by_elevation():
    """375 mm/km below 15 degrees, 425 above 65, linear between."""
    np.testing.assert_allclose(
        CONUS.largest_gradient(np.deg2rad([5.0, 40.0, 80.0])), [375e-6, 400e-6, 425e-6], rtol=1e-12
    )


@pytest.mark.parametrize(
    ("gradient", "x_m", "v_mps", "tau_s", "published_m"),
    [(425e-6, 6_000.0, 70.0, 100.0, 8.5), (300e-6, 5_000.0, 70.0, 30.0, 2.76), (300e-6, 5_000.0, 70.0, 100.0, 5.7)],
)
def test_a_front_that_stands_still(gradient, x_m, v_mps, tau_s, published_m):
    """g (x + 2 tau v): the bound is at least that, and at most what no front can exceed, 2 g (x + tau v).

    The table of receding fronts is looked up a step farther and faster: 1 km and 20 m/s of some 20 km.
    """
    assert gradient * (x_m + 2.0 * tau_s * v_mps) == pytest.approx(published_m, abs=0.05)  # two digits printed
    nothing_credited = worst(x_m, v_mps, gradient, tau_s)
    assert published_m - 0.05 <= nothing_credited <= 2.0 * gradient * (x_m + 1_000.0 + tau_s * (v_mps + 20.0))
    assert published_m - 0.05 <= worst(x_m, v_mps, gradient, tau_s, CREDIT) <= nothing_credited


def test_without_monitor_a_fast_front_nearly_doubles_the_difference():
    """Fronts of 750 m/s: e = g (x + 2 v tau + 2 v_r tau (1 - exp(-x / v_r tau)) - x), which is near 2 g (x + v tau)."""
    x_m, v_mps, decay_m = 10_000.0, 70.0, 75_000.0
    exact = 375e-6 * (2.0 * v_mps * 100.0 + 2.0 * decay_m * (1.0 - np.exp(-x_m / decay_m)))
    assert exact <= worst(x_m, v_mps) <= 1.05 * exact  # the table's step of 1 km is 4 % of 24 km


def test_error_is_never_more_than_twice_the_delay():
    threat = FrontThreat(name="small", elevation_rad=(0.0,), gradient=(400e-6,), max_delay_m=3.0)
    assert worst(40_000.0, 80.0, 400e-6, threat=threat) == pytest.approx(6.0, abs=1e-12)


def test_an_aircraft_is_not_beyond_the_table():
    with pytest.raises(ValueError, match="beyond"):
        worst(90_000.0, 70.0)


@pytest.mark.parametrize(("speed", "width"), [(60.0, 25e3), (100.0, 25e3), (750.0, 25e3), (200.0, 60e3)])
def test_how_long_the_divergence_monitor_keeps_a_satellite_out(speed, width):
    """Against its two filters, step by step; half a step of 0.5 s and the second of the grid are the tolerance."""
    gradient, weight = 425e-6, 0.5 / 30.0
    time = np.arange(-width / speed, 900.0, 0.5)
    first = second = last = 0.0
    for now in time:
        rate = 2.0 * gradient * speed if now < 0.0 else 0.0
        first += weight * (rate - first)
        second += weight * (first - second)
        if second >= CREDIT.threshold_mps + CREDIT.margin_mps:
            last = now
    expected = last + 60.0 if last else 0.0
    assert float(away_s(gradient, speed, width, CREDIT)) == pytest.approx(expected, abs=2.5)


def test_a_slow_front_is_not_credited():
    """2 g v_r below threshold and margin: 0.0381 m/s are 44.9 m/s at 425 mm/km."""
    assert float(away_s(425e-6, 44.0, 100e3, CREDIT)) == 0.0
    assert float(away_s(425e-6, 46.0, 100e3, CREDIT)) > 60.0
    assert float(away_s(425e-6, 700.0, 100e3, None)) == 0.0


def through_the_filters(x_m, v_mps, gradient, width_m, front_mps, edge_m, ages_s=(120.0, 60.0, 0.0)):
    """Distances, differences of the smoothed ranges and whether the satellites were in use at ages, ``(A, F)`` each.

    One dimension: each aircraft comes in at v and is at x now, each edge moves and is at `edge_m` now.
    """
    time = np.arange(-900.0, 0.25, 0.5)[:, np.newaxis]
    count = len(x_m)
    ahead = np.concatenate([x_m - v_mps * time, np.zeros((len(time), count))], axis=1)
    ahead -= np.tile(edge_m + front_mps * time, 2)
    delay = np.clip(np.tile(gradient, 2) * ahead, 0.0, np.tile(gradient * width_m, 2))
    params, no_slip = SmoothingParams(tau_s=(100.0,)), np.zeros(2 * count, dtype=bool)
    state, weight = initial_smoothing(params, n_sats=2 * count), 0.5 / 30.0
    first, second, failed = np.zeros(count), np.zeros(count), np.full(count, -np.inf)
    rows = []
    for row, now in enumerate(time[:, 0]):
        own = delay[row]
        state, smoothed = smooth_step(state, own, -own, no_slip, 0.5 if row else np.nan, params)
        rate = 4.0 * (own - delay[row - 1])[count:] if row else np.zeros(count)
        first = first + weight * (rate - first)
        second = second + weight * (first - second)
        failed = np.where(np.abs(second) > CREDIT.threshold_mps, now, failed)
        if -now in ages_s:
            error = np.abs(smoothed[0, :count] - smoothed[0, count:])
            rows.append((x_m - v_mps * now, error, now - failed >= 60.0))
    return [np.array(each) for each in zip(*rows, strict=True)]


def test_no_front_exceeds_the_bound():
    """Random fronts, either way and as fast as the model has them; the bound is reached to a tenth, so it is no idle
    one."""
    rng, count = np.random.default_rng(5), 3_000
    x_m, v_mps = rng.uniform(1_000.0, 20_000.0, count), rng.choice([50.0, 70.0, 85.0], count)
    gradient = 375e-6 * rng.choice([1.0, 1.0, 0.6, 0.2], count)
    speeds = np.stack([np.zeros(count), rng.uniform(0.0, 100.0, count), np.exp(rng.uniform(2.0, 6.6, count))])
    front = rng.choice([-1.0, 1.0], count) * speeds[rng.integers(3, size=count), np.arange(count)]
    width_m = rng.uniform(25_000.0, np.minimum(200_000.0, 50.0 / gradient))
    edge_m = rng.uniform(-5_000.0, x_m)
    place_m, error, in_use = through_the_filters(x_m, v_mps, gradient, width_m, front, edge_m)
    offset = np.stack([place_m, np.zeros_like(place_m)], axis=-1)
    velocity = np.broadcast_to(np.stack([-v_mps, np.zeros(count)], axis=-1), offset.shape)
    bound = worst_range_error_m(np.full(place_m.shape, 375e-6), TracedPoint(offset, velocity), 100.0, CONUS, CREDIT)
    ratio = (error / bound)[in_use]
    assert ratio.size > 2.0 * count
    assert 0.9 < ratio.max() <= 1.0
