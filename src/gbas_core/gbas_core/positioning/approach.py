# mypy: disable-error-code="no-untyped-call"
"""The final approach: its frame, deviations from its path, and alert limits.

The approach frame has its origin at the landing threshold point (LTP), x forward along the final course in the plane
tangent to the ellipsoid at the LTP, y left, z up. The final approach path is the straight line through the datum
crossing point (LTP raised by the threshold crossing height) with slope tan(GPA) in the plane y = 0. Distances to the
threshold are positive before it.

Deviations are positive left of the course and above the path, rectilinear and angular alike.

Source: ICAO Annex 10 Vol. I, App. B 3.6.4.5 and att. D (FAS data block), tables B-68 and B-69 (alert limits); RTCA
DO-253 2.3.11 (deviations).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.frames import ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.positioning.kernels import approach as kernel
from gbas_core.record import FloatArray

# Known: distance of the GNSS azimuth reference point behind the FPAP, the course width of a FAS without runway.
GARP_BEYOND_FPAP_M: Final = 305.0
POINT_IN_SPACE_COURSE_WIDTH_M: Final = 38.0
# Known: offset of the elevation reference point (GERP) from the GPIP, at a right angle to the course.
GERP_OFFSET_M: Final = 150.0

# Known: approach performance designator of the FAS data block.
APD_AB: Final = 0
APD_C: Final = 1
APD_CD: Final = 2


# What a FAS data block can say, and what of it may be missing.
_BOUNDS: Final[dict[str, tuple[float, float]]] = {
    "ltp_lat_rad": (-np.pi / 2.0, np.pi / 2.0),
    "ltp_lon_rad": (-np.pi, np.pi),
    "ltp_height_m": (-512.0, 6041.5),
    "delta_fpap_lat_rad": (-np.pi / 2.0, np.pi / 2.0),
    "delta_fpap_lon_rad": (-np.pi, np.pi),
    "tch_m": (0.0, 1638.35),
    "gpa_rad": (float(np.deg2rad(0.01)), float(np.deg2rad(89.99))),
    "course_width_m": (POINT_IN_SPACE_COURSE_WIDTH_M, 143.75),
    "delta_length_offset_m": (0.0, 2032.0),
    "fasval_m": (0.0, 50.8),
    "faslal_m": (0.0, 50.8),
    "apd": (0, 7),
    "rpds": (0, 48),
    "gerp_offset_m": (-1000.0, 1000.0),
}
_MAY_BE_MISSING: Final = frozenset({"delta_length_offset_m", "fasval_m", "faslal_m"})


@dataclass(frozen=True, eq=False)
class ApproachDeviation:
    """Where positions are relative to a final approach; arrays (...).

    Attributes
    ----------
    distance_m
        Horizontal distance to the LTP along the course, positive before the threshold [m].
    height_m
        Height above the LTP's tangent plane [m].
    path_height_m
        Height of the path above the LTP at that distance: what the vertical alert limit depends on [m].
    lateral_m, vertical_m
        Distance from the path, positive left and above; the vertical one is measured along the LTP's vertical [m].
    lateral_ddm, vertical_ddm
        Angular deviations, 0.155 and 0.175 at full scale, not limited [DDM]; NaN beyond the reference points.
    """

    distance_m: FloatArray
    height_m: FloatArray
    path_height_m: FloatArray
    lateral_m: FloatArray
    vertical_m: FloatArray
    lateral_ddm: FloatArray
    vertical_ddm: FloatArray


@dataclass(frozen=True, kw_only=True)
class FinalApproach:
    """A final approach segment (FAS) and the geometry that follows from it.

    Attributes
    ----------
    ltp_lat_rad, ltp_lon_rad, ltp_height_m : float
        Landing threshold point, WGS 84 [rad, rad, m].
    delta_fpap_lat_rad, delta_fpap_lon_rad : float
        Flight path alignment point minus LTP [rad]; its ellipsoidal height is the LTP's.
    tch_m, gpa_rad : float
        Threshold crossing height [m] and glide path angle [rad].
    course_width_m : float
        Lateral distance at the threshold of a full scale deviation [m].
    delta_length_offset_m : float
        From the far end of the runway to the FPAP [m], NaN when not given; information only.
    fasval_m, faslal_m : float
        Alert limits at the lowest heights [m]; NaN: none (no vertical guidance, or do not use).
    apd : int
        Approach performance designator as coded: 0 is A and B, 1 is C, 2 is C and D.
    airport_id, runway, route, rpi : str
        Airport, runway (``"26"``, ``"15R"``), route letter, reference path identifier.
    rpds : int
        Reference path data selector, 0 to 48.
    gerp_offset_m : float
        Offset of the GERP from the course, positive left [m]. Known is its size, uncertain whether all equipment uses
        it: 0 puts the origin of the vertical deviation at the GPIP.
    """

    ltp_lat_rad: float
    ltp_lon_rad: float
    ltp_height_m: float
    delta_fpap_lat_rad: float
    delta_fpap_lon_rad: float
    tch_m: float
    gpa_rad: float
    course_width_m: float = 105.0
    delta_length_offset_m: float = float("nan")
    fasval_m: float = 10.0
    faslal_m: float = 40.0
    apd: int = APD_C
    airport_id: str = ""
    runway: str = ""
    route: str = ""
    rpi: str = ""
    rpds: int = 0
    gerp_offset_m: float = GERP_OFFSET_M

    def __post_init__(self) -> None:
        for name, (low, high) in _BOUNDS.items():
            value = getattr(self, name)
            if not low <= value <= high and not (name in _MAY_BE_MISSING and np.isnan(value)):
                raise ValueError(f"final approach: {name} is {value}, it must be from {low:g} to {high:g}")
        if not self.runway_to_fpap_m > 0.0:
            raise ValueError("final approach: the FPAP is where the LTP is, so there is no course")

    @classmethod
    def from_course(
        cls,
        *,
        ltp_lat_rad: float,
        ltp_lon_rad: float,
        ltp_height_m: float,
        course_rad: float,
        fpap_distance_m: float,
        **rest: float | int | str,
    ) -> Self:
        """Build an approach from its true course and the distance from the LTP to the FPAP.

        Parameters
        ----------
        course_rad : float
            True bearing of the final course at the LTP, clockwise from north [rad].
        fpap_distance_m : float
            Distance in the LTP's tangent plane, usually the length of the runway [m].
        **rest
            The other attributes of the class.
        """
        ltp_ecef_m = ecef_from_geodetic(ltp_lat_rad, ltp_lon_rad, ltp_height_m)
        forward_enu = np.array([np.sin(course_rad), np.cos(course_rad), 0.0])
        rot = rot_enu_ecef(ltp_lat_rad, ltp_lon_rad)
        fpap_lat, fpap_lon, _ = geodetic_from_ecef(ltp_ecef_m + fpap_distance_m * (rot.T @ forward_enu))
        return cls(
            ltp_lat_rad=ltp_lat_rad,
            ltp_lon_rad=ltp_lon_rad,
            ltp_height_m=ltp_height_m,
            delta_fpap_lat_rad=float(fpap_lat) - ltp_lat_rad,
            delta_fpap_lon_rad=float(np.mod(fpap_lon - ltp_lon_rad + np.pi, 2.0 * np.pi) - np.pi),
            **rest,  # type: ignore[arg-type]  # checked by the class itself
        )

    @cached_property
    def ltp_ecef_m(self) -> FloatArray:
        """ECEF position of the LTP, shape (3,) [m]."""
        return ecef_from_geodetic(self.ltp_lat_rad, self.ltp_lon_rad, self.ltp_height_m)

    @cached_property
    def fpap_ecef_m(self) -> FloatArray:
        """ECEF position of the FPAP, shape (3,) [m]."""
        latitude, longitude = self.ltp_lat_rad + self.delta_fpap_lat_rad, self.ltp_lon_rad + self.delta_fpap_lon_rad
        return ecef_from_geodetic(latitude, longitude, self.ltp_height_m)

    @cached_property
    def _fpap_enu_m(self) -> FloatArray:
        rot: FloatArray = rot_enu_ecef(self.ltp_lat_rad, self.ltp_lon_rad)
        result: FloatArray = rot @ (self.fpap_ecef_m - self.ltp_ecef_m)
        return result

    @cached_property
    def runway_to_fpap_m(self) -> float:
        """Distance from the LTP to the FPAP in the LTP's tangent plane [m]."""
        return float(np.hypot(self._fpap_enu_m[0], self._fpap_enu_m[1]))

    @cached_property
    def course_rad(self) -> float:
        """True bearing of the final course at the LTP, clockwise from north, 0 to 2 pi [rad]."""
        return float(np.mod(np.arctan2(self._fpap_enu_m[0], self._fpap_enu_m[1]), 2.0 * np.pi))

    @cached_property
    def rot_approach_ecef(self) -> FloatArray:
        """Rotation from ECEF to approach axes, shape (3, 3)."""
        sine, cosine = self._fpap_enu_m[:2] / self.runway_to_fpap_m
        rot_approach_enu = np.array([[sine, cosine, 0.0], [-cosine, sine, 0.0], [0.0, 0.0, 1.0]])
        result: FloatArray = rot_approach_enu @ rot_enu_ecef(self.ltp_lat_rad, self.ltp_lon_rad)
        return result

    @cached_property
    def garp_m(self) -> FloatArray:
        """GNSS azimuth reference point in the approach frame, 305 m beyond the FPAP, shape (3,) [m]."""
        return np.array([self.runway_to_fpap_m + GARP_BEYOND_FPAP_M, 0.0, 0.0])

    @cached_property
    def dcp_m(self) -> FloatArray:
        """Datum crossing point in the approach frame, shape (3,) [m]."""
        return np.array([0.0, 0.0, self.tch_m])

    @cached_property
    def gpip_m(self) -> FloatArray:
        """Glide path intercept point in the approach frame, shape (3,) [m]."""
        return np.array([self.tch_m / np.tan(self.gpa_rad), 0.0, 0.0])

    @cached_property
    def gerp_m(self) -> FloatArray:
        """Elevation reference point in the approach frame, shape (3,) [m]."""
        return np.array([self.gpip_m[0], self.gerp_offset_m, 0.0])

    def approach_from_ecef(self, position_ecef_m: ArrayLike) -> FloatArray:
        """Positions (..., 3) in the approach frame [m] of ECEF positions (..., 3) [m]."""
        offset_m = np.asarray(position_ecef_m, dtype=np.float64) - self.ltp_ecef_m
        result: FloatArray = offset_m @ self.rot_approach_ecef.T
        return result

    def ecef_from_approach(self, position_m: ArrayLike) -> FloatArray:
        """ECEF positions (..., 3) [m] of positions (..., 3) in the approach frame [m]."""
        result: FloatArray = np.asarray(position_m, dtype=np.float64) @ self.rot_approach_ecef + self.ltp_ecef_m
        return result

    def path_height_m(self, distance_m: ArrayLike) -> FloatArray:
        """Height of the path above the LTP's tangent plane at a distance to the LTP [m]."""
        result: FloatArray = self.tch_m + np.asarray(distance_m, dtype=np.float64) * np.tan(self.gpa_rad)
        return result

    def position_on_path(self, distance_m: ArrayLike) -> FloatArray:
        """ECEF positions (..., 3) of the points of the path at distances (...) to the LTP [m]."""
        distance = np.asarray(distance_m, dtype=np.float64)
        return self.ecef_from_approach(
            np.stack([-distance, np.zeros_like(distance), self.path_height_m(distance)], axis=-1)
        )

    def deviations(self, position_ecef_m: ArrayLike) -> ApproachDeviation:
        """Deviations from the final approach path.

        Parameters
        ----------
        position_ecef_m : (..., 3) array
            Positions of the guidance control point, ECEF [m].

        Returns
        -------
        ApproachDeviation
            With arrays of shape (...).

        Source: RTCA DO-253 2.3.11; full scales as in ICAO Annex 10 Vol. I, App. B 3.6.4.5.
        """
        position_m = self.approach_from_ecef(position_ecef_m)
        fields = kernel.deviations(
            np.ascontiguousarray(position_m).reshape(-1, 3), float(self.tch_m), float(self.gpa_rad), self.garp_m,
            self.gerp_m, self.lateral_full_scale_rad,
        )  # fmt: skip
        return ApproachDeviation(*fields.reshape(7, *position_m.shape[:-1]))

    @cached_property
    def lateral_full_scale_rad(self) -> float:
        """Angle at the GARP of a full scale lateral deviation, ``atan(course width / |LTP-GARP|)`` [rad]."""
        return float(np.arctan(self.course_width_m / self.garp_m[0]))

    def limits(self, deviation: ApproachDeviation) -> tuple[FloatArray, FloatArray]:
        """Vertical and lateral alert limit [m] where `deviation` is: :func:`alert_limits` of this approach."""
        return alert_limits(
            self.fasval_m, self.faslal_m, deviation.distance_m, deviation.path_height_m, constant=self.apd == APD_AB
        )


