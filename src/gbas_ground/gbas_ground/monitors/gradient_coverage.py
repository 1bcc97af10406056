"""What a station's baselines can see of gradients, and what every satellite is therefore tested on.

Every test takes a share of the budget of false alarms, so that a second band raises the thresholds of the first, and
may cost more gradients than it adds. A satellite is therefore tested on the bands, one alone or all together, that
detect most, each with the thresholds of its own number of tests: more bands never lower the coverage. The choice rests
on elevations and on which channels there are, not on what was measured, so the budget holds.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtri

from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.signals import WAVELENGTH_M
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences, baselines_of
from gbas_ground.monitors.false_alarm import false_alarm_multiplier
from gbas_ground.monitors.gradient_detectability import BaselineMonitor, blind_intervals, projected_length_m
from gbas_ground.monitors.kernels import gradient as kernels
from gbas_msgs_py.records import BASELINES

if TYPE_CHECKING:
    from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams

_LEVEL: Final = 1.05  # sigmas are rounded up by at most this factor when the coverage is looked up
_PER_STEP: Final = float(1.0 / np.log(_LEVEL))


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
    scale : (B,) array
        How the noise of the baselines compares.
    """

    baselines: Baselines
    length_m: FloatArray
    tests: tuple[BandTests, ...]
    k_md: float
    scale: FloatArray
    # choices and coverages computed so far
    _known: dict[tuple[int, ...], tuple[int, float]] = field(default_factory=dict, repr=False)
    # the same of all satellites of the latest epoch
    _latest: dict[bytes, tuple[IntArray, FloatArray]] = field(default_factory=dict, repr=False)

    @property
    def k_ffd(self) -> float:
        """Multiplier of the thresholds when all bands are tested: the largest."""
        return self.tests[0].k_ffd

    @cached_property
    def multipliers(self) -> FloatArray:
        """Multiplier of the thresholds of each of the tests, ``(T,)``."""
        return np.array([each.k_ffd for each in self.tests])

    @cached_property
    def masks(self) -> BoolArray:
        """Bands of each of the tests, ``(T, F)``."""
        return np.array([[place in each.places for place in self.tests[0].places] for each in self.tests])

    @cached_property
    def rows(self) -> IntArray:
        """Rows of the baselines in the tables, ``(B,)``."""
        pairs = zip(self.baselines.first.tolist(), self.baselines.second.tolist(), strict=True)
        return np.array([BASELINES.index((i + 1, j + 1)) for i, j in pairs], dtype=np.int64)


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
    factors = params.noise.factors(len(positions_m))
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
        k_md=float(-ndtri(params.p_missed_detection)),
        scale=np.hypot(factors[baselines.first], factors[baselines.second]),
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
    sigma = site.scale[:, np.newaxis, np.newaxis] * np.hypot(own, reference)
    return best_tests(sigma, sigma, site, params)[1]


def best_tests(
    residual_m: FloatArray, nominal_sigma_m: FloatArray, site: GradientSite, params: IonosphereGradientParams
) -> tuple[IntArray, FloatArray]:
    """What each satellite is tested on, and its coverage.

    Parameters
    ----------
    residual_m, nominal_sigma_m : (B, F, N) arrays
        As of :class:`~gbas_ground.monitors.double_difference.DoubleDifferences`; only where there is a residual counts.
    site : GradientSite
    params : IonosphereGradientParams

    Returns
    -------
    chosen : (N,) int array
        Place in the site's tests that detects most; the first of equals.
    coverage : (N,) array

    Notes
    -----
    From sigmas without noise, so that what is tested and covered does not change with what is measured. Sigmas of a
    band are taken as its worst baseline's, relative to the receivers' noise, rounded up: few values that come again and
    again, so that most are known, and mostly those of the epoch before.
    """
    sky = np.empty((1 + residual_m.shape[1], residual_m.shape[2]), dtype=np.int64)
    kernels.sky(residual_m, nominal_sigma_m, site.scale, _PER_STEP, sky)
    key = sky.tobytes()
    if key not in site._latest:
        site._latest.clear()
        site._latest[key] = _of_all(sky[0], sky[1:], site, params)
    return site._latest[key]


def _of_all(
    code: IntArray, steps: IntArray, site: GradientSite, params: IonosphereGradientParams
) -> tuple[IntArray, FloatArray]:
    """Place and coverage of every satellite."""
    chosen, coverage = np.zeros(code.shape, dtype=np.int64), np.zeros(code.shape)
    satellites = np.flatnonzero(code)
    keys = zip(code[satellites].tolist(), *steps[:, satellites].tolist(), strict=True)
    for satellite, key in zip(satellites.tolist(), keys, strict=True):
        if key not in site._known:
            site._known[key] = _best(key[0], np.outer(site.scale, _LEVEL ** np.array(key[1:])), site, params)
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
    sigma = np.ascontiguousarray(differences.nominal_sigma_m[..., [satellite]])
    residual = np.ascontiguousarray(differences.residual_m[..., [satellite]])
    (place,), _ = best_tests(residual, sigma, site, params)
    code = np.empty(1, dtype=np.int64)
    kernels.seen(residual, len(params.bands), code)
    return _blind(int(code[0]), sigma[..., 0], site.tests[place], site.length_m[runway], site, params)
