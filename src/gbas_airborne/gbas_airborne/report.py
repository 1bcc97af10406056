# mypy: disable-error-code="no-untyped-call"
"""Last stage of an epoch: the record of every mode's position, with all a protection level needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gbas_airborne.navigation.guidance import approach_columns, guidance_columns
from gbas_airborne.navigation.kernels.report import COLUMNS, used_columns
from gbas_airborne.navigation.locate import Located
from gbas_airborne.navigation.position import Fix, PositionResult
from gbas_airborne.navigation.service_d import projected, separation_m
from gbas_airborne.reception.receive import Received
from gbas_core.satellites import missing
from gbas_msgs_py.codes import ServiceType
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
    station, sets = received.station, [received.corrections.get(name) for name in mode.products]
    of_service_d = mode.service is ServiceType.D
    columns: dict[str, Any] = {
        "gps_week": received.gps_week,
        "tow_s": received.tow_s,
        "mode": float(mode.number),
        "gcid": float(station.gcid) if station is not None else math.nan,
        "k_md_e": math.nan if station is None else station.k_md_e_d if of_service_d else station.k_md_e,
        **approach_columns(received.approach),
    }
    known = [each for each in sets if each is not None]
    if len(known) == len(sets):
        columns["correction_age_s"] = max(received.since_s((each.gps_week, each.tow_s)) for each in known)
        columns["message_age_s"] = max(received.since_s(each.received) for each in known)
    return columns


def _solution(received: Received, result: PositionResult) -> SolutionEpoch:
    mode = result.sources.mode
    columns = _station_columns(received, mode)
    if result.fix is not None:
        columns |= _position_columns(result.fix)
        columns |= _satellite_columns(received, result, result.fix)
        columns |= guidance_columns(received.approach, result.fix.position_m)
    return SolutionEpoch(**columns)


def _position_columns(fix: Fix) -> dict[str, Any]:
    x_m, y_m, z_m = fix.position_m.tolist()
    return {
        "x_m": x_m,
        "y_m": y_m,
        "z_m": z_m,
        # that of the first constellation used
        "clock_m": next(each for each in fix.clock_m.tolist() if math.isfinite(each)),
    }


def _satellite_columns(received: Received, result: PositionResult, fix: Fix) -> dict[str, Any]:
    """Rows of the satellites used, and how many of them and of receivers there are."""
    tan_gpa = math.tan(received.approach.gpa_rad) if received.approach is not None else 0.0
    checks = received.checks.columns
    if result.sources.mode.service is ServiceType.D:
        checks = np.stack([*checks[:2], received.p_d if received.p_d is not None else missing()])
    rows, n_sats, n_receivers = used_columns(
        result.reason, fix.sky, fix.projection, tan_gpa, result.sources.applied, checks, fix.distance_m
    )
    columns: dict[str, Any] = dict(zip(COLUMNS, rows, strict=False))
    columns["d_vert_m"] = columns["d_lat_m"] = 0.0
    if result.sources.mode.beside and (found := projected(result, received.approach)):
        columns["d_vert_m"], columns["d_lat_m"] = separation_m(found)
    return {**columns, "b_m": rows[len(COLUMNS) :], "n_sats": float(n_sats), "n_receivers": float(n_receivers)}
