"""Absolute slant ionosphere gradient monitor: double-difference carriers over the station's baselines.

The statistic of a baseline is the double difference to the nearest wavelength
(:mod:`~gbas_ground.monitors.double_difference`). A gradient shows as its delay over the baseline, less whole
wavelengths: the monitor needs no history and no ambiguity, and it is blind to gradients that make nearly whole
wavelengths (:mod:`gbas_ground.gradient_detectability`). Every baseline has blind gradients of its own; together they
leave few.

What it does not see: a gradient that all satellites share, which is part of the receivers' clocks here and in the air;
a gradient across all baselines; and, at low elevations, whatever a threshold of half a wavelength would have to pass.
Such satellites are reported as not monitored.

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
from typing import Final

import numpy as np
from scipy.stats import chi2, norm

from gbas_core.record import FloatArray
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.corrections import BoolArray
from gbas_ground.gradient_detectability import (
    GRADIENT_RANGE,
    P_MISSED_DETECTION,
    BaselineMonitor,
    Fuse,
    blind_intervals,
    check_gradient_range,
    projected_length_m,
)
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences, Pairing, baselines_of, decided
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.result import MonitorResult, upper_limit

_LEVEL: Final = 1.05  # sigmas are rounded up by at most this factor when the coverage is looked up


@dataclass(frozen=True, kw_only=True)
class IonosphereGradientParams:
    """Settings of the gradient monitor.

    Attributes
    ----------
    runway_bearing_rad : tuple of float
        True bearings of the runways gradients are monitored along; coverage is that of the worst [rad].
    bands : tuple of int
        Carriers used; a satellite without one of them is monitored with the others.
    pairing : {"all", "star"}
        Baselines, see :func:`~gbas_ground.monitors.double_difference.baselines_of`.
    fuse : {"any", "all"}
        A satellite fails when one of its baselines fails, or when all do. Bands are always "any".
    references : int
        Reference satellites of a constellation. Ours.
    noise : CarrierNoise
    p_false_alarm : float
        For one source in 15 s, over all its baselines and bands.
    p_missed_detection : float
        Of a gradient that counts as detectable. Uncertain: the paper does not print it.
    gradient_range : pair of float
        Gradients coverage is counted over [m/m].
    min_coverage : float
        Share of `gradient_range` a satellite's baselines have to detect for it to count as monitored; always more than
        nothing. 0 claims nothing: a station that claims a bound on the gradient must set it.
    required : bool
        Satellites that are due and not monitored fail.
    """

    runway_bearing_rad: tuple[float, ...]
    bands: tuple[int, ...] = (L1, L5)
    pairing: Pairing = "all"
    fuse: Fuse = "any"
    references: int = 5
    noise: CarrierNoise = CarrierNoise()
    p_false_alarm: float = FALSE_EXCLUSION
    p_missed_detection: float = P_MISSED_DETECTION
    gradient_range: tuple[float, float] = GRADIENT_RANGE
    min_coverage: float = 0.0
    required: bool = True

    def __post_init__(self) -> None:
        if not self.runway_bearing_rad or not np.isfinite(self.runway_bearing_rad).all():
            raise ValueError(f"gradient monitor: runway_bearing_rad is {self.runway_bearing_rad}: at least one, finite")
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ValueError(f"gradient monitor: bands is {self.bands}: at least one, each once")
        if self.fuse not in ("any", "all"):
            raise ValueError(f"gradient monitor: fuse is {self.fuse!r}: it must be any or all")
        if self.references < 1:
            raise ValueError(f"gradient monitor: references is {self.references}: at least 1 is needed")
        for name in ("p_false_alarm", "p_missed_detection"):
            if not 0.0 < getattr(self, name) < 0.5:
                raise ValueError(f"gradient monitor: {name} is {getattr(self, name)}: it must be between 0 and 0.5")
        if not 0.0 <= self.min_coverage <= 1.0:
            raise ValueError(f"gradient monitor: min_coverage is {self.min_coverage}: it must be from 0 to 1")
        check_gradient_range(self.gradient_range)


@dataclass(frozen=True, kw_only=True, eq=False)
class GradientSite:
    """What the monitor knows of a station; made once, by :func:`gradient_site`.

    Attributes
    ----------
    baselines : Baselines
    length_m : (W, B) array
        Signed lengths of the baselines along each runway [m].
    k_ffd, k_md : float
        Multipliers of the threshold and of missed detection.
    """

    baselines: Baselines
    length_m: FloatArray
    k_ffd: float
    k_md: float
    _known: dict[tuple[int, ...], float] = field(default_factory=dict, repr=False)  # coverages computed so far


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
    tests = max(1, len(baselines)) * len(params.bands)
    return GradientSite(
        baselines=baselines,
        length_m=np.array([projected_length_m(baselines.vector_m, each) for each in params.runway_bearing_rad]),
        k_ffd=false_alarm_multiplier(params.p_false_alarm, tests=tests),
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
        Share of the range that the satellite's baselines detect now, along the worst runway.
    gradient : (N,) array
        Of satellites that exceeded a threshold: the smallest gradient along the first runway that explains all their
        double differences [m/m]; NaN if none does. The others that do: :func:`gradient_set`.
    """

    verdict: MonitorResult
    by_baseline: MonitorResult
    monitored: BoolArray
    coverage: FloatArray
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
    wavelength = WAVELENGTH_M[list(params.bands)][:, np.newaxis]
    threshold = site.k_ffd * differences.sigma_m
    there, half = np.isfinite(differences.residual_m), 0.5 * wavelength
    looked = there & (threshold < half)
    by_baseline = upper_limit(np.where(looked, np.abs(differences.residual_m), np.nan), threshold, looked)
    # without noise, so that what is covered does not change with it
    able = there & (site.k_ffd * differences.nominal_sigma_m < half)
    coverage = _coverage(differences.nominal_sigma_m, able, site, params)
    statistic, limit = decided(by_baseline.statistic, threshold, params.fuse)
    monitored = (coverage > 0.0) & (coverage >= params.min_coverage) & np.isfinite(statistic)
    exceeded = due & (statistic > limit)
    failed = exceeded | (due & ~monitored) if params.required else exceeded
    return GradientResult(
        verdict=MonitorResult(statistic=statistic, threshold=limit, failed=failed),
        by_baseline=by_baseline,
        monitored=monitored,
        coverage=coverage,
        gradient=_smallest_gradients(exceeded, differences, looked, site.length_m[0], params.bands),
    )


