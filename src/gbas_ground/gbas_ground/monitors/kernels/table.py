"""Rows of the monitors table."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray
from gbas_msgs_py.codes import MonitorState

_NOT_MONITORED: Final = float(MonitorState.NOT_MONITORED)
_PASSED: Final = float(MonitorState.PASSED)
_FAILED: Final = float(MonitorState.FAILED)


@compiled
def monitor_rows(
    statistic: FloatArray,
    threshold: FloatArray,
    failed: BoolArray,
    due: BoolArray,
    shown: BoolArray,
    about: FloatArray,
    source_id: FloatArray,
) -> FloatArray:
    """Columns of the monitors table.

    Parameters
    ----------
    statistic, threshold, failed, due : (K * N,) arrays
        Of K tests after one another.
    shown : (N,) bool array
        Satellites that have rows.
    about : (K, 3) array
        Numbers of monitor and test, and signal.
    source_id : (N,) array

    Returns
    -------
    (7, rows) array
        Monitor, test, satellite, signal, statistic, threshold, state: of what was due or failed.
    """
    n_sats, n_rows = len(shown), 0
    for place in range(len(due)):
        n_rows += (due[place] or failed[place]) and shown[place % n_sats]
    rows, row = np.full((7, n_rows), np.nan), 0
    for test in range(len(about)):
        for sat in range(n_sats):
            place = test * n_sats + sat
            if not ((due[place] or failed[place]) and shown[sat]):
                continue
            rows[0, row], rows[1, row], rows[2, row] = about[test, 0], about[test, 1], source_id[sat]
            rows[3, row], rows[6, row] = about[test, 2], _NOT_MONITORED
            if math.isfinite(statistic[place] + threshold[place]):
                rows[4, row], rows[5, row], rows[6, row] = statistic[place], threshold[place], _PASSED
            if failed[place]:
                rows[6, row] = _FAILED
            row += 1
    return rows


@compiled
def shown_only(values: FloatArray, shown: BoolArray) -> FloatArray:
    """Rows ``(m, N)`` of values ``(m * N,)`` after one another; NaN for satellites that are not shown."""
    n_sats = len(shown)
    rows = np.full((len(values) // n_sats, n_sats), np.nan)
    for row in range(len(rows)):
        for sat in range(n_sats):
            if shown[sat]:
                rows[row, sat] = values[row * n_sats + sat]
    return rows
