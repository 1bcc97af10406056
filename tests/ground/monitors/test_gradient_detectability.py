"""Detectable gradients: the paper's geometry and constants, a dense grid, and what must hold for any baselines."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.parameters import ParameterError
from gbas_core.signals import L1, L5, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import (
    GRADIENT_RANGE,
    SHORTEST_M,
    BaselineMonitor,
    blind_intervals,
    coverage_percent,
    detectable_intervals,
    double_difference_sigma_m,
    k_factor,
    projected_length_m,
    statistic_m,
    wrap_m,
)
from gradient_grid import statistic_on_grid_m

PAPER = yaml.safe_load((Path(__file__).resolve().parents[2] / "tables" / "asigm.yaml").read_text(encoding="utf-8"))
TRUE = PAPER["recomputed"]
K = k_factor()
LOW, HIGH = GRADIENT_RANGE
SPAN = HIGH - LOW


def monitors(*lengths_m: float, sigma_m: float = 0.001, band: int = L1) -> list[BaselineMonitor]:
    return [BaselineMonitor(length_m=length, sigma_m=sigma_m, band=band) for length in lengths_m]


def baseline_enu_m(first: str, second: str) -> np.ndarray:
    at = {name: np.array(position) for name, position in PAPER["ecef_m"].items()}
    lat, lon, _ = geodetic_from_ecef(at["rr1"])
    return rot_enu_ecef(lat, lon) @ (at[second] - at[first])


# --- the paper


def test_constants():
    assert pytest.approx(TRUE["k"], abs=5e-5) == K
    assert norm.isf(0.5e-4) == pytest.approx(TRUE["k_ffd"], abs=5e-5)
    assert norm.isf(1e-4) == pytest.approx(TRUE["k_md"], abs=5e-5)
    assert BaselineMonitor(length_m=1.0, sigma_m=1.0).wavelength_m == pytest.approx(TRUE["wavelength_m"], abs=5e-7)


@pytest.mark.parametrize(("name", "pair"), [("b12_m", "12"), ("b13_m", "13"), ("b23_m", "23")])
def test_lengths_of_the_baselines(name: str, pair: str):
    length_m = np.linalg.norm(baseline_enu_m(f"rr{pair[0]}", f"rr{pair[1]}"))
    assert length_m == pytest.approx(TRUE[name], abs=5e-4)


def test_angles_to_the_runway():
    """The runway is outside the wedge of the baselines: their angle adds to beta, eq (4) has it subtracted."""
    bearing_rad = math.radians(PAPER["runway_bearing_deg"])
    b12, b13 = baseline_enu_m("rr1", "rr2"), baseline_enu_m("rr1", "rr3")
    lengths_m = np.array([np.linalg.norm(b12), np.linalg.norm(b13)])
    along_m = projected_length_m(np.array([b12, b13]), bearing_rad)
    beta_deg, angle_deg = np.degrees(np.arccos(np.abs(along_m) / lengths_m))
    theta_deg = math.degrees(math.acos(b12 @ b13 / (lengths_m[0] * lengths_m[1])))
    assert math.degrees(math.atan2(b12[0], b12[1])) % 360.0 == pytest.approx(TRUE["rr2_azimuth_deg"], abs=5e-3)
    assert beta_deg == pytest.approx(TRUE["beta_deg"], abs=5e-3)
    assert theta_deg == pytest.approx(TRUE["theta_deg"], abs=5e-3)
    # 62.664 from the vectors; 60.68 + 1.99 = 62.67 from the rounded angles.
    assert angle_deg == pytest.approx(TRUE["b13_angle_deg"], abs=1e-2)
    assert angle_deg == pytest.approx(theta_deg + beta_deg, abs=0.02)  # the baselines are not quite level
    np.testing.assert_array_equal(np.sign(along_m), -1.0)  # the receivers are west of the first, the bearing is east


def test_sigma_of_the_double_difference():
    assert double_difference_sigma_m(0.001) == pytest.approx(0.002)  # eq (1), r = 1
    # Variance: two satellites at each of two receivers.
    np.testing.assert_allclose(
        double_difference_sigma_m(0.003, [0.1, 10.0]) ** 2, 2 * 0.003**2 * (1 + np.array([0.01, 100]))
    )


def test_both_together_see_everything_up_to_about_a_millimetre():
    """Figure 4d without projection, as the paper draws it; and with it."""
    assert coverage_percent(monitors(TRUE["b12_m"], TRUE["b13_m"], sigma_m=0.0011), K) == 100.0
    assert coverage_percent(monitors(TRUE["b12_m"], TRUE["b13_m"], sigma_m=0.0012), K) < 100.0
    assert coverage_percent(monitors(TRUE["b12_m"], sigma_m=0.0001), K) < 100.0


# --- one baseline, by hand


def test_one_baseline_by_hand():
    """lambda / b = 0.4 mm/m: blind within k sigma / b of 0.4, 0.8, ... 2.0 mm/m."""
    length_m = float(WAVELENGTH_M[L1]) / 400e-6
    width = K * 0.001 / length_m
    blind = blind_intervals(monitors(length_m), K)
    expected = np.array([[n * 400e-6 - width, n * 400e-6 + width] for n in range(1, 6)])
    expected[-1, 1] = HIGH
    np.testing.assert_allclose(blind, expected, rtol=1e-12)
    assert coverage_percent(monitors(length_m), K) == pytest.approx(100.0 * (1.0 - 9.0 * width / SPAN), rel=1e-12)


def test_nothing_is_seen_across_the_runway_or_under_too_much_noise():
    for no_baseline_m in (0.0, 5e-324, 1e-9, 0.999 * SHORTEST_M):
        assert coverage_percent(monitors(no_baseline_m, sigma_m=0.0), K) == 0.0
    assert coverage_percent(monitors(SHORTEST_M, sigma_m=0.0), K) == 100.0
    assert coverage_percent(monitors(500.0, sigma_m=0.5 * float(WAVELENGTH_M[L1]) / K), K) == 0.0


def test_second_frequency_is_a_longer_baseline_on_a_longer_wavelength():
    """A baseline on L5 sees what one 1.793 times longer would on its wavelength, 0.2548 m."""
    (monitor,) = monitors(100.0, band=L5)
    assert monitor.wavelength_m == pytest.approx(0.2548, abs=5e-5)
    assert monitor.slope_m == pytest.approx(179.3, abs=0.05)
    # 1 mm/m: 179.3 mm, 75.5 mm from one wavelength.
    assert statistic_m(1e-3, monitor) == pytest.approx(0.2548 - 0.1793, abs=1e-4)


def test_wrapping():
    np.testing.assert_allclose(
        wrap_m([0.0, 0.09, 0.11, -0.31, np.nan], 0.2), [0.0, 0.09, -0.09, 0.09, np.nan], atol=1e-15
    )


@pytest.mark.parametrize(
    "change", [{"length_m": -1.0}, {"length_m": math.nan}, {"sigma_m": math.inf}, {"sigma_m": -0.1}]
)
def test_bad_monitor_is_named(change: dict[str, float]):
    (name,) = change
    with pytest.raises(ParameterError, match=name):
        BaselineMonitor(**{"length_m": 1.0, "sigma_m": 0.001, **change})


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"k": math.nan}, "k is nan"),
        ({"gradient_range": (2e-3, 3e-4)}, "0 < low < high"),
        ({"gradient_range": (0.0, 3e-4)}, "0 < low < high"),
        ({"fuse": "some"}, "any or all"),
        ({"monitors": []}, "no baselines"),
    ],
)
def test_bad_arguments_are_named(arguments: dict, text: str):
    given_arguments = {"monitors": monitors(100.0), "k": K, **arguments}
    with pytest.raises(ParameterError, match=text):
        blind_intervals(given_arguments.pop("monitors"), given_arguments.pop("k"), **given_arguments)


# --- any baselines

SOME = st.lists(
    st.builds(
        BaselineMonitor,
        length_m=st.just(0.0) | st.floats(SHORTEST_M, 1000.0),
        sigma_m=st.floats(0.0, 0.015),
        band=st.sampled_from([L1, L5]),
    ),
    min_size=1,
    max_size=4,
)


@given(SOME, st.sampled_from(["any", "all"]))
def test_intervals_agree_with_a_dense_grid(some: list[BaselineMonitor], fuse: str):
    gradients = np.linspace(LOW, HIGH, 20_001)
    statistic = statistic_on_grid_m(gradients, [m.slope_m for m in some], [m.wavelength_m for m in some])
    seen = statistic > K * np.array([m.sigma_m for m in some])[:, np.newaxis]
    on_grid = seen.any(axis=0) if fuse == "any" else seen.all(axis=0)
    edges = detectable_intervals(some, K, fuse=fuse)
    exact = ((gradients > edges[:, :1]) & (gradients < edges[:, 1:])).any(axis=0)
    # They may differ only where a gradient of the grid is an end of an interval, to rounding.
    ends = np.concatenate([edges.ravel(), blind_intervals(some, K, fuse=fuse).ravel(), [LOW, HIGH]])
    near = np.abs(gradients[:, np.newaxis] - ends).min(axis=1) < 1e-14
    np.testing.assert_array_equal(exact[~near], on_grid[~near])


@given(SOME, st.sampled_from(["any", "all"]))
def test_detectable_and_blind_make_the_whole_range(some: list[BaselineMonitor], fuse: str):
    both = np.concatenate([edges(some, K, fuse=fuse) for edges in (detectable_intervals, blind_intervals)])
    both = both[np.argsort(both[:, 0])]
    # Gaps no wider than rounding are in neither.
    np.testing.assert_allclose(both[1:, 0], both[:-1, 1], atol=1e-17)
    assert [both[0, 0], both[-1, 1]] == pytest.approx([LOW, HIGH], abs=1e-17)
    assert coverage_percent(some, K, fuse=fuse) == pytest.approx(
        100.0 * np.diff(detectable_intervals(some, K, fuse=fuse)).sum() / SPAN, abs=1e-9
    )


@given(SOME)
def test_any_sees_most_and_all_least(some: list[BaselineMonitor]):
    each = [coverage_percent([monitor], K) for monitor in some]
    assert coverage_percent(some, K, fuse="any") >= max(each) - 1e-9
    assert coverage_percent(some, K, fuse="all") <= min(each) + 1e-9


@given(SOME, st.floats(0.2, 5.0))
def test_only_the_product_of_k_and_sigma_counts(some: list[BaselineMonitor], factor: float):
    scaled = [BaselineMonitor(length_m=m.length_m, sigma_m=m.sigma_m * factor, band=m.band) for m in some]
    # Gaps narrower than rounding may come and go; nothing wider may.
    assert coverage_percent(scaled, K / factor) == pytest.approx(coverage_percent(some, K), abs=1e-9)


def test_order_does_not_matter():
    some = monitors(775.0, 340.0, 77.0, sigma_m=0.004)
    results = [blind_intervals(list(order), K) for order in itertools.permutations(some)]
    for result in results[1:]:
        np.testing.assert_array_equal(result, results[0])
