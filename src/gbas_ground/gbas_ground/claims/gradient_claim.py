"""What a station of service type D can claim of ionosphere gradients: Y_EIG and M_EIG.

A gradient g that nothing finds makes an error of ``g (x + 2 tau v)`` between the station and an aircraft x away that
approaches at v with smoothing over tau. The bound a station broadcasts is ``E_IG = Y_EIG + M_EIG x``, so with the
largest gradient that stays undetected

    Y_EIG = 2 tau v g,   M_EIG = g.

For 300 mm/km, 30 s and 70 m/s that is 1.26 m and 0.3 m/km, and 2.76 m at 5 km.

Gradients below the lower end of ``ionosphere_gradient.gradient_range`` are not looked for. Within the range a
satellite is used when its baselines detect a share of at least ``ionosphere_gradient.min_coverage`` at the epoch.
With a share of 1 none is left, so the largest undetected gradient is the lower end. With less it may be any of the
range, for the blind gradients of a satellite wander over the range with its elevation and with the receivers that see
it: then it is the upper end, which the fields can carry only if the range ends below 700 mm/km. Gradients beyond the
upper end are not reckoned with: the range is the station's threat space.

The largest values of both fields claim nothing.

Source: ICAO Annex 10 (E_IG, 300 mm/km, 5 km, 2.75 m; known); the error, closed form of the smoothing filters (verified,
docs/validation.md). The airborne speed is that of the 2.75 m (known). That the largest values stand for "not provided"
is uncertain, ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_ground.claims.limits import MAX_M_EIG, MAX_Y_EIG_M
from gbas_ground.monitors.double_difference import NO_REFERENCE, DoubleDifferences
from gbas_ground.monitors.ephemeris_residual import REFERENCE_ELEVATION_RAD
from gbas_ground.monitors.gradient_coverage import GradientSite
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams, check_ionosphere_gradient

APPROACH_SPEED_MPS: Final = 70.0
"""Of the aircraft behind the 2.75 m of E_IG. Known."""
_STEP_Y_M: Final = 0.1
_STEP_M: Final = 0.1e-3


@dataclass(frozen=True, kw_only=True)
class GradientClaim:
    """What a site supports.

    Attributes
    ----------
    largest_undetected : float
        Gradient that may stay undetected on a satellite in use [m/m]; infinite without a monitor that excludes.
    y_eig_m, m_eig : float
        The smallest values that may be broadcast, in steps of the fields; infinite where the fields end.
    why : str
        What the claim rests on, or why there is none.
    """

    largest_undetected: float
    y_eig_m: float
    m_eig: float
    why: str


def coverage_by_elevation(
    site: GradientSite, params: IonosphereGradientParams, elevation_rad: FloatArray
) -> FloatArray:
    """Share of the gradients that the monitor detects on satellites at elevations, with every baseline and band.

    Parameters
    ----------
    site : GradientSite
    params : IonosphereGradientParams
    elevation_rad : (N,) array
        Of the satellite; what it is compared with stands at
        :data:`~gbas_ground.monitors.ephemeris_residual.REFERENCE_ELEVATION_RAD`.

    Returns
    -------
    (N,) array
        Along the worst runway, with the multipliers of false alarm and missed detection; 0 without baselines. It is the
        monitor's own coverage of double differences with these sigmas.
    """
    factors = params.noise.factors(len(site.baselines.place_m))
    scale = np.hypot(factors[site.baselines.first], factors[site.baselines.second])[:, np.newaxis, np.newaxis]
    reference = params.noise.sigma_m(np.array([REFERENCE_ELEVATION_RAD]), params.bands)
    sigma = scale * np.hypot(params.noise.sigma_m(elevation_rad, params.bands), reference)
    differences = DoubleDifferences(
        residual_m=np.zeros(sigma.shape),
        sigma_m=sigma,
        nominal_sigma_m=sigma,
        reference=np.full(sigma.shape, NO_REFERENCE),
    )
    return check_ionosphere_gradient(differences, np.ones(elevation_rad.shape, dtype=bool), site, params).coverage


def gradient_claim(
    site: GradientSite,
    params: IonosphereGradientParams,
    *,
    excludes: bool,
    tau_s: float,
    speed_mps: float = APPROACH_SPEED_MPS,
) -> GradientClaim:
    """The smallest Y_EIG and M_EIG a site supports.

    Parameters
    ----------
    site : GradientSite
    params : IonosphereGradientParams
    excludes : bool
        Whether satellites that fail are excluded.
    tau_s : float
        Time constant of the 30 s corrections [s].
    speed_mps : float
        Of the aircraft over ground [m/s].
    """
    low, high = (1e6 * each for each in params.gradient_range)
    if not excludes:
        return _claim(math.inf, "ionosphere_gradient.exclude is false", tau_s, speed_mps)
    reached = coverage_by_elevation(site, params, np.radians(np.arange(5.0, 91.0)))
    if not (reached >= params.min_coverage).any() or not reached.any():
        why = f"the baselines detect at most {100.0 * reached.max():.1f} % of {low:g} to {high:g} mm/km"
        return _claim(math.inf, why, tau_s, speed_mps)
    if params.min_coverage < 1.0:
        least = f"ionosphere_gradient.min_coverage = {params.min_coverage:g}"
        why = f"with {least}, gradients up to {high:g} mm/km may go undetected"
        return _claim(params.gradient_range[1], why, tau_s, speed_mps)
    first = 5 + int(np.argmax(reached >= 1.0))
    why = f"all of {low:g} to {high:g} mm/km is detected, above {first} deg with every baseline"
    return _claim(params.gradient_range[0], why, tau_s, speed_mps)


def _claim(largest: float, why: str, tau_s: float, speed_mps: float) -> GradientClaim:
    y_eig_m = _stepped(2.0 * tau_s * speed_mps * largest, _STEP_Y_M, MAX_Y_EIG_M)
    m_eig = _stepped(largest, _STEP_M, MAX_M_EIG)
    if math.isinf(y_eig_m + m_eig):
        y_eig_m = m_eig = math.inf  # one without the other bounds nothing
    return GradientClaim(largest_undetected=largest, y_eig_m=y_eig_m, m_eig=m_eig, why=why)


def _stepped(value: float, step: float, largest: float) -> float:
    """Rounded up to the steps of its field; infinite where the field ends."""
    if not value <= largest:
        return math.inf
    return math.ceil(value / step - 1e-6) * step


def refuse_smaller(y_eig_m: float, m_eig: float, claim: GradientClaim) -> None:
    """Complain of a bound on gradients that the station's monitor does not support.

    Raises
    ------
    ValueError
        Naming the key, its value and its bound. The largest values of both fields claim nothing.
    """
    for key, value, least, largest, unit in (
        ("gast_d.y_eig_m", y_eig_m, claim.y_eig_m, MAX_Y_EIG_M, "m"),
        ("gast_d.m_eig", m_eig, claim.m_eig, MAX_M_EIG, "m/m"),
    ):
        if value < min(least - 1e-9, largest):
            bound = "nothing" if math.isinf(least) else f"{least:g} {unit}"
            raise ValueError(
                f"{key} = {value:g} is below what the site's gradient monitor supports ({bound}: {claim.why}); "
                "left out, both fields carry their largest values, which claim nothing"
            )
