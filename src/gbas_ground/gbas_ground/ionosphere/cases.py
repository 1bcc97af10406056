"""What is screened: aircraft at places, with speeds and designators, and the satellites of one sky."""

from __future__ import annotations

from dataclasses import dataclass

from gbas_core.record import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Cases:
    """What does not change with the inflation; C cases of n satellites.

    Attributes
    ----------
    los : (C, 3, n) array
        Unit vectors to the satellites, approach frame.
    tan_gpa : (C,) array
        Tangent of the glide path angle.
    base_m : (n,) array
        Ground sigmas without inflation [m].
    air2_m2 : (C, n) array
        Variances of aircraft and troposphere [m^2].
    iono_m : (C, n) array
        Ionospheric sigma for a sigma_vig of 1 [m].
    error_m : (C, n) array
        Largest range errors in a front [m].
    shape_m : (n,) array
        Share of each satellite in the inflation of sigma_pr_gnd: its range error at the decision height [m].
    limit_m : (2, C) array
        Vertical and lateral alert limits, above which nobody has service [m].
    tolerable_m : (2, C) array
        Vertical and lateral errors that are tolerable [m].
    k_ffmd : float
        Multiplier of the protection level; the least an aircraft may use.
    k_noise : float
        Multiplier of the nominal error that may come on top of the front's.
    nominal_vig : float
        sigma_vig of the nominal error.
    affected : int
        Satellites a front affects at once, 1 or 2.
    """

    los: FloatArray
    tan_gpa: FloatArray
    base_m: FloatArray
    air2_m2: FloatArray
    iono_m: FloatArray
    error_m: FloatArray
    shape_m: FloatArray
    limit_m: FloatArray
    tolerable_m: FloatArray
    k_ffmd: float
    k_noise: float
    nominal_vig: float
    affected: int
