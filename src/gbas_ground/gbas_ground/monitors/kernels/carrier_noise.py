# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Sigma of a carrier by elevation."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled


@compiled
def carrier_sigma_m(elevation_rad, floor_m, low_m, scale_rad):
    """Sigma ``a_0 + a_1 exp(-E / E_0)`` of a receiver's carrier [m]."""
    return floor_m + low_m * np.exp(elevation_rad * (-1.0 / scale_rad))


@compiled
def carrier_sigmas_m(elevation_rad, coefficients_m, scale_rad, sigma_m):
    """The same of each band at each elevation, into ``(F, N)`` [m]; ``coefficients_m`` (2, F)."""
    for band in range(len(sigma_m)):
        for sat in range(len(elevation_rad)):
            sigma_m[band, sat] = carrier_sigma_m(
                elevation_rad[sat], coefficients_m[0, band], coefficients_m[1, band], scale_rad
            )


@compiled
def differenced_sigma_m(scale, sigma_m, reference_m):
    """Sigma of a double difference, of two satellites' carriers and the scale of a baseline's receivers [m]."""
    return scale * np.hypot(sigma_m, reference_m)
