# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Sigma of a carrier by elevation."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def carrier_sigmas_m(elevation_rad, floor_m, low_m, scale_rad):
    """Sigma ``a_0 + a_1 exp(-E / E_0)`` of each band at each elevation, ``(F, N)`` [m]."""
    sigma = np.empty((len(floor_m), len(elevation_rad)))
    for sat in range(len(elevation_rad)):
        decay = np.exp(elevation_rad[sat] * (-1.0 / scale_rad))
        for band in range(len(floor_m)):
            sigma[band, sat] = floor_m[band] + low_m[band] * decay
    return sigma
