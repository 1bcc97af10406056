# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Deviations and alert limits of :mod:`gbas_core.positioning.approach`, compiled. Missing is NaN and stays it."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled

# Known: full scale of the deviations, in difference of depth of modulation and as a share of the glide path angle.
LATERAL_FULL_SCALE_DDM: Final = 0.155
VERTICAL_FULL_SCALE_DDM: Final = 0.175
VERTICAL_FULL_SCALE_OF_GPA: Final = 0.25

FOOT_M: Final = 0.3048
# Known (Annex 10, tables B-68 and B-69): where the alert limits begin and stop growing.
LAL_NEAR_M: Final = 873.0
LAL_FAR_M: Final = 7500.0
VAL_LOW_FT: Final = 200.0
VAL_HIGH_FT: Final = 1340.0


@compiled
def deviations(position_m, tch_m, gpa_rad, garp_m, gerp_m, lateral_full_scale_rad):
    """Fields of :class:`gbas_core.positioning.approach.ApproachDeviation` in their order, ``(7, n)``.

    Positions ``(n, 3)`` and the reference points GARP and GERP ``(3,)`` are in the approach frame.
    """
    result = np.empty((7, position_m.shape[0]))
    for i in range(position_m.shape[0]):
        x, y, z = position_m[i]
        path_height_m = tch_m + -x * np.tan(gpa_rad)
        to_garp_m = garp_m[0] - x if x < garp_m[0] else np.nan
        to_gerp_m = np.hypot(x - gerp_m[0], y - gerp_m[1]) if x < gerp_m[0] else np.nan
        vertical_rad = np.arctan2(z - gerp_m[2], to_gerp_m) - gpa_rad
        result[0, i], result[1, i], result[2, i], result[3, i] = -x, z, path_height_m, y
        result[4, i] = z - path_height_m
        result[5, i] = LATERAL_FULL_SCALE_DDM * np.arctan(y / to_garp_m) / lateral_full_scale_rad
        result[6, i] = VERTICAL_FULL_SCALE_DDM * vertical_rad / (VERTICAL_FULL_SCALE_OF_GPA * gpa_rad)
    return result


@compiled
def alert_limits(fasval_m, faslal_m, distance_m, height_m, constant):
    """Vertical and lateral alert limit of one place; see :func:`gbas_core.positioning.approach.alert_limits`."""
    if constant:
        return fasval_m + (np.nan if np.isnan(height_m) else 0.0), faslal_m + (np.nan if np.isnan(distance_m) else 0.0)
    height_ft = height_m / FOOT_M
    lateral_m, vertical_m = np.nan if np.isnan(distance_m) else 0.0, np.nan if np.isnan(height_ft) else 0.0
    if distance_m > LAL_FAR_M:
        lateral_m = 29.15
    elif distance_m > LAL_NEAR_M:
        lateral_m = 0.0044 * distance_m - 3.85
    if height_ft > VAL_HIGH_FT:
        vertical_m = 33.35
    elif height_ft > VAL_LOW_FT:
        vertical_m = 0.02925 * height_ft - 5.85
    return fasval_m + vertical_m, faslal_m + lateral_m


@compiled
def all_alert_limits(fasval_m, faslal_m, distance_m, height_m, constant):
    """Vertical and lateral alert limits ``(2, n)`` of places ``(n,)``."""
    limits_m = np.empty((2, len(distance_m)))
    for i in range(len(distance_m)):
        limits_m[0, i], limits_m[1, i] = alert_limits(fasval_m[i], faslal_m[i], distance_m[i], height_m[i], constant)
    return limits_m
