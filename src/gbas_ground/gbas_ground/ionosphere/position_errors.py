# mypy: disable-error-code="no-untyped-call"
"""Position errors and protection levels of many geometries, compiled: the inner loops of the screening.

The clocks are eliminated from the normal equations and the three that are left are solved in closed form.

Source: as :func:`gbas_core.positioning.wls.projection_matrix`, ICAO Annex 10 Vol. I, App. B 3.6.5.5.1.1.2.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.ionosphere.cases import Cases

_SINGULAR: Final = 1e-9
"""Of the product of the diagonal: a determinant below it is rounding, and the geometry has no position."""


@compiled
def _geometry(los, weight, group, n_groups, used, tan_gpa, s_vert, s_lat):  # type: ignore[no-untyped-def]
    """Fill in the projections of one geometry; False when there is none.

    ``los`` (3, n), ``weight`` (n,), ``group`` (n,) of int, ``used`` (n,) of bool, ``s_vert``, ``s_lat`` (n,).
    """
    n = weight.shape[0]
    mean = np.zeros((n_groups, 3))
    total = np.zeros(n_groups)
    for i in range(n):
        if used[i]:
            total[group[i]] += weight[i]
            for axis in range(3):
                mean[group[i], axis] += weight[i] * los[axis, i]
    for k in range(n_groups):
        if total[k] > 0.0:
            for axis in range(3):
                mean[k, axis] /= total[k]
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(n):
        if used[i]:
            x, y, z = los[0, i] - mean[group[i], 0], los[1, i] - mean[group[i], 1], los[2, i] - mean[group[i], 2]
            w = weight[i]
            xx += w * x * x
            xy += w * x * y
            xz += w * x * z
            yy += w * y * y
            yz += w * y * z
            zz += w * z * z
    # rows of the adjugate of the symmetric matrix
    a_x, a_y, a_z = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    b_y, b_z, c_z = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * a_x + xy * a_y + xz * a_z
    if not determinant > _SINGULAR * xx * yy * zz:
        return False
    v_x, v_y, v_z = a_z + tan_gpa * a_x, b_z + tan_gpa * a_y, c_z + tan_gpa * a_z
    for i in range(n):
        s_vert[i] = s_lat[i] = 0.0
        if used[i]:
            x, y, z = los[0, i] - mean[group[i], 0], los[1, i] - mean[group[i], 1], los[2, i] - mean[group[i], 2]
            w = -weight[i] / determinant  # the design's rows are minus the lines of sight
            s_vert[i] = w * (v_x * x + v_y * y + v_z * z)
            s_lat[i] = w * (a_y * x + b_y * y + b_z * z)
    return True


@compiled
def _spread(s, variance, nominal, error, affected):  # type: ignore[no-untyped-def]
    """Variance with inflation, nominal variance, and the error of the worst satellite or two, of one direction."""
    inflated = ordinary = first = second = 0.0
    for i in range(s.shape[0]):
        inflated += s[i] * s[i] * variance[i]
        ordinary += s[i] * s[i] * nominal[i]
        size = abs(s[i]) * error[i]
        if size > first:
            first, second = size, first
        elif size > second:
            second = size
    return inflated, ordinary, first + second if affected == 2 else first


@compiled
def _judge(  # type: ignore[no-untyped-def]
    los, tan_gpa, variance, nominal, error, group, n_groups, subsets, limit, tolerable, k_ffmd, k_noise, affected,
    first_only, level, wrong,
):  # fmt: skip
    """Fill in protection levels and errors ``(C, B, 2)``; returns how many geometries are not safe.

    With `first_only` it ends at the first of them.
    """
    n = group.shape[0]
    s_vert, s_lat, weight = np.zeros(n), np.zeros(n), np.empty(n)
    not_safe = 0
    for c in range(los.shape[0]):
        for i in range(n):
            weight[i] = 1.0 / variance[c, i]
        for b in range(subsets.shape[0]):
            if not _geometry(los[c], weight, group, n_groups, subsets[b], tan_gpa[c], s_vert, s_lat):
                level[c, b, :] = wrong[c, b, :] = np.inf
                continue
            served = bounded = True
            for k in range(2):
                s = s_vert if k == 0 else s_lat
                inflated, ordinary, front = _spread(s, variance[c], nominal[c], error[c], affected)
                level[c, b, k] = k_ffmd * np.sqrt(inflated)
                wrong[c, b, k] = k_noise * np.sqrt(ordinary) + front
                served = served and level[c, b, k] <= limit[k, c]
                bounded = bounded and wrong[c, b, k] <= max(level[c, b, k], tolerable[k, c])
            if served and not bounded:
                not_safe += 1
                if first_only:
                    return not_safe
    return not_safe


class Geometries(NamedTuple):
    """Protection levels and errors of cases and subsets, vertical and lateral, ``(C, B, 2)`` [m]; infinite without a
    position. How many are not safe."""

    level_m: FloatArray
    error_m: FloatArray
    not_safe: int


def geometries(
    cases: Cases,
    variance_m2: FloatArray,
    nominal_m2: FloatArray,
    groups: BoolArray,
    subsets: BoolArray,
    *,
    first_only: bool = False,
) -> Geometries:
    """Judge every case with every subset.

    Parameters
    ----------
    cases : Cases
    variance_m2, nominal_m2 : (C, n) arrays
        Variances the aircraft takes, and those of the error without a front [m^2].
    groups, subsets : (k, n), (B, n) bool arrays
        Satellites of each clock; sets an aircraft may use.
    first_only : bool
        End at the first geometry that is not safe; what was not looked at is NaN.
    """
    shape = (cases.los.shape[0], subsets.shape[0], 2)
    level, wrong = np.full(shape, np.nan), np.full(shape, np.nan)
    not_safe = _judge(
        np.ascontiguousarray(cases.los), cases.tan_gpa, variance_m2, nominal_m2, cases.error_m, groups.argmax(axis=0),
        len(groups), subsets, cases.limit_m, cases.tolerable_m, cases.k_ffmd, cases.k_noise, cases.affected,
        first_only, level, wrong,
    )  # fmt: skip
    return Geometries(level, wrong, int(not_safe))


def compile_ahead() -> None:
    """Compile now, not at the first epoch that is screened; once a machine it takes some seconds."""
    one, ones, flags = np.ones(1), np.ones((1, 1)), np.ones((1, 1), dtype=bool)
    cases = Cases(
        los=np.ones((1, 3, 1)), tan_gpa=one, base_m=one, air2_m2=ones, iono_m=ones, error_m=ones, shape_m=one,
        limit_m=np.ones((2, 1)), tolerable_m=np.ones((2, 1)), k_ffmd=1.0, k_noise=1.0, nominal_vig=0.0, affected=1,
    )  # fmt: skip
    geometries(cases, ones, ones, flags, flags)
