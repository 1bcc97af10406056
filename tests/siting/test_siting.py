"""Siting: the paper's optima, the closed form, dense grids of gradients and of places, and proofs put to the test."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gbas_core.parameters import ParameterError
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE, coverage_percent, k_factor
from gbas_siting.chain import chain_lengths_m, chain_statistic_m
from gbas_siting.contraction import contract
from gbas_siting.problem import SitingProblem
from gbas_siting.search import best_siting
from gbas_siting.worst_gradient import worst_gradient
from gradient_grid import best_on_grid_m, worst_on_grid_m

PAPER = yaml.safe_load((Path(__file__).resolve().parents[1] / "tables" / "asigm.yaml").read_text(encoding="utf-8"))
TRUE = PAPER["recomputed"]
LOW, HIGH = GRADIENT_RANGE
LAMBDA_M = float(WAVELENGTH_M[L1])
BRAUNSCHWEIG = ((0.0, 0.0), (-769.27940, -97.96549), (-278.27506, -686.48901))  # from rr1, east and north
BEARING_RAD = math.radians(PAPER["runway_bearing_deg"])


def worst_m(*lengths_m: float, **more: object) -> float:
    return float(worst_gradient(np.array(lengths_m), LAMBDA_M, GRADIENT_RANGE, **more).statistic_m)


# --- the gradient seen worst


@given(
    st.lists(st.tuples(st.floats(0.0, 600.0), st.floats(-5.0, 5.0)), min_size=1, max_size=4),
    st.sampled_from([(L1,), (L5,), (L1, L5)]),
    st.booleans(),
)
@example([(0.0, -1.0), (122.0, 5.0)], (L1, L5), True)  # a term that only rises
@settings(max_examples=200)
def test_breakpoints_find_what_a_dense_grid_finds(monitors: list, bands: tuple[int, ...], slackened: bool):
    """Both kernels: one wavelength, and several; with tolerances and interval widths, and without."""
    slopes = np.array([length for length, _ in monitors])
    wavelengths = np.array([WAVELENGTH_M[bands[i % len(bands)]] for i in range(slopes.size)])
    slacks = np.array([slack for _, slack in monitors]) if slackened else np.zeros(slopes.size)
    exact = float(worst_gradient(slopes, wavelengths, GRADIENT_RANGE, slack_m=slacks).statistic_m)
    count = 40_001
    on_grid = worst_on_grid_m(slopes, wavelengths, GRADIENT_RANGE, slacks, count)
    # A grid finds the minimum or a little more: half a step on the steepest side, 605 m at most.
    step = (HIGH - LOW) / (count - 1)
    assert -1e-12 <= on_grid - exact <= 605.0 * 0.5 * step + 1e-12


def test_differences_of_baselines_are_no_breakpoints():
    """At n lambda / (b_j - b_i) tents cross on sides of one sense: adding those gradients lowers nothing."""
    random = np.random.default_rng(1)
    for lengths in random.uniform(1.0, 600.0, (300, 3)):
        exact = worst_m(*lengths)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            span = abs(lengths[i] - lengths[j])
            gradients = np.arange(math.ceil(LOW * span / LAMBDA_M), math.floor(HIGH * span / LAMBDA_M) + 1)
            gradients = gradients[gradients > 0] * LAMBDA_M / span
            delay = gradients[:, np.newaxis] * lengths
            statistic = np.abs(delay - LAMBDA_M * np.round(delay / LAMBDA_M)).max(axis=1)
            assert (statistic >= exact - 1e-12).all()


def test_worst_gradient_has_the_statistic():
    lengths = np.random.default_rng(2).uniform(1.0, 600.0, (500, 2))
    result = worst_gradient(lengths, LAMBDA_M, GRADIENT_RANGE)
    delay = result.gradient[:, np.newaxis] * lengths
    np.testing.assert_allclose(
        np.abs(delay - LAMBDA_M * np.round(delay / LAMBDA_M)).max(axis=1), result.statistic_m, atol=1e-13
    )


def test_missing_and_perpendicular_baselines_guarantee_nothing():
    assert worst_m(math.nan, 177.0) == 0.0
    assert worst_m(0.0) == 0.0
    assert worst_m(0.0, 0.0, 80.0) == worst_m(80.0)


@given(st.lists(st.floats(1.0, 600.0), min_size=2, max_size=4), st.floats(0.3, 3.0))
def test_scale_of_the_wavelength(lengths: list[float], factor: float):
    """Lengths and wavelength in proportion: so is the statistic. More exact than grids can say."""
    scaled = worst_gradient(np.array(lengths) * factor, LAMBDA_M * factor, GRADIENT_RANGE).statistic_m
    assert float(scaled) == pytest.approx(factor * worst_m(*lengths), abs=1e-12)


@given(st.lists(st.floats(0.0, 600.0), min_size=2, max_size=5), st.randoms(use_true_random=False))
def test_permutation(lengths: list[float], random: object):
    shuffled = list(lengths)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert worst_m(*shuffled) == pytest.approx(worst_m(*lengths), abs=1e-14)


@given(st.lists(st.floats(0.0, 400.0), min_size=2, max_size=4))
def test_mirror(places: list[float]):
    """All baselines of a line of receivers are those of its mirror image."""
    problem = SitingProblem(n_receivers=len(places) + 1, existing_m=((0.0, 0.0), (0.0, 5.0)), baselines="all")
    assert problem.two_sided
    rows = np.array([places[:-1], [-place for place in places[:-1]]])
    first, second = problem.guaranteed(rows).statistic_m
    assert first == pytest.approx(second, abs=1e-14)


@pytest.mark.parametrize("baselines", ["star", "all"])
def test_tolerance_is_the_worst_case(baselines: str):
    """No placement within the tolerance falls below; for a star some trial comes near."""
    random = np.random.default_rng(3)
    plain = SitingProblem(n_receivers=4, baselines=baselines)
    robust = SitingProblem(n_receivers=4, baselines=baselines, tolerance_m=1.0)
    for places in random.uniform(20.0, 300.0, (20, 3)):
        guaranteed = float(robust.guaranteed(places[np.newaxis]).statistic_m[0])
        trials = places + random.choice([-1.0, 1.0, 0.0], (400, 3)) * random.uniform(0.0, 1.0, (400, 1)) ** 0.2
        found = plain.guaranteed(trials).statistic_m.min()
        assert found >= guaranteed - 1e-12
        if baselines == "star":
            assert found - guaranteed < 2e-3 * 1.0  # a tolerance of 1 m moves the statistic by up to 2 mm


# --- the paper's optima


@pytest.mark.parametrize("name", ["m3", "m4"])
def test_optima_of_the_paper(name: str):
    best = best_siting(SitingProblem(n_receivers=int(name[1])))
    true = TRUE[name]
    assert best.sigma_m * 1e3 == pytest.approx(true["sigma_mm"], abs=5e-4)
    assert best.length_m == pytest.approx(true["length_m"], abs=5e-4)
    np.testing.assert_allclose(best.baselines_m[:-1] / best.length_m, true["ratios"], atol=5e-6)
    assert best.closed
    assert best.detectability_percent == 100.0
    monitors = best.problem.monitors(best.new_m, 1.0001 * best.sigma_m)
    assert coverage_percent(monitors, best.problem.k) < 100.0


@pytest.mark.parametrize("n_baselines", [1, 2, 3, 5])
def test_closed_form_of_the_chain(n_baselines: int):
    lengths = chain_lengths_m(LAMBDA_M, GRADIENT_RANGE, n_baselines)
    statistic = chain_statistic_m(LAMBDA_M, GRADIENT_RANGE, n_baselines)
    assert worst_m(*lengths) == pytest.approx(statistic, abs=1e-14)
    best = best_siting(SitingProblem(n_receivers=n_baselines + 1))
    assert best.statistic_m == pytest.approx(statistic, abs=2e-9)
    np.testing.assert_allclose(best.baselines_m, lengths, atol=1e-5)


def test_five_receivers_do_better_than_the_chain():
    """And the proof holds the claim of the closed form to its place: three, four and six receivers."""
    best = best_siting(SitingProblem(n_receivers=5))
    assert best.statistic_m > 1.019 * chain_statistic_m(LAMBDA_M, GRADIENT_RANGE, 4)
    # By the dense grid of gradients, too.
    on_grid = worst_on_grid_m(best.baselines_m, np.full(4, LAMBDA_M), GRADIENT_RANGE, np.zeros(4), 400_001)
    assert on_grid == pytest.approx(best.statistic_m, abs=1e-6)
    assert best.closed


def test_where_the_ratio_does_not_matter():
    """Figure 7: up to lambda / 2300e-6 only the longest baseline counts."""
    limit_m = LAMBDA_M / (LOW + HIGH)
    assert limit_m == pytest.approx(TRUE["independent_below_m"], abs=5e-4)
    below = [worst_m(ratio * limit_m, limit_m) for ratio in (0.1, 0.4, 0.7, 1.0)]
    np.testing.assert_allclose(below, LOW * limit_m, rtol=1e-12)
    longer_m = limit_m + 2.0
    assert len({round(worst_m(ratio * longer_m, longer_m), 9) for ratio in (0.1, 0.4, 0.7, 1.0)}) > 1


def test_where_the_middle_is_useless():
    """Figure 7: at half the baseline, both are blind together from 2 lambda / 2000e-6 = 190.294 m on."""
    limit_m = 2.0 * LAMBDA_M / HIGH
    assert limit_m == pytest.approx(TRUE["middle_useless_above_m"], abs=5e-4)
    assert worst_m(0.5 * (limit_m + 1e-6), limit_m + 1e-6) < 1e-9
    assert worst_m(0.5 * (limit_m - 4.0), limit_m - 4.0) > 0.003


def test_fourth_receiver_at_braunschweig():
    """77 m from the first receiver and 4.5 mm: truncated 77.8 m and 4.56 mm."""
    best = best_siting(SitingProblem(n_receivers=3, existing_m=BRAUNSCHWEIG[:2], runway_bearing_rad=BEARING_RAD))
    assert math.floor(abs(best.new_m[0])) == PAPER["printed"]["fourth"]["place_m"]
    assert math.floor(best.sigma_m * 1e4) / 10.0 == PAPER["printed"]["fourth"]["sigma_mm"]
    # By the paper's procedure: places in steps of 0.25 m, gradients in steps of 0.5 mm/km.
    places = np.arange(1.0, 775.0, 0.25)
    statistic, (longest_m, place_m) = best_on_grid_m(
        [np.array([best.length_m]), places], np.arange(LOW, HIGH, 5e-7), LAMBDA_M
    )
    assert longest_m == best.length_m
    assert place_m == pytest.approx(abs(best.new_m[0]), abs=0.3)
    # Half a step of a gradient moves the longest baseline's statistic by 0.2 mm, a step of 0.25 m by 0.5 mm at most.
    assert statistic == pytest.approx(best.statistic_m, abs=7e-4)
    # It stands on the line from the first receiver along the runway, on the side of the second.
    east_m, north_m = best.problem.positions_m(best.new_m)[2]
    assert math.degrees(math.atan2(east_m, north_m)) % 360.0 == pytest.approx(84.73 + 180.0)


# --- the proof, against brute force


@pytest.mark.parametrize("step_m", [2.0, 0.5])
@pytest.mark.parametrize("baselines", ["star", "all"])
def test_no_places_of_a_grid_beat_the_bound_three_receivers(step_m: float, baselines: str):
    problem = SitingProblem(n_receivers=3, baselines=baselines)
    best = best_siting(problem, budget=200_000)
    axis = np.arange(0.5 * step_m, 500.0, step_m)
    places = np.stack([each.ravel() for each in np.meshgrid(axis, axis)], axis=-1)
    found = problem.guaranteed(places).statistic_m.max()
    assert found <= best.bound_m
    # A grid point is within half a step of the best places, on both axes.
    assert found >= best.statistic_m - HIGH * step_m


@pytest.mark.parametrize("step_m", [8.0, 3.0])
def test_no_places_of_a_grid_beat_the_bound_four_receivers(step_m: float):
    problem = SitingProblem(n_receivers=4, max_length_m=320.0)
    best = best_siting(problem)
    axis = np.arange(0.5 * step_m, 320.0, step_m)
    places = np.stack([each.ravel() for each in np.meshgrid(axis, axis, axis)], axis=-1)
    found = problem.guaranteed(places[(np.diff(places) > 0.0).all(axis=1)]).statistic_m.max()
    assert best.statistic_m - HIGH * step_m <= found <= best.bound_m


@given(st.lists(st.tuples(st.floats(0.0, 400.0), st.floats(0.0, 60.0)), min_size=2, max_size=3), st.integers(0, 99))
@settings(max_examples=50)
def test_bound_of_a_box_holds_in_the_box(box: list[tuple[float, float]], seed: int):
    for bands, baselines in (((L1,), "star"), ((L1, L5), "all")):
        problem = SitingProblem(n_receivers=len(box) + 1, bands=bands, baselines=baselines, tolerance_m=0.5)
        low = np.array([[begin for begin, _ in box]])
        high = low + np.array([[width for _, width in box]])
        inside = low + (high - low) * np.random.default_rng(seed).random((200, len(box)))
        assert problem.guaranteed(inside).statistic_m.max() <= problem.bound_m(low, high)[0] + 1e-12


@given(
    st.lists(st.tuples(st.floats(1.0, 400.0), st.floats(0.1, 60.0)), min_size=2, max_size=3),
    st.sampled_from([(L1,), (L1, L5)]),
    st.floats(0.02, 0.09),
    st.integers(0, 99),
)
@settings(max_examples=100)
def test_contraction_cuts_off_nothing_that_reaches(box: list, bands: tuple[int, ...], reach_m: float, seed: int):
    problem = SitingProblem(
        n_receivers=len(box) + 2, existing_m=((0.0, 0.0), (390.0, 5.0)), bands=bands, tolerance_m=0.5
    )
    low = np.array([[begin for begin, _ in box]])
    high = low + np.array([[width for _, width in box]])
    inside = low + (high - low) * np.random.default_rng(seed).random((400, len(box)))
    inside = inside[(np.diff(inside) >= 0.0).all(axis=1)]  # places are in ascending order
    reaching = inside[problem.guaranteed(inside).statistic_m >= reach_m] if inside.size else inside
    alive = np.ones(1, dtype=np.bool_)
    contract(
        low, high, IONO_RATIO[list(bands)], np.array([390.0]), WAVELENGTH_M[list(bands)], 0.5, LOW, HIGH, reach_m, alive
    )
    if reaching.size:
        assert alive[0]
        assert ((low <= reaching) & (reaching <= high)).all()


def test_contraction_cuts_off_something():
    """From all places: nothing but 300 mm/km times the longest baseline reaches 66 mm at 300 mm/km."""
    low, high, alive = np.zeros((1, 3)), np.full((1, 3), 250.0), np.ones(1, dtype=np.bool_)
    bands = [L1]
    contract(low, high, IONO_RATIO[bands], np.empty(0), WAVELENGTH_M[bands], 0.0, LOW, HIGH, 0.066, alive)
    assert alive[0]
    none, best = best_siting(SitingProblem(n_receivers=4)).statistic_m + 1e-4, np.array([[60.0, 115.0, 215.0]])
    low, high = best.copy(), best + 8.0
    contract(low, high, IONO_RATIO[bands], np.empty(0), WAVELENGTH_M[bands], 0.0, LOW, HIGH, none, alive)
    assert not alive[0]


@pytest.mark.parametrize("n_receivers", [7, 8])
def test_proof_closes_for_many_receivers(n_receivers: int):
    best = best_siting(SitingProblem(n_receivers=n_receivers))
    assert best.closed
    assert best.statistic_m >= chain_statistic_m(LAMBDA_M, GRADIENT_RANGE, n_receivers - 1) - 1e-9
    assert best.statistic_m < 0.5 * LAMBDA_M


def test_one_band_is_the_other_in_its_own_units():
    """L5 alone: lengths are shorter by the ionosphere, wavelengths longer."""
    first, second = (best_siting(SitingProblem(n_receivers=3, bands=(band,))) for band in (L1, L5))
    ratio = float(WAVELENGTH_M[L5] / WAVELENGTH_M[L1])
    assert second.statistic_m == pytest.approx(ratio * first.statistic_m, abs=3e-8)
    np.testing.assert_allclose(second.new_m, first.new_m * ratio / IONO_RATIO[L5], atol=1e-4)


def test_more_can_only_help():
    three = best_siting(SitingProblem(n_receivers=3))
    for change in ({"bands": (L1, L5)}, {"baselines": "all"}, {"n_receivers": 4}):
        better = best_siting(SitingProblem(**{"n_receivers": 3, **change}), budget=100_000)
        assert better.statistic_m > three.statistic_m
    for change in ({"tolerance_m": 1.0}, {"max_length_m": 150.0}, {"gradient_range": (200e-6, 2000e-6)}):
        assert best_siting(SitingProblem(**{"n_receivers": 3, **change})).bound_m < three.statistic_m


def test_k_scales_sigma_and_moves_nothing():
    first, second = (best_siting(SitingProblem(n_receivers=3, k=k)) for k in (k_factor(), 5.0))
    np.testing.assert_array_equal(first.new_m, second.new_m)
    assert first.sigma_m * k_factor() == pytest.approx(5.0 * second.sigma_m, rel=1e-14)


def test_length_limit():
    limited = best_siting(SitingProblem(n_receivers=3, max_length_m=100.0))
    assert limited.length_limited
    assert limited.statistic_m == pytest.approx(LOW * 100.0)  # nothing sees the lowest gradient better
    assert not best_siting(SitingProblem(n_receivers=3)).length_limited


def test_everything_stands_already():
    problem = SitingProblem(n_receivers=3, existing_m=BRAUNSCHWEIG, runway_bearing_rad=BEARING_RAD)
    judged = best_siting(problem)
    assert judged.new_m.size == 0
    assert judged.statistic_m == pytest.approx(worst_m(775.0256, 340.1522), abs=1e-6)
    assert judged.closed


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"n_receivers": 1}, "receivers"),
        ({"n_receivers": 2, "existing_m": ((0.0, 0.0),) * 3}, "existing"),
        ({"existing_m": ((0.0, math.nan),)}, "existing"),
        ({"runway_bearing_rad": math.inf}, "bearing"),
        ({"k": 0.0}, "k = 0.0 is not above 0"),
        ({"baselines": "ring"}, "baselines"),
        ({"tolerance_m": -1.0}, "tolerance_m"),
        ({"max_length_m": 0.0}, "max_length_m"),
        ({"bands": (L1, L1)}, "bands"),
        ({"bands": ()}, "bands"),
    ],
)
def test_bad_problem_is_named(change: dict, text: str):
    with pytest.raises(ParameterError, match=text):
        SitingProblem(**{"n_receivers": 3, **change})
