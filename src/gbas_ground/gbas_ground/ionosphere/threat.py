"""The ionospheric fronts a station protects its users against.

A front is a straight edge across which the slant delay of a satellite grows from none to a largest one, nowhere steeper
than a bound, wherever it is and wherever it moves. The protection needs the slope's bound, the largest delay and how
many satellites may be affected at once; smallest width and speeds count only for what the divergence monitor sees.

Sources: Pullen, Park, Enge, Radio Science 44 (2009) RS0A21 and Datta-Barua et al., J. Aircraft 47 (2010), pp. 912-922
(United States); Mayer et al., ION GNSS 2009, pp. 1091-1099 (Germany; its widths and speeds are those of the United
States: uncertain).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray

_DEGREE: Final = np.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class FrontThreat:
    """A threat model.

    Attributes
    ----------
    name : str
    elevation_rad, gradient : tuple of float
        Nodes of the largest slant gradient on L1 against elevation [rad], [m/m]; linear between them and constant
        beyond the first and last.
    min_width_m : float
        Least distance over which a front has all its delay [m].
    max_speed_mps : float
        Largest speed of a front relative to the station's pierce points [m/s].
    max_delay_m : float
        Largest slant delay on L1 [m].
    """

    name: str
    elevation_rad: tuple[float, ...]
    gradient: tuple[float, ...]
    min_width_m: float = 25_000.0
    max_speed_mps: float = 750.0
    max_delay_m: float = 50.0

    def __post_init__(self) -> None:
        if not self.gradient or len(self.gradient) != len(self.elevation_rad):
            raise ValueError(f"threat model {self.name}: gradients and elevations are not lists of one length")
        if any(high <= low for low, high in zip(self.elevation_rad, self.elevation_rad[1:], strict=False)):
            raise ValueError(f"threat model {self.name}: elevations {self.elevation_rad} do not rise")
        numbers = (*self.gradient, self.min_width_m, self.max_speed_mps, self.max_delay_m)
        if not all(np.isfinite(each) and each > 0.0 for each in numbers):
            raise ValueError(f"threat model {self.name}: gradients, width, speed and delay must be above 0 and finite")

    def largest_gradient(self, elevation_rad: ArrayLike) -> FloatArray:
        """Largest slant gradient at elevations [m/m]; NaN stays NaN."""
        return np.asarray(np.interp(np.asarray(elevation_rad, dtype=np.float64), self.elevation_rad, self.gradient))


THREATS: Final[Mapping[str, FrontThreat]] = MappingProxyType(
    {
        "conus": FrontThreat(
            name="conus", elevation_rad=(15.0 * _DEGREE, 65.0 * _DEGREE), gradient=(375.0e-6, 425.0e-6)
        ),
        "germany": FrontThreat(name="germany", elevation_rad=(0.0,), gradient=(140.0e-6,)),
    }
)
"""Threat models known by name."""
