"""What each monitor says of each satellite, in the rows of one table."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID
from gbas_core.signals import L1, L2, L5
from gbas_ground.monitors.kernels.worst import worst_along
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.codes import MonitorState, Signal
from gbas_msgs_py.monitors import TESTS, TestKey
from gbas_msgs_py.records import MonitorDetailEpoch, MonitorEpoch

IntArray = NDArray[np.intp]
_SOURCE_ID: Final[FloatArray] = RANGING_SOURCE_ID.astype(np.float64)


class MonitorSummary(NamedTuple):
    """One test's view of the satellites, each ``(N,)``: statistic, threshold, what failed, what was due; its signal."""

    statistic: FloatArray
    threshold: FloatArray
    failed: BoolArray
    due: BoolArray
    signal: Signal


Summaries = Mapping[TestKey, MonitorSummary]
"""By the numbers of monitor and test; a test that is missing is not due."""

_SIGNAL_OF_BAND: Final = {L1: Signal.L1, L2: Signal.L2, L5: Signal.L5}


def signal_of(bands: Collection[int]) -> Signal:
    """The signal of a test that looks at these bands."""
    return _SIGNAL_OF_BAND[next(iter(bands))] if len(bands) == 1 else Signal.NONE


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


def summarise(result: MonitorResult, due: BoolArray, signal: Signal = Signal.L1) -> MonitorSummary:
    """The worst of what a test compares of each satellite.

    Parameters
    ----------
    result : MonitorResult
        ``(..., N)``.
    due : (..., N) bool array
        Where the monitor ought to look; where it does and has no statistic, it did not monitor.
    signal : Signal

    Returns
    -------
    MonitorSummary
        Statistic and threshold are those of the comparison that is furthest over its threshold, or nearest to it.
    """
    expected = due if due.ndim == 1 else np.logical_or.reduce(due.reshape(-1, N_SATS))
    if result.statistic.ndim > 1:
        worst, failed = _worst_of_each(result, 1)
        return MonitorSummary(worst[0, 0], worst[1, 0], failed[0], expected, signal)
    statistic, threshold, failed = result
    if threshold.ndim == 0:
        threshold = np.full(statistic.shape, threshold)
    return MonitorSummary(statistic, threshold, failed, expected, signal)


def summarise_each(result: MonitorResult, due: BoolArray, signal: Signal = Signal.L1) -> tuple[MonitorSummary, ...]:
    """The same of several tests, which are the first axis of the result; `due` is ``(N,)``."""
    count = len(result.statistic)
    worst, failed = _worst_of_each(result, count)
    return tuple([MonitorSummary(worst[0, test], worst[1, test], failed[test], due, signal) for test in range(count)])


def _worst_of_each(result: MonitorResult, count: int) -> tuple[FloatArray, BoolArray]:
    """Statistic and threshold of the worst ``(2, count, N)`` of each of so many tests, and whether any failed."""
    statistic, threshold, failed = result
    if threshold.shape != statistic.shape:
        threshold = np.array(np.broadcast_to(threshold, statistic.shape))
    shape = count, -1, N_SATS
    worst, fails = np.empty((2, count, N_SATS)), np.empty((count, N_SATS), dtype=bool)
    worst_along(statistic.reshape(shape), threshold.reshape(shape), failed.reshape(shape), worst, fails)
    return worst, fails


def monitor_epoch(gps_week: int, tow_s: float, summaries: Summaries, shown: BoolArray) -> MonitorEpoch:
    """The table of what all monitors said.

    Parameters
    ----------
    gps_week, tow_s
        The epoch.
    summaries : mapping
    shown : (N,) bool array
        Satellites that have rows.
    """
    keys = [key for key in TESTS if key in summaries]
    if not keys:
        return MonitorEpoch(gps_week=gps_week, tow_s=tow_s)
    columns = zip(*(summaries[key][:4] for key in keys), strict=True)
    statistic, threshold, failed, due = (np.stack(column) for column in columns)
    looked = np.isfinite(statistic + threshold)
    state = np.where(looked, float(MonitorState.PASSED), float(MonitorState.NOT_MONITORED))
    state = np.where(failed, float(MonitorState.FAILED), state)
    place, satellite = np.nonzero((due | failed) & shown)
    monitor, test = np.array(keys, dtype=np.float64).T
    signal = np.array([float(summaries[key].signal) for key in keys])
    at = place, satellite
    return MonitorEpoch(
        gps_week=gps_week,
        tow_s=tow_s,
        monitor=monitor[place],
        test=test[place],
        sat=_SOURCE_ID[satellite],
        signal=signal[place],
        statistic=np.where(looked, statistic, np.nan)[at],
        threshold=np.where(looked, threshold, np.nan)[at],
        state=state[at],
    )


def monitor_detail_epoch(
    gps_week: int, tow_s: float, details: Mapping[str, Any], shown: BoolArray
) -> MonitorDetailEpoch:
    """The table of what is behind the statistics; `details` are its fields."""
    return MonitorDetailEpoch(
        gps_week=gps_week, tow_s=tow_s, **{name: np.where(shown, value, np.nan) for name, value in details.items()}
    )


def moved(result: MonitorResult, source: int, destination: int) -> MonitorResult:
    """The same with one axis elsewhere."""
    shape = result.statistic.shape
    return MonitorResult(
        statistic=np.moveaxis(result.statistic, source, destination),
        threshold=np.moveaxis(np.broadcast_to(result.threshold, shape), source, destination),
        failed=np.moveaxis(np.broadcast_to(result.failed, shape), source, destination),
    )
