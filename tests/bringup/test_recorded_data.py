"""Recorded receivers through the whole chain: bounded errors, and agreement with RTKLIB."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_bringup.process import ProcessResult, process
from gbas_bringup.results import error_statistics
from recorded_report import paired, rms_enu_m, rtklib_of, unsmoothed_difference_m
from recorded_sets import recorded_sets, request, truth_ecef_m, truth_of_rows

# Epochs until a filter of 100 s has settled (230 s after the first epoch at both ends) and the ephemeris CRCs of at
# least four satellites have come round: no solution can be expected before.
START_S = 245.0


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


@pytest.mark.parametrize("name", ["spirent_static", "spirent_dynamic"])
def test_errors_are_not_above_rtklib(
    name: str, results: dict[str, ProcessResult], data_dir: Path, tmp_path: Path
) -> None:
    tow_s, ours, theirs = paired(results[name].rows, rtklib_of(name, data_dir, tmp_path))
    truth = truth_ecef_m(name, data_dir, tow_s)
    our_rms, their_rms = rms_enu_m(ours - truth, truth[0]), rms_enu_m(theirs - truth, truth[0])
    # 2 cm: what 100 s of smoothing may lag behind a simulated ionosphere that changes while the rover moves.
    assert our_rms[0] <= their_rms[0] + 0.02
    assert our_rms[1] <= their_rms[1] + 0.02


@pytest.mark.parametrize("name", ["upc1_upc2", "mosaic_base_rover", "spirent_static"])
def test_unsmoothed_positions_agree_with_dgnss_on_rtklib_ranges(name: str, data_dir: Path) -> None:
    count, rms_m = unsmoothed_difference_m(name, data_dir)
    assert count > 20
    # What may differ: corrections are quantised to 1 cm by the broadcast, and RTKLIB's baseline has no troposphere.
    assert rms_m < 0.05
