"""Last stage of an epoch: the record of every mode's position, with all a protection level needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gbas_airborne.navigation.guidance import approach_columns, guidance_columns
from gbas_airborne.navigation.locate import Located
from gbas_airborne.navigation.position import Fix, PositionResult
from gbas_airborne.reception.receive import Received
from gbas_airborne.reception.station_data import Corrections
from gbas_core.positioning.wls import vertical_lateral
from gbas_core.record import FloatArray
from gbas_msgs_py.modes import Mode
from gbas_msgs_py.records import SolutionEpoch


def report(located: Located) -> tuple[SolutionEpoch, ...]:
    """One record a mode."""
    return tuple(_solution(located.received, result) for result in located.results)


def no_positions(received: Received, modes: tuple[Mode, ...]) -> tuple[SolutionEpoch, ...]:
    """One record a mode of an epoch that has no position: what the station told and its age."""
    return tuple(SolutionEpoch(**_station_columns(received, mode)) for mode in modes)


def _station_columns(received: Received, mode: Mode) -> dict[str, Any]:
    """What is known without a position."""
    station, corrections = received.station, received.corrections.get(mode.product)
    columns: dict[str, Any] = {
        "gps_week": received.gps_week,
        "tow_s": received.tow_s,
        "mode": float(mode.number),
        "gcid": float(station.gcid) if station is not None else math.nan,
        "k_md_e": station.k_md_e if station is not None else math.nan,
        **approach_columns(received.approach),
    }
    if corrections is not None:
        columns["correction_age_s"] = received.since_s((corrections.gps_week, corrections.tow_s))
        columns["message_age_s"] = received.since_s(corrections.received)
    return columns


def _solution(received: Received, result: PositionResult) -> SolutionEpoch:
    mode = result.sources.mode
    columns = _station_columns(received, mode)
    corrections = received.corrections.get(mode.product)
    if result.fix is not None and corrections is not None:
        columns |= _position_columns(result.fix)
        columns |= _satellite_columns(received, result, result.fix, corrections)
        columns |= guidance_columns(received.approach, result.fix.position_m)
    return SolutionEpoch(**columns)


def _position_columns(fix: Fix) -> dict[str, Any]:
    clock_m = fix.clock_m()
    return {
        "x_m": float(fix.position_m[0]),
        "y_m": float(fix.position_m[1]),
        "z_m": float(fix.position_m[2]),
        # that of the first constellation used
        "clock_m": float(clock_m[np.isfinite(clock_m)][0]),
        "n_sats": float(fix.used.sum()),
        # no mode yet compares two positions
        "d_vert_m": 0.0,
        "d_lat_m": 0.0,
    }


def _satellite_columns(
    received: Received, result: PositionResult, fix: Fix, corrections: Corrections
) -> dict[str, Any]:
    """Rows of the satellites used."""
    used, geometry, approach = fix.used, result.geometry, received.approach
    s_vert, s_lat = vertical_lateral(fix.projection, approach.gpa_rad if approach is not None else 0.0)
    b_m = np.where(used, corrections.b_m, np.nan)
    behind = np.isfinite(b_m).sum(axis=0).max()

    def only(values: FloatArray) -> FloatArray:
        return np.where(used, values, np.nan)

    return {
        "n_receivers": float(max(behind, 1)),
        "elevation_rad": only(geometry.elevation_rad),
        "azimuth_rad": only(geometry.azimuth_rad),
        "s_vert": only(s_vert),
        "s_lat": only(s_lat),
        "sigma_gnd_m": only(corrections.sigma_m),
        "sigma_air_m": only(geometry.sigma_air_m),
        "sigma_tropo_m": only(geometry.sigma_tropo_m),
        "sigma_iono_m": only(geometry.sigma_iono_m),
        "b_m": b_m,
        "ephemeris_error_m": only(geometry.distance_m * received.checks.p),
        "residual_m": fix.residual_m(),
    }
