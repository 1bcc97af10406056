"""Ephemeris monitor: a satellite that is not where its broadcast orbit says, by double-difference carriers.

A displacement across the line of sight turns the line of sight, and the double difference over a baseline grows by the
baseline times that angle: 1 km at 20 000 km over 700 m makes 35 mm. The statistic is that of the gradient monitor
(:mod:`~gbas_ground.monitors.double_difference`), but followed from epoch to epoch through the half wavelengths: an
orbit that leaves its ephemeris slowly, by a manoeuvre (type A fault), does not come back to zero at 5 km. It begins
within half a wavelength; what bounds the orbit then is the new ephemeris against the old one
(:mod:`~gbas_ground.monitors.ephemeris_change`, type B faults) and the code against its expected range. Following needs
no slip detection, because a slip is whole wavelengths.

An orbit that is wrong already when its satellite is first seen is found only if it is not near whole wavelengths on all
baselines.

What a site can claim (:func:`decorrelation`, :func:`site_decorrelation`): the largest angle its baselines do not
detect is the parameter P of the broadcast, P = MDE / range. A single baseline, or several in one line, see an orbit
only in one direction and bound nothing in the other: P is then infinite, and without another monitor for that direction
the station must not rely on this one.

A double difference does not tell an orbit from an ionosphere gradient: whichever monitor fails first excludes the
satellite.

Source: fact of the LAAS/GBAS literature: Pullen, Lee, Luo, Pervan, Chan, Gratton, Ephemeris protection level equations
and monitor algorithms for GBAS, ION GPS 2001 (types A and B, P = MDE / range); Tang, Pullen, Enge, Gratton, Pervan,
Brenner, Scheitlin, Kline, Ephemeris type A fault analysis and mitigation for LAAS, IEEE/ION PLANS 2010 (baselines).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np
from scipy.special import ndtri

from gbas_core.compiled import as_written
from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS, WAVELENGTH_M
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, verdicts
from gbas_ground.monitors.kernels import double_difference as kernels
from gbas_ground.monitors.kernels.carrier_noise import differenced_sigma_m
from gbas_ground.monitors.monitor_table import signal_of, summarise
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.monitors import EPHEMERIS_RESIDUAL

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

REFERENCE_ELEVATION_RAD: Final = float(np.radians(30.0))
"""Lowest reference satellite that a site's P is reckoned with. Ours; :mod:`gbas_ground.claims.orbit_claim` has the
epoch's.
"""
_PARALLEL: Final = 1e-6  # sine of the angle below which two baselines, seen from the satellite, are one


@parameters
class EphemerisResidualParams:
    """Broadcast orbits against double-difference carriers, which are those of the gradient monitor.

    What a satellite that is not monitored may be used for is the station's business. Orbits move a double difference by
    millimetres a minute.
    """

    exclude: Annotated[bool, Parameter("satellites that fail are excluded")] = True
    required: Annotated[
        bool,
        Parameter(
            "satellites whose orbits it does not bound within the largest P are not used; always so with gast_d.enabled"
        ),
    ] = False
    p_false_alarm: Annotated[
        float, Parameter("of one source in 15 s, over all baselines and bands", "-", 1e-12, 0.5)
    ] = FALSE_EXCLUSION
    p_missed_detection: Annotated[
        float, Parameter("of an orbit error P is claimed for (uncertain)", "-", 1e-12, 0.5)
    ] = 1e-4
    max_gap_s: Annotated[float, Parameter("longest gap a double difference is followed across", "s", 0.1, 3600.0)] = (
        60.0
    )
    bands: Annotated[tuple[int, ...], Derived("those of the gradient monitor", "-", 0, N_BANDS - 1)] = (
        L1,
        L5,
    )

    def __post_init__(self) -> None:
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ParameterError(f"bands = {self.bands} is not one or more, each once")

    def multiplier(self, n_baselines: int) -> float:
        """Standard deviations of the threshold."""
        return false_alarm_multiplier(self.p_false_alarm, tests=max(1, n_baselines) * len(self.bands))

    @property
    def k_md(self) -> float:
        """Standard deviations for missed detection."""
        return float(-ndtri(self.p_missed_detection))


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisResidualState:
    """Double differences as they were followed.

    Attributes
    ----------
    followed : (2, B, F, N) array
        Double differences [m], NaN where there is none; time since each was last there, NaN if it never was [s].
    """

    followed: FloatArray


def initial_ephemeris_residual(n_baselines: int, params: EphemerisResidualParams) -> EphemerisResidualState:
    """A monitor that has seen nothing."""
    return EphemerisResidualState(followed=np.full((2, n_baselines, len(params.bands), N_SATS), np.nan))


class Orbits(NamedTuple):
    """What the monitor looks at, at one epoch.

    Attributes
    ----------
    differences : DoubleDifferences
        Of the baselines and `params.bands`.
    due : (N,) bool array
        Satellites that must be monitored.
    shift_m : (R, N) array, optional
        What a new ephemeris changes in the residuals of this epoch, as for
        :class:`~gbas_ground.monitors.carrier_acceleration.Carriers` [m].
    """

    differences: DoubleDifferences
    due: BoolArray
    shift_m: FloatArray | None = None


def ephemeris_residual_step(
    state: EphemerisResidualState, seen: Orbits, baselines: Baselines, dt_s: float, params: EphemerisResidualParams
) -> tuple[EphemerisResidualState, MonitorResult]:
    """Follow and test one epoch.

    Parameters
    ----------
    state : EphemerisResidualState
    seen : Orbits
    baselines : Baselines
    dt_s : float
        Time since the epoch before [s]; NaN at the first.
    params : EphemerisResidualParams

    Returns
    -------
    state : EphemerisResidualState
    result : MonitorResult
        ``(N,)``: size of the double difference of the baseline and band that is worst, and its threshold [m].
    """
    followed, found = np.empty(state.followed.shape), np.empty((2, len(seen.due)))
    failed = np.empty(len(seen.due), dtype=bool)
    kernels.follow(
        state.followed,
        seen.differences.residual_m,
        seen.differences.sigma_m,
        baselines.first,
        baselines.second,
        np.zeros((len(baselines.place_m), N_SATS)) if seen.shift_m is None else seen.shift_m,
        seen.due,
        float(dt_s),
        float(params.max_gap_s),
        params.multiplier(len(baselines)),
        WAVELENGTH_M.take(params.bands),
        followed,
        found,
        failed,
    )
    new = EphemerisResidualState(followed=followed)
    return new, MonitorResult(statistic=found[0], threshold=found[1], failed=failed)


def decorrelation(
    vector_m: FloatArray, threshold_m: FloatArray, los_enu: FloatArray, *, descent_rad: float = 0.0
) -> FloatArray:
    """Largest error per metre of separation that an undetected orbit error causes: the parameter P of each satellite.

    Parameters
    ----------
    vector_m : (B, 3) array
        Baselines, east, north, up [m].
    threshold_m : (B, N) array
        Size of a double difference that is detected with the wanted probability: (k_ffd + k_md) sigma [m]. NaN where a
        baseline does not see the satellite.
    los_enu : (3, N) array
        Unit vectors to the satellites.
    descent_rad : float
        Angle below the station's horizon that users are up to [rad]; they may be in any direction.

    Returns
    -------
    (N,) array
        P [m/m]; infinite without two baselines in different directions.

    Notes
    -----
    An orbit error d across the line of sight, over the range, is an angle u. It is not detected while |b u| is below
    the threshold of every baseline b: inside a polygon around zero. The user's error is u times the separation; its
    largest value is at a corner of the polygon.
    """
    across = vector_m[:, :, np.newaxis] - np.einsum("bi,in->bn", vector_m, los_enu)[:, np.newaxis] * los_enu
    largest = np.zeros(los_enu.shape[-1])
    bounded = np.zeros(los_enu.shape[-1], dtype=bool)
    seen = np.isfinite(threshold_m)
    for i, j in combinations(range(len(vector_m)), 2):
        normal = np.cross(across[i], across[j], axis=0)
        area = (normal * los_enu).sum(axis=0)  # both lie across the line of sight
        scale = np.linalg.norm(across[i], axis=0) * np.linalg.norm(across[j], axis=0)
        apart = (np.abs(area) > _PARALLEL * scale) & seen[i] & seen[j]
        bounded |= apart
        with np.errstate(divide="ignore", invalid="ignore"):
            for sign in (1.0, -1.0):  # the other two corners are opposite to these
                # u with across_i u = T_i and across_j u = +-T_j, by the dual vectors in the plane
                turned = np.cross(threshold_m[i] * across[j] - sign * threshold_m[j] * across[i], los_enu, axis=0)
                corner = turned / area
                inside = np.abs(np.einsum("bin,in->bn", across, corner)) <= threshold_m * (1.0 + 1e-9)
                size = np.hypot(corner[0], corner[1]) * np.cos(descent_rad) + np.abs(corner[2]) * np.sin(descent_rad)
                reached = apart & (inside | ~seen).all(axis=0)
                largest = np.where(reached, np.maximum(largest, size), largest)
    return np.where(bounded, largest, np.inf)


def site_decorrelation(
    baselines: Baselines,
    elevation_rad: FloatArray,
    azimuth_rad: FloatArray,
    noise: CarrierNoise,
    params: EphemerisResidualParams,
    *,
    seen: BoolArray | None = None,
    reference_elevation_rad: float = REFERENCE_ELEVATION_RAD,
    descent_rad: float = float(np.radians(3.0)),
) -> FloatArray:
    """P a site can claim for satellites at places in the sky.

    Parameters
    ----------
    baselines : Baselines
    elevation_rad, azimuth_rad : (N,) arrays
        Places of the satellite.
    noise : CarrierNoise
    params : EphemerisResidualParams
        The first band counts, so that the claim holds for satellites with it alone.
    seen : (B,) bool array, optional
        Baselines that see the satellites; all if it is left out. Thresholds are those of all, as the monitor has them.
    reference_elevation_rad : float
        Elevation of the lowest reference satellite that has to be reckoned with [rad].
    descent_rad : float
        As of :func:`decorrelation`; an approach of 3 degrees.

    Returns
    -------
    (N,) array
        P [m/m]. The minimum detectable error of an orbit, across the line of sight, is P times the range.
    """
    sigma = assumed_sigma_m(baselines, elevation_rad, noise, params, reference_elevation_rad=reference_elevation_rad)
    threshold = (params.multiplier(len(baselines)) + params.k_md) * sigma
    if seen is not None:
        threshold = np.where(seen[:, np.newaxis], threshold, np.nan)
    level = np.cos(elevation_rad)
    los = np.stack([level * np.sin(azimuth_rad), level * np.cos(azimuth_rad), np.sin(elevation_rad)])
    return decorrelation(baselines.vector_m, threshold, los, descent_rad=descent_rad)


def assumed_sigma_m(
    baselines: Baselines,
    elevation_rad: FloatArray,
    noise: CarrierNoise,
    params: EphemerisResidualParams,
    *,
    reference_elevation_rad: float = REFERENCE_ELEVATION_RAD,
) -> FloatArray:
    """Sigma of the first band's double differences that a site's P is reckoned with, ``(B, N)`` [m].

    Parameters are those of :func:`site_decorrelation`.
    """
    factors = noise.factors(len(baselines.place_m))
    scale = np.hypot(factors[baselines.first], factors[baselines.second])[:, np.newaxis]
    sigma = noise.sigma_m(elevation_rad, params.bands[:1])
    reference = noise.sigma_m(np.array([reference_elevation_rad]), params.bands[:1])
    return np.asarray(as_written(differenced_sigma_m)(scale, sigma, reference))


# --- in the station


def _initial(station: PreparedStation) -> EphemerisResidualState:
    return initial_ephemeris_residual(len(station.gradient_site.baselines), station.ephemeris_residual)


def _step(state: EphemerisResidualState, epoch: MonitoredEpoch) -> tuple[EphemerisResidualState, MonitorOutput]:
    """Satellites whose orbits are not bounded are not ready where that is required."""
    inputs, station = epoch.inputs, epoch.inputs.station
    baselines, params = station.gradient_site.baselines, station.ephemeris_residual
    seen = Orbits(epoch.fitting.differences, inputs.due, inputs.shift_m)
    state, result = ephemeris_residual_step(state, seen, baselines, inputs.dt_s, params)
    due, test = inputs.due & (len(baselines) > 0), EPHEMERIS_RESIDUAL.test("residual")
    return state, MonitorOutput(
        summaries={EPHEMERIS_RESIDUAL.key(test.name): summarise(result, due, signal_of(params.bands))},
        satellites=verdicts(params.exclude, test.cause, result, inputs.due, power=1),
        ready=epoch.orbit_bound <= station.largest_decorrelation if station.orbit_required else None,
    )


MONITOR: Final = SignalMonitor(
    entry=EPHEMERIS_RESIDUAL, parameters=EphemerisResidualParams, initial=_initial, step=_step
)
