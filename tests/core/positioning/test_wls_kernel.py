"""The compiled projection against numpy's singular value decomposition of the same weighted design."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.positioning.kernels.wls import condition_number
from gbas_core.positioning.wls import projection_matrix


def by_decomposition(los: np.ndarray, sigma_m: np.ndarray, groups: np.ndarray, max_condition: float):
    """S and the condition number of W^1/2 G; None for S where it is too large or satellites are too few."""
    used = np.isfinite(sigma_m) & (sigma_m > 0.0) & np.isfinite(los).all(axis=0) & groups.any(axis=0)
    kept = np.concatenate([np.ones(3, dtype=bool), (groups & used).any(axis=1)])
    if used.sum() < kept.sum() or not kept[3:].any():
        return None, np.inf
    design = (np.concatenate([-los, groups])[kept][:, used] / sigma_m[used]).T
    singular = np.linalg.svd(design, compute_uv=False)
    if not singular[0] <= max_condition * singular[-1]:
        return None, np.inf
    projection = np.zeros((3 + len(groups), los.shape[1]))
    projection[np.ix_(kept, used)] = np.linalg.pinv(design, rcond=1e-15) / sigma_m[used]
    return projection, singular[0] / singular[-1]


def sky(rng: np.random.Generator, n: int, spread: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines of sight within `spread` of one direction, sigmas and constellations; some of them missing."""
    los = np.array([0.3, 0.2, 0.9])[:, np.newaxis] + spread * rng.normal(size=(3, n))
    los /= np.linalg.norm(los, axis=0)
    sigma_m = rng.uniform(0.2, 5.0, n)
    sigma_m[rng.uniform(size=n) < 0.2] = rng.choice([np.nan, 0.0, -1.0, np.inf])
    los[:, rng.uniform(size=n) < 0.1] = np.nan
    groups = np.zeros((2, n), dtype=bool)
    member = rng.integers(-1, 2, n)
    groups[member[member >= 0], np.flatnonzero(member >= 0)] = True
    return los, sigma_m, groups


@pytest.mark.parametrize("n", [0, 1, 4, 5, 8, 20, 68])
@pytest.mark.parametrize("spread", [1.0, 0.1, 0.003, 1e-7])
def test_projection_is_that_of_the_decomposition(n: int, spread: float) -> None:
    """Rounding of either, some ten times 1e-16, grows with the condition number."""
    rng, found = np.random.default_rng(n), 0
    for _ in range(50):
        given = sky(rng, n, spread)
        expected, condition = by_decomposition(*given, 1e4)
        projection = projection_matrix(*given, max_condition=1e4)
        if expected is None:
            assert projection is None
            continue
        found += 1
        assert projection is not None
        np.testing.assert_allclose(projection, expected, rtol=0.0, atol=1e-14 * condition * np.abs(expected).max())
    assert found or n < 8 or spread < 0.01


def test_the_same_direction_twice_is_no_geometry() -> None:
    los = np.repeat(np.array([[0.0], [0.6], [0.8]]), 8, axis=1)
    assert projection_matrix(los, np.ones(8), np.ones((1, 8), dtype=bool)) is None
    assert projection_matrix(np.full((3, 8), np.nan), np.ones(8), np.ones((1, 8), dtype=bool)) is None


@pytest.mark.parametrize("size", [3, 4, 5])
def test_condition_number_is_that_of_numpy(size: int) -> None:
    rng = np.random.default_rng(size)
    for exponent in np.linspace(0.0, 6.0, 30):
        matrix = np.triu(rng.normal(size=(size, size))) @ np.diag(np.logspace(0.0, exponent, size))
        # one-sided rotations keep small singular values to their last digits
        assert condition_number(matrix.copy()) == pytest.approx(np.linalg.cond(matrix), rel=1e-8)
    assert condition_number(np.zeros((size, size))) == np.inf
    assert condition_number(np.full((size, size), np.nan)) == np.inf
