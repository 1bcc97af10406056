"""What each monitor says of each satellite, in the columns of one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, missing
from gbas_ground.corrections import BoolArray
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.records import GROUND_MONITORS, MonitorEpoch, MonitorState

_EACH: Final = np.arange(N_SATS)


class Look(NamedTuple):
    """One monitor's view of the satellites: statistic, threshold, :class:`MonitorState`, each ``(N,)``."""

    statistic: FloatArray
    threshold: FloatArray
    state: FloatArray


def look(result: MonitorResult, due: BoolArray) -> Look:
    """The worst of a monitor's tests of each satellite.

    Parameters
    ----------
    result : MonitorResult
        ``(..., N)``.
    due : (..., N) bool array
        Where the monitor ought to look; where it does and has no statistic, it did not monitor.

    Returns
    -------
    Look
        Statistic and threshold are those of the test that is furthest over its threshold, or nearest to it.
    """
    threshold = np.broadcast_to(result.threshold, result.statistic.shape)
    statistic, failed, expected = result.statistic, result.failed, due
    if statistic.ndim > 1:
        statistic, threshold = statistic.reshape(-1, N_SATS), threshold.reshape(-1, N_SATS)
        excess = (statistic - threshold) / np.abs(threshold)
        worst = np.where(np.isnan(excess), -np.inf, excess).argmax(axis=0)
        statistic, threshold = statistic[worst, _EACH], threshold[worst, _EACH]
        failed = np.logical_or.reduce(failed.reshape(-1, N_SATS))
    if due.ndim > 1:
        expected = np.logical_or.reduce(due.reshape(-1, N_SATS))
    looked = np.isfinite(statistic + threshold)
    seen = np.where(looked, float(MonitorState.PASSED), float(MonitorState.NOT_MONITORED))
    state = np.where(expected, seen, float(MonitorState.NOT_DUE))
    return Look(
        statistic=np.where(looked, statistic, np.nan),
        threshold=np.where(looked, threshold, np.nan),
        state=np.where(failed, float(MonitorState.FAILED), state),
    )


def monitor_epoch(
    gps_week: int,
    tow_s: float,
    looks: Mapping[str, Look],
    details: Mapping[str, Any],
    shown: BoolArray,
) -> MonitorEpoch:
    """The table of what all monitors measured.

    Parameters
    ----------
    gps_week, tow_s
        The epoch.
    looks : mapping
        By the names in :data:`GROUND_MONITORS`; a monitor that is missing is not due.
    details : mapping
        Further fields of the table.
    shown : (N,) bool array
        Satellites that have a row.
    """
    count = len(GROUND_MONITORS)
    statistic, threshold, state = missing(count), missing(count), np.zeros((count, N_SATS))
    for row, name in enumerate(GROUND_MONITORS):
        if name in looks:
            statistic[row], threshold[row], state[row] = looks[name]
    fields = {"statistic": statistic, "threshold": threshold, "state": state, **details}
    return MonitorEpoch(
        gps_week=gps_week, tow_s=tow_s, **{name: np.where(shown, value, np.nan) for name, value in fields.items()}
    )
