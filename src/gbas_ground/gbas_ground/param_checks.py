"""What a station's parameters have to be together: supported claims, messages that fit, budgets that are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from gbas_core.parameters import ParameterError
from gbas_ground.claims.gradient_claim import refuse_smaller as refuse_smaller_gradient
from gbas_ground.claims.limits import MAX_M_EIG, MAX_Y_EIG_M
from gbas_ground.claims.orbit_claim import refuse_smaller as refuse_smaller_decorrelation
from gbas_ground.corrections.second_band import second_band_of
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION
from gbas_ground.sections import GCID_UNHEALTHY
from gbas_vdb.errors import VdbError
from gbas_vdb.transmission.schedule import further_sources_that_fit, sources_that_fit

if TYPE_CHECKING:
    from gbas_ground.params import GroundParams

TYPE_D_GCID: Final = (2, 3, 4)
"""Designators of stations that serve type D as well. Known for 2; what 3 and 4 add is not in a public text."""
MAX_SCREENED_M: Final = 60_000.0
"""Largest distance of use that can be protected against ionospheric fronts [m]. Ours."""
MIN_SERVICE_SATELLITES: Final = 4
"""Fewer corrections than this give nobody a position: the station then says that it is not healthy."""
MAX_DISTANCE_FROM_REFERENCE_M: Final = 10_000.0
"""A reference receiver further from the reference point than this is a mistake in the configuration. Ours."""
FALSE_EXCLUSION_OF_ALL: Final = 2e-7
"""Budget of false exclusions of one source in 15 s by all monitors together. Known: a twentieth of it for each, which
the published threshold of the single-band divergence monitor does not keep; it has nine of the twentieths."""
_BUDGET_PARAMETERS: Final = "ccd.threshold_mps over ccd.sigma_mps, and p_false_alarm of the others,"


def check_station(params: GroundParams) -> None:
    """Refuse parameters that do not go together.

    Raises
    ------
    ParameterError
        Naming the parameters, their values and what they break.
    """
    _check_receivers(params)
    _check_sigma_table(params)
    second_band_of(params)
    _check_false_exclusions(params)
    _check_messages(params)
    _check_orbit_claim(params)
    _check_gradient_claim(params)
    _check_ionosphere(params)


def false_exclusions(params: GroundParams) -> dict[str, float]:
    """Probability that each monitor that excludes does so to a sound source in 15 s, by its name [-]."""
    shares = {
        "ccd": (params.ccd.exclude, params.ccd.p_false_exclusion()),
        "ccd_f": (True, params.ccd_f.p_false_exclusion(params.ccd.tau_s)),
        "ionosphere_gradient": (params.ionosphere_gradient.exclude, params.ionosphere_gradient.p_false_alarm),
        "carrier_acceleration": (params.carrier_acceleration.exclude, params.carrier_acceleration.p_false_alarm),
        "ephemeris_residual": (params.ephemeris_residual.exclude, params.ephemeris_residual.p_false_alarm),
        "signal_power": (params.signal_power.exclude, FALSE_EXCLUSION),
        "sigma_monitor": (params.sigma_monitor.exclude, params.sigma_monitor.p_false_alarm),
    }
    return {name: share if excludes else 0.0 for name, (excludes, share) in shares.items()}


def _check_receivers(params: GroundParams) -> None:
    reference_m = params.reference_point_m()
    for number, place in enumerate(params.receivers.ecef_m, start=1):
        distance = float(np.linalg.norm(np.array(place, dtype=np.float64) - reference_m))
        if not distance <= MAX_DISTANCE_FROM_REFERENCE_M:
            raise ParameterError(
                f"receivers.rr{number}_ecef_m lies {distance:.0f} m from the reference point, more than "
                f"{MAX_DISTANCE_FROM_REFERENCE_M:.0f} m"
            )
    factors = params.carrier_noise.receiver_factor
    if len(factors) not in (1, params.n_receivers):
        raise ParameterError(
            f"carrier_noise.receiver_factor = {factors} is neither one number nor one for each of the "
            f"{params.n_receivers} receivers"
        )


def _check_sigma_table(params: GroundParams) -> None:
    nodes = params.accuracy.sigma_elevation_rad
    if nodes and nodes[0] > params.monitors.elevation_mask_rad:
        raise ParameterError("accuracy.sigma_elevation_deg starts above monitors.elevation_mask_deg")


def _check_false_exclusions(params: GroundParams) -> None:
    shares = false_exclusions(params)
    if sum(shares.values()) > FALSE_EXCLUSION_OF_ALL:
        given = ", ".join(f"{name} {share:.2g}" for name, share in shares.items())
        raise ParameterError(
            f"false exclusions of one source in 15 s ({given}) are together more than the budget of "
            f"{FALSE_EXCLUSION_OF_ALL:g}: {_BUDGET_PARAMETERS} decide"
        )


def _check_messages(params: GroundParams) -> None:
    """Station data and approaches must fit the messages, and the messages the slots."""
    try:
        room = sources_that_fit(params.station_message(), params.approach_messages(), params.schedule())
    except (VdbError, ValueError) as error:
        raise ParameterError(f"cannot be broadcast: {error}") from None
    if room < MIN_SERVICE_SATELLITES:
        raise ParameterError(f"vdb.slots = {params.vdb.slots!r} leaves room for {room} satellites; 4 are needed")
    kinds = params.private_kinds()
    if not kinds:
        return
    given = params.station_message(), params.approach_messages(), params.schedule()
    room = further_sources_that_fit(MIN_SERVICE_SATELLITES, kinds, *given)
    if room < MIN_SERVICE_SATELLITES:
        raise ParameterError(
            f"vdb.slots = {params.vdb.slots!r} leaves room for {max(room, 0)} satellites of second_band.products = "
            f"{', '.join(params.second_band.products)} beside 4 on L1; 4 are needed"
        )


def _check_orbit_claim(params: GroundParams) -> None:
    """What the station does not monitor itself it must not claim, unless it says who does."""
    claims = params.ephemeris
    given = {"ephemeris.p": claims.p} | ({"ephemeris.p_d": claims.p_d} if params.gast_d.enabled else {})
    for key, value in given.items():
        if claims.external_monitor:
            if value == 0.0:
                raise ParameterError(
                    f"{key} is missing: what ephemeris.external_monitor = {claims.external_monitor!r} supports",
                    missing=True,
                )
        elif value > 0.0:
            excludes = params.ephemeris_residual.exclude
            try:
                refuse_smaller_decorrelation(
                    key, value, params.orbit_site(), params.monitors.elevation_mask_rad, excludes=excludes
                )
            except ValueError as error:
                raise ParameterError(str(error)) from None


def _check_gradient_claim(params: GroundParams) -> None:
    """A bound on gradients has to follow from what the gradient monitor detects."""
    gast_d = params.gast_d
    if params.station.gcid in TYPE_D_GCID and not gast_d.enabled:
        raise ParameterError(f"station.gcid = {params.station.gcid} claims service type D, and gast_d.enabled is false")
    if gast_d.enabled and not gast_d.required and params.station.gcid != GCID_UNHEALTHY:
        raise ParameterError(f"gast_d.required = false with station.gcid = {params.station.gcid}, expected 7")
    if not gast_d.enabled or (gast_d.y_eig_m >= MAX_Y_EIG_M and gast_d.m_eig >= MAX_M_EIG):
        return
    try:
        refuse_smaller_gradient(gast_d.y_eig_m, gast_d.m_eig, params.gradient_claim())
    except ValueError as error:
        raise ParameterError(str(error)) from None


def _check_ionosphere(params: GroundParams) -> None:
    """Only what is screened may be claimed: approaches, out to a largest distance of use."""
    if not params.ionosphere.protects:
        return
    model = f"ionosphere.threat_model = {params.ionosphere.threat_model!r}"
    distance_m = params.station.max_use_distance_m
    if not params.approaches:
        raise ParameterError(f"{model} needs at least one approach to be protected")
    if not 0.0 < distance_m <= MAX_SCREENED_M:
        raise ParameterError(
            f"{model} needs station.max_use_distance_m above 0 (not unlimited) and at most {MAX_SCREENED_M:g} m, "
            f"not {distance_m:g}"
        )
    if params.smoothing.tau_s[0] <= 0.0:
        raise ParameterError(f"{model} needs smoothing.tau_s above 0 s")
