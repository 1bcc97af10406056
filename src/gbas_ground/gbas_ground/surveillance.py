"""All monitors of the satellites' signals at one epoch: what they need, in which order, and what their verdict means.

The monitors themselves are in :mod:`gbas_ground.monitors`, each blind to the others. Here they are given the same
channels, and their verdicts become exclusions of satellites: a satellite that fails is excluded from both smoothing
constants and all bands, and one that a required monitor cannot judge yet is not used yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from gbas_core.divergence import DivergenceState
from gbas_core.record import FloatArray
from gbas_core.satellites import missing
from gbas_core.signals import L1, L5
from gbas_ground.causes import ExclusionCause
from gbas_ground.corrections import BoolArray
from gbas_ground.geometry import Expected
from gbas_ground.looks import Look, look
from gbas_ground.monitors.code_carrier_divergence import CcdEpoch, CcdParams, ccd_step, initial_ccd
from gbas_ground.monitors.double_difference import (
    DoubleDifferences,
    Troposphere,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.ionosphere_gradient import (
    GradientResult,
    GradientSite,
    IonosphereGradientParams,
    check_ionosphere_gradient,
    gradient_site,
)
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.params import GroundParams
from gbas_msgs_py.records import BASELINES, MAX_REFERENCE_RECEIVERS


class Seen(NamedTuple):
    """What monitors may look at, at one epoch.

    Attributes
    ----------
    code_m, carrier_m, cn0_dbhz : (R, N_BANDS, N) arrays
        Of all channels that were measured; NaN where not.
    slipped : (R, N_BANDS, N) bool array
        Where a carrier and the one before do not belong together.
    ready : (R, N) bool array
        Channels whose smoothing filter has settled and that nothing excludes.
    due : (N,) bool array
        Satellites that would be broadcast if nothing else were against it.
    may_refer : (N,) bool array
        Satellites others may be compared with.
    expected : Expected
    dt_s : float
        Time since the epoch before; NaN at the first [s].
    """

    code_m: FloatArray
    carrier_m: FloatArray
    cn0_dbhz: FloatArray
    slipped: BoolArray
    ready: BoolArray
    due: BoolArray
    may_refer: BoolArray
    expected: Expected
    dt_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class WatchState:
    """What the monitors remember between epochs."""

    ccd: DivergenceState


class Verdict(NamedTuple):
    """What one monitor decided about satellites, ``(N,)``; `excludes` says whether that counts."""

    cause: ExclusionCause
    result: MonitorResult
    excludes: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Watched:
    """What the monitors found at one epoch.

    Attributes
    ----------
    verdicts : tuple of Verdict
    looks : mapping from a monitor's name to Look
    ready : (N,) bool array
        Satellites that every required monitor could judge.
    passed : (N,) bool array
        Those that none of the monitors that exclude failed.
    details : mapping from a field of :class:`MonitorEpoch` to its value
    """

    verdicts: tuple[Verdict, ...]
    looks: Mapping[str, Look]
    ready: BoolArray
    passed: BoolArray
    details: Mapping[str, Any]


class _Settings(NamedTuple):
    """Parameters and constants of the monitors; made once from the station's parameters."""

    ccd: CcdParams
    gradient: IonosphereGradientParams
    gradient_required: bool
    site: GradientSite
    troposphere: Troposphere


@lru_cache(maxsize=8)
def _settings(params: GroundParams) -> _Settings:
    sections = params.monitors
    gradient = sections.gradient.params(
        tuple(approach.course_rad for approach in params.approaches),
        sections.carrier_noise.params(),
    )
    return _Settings(
        ccd=sections.ccd.params(params.max_gap_s),
        gradient=gradient,
        gradient_required=sections.gradient.required or params.gast_d,
        site=gradient_site(params.receiver_positions_m(), params.reference_point_m(), gradient),
        troposphere=Troposphere(refractivity=params.refractivity, scale_height_m=params.scale_height_m),
    )


