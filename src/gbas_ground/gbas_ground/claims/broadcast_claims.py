"""What a station's broadcast claims, and what each claim rests on.

The broadcast says of the station: a designator of accuracy (sigma_pr_gnd), of the ionosphere on ordinary days
(sigma_vig), of orbits (P), of ionosphere gradients (Y_EIG, M_EIG, type D) and of the whole (GCID). Each is either
monitored by the station, declared by whoever configured it, or the largest value its field carries: then it claims
nothing. Here these are told apart, for people (:func:`statements`) and for the check that no shipped configuration
claims a designator its monitors do not support (:func:`supported_gcid`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_ground.claims.limits import MAX_DECORRELATION, MAX_M_EIG, MAX_Y_EIG_M
from gbas_ground.claims.orbit_claim import claimed_decorrelation, supported_decorrelation
from gbas_ground.ionosphere.protection import protection_in_words
from gbas_ground.param_checks import TYPE_D_GCID
from gbas_ground.params import GroundParams
from gbas_ground.sections import GCID_UNHEALTHY, MAX_SIGMA_VIG

GCID_TYPE_C: Final = 1
_MIN_B_VALUES: Final = 2  # receivers behind a correction that make B values


@dataclass(frozen=True, kw_only=True)
class OrbitClaim:
    """P that a station broadcasts with all its receivers at work.

    Attributes
    ----------
    at_mask, at_zenith : float
        At the elevation mask, where it is largest, and at the zenith [m/m].
    source : str
        ``"monitor"``, ``"external"`` or ``"none"``.
    """

    at_mask: float
    at_zenith: float
    source: str


def orbit_claim(params: GroundParams) -> OrbitClaim:
    """P at the elevation mask and at the zenith, and what it rests on."""
    elevation_rad = np.array([params.monitors.elevation_mask_rad, np.pi / 2.0])
    external = bool(params.ephemeris.external_monitor)
    supported = np.full(2, np.inf)
    if params.ephemeris_residual.exclude:
        supported = supported_decorrelation(params.orbit_site(), elevation_rad)
    mask, zenith = (float(each) for each in claimed_decorrelation(supported, params.ephemeris.p, external=external))
    monitored = bool(supported[0] <= MAX_DECORRELATION)
    return OrbitClaim(
        at_mask=mask, at_zenith=zenith, source="external" if external else "monitor" if monitored else "none"
    )


def unsupported(params: GroundParams) -> Iterator[str]:
    """What stands against a healthy designator: monitors that a claim of integrity needs and that do not act.

    The list is ours (uncertain): a healthy GCID stands for the station's share of the integrity risk, and a fault that
    no monitor excludes has none.
    """
    if params.receivers.minimum < _MIN_B_VALUES:
        yield "no B values: receivers.minimum is 1"
    for name, acts in (
        ("ccd", params.ccd.exclude),
        ("carrier_acceleration", params.carrier_acceleration.exclude),
        ("ionosphere_gradient", params.ionosphere_gradient.exclude and params.n_receivers > 1),
        ("signal_power", params.signal_power.exclude and params.signal_power.require_cn0),
        ("expected_power", params.expected_power.exclude and params.signal_power.require_cn0),
        ("sigma_monitor", params.sigma_monitor.exclude),
    ):
        if not acts:
            yield f"{name} does not exclude"
    if orbit_claim(params).source == "none":
        yield "orbits are not monitored"


def supported_gcid(params: GroundParams) -> int:
    """The largest claim that a station's monitors support: type D, type C, or unhealthy.

    Parameters
    ----------
    params : GroundParams

    Returns
    -------
    int
        2 with type D and a bound on gradients that the gradient monitor supports; 1 when all monitors of
        :func:`unsupported` act; else 7.
    """
    if next(unsupported(params), None) is not None:
        return GCID_UNHEALTHY
    return TYPE_D_GCID[0] if params.gast_d.enabled and _bounds_gradients(params) else GCID_TYPE_C


def _bounds_gradients(params: GroundParams) -> bool:
    """Whether Y_EIG and M_EIG claim anything; if so the monitor supports it, or the parameters were refused."""
    return params.gast_d.y_eig_m < MAX_Y_EIG_M or params.gast_d.m_eig < MAX_M_EIG


def statements(params: GroundParams) -> tuple[str, ...]:
    """What the protection levels of the station's users rest on, one short statement a claim.

    Parameters
    ----------
    params : GroundParams
        Station as configured; receivers that fail are not in it.
    """
    return (
        _accuracy(params),
        _nominal_ionosphere(params),
        _orbits(params),
        *_gradients(params),
        protection_in_words(params),
        _receivers(params),
        _designator(params),
    )


def _accuracy(params: GroundParams) -> str:
    watched = params.n_receivers >= _MIN_B_VALUES and params.sigma_monitor.exclude
    how = "by the sigma monitor" if watched else "assumed"
    if params.accuracy.sigma_elevation_rad:
        return f"measured sigmas ({how})"
    return f"designator {params.accuracy.designator} ({how})"


def _nominal_ionosphere(params: GroundParams) -> str:
    sigma = params.atmosphere.sigma_vert_iono_gradient
    return f"sigma_vig {1e6 * sigma:g} mm/km ({'largest' if sigma >= MAX_SIGMA_VIG else 'declared'})"


def _orbits(params: GroundParams) -> str:
    claim = orbit_claim(params)
    if claim.source == "external":
        return f"P {claim.at_mask:.3g} ({params.ephemeris.external_monitor})"
    if claim.source == "none":
        return f"P {claim.at_mask:.4g} (not monitored)"
    return f"P {claim.at_zenith:.3g} to {claim.at_mask:.3g} (ephemeris monitor)"


def _gradients(params: GroundParams) -> tuple[str, ...]:
    if not params.gast_d.enabled:
        return ()
    how = "gradient monitor" if _bounds_gradients(params) else "largest"
    return (f"Y_EIG {params.gast_d.y_eig_m:g} m, M_EIG {1e3 * params.gast_d.m_eig:g} m/km ({how})",)


def _receivers(params: GroundParams) -> str:
    count = params.n_receivers
    if count < _MIN_B_VALUES:
        return "1 receiver: no B values"
    single = "" if params.receivers.minimum >= _MIN_B_VALUES else ", no B values where one is left"
    return f"{count} receivers{single}"


def _designator(params: GroundParams) -> str:
    if params.station.gcid == GCID_UNHEALTHY:
        return "gcid 7: no service"
    supported = supported_gcid(params)
    if params.station.gcid > supported or supported == GCID_UNHEALTHY:
        return f"gcid {params.station.gcid} (declared; {'; '.join(unsupported(params)) or 'no bound on gradients'})"
    return f"gcid {params.station.gcid} (by the monitors)"
