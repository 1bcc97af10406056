# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Positions of all modes of an epoch: Gauss-Newton steps and the range test. Missing is NaN: it never passes a rule.

The first axis of arrays is the mode. What is found at a position is a row of ``sky`` (rows, N), see the constants.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 2.3.9 to 2.3.12.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.gnss.kernels.frames import azimuth_elevation, fill_enu, geodetic
from gbas_core.gnss.kernels.orbits import rotated_range
from gbas_core.models import error_models as model
from gbas_core.models.error_models import EDGE_DEG
from gbas_core.positioning.kernels.wls import project
from gbas_core.record import FloatArray
from gbas_msgs_py.codes import Rejection

RANGE, AZIMUTH, ELEVATION, TROPO, SIGMA_AIR, SIGMA_TROPO, SIGMA_IONO, SIGMA, INNOVATION, RESIDUAL, RANGE_ERROR = range(
    11
)
ROWS: Final = 11
"""Rows of the sky: range, directions, tropospheric correction, sigmas of parts for levels and of all for weights,
corrected range less that predicted where the last step began and less its estimate, error of a satellite that the range
test excluded.
"""
CONVERGED_M: Final = 0.05
"""A last step below this leaves an error far below a millimetre: what depends on the position (troposphere, lines of
sight) changes by less than a hundredth of the step."""
_LEAST_REDUNDANCY: Final = 1e-6
LEVELS, WEIGHTS = range(2)
"""Families of sigmas."""
_NONE, _DISTANCE, _SIGMA = int(Rejection.NONE), int(Rejection.DISTANCE), int(Rejection.SIGMA)
_ELEVATION, _RANGE_TEST = int(Rejection.ELEVATION), int(Rejection.RANGE_TEST)


class Conditions(NamedTuple):
    """What is the same for all modes: the station's data and the receiver's settings."""

    height_m: float
    d_max_m: float
    refractivity: float
    refractivity_uncertainty: float
    scale_height_m: float
    mask_rad: float
    assumed_mps: float
    max_condition: float
    max_iterations: int
    test_sigma: float
    test_floor_m: float
    max_exclusions: int


@compiled
def own_speed_mps(position_m, previous_m, dt_s, up, assumed_mps):
    """Horizontal speed since the previous position; the assumed one without (NaN)."""
    if np.isnan(previous_m[0]):
        return assumed_mps
    rising = square = 0.0
    for axis in range(3):
        rising += (position_m[axis] - previous_m[axis]) * up[axis]
    for axis in range(3):
        square += (position_m[axis] - previous_m[axis] - rising * up[axis]) ** 2
    return np.sqrt(square) / dt_s


class ErrorModel(NamedTuple):
    """What a mode's sigmas are made of beside the corrections'.

    Attributes
    ----------
    coefficient : (C,) array
        Factors of the signals in the range; 0 for one that is not there.
    curves : (2, groups, C, 6) array
        Coefficients a0, a1 [m] and theta0 [deg] of airborne noise, and of multipath; for levels and for weights.
    gradient : float
        sigma_vig on L1 [m/m].
    iono_factor, tau_s : float
        Ionospheric delay over that on L1, and time constant of sigma_iono [s].
    """

    coefficient: FloatArray
    curves: FloatArray
    gradient: float
    iono_factor: float
    tau_s: float


@compiled
def air_sigma_m(theta_deg, coefficient, curves, noise_factor, s):
    """Airborne noise and multipath of a range [m]; signals are independent.

    Factors and curves of the signals ``(C,)``, ``(C, 6)``; factors on their sigmas ``(C, N)``.
    """
    total = 0.0
    for c in range(coefficient.shape[0]):
        if coefficient[c] == 0.0:
            continue
        a = curves[c]
        own_m = np.hypot(model.curve_m(theta_deg, a[0], a[1], a[2]), model.curve_m(theta_deg, a[3], a[4], a[5]))
        if coefficient[1] == 0.0:
            return own_m * noise_factor[c, s]
        total += (coefficient[c] * own_m * noise_factor[c, s]) ** 2
    return np.sqrt(total)


