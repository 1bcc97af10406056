"""What each monitor says of each satellite, in the columns of one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, missing
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.codes import MonitorState
from gbas_msgs_py.records import GROUND_MONITORS, MonitorEpoch

IntArray = NDArray[np.intp]


class MonitorSummary(NamedTuple):
    """One monitor's view of the satellites, each ``(N,)``: statistic, threshold, what failed, and what was due."""

    statistic: FloatArray
    threshold: FloatArray
    failed: BoolArray
    due: BoolArray


def place_of_worst(result: MonitorResult, *, axes: int) -> tuple[IntArray, ...]:
    """Where along the first `axes` axes the statistic is furthest over its threshold, or nearest to it.

    Returns
    -------
    tuple of int arrays
        One index an axis, each of the shape of the remaining axes; 0 where there is no statistic.
    """
    shape = result.statistic.shape
    excess = (result.statistic - result.threshold) / np.abs(result.threshold)  # thresholds may be negative
    flat = excess.reshape(-1, *shape[axes:])
    place = np.where(np.isnan(flat), -np.inf, flat).argmax(axis=0)
    return np.unravel_index(place, shape[:axes])


def worst_of(result: MonitorResult, *, axes: int) -> MonitorResult:
    """Statistic and threshold at :func:`place_of_worst`; failed where any along these axes did."""
    shape = result.statistic.shape
    rest = np.indices(shape[axes:], sparse=True)
    place = (*place_of_worst(result, axes=axes), *rest)
    return MonitorResult(
        statistic=result.statistic[place],
        threshold=np.broadcast_to(result.threshold, shape)[place],
        failed=np.logical_or.reduce(result.failed.reshape(-1, *shape[axes:])),
    )


def summarise(result: MonitorResult, due: BoolArray) -> MonitorSummary:
    """The worst of a monitor's tests of each satellite.

    Parameters
    ----------
    result : MonitorResult
        ``(..., N)``.
    due : (..., N) bool array
        Where the monitor ought to look; where it does and has no statistic, it did not monitor.

    Returns
    -------
    MonitorSummary
        Statistic and threshold are those of the test that is furthest over its threshold, or nearest to it.
    """
    axes = result.statistic.ndim - 1
    worst = worst_of(result, axes=axes) if axes else result
    expected = due if due.ndim == 1 else np.logical_or.reduce(due.reshape(-1, N_SATS))
    return MonitorSummary(worst.statistic, worst.threshold, worst.failed, expected)


def monitor_epoch(
    gps_week: int,
    tow_s: float,
    summaries: Mapping[str, MonitorSummary],
    details: Mapping[str, Any],
    shown: BoolArray,
) -> MonitorEpoch:
    """The table of what all monitors measured.

    Parameters
    ----------
    gps_week, tow_s
        The epoch.
    summaries : mapping
        By the names in :data:`GROUND_MONITORS`; a monitor that is missing is not due.
    details : mapping
        Further fields of the table.
    shown : (N,) bool array
        Satellites that have a row.
    """
    count = len(GROUND_MONITORS)
    statistic, threshold = missing(count), missing(count)
    failed, due = np.zeros((count, N_SATS), dtype=bool), np.zeros((count, N_SATS), dtype=bool)
    for row, name in enumerate(GROUND_MONITORS):
        if name in summaries:
            statistic[row], threshold[row], failed[row], due[row] = summaries[name]
    looked = np.isfinite(statistic + threshold)
    state = np.where(looked, float(MonitorState.PASSED), float(MonitorState.NOT_MONITORED))
    state = np.where(due, state, float(MonitorState.NOT_DUE))
    fields = {
        "statistic": np.where(looked, statistic, np.nan),
        "threshold": np.where(looked, threshold, np.nan),
        "state": np.where(failed, float(MonitorState.FAILED), state),
        **details,
    }
    return MonitorEpoch(
        gps_week=gps_week, tow_s=tow_s, **{name: np.where(shown, value, np.nan) for name, value in fields.items()}
    )
