"""The middle of the values that are there."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import FloatArray


@compiled
def median(values: FloatArray) -> float:
    """Median of the finite values ``(N,)``; NaN without any."""
    there = values[np.isfinite(values)]
    if len(there) == 0:
        return np.nan
    there.sort()
    return 0.5 * (there[(len(there) - 1) // 2] + there[len(there) // 2])
