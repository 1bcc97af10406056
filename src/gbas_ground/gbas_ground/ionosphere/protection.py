"""The station's protection against ionospheric fronts: what it inflates at an epoch, and what it remembers.

The screening is made anew each minute of data time, and at once when the satellites that are sent, or the receivers
behind them, change. sigma_vig is raised first, then sigma_pr_gnd of each satellite in proportion to what a front does
to its range. Station data are sent every ten seconds only: sigma_vig changes with the minute, and a rise counts from
the next minute on, when every aircraft has it; sigma_pr_gnd, sent with each correction, makes up for it meanwhile.
When no inflation is enough, nothing is sent as usable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.models.error_models import AirborneAccuracy, sigma_air, sigma_iono_m, sigma_tropo_m
from gbas_core.models.missed_detection import K_FFMD_SINGLE, k_ffmd
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SYSTEM_MASKS
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.ionosphere.cases import Cases
from gbas_ground.ionosphere.geometry_screening import judge, least_safe, sent_sigma_m, subsets_of
from gbas_ground.ionosphere.places import Places
from gbas_ground.ionosphere.range_error import TracedPoint, worst_range_error_m
from gbas_ground.ionosphere.threat import FrontThreat
from gbas_ground.param_checks import MIN_SERVICE_SATELLITES
from gbas_ground.params import GroundParams
from gbas_ground.sections import MAX_SIGMA_VIG

_VIG_STEP: Final = 1.0e-7  # resolution of the type 2 message
_VIG_STEPS: Final = round(MAX_SIGMA_VIG / _VIG_STEP)
_FACTOR_STEP: Final = 0.005  # of the range error at the decision height; some 3 cm
_FACTOR_STEPS: Final = 200
_DESIGNATORS: Final[tuple[AirborneAccuracy, ...]] = ("A", "B")


class Sky(NamedTuple):
    """The corrected satellites: elevation, azimuth [rad], ground sigma [m] and receivers behind them, ``(N,)``."""

    elevation_rad: FloatArray
    azimuth_rad: FloatArray
    sigma_m: FloatArray
    receivers: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Protection:
    """What is inflated at an epoch.

    Attributes
    ----------
    sigma_vig : float
        As broadcast [m/m].
    factor : float
        Of the inflation of sigma_pr_gnd [-].
    shape_m : (N,) array
        Times `factor`, what is added to sigma_pr_gnd in quadrature; NaN for satellites that are not protected.
    available : bool
        False when no inflation is enough: then nothing may be used.
    """

    sigma_vig: float
    factor: float = 0.0
    shape_m: FloatArray
    available: bool = True

    def inflated_m(self, sigma_m: FloatArray) -> FloatArray:
        """Broadcast sigmas, ``(N,)`` [m]; none for what is not protected."""
        if self.factor == 0.0:
            return np.where(np.isnan(self.shape_m), np.nan, sigma_m)
        return sent_sigma_m(sigma_m, self.shape_m, self.factor)


@dataclass(frozen=True, kw_only=True, eq=False)
class IonosphereState:
    """What is remembered between epochs.

    Attributes
    ----------
    satellites : (N,) array
        Receivers behind each satellite screened; 0 where it was not.
    renewed_key : int
        Epoch of the last renewal, or at which the service was interrupted [ms].
    credited_vig : float
        sigma_vig that every aircraft has at least [m/m].
    protection : Protection or None
        None before the first screening.
    """

    satellites: FloatArray
    renewed_key: int = 0
    credited_vig: float = math.nan
    protection: Protection | None = None


def initial_ionosphere() -> IonosphereState:
    """Nothing is screened."""
    return IonosphereState(satellites=np.zeros(N_SATS))


def protect(
    state: IonosphereState, key: int, sent: BoolArray, sky: Sky, params: GroundParams, places: Places | None
) -> tuple[IonosphereState, Protection]:
    """Protection of one epoch.

    Parameters
    ----------
    state : IonosphereState
    key : int
        The epoch [ms since the start of GPS time].
    sent : (N,) bool array
        Satellites that would be broadcast.
    sky : Sky
    params : GroundParams
    places : Places or None
        Where aircraft may be that are protected; None: nothing is to be protected.
    """
    if places is None:
        return state, Protection(sigma_vig=params.atmosphere.sigma_vert_iono_gradient, shape_m=np.zeros(N_SATS))
    if np.count_nonzero(sent) < MIN_SERVICE_SATELLITES:  # nobody has a position; the most cautious values
        return _interrupted(state, key), Protection(sigma_vig=MAX_SIGMA_VIG, shape_m=np.zeros(N_SATS))
    before = state.protection
    elapsed = key - state.renewed_key >= round(1000.0 * params.ionosphere.renewal_s)
    renew = before is None or elapsed
    satellites = np.where(sent, sky.receivers, 0.0)
    if before is not None and not renew and bool((satellites == state.satellites).all()):
        return state, before
    screening = _Screening.of(sent, sky, params, places)
    if before is None:
        sigma_vig = credited = screening.least_vig(MAX_SIGMA_VIG)
        if not elapsed:  # after a short interruption an aircraft may have what was sent before it
            credited = float(np.fmin(credited, state.credited_vig))
    elif renew:
        sigma_vig = screening.least_vig(before.sigma_vig)
        credited = min(sigma_vig, before.sigma_vig)
    else:
        sigma_vig, credited = before.sigma_vig, state.credited_vig
    factor = screening.least_factor(credited, 0.0 if before is None else before.factor)
    protection = Protection(
        sigma_vig=sigma_vig,
        factor=0.0 if factor is None else factor,
        shape_m=screening.on_axis(),
        available=factor is not None,
    )
    new = IonosphereState(
        satellites=satellites,
        renewed_key=key if renew else state.renewed_key,
        credited_vig=credited,
        protection=protection,
    )
    return new, protection


def _interrupted(state: IonosphereState, key: int) -> IonosphereState:
    """Without a service everything is forgotten but the sigma_vig that aircraft may still have, and when it ended."""
    if state.protection is None:
        return state
    credited = float(np.fmin(state.credited_vig, state.protection.sigma_vig))
    return replace(initial_ionosphere(), renewed_key=key, credited_vig=credited)


def changes(before: Protection | None, now: Protection) -> Iterator[tuple[str, float, float]]:
    """What an event says of a new protection: cause, value and its bound, for each that changed."""
    if before is None or before.available != now.available:
        cause = "ionosphere_protected" if now.available else "ionosphere_unprotected"
        yield cause, now.sigma_vig, MAX_SIGMA_VIG
    if before is None or before.sigma_vig != now.sigma_vig:
        yield "ionosphere_sigma_vig", now.sigma_vig, MAX_SIGMA_VIG
    if now.available and (before is None or before.factor != now.factor):
        yield "ionosphere_sigma_pr_gnd", now.factor, _FACTOR_STEPS * _FACTOR_STEP


@dataclass(frozen=True, kw_only=True, eq=False)
class _Screening:
    """One sky, ready to try inflations on."""

    satellites: NDArray[np.int64]
    cases: Cases
    groups: BoolArray
    subsets: BoolArray

    @classmethod
    def of(cls, sent: BoolArray, sky: Sky, params: GroundParams, places: Places) -> _Screening:
        satellites = np.flatnonzero(sent)
        section = params.ionosphere
        letters = [each for each in params.station.systems if (SYSTEM_MASKS[each] & sent).any()]
        groups = np.array([SYSTEM_MASKS[each][satellites] for each in letters])
        subsets = subsets_of(groups, _combinations(letters, section.aircraft_systems), section.max_missing)
        cases = cases_of(satellites, sky, params, places)
        return cls(satellites=satellites, cases=cases, groups=groups, subsets=subsets)

    def safe(self, sigma_vig: float, factor: float) -> bool:
        sigma_m = sent_sigma_m(self.cases.base_m, self.cases.shape_m, factor)
        if (sigma_m > MAX_SIGMA_M).any():
            return False
        return judge(self.cases, self.groups, self.subsets, sigma_vig, factor, first_only=True).not_safe == 0

    def least_vig(self, start: float) -> float:
        """Least sigma_vig that is safe without other inflation; the largest when none is."""
        nominal = math.ceil(self.cases.nominal_vig / _VIG_STEP - 1e-6)
        step = least_safe(
            lambda step: self.safe((nominal + step) * _VIG_STEP, 0.0),
            _VIG_STEPS - nominal,
            round(start / _VIG_STEP) - nominal,
        )
        return MAX_SIGMA_VIG if step is None else (nominal + step) * _VIG_STEP

    def least_factor(self, sigma_vig: float, start: float) -> float | None:
        """Least inflation of sigma_pr_gnd that is safe; None when none is."""
        step = least_safe(
            lambda step: self.safe(sigma_vig, step * _FACTOR_STEP), _FACTOR_STEPS, round(start / _FACTOR_STEP)
        )
        return None if step is None else step * _FACTOR_STEP

    def on_axis(self) -> FloatArray:
        """The shape on the satellite axis."""
        shape = np.full(N_SATS, np.nan)
        shape[self.satellites] = self.cases.shape_m
        return shape


def _combinations(letters: list[str], allowed: tuple[str, ...]) -> list[tuple[int, ...]]:
    """Constellations an aircraft may use together, as places in `letters`; those without satellites fall away."""
    wanted = allowed or ("G", "E", "GE")
    return sorted({found for each in wanted if (found := tuple(i for i, x in enumerate(letters) if x in each))})


def range_errors_m(
    places: Places, elevation_rad: FloatArray, azimuth_rad: FloatArray, threat: FrontThreat, tau_s: float
) -> FloatArray:
    """Largest range errors at all places, ``(C, n)`` [m].

    Distance is that of the aircraft, or that of where its path to the satellite meets the station's plane: descending,
    an aircraft crosses the ionosphere faster towards a low satellite ahead than it flies. The worse of both counts.
    """
    towards = np.stack([np.sin(azimuth_rad), np.cos(azimuth_rad)], axis=-1) / np.tan(elevation_rad)[:, np.newaxis]
    traced = np.stack([np.zeros_like(towards), towards])[:, np.newaxis]  # (2, 1, n, 2)
    offset, height = places.offset_m[:, np.newaxis, :2], places.offset_m[:, np.newaxis, 2:]
    forward = (places.speed_mps[:, np.newaxis] * places.los_axes[:, 0, :2])[:, np.newaxis]
    descent = (places.speed_mps * places.tan_gpa)[:, np.newaxis, np.newaxis]
    errors = worst_range_error_m(
        threat.largest_gradient(elevation_rad),
        TracedPoint(offset - height * traced, forward + descent * traced),
        tau_s,
        threat,
        places.credit,
        radius_m=places.radius_m,
    )
    return np.asarray(errors.max(axis=0))


def cases_of(satellites: NDArray[np.int64], sky: Sky, params: GroundParams, places: Places) -> Cases:
    """Everything of a sky that does not change with the inflation.

    Parameters
    ----------
    satellites : (n,) array
        Their places on the satellite axis.
    sky : Sky
    params : GroundParams
    places : Places
        Where aircraft may be.
    """
    elevation, azimuth, base, receivers = (each[satellites] for each in sky)
    section, mask = params.ionosphere, params.monitors.elevation_mask_rad
    up = np.stack([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
    air = np.stack([sigma_air(aad, elevation, mask_rad=mask) for aad in _DESIGNATORS])
    tropo = sigma_tropo_m(
        params.atmosphere.refractivity_uncertainty,
        params.atmosphere.scale_height_m,
        elevation,
        places.height_m[:, np.newaxis],
        mask_rad=mask,
    )
    speed, slant = places.speed_mps[:, np.newaxis], places.slant_m[:, np.newaxis]
    error = range_errors_m(places, elevation, azimuth, section.threat(), params.smoothing.tau_s[0])
    return Cases(
        los=places.los_axes @ up,
        tan_gpa=places.tan_gpa,
        base_m=base,
        air2_m2=air[places.designator_b.astype(np.int64)] ** 2 + tropo**2,
        iono_m=sigma_iono_m(1.0, elevation, slant, speed, params.smoothing.tau_s[0], mask_rad=mask),
        error_m=error,
        shape_m=error[places.decision].max(axis=0),
        limit_m=places.limit_m,
        tolerable_m=places.tolerable_m,
        k_ffmd=_least_k_ffmd(receivers),
        k_noise=section.k_noise,
        nominal_vig=params.atmosphere.sigma_vert_iono_gradient,
        affected=section.affected,
    )


def _least_k_ffmd(receivers: FloatArray) -> float:
    """The smallest multiplier an aircraft may use, which goes by the most receivers behind any satellite it has."""
    return min(K_FFMD_SINGLE if count < 2 else k_ffmd(count) for count in map(int, np.unique(receivers)))


def protection_in_words(params: GroundParams) -> str:
    """What the station's protection against ionospheric fronts is, in one sentence."""
    section = params.ionosphere
    if not section.protects:
        return "no threat model of ionospheric fronts: protection levels do not bound errors in a front"
    threat = section.threat()
    steepest = 1e6 * max(threat.gradient)
    satellites = "one satellite" if section.affected == 1 else "two satellites"
    bound = (
        "no error beyond the protection levels"
        if section.tolerable_vertical_m == 0.0
        else f"errors up to {section.tolerable_vertical_m:g} m beyond the protection level at the decision height"
    )
    return (
        f"ionospheric fronts of the {threat.name} model (up to {steepest:g} mm/km on {satellites} at once): {bound} "
        f"within {params.station.max_use_distance_m / 1000.0:g} km on the approaches"
    )
