"""Which gradients a station's monitor detects on the satellites of a day, by elevation: stated, and by Monte Carlo.

The stated coverage is what the monitor gives a satellite at an epoch: the share of gradients along the runway whose
statistic is ``(k_ffd + k_md) sigma`` or more away from every multiple of the wavelength, with the noise of that
satellite and its reference satellites, and the thresholds of as many tests as are run.

The Monte Carlo run knows nothing of it: receivers with clocks, ambiguities and Gaussian noise of the station's model,
random gradients on the satellites, and the monitor's verdict. It detects at least what is covered, since gradients that
count as blind are often detected too, and misses of the gradients that are covered at most P_md.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from gbas_core.gnss.frames import azimuth_elevation, rot_enu_ecef
from gbas_core.gnss.orbits import rotated_range
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import BANDS, IONO_RATIO, WAVELENGTH_M
from gbas_ground.monitors.double_difference import DoubleDifferences, double_differences, reference_satellites
from gbas_ground.monitors.false_alarm import false_alarm_multiplier
from gbas_ground.monitors.gradient_coverage import BandTests, GradientSite, blind_gradients, gradient_site
from gbas_ground.monitors.gradient_detectability import P_FALSE_ALARM
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams, check_ionosphere_gradient
from gbas_ground.params import GroundParams
from gbas_sim.world import open_orbits
from gbas_sim.world_params import WorldParams

DAY_S: Final = 86_400.0
BINS_DEG: Final = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 45.0, 60.0, 90.0)
_CLOCK_M: Final = 1.0e4
_CYCLES: Final = 1000


@dataclass(frozen=True, kw_only=True)
class Bin:
    """Satellites between two elevations, over the day.

    Attributes
    ----------
    low_deg, high_deg : float
    samples : int
        Satellites times epochs.
    unmonitored_percent : float
        Share of them of which nothing is covered.
    coverage_percent, least_percent : float
        Mean and least share of the gradients that is covered.
    trials, detected : int
        Random gradients of the Monte Carlo run, and those that were detected.
    covered, missed : int
        Those of them that are covered, and of these the ones that were not detected.
    false_alarms, quiet : int
        Satellites without a gradient that failed, of so many.
    """

    low_deg: float
    high_deg: float
    samples: int
    unmonitored_percent: float
    coverage_percent: float
    least_percent: float
    trials: int
    detected: int
    covered: int
    missed: int
    false_alarms: int
    quiet: int

    @property
    def detected_percent(self) -> float:
        """Share that the Monte Carlo run detected [%]; NaN without trials."""
        return 100.0 * self.detected / self.trials if self.trials else float("nan")


def papers_multiplier(site: GradientSite) -> GradientSite:
    """The same station with the paper's k_ffd, 3.8906: 1e-4 of one baseline, band and epoch, whatever their number."""
    k_ffd = false_alarm_multiplier(P_FALSE_ALARM, interval_s=15.0)
    tests = tuple(BandTests(places=each.places, k_ffd=k_ffd) for each in site.tests)
    return GradientSite(baselines=site.baselines, length_m=site.length_m, tests=tests, k_md=site.k_md, scale=site.scale)


def elevations_of_a_day(station: GroundParams, world: WorldParams, step_s: float) -> FloatArray:
    """Elevations ``(E, N)`` of the satellites of a world, from its start, above the station's mask; NaN below [rad]."""
    orbits = open_orbits(replace(world, flight=None, duration_s=DAY_S))
    here = station.reference_point_m()
    rotation = rot_enu_ecef(station.station.latitude_rad, station.station.longitude_rad)
    rows = []
    for since_s in np.arange(0.0, DAY_S, step_s):
        tow_s = world.start_tow_s + float(since_s)
        state = orbits.arc(world.start_week, tow_s)(np.full(N_SATS, tow_s))
        _, los = rotated_range(here, state.position_m)
        _, elevation = azimuth_elevation(rotation @ los)
        high = elevation >= station.monitors.elevation_mask_rad
        rows.append(np.where(high & orbits.transmitting(world.start_week, tow_s), elevation, np.nan))
    return np.array(rows)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sky:
    """One epoch of the day: who refers to whom, and what is covered."""

    elevation_rad: FloatArray
    here: BoolArray
    references: IntArray
    coverage: FloatArray
    blind: dict[int, FloatArray]


class Trials(NamedTuple):
    """Monte Carlo runs of each epoch.

    Each has a random gradient of the monitor's range on every satellite that is nobody's reference, and on one of each
    constellation's references in turn.
    """

    random: np.random.Generator
    repetitions: int = 1


def study(
    elevation_rad: FloatArray,
    site: GradientSite,
    params: IonosphereGradientParams,
    trials: Trials,
    *,
    bins_deg: Sequence[float] = BINS_DEG,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Bin]:
    """Coverage and Monte Carlo of the satellites of a day.

    Parameters
    ----------
    elevation_rad : (E, N) array
        From :func:`elevations_of_a_day`.
    site : GradientSite
    params : IonosphereGradientParams
    trials : Trials
    bins_deg : sequence of float
        Ends of the bins.
    progress : callable
        Told how many of all epochs are done.
    """
    counts: list[tuple[FloatArray | BoolArray, ...]] = []
    for number, row in enumerate(elevation_rad):
        sky = _sky(row, site, params)
        for repetition in range(trials.repetitions):
            counts.append((row, sky.coverage, *_trial(sky, site, params, repetition, trials.random)))
        progress(number + 1, len(elevation_rad))
    elevation, coverage, tried, detected, covered, alarms = (np.array(each) for each in zip(*counts, strict=True))
    return [
        _bin(low, high, _Tally(np.degrees(elevation), coverage, tried, detected, covered, alarms), trials.repetitions)
        for low, high in itertools.pairwise(bins_deg)
    ]


