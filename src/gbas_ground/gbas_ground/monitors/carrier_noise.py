"""Sigma of a reference receiver's carrier, noise and multipath, by elevation and band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray
from gbas_core.signals import N_BANDS


@dataclass(frozen=True, kw_only=True)
class CarrierNoise:
    """Sigma ``s (a_0 + a_1 exp(-E / E_0))`` of one receiver's carrier, not differenced.

    All uncertain (ours): measured on double differences of two geodetic receivers on a roof (UPC1 and UPC2, 38 m, 2010:
    L1 and L2) and of two on one metre (mosaic-X5, 2024: L5 and E5a), and enlarged until nothing of those recordings
    exceeds a Gaussian of this sigma. Antennas that limit multipath are better; measure at the site.

    Attributes
    ----------
    floor_m : tuple of float
        a_0 by band L1, L2, L5; a survey error of the baselines is part of it [m].
    low_m : tuple of float
        a_1 by band [m].
    scale_rad : float
        E_0 [rad].
    receiver_factor : tuple of float
        s, one a receiver, or one for all. The paper's r_ij is the ratio of two of them.
    """

    floor_m: tuple[float, ...] = (0.0012, 0.0012, 0.0025)
    low_m: tuple[float, ...] = (0.010, 0.014, 0.016)
    scale_rad: float = float(np.radians(20.0))
    receiver_factor: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        for name in ("floor_m", "low_m"):
            values = getattr(self, name)
            if len(values) != N_BANDS or not all(np.isfinite(value) and value > 0.0 for value in values):
                raise ValueError(f"carrier noise: {name} is {values}: one for each of the {N_BANDS} bands, above 0 m")
        if not (np.isfinite(self.scale_rad) and self.scale_rad > 0.0):
            raise ValueError(f"carrier noise: scale_rad is {self.scale_rad}: it must be above 0")
        if not self.receiver_factor or not all(np.isfinite(each) and each > 0.0 for each in self.receiver_factor):
            raise ValueError(f"carrier noise: receiver_factor is {self.receiver_factor}: at least one, all above 0")

    def sigma_m(self, elevation_rad: ArrayLike, bands: tuple[int, ...]) -> FloatArray:
        """Sigma of a receiver of factor 1, ``(F, N)`` for elevations ``(N,)`` [m]."""
        decay = np.exp(np.asarray(elevation_rad, dtype=np.float64) * (-1.0 / self.scale_rad))
        floor, low = np.array([[values[band] for band in bands] for values in (self.floor_m, self.low_m)])
        return np.asarray(floor[:, np.newaxis] + low[:, np.newaxis] * decay)

    def factors(self, n_receivers: int) -> FloatArray:
        """Factor of each receiver, ``(R,)``.

        Raises
        ------
        ValueError
            When there are neither one nor as many as receivers.
        """
        if len(self.receiver_factor) not in (1, n_receivers):
            raise ValueError(f"carrier noise: {len(self.receiver_factor)} receiver factors for {n_receivers} receivers")
        return np.broadcast_to(np.array(self.receiver_factor, dtype=np.float64), (n_receivers,))
