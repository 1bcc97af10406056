"""The troposphere: refractivity that falls exponentially with height, the same over the whole site.

For this atmosphere the correction a GBAS receiver applies between the station's height and its own is exact, when the
station broadcasts its refractivity and scale height; what remains is that aircraft and station see a satellite at
different elevations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray

# Known: obliquity 1 / sqrt(0.002 + sin^2 E). Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3.
_OBLIQUITY: Final = 0.002


@dataclass(frozen=True, kw_only=True)
class Troposphere:
    """Exponential refractivity.

    Attributes
    ----------
    refractivity : float
        At the reference height [N units]; 0 is a vacuum.
    scale_height_m : float
        Height over which it falls to 1/e [m].
    reference_height_m : float
        Above the ellipsoid [m].
    """

    refractivity: float = 0.0
    scale_height_m: float = 7900.0
    reference_height_m: float = 0.0

    def __post_init__(self) -> None:
        bounds = {
            "refractivity": (0.0, 800.0),
            "scale_height_m": (100.0, 30_000.0),
            "reference_height_m": (-1000.0, 20_000.0),
        }
        for key, (low, high) in bounds.items():
            value = getattr(self, key)
            if not low <= value <= high:
                raise ValueError(f"troposphere: {key} = {value!r} is not within {low:g} to {high:g}")

    def delay_m(self, height_m: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        """Delay ``(..., N_SATS)`` at heights ``(...)`` and elevations ``(..., N_SATS)`` [m].

        Source: the integral of 1e-6 N exp(-(h - h_ref) / h_0) over height from the receiver up, times the obliquity.
        """
        above = (height_m - self.reference_height_m) / self.scale_height_m
        zenith_m = 1e-6 * self.refractivity * self.scale_height_m * np.exp(-above)
        return np.asarray(zenith_m[..., np.newaxis] / np.sqrt(_OBLIQUITY + np.sin(elevation_rad) ** 2))
