"""Recorded receivers through the whole chain: bounded errors, and agreement with RTKLIB."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gbas_bringup.process import ProcessResult, prepare, process
from gbas_bringup.results import Row, error_statistics
from gbas_core.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gpstime import epoch_key
from gbas_core.satellites import SAT_IDS
from gbas_studies.chain import AirborneOutput
from recorded_sets import recorded_sets, request, truth_ecef_m, truth_of_rows
from rtklib_dgnss import rtklib_positions
from weighted_dgnss import dgnss_position, read_ranges

# Epochs until a filter of 100 s has settled (200 s after the first epoch on the ground) and the ephemeris CRCs of at
# least four satellites have come round: no solution can be expected before.
START_S = 215.0


@pytest.fixture(scope="module")
def results(data_dir: Path) -> dict[str, ProcessResult]:
    """Every set processed once."""
    return {name: process(request(name, data_dir)) for name in recorded_sets()}


@pytest.mark.parametrize("name", recorded_sets())
def test_every_epoch_is_solved_and_bounded(name: str, results: dict[str, ProcessResult], data_dir: Path) -> None:
    rows = results[name].rows
    statistics = error_statistics(rows, truth_of_rows(name, data_dir, rows))
    begin = rows[0].tow_s + START_S
    settled = [row for row in rows if row.tow_s >= begin]
    assert all(row.position_m is not None for row in settled)
    assert statistics["epochs"] >= len(settled) > 0
    assert statistics["vertical_bounded_epochs"] == statistics["epochs"]
    assert statistics["lateral_bounded_epochs"] == statistics["epochs"]


def test_no_position_without_protection(results: dict[str, ProcessResult]) -> None:
    for result in results.values():
        for row in result.rows:
            if row.position_m is not None:
                assert np.isfinite([row.vpl_m, row.lpl_m]).all()
            else:
                assert row.alert


def _rms_enu(error_ecef_m: np.ndarray, place: np.ndarray) -> tuple[float, float]:
    latitude, longitude, _ = geodetic_from_ecef(place)
    enu = error_ecef_m @ rot_enu_ecef(latitude, longitude).T
    return float(np.sqrt(np.mean(np.sum(enu[:, :2] ** 2, axis=1)))), float(np.sqrt(np.mean(enu[:, 2] ** 2)))


def _paired(rows: tuple[Row, ...], other: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of week and both positions of the epochs that both programs solved."""
    place = {int(key): k for k, key in enumerate(other["key"])}
    pairs = [
        (row.tow_s, row.position_m, other["xyz_m"][place[epoch_key(row.gps_week, row.tow_s)]])
        for row in rows
        if row.position_m is not None and epoch_key(row.gps_week, row.tow_s) in place
    ]
    return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs]), np.array([p[2] for p in pairs])


def _rtklib(name: str, data: Path, folder: Path) -> dict[str, np.ndarray]:
    item = recorded_sets()[name]
    return rtklib_positions(
        data / item["ground"][0],
        data / item["user"],
        [data / path for path in item["navigation"]],
        folder,
        base_xyz=tuple(item["ground_xyz_m"][0]),
        systems=item["systems"],
        galileo=item.get("galileo", "inav"),
    )


@pytest.mark.parametrize("name", ["spirent_static", "spirent_dynamic"])
def test_errors_are_not_above_rtklib(
    name: str, results: dict[str, ProcessResult], data_dir: Path, tmp_path: Path
) -> None:
    tow_s, ours, theirs = _paired(results[name].rows, _rtklib(name, data_dir, tmp_path))
    truth = truth_ecef_m(name, data_dir, tow_s)
    our_rms, their_rms = _rms_enu(ours - truth, truth[0]), _rms_enu(theirs - truth, truth[0])
    # 2 cm: what 100 s of smoothing may lag behind a simulated ionosphere that changes while the rover moves.
    assert our_rms[0] <= their_rms[0] + 0.02
    assert our_rms[1] <= their_rms[1] + 0.02


def _unsmoothed(name: str, data: Path) -> list[AirborneOutput]:
    """The first ten minutes without smoothing on either side."""
    prepared = prepare(request(name, data))
    raw = replace(
        prepared,
        ground=replace(prepared.ground, tau_s=(0.0, 0.0), settle_time_s=0.0, readmission_time_s=0.0),
        airborne=replace(prepared.airborne, smoothing_tau_s=0.0, settle_s=0.0),
    )
    return [output for output in raw.chain().run(raw.epochs()[:600]) if isinstance(output, AirborneOutput)]


def _position(output: AirborneOutput) -> np.ndarray:
    return np.array([output.solution.x_m, output.solution.y_m, output.solution.z_m])


@pytest.mark.parametrize("name", ["upc1_upc2", "mosaic_base_rover", "spirent_static"])
def test_unsmoothed_positions_agree_with_dgnss_on_rtklib_ranges(name: str, data_dir: Path, tmp_path: Path) -> None:
    item: dict[str, Any] = recorded_sets()[name]
    navigation = [data_dir / path for path in item["navigation"]]
    message = item.get("galileo", "inav")
    base = read_ranges(data_dir / item["ground"][0], navigation, tmp_path, galileo=message)
    rover = read_ranges(data_dir / item["user"], navigation, tmp_path, galileo=message)
    place = np.array(item["ground_xyz_m"][0])
    differences = []
    for output in _unsmoothed(name, data_dir)[::10]:
        solution = output.solution
        if not np.isfinite(solution.x_m):
            continue
        key = epoch_key(solution.gps_week, solution.tow_s)
        variance = sum(
            getattr(solution, column) ** 2 for column in ("sigma_gnd_m", "sigma_air_m", "sigma_tropo_m", "sigma_iono_m")
        )
        sigma_m = {SAT_IDS[k]: float(np.sqrt(variance[k])) for k in np.flatnonzero(np.isfinite(variance))}
        theirs = dgnss_position([(base[key], place)], rover[key], sigma_m, place)
        differences.append(_position(output) - theirs)
    assert len(differences) > 20
    rms = float(np.sqrt(np.mean(np.sum(np.square(differences), axis=1))))
    # What may differ: corrections are quantised to 1 cm by the broadcast, and RTKLIB's baseline has no troposphere.
    assert rms < 0.05