def alert_limits(
    fasval_m: ArrayLike,
    faslal_m: ArrayLike,
    distance_m: ArrayLike,
    height_m: ArrayLike,
    *,
    constant: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Alert limits along the final approach.

    Parameters
    ----------
    fasval_m, faslal_m : array_like
        Vertical and lateral alert limit of the final approach segment [m].
    distance_m : array_like
        Horizontal distance to the LTP along the path; infinite gives the largest limit [m].
    height_m : array_like
        Height above the LTP of the position projected on the path; infinite gives the largest limit [m].
    constant : bool
        True for an approach with designator A or B (APV), whose limits are FASVAL and FASLAL everywhere.

    Returns
    -------
    val_m, lal_m : arrays
        Limits [m]. A missing input gives a missing limit: with no limit known there is no service. Below the lowest
        breakpoint, and beyond the threshold, the limits stay FASVAL and FASLAL.

    Notes
    -----
    The published segments meet within 9 mm (lateral, 873 m) and 5 mm (vertical, 1340 ft); they are used as published.

    Source: ICAO Annex 10 Vol. I, App. B tables B-68 and B-69.
    """
    given = np.broadcast_arrays(*(np.asarray(each, np.float64) for each in (fasval_m, faslal_m, distance_m, height_m)))
    fasval, faslal, distance, height = (np.array(each).ravel() for each in given)
    limits_m = kernel.all_alert_limits(fasval, faslal, distance, height, bool(constant))
    val_m, lal_m = limits_m.reshape(2, *given[0].shape)
    return np.asarray(val_m), np.asarray(lal_m)
