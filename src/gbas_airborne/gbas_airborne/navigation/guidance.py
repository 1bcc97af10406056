# mypy: disable-error-code="no-untyped-call"
"""Guidance: where the aircraft is on the approach, whether that is within coverage, and the alert limits there.

Source: ICAO Annex 10 vol. I, tables B-68 and B-69 (alert limits) and 3.7.3.5.3 (service volume); RTCA DO-253
(deviations); geometry in :mod:`gbas_core.positioning.approach`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_core.positioning.approach import APD_AB, ApproachDeviation, FinalApproach
from gbas_core.positioning.kernels.approach import alert_limits
from gbas_core.record import FloatArray
from gbas_msgs_py.records import SolutionEpoch

# Known (ICAO Annex 10 vol. I, 3.7.3.5.3): minimum GAST-C service volume, lateral from the LTP, vertical from the GPIP.
HALF_WIDTH_AT_LTP_M: Final = 137.0
INNER_SPLAY_RAD: Final = math.radians(35.0)
INNER_RANGE_M: Final = 28_000.0
OUTER_SPLAY_RAD: Final = math.radians(10.0)
OUTER_RANGE_M: Final = 37_000.0
LOWEST_OF_GPA: Final = 0.45
HIGHEST_OF_GPA: Final = 1.75
HIGHEST_RAD: Final = math.radians(7.0)
CEILING_M: Final = 3000.0


def in_service_volume(approach: FinalApproach, deviation: ApproachDeviation) -> bool:
    """Whether a position is where the approach's guidance must be good.

    Parameters
    ----------
    approach : FinalApproach
    deviation : ApproachDeviation
        Of one position.

    Notes
    -----
    The lower end of 30 m above the threshold is not applied: guidance does not vanish at the decision height, the
    protection levels go on judging it. Positions behind the GPIP are outside.

    Source: ICAO Annex 10 vol. I, 3.7.3.5.3.
    """
    distance_m, height_m = float(deviation.distance_m), float(deviation.height_m)
    splay_rad = INNER_SPLAY_RAD if distance_m <= INNER_RANGE_M else OUTER_SPLAY_RAD
    half_width_m = HALF_WIDTH_AT_LTP_M + max(distance_m, 0.0) * math.tan(splay_rad)
    to_gpip_m = distance_m + float(approach.gpip_m[0])
    if not (to_gpip_m > 0.0 and distance_m <= OUTER_RANGE_M and abs(float(deviation.lateral_m)) <= half_width_m):
        return False
    angle_rad = math.atan2(height_m, to_gpip_m)
    highest_rad = max(HIGHEST_RAD, HIGHEST_OF_GPA * approach.gpa_rad)
    return LOWEST_OF_GPA * approach.gpa_rad <= angle_rad <= highest_rad and height_m <= CEILING_M


def guidance_columns(approach: FinalApproach | None, position_ecef_m: FloatArray) -> dict[str, float]:
    """The approach's part of a solution: deviations and what alert limits are made of.

    Without an approach it is empty. Angular deviations are given within the service volume only: a missing one tells
    that there is no guidance there.
    """
    if approach is None:
        return {}
    deviation = approach.deviations(position_ecef_m)
    covered = in_service_volume(approach, deviation)
    return {
        "distance_to_ltp_m": float(deviation.distance_m),
        "height_above_ltp_m": float(deviation.height_m),
        "lateral_m": float(deviation.lateral_m),
        "vertical_m": float(deviation.vertical_m),
        "lateral_ddm": float(deviation.lateral_ddm) if covered else math.nan,
        "vertical_ddm": float(deviation.vertical_ddm) if covered else math.nan,
    }


def approach_columns(approach: FinalApproach | None) -> dict[str, float]:
    """The part of a solution that comes from the approach alone; empty without one."""
    if approach is None:
        return {}
    return {"fasval_m": approach.fasval_m, "faslal_m": approach.faslal_m, "apd": float(approach.apd)}


def alert_limits_m(solution: SolutionEpoch) -> tuple[float, float]:
    """Vertical and lateral alert limit of a solution [m]; NaN where the approach has none.

    Notes
    -----
    The vertical limit depends on the height of the path below or above the aircraft, not on the aircraft's own height.
    Without a deviation the limits are the largest (tables B-68 and B-69); there is no position then either, so nothing
    is lost.
    """
    distance_m = solution.distance_to_ltp_m
    path_height_m = solution.height_above_ltp_m - solution.vertical_m
    if not math.isfinite(distance_m + path_height_m):
        distance_m = path_height_m = np.inf
    limits_m: tuple[float, float] = alert_limits(
        float(solution.fasval_m), float(solution.faslal_m), float(distance_m), float(path_height_m),
        bool(solution.apd == APD_AB),
    )  # fmt: skip
    return limits_m
