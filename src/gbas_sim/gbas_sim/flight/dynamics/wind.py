"""Wind over height: none, the same everywhere, or a profile."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.smooth import SmoothTable

_SPACING_M: Final = 20.0
# Below and above the given heights the wind stays as it is there.
_MARGIN_M: Final = 1000.0


@parameters
class Wind:
    """Horizontal wind, steady in time, between given heights along a monotone cubic curve; no heights: calm."""

    height_m: Annotated[
        tuple[float, ...], Parameter("heights above the ellipsoid, growing", "m", -1000.0, 30_000.0)
    ] = ()
    speed_mps: Annotated[tuple[float, ...], Parameter("speed at each of them", "m/s", 0.0, 150.0)] = ()
    from_rad: Annotated[
        tuple[float, ...], Parameter("where it blows from, clockwise from true north", "deg", -360.0, 360.0)
    ] = ()

    def __post_init__(self) -> None:
        if not len(self.height_m) == len(self.speed_mps) == len(self.from_rad):
            counts = f"{len(self.height_m)}, {len(self.speed_mps)} and {len(self.from_rad)}"
            raise ValueError(f"height_m, speed_mps and from_deg have {counts} values, not as many")
        if any(high - low < 1.0 for low, high in zip(self.height_m, self.height_m[1:], strict=False)):
            raise ValueError(f"height_m = {self.height_m!r} does not grow by at least 1")

    @classmethod
    def constant(cls, *, speed_mps: float, from_rad: float) -> Wind:
        """The same wind at every height."""
        return cls(height_m=(0.0,), speed_mps=(speed_mps,), from_rad=(from_rad,))

    @property
    def calm(self) -> bool:
        """True when the air is at rest everywhere."""
        return not any(self.speed_mps)

    @cached_property
    def _table(self) -> SmoothTable:
        speed, angle = np.array(self.speed_mps or (0.0,)), np.array(self.from_rad or (0.0,))
        knots = np.array(self.height_m or (0.0,))
        knots = np.concatenate([[knots[0] - _MARGIN_M], knots, [knots[-1] + _MARGIN_M]])
        blows = np.stack([-speed * np.sin(angle), -speed * np.cos(angle)], axis=-1)
        curve = PchipInterpolator(knots, np.concatenate([blows[:1], blows, blows[-1:]]))
        heights = np.linspace(knots[0], knots[-1], int(np.ptp(knots) / _SPACING_M) + 2)
        return SmoothTable.make(heights, curve(heights), curve(heights, 1))

    def at(self, height_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wind and its change with height.

        Parameters
        ----------
        height_m : (...) array
            Heights above the ellipsoid [m].

        Returns
        -------
        velocity_mps, gradient_ps : (..., 2) arrays
            East and north components of the air's velocity [m/s], and their derivatives by height [1/s].
        """
        height = np.asarray(height_m, dtype=np.float64)
        if self.calm:
            still = np.zeros((*height.shape, 2))
            return still, still
        velocity, gradient, _ = self._table.derivatives(height)
        return velocity, gradient
