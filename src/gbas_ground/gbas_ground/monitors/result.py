"""What every monitor returns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray


class MonitorResult(NamedTuple):
    """Statistic, threshold and verdict of one monitor at one epoch.

    Attributes
    ----------
    statistic : (..., N) array
        What is compared; NaN where the monitor could not look.
    threshold : array that broadcasts against `statistic`
        In the statistic's unit.
    failed : (..., N) bool array
        Where the monitor failed. A statistic that should be there and is not also fails; one that need not be there
        (the satellite is not tracked, the receiver not used) does not.
    """

    statistic: FloatArray
    threshold: FloatArray
    failed: BoolArray

    def at(self, *index: int) -> tuple[float, float]:
        """Statistic and threshold at one place, for an event."""
        threshold = np.broadcast_to(self.threshold, self.statistic.shape)
        return float(self.statistic[index]), float(threshold[index])


def upper_limit(statistic: FloatArray, threshold: FloatArray | float, applies: BoolArray) -> MonitorResult:
    """Verdict of a monitor that fails above a threshold; where it applies, NaN on either side fails too."""
    limit = np.asarray(threshold, dtype=np.float64)
    return MonitorResult(statistic=statistic, threshold=limit, failed=applies & ~(statistic <= limit))
