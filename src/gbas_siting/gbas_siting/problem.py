"""What is to be placed, and how a set of places is judged."""

from __future__ import annotations

import itertools
import math
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.record import FloatArray
from gbas_core.signals import BANDS, IONO_RATIO, L1, N_BANDS, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import (
    GRADIENT_RANGE,
    BaselineMonitor,
    check_gradient_range,
    k_factor,
    projected_length_m,
)
from gbas_siting.worst_gradient import Worst, worst_gradient

Baselines = Literal["star", "all"]

MAX_LENGTH_M: Final = 500.0
MAX_RECEIVERS: Final = 12
"""Bound against searches without end; a station has four."""


@parameters
class SitingProblem:
    """Receivers to be placed along a runway.

    New receivers are put on the line through the first receiver along the runway. With a star, baselines of the first
    receiver are monitored; otherwise every pair. A new receiver may come to stand the tolerance from its planned
    distance to the first one: the result holds for the worst case. Without a greatest length it is
    :data:`MAX_LENGTH_M`, or the longest existing baseline where that is longer. A gradient need be detected on one of
    the bands.

    Raises
    ------
    ParameterError
        For anything out of bounds.
    """

    n_receivers: Annotated[int, Parameter("receivers in all, those that exist included", "-", 2, MAX_RECEIVERS)]
    existing_m: Annotated[
        tuple[tuple[float, float], ...],
        Parameter("east and north of receivers that stay; none: the first is put at the origin", "m"),
    ] = ()
    runway_bearing_rad: Annotated[float, Parameter("true bearing of the runway", "deg", -360.0, 360.0)] = 0.5 * math.pi
    gradient_range: Annotated[
        tuple[float, float], Parameter("gradients to be detected, along the runway", "m/m", 0.0, 1.0)
    ] = GRADIENT_RANGE
    k: Annotated[
        float,
        Parameter(
            "standard deviations between a multiple of the wavelength and a detectable gradient", "-", 0.0, 100.0
        ),
    ] = k_factor()
    baselines: Annotated[Baselines, Parameter("which baselines are monitored")] = "star"
    tolerance_m: Annotated[float, Parameter("placement tolerance along the runway", "m", 0.0)] = 0.0
    max_length_m: Annotated[
        float | None, Parameter("farthest a new receiver may be from the first, along the runway", "m", 0.0, 1.0e5)
    ] = None
    bands: Annotated[tuple[int, ...], Parameter("numbers of the bands that are monitored", "-", 0, N_BANDS - 1)] = (L1,)

    def __post_init__(self) -> None:
        if len(self.existing_m) > self.n_receivers:
            raise ParameterError(
                f"receivers is {self.n_receivers}: must be at least the number of existing ones, {len(self.existing_m)}"
            )
        check_gradient_range(self.gradient_range)
        if not self.k > 0.0:
            raise ParameterError(f"k = {self.k!r} is not above 0")
        if not 0.0 < self.length_limit_m <= 1.0e5:
            raise ParameterError(f"max_length_m = {self.length_limit_m!r} is not above 0 and at most 100 km")
        if not len(set(self.bands)) == len(self.bands) > 0:
            raise ParameterError(f"bands = {self.bands!r} is not one or more of {', '.join(BANDS)}, each once")

    @property
    def n_new(self) -> int:
        """Receivers to be placed."""
        return self.n_receivers - self.n_fixed

    @property
    def n_fixed(self) -> int:
        """Receivers whose place is given: those that exist, or the first one at the origin."""
        return max(1, len(self.existing_m))

    @cached_property
    def fixed_m(self) -> FloatArray:
        """Places along the runway of the fixed receivers, from the first ``(n_fixed,)`` [m]."""
        if not self.existing_m:
            return np.zeros(1)
        positions = np.array(self.existing_m, dtype=np.float64)
        return projected_length_m(positions - positions[0], self.runway_bearing_rad)

    @property
    def length_limit_m(self) -> float:
        """Farthest a new receiver may be from the first [m]."""
        if self.max_length_m is not None:
            return self.max_length_m
        return max(MAX_LENGTH_M, float(np.abs(self.fixed_m).max()))

    @property
    def two_sided(self) -> bool:
        """Whether it matters on which side of the first receiver a new one is.

        A star knows distances only, and without existing receivers the first can be the one at the end.
        """
        return self.baselines == "all" and self.n_fixed > 1

    @cached_property
    def pairs(self) -> NDArray[np.int64]:
        """Receivers of each monitored baseline ``(p, 2)``."""
        if self.baselines == "star":
            return np.array([(0, other) for other in range(1, self.n_receivers)])
        return np.array(list(itertools.combinations(range(self.n_receivers), 2)))

    @cached_property
    def _gain(self) -> FloatArray:
        """Ionosphere on each band, one column a band."""
        result: FloatArray = IONO_RATIO[list(self.bands), np.newaxis]
        return result

    @cached_property
    def wavelength_m(self) -> FloatArray:
        """Wavelength of each monitor: all baselines on the first band, then all on the next ``(c,)`` [m]."""
        result: FloatArray = np.repeat(WAVELENGTH_M[list(self.bands)], len(self.pairs))
        return result

    @cached_property
    def slack_m(self) -> FloatArray:
        """What the placement tolerance takes off each monitor ``(c,)`` [m]."""
        slack: FloatArray = self.width_m(np.full((1, self.n_new), self.tolerance_m))[0]
        return slack

    def slope_m(self, new_m: FloatArray) -> FloatArray:
        """Delay over each monitored baseline per unit gradient ``(n, c)`` for places ``(n, n_new)`` [m]."""
        places = self.places_m(new_m)
        return self._monitors(np.abs(places[:, self.pairs[:, 1]] - places[:, self.pairs[:, 0]]))

    def width_m(self, half_m: FloatArray) -> FloatArray:
        """Half width of each slope ``(n, c)`` when places have half widths ``(n, n_new)`` [m]."""
        own = np.concatenate([np.zeros((half_m.shape[0], self.n_fixed)), half_m], axis=1)
        return self._monitors(own[:, self.pairs[:, 1]] + own[:, self.pairs[:, 0]])

    def _monitors(self, lengths_m: FloatArray) -> FloatArray:
        result: FloatArray = (lengths_m[:, np.newaxis] * self._gain).reshape(lengths_m.shape[0], -1)
        return result

    def places_m(self, new_m: FloatArray) -> FloatArray:
        """Places along the runway of all receivers, the fixed ones first ``(n, n_receivers)`` [m]."""
        fixed = np.broadcast_to(self.fixed_m, (new_m.shape[0], self.n_fixed))
        return np.concatenate([fixed, new_m], axis=1)

    def guaranteed(self, new_m: FloatArray, *, enough_m: float = -np.inf) -> Worst:
        """Statistic of the gradient seen worst, whatever the placement errors within the tolerance.

        Parameters
        ----------
        new_m : (n, n_new) array
            Places along the runway, from the first receiver [m].
        enough_m : float
            As in :func:`worst_gradient`.

        Notes
        -----
        Exact for a star. Between two new receivers both may be off: each such baseline is taken at its own worst, which
        no placement can fall below, and which not all baselines can have at once.
        """
        slope = self.slope_m(new_m)
        return worst_gradient(slope, self.wavelength_m, self.gradient_range, slack_m=self.slack_m, enough_m=enough_m)

    def bound_m(self, low_m: FloatArray, high_m: FloatArray, *, enough_m: float = -np.inf) -> FloatArray:
        """What no places between `low_m` and `high_m` ``(n, n_new)`` can exceed ``(n,)`` [m]."""
        slack = self.slack_m - self.width_m(0.5 * (high_m - low_m))
        slope = self.slope_m(0.5 * (low_m + high_m))
        result = worst_gradient(slope, self.wavelength_m, self.gradient_range, slack_m=slack, enough_m=enough_m)
        # No distance to a multiple is more than half a wavelength.
        bound: FloatArray = np.minimum(result.statistic_m, 0.5 * self.wavelength_m.max())
        return bound

    def monitors(self, new_m: FloatArray, sigma_m: float) -> tuple[BaselineMonitor, ...]:
        """The monitors of one set of places ``(n_new,)``, for coverage and blind intervals."""
        places = self.places_m(new_m[np.newaxis])[0]
        lengths = np.abs(places[self.pairs[:, 1]] - places[self.pairs[:, 0]])
        return tuple(
            BaselineMonitor(length_m=float(length), sigma_m=sigma_m, band=band)
            for band in self.bands
            for length in lengths
        )

    def positions_m(self, new_m: FloatArray) -> FloatArray:
        """East and north of all receivers, the existing ones first ``(n_receivers, 2)`` [m]."""
        existing = np.array(self.existing_m or ((0.0, 0.0),), dtype=np.float64)
        along = np.array([math.sin(self.runway_bearing_rad), math.cos(self.runway_bearing_rad)])
        return np.concatenate([existing, existing[0] + new_m[:, np.newaxis] * along])
