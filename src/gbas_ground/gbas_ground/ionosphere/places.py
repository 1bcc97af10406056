"""Where the aircraft may be that a station protects: along its approaches, slow and fast, of either designator."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.frames import rot_enu_ecef
from gbas_core.positioning.approach import FinalApproach, alert_limits
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.ionosphere.range_error import DivergenceCredit
from gbas_ground.ionosphere.section import IonosphereSection
from gbas_ground.params import GroundParams

_DISTANCES_M: Final = (2_000.0, 3_500.0, 5_500.0, 7_600.0, 12_000.0, 20_000.0, 32_000.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Where aircraft may be, how fast and with which designator; C cases, and D decision heights of the fastest.

    Attributes
    ----------
    los_axes : (C, 3, 3) array
        From east, north and up to the approach frame.
    tan_gpa, speed_mps : (C,) arrays
    offset_m : (C, 3) array
        From the station, east, north and up [m].
    height_m, slant_m : (C,) arrays
        Height above the threshold, distance from the station [m].
    designator_b : (C,) bool array
        Airborne accuracy designator B, else A.
    limit_m, tolerable_m : (2, C) arrays
        Vertical and lateral. Limits are those of the next place farther away: between the two they are not less.
    decision : (D,) int array
        The cases at the decision heights.
    radius_m : float
        Distance of the farthest antenna from the station [m].
    credit : DivergenceCredit or None
    """

    los_axes: FloatArray
    tan_gpa: FloatArray
    speed_mps: FloatArray
    offset_m: FloatArray
    height_m: FloatArray
    slant_m: FloatArray
    designator_b: BoolArray
    limit_m: FloatArray
    tolerable_m: FloatArray
    decision: NDArray[np.int64]
    radius_m: float
    credit: DivergenceCredit | None


def places_of(params: GroundParams) -> Places:
    """Places along every approach from the threshold to the largest distance of use."""
    section, station = params.ionosphere, params.reference_point_m()
    enu = rot_enu_ecef(params.station.latitude_rad, params.station.longitude_rad)
    rows: list[tuple[Any, ...]] = []
    for approach in params.approaches:
        decision_m = decision_distance_m(approach, section.decision_height_m)
        outer_m = params.station.max_use_distance_m + float(np.linalg.norm(approach.ltp_ecef_m - station))
        distances = sorted({0.0, decision_m, outer_m, *(each for each in _DISTANCES_M if decision_m < each < outer_m)})
        for distance_m, beyond_m in zip(distances, [*distances[1:], outer_m], strict=True):
            away_m = approach.position_on_path(distance_m) - station
            height_m = float(approach.path_height_m(distance_m))
            limits = alert_limits(approach.fasval_m, approach.faslal_m, beyond_m, approach.path_height_m(beyond_m))
            course, slope = approach.course_rad, math.tan(approach.gpa_rad)
            turn = [
                [math.sin(course), math.cos(course), 0.0],
                [-math.cos(course), math.sin(course), 0.0],
                [0.0, 0.0, 1.0],
            ]
            for speed in sorted(set(section.aircraft_speed_mps)):
                for aad in section.aircraft_aad:
                    shaping = distance_m == decision_m and speed == max(section.aircraft_speed_mps)
                    rows.append(
                        (turn, slope, speed, enu @ away_m, height_m, np.linalg.norm(away_m), aad == "B", limits,
                         _tolerable_m(section, height_m), shaping)
                    )  # fmt: skip
    axes, slopes, speeds, offsets, heights, slants, b, limit, tolerable, shaping_of = (
        np.array(each) for each in zip(*rows, strict=True)
    )
    return Places(
        los_axes=axes,
        tan_gpa=slopes,
        speed_mps=speeds,
        offset_m=offsets,
        height_m=heights,
        slant_m=slants,
        designator_b=b,
        limit_m=np.ascontiguousarray(limit.T),
        tolerable_m=np.ascontiguousarray(tolerable.T),
        decision=np.flatnonzero(shaping_of),
        radius_m=float(np.linalg.norm(params.receiver_positions_m() - station, axis=-1).max()),
        credit=credit_of(params),
    )


def _tolerable_m(section: IonosphereSection, height_m: float) -> tuple[float, float]:
    growth_m = max(0.0, height_m - section.decision_height_m) * section.tolerable_growth
    errors = (section.tolerable_vertical_m, section.tolerable_lateral_m)
    vertical_m, lateral_m = (each + growth_m if each > 0.0 else 0.0 for each in errors)
    return vertical_m, lateral_m


def decision_distance_m(approach: FinalApproach, height_m: float) -> float:
    """Distance to the threshold at which the path is this high above it; 0 when it is higher everywhere [m]."""
    return max(0.0, (height_m - approach.tch_m) / math.tan(approach.gpa_rad))


def credit_of(params: GroundParams) -> DivergenceCredit | None:
    """What the station's divergence monitor excludes for certain; None when it excludes nothing."""
    ccd = params.ccd
    if not ccd.exclude:
        return None
    return DivergenceCredit(
        threshold_mps=ccd.threshold_mps,
        margin_mps=params.ionosphere.k_missed_detection * ccd.sigma_mps,
        tau_s=ccd.tau_s,
        readmission_s=params.monitors.readmission_time_s,
    )
