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
def worst_along(statistic, threshold, failed, worst, fails):
    """Of each test and satellite the comparison furthest over its threshold, or nearest to it: the first of equals.

    Parameters
    ----------
    statistic, threshold : (T, M, N) arrays
    failed : (T, M, N) bool array
    worst : (2, T, N) array
        Filled in: its statistic and threshold.
    fails : (T, N) bool array
        Filled in: whether any did.
    """
    n_tests, count, n_sats = statistic.shape
    for test in range(n_tests):
        for sat in range(n_sats):
            place, largest, fails[test, sat] = 0, -np.inf, False
            for each in range(count):
                over = excess(statistic[test, each, sat], threshold[test, each, sat])
                if over > largest:
                    place, largest = each, over
                fails[test, sat] |= failed[test, each, sat]
            worst[0, test, sat], worst[1, test, sat] = statistic[test, place, sat], threshold[test, place, sat]
