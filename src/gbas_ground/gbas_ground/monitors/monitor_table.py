"""What each monitor says of each satellite, in the rows of one table."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID
from gbas_core.signals import L1, L2, L5
from gbas_ground.monitors.kernels.table import monitor_rows, shown_only
from gbas_ground.monitors.kernels.worst import worst_along
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.codes import Signal
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

_NO_SUMMARIES: Final[Summaries] = {}
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


def monitor_epoch(
    gps_week: int, tow_s: float, summaries: Summaries, shown: BoolArray, further: Summaries = _NO_SUMMARIES
) -> MonitorEpoch:
    """The table of what all monitors said.

    Parameters
    ----------
    gps_week, tow_s
        The epoch.
    summaries : mapping
    shown : (N,) bool array
        Satellites that have rows.
    further : mapping
        The same of another signal.
    """
    said = [(key, summaries[key]) for key in TESTS if key in summaries]
    said += [(key, further[key]) for key in TESTS if key in further]
    if not said:
        return MonitorEpoch(gps_week=gps_week, tow_s=tow_s)
    keys = tuple([key for key, _ in said])
    statistic, threshold, failed, due, signal = zip(*(summary for _, summary in said), strict=True)
    rows = monitor_rows(
        np.concatenate(statistic), np.concatenate(threshold), np.concatenate(failed), np.concatenate(due), shown,
        _about(keys, signal), _SOURCE_ID,
    )  # fmt: skip
    return MonitorEpoch(
        gps_week=gps_week,
        tow_s=tow_s,
        monitor=rows[0],
        test=rows[1],
        sat=rows[2],
        signal=rows[3],
        statistic=rows[4],
        threshold=rows[5],
        state=rows[6],
    )


@lru_cache(maxsize=16)
def _about(keys: tuple[TestKey, ...], signals: tuple[Signal, ...]) -> FloatArray:
    """Numbers of monitor and test, and signal, ``(K, 3)``."""
    return np.array([(*key, signal) for key, signal in zip(keys, signals, strict=True)], dtype=np.float64)


def monitor_detail_epoch(
    gps_week: int, tow_s: float, details: Mapping[str, Any], shown: BoolArray
) -> MonitorDetailEpoch:
    """The table of what is behind the statistics; `details` are its fields."""
    if not details:
        return MonitorDetailEpoch(gps_week=gps_week, tow_s=tow_s)
    rows = shown_only(np.concatenate(tuple(details.values()), axis=None, dtype=np.float64), shown)
    fields, begin = {}, 0
    for name, value in details.items():
        end = begin + value.size // N_SATS
        fields[name] = rows[begin:end].reshape(value.shape)
        begin = end
    return MonitorDetailEpoch(gps_week=gps_week, tow_s=tow_s, **fields)


def moved(result: MonitorResult, source: int, destination: int) -> MonitorResult:
    """The same with one axis elsewhere."""
    shape = result.statistic.shape
    return MonitorResult(
        statistic=np.moveaxis(result.statistic, source, destination),
        threshold=np.moveaxis(np.broadcast_to(result.threshold, shape), source, destination),
        failed=np.moveaxis(np.broadcast_to(result.failed, shape), source, destination),
    )