def _coverage(
    sigma_m: FloatArray, looked: BoolArray, site: GradientSite, params: IonosphereGradientParams
) -> FloatArray:
    """Share of the gradients that are detectable, (N,).

    Sigmas of a band are taken as its worst baseline's, relative to the receivers' noise, rounded up: few values that
    come again and again, so that most are known.
    """
    scale = _scales(site, params)
    level = np.where(looked, sigma_m, 0.0) / scale[:, np.newaxis, np.newaxis]
    largest = level.max(axis=0, initial=0.0)  # (F, N)
    rounded = np.ceil(np.log(np.where(largest > 0.0, largest, 1.0)) / np.log(_LEVEL)).astype(np.int64)
    size = looked.shape[0] * looked.shape[1]
    code = (np.int64(1) << np.arange(size, dtype=np.int64)) @ looked.reshape(size, looked.shape[-1])
    result = np.zeros(code.shape)
    satellites = np.flatnonzero(code)
    keys = zip(code[satellites].tolist(), *rounded[:, satellites].tolist(), strict=True)
    for satellite, key in zip(satellites, keys, strict=True):
        if key not in site._known:
            site._known[key] = _coverage_of(key[0], np.outer(scale, _LEVEL ** np.array(key[1:])), site, params)
        result[satellite] = site._known[key]
    return result


def _scales(site: GradientSite, params: IonosphereGradientParams) -> FloatArray:
    """How the noise of the baselines compares, (B,)."""
    factors = params.noise.factors(len(site.baselines.place_m))
    return np.asarray(np.hypot(factors[site.baselines.first], factors[site.baselines.second]))


