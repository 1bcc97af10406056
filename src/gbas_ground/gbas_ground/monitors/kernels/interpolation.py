# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""A table between its nodes."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def interpolated(x, nodes, values):
    """Linear between rising nodes ``(K,)``, constant beyond them; NaN for NaN."""
    if np.isnan(x):
        return np.nan
    if x >= nodes[-1]:
        return values[-1]
    if x < nodes[0]:
        return values[0]
    place = 0
    while x >= nodes[place + 1]:
        place += 1
    slope = (values[place + 1] - values[place]) / (nodes[place + 1] - nodes[place])
    return slope * (x - nodes[place]) + values[place]
