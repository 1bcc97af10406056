# mypy: disable-error-code="no-untyped-call"
"""Error models of the standard: what each part of a corrected pseudorange may be wrong by.

One published model a function. Elevations are radians and broadcast against the rest. An elevation below the mask, or a
missing one, gives NaN: a satellite without a sigma is not used.

Sources: ICAO Annex 10 Vol. I, App. B tables of ground accuracy designators and 3.6.5; RTCA DO-253 2.3.12; the models of
airborne noise and multipath, troposphere and ionosphere as in Caamano et al., "Dual frequency dual constellation GBAS
processing modes", eq (8) to (12).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.compiled import as_written, compiled
from gbas_core.record import FloatArray
from gbas_core.signals import IONO_RATIO, L5

GroundAccuracy = Literal["A", "B", "C"]
AirborneAccuracy = Literal["A", "B"]

# Known: lowest elevation for which the designators are defined.
MASK_RAD: Final = float(np.deg2rad(5.0))
# Known: the elevation at which designator C changes its coefficients; 35 degrees itself belongs to the lower part.
GAD_C_STEP_DEG: Final = 35.0
# Known: radius of the Earth and height of the thin shell in the obliquity factor.
IONO_EARTH_RADIUS_M: Final = 6_378_136.3
IONO_SHELL_HEIGHT_M: Final = 350_000.0
EDGE_DEG: Final = 1e-9  # rounding of an elevation that is meant to be on the mask or the step


@dataclass(frozen=True, kw_only=True)
class GroundCurve:
    """Coefficients of ``sqrt((a0 + a1 exp(-theta / theta0))^2 / M + a2^2)``, theta in degrees."""

    a0_m: float
    a1_m: float
    theta0_deg: float
    a2_m: float


@dataclass(frozen=True, kw_only=True)
class AirborneCurve:
    """Coefficients of ``a0 + a1 exp(-theta / theta0)``, theta in degrees."""

    a0_m: float
    a1_m: float
    theta0_deg: float


# Known (Annex 10): ground accuracy designators. C has two parts, joined at GAD_C_STEP_DEG.
GAD_A: Final = GroundCurve(a0_m=0.5, a1_m=1.65, theta0_deg=14.3, a2_m=0.08)
GAD_B: Final = GroundCurve(a0_m=0.16, a1_m=1.07, theta0_deg=15.5, a2_m=0.08)
GAD_C_HIGH: Final = GroundCurve(a0_m=0.15, a1_m=0.84, theta0_deg=15.5, a2_m=0.04)
GAD_C_LOW: Final = GroundCurve(a0_m=0.24, a1_m=0.0, theta0_deg=15.5, a2_m=0.04)

# Known (Caamano et al., eq (8) and (9)): airborne accuracy designators and airframe multipath.
AAD_A: Final = AirborneCurve(a0_m=0.15, a1_m=0.43, theta0_deg=6.9)
AAD_B: Final = AirborneCurve(a0_m=0.11, a1_m=0.13, theta0_deg=4.0)
AIRFRAME_MULTIPATH: Final = AirborneCurve(a0_m=0.13, a1_m=0.53, theta0_deg=10.0)

# Uncertain, ours: surrogates for L5/E5a and E1, whose curves are published as pictures only. Replace when numbers are
# known.
L5_GROUND_SURROGATE: Final = GroundCurve(a0_m=0.08, a1_m=0.30, theta0_deg=15.5, a2_m=0.04)
L5_NOISE_SURROGATE: Final = AirborneCurve(a0_m=0.06, a1_m=0.05, theta0_deg=6.0)
L5_MULTIPATH_SURROGATE: Final = AirborneCurve(a0_m=0.08, a1_m=0.20, theta0_deg=10.0)
E1_GROUND_FACTOR_SURROGATE: Final = 0.9


# --- formulas of single numbers for compiled loops; as written they are those of arrays too


@compiled
def curve_m(theta_deg, a0_m, a1_m, theta0_deg):  # type: ignore[no-untyped-def]
    """``a0 + a1 exp(-theta / theta0)`` [m]."""
    return a0_m + a1_m * np.exp(-theta_deg / theta0_deg)


@compiled
def tropo_m(refractivity, scale_m, sine, height_m):  # type: ignore[no-untyped-def]
    """TC of :func:`tropo_correction_m`; `sine` is that of the elevation [m]."""
    return refractivity * scale_m * 1e-6 / np.sqrt(0.002 + sine**2) * -np.expm1(-height_m / scale_m)


@compiled
def obliquity(elevation_rad):  # type: ignore[no-untyped-def]
    """F_pp of :func:`iono_obliquity` [-]."""
    ratio = IONO_EARTH_RADIUS_M / (IONO_EARTH_RADIUS_M + IONO_SHELL_HEIGHT_M) * np.cos(elevation_rad)
    return 1.0 / np.sqrt(1.0 - ratio**2)


@compiled
def iono_m(factor, gradient, distance_m, speed_mps, tau_s):  # type: ignore[no-untyped-def]
    """:func:`sigma_iono_m` with an obliquity [m]."""
    return factor * gradient * (distance_m + 2.0 * tau_s * speed_mps)


@compiled
def ground_m(single_m, number, a2_m):  # type: ignore[no-untyped-def]
    """Ground error of the mean of a number of receivers, from the curve of a single one and what they share [m]."""
    return np.sqrt(single_m**2 / number + a2_m**2)


def _elevation_deg(elevation_rad: ArrayLike, mask_rad: float) -> FloatArray:
    """Elevation in degrees, NaN below the mask."""
    elevation_deg = np.rad2deg(np.asarray(elevation_rad, dtype=np.float64))
    return np.where(elevation_deg >= np.rad2deg(mask_rad) - EDGE_DEG, elevation_deg, np.nan)


def ground_curve_m(
    curve: GroundCurve, elevation_rad: ArrayLike, n_receivers: ArrayLike, *, mask_rad: float = MASK_RAD
) -> FloatArray:
    """Ground error of `curve` for the mean of `n_receivers` receivers [m]; NaN for fewer than one receiver."""
    theta_deg = _elevation_deg(elevation_rad, mask_rad)
    number = np.asarray(n_receivers, dtype=np.float64)
    number = np.where(number >= 1.0, number, np.nan)
    single_m = as_written(curve_m)(theta_deg, curve.a0_m, curve.a1_m, curve.theta0_deg)
    return np.asarray(as_written(ground_m)(single_m, number, curve.a2_m))


def airborne_curve_m(curve: AirborneCurve, elevation_rad: ArrayLike, *, mask_rad: float = MASK_RAD) -> FloatArray:
    """Airborne error of `curve` [m]."""
    theta_deg = _elevation_deg(elevation_rad, mask_rad)
    return np.asarray(as_written(curve_m)(theta_deg, curve.a0_m, curve.a1_m, curve.theta0_deg))


GROUND_CURVES: Final[dict[GroundAccuracy, tuple[GroundCurve, GroundCurve]]] = {
    "A": (GAD_A, GAD_A),
    "B": (GAD_B, GAD_B),
    "C": (GAD_C_LOW, GAD_C_HIGH),
}
"""Of each designator, up to GAD_C_STEP_DEG and above."""


@compiled
def sigma_pr_gnd_of(curves: FloatArray, elevation_rad: float, number: float, mask_rad: float) -> float:
    """:func:`sigma_pr_gnd` of one satellite; `curves` ``(2, 4)`` are the coefficients below and above the step."""
    theta_deg = np.rad2deg(elevation_rad)
    if not (theta_deg >= np.rad2deg(mask_rad) - EDGE_DEG and number >= 1.0):
        return np.nan
    a = curves[1 if theta_deg > GAD_C_STEP_DEG + EDGE_DEG else 0]
    return float(ground_m(curve_m(theta_deg, a[0], a[1], a[2]), number, a[3]))


def sigma_pr_gnd(
    gad: GroundAccuracy, elevation_rad: ArrayLike, n_receivers: ArrayLike, *, mask_rad: float = MASK_RAD
) -> FloatArray:
    """Largest allowed rms of the broadcast correction for a ground accuracy designator.

    Parameters
    ----------
    gad : {"A", "B", "C"}
        Ground accuracy designator.
    elevation_rad : array_like
        Satellite elevation at the reference point [rad].
    n_receivers : array_like
        Number of receivers averaged in the correction, M [-].

    Returns
    -------
    array
        Standard deviation [m]; NaN below the mask and for fewer than one receiver.

    Raises
    ------
    ValueError
        For an unknown designator.

    Source: ICAO Annex 10 Vol. I, App. B 3.6.7.1.1.1, tables of A, B and C.
    """
    if gad == "A":
        return ground_curve_m(GAD_A, elevation_rad, n_receivers, mask_rad=mask_rad)
    if gad == "B":
        return ground_curve_m(GAD_B, elevation_rad, n_receivers, mask_rad=mask_rad)
    if gad == "C":
        high = ground_curve_m(GAD_C_HIGH, elevation_rad, n_receivers, mask_rad=mask_rad)
        low = ground_curve_m(GAD_C_LOW, elevation_rad, n_receivers, mask_rad=mask_rad)
        return np.where(np.rad2deg(np.asarray(elevation_rad)) > GAD_C_STEP_DEG + EDGE_DEG, high, low)
    raise ValueError(f"ground accuracy designator {gad!r} is not A, B or C")


def sigma_ionosphere_free_m(sigma_l1_m: ArrayLike, sigma_l5_m: ArrayLike, correlation: ArrayLike = 0.0) -> FloatArray:
    """Error of the ionosphere-free combination of two ranges, from theirs.

    Parameters
    ----------
    sigma_l1_m, sigma_l5_m : array_like
        Standard deviations on L1/E1 and on L5/E5a, of one smoothing time constant [m].
    correlation : array_like
        Correlation of the two errors; 0 is eq (7). Errors that go together cancel in part: a measured correlation
        above 0 gives less, one below 0 more.

    Returns
    -------
    array
        Standard deviation [m]; NaN where a sigma is missing or negative, or a correlation is not within -1 to 1.

    Source: Caamano et al., eq (7), f1^2/(f1^2 - f5^2) = gamma/(gamma - 1) and f5^2/(f1^2 - f5^2) = 1/(gamma - 1); with
    correlation, the variance of a difference.
    """
    first, second, rho = (np.asarray(value, dtype=np.float64) for value in (sigma_l1_m, sigma_l5_m, correlation))
    first, second = (np.where(value >= 0.0, value, np.nan) for value in (first, second))
    rho = np.where(np.abs(rho) <= 1.0, rho, np.nan)
    first, second = IONO_RATIO[L5] / (IONO_RATIO[L5] - 1.0) * first, second / (IONO_RATIO[L5] - 1.0)
    # (a - b)^2 + 2 ab (1 - rho): never negative in floating point
    return np.asarray(np.sqrt((first - second) ** 2 + 2.0 * first * second * (1.0 - rho)))


def sigma_noise_air(aad: AirborneAccuracy, elevation_rad: ArrayLike, *, mask_rad: float = MASK_RAD) -> FloatArray:
    """Receiver noise, thermal and interference, for an airborne accuracy designator [m].

    Raises
    ------
    ValueError
        For an unknown designator.

    Source: Caamano et al., eq (8).
    """
    if aad not in ("A", "B"):
        raise ValueError(f"airborne accuracy designator {aad!r} is not A or B")
    return airborne_curve_m(AAD_A if aad == "A" else AAD_B, elevation_rad, mask_rad=mask_rad)


def sigma_multipath_air(elevation_rad: ArrayLike, *, mask_rad: float = MASK_RAD) -> FloatArray:
    """Airframe multipath [m].

    Source: Caamano et al., eq (9).
    """
    return airborne_curve_m(AIRFRAME_MULTIPATH, elevation_rad, mask_rad=mask_rad)


def sigma_air(aad: AirborneAccuracy, elevation_rad: ArrayLike, *, mask_rad: float = MASK_RAD) -> FloatArray:
    """Airborne receiver noise and multipath together [m].

    Source: Caamano et al., eq (10).
    """
    noise_m = sigma_noise_air(aad, elevation_rad, mask_rad=mask_rad)
    return np.hypot(noise_m, sigma_multipath_air(elevation_rad, mask_rad=mask_rad))


def tropo_correction_m(
    refractivity: ArrayLike,
    scale_height_m: ArrayLike,
    elevation_rad: ArrayLike,
    height_difference_m: ArrayLike,
    *,
    mask_rad: float = MASK_RAD,
) -> FloatArray:
    """Difference of the tropospheric delay between the ground and the aircraft, added to the aircraft's pseudorange.

    Parameters
    ----------
    refractivity : array_like
        Refractivity index N_r of message type 2 [-].
    scale_height_m : array_like
        Tropospheric scale height h_0 [m]; NaN results unless it is above 0.
    elevation_rad : array_like
        Satellite elevation [rad].
    height_difference_m : array_like
        Height of the aircraft above the reference point [m].

    Returns
    -------
    array
        Correction TC, positive above the reference point [m].

    Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3; Caamano et al., eq (11).
    """
    scale_m = np.asarray(scale_height_m, dtype=np.float64)
    scale_m = np.where(scale_m > 0.0, scale_m, np.nan)
    sine = np.sin(np.deg2rad(_elevation_deg(elevation_rad, mask_rad)))
    height_m = np.asarray(height_difference_m, dtype=np.float64)
    return np.asarray(as_written(tropo_m)(np.asarray(refractivity), scale_m, sine, height_m))


def sigma_tropo_m(
    refractivity_uncertainty: ArrayLike,
    scale_height_m: ArrayLike,
    elevation_rad: ArrayLike,
    height_difference_m: ArrayLike,
    *,
    mask_rad: float = MASK_RAD,
) -> FloatArray:
    """Uncertainty of :func:`tropo_correction_m`, from the refractivity's [m]; never negative.

    Source: Caamano et al., eq (11).
    """
    correction_m = tropo_correction_m(
        refractivity_uncertainty, scale_height_m, elevation_rad, height_difference_m, mask_rad=mask_rad
    )
    result: FloatArray = np.abs(correction_m)
    return result


def iono_obliquity(elevation_rad: ArrayLike) -> FloatArray:
    """Vertical-to-slant factor F_pp of a thin shell, 1 at the zenith [-]; NaN below the horizon.

    Source: RTCA DO-253 2.3.12.3; Caamano et al., eq (12).
    """
    elevation = np.asarray(elevation_rad, dtype=np.float64)
    elevation = np.where(elevation >= 0.0, elevation, np.nan)
    return np.asarray(as_written(obliquity)(elevation))


def sigma_iono_m(
    sigma_vig: ArrayLike,
    elevation_rad: ArrayLike,
    distance_m: ArrayLike,
    speed_mps: ArrayLike,
    tau_s: ArrayLike,
    *,
    mask_rad: float = MASK_RAD,
) -> FloatArray:
    """Residual ionospheric uncertainty of a differentially corrected, smoothed range.

    Parameters
    ----------
    sigma_vig : array_like
        Standard deviation of the vertical ionospheric gradient [m/m].
    elevation_rad : array_like
        Satellite elevation [rad].
    distance_m : array_like
        Slant distance from the aircraft to the reference point, x_air [m].
    speed_mps : array_like
        Horizontal speed of the aircraft, v_air [m/s].
    tau_s : array_like
        Smoothing time constant [s]; 100 s for GAST C and for the protection levels of GAST D (uncertain for its
        weights).

    Returns
    -------
    array
        Standard deviation [m]; NaN below the mask, and where an input is missing or negative.

    Source: RTCA DO-253 2.3.12.3; Caamano et al., eq (12).
    """
    factors = [np.asarray(value, dtype=np.float64) for value in (sigma_vig, distance_m, speed_mps, tau_s)]
    gradient, distance, speed, tau = (np.where(value >= 0.0, value, np.nan) for value in factors)
    factor = iono_obliquity(np.deg2rad(_elevation_deg(elevation_rad, mask_rad)))
    return np.asarray(as_written(iono_m)(factor, gradient, distance, speed, tau))