def _monitors(
    looked: int, sigma_m: FloatArray, length_m: FloatArray, params: IonosphereGradientParams
) -> list[list[BaselineMonitor]]:
    """The baselines behind a satellite, band by band."""
    n_bands = len(params.bands)
    return [
        [
            BaselineMonitor(length_m=abs(float(length_m[row])), sigma_m=float(sigma_m[row, place]), band=band)
            for row in range(len(length_m))
            if looked >> (row * n_bands + place) & 1
        ]
        for place, band in enumerate(params.bands)
    ]


def _coverage_of(looked: int, sigma_m: FloatArray, site: GradientSite, params: IonosphereGradientParams) -> float:
    shares = []
    for length in site.length_m:
        blind = _blind(_monitors(looked, sigma_m, length, params), site.k_ffd + site.k_md, params)
        low, high = params.gradient_range
        shares.append(1.0 - float((blind[:, 1] - blind[:, 0]).sum()) / (high - low))
    return min(shares)


def _blind(by_band: list[list[BaselineMonitor]], k: float, params: IonosphereGradientParams) -> FloatArray:
    """Blind gradients of several bands: those blind on each."""
    blind = np.array([params.gradient_range])
    for monitors in by_band:
        if monitors:
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
    sigma = differences.nominal_sigma_m[..., satellite]
    wavelength = WAVELENGTH_M[list(params.bands)]
    looked = np.isfinite(differences.residual_m[..., satellite]) & (site.k_ffd * sigma < 0.5 * wavelength)
    code = sum(1 << place for place in np.flatnonzero(looked.ravel()).tolist())
    return _blind(_monitors(code, sigma, site.length_m[runway], params), site.k_ffd + site.k_md, params)


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


def gradient_set(
    residual_m: FloatArray,
    sigma_m: FloatArray,
    length_m: FloatArray,
    bands: tuple[int, ...],
    *,
    largest: float = GRADIENT_RANGE[1],
    p_lost: float = 1.0e-4,
) -> FloatArray:
    """All gradients along the runway that explain the double differences of one satellite, n lambda and all.

    Parameters
    ----------
    residual_m, sigma_m : (B, F) arrays
        Double differences and their sigmas [m]; NaN where there is none.
    length_m : (B,) array
        Signed lengths along the runway [m].
    bands : tuple of int
        The F bands.
    largest : float
        Largest size looked for [m/m].
    p_lost : float
        Probability that the true gradient is not in the set.

    Returns
    -------
    (n,) array
        In order of size [m/m]: of one baseline, every ``(-dd + n lambda) / slope``; of several, those on which they
        agree (chi-square of the residuals). Empty if no gradient along the runway explains them.

    Source: the paper, eq (2), (3).
    """
    slope = length_m[:, np.newaxis] * IONO_RATIO[list(bands)]
    there = np.isfinite(residual_m + sigma_m) & (slope != 0.0)
    if not there.any():
        return np.empty(0)
    delay, sigma, slope = -residual_m[there], sigma_m[there], slope[there]
    wavelength = np.broadcast_to(WAVELENGTH_M[list(bands)], there.shape)[there]
    first = int(np.argmax(np.abs(slope) / wavelength))  # its multiples are the closest
    most = int(np.ceil((largest * abs(slope[first]) + wavelength[first]) / wavelength[first]))
    start = (delay[first] + np.arange(-most, most + 1) * wavelength[first]) / slope[first]
    whole = np.rint((start[:, np.newaxis] * slope - delay) / wavelength) * wavelength + delay
    weight = slope / sigma**2
    gradient = whole @ weight / (slope @ weight)
    misfit = (((whole - gradient[:, np.newaxis] * slope) / sigma) ** 2).sum(axis=-1)
    agrees = misfit <= chi2.isf(p_lost, max(1, delay.size - 1))
    kept = gradient[agrees & (np.abs(gradient) <= largest)]
    return np.asarray(kept[np.argsort(np.abs(kept), kind="stable")])
