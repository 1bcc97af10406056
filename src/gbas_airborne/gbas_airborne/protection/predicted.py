"""Predicted protection levels along a planned path: PVPL, PLPL, and whether an approach can be flown as planned.

What is predicted is the fault-free and the receiver fault level with B values of zero, and the ephemeris bound, of the
satellites that will be there: those in the ephemerides, above the mask, and not lost by the plan, by the station's own
word (type 5 messages) or by what stands in the way. D_V and D_L are what the future brings: they are left out.

Source: RTCA DO-253 (predicted levels, approach service); ICAO Annex 10 vol. I, App. B 3.6.5.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from gbas_airborne.modes import air_model, processing_of
from gbas_airborne.params import AirborneParams
from gbas_airborne.protection.levels import Multipliers
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import azimuth_elevation, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.models.error_models import AirborneCurve, airborne_curve_m, sigma_iono_m, sigma_tropo_m
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS, SOURCE_ID_INDEX, satellites_of
from gbas_msgs_py.codes import ServiceType
from gbas_msgs_py.modes import Mode
from gbas_vdb.messages.types import Type5

_LEVELS: Final = 0
LONGEST_S: Final = 1270.0
"""Longest time a type 5 message can tell."""
_NONE: Final = np.full(2, np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPath:
    """Where the aircraft will be: n points in the order of time.

    Attributes
    ----------
    gps_week : int
    tow_s : (n,) array
        When, may go beyond the week [s].
    position_m : (n, 3) array
        ECEF [m].
    speed_mps : (n,) array
        Horizontal [m/s].
    lost : (n, N_SATS) bool array
        Satellites that will not be there: :func:`lost_by_type5`, terrain, a planned outage, a bank.
    """

    gps_week: int
    tow_s: FloatArray
    position_m: FloatArray
    speed_mps: FloatArray
    lost: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ExpectedStation:
    """What the station is expected to send.

    Attributes
    ----------
    reference_m : (3,) array
        Reference point, ECEF [m].
    n_receivers : int
        Behind every correction.
    sigma_gnd_m : mapping by product
        Sigma of each set of corrections that the mode applies, and of each its levels are of, ``(N_SATS,)`` [m].
    sigma_vig : float
        [m/m].
    refractivity_uncertainty, scale_height_m : float
        As in type 2 messages [-, m].
    p, k_md_e : float
        Of the ephemeris bound [m/m, -].
    """

    reference_m: FloatArray
    n_receivers: int
    sigma_gnd_m: dict[str, FloatArray]
    sigma_vig: float
    refractivity_uncertainty: float
    scale_height_m: float
    p: float
    k_md_e: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedLevels:
    """Of each point of the path, (n,) arrays; NaN where the geometry gives no position, or what is asked is missing.

    `used` is ``(n, N_SATS)``; limits are NaN without an approach.
    """

    pvpl_m: FloatArray
    plpl_m: FloatArray
    veb_m: FloatArray
    leb_m: FloatArray
    val_m: FloatArray
    lal_m: FloatArray
    used: BoolArray

    @property
    def available(self) -> BoolArray:
        """Where levels and bounds are within the limits, (n,)."""
        vertical = (self.pvpl_m <= self.val_m) & (self.veb_m <= self.val_m)
        return vertical & (self.plpl_m <= self.lal_m) & (self.leb_m <= self.lal_m)


class Planned(NamedTuple):
    """What is planned, and what is expected of satellites, station and receiver.

    The axes of levels are those of the approach; without one they are north, west and up at each point.
    """

    path: PlannedPath
    ephemeris: Ephemeris
    station: ExpectedStation
    mode: Mode
    params: AirborneParams
    approach: FinalApproach | None = None


def predicted_levels(planned: Planned) -> PredictedLevels:
    """Protection levels, ephemeris bounds and alert limits along a path."""
    path, approach = planned.path, planned.approach
    points = [_point(planned, k) for k in range(len(path.tow_s))]
    numbers = np.array([levels for levels, _ in points]).reshape(-1, 2, 2)
    val_m = lal_m = np.full(len(points), np.nan)
    if approach is not None:
        val_m, lal_m = approach.limits(approach.deviations(path.position_m))
    return PredictedLevels(
        pvpl_m=numbers[:, 0, 0],
        plpl_m=numbers[:, 0, 1],
        veb_m=numbers[:, 1, 0],
        leb_m=numbers[:, 1, 1],
        val_m=val_m,
        lal_m=lal_m,
        used=np.array([used for _, used in points]),
    )


def critical_satellites(planned: Planned) -> BoolArray:
    """Satellites any one of whose loss ends the availability of the approach at some point, ``(N_SATS,)``.

    The continuity of an approach that begins is that of these. All that are used are critical where it is not available
    to begin with.
    """
    critical = np.zeros(N_SATS, dtype=bool)
    for index in np.flatnonzero(predicted_levels(planned).used.any(axis=0)):
        lost = planned.path.lost.copy()
        lost[:, index] = True
        without = planned._replace(path=replace(planned.path, lost=lost))
        critical[index] = not predicted_levels(without).available.all()
    return critical


def lost_by_type5(message: Type5, since_s: FloatArray) -> BoolArray:
    """Satellites a station will not correct, ``(n, N_SATS)``, at times after its message's instant ``(n,)`` [s].

    One that ceases is lost from its time on, one that becomes available before its. The longest time of the message
    says "or more": nothing is known to change. Sources the suite does not know are left out.

    Source: ICAO Annex 10 vol. I, App. B 3.6.4.6.
    """
    lost = np.zeros((len(since_s), N_SATS), dtype=bool)
    for source in message.sources:
        index = SOURCE_ID_INDEX.get(source.ranging_source_id)
        if index is not None:
            later = (since_s >= source.duration_s) & (source.duration_s < LONGEST_S)
            lost[:, index] = ~later if source.becomes_available else later
    return lost


def _point(planned: Planned, k: int) -> tuple[FloatArray, BoolArray]:
    """Levels and bounds ``(2, 2)`` at one point, vertical and lateral, and the satellites used."""
    path, ephemeris, station, mode, params, approach = planned
    place_m = path.position_m[k]
    latitude, longitude, height_m = geodetic_from_ecef(place_m)
    satellite = predicted_state(ephemeris, path.gps_week, path.tow_s[k], place_m)
    _, los = rotated_range(place_m, satellite.position_m)
    enu = rot_enu_ecef(latitude, longitude) @ los
    _, elevation = azimuth_elevation(enu)
    distance_m = float(np.linalg.norm(place_m - station.reference_m))
    above_m = float(height_m - geodetic_from_ecef(station.reference_m)[2])
    here = satellites_of(mode.systems) & satellites_of(params.systems) & ~path.lost[k]
    masked = np.where(here & (elevation >= params.elevation_mask_rad), elevation, np.nan)
    tropo_m = sigma_tropo_m(station.refractivity_uncertainty, station.scale_height_m, masked, above_m)
    iono_s = processing_of(mode).iono_tau_s
    iono_m = mode.iono_factor * sigma_iono_m(station.sigma_vig, masked, distance_m, path.speed_mps[k], iono_s)
    other = tropo_m**2 + iono_m**2
    levels, weights = (_parts(station, mode, params, masked, family) for family in range(2))
    frame = approach.rot_approach_ecef @ los if approach is not None else np.array([enu[1], -enu[0], enu[2]])
    projection = projection_matrix(frame, np.sqrt(weights[0] + weights[1] + other), CLOCK_GROUPS)
    if projection is None:
        return np.array([_NONE, _NONE]), np.zeros(N_SATS, dtype=bool)
    used = (projection != 0.0).any(axis=0)
    s = np.array(vertical_lateral(projection, approach.gpa_rad if approach is not None else 0.0))[:, used]
    return _levels(s, levels[0][used], levels[1][used] + other[used], distance_m, planned), used


def _parts(
    station: ExpectedStation, mode: Mode, params: AirborneParams, elevation: FloatArray, family: int
) -> tuple[FloatArray, FloatArray]:
    """Variances of the corrections and of the aircraft, for levels or weights; signals are independent [m^2]."""
    products = mode.level_products if family == _LEVELS else mode.products
    curves, ground, air = air_model(mode, params.aad).curves[family], np.zeros(N_SATS), np.zeros(N_SATS)
    for signal, (_, factor) in enumerate(mode.components):
        ground = ground + (factor * station.sigma_gnd_m[products[signal]]) ** 2
        for system, group in enumerate(CLOCK_GROUPS):
            a = curves[system][signal]
            of_system = [
                airborne_curve_m(AirborneCurve(a0_m=a[n], a1_m=a[n + 1], theta0_deg=a[n + 2]), elevation)
                for n in (0, 3)
            ]
            air = air + np.where(group, factor**2 * (of_system[0] ** 2 + of_system[1] ** 2), 0.0)
    return ground, air


def _levels(s: FloatArray, ground: FloatArray, other: FloatArray, distance_m: float, planned: Planned) -> FloatArray:
    """Levels and bounds ``(2, 2)``: the larger of fault-free and faulted receiver with B values of zero, and bounds."""
    station, mode, params = planned.station, planned.mode, planned.params
    service_d = mode.service is ServiceType.D
    probability = params.gast_d.protection_probability if service_d else params.protection_probability
    multipliers = Multipliers.generate(probability, params.receiver_fault_prior, params.k_ffmd_single)
    m = station.n_receivers
    sigma_m = np.sqrt((s**2 * (ground + other)).sum(axis=1))
    level_m = multipliers.k_ffmd[m] * sigma_m
    if m > 1:
        faulted_m = np.sqrt((s**2 * (m / (m - 1.0) * ground + other)).sum(axis=1))
        level_m = np.maximum(level_m, multipliers.k_md[m] * faulted_m)
    bound_m = (np.abs(s) * distance_m * station.p).max(axis=1) + station.k_md_e * sigma_m
    return np.array([level_m, bound_m])


def path_along(
    approach: FinalApproach, gps_week: int, tow_s: float, distances_m: Sequence[float], speed_mps: float
) -> PlannedPath:
    """A flight down the glide path over these distances to the threshold, the first at the given time.

    Raises
    ------
    ValueError
        When the distances do not fall, or the speed is not above 0.
    """
    distances = np.asarray(distances_m, dtype=np.float64)
    if not (speed_mps > 0.0 and (np.diff(distances) < 0.0).all() and math.isfinite(distances.sum())):
        raise ValueError(f"distances {distances} have to fall, at a speed above 0 m/s ({speed_mps})")
    return PlannedPath(
        gps_week=gps_week,
        tow_s=tow_s + (distances[0] - distances) / speed_mps,
        position_m=approach.position_on_path(distances),
        speed_mps=np.full(len(distances), float(speed_mps)),
        lost=np.zeros((len(distances), N_SATS), dtype=bool),
    )
