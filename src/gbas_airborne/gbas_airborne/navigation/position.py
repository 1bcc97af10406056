"""Differential position of one epoch, with everything a protection level needs.

The position is found by Gauss-Newton steps from the last one, or from the station's reference point. Each step forms
lines of sight, tropospheric correction, sigmas and weights anew, so that all belong to the position they lead to.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 2.3.9 to 2.3.12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.modes import product_of
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import RangingSources
from gbas_airborne.reception.station_data import Corrections, StationData
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
from gbas_core.positioning.wls import projection_matrix
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, missing
from gbas_msgs_py.codes import Rejection

# From east, north, up to north, west, up: the frame without an approach (forward, left, up of a north heading).
ROT_NWU_ENU: Final[FloatArray] = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# A last step below this leaves an error far below a millimetre: what depends on the position (troposphere, lines of
# sight) changes by less than a hundredth of the step.
CONVERGED_M: Final = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """What is known before the position is sought.

    Attributes
    ----------
    start_m : (3,) array
        Where to start [m]; anywhere within some hundred kilometres.
    previous_m : (3,) array or None
        Last position, if it is recent enough to tell the speed [m].
    dt_s : float
        How long ago that was [s].
    """

    start_m: FloatArray
    previous_m: FloatArray | None = None
    dt_s: float = math.nan

    def speed_mps(self, position_m: FloatArray, up: FloatArray, otherwise_mps: float) -> float:
        """Horizontal speed at a position [m/s]; `up` is the local vertical there."""
        if self.previous_m is None:
            return otherwise_mps
        moved = position_m - self.previous_m
        horizontal = moved - (moved @ up) * up
        return float(np.sqrt(horizontal @ horizontal)) / self.dt_s


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """Lines of sight and sigmas at one position, of all satellites with an ephemeris, (N_SATS,) arrays."""

    range_m: FloatArray
    los: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    tropo_m: FloatArray
    sigma_air_m: FloatArray
    sigma_tropo_m: FloatArray
    sigma_iono_m: FloatArray
    sigma_m: FloatArray
    rot_enu: FloatArray
    distance_m: float

    @classmethod
    def missing(cls) -> Geometry:
        """That of nowhere."""
        nothing = missing()
        return cls(
            range_m=nothing, los=missing(3), azimuth_rad=nothing, elevation_rad=nothing, tropo_m=nothing,
            sigma_air_m=nothing, sigma_tropo_m=nothing, sigma_iono_m=nothing, sigma_m=nothing,
            rot_enu=np.full((3, 3), np.nan), distance_m=math.nan,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Fix:
    """A weighted least squares position.

    Attributes
    ----------
    used : (N_SATS,) bool array
    position_m : (3,) array
        ECEF [m].
    los : (3, N_SATS) array
        Lines of sight in the approach frame.
    projection : (3 + groups, N_SATS) array
        From ranges to position (approach frame) and clocks; 0 where not used.
    innovation_m : (N_SATS,) array
        Corrected ranges less those predicted where the last step began [m].
    change_m : (3 + groups,) array
        The last step, and the clocks [m].
    """

    used: BoolArray
    position_m: FloatArray
    los: FloatArray
    projection: FloatArray
    innovation_m: FloatArray
    change_m: FloatArray

    def clock_m(self) -> FloatArray:
        """Receiver clock against the corrections of each group of satellites [m]; NaN where none is used."""
        return np.where((CLOCK_GROUPS & self.used).any(axis=1), self.change_m[3:], np.nan)

    def residual_m(self) -> FloatArray:
        """Corrected ranges less their estimates [m]."""
        los = np.where(self.used, self.los, 0.0)
        predicted = self.change_m[3:] @ CLOCK_GROUPS - self.change_m[:3] @ los
        return np.where(self.used, self.innovation_m - predicted, np.nan)

    def leverage(self) -> FloatArray:
        """Share of each range in its own estimate, the diagonal of G S [-]."""
        los, s = np.where(self.used, self.los, 0.0), self.projection
        own: FloatArray = (s[3:] * CLOCK_GROUPS).sum(axis=0) - (s[:3] * los).sum(axis=0)
        return np.where(self.used, own, np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionResult:
    """What became of the search for a position.

    Attributes
    ----------
    sources : RangingSources
    reason : (N_SATS,) int array
        Rejection, with the rules that need a position.
    geometry : Geometry
        Where the search ended.
    fix : Fix or None
        None with too few satellites, too weak a geometry, without convergence, or when the range test cannot be passed.
    range_error_m : (N_SATS,) array
        Error of the satellites the range test excluded [m]; NaN for others.
    """

    sources: RangingSources
    reason: NDArray[np.int64]
    geometry: Geometry = field(default_factory=Geometry.missing)
    fix: Fix | None = None
    range_error_m: FloatArray = field(default_factory=missing)


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionInputs:
    """What is fixed while the position of an epoch is sought."""

    sources: RangingSources
    corrections: Corrections
    station: StationData
    approach: FinalApproach | None
    prior: Prior


def tested_position(inputs: PositionInputs, params: AirborneParams) -> PositionResult:
    """Position of one epoch without the satellites that fail the range test.

    When more fail, or are held out from earlier epochs, than the parameter allows, there is no position: so many faults
    at once are not single faults, and the satellites left may be the wrong ones.
    """
    errors = missing()
    excluded = int(np.count_nonzero(inputs.sources.reason == int(Rejection.RANGE_TEST)))
    while True:
        result = solve(inputs, params)
        worst = worst_range(result.fix, result.geometry.sigma_m, params) if result.fix is not None else None
        if worst is None:
            break
        index, errors[index] = worst
        excluded += 1
        reason = result.reason.copy()
        reason[index] = int(Rejection.RANGE_TEST)
        if excluded > params.range_test_max_exclusions:
            result = replace(result, reason=reason)
            break
        source_reason = np.where(reason == int(Rejection.RANGE_TEST), reason, inputs.sources.reason)
        inputs = replace(inputs, sources=replace(inputs.sources, reason=source_reason))
    fix = result.fix if excluded <= params.range_test_max_exclusions else None
    return replace(result, fix=fix, range_error_m=errors)


def solve(inputs: PositionInputs, params: AirborneParams) -> PositionResult:
    """Position of one epoch, of the sources whose reason is NONE, without a range test."""
    position = inputs.prior.start_m
    for _ in range(params.max_iterations):
        geometry = _geometry(inputs, position, params)
        reason = _reasons(inputs, geometry, params)
        fix = _step(inputs, geometry, reason, position, params)
        moved = fix.position_m - position if fix is not None else np.zeros(3)
        if float(moved @ moved) < CONVERGED_M**2:
            break
        position = position + moved
    else:
        fix = None
    return PositionResult(sources=inputs.sources, reason=reason, geometry=geometry, fix=fix)


def _geometry(inputs: PositionInputs, position: FloatArray, params: AirborneParams) -> Geometry:
    station, sources = inputs.station, inputs.sources
    lat, lon, height = geodetic_from_ecef(position)
    rot_enu = rot_enu_ecef(lat, lon)
    range_m, los = rotated_range(position, sources.satellite_m)
    azimuth, elevation = azimuth_elevation(rot_enu @ los)
    baseline = position - station.reference_ecef_m
    distance = float(np.sqrt(baseline @ baseline))
    height_above = float(height) - station.reference_height_m
    mask = params.elevation_mask_rad
    speed_mps = inputs.prior.speed_mps(position, rot_enu[2], params.max_speed_mps)
    noise = np.hypot(
        sigma_noise_air(params.aad, elevation, mask_rad=mask), sigma_multipath_air(elevation, mask_rad=mask)
    )
    air = noise * sources.noise_factor
    scale = station.scale_height_m
    tropo = tropo_correction_m(station.refractivity, scale, elevation, height_above, mask_rad=mask)
    sigma_tropo = sigma_tropo_m(station.refractivity_uncertainty, scale, elevation, height_above, mask_rad=mask)
    # Corrections are smoothed over their product's time, whatever the aircraft does.
    tau_s = max(sources.mode.smoothing_s, product_of(sources.mode).smoothing_s)
    iono = sigma_iono_m(station.sigma_vig, elevation, distance, speed_mps, tau_s, mask_rad=mask)
    gnd = inputs.corrections.sigma_m
    return Geometry(
        range_m=range_m,
        los=los,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        tropo_m=tropo,
        sigma_air_m=air,
        sigma_tropo_m=sigma_tropo,
        sigma_iono_m=iono,
        sigma_m=np.sqrt(gnd**2 + air**2 + sigma_tropo**2 + iono**2),
        rot_enu=rot_enu,
        distance_m=distance,
    )


def _reasons(inputs: PositionInputs, geometry: Geometry, params: AirborneParams) -> NDArray[np.int64]:
    """Reasons with those that need the position: distance, elevation, a missing sigma."""
    reason = inputs.sources.reason
    candidate = reason == int(Rejection.NONE)
    if not geometry.distance_m <= inputs.station.d_max_m:
        return np.where(candidate, int(Rejection.DISTANCE), reason)
    low = candidate & (geometry.elevation_rad < params.elevation_mask_rad)
    without = ~np.isfinite(geometry.sigma_m + geometry.tropo_m + inputs.sources.range_m) | ~(geometry.sigma_m > 0.0)
    reason = np.where(candidate & without, int(Rejection.SIGMA), reason)
    return np.where(low, int(Rejection.ELEVATION), reason)


def _step(
    inputs: PositionInputs,
    geometry: Geometry,
    reason: NDArray[np.int64],
    position: FloatArray,
    params: AirborneParams,
) -> Fix | None:
    """The position one step from another; None when the geometry is too weak."""
    used = reason == int(Rejection.NONE)
    approach = inputs.approach
    rot = approach.rot_approach_ecef if approach is not None else ROT_NWU_ENU @ geometry.rot_enu
    los = rot @ geometry.los
    sigma = np.where(used, geometry.sigma_m, np.nan)
    projection = projection_matrix(los, sigma, CLOCK_GROUPS, max_condition=params.max_condition)
    if projection is None:
        return None
    innovation = np.where(used, inputs.sources.range_m + geometry.tropo_m - geometry.range_m, 0.0)
    change = projection @ innovation
    return Fix(
        used=np.asarray(used),
        position_m=position + rot.T @ change[:3],
        los=los,
        projection=projection,
        innovation_m=innovation,
        change_m=change,
    )


def worst_range(fix: Fix, sigma_m: FloatArray, params: AirborneParams) -> tuple[int, float] | None:
    """The satellite that fails the range test worst, and the error its residual speaks for [m]; None when all pass.

    A residual r of a satellite with leverage h (diagonal of G S) speaks for an error of r / (1 - h), the deletion
    residual; that is tested against its own sigma, sigma / sqrt(1 - h), and against a floor. A satellite without
    redundancy (h = 1) cannot be tested.

    Source: Annex 10 asks for no airborne range test in GAST-C; this one is ours, a net for gross errors. Baarda's test
    (Baarda, A testing procedure for use in geodetic networks, 1968).
    """
    redundancy = 1.0 - fix.leverage()
    testable = fix.used & (redundancy > 1e-6)
    if not testable.any():
        return None
    safe = np.where(testable, redundancy, 1.0)
    error = np.where(testable, np.abs(fix.residual_m()) / safe, 0.0)
    normalised = np.where(testable, error * np.sqrt(safe) / np.where(testable, sigma_m, 1.0), 0.0)
    failed = (normalised > params.range_test_sigma) & (error > params.range_test_floor_m)
    if not failed.any():
        return None
    index = int(np.where(failed, normalised, 0.0).argmax())
    return index, float(error[index])
