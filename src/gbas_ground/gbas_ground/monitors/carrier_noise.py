"""Sigma of a reference receiver's carrier, noise and multipath, by elevation and band."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.record import FloatArray
from gbas_ground.monitors.kernels.carrier_noise import carrier_sigmas_m

Bands = tuple[float, float, float]


@parameters
class CarrierNoise:
    """Sigma ``s (a_0 + a_1 exp(-E / E_0))`` of one receiver's carrier, not differenced.

    All uncertain (ours): measured on double differences of two geodetic receivers on a roof (UPC1 and UPC2, 38 m, 2010:
    L1 and L2) and of two on one metre (mosaic-X5, 2024: L5 and E5a), and enlarged until nothing of those recordings
    exceeds a Gaussian of this sigma. Antennas that limit multipath are better; measure at the site. A survey error of
    the baselines is part of a_0. The paper's r_ij is the ratio of two receivers' factors s.
    """

    floor_m: Annotated[Bands, Parameter("a_0, at the zenith, by band L1, L2, L5", "m", 1e-5, 1.0)] = (
        0.0012, 0.0012, 0.0025,
    )  # fmt: skip
    low_m: Annotated[Bands, Parameter("a_1, added at the horizon, by band L1, L2, L5", "m", 1e-5, 1.0)] = (
        0.010, 0.014, 0.016,
    )  # fmt: skip
    scale_rad: Annotated[float, Parameter("E_0, elevation over which it falls", "deg", 1.0, 90.0)] = math.radians(20.0)
    receiver_factor: Annotated[
        tuple[float, ...], Parameter("s of rr1, rr2, ..., or one for all", "-", 0.1, 10.0)
    ] = (1.0,)  # fmt: skip

    def __post_init__(self) -> None:
        if not self.receiver_factor:
            raise ParameterError("receiver_factor = () is not one number for all receivers, or one each")

    def sigma_m(self, elevation_rad: ArrayLike, bands: tuple[int, ...]) -> FloatArray:
        """Sigma of a receiver of factor 1, ``(F, N)`` for elevations ``(N,)`` [m]."""
        elevation = np.ascontiguousarray(elevation_rad, dtype=np.float64)
        sigma = np.empty((len(bands), len(elevation)))
        if bands not in self._coefficients_m:
            self._coefficients_m[bands] = np.array((self.floor_m, self.low_m), dtype=np.float64).take(bands, axis=1)
        carrier_sigmas_m(elevation, self._coefficients_m[bands], float(self.scale_rad), sigma)
        return sigma

    @cached_property
    def _coefficients_m(self) -> dict[tuple[int, ...], FloatArray]:
        """a_0 and a_1, ``(2, F)``, of the bands asked for so far [m]."""
        return {}

    def factors(self, n_receivers: int) -> FloatArray:
        """Factor of each receiver, ``(R,)``.

        Raises
        ------
        ValueError
            When there are neither one nor as many as receivers.
        """
        if n_receivers not in self._factors:
            if len(self.receiver_factor) not in (1, n_receivers):
                given = len(self.receiver_factor)
                raise ValueError(f"carrier noise: {given} receiver factors for {n_receivers} receivers")
            self._factors[n_receivers] = np.array(np.broadcast_to(self.receiver_factor, n_receivers), dtype=np.float64)
        return self._factors[n_receivers]

    @cached_property
    def _factors(self) -> dict[int, FloatArray]:
        return {}
