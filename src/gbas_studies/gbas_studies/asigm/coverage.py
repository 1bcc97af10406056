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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

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
from gbas_studies.campaign import Campaign, Execution, run

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Day:
    """Satellites of a day, and the stations that look for gradients on them.

    Attributes
    ----------
    elevation_rad : (E, N) array
        From :func:`elevations_of_a_day`.
    stations : mapping from a name to (GradientSite, IonosphereGradientParams)
    repetitions : int
        Monte Carlo runs of each epoch: each has a random gradient of the monitor's range on every satellite that
        is nobody's reference, and on one of each constellation's references in turn.
    """

    elevation_rad: FloatArray
    stations: Mapping[str, tuple[GradientSite, IonosphereGradientParams]]
    repetitions: int = 1


@dataclass(frozen=True, kw_only=True)
class EpochCounts:
    """One epoch of the day, satellite by satellite.

    Attributes
    ----------
    satellites : tuple of int
        On the satellite axis; the others of the tuples are theirs.
    coverage : tuple of float
        Share of the gradients that is covered.
    tried, detected, covered, missed, alarms : tuple of int
        Random gradients; those detected, covered, and covered and not detected; failures without a gradient.
    """

    satellites: tuple[int, ...]
    coverage: tuple[float, ...]
    tried: tuple[int, ...]
    detected: tuple[int, ...]
    covered: tuple[int, ...]
    missed: tuple[int, ...]
    alarms: tuple[int, ...]


def study(
    day: Day, *, seed: int, bins_deg: Sequence[float] = BINS_DEG, execution: Execution | None = None
) -> dict[str, list[Bin]]:
    """Coverage and Monte Carlo of the satellites of a day, for each station.

    Parameters
    ----------
    day : Day
    seed : int
        Of the Monte Carlo runs.
    bins_deg : sequence of float
        Ends of the bins.
    execution : Execution, optional
        Where: the tables do not depend on it.
    """
    epochs = len(day.elevation_rad)
    campaign = Campaign(
        study="coverage",
        settings=day,
        trials=[(name, number) for name in day.stations for number in range(epochs)],
        prepare=_as_it_is,
        run_trial=run_epoch,
        result=EpochCounts,
        seed=seed,
        batch=8,
    )
    found = run(campaign, execution)
    return {
        name: _bins(day, found[place * epochs : (place + 1) * epochs], bins_deg)
        for place, name in enumerate(day.stations)
    }


def _as_it_is(day: Day) -> Day:
    return day


def run_epoch(day: Day, trial: tuple[str, int], seed: np.random.SeedSequence) -> EpochCounts:
    """All Monte Carlo runs of one epoch of the day, by name of the station and number of the epoch."""
    name, number = trial
    (site, params), random = day.stations[name], np.random.default_rng(seed)
    sky = _sky(day.elevation_rad[number], site, params)
    runs = [_trial(sky, site, params, repetition, random) for repetition in range(day.repetitions)]
    tried, detected, inside, alarms = (np.array(each) for each in zip(*runs, strict=True))
    covered = tried & inside

    def counts(happened: BoolArray) -> tuple[int, ...]:
        return tuple(happened.sum(axis=0)[sky.here].tolist())

    return EpochCounts(
        satellites=tuple(np.flatnonzero(sky.here).tolist()),
        coverage=tuple(sky.coverage[sky.here].tolist()),
        tried=counts(tried),
        detected=counts(detected),
        covered=counts(covered),
        missed=counts(covered & ~detected),
        alarms=counts(alarms),
    )


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


def _bins(day: Day, epochs: Sequence[EpochCounts], bins_deg: Sequence[float]) -> list[Bin]:
    pairs = zip(day.elevation_rad, epochs, strict=True)
    elevation_deg = np.degrees(np.concatenate([row[list(epoch.satellites)] for row, epoch in pairs]))

    def joined(name: str) -> FloatArray:
        return np.concatenate([np.array(getattr(epoch, name), dtype=np.float64) for epoch in epochs])

    names = ("coverage", "tried", "detected", "covered", "missed", "alarms")
    columns = {name: joined(name) for name in names}
    rows = []
    for low, high in itertools.pairwise(bins_deg):
        inside = (elevation_deg >= low) & (elevation_deg < high)
        rows.append(_bin(low, high, {name: each[inside] for name, each in columns.items()}, day.repetitions))
    return rows


def _bin(low: float, high: float, columns: Mapping[str, FloatArray], repetitions: int) -> Bin:
    share, tried = columns["coverage"], int(columns["tried"].sum())
    return Bin(
        low_deg=low,
        high_deg=high,
        samples=share.size,
        unmonitored_percent=100.0 * float((share == 0.0).mean()) if share.size else float("nan"),
        coverage_percent=100.0 * float(share.mean()) if share.size else float("nan"),
        least_percent=100.0 * float(share.min()) if share.size else float("nan"),
        trials=tried,
        detected=int(columns["detected"].sum()),
        covered=int(columns["covered"].sum()),
        missed=int(columns["missed"].sum()),
        false_alarms=int(columns["alarms"].sum()),
        quiet=share.size * repetitions - tried,
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
