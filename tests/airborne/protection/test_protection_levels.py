"""Protection levels against published multipliers, a second formulation, and what they promise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import protection_loops
from gbas_airborne.protection.kernels.levels import h1_level_m
from gbas_airborne.protection.levels import Multipliers, protection_levels
from gbas_core.models.missed_detection import k_ffmd, k_md
from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.satellites import N_SATS, missing
from gbas_msgs_py.records import SolutionEpoch

PUBLISHED = Multipliers(
    k_ffmd=np.array([np.nan, *protection_loops.K_FFMD.values()]),
    k_md=np.array([np.nan, np.nan, *protection_loops.K_MD.values()]),
)


@pytest.mark.parametrize(("m", "published"), [(2, 5.762), (3, 5.810), (4, 5.847)])
def test_k_ffmd_is_the_published_table(m: int, published: float) -> None:
    assert k_ffmd(m) == pytest.approx(published, abs=5e-4)  # the table has three decimals


@pytest.mark.parametrize(("m", "published"), [(2, 2.935), (3, 2.898), (4, 2.878)])
def test_k_md_is_the_published_table(m: int, published: float) -> None:
    assert k_md(m) == pytest.approx(published, abs=5e-4)


@pytest.mark.parametrize(("m", "fitted"), [(2, 6.598), (3, 6.641), (4, 6.673)])
def test_generator_reaches_the_gast_d_table(m: int, fitted: float) -> None:
    assert k_ffmd(m, 1.25e-10) == pytest.approx(fitted, abs=5e-4)


def test_multipliers_are_indexed_by_receivers() -> None:
    table = Multipliers.generate(2.5e-8, 1e-5, 6.86)
    np.testing.assert_allclose(table.k_ffmd[1:], [6.86, 5.762, 5.810, 5.847], atol=5e-4)
    np.testing.assert_allclose(table.k_md[2:], [2.935, 2.898, 2.878], atol=5e-4)
    assert np.isnan(table.k_md[:2]).all()


def make_solution(
    satellites: list[protection_loops.Satellite], *, gpa_rad: float = 0.0, k_md_e: float = 5.0
) -> SolutionEpoch:
    """The record of a geometry: the suite's projection of the same satellites."""
    n = len(satellites)
    los, columns = np.full((3, N_SATS), np.nan), {}
    los[:, :n] = [
        [math.cos(s.elevation_rad) * math.cos(s.azimuth_rad) for s in satellites],
        [math.cos(s.elevation_rad) * math.sin(s.azimuth_rad) for s in satellites],
        [math.sin(s.elevation_rad) for s in satellites],
    ]
    for name in ("sigma_gnd_m", "sigma_air_m", "sigma_tropo_m", "sigma_iono_m", "ephemeris_error_m", "elevation_rad"):
        columns[name] = missing()
        columns[name][:n] = [getattr(s, name) for s in satellites]
    b_m = missing(4)
    for i, satellite in enumerate(satellites):
        b_m[: len(satellite.b_m), i] = [np.nan if b is None else b for b in satellite.b_m]
    groups = np.zeros((2, N_SATS), dtype=bool)
    for i, satellite in enumerate(satellites):
        groups[satellite.clock, i] = True
    variance = sum(columns[name] ** 2 for name in ("sigma_gnd_m", "sigma_air_m", "sigma_tropo_m", "sigma_iono_m"))
    projection = projection_matrix(los, np.sqrt(variance), groups)
    assert projection is not None
    s_vert, s_lat = vertical_lateral(projection, gpa_rad)
    used = np.arange(N_SATS) < n
    return SolutionEpoch(
        gps_week=2300, tow_s=0.0, x_m=0.0, y_m=0.0, z_m=0.0, n_sats=float(n), k_md_e=k_md_e,
        n_receivers=float(max(s.n_receivers for s in satellites)), d_vert_m=0.0, d_lat_m=0.0,
        s_vert=np.where(used, s_vert, np.nan), s_lat=np.where(used, s_lat, np.nan), b_m=b_m, **columns,
    )  # fmt: skip


