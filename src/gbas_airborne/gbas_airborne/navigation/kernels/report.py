# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""What is told of the satellites a position is made of, compiled."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_airborne.navigation.kernels.position import (
    AZIMUTH,
    ELEVATION,
    RESIDUAL,
    SIGMA_AIR,
    SIGMA_IONO,
    SIGMA_TROPO,
)
from gbas_airborne.reception.columns import B_VALUES, SIGMA
from gbas_core.compiled import compiled
from gbas_core.positioning.wls import vertical_projection
from gbas_msgs_py.codes import Rejection

COLUMNS: Final = (
    "elevation_rad",
    "azimuth_rad",
    "s_vert",
    "s_lat",
    "sigma_gnd_m",
    "sigma_air_m",
    "sigma_tropo_m",
    "sigma_iono_m",
    "ephemeris_error_m",
    "residual_m",
)
"""Columns of the solution, in the order of their rows; the B values follow."""
_NONE: Final = int(Rejection.NONE)
_N_COLUMNS: Final = len(COLUMNS)
_s_vert: Final = compiled(vertical_projection)


@compiled
def used_columns(reason, sky, projection, tan_gpa, corrections, checks, distance_m):
    """Rows of :data:`COLUMNS` and of B values, NaN where a satellite is not used; numbers of satellites and receivers.

    Reasons ``(N,)``, sky ``(ROWS, N)``, projection ``(3 + groups, N)``, corrections ``(rows, N)`` and checks ``(3, N)``
    as received. Receivers are the most behind any correction used, at least one.
    """
    n_values = corrections.shape[0] - B_VALUES
    rows = np.full((_N_COLUMNS + n_values, reason.shape[0]), np.nan)
    n_sats, n_receivers = 0, 1
    for s in range(reason.shape[0]):
        if reason[s] != _NONE:
            continue
        n_sats += 1
        rows[0, s], rows[1, s] = sky[ELEVATION, s], sky[AZIMUTH, s]
        rows[2, s], rows[3, s] = _s_vert(projection[0, s], projection[2, s], tan_gpa), projection[1, s]
        rows[4, s], rows[5, s] = corrections[SIGMA, s], sky[SIGMA_AIR, s]
        rows[6, s], rows[7, s] = sky[SIGMA_TROPO, s], sky[SIGMA_IONO, s]
        rows[8, s], rows[9, s] = distance_m * checks[2, s], sky[RESIDUAL, s]
        behind = 0
        for j in range(n_values):
            rows[_N_COLUMNS + j, s] = corrections[B_VALUES + j, s]
            behind += np.isfinite(corrections[B_VALUES + j, s])
        n_receivers = max(n_receivers, behind)
    return rows, n_sats, n_receivers