@compiled
def look(
    position_m, reference_m, satellite_m, noise_factor, sigma_gnd_m, previous_m, dt_s, models, group, given, sky, los,
    rot,
):  # fmt: skip
    """Fill in the sky at a position, lines of sight ``(3, N)`` and local axes; returns the distance to the station."""
    latitude, longitude, height_m = geodetic(position_m[0], position_m[1], position_m[2])
    fill_enu(latitude, longitude, rot)
    square = 0.0
    for axis in range(3):
        square += (position_m[axis] - reference_m[axis]) ** 2
    distance_m, above_m = np.sqrt(square), height_m - given.height_m
    speed_mps = own_speed_mps(position_m, previous_m, dt_s, rot[2], given.assumed_mps)
    scale_m = given.scale_height_m if given.scale_height_m > 0.0 else np.nan
    known = models.gradient >= 0.0 and distance_m >= 0.0 and speed_mps >= 0.0 and models.tau_s >= 0.0
    gradient = models.gradient if known else np.nan
    for s in range(satellite_m.shape[1]):
        sky[:, s] = np.nan
        if np.isnan(satellite_m[0, s]):
            los[0, s] = los[1, s] = los[2, s] = np.nan
            continue
        range_m, x, y, z = rotated_range(position_m, satellite_m[0, s], satellite_m[1, s], satellite_m[2, s])
        los[0, s], los[1, s], los[2, s] = x, y, z
        azimuth, elevation = azimuth_elevation(rot, x, y, z)
        sky[RANGE, s], sky[AZIMUTH, s], sky[ELEVATION, s] = range_m, azimuth, elevation
        theta_deg = np.rad2deg(elevation)
        if not theta_deg >= np.rad2deg(given.mask_rad) - EDGE_DEG:
            continue
        curves = models.curves[:, group[s]]
        air_m = air_sigma_m(theta_deg, models.coefficient, curves[LEVELS], noise_factor[LEVELS], s)
        air_weight_m = air_sigma_m(theta_deg, models.coefficient, curves[WEIGHTS], noise_factor[WEIGHTS], s)
        sine = np.sin(np.deg2rad(theta_deg))
        tropo_m = abs(model.tropo_m(given.refractivity_uncertainty, scale_m, sine, above_m))
        iono_m = models.iono_factor * model.iono_m(
            model.obliquity(np.deg2rad(theta_deg)), gradient, distance_m, speed_mps, models.tau_s
        )
        sky[TROPO, s] = model.tropo_m(given.refractivity, scale_m, sine, above_m)
        sky[SIGMA_AIR, s], sky[SIGMA_TROPO, s], sky[SIGMA_IONO, s] = air_m, tropo_m, iono_m
        weight_m = np.sqrt(sigma_gnd_m[WEIGHTS, s] ** 2 + air_weight_m**2 + tropo_m**2 + iono_m**2)
        # what the levels lack, the weights lack
        sky[SIGMA, s] = weight_m if np.isfinite(sigma_gnd_m[LEVELS, s] + air_m) else np.nan
    return distance_m


@compiled
def add_reasons(source_reason, range_m, sky, distance_m, given, reason):
    """Reasons with those that need the position: distance, elevation, a missing sigma."""
    for s in range(reason.shape[0]):
        reason[s] = source_reason[s]
        if reason[s] != _NONE:
            continue
        if not distance_m <= given.d_max_m:
            reason[s] = _DISTANCE
        elif sky[ELEVATION, s] < given.mask_rad:
            reason[s] = _ELEVATION
        elif not (np.isfinite(sky[SIGMA, s] + sky[TROPO, s] + range_m[s]) and sky[SIGMA, s] > 0.0):
            reason[s] = _SIGMA