def sky(n: int, *, seed: int, receivers: int | None = 4, clocks: int = 2) -> list[protection_loops.Satellite]:
    """A random sky. With `receivers` None the number of receivers differs from satellite to satellite."""
    rng = np.random.default_rng(seed)
    satellites = []
    for i in range(n):
        m = int(rng.integers(2, 5)) if receivers is None else receivers
        behind = set(rng.permutation(4)[:m].tolist()) if m > 1 else set()
        satellites.append(
            protection_loops.Satellite(
                azimuth_rad=2.4 * i + rng.uniform(-0.3, 0.3),
                elevation_rad=math.radians(rng.uniform(6.0, 85.0)),
                clock=i % clocks,
                sigma_gnd_m=rng.uniform(0.1, 0.6),
                sigma_air_m=rng.uniform(0.2, 0.7),
                sigma_tropo_m=rng.uniform(0.0, 0.2),
                sigma_iono_m=rng.uniform(0.0, 0.3),
                b_m=tuple(float(rng.normal(0.0, 0.2)) if j in behind else None for j in range(4)),
                ephemeris_error_m=rng.uniform(0.0, 2.0),
            )
        )
    return satellites


@pytest.mark.parametrize("receivers", [1, 2, 3, 4, None])
@pytest.mark.parametrize("seed", range(6))
def test_levels_agree_with_loops(receivers: int | None, seed: int) -> None:
    gpa_rad = math.radians(3.0)
    satellites = sky(6 + seed, seed=seed, receivers=receivers)
    levels = protection_levels(make_solution(satellites, gpa_rad=gpa_rad), PUBLISHED)
    for row, s in enumerate(protection_loops.vertical_and_lateral(satellites, gpa_rad)):
        # The same formulas in another order of summation, a solution by another factorisation.
        exact = {"rel": 1e-9, "abs": 1e-12}
        h0 = protection_loops.h0(s, satellites, protection_loops.K_FFMD)
        assert levels.h0_m[row] == pytest.approx(h0, **exact)
        bound = protection_loops.ephemeris_bound(s, satellites, 5.0)
        assert levels.ephemeris_bound_m[row] == pytest.approx(bound, **exact)
        if receivers == 1:
            assert math.isnan(levels.h1_m[row])
            assert levels.level_m[row] == levels.h0_m[row]
        else:
            h1 = protection_loops.h1(s, satellites, protection_loops.K_MD)
            assert levels.h1_m[row] == pytest.approx(h1, **exact)
            assert levels.level_m[row] == max(levels.h0_m[row], levels.h1_m[row])


def test_separation_is_added_to_both() -> None:
    solution = make_solution(sky(8, seed=3))
    plain = protection_levels(solution, PUBLISHED)
    apart = protection_levels(replace(solution, d_vert_m=1.5, d_lat_m=0.5), PUBLISHED)
    np.testing.assert_allclose(apart.h0_m - plain.h0_m, [1.5, 0.5], rtol=1e-12)
    np.testing.assert_allclose(apart.h1_m - plain.h1_m, [1.5, 0.5], rtol=1e-12)


@pytest.mark.parametrize("column", ["sigma_gnd_m", "sigma_air_m", "sigma_tropo_m", "sigma_iono_m", "s_vert", "s_lat"])
def test_a_missing_number_of_a_used_satellite_leaves_no_protection(column: str) -> None:
    solution = make_solution(sky(8, seed=1))
    values = getattr(solution, column).copy()
    values[2] = np.nan
    assert np.isnan(protection_levels(replace(solution, **{column: values}), PUBLISHED).level_m).all()


@pytest.mark.parametrize("receivers", [1, 3])
def test_missing_b_values_leave_no_protection(receivers: int) -> None:
    solution = make_solution(sky(8, seed=1, receivers=3))
    b_m = solution.b_m.copy()
    b_m[:, 4] = np.nan
    broken = replace(solution, b_m=b_m, n_receivers=float(receivers))
    assert np.isnan(protection_levels(broken, PUBLISHED).level_m).all()


def test_receivers_that_do_not_fit_the_b_values_leave_no_protection() -> None:
    solution = make_solution(sky(8, seed=1, receivers=2))
    for n_receivers in (np.nan, 0.0, 3.0, 5.0):
        assert np.isnan(protection_levels(replace(solution, n_receivers=n_receivers), PUBLISHED).level_m).all()


