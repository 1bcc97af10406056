"""What each monitor says of each satellite, in the columns of one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, missing
from gbas_ground.corrections import BoolArray
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.records import GROUND_MONITORS, MonitorEpoch, MonitorState


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
    shape = result.statistic.shape
    count = max(1, int(np.prod(shape[:-1])))
    statistic = result.statistic.reshape(count, N_SATS)
    threshold = np.broadcast_to(result.threshold, shape).reshape(count, N_SATS)
    failed = result.failed.reshape(count, N_SATS).any(axis=0)
    expected = np.broadcast_to(due, shape).reshape(count, N_SATS).any(axis=0)
    excess = (statistic - threshold) / np.abs(threshold)
    known = np.isfinite(excess)
    worst = np.where(known, excess, -np.inf).argmax(axis=0)[np.newaxis]
    looked = known.any(axis=0)
    seen = np.where(looked, float(MonitorState.PASSED), float(MonitorState.NOT_MONITORED))
    state = np.where(expected, seen, float(MonitorState.NOT_DUE))
    return Look(
        statistic=np.where(looked, np.take_along_axis(statistic, worst, axis=0)[0], np.nan),
        threshold=np.where(looked, np.take_along_axis(threshold, worst, axis=0)[0], np.nan),
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