@compiled
def turn(rot, los, turned):
    """Fill in lines of sight in other axes."""
    for s in range(los.shape[1]):
        for axis in range(3):
            turned[axis, s] = rot[axis, 0] * los[0, s] + rot[axis, 1] * los[1, s] + rot[axis, 2] * los[2, s]


@compiled
def step(reason, range_m, sky, los, group, given, projection, change_m):
    """Fill in the projection, the innovations and the change of position and clocks; False with too weak a geometry."""
    n_sats, n_unknowns = reason.shape[0], change_m.shape[0]
    sigma_m = np.full(n_sats, np.nan)
    for s in range(n_sats):
        sky[INNOVATION, s] = 0.0
        if reason[s] == _NONE:
            sigma_m[s] = sky[SIGMA, s]
            sky[INNOVATION, s] = range_m[s] + sky[TROPO, s] - sky[RANGE, s]
    if not project(los, sigma_m, group, n_unknowns - 3, given.max_condition, projection):
        return False
    for row in range(n_unknowns):
        change_m[row] = 0.0
        for s in range(n_sats):
            change_m[row] += projection[row, s] * sky[INNOVATION, s]
    return True


@compiled
def find_worst(reason, sky, los, group, projection, change_m, given):
    """Fill in the residuals; the satellite that fails the range test worst, and its error [m]; -1 when all pass.

    A residual r of a satellite with leverage h (diagonal of G S) speaks for an error of r / (1 - h), the deletion
    residual; that is tested against its own sigma, sigma / sqrt(1 - h), and against a floor. A satellite without
    redundancy (h = 1) cannot be tested.

    Source: Annex 10 asks for no airborne range test in GAST-C; this one is ours, a net for gross errors. Baarda's test
    (Baarda, A testing procedure for use in geodetic networks, 1968).
    """
    worst, largest, worst_m = -1, 0.0, 0.0
    for s in range(reason.shape[0]):
        if reason[s] != _NONE:
            continue
        clock = 3 + group[s]
        predicted_m, leverage = change_m[clock], projection[clock, s]
        for axis in range(3):
            predicted_m -= change_m[axis] * los[axis, s]
            leverage -= projection[axis, s] * los[axis, s]
        sky[RESIDUAL, s] = sky[INNOVATION, s] - predicted_m
        redundancy = 1.0 - leverage
        if not redundancy > _LEAST_REDUNDANCY:
            continue
        error_m = abs(sky[RESIDUAL, s]) / redundancy
        normalised = error_m * np.sqrt(redundancy) / sky[SIGMA, s]
        if normalised > given.test_sigma and error_m > given.test_floor_m and normalised > largest:
            worst, largest, worst_m = s, normalised, error_m
    return worst, worst_m


@compiled
def solve(
    position_m, source_reason, range_m, satellite_m, noise_factor, sigma_gnd_m, reference_m, previous_m, dt_s, models,
    rot_approach, group, given, reason, sky, projection, change_m, los,
):  # fmt: skip
    """Position of one mode without a range test, in ``position_m`` (the last one when there is none); whether there is
    one, and the distance to the station.

    ``rot_approach`` (3, 3) is NaN without an approach: axes are then north, west, up.
    """
    rot_enu, rot, los_ecef = np.empty((3, 3)), rot_approach.copy(), np.empty(los.shape)
    distance_m = np.nan
    for _ in range(given.max_iterations):
        distance_m = look(
            position_m, reference_m, satellite_m, noise_factor, sigma_gnd_m, previous_m, dt_s, models, group,
            given, sky, los_ecef, rot_enu,
        )  # fmt: skip
        add_reasons(source_reason, range_m, sky, distance_m, given, reason)
        if np.isnan(rot_approach[0, 0]):
            rot[0], rot[1], rot[2] = rot_enu[1], -rot_enu[0], rot_enu[2]
        turn(rot, los_ecef, los)
        if not step(reason, range_m, sky, los, group, given, projection, change_m):
            return False, distance_m
        square = 0.0
        for axis in range(3):
            moved = rot[0, axis] * change_m[0] + rot[1, axis] * change_m[1] + rot[2, axis] * change_m[2]
            position_m[axis] += moved
            square += moved**2
        if square < CONVERGED_M**2:
            return True, distance_m
    return False, distance_m