def test_missing_ephemeris_error_leaves_no_bound_but_a_level() -> None:
    solution = make_solution(sky(8, seed=1))
    error = solution.ephemeris_error_m.copy()
    error[0] = np.nan
    for broken in (replace(solution, ephemeris_error_m=error), replace(solution, k_md_e=math.nan)):
        levels = protection_levels(broken, PUBLISHED)
        assert np.isfinite(levels.level_m).all()
        assert np.isnan(levels.ephemeris_bound_m).all()


def test_nobody_used_leaves_no_protection() -> None:
    empty = SolutionEpoch(gps_week=2300, tow_s=0.0)
    assert np.isnan(protection_levels(empty, PUBLISHED).level_m).all()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), factor=st.floats(1.0, 5.0), which=st.integers(0, 7))
def test_a_larger_b_value_of_one_sign_never_lowers_the_worst_case(seed: int, factor: float, which: int) -> None:
    """With one satellite's B value alone, the level grows with it; scaling all sigmas scales the fault-free level."""
    solution = make_solution(sky(8, seed=seed, receivers=4))
    alone = np.where(np.isfinite(solution.b_m), 0.0, np.nan)
    alone[0, which] = 0.3
    small = protection_levels(replace(solution, b_m=alone), PUBLISHED)
    large = protection_levels(replace(solution, b_m=alone * factor), PUBLISHED)
    assert (large.h1_m >= small.h1_m - 1e-12).all()
    np.testing.assert_allclose(large.h0_m, small.h0_m, rtol=1e-12)


def within(count: int, trials: int, probability: float) -> bool:
    """Whether a count of rare events fits its probability, to four standard deviations of the binomial."""
    return abs(count - trials * probability) <= 4.0 * math.sqrt(trials * probability * (1.0 - probability))


def test_fault_free_errors_exceed_the_level_as_often_as_said() -> None:
    """H0: with matching sigmas, P(|error| > level) is p / (M + 1); p is raised so that 200,000 trials see it."""
    probability, m, trials = 0.03, 4, 200_000
    solution = make_solution(sky(9, seed=5, receivers=m))
    levels = protection_levels(solution, Multipliers.generate(probability, 0.9, 6.86))
    variance = (
        solution.sigma_gnd_m**2 + solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2
    )[:9]
    errors = np.random.default_rng(11).normal(size=(trials, 9)) * np.sqrt(variance)
    for row, s in enumerate((solution.s_vert[:9], solution.s_lat[:9])):
        count = int((np.abs(errors @ s) > levels.h0_m[row]).sum())
        assert within(count, trials, probability / (m + 1))


@pytest.mark.parametrize("m", [2, 3, 4])
def test_a_faulted_receiver_is_covered_as_often_as_said(m: int) -> None:
    """H1: receiver 0 has a large bias on two satellites. Its level fails with probability Q(K_md).

    Corrections are the mean of M receivers of sigma sqrt(M) sigma_gnd each, B values as the ground makes them. The
    probability of a missed detection is raised to 5 % so that 20,000 trials see it.
    """
    missed, trials, n = 0.05, 20_000, 8
    k = np.full(5, np.nan)
    k[m] = k_md(m, missed * (m + 1) / m * 1e-3, 1e-3)
    assert k[m] == pytest.approx(1.6449, abs=1e-4)  # Q^-1(0.05)
    solution = make_solution(sky(n, seed=20 + m, receivers=m))
    s = np.array([np.where(np.arange(N_SATS) < n, solution.s_vert, 0.0), np.zeros(N_SATS)])
    gnd2 = np.where(np.arange(N_SATS) < n, solution.sigma_gnd_m**2, 0.0)
    other2 = np.where(np.arange(N_SATS) < n, 0.3**2, 0.0)
    rng = np.random.default_rng(100 + m)
    bias = np.zeros(n)
    bias[[1, 4]] = [25.0, 40.0]
    count = 0
    for _ in range(trials):
        noise = rng.normal(size=(m, n)) * np.sqrt(m * gnd2[:n])
        noise[0] += bias
        correction = noise.mean(axis=0)
        b_m = missing(4)
        b_m[:m, :n] = correction - (noise.sum(axis=0) - noise) / (m - 1)
        only_first = np.where(np.arange(4)[:, None] == 0, b_m, b_m * 0.0)
        level = h1_level_m(s[0], only_first, gnd2, other2, k)
        error = abs(s[0, :n] @ (correction + rng.normal(size=n) * 0.3))
        count += int(error > level)
    assert within(count, trials, missed)
