"""Absolute slant ionosphere gradient monitor: double-difference carriers over the station's baselines.

The statistic of a baseline is the double difference to the nearest wavelength
(:mod:`~gbas_ground.monitors.double_difference`). A gradient shows as its delay over the baseline, less whole
wavelengths: the monitor needs no history and no ambiguity, and it is blind to gradients that make nearly whole
wavelengths (:mod:`gbas_ground.monitors.gradient_detectability`). Every baseline has blind gradients of its own;
together they leave few.

What it does not see: a gradient that all satellites share, which is part of the receivers' clocks here and in the air;
a gradient across all baselines; and, at low elevations, whatever a threshold of half a wavelength would have to pass.
Such satellites are reported as not monitored.

What each satellite is tested on, and how much that covers: :mod:`~gbas_ground.monitors.gradient_coverage`.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach;
Khanafseh, Yang, Pervan, ION GNSS 2010.

Notes
-----
Sign. The delay of the second receiver of a baseline less that of the first is minus the double difference, because the
ionosphere advances a carrier; the paper's eq (2) leaves that open. Gradients here are positive where the slant delay on
L1 grows in the direction of the runway's bearing.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import N_SATS, missing
from gbas_core.signals import BAND_INDEX, L1, L5, WAVELENGTH_M, Band
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import DoubleDifferences, Pairing
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION
from gbas_ground.monitors.gradient_coverage import GradientSite, best_tests
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE, P_MISSED_DETECTION, Fuse, check_gradient_range
from gbas_ground.monitors.gradient_estimates import gradient_set
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, no_memory, verdicts
from gbas_ground.monitors.kernels import gradient as kernels
from gbas_ground.monitors.monitor_table import signal_of, summarise
from gbas_ground.monitors.result import MonitorResult, upper_limit
from gbas_msgs_py.monitors import IONOSPHERE_GRADIENT
from gbas_msgs_py.records import BASELINES


@parameters
class IonosphereGradientParams:
    """Absolute slant ionosphere gradient.

    A satellite without one of the bands is monitored with the others; bands are always fused by "any". What a satellite
    that is not monitored may be used for is the station's business. A coverage of 0 claims nothing: a station that
    claims a bound on the gradient must set it.
    """

    exclude: Annotated[bool, Parameter("satellites that fail are excluded")] = True
    required: Annotated[
        bool, Parameter("satellites it cannot judge are not used; always so with gast_d.enabled")
    ] = False  # fmt: skip
    carriers: Annotated[tuple[Band, ...], Parameter("carriers used")] = ("L1", "L5")
    pairing: Annotated[Pairing, Parameter("baselines: all, or from rr1 only")] = "all"
    fuse: Annotated[Fuse, Parameter("baselines that have to fail")] = "any"
    references: Annotated[int, Parameter("reference satellites of a constellation", "-", 1, 12)] = 5
    p_false_alarm: Annotated[
        float, Parameter("of one source in 15 s, over all its baselines and bands", "-", 1e-12, 0.5)
    ] = FALSE_EXCLUSION
    p_missed_detection: Annotated[
        float, Parameter("of a gradient counted as detectable (uncertain)", "-", 1e-12, 0.5)
    ] = P_MISSED_DETECTION
    gradient_range: Annotated[
        tuple[float, float], Parameter("gradients to be detected, which coverage is counted over", "m/m", 0.0, 0.1)
    ] = GRADIENT_RANGE
    min_coverage: Annotated[
        float, Parameter("share of them a satellite has to be monitored for; always more than nothing", "-", 0.0, 1.0)
    ] = 0.0
    runway_bearing_rad: Annotated[
        tuple[float, ...], Parameter("true bearings; empty: the courses of the approaches", "deg", -360.0, 360.0)
    ] = ()
    noise: Annotated[CarrierNoise, Derived("of the receivers' carriers")] = CarrierNoise()

    def __post_init__(self) -> None:
        if not self.carriers or len(set(self.carriers)) != len(self.carriers):
            raise ParameterError(f"carriers = {self.carriers} is not one or more, each once")
        check_gradient_range(self.gradient_range)

    @cached_property
    def bands(self) -> tuple[int, ...]:
        """Carriers used, as places on the axis of the bands."""
        return tuple(BAND_INDEX[carrier] for carrier in self.carriers)

    @cached_property
    def half_wavelength_m(self) -> FloatArray:
        """A threshold beyond this can never be exceeded, ``(F,)`` [m]."""
        return np.asarray(0.5 * WAVELENGTH_M.take(self.bands))


class GradientResult(NamedTuple):
    """What the monitor found.

    Attributes
    ----------
    verdict : MonitorResult
        ``(N,)``: statistic and threshold of the baseline and band that decided [m].
    monitored : (N,) bool array
        Satellites with a statistic that can detect something, and enough of `params.gradient_range`.
    coverage : (N,) array
        Share of the range that the tests that were run detect now, along the worst runway.
    chosen : (N,) int array
        What each satellite is tested on: its place in `site.tests`.
    gradient : (N,) array
        Of satellites that exceeded a threshold: the smallest gradient along the first runway that explains all their
        double differences [m/m]; NaN if none does. The others that do:
        :func:`~gbas_ground.monitors.gradient_estimates.gradient_set`.
    """

    verdict: MonitorResult
    monitored: BoolArray
    coverage: FloatArray
    chosen: IntArray
    gradient: FloatArray


def check_ionosphere_gradient(
    differences: DoubleDifferences, due: BoolArray, site: GradientSite, params: IonosphereGradientParams
) -> GradientResult:
    """Test one epoch.

    Parameters
    ----------
    differences : DoubleDifferences
        Of `site.baselines` and `params.bands`.
    due : (N,) bool array
        Satellites that must be monitored.
    site : GradientSite
    params : IonosphereGradientParams

    Returns
    -------
    GradientResult
        Satellites are what fails: a double difference does not tell a gradient from a fault of one channel.
    """
    chosen, coverage = best_tests(differences.residual_m, differences.nominal_sigma_m, site, params)
    found, exceeded = np.empty((2, len(due))), np.empty(len(due), dtype=bool)
    kernels.test(
        differences.residual_m,
        differences.sigma_m,
        chosen,
        site.masks,
        site.multipliers,
        params.half_wavelength_m,
        params.fuse == "all",
        due,
        found,
        exceeded,
    )
    looked = np.isfinite(found[0])
    result = GradientResult(
        verdict=MonitorResult(statistic=found[0], threshold=found[1], failed=exceeded),
        monitored=looked & (coverage > 0.0) & (coverage >= params.min_coverage),
        coverage=coverage,
        chosen=chosen,
        gradient=missing(),
    )
    if exceeded.any():
        _explain(result, differences, site, params)
    return result


def by_baseline(
    result: GradientResult, differences: DoubleDifferences, site: GradientSite, params: IonosphereGradientParams
) -> MonitorResult:
    """Each baseline and band for itself, ``(B, F, N)``; what failed has no part of `params.fuse`."""
    threshold = site.multipliers[result.chosen] * differences.sigma_m
    possible = threshold < params.half_wavelength_m[:, np.newaxis]
    looked = np.isfinite(differences.residual_m) & site.masks[result.chosen].T & possible
    return upper_limit(np.where(looked, np.abs(differences.residual_m), np.nan), threshold, looked)


def _explain(
    result: GradientResult, differences: DoubleDifferences, site: GradientSite, params: IonosphereGradientParams
) -> None:
    """Fill in the first of :func:`gradient_set` for the satellites that exceeded a threshold."""
    looked = np.isfinite(by_baseline(result, differences, site, params).statistic)
    for satellite in np.flatnonzero(result.verdict.failed):
        own = np.where(looked[..., satellite], differences.residual_m[..., satellite], np.nan)
        explained = gradient_set(own, differences.sigma_m[..., satellite], site.length_m[0], params.bands)
        if explained.size:
            result.gradient[satellite] = explained[0]


# --- in the station


def _step(state: None, epoch: MonitoredEpoch) -> tuple[None, MonitorOutput]:
    inputs, station = epoch.inputs, epoch.inputs.station
    site, params, differences = station.gradient_site, station.ionosphere_gradient, epoch.fitting.differences
    found = check_ionosphere_gradient(differences, inputs.due, site, params)
    due = inputs.due & (len(site.baselines) > 0)
    test = IONOSPHERE_GRADIENT.test("gradient")
    return state, MonitorOutput(
        summaries={IONOSPHERE_GRADIENT.key(test.name): summarise(found.verdict, due, signal_of(params.bands))},
        details=_details(found, differences, site, params.bands),
        satellites=verdicts(params.exclude, test.cause, found.verdict, due, power=1),
        ready=found.monitored if station.gradient_required else None,
    )


def _details(
    found: GradientResult, differences: DoubleDifferences, site: GradientSite, bands: tuple[int, ...]
) -> dict[str, Any]:
    details: dict[str, Any] = {"gradient": found.gradient, "gradient_coverage": found.coverage}
    for name, band in (("double_difference_m", L1), ("double_difference_l5_m", L5)):
        if band in bands:
            details[name] = np.empty((len(BASELINES), N_SATS))
            kernels.spread(differences.residual_m, bands.index(band), site.rows, details[name])
    return details


MONITOR: Final = SignalMonitor(
    entry=IONOSPHERE_GRADIENT, parameters=IonosphereGradientParams, initial=no_memory, step=_step
)
