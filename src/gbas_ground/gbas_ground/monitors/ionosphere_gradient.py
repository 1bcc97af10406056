"""Absolute slant ionosphere gradient monitor: double-difference carriers over the station's baselines.

The statistic of a baseline is the double difference to the nearest wavelength
(:mod:`~gbas_ground.monitors.double_difference`). A gradient shows as its delay over the baseline, less whole
wavelengths: the monitor needs no history and no ambiguity, and it is blind to gradients that make nearly whole
wavelengths (:mod:`gbas_ground.monitors.gradient_detectability`). Every baseline has blind gradients of its own;
together they leave few.

What it does not see: a gradient that all satellites share, which is part of the receivers' clocks here and in the air;
a gradient across all baselines; and, at low elevations, whatever a threshold of half a wavelength would have to pass.
Such satellites are reported as not monitored.

Every test takes a share of the budget of false alarms, so that a second band raises the thresholds of the first, and
may cost more gradients than it adds. A satellite is therefore tested on the bands, one alone or all together, that
detect most, each with the thresholds of its own number of tests: more bands never lower the coverage. The choice rests
on elevations and on which channels there are, not on what was measured, so the budget holds.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach;
Khanafseh, Yang, Pervan, ION GNSS 2010.

Notes
-----
Sign. The delay of the second receiver of a baseline less that of the first is minus the double difference, because the
ionosphere advances a carrier; the paper's eq (2) leaves that open. Gradients here are positive where the slant delay on
L1 grows in the direction of the runway's bearing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Final

import numpy as np
from scipy.stats import norm

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.signals import BAND_INDEX, WAVELENGTH_M, Band
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences, Pairing, baselines_of, decided
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.gradient_detectability import (
    GRADIENT_RANGE,
    P_MISSED_DETECTION,
    BaselineMonitor,
    Fuse,
    blind_intervals,
    check_gradient_range,
    projected_length_m,
)
from gbas_ground.monitors.gradient_estimates import gradient_set
from gbas_ground.monitors.result import MonitorResult, upper_limit

_LEVEL: Final = 1.05  # sigmas are rounded up by at most this factor when the coverage is looked up
_PER_STEP: Final = float(1.0 / np.log(_LEVEL))


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


@dataclass(frozen=True, kw_only=True)
class BandTests:
    """Bands a satellite may be tested on together.

    Attributes
    ----------
    places : tuple of int
        On the axis of the monitor's bands.
    k_ffd : float
        Multiplier of the thresholds when these bands share the budget of false alarms.
    """

    places: tuple[int, ...]
    k_ffd: float


@dataclass(frozen=True, kw_only=True, eq=False)
class GradientSite:
    """What the monitor knows of a station; made once, by :func:`gradient_site`.

    Attributes
    ----------
    baselines : Baselines
    length_m : (W, B) array
        Signed lengths of the baselines along each runway [m].
    tests : tuple of BandTests
        What a satellite may be tested on: all bands, then each alone.
    k_md : float
        Multiplier of missed detection.
    """

    baselines: Baselines
    length_m: FloatArray
    tests: tuple[BandTests, ...]
    k_md: float
    # choices and coverages computed so far
    _known: dict[tuple[int, ...], tuple[int, float]] = field(default_factory=dict, repr=False)

    @property
    def k_ffd(self) -> float:
        """Multiplier of the thresholds when all bands are tested: the largest."""
        return self.tests[0].k_ffd


def gradient_site(positions_m: FloatArray, reference_m: FloatArray, params: IonosphereGradientParams) -> GradientSite:
    """Baselines, projections and multipliers of a station.

    Parameters
    ----------
    positions_m : (R, 3) array
        Surveyed antennas, ECEF [m].
    reference_m : (3,) array
        Reference point, ECEF [m].
    params : IonosphereGradientParams
    """
    baselines = baselines_of(positions_m, reference_m, params.pairing)
    params.noise.factors(len(positions_m))
    places = tuple(range(len(params.bands)))
    sets = (places, *((place,) for place in places if len(places) > 1))
    each = max(1, len(baselines))
    return GradientSite(
        baselines=baselines,
        length_m=np.array([projected_length_m(baselines.vector_m, each) for each in params.runway_bearing_rad]),
        tests=tuple(
            BandTests(places=own, k_ffd=false_alarm_multiplier(params.p_false_alarm, tests=each * len(own)))
            for own in sets
        ),
        k_md=float(norm.isf(params.p_missed_detection)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class GradientResult:
    """What the monitor found.

    Attributes
    ----------
    verdict : MonitorResult
        ``(N,)``: statistic and threshold of the baseline and band that decided [m].
    by_baseline : MonitorResult
        ``(B, F, N)``: each baseline and band for itself; its `failed` has no part of `params.fuse`.
    monitored : (N,) bool array
        Satellites with a statistic that can detect something, and enough of `params.gradient_range`.
    coverage : (N,) array
        Share of the range that the tests that were run detect now, along the worst runway.
    tested : (F, N) bool array
        Bands each satellite is tested on.
    gradient : (N,) array
        Of satellites that exceeded a threshold: the smallest gradient along the first runway that explains all their
        double differences [m/m]; NaN if none does. The others that do:
        :func:`~gbas_ground.monitors.gradient_estimates.gradient_set`.
    """

    verdict: MonitorResult
    by_baseline: MonitorResult
    monitored: BoolArray
    coverage: FloatArray
    tested: BoolArray
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
    there = np.isfinite(differences.residual_m)
    chosen, coverage = _choice(differences.nominal_sigma_m, there, site, params)
    tested = _band_masks(site, params)[chosen].T
    threshold = np.array([each.k_ffd for each in site.tests])[chosen] * differences.sigma_m
    looked = there & tested & (threshold < _half_wavelength_m(params))
    by_baseline = upper_limit(np.where(looked, np.abs(differences.residual_m), np.nan), threshold, looked)
    statistic, limit = decided(by_baseline.statistic, threshold, params.fuse)
    monitored = (coverage > 0.0) & (coverage >= params.min_coverage) & np.isfinite(statistic)
    exceeded = due & (statistic > limit)
    return GradientResult(
        verdict=MonitorResult(statistic=statistic, threshold=limit, failed=exceeded),
        by_baseline=by_baseline,
        monitored=monitored,
        coverage=coverage,
        tested=tested,
        gradient=_smallest_gradients(exceeded, differences, looked, site.length_m[0], params.bands),
    )


def coverage_at(
    elevation_rad: FloatArray, reference_rad: FloatArray | float, site: GradientSite, params: IonosphereGradientParams
) -> FloatArray:
    """Share of `params.gradient_range` detected on satellites of these elevations, ``(N,)``, along the worst runway.

    Parameters
    ----------
    elevation_rad : (N,) array
        Of satellites with all bands at all receivers; for fewer bands, other `params` and `site`.
    reference_rad : float or (N,) array
        Elevation of the reference satellite that gives the middle statistic, see :class:`DoubleDifferences`.
    site : GradientSite
    params : IonosphereGradientParams
    """
    own, reference = (
        params.noise.sigma_m(np.broadcast_to(each, np.shape(elevation_rad)), params.bands)
        for each in (elevation_rad, reference_rad)
    )
    sigma = _scales(site, params)[:, np.newaxis, np.newaxis] * np.hypot(own, reference)
    return _choice(sigma, np.isfinite(sigma), site, params)[1]


def _band_masks(site: GradientSite, params: IonosphereGradientParams) -> BoolArray:
    """Bands of each of the site's tests, ``(T, F)``."""
    return np.array([[place in each.places for place in range(len(params.bands))] for each in site.tests])


