"""Recorded receivers through the whole chain: bounded errors, and agreement with RTKLIB."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_chain.process import ProcessResult, process
from gbas_chain.results import error_statistics, position_errors
from gbas_studies.bounding import BoundingReport, error_series
from recorded_report import (
    BOUNDING_SETS,
    bounding,
    paired,
    rms_enu_m,
    rtklib_of,
    unsmoothed,
    unsmoothed_difference_m,
)
from recorded_sets import recorded_sets, truth_ecef_m, truth_of_rows
from recorded_sets import request as request_of

# Epochs until a filter of 100 s has settled (230 s after the first epoch at both ends) and the ephemeris CRCs of at
# least four satellites have come round: no solution can be expected before.
START_S = 245.0


SHORT = 1200
"""Epochs of the long recordings that every run looks at: 20 minutes of an hour; the whole is a campaign."""


@pytest.fixture(
    scope="module", params=[SHORT, pytest.param(None, marks=pytest.mark.campaign)], ids=["20 minutes", "whole"]
)
def results(data_dir: Path, request: pytest.FixtureRequest) -> dict[str, ProcessResult]:
    """Every set processed once."""
    return {name: process(request_of(name, data_dir), count=request.param) for name in recorded_sets()}


@pytest.mark.parametrize("name", recorded_sets())
def test_every_epoch_is_solved_and_none_is_a_counter_example(
    name: str, results: dict[str, ProcessResult], data_dir: Path
) -> None:
    rows = results[name].rows
    statistics = error_statistics(rows, truth_of_rows(name, data_dir, rows))
    begin = rows[0].tow_s + START_S
    settled = [row for row in rows if row.tow_s >= begin]
    assert all(row.position_m is not None for row in settled)
    assert statistics["epochs"] >= len(settled) > 0
    assert statistics["vertical_bounded_epochs"] == statistics["epochs"]
    assert statistics["lateral_bounded_epochs"] == statistics["epochs"]


def _bounding(name: str, filters: str, results: dict[str, ProcessResult], data: Path) -> BoundingReport:
    if filters == "unsmoothed":
        return bounding(name, data, unsmoothed(name, data), 0.0)
    result = results[name]
    return bounding(name, data, [output.solution for output in result.outputs], result.airborne.smoothing_tau_s)


@pytest.mark.parametrize(
    ("name", "filters"),
    [
        *((name, "smoothed") for name in BOUNDING_SETS),
        ("mosaic_base_rover", "unsmoothed"),
        pytest.param("upc1_upc2", "unsmoothed", marks=pytest.mark.campaign),
        pytest.param("upc12_garr", "unsmoothed", marks=pytest.mark.campaign),
    ],
)
def test_sigmas_of_the_first_half_hold_in_the_second(
    name: str, filters: str, results: dict[str, ProcessResult], data_dir: Path
) -> None:
    """Errors beyond K sigma with K for 30, 10 and 1 %: there must be some, and not significantly more than that.

    Each verdict is wrong with 2.5 %, of an interval that is rather too wide (`exceedance`); the data do not change.
    """
    report = _bounding(name, filters, results, data_dir)
    for error, found in report.exceedances["measured"].items():
        assert [each.verdict for each in found if each.verdict == "exceeded"] == [], error
    assert report.exceedances["measured"]["range"][0].count > 0
    # The assumed sigmas are those of receivers in an aircraft with smoothed codes: larger than what was measured.
    assert report.ratio < 1.0
    if filters == "unsmoothed":
        # What makes it a test: sigmas half as large as the measured ones would have failed it.
        assert all(each.visible_ratio < 2.0 for each in report.exceedances["measured"]["range"])
    counts = report.stanford[0.1]
    beyond = report.exceedances["measured"]["vertical"][1]
    assert counts.misleading + counts.unavailable_misleading + counts.hazardous == beyond.count
    assert counts.hazardous == 0


@pytest.mark.parametrize("name", BOUNDING_SETS)
def test_errors_of_ranges_add_up_to_the_position_error(
    name: str, results: dict[str, ProcessResult], data_dir: Path
) -> None:
    result = results[name]
    truth = truth_of_rows(name, data_dir, result.rows)
    direct = position_errors(result.rows, truth)
    known = np.isfinite(direct.vertical_m)
    series = error_series([output.solution for output in result.outputs], truth)
    # 10 µm: residuals belong to the position before the last step, which is below 5 cm.
    np.testing.assert_allclose(np.abs(series.position_m[0]), direct.vertical_m[known], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(np.abs(series.position_m[1]), direct.lateral_m[known], rtol=0.0, atol=1e-5)


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
