# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""The projection matrix of :mod:`gbas_core.positioning.wls`, compiled."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled

_JACOBI_SWEEPS: Final = 40
_ORTHOGONAL: Final = 1e-15


@compiled
def orthogonalise(columns, upper):
    """Factors Q R of a matrix whose columns are the rows of ``columns`` (m, n), which become those of Q; fills R.

    Gram-Schmidt, each column twice: Q is then orthogonal to rounding.
    """
    m, n = columns.shape
    upper[:] = 0.0
    for j in range(m):
        for _ in range(2):
            for k in range(j):
                dot = 0.0
                for i in range(n):
                    dot += columns[k, i] * columns[j, i]
                upper[k, j] += dot
                for i in range(n):
                    columns[j, i] -= dot * columns[k, i]
        square = 0.0
        for i in range(n):
            square += columns[j, i] ** 2
        upper[j, j] = np.sqrt(square)
        for i in range(n):
            columns[j, i] /= upper[j, j]


@compiled
def invert_upper(upper, inverse):
    """Fill in the inverse of an upper triangular matrix (m, m)."""
    m = upper.shape[0]
    inverse[:] = 0.0
    for j in range(m):
        inverse[j, j] = 1.0 / upper[j, j]
        for i in range(j - 1, -1, -1):
            total = 0.0
            for k in range(i + 1, j + 1):
                total += upper[i, k] * inverse[k, j]
            inverse[i, j] = -total / upper[i, i]


@compiled
def condition_number(matrix):
    """Largest over smallest singular value of a square matrix, which is destroyed: one-sided Jacobi rotations."""
    m = matrix.shape[0]
    for _ in range(_JACOBI_SWEEPS):
        rotated = False
        for p in range(m - 1):
            for q in range(p + 1, m):
                pp = qq = pq = 0.0
                for i in range(m):
                    pp += matrix[i, p] ** 2
                    qq += matrix[i, q] ** 2
                    pq += matrix[i, p] * matrix[i, q]
                if not abs(pq) > _ORTHOGONAL * np.sqrt(pp * qq):
                    continue
                rotated = True
                zeta = (qq - pp) / (2.0 * pq)
                tangent = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + np.sqrt(1.0 + zeta * zeta))
                cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
                for i in range(m):
                    at_p, at_q = matrix[i, p], matrix[i, q]
                    matrix[i, p] = cosine * (at_p - tangent * at_q)
                    matrix[i, q] = cosine * (at_q + tangent * at_p)
        if not rotated:
            break
    smallest, largest = np.inf, 0.0
    for j in range(m):
        square = 0.0
        for i in range(m):
            square += matrix[i, j] ** 2
        smallest, largest = np.minimum(smallest, square), np.maximum(largest, square)  # NaN stays
    return np.sqrt(largest / smallest) if np.isfinite(smallest) and smallest > 0.0 else np.inf


@compiled
def well_conditioned(upper, inverse, max_condition):
    """Whether the condition number of R is at most that large; its norms mostly tell."""
    squares = inverse_squares = 0.0
    for i in range(upper.shape[0]):
        for j in range(upper.shape[0]):
            squares += upper[i, j] ** 2
            inverse_squares += inverse[i, j] ** 2
    if np.sqrt(squares) * np.sqrt(inverse_squares) <= max_condition:  # never less than the condition number
        return True
    return condition_number(upper.copy()) <= max_condition


@compiled
def is_used(los, sigma_m, group, i):
    """Whether a satellite has a line of sight, a finite sigma above zero, and a clock."""
    weighted = np.isfinite(sigma_m[i]) and sigma_m[i] > 0.0 and group[i] >= 0
    return weighted and np.isfinite(los[0, i] + los[1, i] + los[2, i])


@compiled
def project(los, sigma_m, group, n_groups, max_condition, projection):
    """Fill in S ``(3 + k, N)``; False when there is none. See :func:`gbas_core.positioning.wls.projection_matrix`.

    Lines of sight ``(3, N)``, sigmas ``(N,)`` and clocks ``(N,)`` of the satellites, -1 for none.
    """
    n_sats, n = sigma_m.shape[0], 0
    column, m = np.full(n_groups, -1), 3
    place = np.empty(n_sats, np.int64)
    for i in range(n_sats):
        if is_used(los, sigma_m, group, i):
            place[n] = i
            n += 1
            column[group[i]] = 0
    for k in range(n_groups):
        if column[k] == 0:
            column[k] = m
            m += 1
    projection[:] = 0.0
    if n < m or m == 3:
        return False
    columns, upper, inverse = np.zeros((m, n)), np.empty((m, m)), np.empty((m, m))
    for j in range(n):
        i = place[j]
        weight = 1.0 / sigma_m[i]
        for axis in range(3):
            columns[axis, j] = weight * -los[axis, i]
        columns[column[group[i]], j] = weight
    orthogonalise(columns, upper)
    invert_upper(upper, inverse)
    if not well_conditioned(upper, inverse, max_condition):
        return False
    for row in range(3 + n_groups):
        own = row if row < 3 else column[row - 3]
        if own >= 0:
            for j in range(n):
                total = 0.0
                for k in range(own, m):
                    total += inverse[own, k] * columns[k, j]
                projection[row, place[j]] = total / sigma_m[place[j]]
    return True