@compiled
def tested_positions(
    start_m, source_reason, range_m, satellite_m, noise_factor, sigma_gnd_m, reference_m, previous_m, dt_s, coefficient,
    curves, iono, rot_approach, group, n_groups, given,
):  # fmt: skip
    """Positions without the satellites that fail the range test.

    When more fail, or are held out from earlier epochs, than the parameter allows, there is no position: so many faults
    at once are not single faults, and the satellites left may be the wrong ones.

    Parameters
    ----------
    start_m, previous_m : (M, 3) arrays
        Where to start; the last position, NaN if it cannot tell the speed [m].
    source_reason : (M, N) int array
        Why a satellite cannot be used; NONE where it can.
    range_m : (M, N) array
    noise_factor, sigma_gnd_m : (M, 2, C, N), (M, 2, N) arrays
        Of levels and weights.
    satellite_m : (M, 3, N) array
    reference_m : (3,) array
    dt_s : (M,) array
        Time since the previous position [s].
    coefficient, curves, iono : (M, C), (M, 2, groups, C, 6), (M, 3) arrays
        Fields of :class:`ErrorModel`, the last three of them in ``iono``.
    rot_approach : (3, 3) array
    group : (N,) int array
        Clock of each satellite.
    given : Conditions

    Returns
    -------
    found : (M,) bool array
    position_m : (M, 3) array
    distance_m : (M,) array
        To the station.
    reason : (M, N) int array
    sky : (M, ROWS, N) array
    projection : (M, 3 + groups, N) array
    clock_m : (M, groups) array
        NaN for a group that is not used.
    """
    n_modes, n_sats = range_m.shape
    found, position_m, distance_m = np.zeros(n_modes, np.bool_), np.empty((n_modes, 3)), np.empty(n_modes)
    reason, sky = np.empty(source_reason.shape, np.int64), np.empty((n_modes, ROWS, n_sats))
    projection, clock_m = np.empty((n_modes, 3 + n_groups, n_sats)), np.full((n_modes, n_groups), np.nan)
    change_m, los = np.empty(3 + n_groups), np.empty((3, n_sats))
    for m in range(n_modes):
        models = ErrorModel(coefficient[m], curves[m], iono[m, 0], iono[m, 1], iono[m, 2])
        sources, errors_m = source_reason[m].copy(), np.full(n_sats, np.nan)
        excluded = np.count_nonzero(sources == _RANGE_TEST)
        while True:
            position_m[m] = start_m[m]
            found[m], distance_m[m] = solve(
                position_m[m], sources, range_m[m], satellite_m[m], noise_factor[m], sigma_gnd_m[m], reference_m,
                previous_m[m], dt_s[m], models, rot_approach, group, given, reason[m], sky[m], projection[m],
                change_m, los,
            )  # fmt: skip
            if not found[m]:
                break
            worst, error_m = find_worst(reason[m], sky[m], los, group, projection[m], change_m, given)
            if worst < 0:
                break
            errors_m[worst] = error_m
            reason[m, worst] = sources[worst] = _RANGE_TEST
            excluded += 1
            if excluded > given.max_exclusions:
                break
        found[m] = found[m] and excluded <= given.max_exclusions
        sky[m, RANGE_ERROR] = errors_m
        for s in range(n_sats):
            if reason[m, s] == _NONE:
                clock_m[m, group[s]] = change_m[3 + group[s]]
    return found, position_m, distance_m, reason, sky, projection, clock_m
