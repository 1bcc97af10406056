"""Ionospheric fronts and bubbles: their profiles, what they do to smoothed ranges, and the threat spaces."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from atmosphere_scene import STATION, derivative, moving, paths, satellites_at, spiral
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_sim.atmosphere.fronts import THREAT_SPACES, PlasmaBubble, WedgeFront

TABLE = yaml.safe_load((Path(__file__).parents[2] / "tables" / "threat_spaces.yaml").read_text(encoding="utf-8"))
REFERENCES = ("baseline", "ray", "pierce", "earth")
AZIMUTH, ELEVATION = spiral()
TAU_S = (30.0, 100.0)


# --- profiles, by interpolation


def profile(s_m: np.ndarray, front: WedgeFront, since_s: float) -> np.ndarray:
    """Slant delay by interpolation between the ends of the wedge."""
    foot = front.start_m + front.speed_mps * (since_s - front.start_s)
    if front.edge == "trailing":
        return np.interp(s_m, [foot, foot + front.wide_m], [0.0, front.deep_m])
    return np.interp(s_m, [foot - front.wide_m, foot], [front.deep_m, 0.0])


def bubble_profile(s_m: np.ndarray, bubble: PlasmaBubble, since_s: float) -> np.ndarray:
    edge = bubble.start_m + bubble.speed_mps * (since_s - bubble.start_s)
    corners = np.cumsum([edge - bubble.width_m, bubble.back_wall_m, bubble.floor_m, bubble.front_wall_m])
    return np.interp(s_m, corners, [bubble.depth_m, 0.0, 0.0, bubble.depth_m])


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("edge", ["trailing", "leading"])
def test_wedge_by_interpolation(reference, edge):
    front = WedgeFront(
        gradient=400e-6,
        width_m=25_000.0,
        edge=edge,
        direction_rad=1.9,
        speed_mps=120.0,
        start_m=-15_000.0,
        start_s=40.0,
        reference=reference,
    )
    now = moving()
    distance_m = np.broadcast_to(now.along(1.9, reference)[0], (5, N_SATS))
    delay_m = front.delay(now).delay_m
    np.testing.assert_allclose(delay_m, profile(distance_m, front, 100.0), rtol=0, atol=1e-9)
    assert 0.0 < delay_m.max() <= front.deep_m == pytest.approx(10.0)
    assert delay_m.shape == (5, N_SATS)


@pytest.mark.parametrize("reference", REFERENCES)
def test_bubble_by_interpolation(reference):
    bubble = PlasmaBubble(
        depth_m=20.0,
        front_wall_m=4000.0,
        back_wall_m=9000.0,
        floor_m=3000.0,
        start_m=5000.0,
        speed_mps=60.0,
        reference=reference,
    )
    now = moving()
    distance_m = np.broadcast_to(now.along(0.5 * math.pi, reference)[0], (5, N_SATS))
    np.testing.assert_allclose(bubble.delay(now).delay_m, bubble_profile(distance_m, bubble, 100.0), rtol=0, atol=1e-9)


def test_bubble_is_two_wedges():
    """Its front wall is a wedge that falls towards it, its back wall one that rises: less the background."""
    bubble = PlasmaBubble(depth_m=12.0, front_wall_m=5000.0, back_wall_m=8000.0, floor_m=2000.0, speed_mps=50.0)
    common = {"direction_rad": bubble.direction_rad, "speed_mps": 50.0, "max_delay_m": 12.0}
    front = WedgeFront(gradient=12.0 / 5000.0, start_m=-5000.0, edge="trailing", **common)
    back = WedgeFront(gradient=12.0 / 8000.0, start_m=-7000.0, edge="leading", **common)
    now = moving()
    both = front.delay(now) + back.delay(now)
    np.testing.assert_allclose(bubble.delay(now).delay_m, both.delay_m, rtol=0, atol=1e-9)
    np.testing.assert_allclose(bubble.delay(now).rate_mps, both.rate_mps, rtol=0, atol=1e-9)


def test_edges_make_a_whole():
    """What the trailing edge has not, the leading edge one width further on has."""
    front = {"gradient": 300e-6, "width_m": 30_000.0, "direction_rad": 0.4, "speed_mps": 200.0}
    now = moving()
    trailing = WedgeFront(**front, start_m=-30_000.0).delay(now)
    leading = WedgeFront(**front, start_m=0.0, edge="leading").delay(now)
    np.testing.assert_allclose(trailing.delay_m + leading.delay_m, 9.0, rtol=0, atol=1e-9)


@given(
    gradient=st.floats(1e-6, 2e-3),
    max_delay_m=st.floats(0.01, 200.0),
    direction_rad=st.floats(-6.2, 6.2),
    speed_mps=st.floats(0.0, 1500.0),
    start_m=st.floats(-1e6, 1e6),
    edge=st.sampled_from(["trailing", "leading"]),
    reference=st.sampled_from(REFERENCES),
)
def test_wedges_are_bounded(gradient, max_delay_m, **values):
    now = moving()
    front = WedgeFront(gradient=gradient, max_delay_m=max_delay_m, **values)
    delay = front.delay(now)
    assert (delay.delay_m >= 0.0).all()
    assert (delay.delay_m <= max_delay_m).all()
    steady = (delay.delay_m == 0.0) | (delay.delay_m == max_delay_m)
    assert not delay.rate_mps[steady].any()


@given(
    depth_m=st.floats(0.01, 100.0),
    front_wall_m=st.floats(10.0, 1e5),
    back_wall_m=st.floats(10.0, 1e5),
    floor_m=st.floats(0.0, 1e5),
    start_m=st.floats(-1e5, 1e5),
    reference=st.sampled_from(REFERENCES),
)
def test_bubbles_are_bounded(depth_m, **values):
    delay_m = PlasmaBubble(depth_m=depth_m, **values).delay(moving()).delay_m
    assert (delay_m >= 0.0).all()
    assert (delay_m <= depth_m).all()


# --- rates


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("edge", ["trailing", "leading"])
def test_rate_of_a_wedge(reference, edge):
    front = WedgeFront(
        gradient=400e-6,
        width_m=100_000.0,
        edge=edge,
        direction_rad=1.9,
        speed_mps=120.0,
        start_m=-50_000.0 if edge == "trailing" else 50_000.0,
        reference=reference,
    )
    check_rate(front)


@pytest.mark.parametrize("reference", REFERENCES)
def test_rate_of_a_bubble(reference):
    check_rate(PlasmaBubble(depth_m=20.0, start_m=60_000.0, floor_m=0.0, reference=reference))


def check_rate(effect) -> None:
    """Rounding of distances, 1e-8 m over 0.25 s times 400 mm/km; paths at a corner within the steps left out."""
    now = moving()
    expected = derivative(lambda p: effect.delay(p).delay_m, now)
    smooth = np.abs(derivative(lambda p: effect.delay(p).delay_m, now, step_s=0.5) - expected) < 1e-8
    assert smooth.mean() > 0.95
    rate = effect.delay(now).rate_mps
    np.testing.assert_allclose(rate[smooth], expected[smooth], rtol=1e-9, atol=1e-10)
    assert (rate[smooth] != 0.0).mean() > 0.1


# --- ground and air alike


@pytest.mark.parametrize("gradient", [140e-6, 425e-6, 860e-6])
def test_gradient_between_two_receivers(gradient):
    """Differential carrier over the baseline in the direction of the gradient; two satellites, double difference."""
    front = WedgeFront(gradient=gradient, width_m=25_000.0, direction_rad=0.9, start_m=-12_000.0)
    affected = WedgeFront(
        gradient=gradient, width_m=25_000.0, direction_rad=0.9, start_m=-12_000.0, satellites=("G10",)
    )
    baseline = np.array([700.0 * math.sin(0.9), 700.0 * math.cos(0.9), 0.0])
    now = paths([[0.0, 0.0, 0.0], baseline])
    carrier_m = -front.delay(now).delay_m
    # Rounding of 1e-9 m in positions, eleven times as much along the ground at 5 degrees.
    np.testing.assert_allclose((carrier_m[0] - carrier_m[1]) / 700.0, gradient, rtol=1e-9)
    carrier_m = -affected.delay(now).delay_m
    single = carrier_m[0] - carrier_m[1]
    double = single[SAT_INDEX["G10"]] - single[SAT_INDEX["E05"]]
    assert double / 700.0 == pytest.approx(gradient, rel=1e-9)


@pytest.mark.parametrize("reference", ["ray", "pierce", "earth"])
def test_one_pierce_point_one_delay(reference):
    """An aircraft on the path to a ground receiver feels what the receiver feels."""
    front = WedgeFront(gradient=400e-6, width_m=100_000.0, start_m=-40_000.0, reference=reference)
    ground = paths([[0.0, 0.0, 0.0]])
    above = STATION.axes @ (5000.0 * ground.los[0, :, 4])
    delay_m = front.delay(paths([[0.0, 0.0, 0.0], above])).delay_m
    assert delay_m[1, 4] == pytest.approx(delay_m[0, 4], abs=1e-9)
    assert np.abs(delay_m[1] - delay_m[0]).max() > 0.1


@pytest.mark.parametrize("edge", ["trailing", "leading"])
def test_a_moving_front_passes_one_receiver_after_the_other(edge):
    """At speed v a receiver d further on feels at time t what the station felt at t - d / v."""
    front = WedgeFront(
        gradient=300e-6, width_m=30_000.0, direction_rad=0.0, speed_mps=250.0, start_m=-20_000.0, edge=edge
    )
    there = [[0.0, 0.0, 0.0], [300.0, 4000.0, 0.0]]
    for since_s in (0.0, 60.0, 130.0):
        first = front.delay(paths(there, since_start_s=since_s)).delay_m[0]
        then = front.delay(paths(there, since_start_s=since_s + 16.0)).delay_m[1]
        np.testing.assert_allclose(then, first, rtol=0, atol=1e-9)


def test_a_front_over_the_earth_reaches_satellites_one_by_one():
    """With "earth" the delay starts when the line reaches the pierce point; with "pierce" for all at once."""
    values = {"gradient": 300e-6, "width_m": 50_000.0, "speed_mps": 500.0, "edge": "leading"}
    northward = np.array([AZIMUTH[0], 0.0, math.pi])  # three satellites at 30 degrees
    satellite = satellites_at(np.resize(northward, N_SATS), np.full(N_SATS, math.radians(30.0)))
    times = np.arange(-3000.0, 3000.0, 10.0)
    reached = {}
    for reference in ("earth", "pierce"):
        front = WedgeFront(reference=reference, **values)
        at_station = [[0.0, 0.0, 0.0]]
        delay_m = [front.delay(paths(at_station, satellite_m=satellite, since_start_s=t)).delay_m[0] for t in times]
        reached[reference] = times[(np.array(delay_m) > 1e-6).argmax(axis=0)]
    assert (reached["pierce"] == 10.0).all()
    along_m, _ = paths([[0.0, 0.0, 0.0]], satellite_m=satellite).along(0.0, "earth")
    np.testing.assert_allclose(reached["earth"], along_m[0] / 500.0, atol=10.0)
    assert reached["earth"][1] - reached["earth"][2] > 1000.0


def test_only_named_satellites():
    front = WedgeFront(gradient=300e-6, width_m=50_000.0, start_m=-20_000.0, satellites=("G03", "E12"))
    delay_m = front.delay(moving()).delay_m
    assert set(np.nonzero(delay_m[0])[0]) == {SAT_INDEX["G03"], SAT_INDEX["E12"]}


def test_several_at_once():
    """Delays and rates add."""
    first = WedgeFront(gradient=300e-6, width_m=50_000.0, start_m=-20_000.0)
    second = WedgeFront(gradient=200e-6, width_m=80_000.0, start_m=-30_000.0, direction_rad=2.0, speed_mps=50.0)
    now = moving()
    total = first.delay(now) + second.delay(now)
    np.testing.assert_array_equal(total.delay_m, first.delay(now).delay_m + second.delay(now).delay_m)
    np.testing.assert_array_equal(total.rate_mps, first.delay(now).rate_mps + second.delay(now).rate_mps)


# --- smoothed ranges


def approach(front: WedgeFront, speed_mps: float, height_m: float = 0.0, *, last_m: float, seconds: float):
    """Delays (E, 2, N_SATS) of the station and of an aircraft that closes on it from the north, at 2 Hz."""
    since_s = np.arange(0.0, seconds + 0.25, 0.5)
    enu = np.zeros((since_s.size, 2, 3))
    enu[:, 1, 1] = last_m + speed_mps * (seconds - since_s)
    enu[:, 1, 2] = height_m
    velocity = np.broadcast_to([[0.0, 0.0, 0.0], [0.0, -speed_mps, 0.0]], enu.shape)
    return front.delay(paths(enu, velocity_enu_mps=velocity, since_start_s=since_s, tow_s=216_000.0 + since_s))


def smoothed_errors_m(delay_m: np.ndarray) -> np.ndarray:
    """Error (tau, N_SATS) at the last epoch: code and carrier with opposite delays, smoothed, ground subtracted."""
    params = SmoothingParams(tau_s=TAU_S, start="invariant")
    state = initial_smoothing(params, 2)
    slipped = np.zeros(delay_m.shape[1:], dtype=bool)
    for number, delay in enumerate(delay_m):
        state, smoothed_m = smooth_step(state, delay, -delay, slipped, 0.5 if number else math.nan, params)
    return smoothed_m[:, 1] - smoothed_m[:, 0]


# 1200 s are twelve time constants: 6e-6 of the lag of 5.6 m is left.
LONG_S, SETTLED_M = 1200.0, 1e-4


@pytest.mark.parametrize("reference", ["baseline", "ray"])
@pytest.mark.parametrize(("gradient", "speed_mps"), [(300e-6, 70.0), (100e-6, 82.0)])
def test_stationary_front_and_approaching_aircraft(reference, gradient, speed_mps):
    """Error g (x + 2 tau v), of which a filter with epochs T apart has tau - T; divergence 2 g v; 30 s less 100 s.

    300 mm/km over 5 km and 2 x 30 s x 70 m/s is the 2.76 m that the limit of 2.75 m at the threshold comes from.
    """
    front = WedgeFront(gradient=gradient, width_m=200_000.0, start_m=-10_000.0, reference=reference)
    delay = approach(front, speed_mps, last_m=5000.0, seconds=LONG_S)
    error_m = smoothed_errors_m(delay.delay_m)
    for tau_s, error in zip(TAU_S, error_m, strict=True):
        np.testing.assert_allclose(error, gradient * (5000.0 + 2.0 * (tau_s - 0.5) * speed_mps), atol=SETTLED_M)
        np.testing.assert_allclose(
            error, gradient * (5000.0 + 2.0 * tau_s * speed_mps), atol=gradient * speed_mps + SETTLED_M
        )
    separation_m = error_m[1] - error_m[0]
    np.testing.assert_allclose(separation_m, 2.0 * 70.0 * gradient * speed_mps, atol=2.0 * SETTLED_M)
    # Code less carrier holds the delay twice.
    np.testing.assert_allclose(-2.0 * delay.rate_mps[-1, 1], 2.0 * gradient * speed_mps, rtol=1e-12)
    assert not delay.rate_mps[:, 0].any()


def test_published_numbers():
    front = WedgeFront(gradient=300e-6, width_m=200_000.0, start_m=-10_000.0)
    delay = approach(front, 70.0, last_m=5000.0, seconds=LONG_S)
    error_m = smoothed_errors_m(delay.delay_m)[:, 0]
    assert error_m == pytest.approx([2.76, 5.70], abs=0.025)
    assert error_m[1] - error_m[0] == pytest.approx(2.94, abs=1e-3)
    assert -2.0 * delay.rate_mps[-1, 1, 0] == pytest.approx(0.042, abs=1e-12)


def test_approaching_aircraft_over_pierce_points():
    """With "pierce" the distance is foreshortened, and x and v alike: g and the error shrink by one factor."""
    front = WedgeFront(gradient=300e-6, width_m=200_000.0, start_m=-10_000.0, reference="pierce")
    delay = approach(front, 70.0, last_m=5000.0, seconds=LONG_S)
    error_m = smoothed_errors_m(delay.delay_m)
    baseline = paths([[0.0, 0.0, 0.0], [0.0, 5000.0, 0.0]])
    factor = baseline.along(0.0, "pierce")[0][1] / 5000.0
    assert 0.2 < factor.min() < 0.3
    assert 0.95 < factor.max() < 1.01
    # The factor is not constant over the 14 km of the longest memory: 14 km over the 350 km and more to the shell.
    np.testing.assert_allclose(error_m[0], factor * 300e-6 * (5000.0 + 2.0 * 29.5 * 70.0), rtol=0.02)


def test_moving_front_over_receivers_at_rest():
    """A passing front moves code against carrier by 2 g v; smoothed ranges of all receivers lag alike."""
    front = WedgeFront(gradient=200e-6, width_m=200_000.0, start_m=150_000.0, speed_mps=100.0, edge="leading")
    since_s = np.arange(0.0, LONG_S + 0.25, 0.5)
    enu = np.zeros((since_s.size, 2, 3))
    enu[:, 1, 1] = 600.0
    delay = front.delay(paths(enu, since_start_s=since_s - 1400.0))
    np.testing.assert_allclose(2.0 * delay.rate_mps, 2.0 * 200e-6 * 100.0, rtol=1e-12)
    error_m = smoothed_errors_m(delay.delay_m)
    np.testing.assert_allclose(error_m, -200e-6 * 600.0, atol=SETTLED_M)


# --- threat spaces


@pytest.mark.parametrize("name", sorted(TABLE))
def test_threat_spaces_as_published(name):
    space, published = THREAT_SPACES[name], TABLE[name]
    for row in published["gradients"]:
        bound = space.largest_gradient(row["speed_mps"], math.radians(row["elevation_deg"]))
        assert float(bound) * 1e6 == pytest.approx(row["mmpkm"], rel=1e-12)
    assert [1e-3 * width for width in space.width_m] == published["width_km"]
    assert list(space.speed_mps) == published["speed_mps"]
    assert space.max_delay_m == published["max_delay_m"]


def test_every_threat_space_is_published():
    assert set(THREAT_SPACES) == set(TABLE)


INSIDE = {"gradient": 400e-6, "width_m": 100_000.0, "speed_mps": 200.0, "threat_space": "conus"}


def test_threat_space_by_elevation():
    """400 mm/km is what the model for the United States has at 40 degrees and above."""
    front = WedgeFront(**INSIDE, satellites=("G01", "G02"))
    elevation = np.full(N_SATS, np.nan)
    elevation[:4] = np.radians([39.9, 40.0, 10.0, 80.0])
    exceeded = front.exceeded(elevation)
    assert exceeded[0]
    assert not exceeded[1:].any()  # the third is not affected
    assert not WedgeFront(gradient=1e-2, width_m=1000.0).exceeded(elevation).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gradient": 426e-6}, "gradient = 0.000426 is not within 0 to 0.000425 of conus"),
        ({"speed_mps": 751.0}, "speed_mps = 751 is not within 0 to 750 of conus"),
        ({"width_m": 24_000.0}, "width_m = 24000 is not within 25000 to 200000 of conus"),
        ({"width_m": 130_000.0}, "max_delay_m = 52 is not within 0 to 50 of conus"),
        ({"threat_space": "germany"}, "gradient = 0.0004 is not within 0 to 0.00014 of germany"),
        ({"threat_space": "gast_d", "speed_mps": 800.0}, "gradient = 0.0004 is not within 0 to 0.0001 of gast_d"),
        ({"threat_space": "brazil", "speed_mps": 10.0}, "speed_mps = 10 is not within 40 to 250 of brazil"),
        ({"threat_space": "mars"}, "threat_space = 'mars' is not one of conus, "),
        ({"width_m": -1.0}, "width_m = -1 is not within 1 to 10000000 m"),
        ({"max_delay_m": 30.0}, "max_delay_m = 30.0 is not gradient times width_m = 40"),
        ({"width_m": None}, "width_m and max_delay_m are both missing"),
        ({"gradient": math.nan}, "gradient = nan is not a finite number"),
        ({"edge": "upper"}, "edge = 'upper' is not one of 'trailing', 'leading'"),
        ({"reference": "moon"}, "reference = 'moon' is not one of 'baseline', 'ray', 'pierce', 'earth'"),
        ({"satellites": ("G01", "X9")}, "satellites = 'X9' is not one of G01, G02"),
        ({"speed_mps": -1.0}, "speed_mps = -1 is not within 0 to 10000 m/s"),
    ],
)
def test_front_refuses(changes, message):
    with pytest.raises(ValueError, match=message):
        WedgeFront(**(INSIDE | changes))


def test_depth_or_width():
    """Either follows from the other; both may be given when they agree."""
    assert WedgeFront(gradient=400e-6, max_delay_m=40.0).wide_m == pytest.approx(100_000.0)
    assert WedgeFront(gradient=400e-6, width_m=100_000.0).deep_m == pytest.approx(40.0)
    assert WedgeFront(gradient=412e-6, width_m=100_000.0, max_delay_m=41.0).deep_m == 41.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth_m": 36.0}, "depth_m = 36 is not within 0 to 35 of brazil"),
        ({"front_wall_m": 19_000.0}, "front_wall_m = 19000 is not within 20000 to 450000 of brazil"),
        ({"depth_m": 25.0, "back_wall_m": 20_000.0}, "gradient = 0.00125 is not within"),
        ({"speed_mps": 300.0}, "speed_mps = 300 is not within 40 to 250 of brazil"),
        ({"floor_m": -1.0}, "floor_m = -1 is not within 0 to 10000000 m"),
    ],
)
def test_bubble_refuses(changes, message):
    values = {"depth_m": 17.0, "front_wall_m": 20_000.0, "back_wall_m": 20_000.0, "threat_space": "brazil"}
    PlasmaBubble(**values)
    with pytest.raises(ValueError, match=message):
        PlasmaBubble(**(values | changes))