def _half_wavelength_m(params: IonosphereGradientParams) -> FloatArray:
    """A threshold beyond this can never be exceeded, ``(F, 1)`` [m]."""
    return np.asarray(0.5 * WAVELENGTH_M[list(params.bands)][:, np.newaxis])


def _choice(
    nominal_sigma_m: FloatArray, there: BoolArray, site: GradientSite, params: IonosphereGradientParams
) -> tuple[IntArray, FloatArray]:
    """Place in the site's tests that detects most, and its coverage, both (N,); the first of equals.

    From sigmas without noise, so that what is tested and covered does not change with what is measured. Sigmas of a
    band are taken as its worst baseline's, relative to the receivers' noise, rounded up: few values that come again and
    again, so that most are known.
    """
    scale, size = _scales(site, params), there.shape[0] * there.shape[1]
    level = np.where(there, nominal_sigma_m, 0.0) / scale[:, np.newaxis, np.newaxis]
    largest = level.max(axis=0, initial=0.0)  # (F, N)
    steps = np.ceil(np.log(np.where(largest > 0.0, largest, 1.0)) * _PER_STEP).astype(np.int64)
    code = (np.int64(1) << np.arange(size, dtype=np.int64)) @ there.reshape(size, there.shape[-1])
    chosen, coverage = np.zeros(code.shape, dtype=np.int64), np.zeros(code.shape)
    satellites = np.flatnonzero(code)
    keys = zip(code[satellites].tolist(), *steps[:, satellites].tolist(), strict=True)
    for satellite, key in zip(satellites.tolist(), keys, strict=True):
        if key not in site._known:
            site._known[key] = _best(key[0], np.outer(scale, _LEVEL ** np.array(key[1:])), site, params)
        chosen[satellite], coverage[satellite] = site._known[key]
    return chosen, coverage


