# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""The middle of the values that are there."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def median(values):
    """Median of the finite values ``(N,)``; NaN without any."""
    there = values[np.isfinite(values)]
    if len(there) == 0:
        return np.nan
    there.sort()
    return 0.5 * (there[(len(there) - 1) // 2] + there[len(there) // 2])
