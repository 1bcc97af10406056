# mypy: disable-error-code="no-untyped-call"
"""Weighted least squares: from ranges to position, and the projection matrix protection levels are made of.

The design row of satellite i is ``[-e_x, -e_y, -e_z, clock...]``, e being the unit vector from the receiver to the
satellite, in whatever frame e is given: the approach frame (x forward, y left, z up) for guidance and protection
levels, ECEF for a first position. Each clock group (a constellation) has one clock unknown; a group without a used
satellite is dropped, and its row of S is zero.

Nothing here repairs a weak geometry: too few satellites, or a condition number above the bound, gives None, which the
caller must handle.

Source: ICAO Annex 10 Vol. I, App. B 3.6.5.5.1.1.2 (definition of S, s_vert and s_lat).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.orbits import rotated_range
from gbas_core.positioning.kernels.wls import project
from gbas_core.record import BoolArray, FloatArray

# Uncertain, ours: bound on the condition number of the weighted design. Usable geometries are below about 100; beyond
# 1e4 the position is worth nothing and, long before that, no protection level is below an alert limit.
MAX_CONDITION: Final = 1e4
_MAX_ITERATIONS: Final = 10
_CONVERGED_M: Final = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionSolution:
    """Result of :func:`solve_position`.

    Attributes
    ----------
    position_m : (3,) array
        ECEF position at the time of reception [m].
    clock_m : (k,) array
        Receiver clock of each group [m], NaN for a group without satellites.
    residual_m : (N,) array
        Measured minus computed range, NaN for an unused satellite [m].
    los_ecef : (3, N) array
        Unit vectors from the position to the satellites.
    projection : (3 + k, N) array
        S in ECEF axes at the last iteration.
    iterations : int
        Iterations used.
    """

    position_m: FloatArray
    clock_m: FloatArray
    residual_m: FloatArray
    los_ecef: FloatArray
    projection: FloatArray
    iterations: int


def used_satellites(los: FloatArray, sigma_m: FloatArray, clock_groups: BoolArray) -> BoolArray:
    """Satellites that can be used: a line of sight, a finite sigma above zero, and a clock group. (N,) bool array."""
    with np.errstate(invalid="ignore"):
        weighted = np.isfinite(sigma_m) & (sigma_m > 0.0)
    result: BoolArray = weighted & np.isfinite(los).all(axis=0) & clock_groups.any(axis=0)
    return result


def projection_matrix(
    los: FloatArray, sigma_m: FloatArray, clock_groups: ArrayLike, *, max_condition: float = MAX_CONDITION
) -> FloatArray | None:
    """Projection of range errors into position and clock errors, ``S = (G^T W G)^-1 G^T W``.

    Parameters
    ----------
    los : (3, N) array
        Unit vectors from receiver to satellite in the frame the position is wanted in; NaN where there is none.
    sigma_m : (N,) array
        Standard deviation that weights each satellite [m]; NaN (or anything not finite and positive) means unused.
    clock_groups : (k, N) bool array
        Satellites of each clock unknown; a satellite belongs to at most one group, one in none is unused.
    max_condition : float
        Largest accepted condition number of the weighted design [-].

    Returns
    -------
    (3 + k, N) array or None
        S: position in the first three rows, one row for each clock group after; zero for unused satellites and for
        dropped groups. None when there are fewer used satellites than unknowns, or when the geometry is too weak.

    Raises
    ------
    ValueError
        For shapes that do not fit, or a satellite in two groups.
    """
    groups = np.atleast_2d(np.asarray(clock_groups, dtype=bool))
    _check_shapes(los, sigma_m, groups)
    group = np.where(groups.any(axis=0), groups.argmax(axis=0), -1)
    projection = np.empty((3 + len(groups), los.shape[1]))
    sigma = np.array(sigma_m, dtype=np.float64)
    found = project(np.array(los, dtype=np.float64), sigma, group, len(groups), float(max_condition), projection)
    return projection if found else None


def _check_shapes(los: FloatArray, sigma_m: FloatArray, groups: BoolArray) -> None:
    n_sats = sigma_m.shape[-1]
    if los.shape != (3, n_sats) or sigma_m.ndim != 1 or groups.shape[1:] != (n_sats,):
        raise ValueError(
            f"shapes los {los.shape}, sigma_m {sigma_m.shape}, clock_groups {groups.shape}: "
            "expected (3, N), (N,), (k, N)"
        )
    if (groups.sum(axis=0) > 1).any():
        raise ValueError("clock_groups: a satellite is in more than one group")


def vertical_projection(s_x, s_z, tan_gpa):  # type: ignore[no-untyped-def]
    """Projection on the vertical error relative to the glide path, of numbers or arrays: ``s_z + s_x tan(GPA)``."""
    return s_z + s_x * tan_gpa


def vertical_lateral(projection: FloatArray, gpa_rad: float) -> tuple[FloatArray, FloatArray]:
    """Vertical and lateral projection of range errors, relative to the glide path.

    Parameters
    ----------
    projection : (..., 3 + k, N) array
        S in the approach frame, from :func:`projection_matrix`.
    gpa_rad : float
        Glide path angle [rad].

    Returns
    -------
    s_vert, s_lat : (..., N) arrays
        ``s_z + s_x tan(GPA)`` and ``s_y`` [-].

    Source: ICAO Annex 10 Vol. I, App. B 3.6.5.5.1.1.2.
    """
    s_vert: FloatArray = vertical_projection(projection[..., 0, :], projection[..., 2, :], np.tan(gpa_rad))
    return s_vert, projection[..., 1, :]


def solve_position(
    approximate_m: FloatArray,
    satellite_m: FloatArray,
    range_m: FloatArray,
    sigma_m: FloatArray,
    clock_groups: ArrayLike,
    *,
    max_condition: float = MAX_CONDITION,
) -> PositionSolution | None:
    """Position and clocks from pseudoranges, by Gauss-Newton iteration in ECEF.

    Parameters
    ----------
    approximate_m : (3,) array
        Where to start; the centre of the Earth will do [m].
    satellite_m : (3, N) array
        Satellite positions at transmission, in the Earth-fixed frame of transmission; the Earth's rotation during the
        flight of the signal is applied here [m].
    range_m : (N,) array
        Corrected pseudoranges: satellite clock and corrections added, receiver clock not removed [m].
    sigma_m : (N,) array
        Standard deviations for the weights, NaN unused [m].
    clock_groups : (k, N) bool array
        Satellites of each receiver clock.

    Returns
    -------
    PositionSolution or None
        None when :func:`projection_matrix` refuses, or without convergence.
    """
    groups = np.atleast_2d(np.asarray(clock_groups, dtype=bool))
    sigma_m = np.where(np.isfinite(range_m), sigma_m, np.nan)
    position_m, clock_m = np.array(approximate_m, dtype=np.float64), np.zeros(len(groups))
    for iteration in range(1, _MAX_ITERATIONS + 1):
        geometric_m, los = rotated_range(position_m, satellite_m)
        projection = projection_matrix(los, sigma_m, groups, max_condition=max_condition)
        if projection is None:
            return None
        used = used_satellites(los, sigma_m, groups)
        innovation_m = np.where(used, range_m - geometric_m - clock_m @ groups, 0.0)
        step = projection @ innovation_m
        position_m, clock_m = position_m + step[:3], clock_m + step[3:]
        if float(np.sqrt(step[:3] @ step[:3])) < _CONVERGED_M:
            geometric_m, los = rotated_range(position_m, satellite_m)
            residual_m = np.where(used, range_m - geometric_m - clock_m @ groups, np.nan)
            clock_m = np.where((groups & used).any(axis=1), clock_m, np.nan)
            return PositionSolution(
                position_m=position_m,
                clock_m=clock_m,
                residual_m=residual_m,
                los_ecef=los,
                projection=projection,
                iterations=iteration,
            )
    return None