def _sky(elevation_rad: FloatArray, site: GradientSite, params: IonosphereGradientParams) -> _Sky:
    here = np.isfinite(elevation_rad)
    references = reference_satellites(here, elevation_rad, params.references)
    quiet = np.where(here, np.zeros((len(site.baselines.place_m), len(params.bands), 1)), np.nan)
    differences = _differences(quiet, elevation_rad, references, site, params)
    coverage = check_ionosphere_gradient(differences, here, site, params).coverage
    blind = {int(each): blind_gradients(differences, int(each), site, params) for each in np.flatnonzero(here)}
    return _Sky(elevation_rad=elevation_rad, here=here, references=references, coverage=coverage, blind=blind)


def _differences(
    residual_m: FloatArray,
    elevation_rad: FloatArray,
    references: IntArray,
    site: GradientSite,
    params: IonosphereGradientParams,
) -> DoubleDifferences:
    return double_differences(residual_m, site.baselines, references, elevation_rad, params.noise, params.bands)


def _trial(
    sky: _Sky, site: GradientSite, params: IonosphereGradientParams, repetition: int, random: np.random.Generator
) -> tuple[BoolArray, BoolArray, BoolArray, BoolArray]:
    """Which satellites had a gradient, which of these were detected, which covered; which others failed, all (N,)."""
    tried = sky.here & ~np.isin(np.arange(N_SATS), sky.references)
    for group in np.unique(sky.references[sky.here], axis=0):
        known = group[group >= 0]
        if known.size:
            tried[known[repetition % known.size]] = True
    gradient = np.where(tried, random.uniform(*params.gradient_range, N_SATS), 0.0)
    found = check_ionosphere_gradient(
        _differences(_carriers(sky, gradient, site, params, random), sky.elevation_rad, sky.references, site, params),
        sky.here,
        site,
        params,
    )
    inside = np.zeros(N_SATS, dtype=np.bool_)
    inside[tried] = [not _within(gradient[each], sky.blind[int(each)]) for each in np.flatnonzero(tried)]
    return tried, tried & found.verdict.failed, inside, found.verdict.failed & ~tried


def _carriers(
    sky: _Sky, gradient: FloatArray, site: GradientSite, params: IonosphereGradientParams, random: np.random.Generator
) -> FloatArray:
    """Carrier residuals (R, F, N): clocks, ambiguities, noise, and gradients along the first runway."""
    place_m, bands = site.baselines.place_m, list(params.bands)
    bearing = params.runway_bearing_rad[0]
    along_m = place_m[:, 0] * np.sin(bearing) + place_m[:, 1] * np.cos(bearing)
    shape = (len(place_m), len(bands), N_SATS)
    scale = params.noise.factors(len(place_m))[:, np.newaxis, np.newaxis]
    value = random.integers(-_CYCLES, _CYCLES, shape) * WAVELENGTH_M[bands][:, np.newaxis]
    value = value + random.normal(0.0, _CLOCK_M, (len(place_m), 1, 1))
    value += scale * params.noise.sigma_m(sky.elevation_rad, params.bands) * random.normal(size=shape)
    value -= along_m[:, np.newaxis, np.newaxis] * IONO_RATIO[bands][:, np.newaxis] * gradient
    return np.where(sky.here, value, np.nan)


def _within(gradient: float, intervals: FloatArray) -> bool:
    return bool(((gradient >= intervals[:, 0]) & (gradient <= intervals[:, 1])).any())


class _Tally(NamedTuple):
    """What came of all trials, ``(trials, N)`` each."""

    elevation_deg: FloatArray
    coverage: FloatArray
    tried: BoolArray
    detected: BoolArray
    covered: BoolArray
    alarms: BoolArray


def _bin(low: float, high: float, tally: _Tally, repetitions: int) -> Bin:
    elevation_deg, coverage, tried, detected, covered, alarms = tally
    inside = (elevation_deg >= low) & (elevation_deg < high)
    share = coverage[inside]
    return Bin(
        low_deg=low,
        high_deg=high,
        samples=int(inside.sum()) // repetitions,
        unmonitored_percent=100.0 * float((share == 0.0).mean()) if share.size else float("nan"),
        coverage_percent=100.0 * float(share.mean()) if share.size else float("nan"),
        least_percent=100.0 * float(share.min()) if share.size else float("nan"),
        trials=int(tried[inside].sum()),
        detected=int(detected[inside].sum()),
        covered=int(covered[inside].sum()),
        missed=int((covered & ~detected)[inside].sum()),
        false_alarms=int(alarms[inside].sum()),
        quiet=int((inside & ~tried).sum()),
    )


def site_with(
    station: GroundParams, receivers: int, bands: tuple[int, ...]
) -> tuple[GradientSite, IonosphereGradientParams]:
    """The station's monitor with its first receivers and these bands only."""
    noise = station.carrier_noise
    if len(noise.receiver_factor) > 1:
        noise = replace(noise, receiver_factor=noise.receiver_factor[:receivers])
    params = replace(station.gradient_monitor(), noise=noise, carriers=tuple(BANDS[band] for band in bands))
    return gradient_site(station.receiver_positions_m()[:receivers], station.reference_point_m(), params), params