def _best(there: int, sigma_m: FloatArray, site: GradientSite, params: IonosphereGradientParams) -> tuple[int, float]:
    """Place in the site's tests that detects most, and its coverage."""
    coverage = [
        min(_covered(there, sigma_m, tests, length, site, params) for length in site.length_m) for tests in site.tests
    ]
    place = int(np.argmax(coverage))
    return place, coverage[place]


def _covered(
    there: int,
    sigma_m: FloatArray,
    tests: BandTests,
    length_m: FloatArray,
    site: GradientSite,
    params: IonosphereGradientParams,
) -> float:
    """Share of the gradients that is not blind."""
    blind = _blind(there, sigma_m, tests, length_m, site, params)
    low, high = params.gradient_range
    return 1.0 - float((blind[:, 1] - blind[:, 0]).sum()) / (high - low)


def _scales(site: GradientSite, params: IonosphereGradientParams) -> FloatArray:
    """How the noise of the baselines compares, (B,)."""
    factors = params.noise.factors(len(site.baselines.place_m))
    return np.asarray(np.hypot(factors[site.baselines.first], factors[site.baselines.second]))


def _blind(
    there: int,
    sigma_m: FloatArray,
    tests: BandTests,
    length_m: FloatArray,
    site: GradientSite,
    params: IonosphereGradientParams,
) -> FloatArray:
    """Gradients that are blind on each of the bands that are tested; `there` has a bit a baseline and band."""
    blind, n_bands = np.array([params.gradient_range]), len(params.bands)
    for place in tests.places:
        band = params.bands[place]
        monitors = [
            BaselineMonitor(length_m=abs(float(length_m[row])), sigma_m=float(sigma_m[row, place]), band=band)
            for row in range(len(length_m))
            if there >> (row * n_bands + place) & 1 and tests.k_ffd * sigma_m[row, place] < 0.5 * WAVELENGTH_M[band]
        ]
        if monitors:
            k = tests.k_ffd + site.k_md
            own = blind_intervals(monitors, k, fuse=params.fuse, gradient_range=params.gradient_range)
            blind = _intersection(blind, own)
    return blind


def _intersection(one: FloatArray, other: FloatArray) -> FloatArray:
    """Of two sets of sorted, disjoint intervals."""
    low = np.maximum(one[:, np.newaxis, 0], other[np.newaxis, :, 0])
    high = np.minimum(one[:, np.newaxis, 1], other[np.newaxis, :, 1])
    kept = low < high
    return np.asarray(np.stack([low[kept], high[kept]], axis=-1))


def blind_gradients(
    differences: DoubleDifferences,
    satellite: int,
    site: GradientSite,
    params: IonosphereGradientParams,
    runway: int = 0,
) -> FloatArray:
    """Gradients along a runway that a satellite's baselines do not detect at this epoch, ``(n, 2)`` [m/m].

    A row of these, epoch by epoch, is the track of blind gradients of a satellite.

    Parameters
    ----------
    differences : DoubleDifferences
    satellite : int
        Place on the satellite axis.
    site : GradientSite
    params : IonosphereGradientParams
    runway : int
        Place in `params.runway_bearing_rad`.
    """
    sigma = differences.nominal_sigma_m[..., [satellite]]
    there = np.isfinite(differences.residual_m[..., [satellite]])
    (place,), _ = _choice(sigma, there, site, params)
    code = sum(1 << place for place in np.flatnonzero(there.ravel()).tolist())
    return _blind(code, sigma[..., 0], site.tests[place], site.length_m[runway], site, params)


def _smallest_gradients(
    exceeded: BoolArray, differences: DoubleDifferences, looked: BoolArray, length_m: FloatArray, bands: tuple[int, ...]
) -> FloatArray:
    """First of :func:`gradient_set` for the satellites that exceeded a threshold, (N,); NaN for the others."""
    result = np.full(exceeded.shape, np.nan)
    for satellite in np.flatnonzero(exceeded):
        own = np.where(looked[..., satellite], differences.residual_m[..., satellite], np.nan)
        explained = gradient_set(own, differences.sigma_m[..., satellite], length_m, bands)
        if explained.size:
            result[satellite] = explained[0]
    return result
