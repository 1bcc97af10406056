# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""The worst of what a test compares."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def excess(statistic, threshold):
    """How far a statistic is over its threshold, of the threshold's size; minus infinity without one.

    Thresholds may be negative.
    """
    over = (statistic - threshold) / np.abs(threshold)
    return -np.inf if np.isnan(over) else over


@compiled
def worst_along(statistic, threshold, failed):
    """Of each test and satellite the comparison furthest over its threshold, or nearest to it: the first of equals.

    Parameters
    ----------
    statistic, threshold : (T, M, N) arrays
    failed : (T, M, N) bool array

    Returns
    -------
    statistic, threshold : (T, N) arrays
    failed : (T, N) bool array
        Whether any did.
    """
    n_tests, count, n_sats = statistic.shape
    worst, limit = np.empty((n_tests, n_sats)), np.empty((n_tests, n_sats))
    fails = np.zeros((n_tests, n_sats), dtype=np.bool_)
    for test in range(n_tests):
        for sat in range(n_sats):
            place, largest = 0, -np.inf
            for each in range(count):
                over = excess(statistic[test, each, sat], threshold[test, each, sat])
                if over > largest:
                    place, largest = each, over
                fails[test, sat] |= failed[test, each, sat]
            worst[test, sat], limit[test, sat] = statistic[test, place, sat], threshold[test, place, sat]
    return worst, limit, fails
