"""Differential position of one epoch, with everything a protection level needs.

The position is found by Gauss-Newton steps from the last one, or from the station's reference point. Each step forms
lines of sight, tropospheric correction, sigmas and weights anew, so that all belong to the position they lead to.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 2.3.9 to 2.3.12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import RangingSources, Rejection
from gbas_airborne.reception.vdb_messages import Corrections, StationData
from gbas_core.gnss.frames import azimuth_elevation, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import rotated_range
from gbas_core.models.error_models import (
    sigma_iono_m,
    sigma_multipath_air,
    sigma_noise_air,
    sigma_tropo_m,
    tropo_correction_m,
)
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.ranging.smoothing import TAU_100_S
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, missing

# From east, north, up to north, west, up: the frame without an approach (forward, left, up of a north heading).
ROT_NWU_ENU: Final[FloatArray] = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# A last step below this leaves an error far below a millimetre: what depends on the position (troposphere, lines of
# sight) changes by less than a hundredth of the step.
CONVERGED_M: Final = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionInputs:
    """What is fixed while the position of an epoch is sought."""

    sources: RangingSources
    corrections: Corrections
    station: StationData
    approach: FinalApproach | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Speed:
    """What the horizontal speed is estimated from: the last position, how long ago, and what to assume without."""

    previous_ecef_m: FloatArray | None
    dt_s: float
    otherwise_mps: float

    def at(self, position_ecef_m: FloatArray, up_ecef: FloatArray) -> float:
        """Horizontal speed at a position [m/s]; `up_ecef` is the local vertical."""
        if self.previous_ecef_m is None:
            return self.otherwise_mps
        moved = position_ecef_m - self.previous_ecef_m
        horizontal = moved - (moved @ up_ecef) * up_ecef
        return float(np.sqrt(horizontal @ horizontal)) / self.dt_s


@dataclass(frozen=True, kw_only=True, eq=False)
class Fix:
    """A position and its per-satellite numbers, (N_SATS,) arrays, NaN (projection: 0) where not used."""

    position_m: FloatArray
    clock_m: FloatArray
    reason: NDArray[np.int64]
    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    projection: FloatArray
    s_vert: FloatArray
    s_lat: FloatArray
    sigma_gnd_m: FloatArray
    sigma_air_m: FloatArray
    sigma_tropo_m: FloatArray
    sigma_iono_m: FloatArray
    sigma_m: FloatArray
    residual_m: FloatArray
    leverage: FloatArray
    distance_m: float
    speed_mps: float

    @property
    def used(self) -> BoolArray:
        """Satellites the position is made of."""
        return np.asarray(self.reason == int(Rejection.NONE))


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionResult:
    """What became of the search for a position.

    Attributes
    ----------
    fix : Fix or None
        None with too few satellites, too weak a geometry, without convergence, or when the range test cannot be passed.
    reason : (N_SATS,) int array
        Rejection, with the rules that need a position.
    elevation_rad : (N_SATS,) array
        Elevation of all satellites with an ephemeris [rad].
    distance_m : float
        Slant distance to the station's reference point [m].
    range_error_m : (N_SATS,) array
        Error of the satellites the range test excluded [m]; NaN for others.
    """

    fix: Fix | None
    reason: NDArray[np.int64]
    elevation_rad: FloatArray = field(default_factory=missing)
    distance_m: float = math.nan
    range_error_m: FloatArray = field(default_factory=missing)


class _Step(NamedTuple):
    """One Gauss-Newton step, in the approach frame."""

    position_m: FloatArray
    reason: NDArray[np.int64]
    los: FloatArray
    sigma_m: FloatArray
    projection: FloatArray
    innovation_m: FloatArray
    change_m: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sky:
    """Geometry and sigmas at one trial position."""

    range_m: FloatArray
    los_ecef: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    tropo_m: FloatArray
    sigma_air_m: FloatArray
    sigma_tropo_m: FloatArray
    sigma_iono_m: FloatArray
    sigma_m: FloatArray
    rot_enu: FloatArray
    distance_m: float
    speed_mps: float


def tested_position(
    inputs: PositionInputs, start_ecef_m: FloatArray, speed: Speed, params: AirborneParams
) -> PositionResult:
    """Position of one epoch without the satellites that fail the range test; arguments as :func:`solve`.

    When more fail, or are held out from earlier epochs, than the parameter allows, there is no position: so many faults
    at once are not single faults, and the satellites left may be the wrong ones.
    """
    errors = missing()
    excluded = int(np.count_nonzero(inputs.sources.reason == int(Rejection.RANGE_TEST)))
    while True:
        attempt = solve(inputs, start_ecef_m, speed, params)
        worst = worst_range(attempt.fix, params) if attempt.fix is not None else None
        if worst is None:
            break
        index, errors[index] = worst
        excluded += 1
        reason = attempt.reason.copy()
        reason[index] = int(Rejection.RANGE_TEST)
        if excluded > params.range_test_max_exclusions:
            attempt = replace(attempt, reason=reason)
            break
        source_reason = np.where(reason == int(Rejection.RANGE_TEST), reason, inputs.sources.reason)
        inputs = replace(inputs, sources=replace(inputs.sources, reason=source_reason))
    fix = attempt.fix if excluded <= params.range_test_max_exclusions else None
    return replace(attempt, fix=fix, range_error_m=errors)


def solve(inputs: PositionInputs, start_ecef_m: FloatArray, speed: Speed, params: AirborneParams) -> PositionResult:
    """Position of one epoch.

    Parameters
    ----------
    inputs : PositionInputs
        Satellites whose reason is NONE are candidates.
    start_ecef_m : (3,) array
        Where to start [m]; anywhere within some hundred kilometres.
    speed : Speed
    params : AirborneParams

    Returns
    -------
    PositionResult
        Without a range test.
    """
    position = start_ecef_m
    for _ in range(params.max_iterations):
        sky = _sky(inputs, position, speed, params)
        reason = _reasons(inputs, sky, params)
        step = _step(inputs, sky, position, reason, params)
        moved = step.position_m - position if step is not None else np.zeros(3)
        if float(moved @ moved) < CONVERGED_M**2:
            break
        position = position + moved
    else:
        step = None
    fix = _fix(inputs, sky, step) if step is not None else None
    return PositionResult(fix=fix, reason=reason, elevation_rad=sky.elevation_rad, distance_m=sky.distance_m)


def _sky(inputs: PositionInputs, position: FloatArray, speed: Speed, params: AirborneParams) -> _Sky:
    station, sources = inputs.station, inputs.sources
    lat, lon, height = geodetic_from_ecef(position)
    rot_enu = rot_enu_ecef(lat, lon)
    range_m, los = rotated_range(position, sources.satellite_m)
    azimuth, elevation = azimuth_elevation(rot_enu @ los)
    baseline = position - station.reference_ecef_m
    distance = float(np.sqrt(baseline @ baseline))
    height_above = float(height) - station.reference_height_m
    mask = params.elevation_mask_rad
    speed_mps = speed.at(position, rot_enu[2])
    noise = np.hypot(
        sigma_noise_air(params.aad, elevation, mask_rad=mask), sigma_multipath_air(elevation, mask_rad=mask)
    )
    air = noise * sources.noise_factor
    scale = station.scale_height_m
    tropo = tropo_correction_m(station.refractivity, scale, elevation, height_above, mask_rad=mask)
    sigma_tropo = sigma_tropo_m(station.refractivity_uncertainty, scale, elevation, height_above, mask_rad=mask)
    # The ground's corrections are smoothed over 100 s, whatever the aircraft does.
    tau_s = max(params.smoothing_tau_s, TAU_100_S)
    iono = sigma_iono_m(station.sigma_vig, elevation, distance, speed_mps, tau_s, mask_rad=mask)
    gnd = inputs.corrections.sigma_m
    return _Sky(
        range_m=range_m,
        los_ecef=los,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        tropo_m=tropo,
        sigma_air_m=air,
        sigma_tropo_m=sigma_tropo,
        sigma_iono_m=iono,
        sigma_m=np.sqrt(gnd**2 + air**2 + sigma_tropo**2 + iono**2),
        rot_enu=rot_enu,
        distance_m=distance,
        speed_mps=speed_mps,
    )


def _reasons(inputs: PositionInputs, sky: _Sky, params: AirborneParams) -> NDArray[np.int64]:
    """Reasons with those that need the position: distance, elevation, a missing sigma."""
    reason = inputs.sources.reason
    candidate = reason == int(Rejection.NONE)
    if not sky.distance_m <= inputs.station.d_max_m:
        return np.where(candidate, int(Rejection.DISTANCE), reason)
    low = candidate & (sky.elevation_rad < params.elevation_mask_rad)
    without = ~np.isfinite(sky.sigma_m + sky.tropo_m + inputs.sources.range_m) | ~(sky.sigma_m > 0.0)
    reason = np.where(candidate & without, int(Rejection.SIGMA), reason)
    return np.where(low, int(Rejection.ELEVATION), reason)


def _step(
    inputs: PositionInputs, sky: _Sky, position: FloatArray, reason: NDArray[np.int64], params: AirborneParams
) -> _Step | None:
    """The step from a position; None when the geometry is too weak."""
    used = reason == int(Rejection.NONE)
    approach = inputs.approach
    rot = approach.rot_approach_ecef if approach is not None else ROT_NWU_ENU @ sky.rot_enu
    los = rot @ sky.los_ecef
    sigma = np.where(used, sky.sigma_m, np.nan)
    projection = projection_matrix(los, sigma, CLOCK_GROUPS, max_condition=params.max_condition)
    if projection is None:
        return None
    innovation = np.where(used, inputs.sources.range_m + sky.tropo_m - sky.range_m, 0.0)
    change = projection @ innovation
    return _Step(position + rot.T @ change[:3], reason, los, sigma, projection, innovation, change)


def _fix(inputs: PositionInputs, sky: _Sky, step: _Step) -> Fix:
    """The position a last step leads to, with all a protection level and the range test need."""
    used = step.reason == int(Rejection.NONE)
    approach, projection, change = inputs.approach, step.projection, step.change_m
    los0 = np.where(used, step.los, 0.0)
    predicted = change[3:] @ CLOCK_GROUPS - change[:3] @ los0
    leverage = (projection[3:] * CLOCK_GROUPS).sum(axis=0) - (projection[:3] * los0).sum(axis=0)
    s_vert, s_lat = vertical_lateral(projection, approach.gpa_rad if approach is not None else 0.0)

    def only(values: FloatArray) -> FloatArray:
        return np.where(used, values, np.nan)

    return Fix(
        position_m=step.position_m,
        clock_m=np.where((CLOCK_GROUPS & used).any(axis=1), change[3:], np.nan),
        reason=step.reason,
        azimuth_rad=only(sky.azimuth_rad),
        elevation_rad=only(sky.elevation_rad),
        projection=projection,
        s_vert=only(s_vert),
        s_lat=only(s_lat),
        sigma_gnd_m=only(inputs.corrections.sigma_m),
        sigma_air_m=only(sky.sigma_air_m),
        sigma_tropo_m=only(sky.sigma_tropo_m),
        sigma_iono_m=only(sky.sigma_iono_m),
        sigma_m=step.sigma_m,
        residual_m=only(step.innovation_m - predicted),
        leverage=only(leverage),
        distance_m=sky.distance_m,
        speed_mps=sky.speed_mps,
    )


def worst_range(fix: Fix, params: AirborneParams) -> tuple[int, float] | None:
    """The satellite that fails the range test worst, and the error its residual speaks for [m]; None when all pass.

    A residual r of a satellite with leverage h (diagonal of G S) speaks for an error of r / (1 - h), the deletion
    residual; that is tested against its own sigma, sigma / sqrt(1 - h), and against a floor. A satellite without
    redundancy (h = 1) cannot be tested.

    Source: Annex 10 asks for no airborne range test in GAST-C; this one is ours, a net for gross errors. Baarda's test
    (Baarda, A testing procedure for use in geodetic networks, 1968).
    """
    redundancy = 1.0 - fix.leverage
    testable = fix.used & (redundancy > 1e-6)
    if not testable.any():
        return None
    safe = np.where(testable, redundancy, 1.0)
    error = np.where(testable, np.abs(fix.residual_m) / safe, 0.0)
    normalised = np.where(testable, error * np.sqrt(safe) / np.where(testable, fix.sigma_m, 1.0), 0.0)
    failed = (normalised > params.range_test_sigma) & (error > params.range_test_floor_m)
    if not failed.any():
        return None
    index = int(np.where(failed, normalised, 0.0).argmax())
    return index, float(error[index])
