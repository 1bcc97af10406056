"""Averaged C/N0 of one channel after the other, and the mean over receivers."""

from __future__ import annotations

import math


def loop_average(values, times, tau_s, max_gap_s):
    """Exponential average of one channel's values (None where missing) at the last of the times; None without one."""
    mean = last = None
    for value, time in zip(values, times, strict=True):
        if value is None:
            continue
        if mean is None or time - last > max_gap_s:
            mean = value
        else:
            mean += min((time - last) / tau_s, 1.0) * (value - mean)
        last = time
    return mean if values[-1] is not None else None


def loop_minimum(elevation, nodes, values):
    """The table between its nodes, constant outside."""
    if elevation <= nodes[0]:
        return values[0]
    for low, high, below, above in zip(nodes, nodes[1:], values, values[1:], strict=False):
        if elevation <= high:
            return below + (above - below) * (elevation - low) / (high - low)
    return values[-1]


def mean_of(values):
    """Mean of what is there; NaN of nothing."""
    there = [value for value in values if value is not None]
    return sum(there) / len(there) if there else math.nan