def initial_watch(params: GroundParams) -> WatchState:
    """Monitors that have seen nothing."""
    return WatchState(ccd=initial_ccd(_settings(params).ccd, params.n_receivers))


def watch(state: WatchState, seen: Seen, params: GroundParams) -> tuple[WatchState, Watched]:
    """Run every monitor over one epoch."""
    settings, sections = _settings(params), params.monitors
    ccd_state, ccd = ccd_step(
        state.ccd, seen.code_m, seen.carrier_m, seen.slipped, seen.ready, seen.dt_s, settings.ccd
    )
    differences, gradient = _gradient(seen, settings)
    divergence = _of_band(ccd.satellites, L1)
    verdicts = (
        Verdict(ExclusionCause.CODE_CARRIER_DIVERGENCE, _on(divergence, seen.due), sections.ccd.exclude),
        Verdict(ExclusionCause.IONOSPHERE_GRADIENT, _on(gradient.verdict, seen.due), sections.gradient.exclude),
    )
    looks = {
        "ccd": look(divergence, seen.due),
        "gradient": look(gradient.verdict, seen.due & (len(settings.site.baselines) > 0)),
    }
    ready = ~sections.ccd.exclude | (ccd.receivers[L1] > 0)
    if settings.gradient_required:
        ready = ready & gradient.monitored
    failed = [each.result.failed for each in verdicts if each.excludes]
    watched = Watched(
        verdicts=verdicts,
        looks=looks,
        ready=np.broadcast_to(ready, seen.due.shape),
        passed=~np.logical_or.reduce(failed) if failed else np.ones_like(seen.due),
        details=_details(ccd, differences, gradient, settings),
    )
    return WatchState(ccd=ccd_state), watched


def _on(result: MonitorResult, satellites: BoolArray) -> MonitorResult:
    """Failures of these satellites alone."""
    return replace(result, failed=result.failed & satellites)


def _of_band(result: MonitorResult, band: int) -> MonitorResult:
    return MonitorResult(
        statistic=result.statistic[band],
        threshold=np.broadcast_to(result.threshold, result.statistic.shape)[band],
        failed=result.failed[band],
    )


def _gradient(seen: Seen, settings: _Settings) -> tuple[DoubleDifferences, GradientResult]:
    site, params = settings.site, settings.gradient
    residual_m = carrier_residual_m(
        np.where(seen.ready[:, np.newaxis], seen.carrier_m, np.nan),
        seen.expected.range_m,
        seen.expected.clock_s,
        seen.expected.elevation_rad,
        site.baselines.height_m,
        settings.troposphere,
        params.bands,
    )
    references = reference_satellites(seen.may_refer, seen.expected.elevation_rad, params.references)
    differences = double_differences(
        residual_m, site.baselines, references, seen.expected.elevation_rad, params.noise, params.bands
    )
    return differences, check_ionosphere_gradient(differences, seen.due, site, params)


def _details(
    ccd: CcdEpoch, differences: DoubleDifferences, gradient: GradientResult, settings: _Settings
) -> dict[str, Any]:
    by_receiver = missing(MAX_REFERENCE_RECEIVERS)
    by_receiver[: len(ccd.receiver_mps)] = ccd.receiver_mps[:, L1]
    details: dict[str, Any] = {
        "ccd_receiver_mps": by_receiver,
        "gradient": gradient.gradient,
        "gradient_coverage": gradient.coverage,
    }
    baselines, bands = settings.site.baselines, settings.gradient.bands
    places = [BASELINES.index((i + 1, j + 1)) for i, j in zip(baselines.first, baselines.second, strict=True)]
    for name, band in (("double_difference_m", L1), ("double_difference_l5_m", L5)):
        values = missing(len(BASELINES))
        if band in bands:
            values[places] = differences.residual_m[:, bands.index(band)]
        details[name] = values
    return details
