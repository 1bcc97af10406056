"""A new ephemeris against the one before."""

from __future__ import annotations

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.orbits import satellite_state
from gbas_ground.monitors.result import MonitorResult, upper_limit


def check_ephemeris_change(
    new: Ephemeris, old: Ephemeris, gps_week: int, tow_s: float, limit_m: float
) -> MonitorResult:
    """Compare the positions two ephemerides of a satellite give at one time.

    Parameters
    ----------
    new : Ephemeris
        Just received.
    old : Ephemeris
        In use until now; satellites without one pass, because there is nothing to compare with.
    gps_week, tow_s
        The time.
    limit_m : float
        Largest distance [m].

    Returns
    -------
    MonitorResult
        Statistic: distance between the two positions [m], ``(N,)``. A new ephemeris that gives no position fails when
        there is an old one.

    Source: data quality monitor, 250 m (uncertain).
    """
    old_m = satellite_state(old, gps_week, tow_s).position_m
    new_m = satellite_state(new, gps_week, tow_s).position_m
    distance = np.sqrt(((new_m - old_m) ** 2).sum(axis=-2))
    both = np.isfinite(new.message) & np.isfinite(old_m).all(axis=-2)
    return upper_limit(distance, limit_m, both)
