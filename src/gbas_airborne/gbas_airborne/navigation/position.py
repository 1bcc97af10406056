# mypy: disable-error-code="no-untyped-call"
"""Differential positions of one epoch, with everything a protection level needs.

The position is found by Gauss-Newton steps from the last one, or from the station's reference point. Each step forms
lines of sight, tropospheric correction, sigmas and weights anew, so that all belong to the position they lead to.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 2.3.9 to 2.3.12.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.modes import air_model, processing_of
from gbas_airborne.navigation.kernels.position import (
    ELEVATION,
    LEVELS,
    RANGE_ERROR,
    WEIGHTS,
    Conditions,
    tested_positions,
)
from gbas_airborne.params import OF_LEVELS, AirborneParams
from gbas_airborne.ranging.corrected_ranges import RangingSources
from gbas_airborne.reception.columns import SIGMA
from gbas_airborne.reception.station_data import StationData
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import CLOCK_GROUPS
from gbas_msgs_py.codes import ServiceCause, ServiceType
from gbas_msgs_py.modes import Mode

GROUP: Final[IntArray] = CLOCK_GROUPS.argmax(axis=0)
"""Clock of each satellite."""
_NO_APPROACH: Final[FloatArray] = np.full((3, 3), np.nan)


class Prior(NamedTuple):
    """What is known before the position is sought.

    Attributes
    ----------
    start_m : (3,) array
        Where to start [m]; anywhere within some hundred kilometres.
    recent : bool
        Whether that is the last position and recent enough to tell the speed.
    dt_s : float
        How long ago it was [s].
    """

    start_m: FloatArray
    recent: bool
    dt_s: float


class PositionInputs(NamedTuple):
    """What a mode's position is made of; ``reason`` is that of the sources, with what is held out."""

    sources: RangingSources
    reason: NDArray[np.int64]
    prior: Prior


@dataclass(frozen=True, kw_only=True, eq=False)
class Fix:
    """A weighted least squares position.

    Attributes
    ----------
    position_m : (3,) array
        ECEF [m].
    distance_m : float
        To the station's reference point [m].
    clock_m : (groups,) array
        Receiver clock against the corrections of each group of satellites [m]; NaN where none is used.
    sky : (ROWS, N_SATS) array
        Directions, sigmas and residuals, rows of :mod:`gbas_airborne.navigation.kernels.position`.
    projection : (3 + groups, N_SATS) array
        From ranges to position (approach frame) and clocks; 0 where not used.
    """

    position_m: FloatArray
    distance_m: float
    clock_m: FloatArray
    sky: FloatArray
    projection: FloatArray


class Withheld(NamedTuple):
    """Why a position that was found is not used: the cause, the number and its bound."""

    cause: ServiceCause
    value: float
    threshold: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionResult:
    """What became of the search for a position.

    Attributes
    ----------
    sources : RangingSources
    reason : (N_SATS,) int array
        Rejection, with the rules that need a position.
    distance_m : float
        Where the search ended, to the station's reference point [m].
    elevation_rad : (N_SATS,) array or None
        There.
    range_error_m : (N_SATS,) array or None
        Error of the satellites the range test excluded [m]; NaN for others.
    fix : Fix or None
        None with too few satellites, too weak a geometry, without convergence, when the range test cannot be passed, or
        when it is withheld.
    withheld : Withheld or None
        What stands against the position.
    failed : Withheld or None
        That, or what stood against the position before satellites were left out.
    """

    sources: RangingSources
    reason: NDArray[np.int64]
    distance_m: float = float("nan")
    elevation_rad: FloatArray | None = None
    range_error_m: FloatArray | None = None
    fix: Fix | None = None
    withheld: Withheld | None = None
    failed: Withheld | None = None


def find_positions(
    inputs: list[PositionInputs], station: StationData, approach: FinalApproach | None, params: AirborneParams
) -> list[PositionResult]:
    """Positions of several modes without the satellites that fail the range test."""
    recent = [each.prior.start_m if each.prior.recent else np.full(3, np.nan) for each in inputs]
    found, position_m, distance_m, reason, sky, projection, clock_m = tested_positions(
        np.array([each.prior.start_m for each in inputs]),
        np.array([each.reason for each in inputs]),
        np.array([each.sources.range_m for each in inputs]),
        np.array([each.sources.satellite_m for each in inputs]),
        np.array([each.sources.noise_factor for each in inputs]),
        np.array([(each.sources.applied[SIGMA], each.sources.weight_sigma_m) for each in inputs]),
        station.reference_ecef_m,
        np.array(recent),
        np.array([each.prior.dt_s for each in inputs]),
        np.array([processing_of(each.sources.mode).coefficient for each in inputs]),
        _curves(tuple(each.sources.mode for each in inputs), params),
        np.array([_iono(each.sources.mode, station) for each in inputs]),
        approach.rot_approach_ecef if approach is not None else _NO_APPROACH,
        GROUP,
        len(CLOCK_GROUPS),
        _conditions(station, params),
    )
    return [
        PositionResult(
            sources=each.sources,
            reason=reason[row],
            distance_m=float(distance_m[row]),
            elevation_rad=sky[row, ELEVATION],
            range_error_m=sky[row, RANGE_ERROR],
            fix=None
            if not found[row]
            else Fix(
                position_m=position_m[row],
                distance_m=float(distance_m[row]),
                clock_m=clock_m[row],
                sky=sky[row],
                projection=projection[row],
            ),
        )
        for row, each in enumerate(inputs)
    ]


@lru_cache(maxsize=8)
def _curves(modes: tuple[Mode, ...], params: AirborneParams) -> FloatArray:
    """Curves of airborne noise and multipath of modes, (M, 2, groups, C, 6)."""
    curves: FloatArray = np.array([air_model(mode, params.aad).curves for mode in modes])
    for row, mode in enumerate(modes):
        if mode.levels and params.gast_d.weights == OF_LEVELS:
            curves[row, WEIGHTS] = curves[row, LEVELS]
    return curves


def _iono(mode: Mode, station: StationData) -> tuple[float, float, float]:
    """sigma_vig, ionospheric delay over that on L1, and time constant."""
    gradient = station.sigma_vig_d if mode.service is ServiceType.D else station.sigma_vig
    return float(gradient), mode.iono_factor, processing_of(mode).iono_tau_s


def _conditions(station: StationData, params: AirborneParams) -> Conditions:
    return Conditions(
        height_m=float(station.reference_height_m),
        d_max_m=float(station.d_max_m),
        refractivity=float(station.refractivity),
        refractivity_uncertainty=float(station.refractivity_uncertainty),
        scale_height_m=float(station.scale_height_m),
        mask_rad=float(params.elevation_mask_rad),
        assumed_mps=float(params.max_speed_mps),
        max_condition=float(params.max_condition),
        max_iterations=int(params.max_iterations),
        test_sigma=float(params.range_test_sigma),
        test_floor_m=float(params.range_test_floor_m),
        max_exclusions=int(params.range_test_max_exclusions),
    )
