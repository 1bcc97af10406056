"""Which gradients explain double differences: along a runway, and as a vector with its direction.

A double difference is known to a whole number of wavelengths only, so that what explains it is a set. Baselines of one
direction tell the component along it. Baselines of several directions tell the gradient vector, east and north, and
with it the direction of the front; how its delay changes in time then tells how fast the front goes.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach,
eq (2), (3), and its outlook: the direction of the front from baselines that are not collinear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from gbas_core.record import FloatArray
from gbas_core.signals import IONO_RATIO, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE, wrap_m

LEAST_ANGLE_RAD: Final = float(np.radians(5.0))
"""Directions of baselines that differ by less tell no direction of a gradient. Ours."""


def gradient_set(
    residual_m: FloatArray,
    sigma_m: FloatArray,
    length_m: FloatArray,
    bands: tuple[int, ...],
    *,
    largest: float = GRADIENT_RANGE[1],
    p_lost: float = 1.0e-4,
) -> FloatArray:
    """All gradients along the runway that explain the double differences of one satellite, n lambda and all.

    Parameters
    ----------
    residual_m, sigma_m : (B, F) arrays
        Double differences and their sigmas [m]; NaN where there is none.
    length_m : (B,) array
        Signed lengths along the runway [m].
    bands : tuple of int
        The F bands.
    largest : float
        Largest size looked for [m/m].
    p_lost : float
        Probability that the true gradient is not in the set.

    Returns
    -------
    (n,) array
        In order of size [m/m]: of one baseline, every ``(-dd + n lambda) / slope``; of several, those on which they
        agree (chi-square of the residuals). Empty if no gradient along the runway explains them.

    Source: the paper, eq (2), (3).
    """
    slope = length_m[:, np.newaxis] * IONO_RATIO[list(bands)]
    there = np.isfinite(residual_m + sigma_m) & (slope != 0.0)
    if not there.any():
        return np.empty(0)
    delay, sigma, slope = -residual_m[there], sigma_m[there], slope[there]
    wavelength = np.broadcast_to(WAVELENGTH_M[list(bands)], there.shape)[there]
    first = int(np.argmax(np.abs(slope) / wavelength))  # its multiples are the closest
    most = int(np.ceil((largest * abs(slope[first]) + wavelength[first]) / wavelength[first]))
    start = (delay[first] + np.arange(-most, most + 1) * wavelength[first]) / slope[first]
    whole = np.rint((start[:, np.newaxis] * slope - delay) / wavelength) * wavelength + delay
    weight = slope / sigma**2
    gradient = whole @ weight / (slope @ weight)
    misfit = (((whole - gradient[:, np.newaxis] * slope) / sigma) ** 2).sum(axis=-1)
    agrees = misfit <= chdtri(max(1, delay.size - 1), p_lost)
    kept = gradient[agrees & (np.abs(gradient) <= largest)]
    return np.asarray(kept[np.argsort(np.abs(kept), kind="stable")])


@dataclass(frozen=True, kw_only=True, eq=False)
class GradientVectors:
    """Gradient vectors that explain the double differences of a satellite, best fit first.

    Attributes
    ----------
    vector : (n, 2) array
        East and north, towards more delay on L1 [m/m].
    misfit : (n,) array
        Chi-square of the residuals [-].
    covariance : (2, 2) array
        Of each vector, given its whole wavelengths [(m/m)^2]; NaN without a result.
    """

    vector: FloatArray
    misfit: FloatArray
    covariance: FloatArray

    @property
    def size(self) -> FloatArray:
        """Sizes, ``(n,)`` [m/m]."""
        return np.asarray(np.hypot(self.vector[:, 0], self.vector[:, 1]))

    @property
    def azimuth_rad(self) -> FloatArray:
        """Directions towards more delay, from north, ``(n,)`` [rad]; the front lies across."""
        return np.asarray(np.arctan2(self.vector[:, 0], self.vector[:, 1]) % (2.0 * np.pi))

    @property
    def azimuth_sigma_rad(self) -> FloatArray:
        """Their standard deviations, to first order, ``(n,)`` [rad]."""
        across = np.stack([self.vector[:, 1], -self.vector[:, 0]], axis=-1)
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", across, self.covariance, across)) / self.size**2)

    def along(self, bearing_rad: float) -> tuple[FloatArray, float]:
        """Components along a bearing ``(n,)``, and their standard deviation [m/m]."""
        direction = np.array([np.sin(bearing_rad), np.cos(bearing_rad)])
        return self.vector @ direction, float(np.sqrt(direction @ self.covariance @ direction))


_NONE: Final = GradientVectors(vector=np.empty((0, 2)), misfit=np.empty(0), covariance=np.full((2, 2), np.nan))


def gradient_vectors(
    difference_m: FloatArray,
    sigma_m: FloatArray,
    factor: FloatArray,
    place_m: FloatArray,
    bands: tuple[int, ...],
    *,
    largest: float = GRADIENT_RANGE[1],
    p_lost: float = 1.0e-4,
) -> GradientVectors:
    """All gradient vectors that explain one satellite's carriers against a reference satellite's.

    Parameters
    ----------
    difference_m : (R, F) array
        Carrier residual of the satellite less that of the reference, at each receiver [m]; NaN where there is none.
    sigma_m : (F,) array
        Its sigma at a receiver of factor 1: root sum square of both satellites' carriers [m].
    factor : (R,) array
        Noise of each receiver relative to that [-].
    place_m : (R, 2) or (R, 3) array
        Receivers, east and north first [m].
    bands : tuple of int
        The F bands.
    largest : float
        Largest size looked for [m/m].
    p_lost : float
        Probability that the true vector is not in the set.

    Returns
    -------
    GradientVectors
        None (n = 0) where the baselines do not have two directions.

    Notes
    -----
    Least squares over the baselines from one receiver, whose noise they share (the paper's eq (1) with the receivers'
    ratios, and the covariance between baselines). Whole wavelengths: all of the two baselines that span the largest
    area, and for the others the nearest. With two baselines nothing is left to choose by: every pair of whole
    wavelengths is a solution, which is why the paper asks for more baselines.
    """
    delay, design, covariance, wavelength = _observed(difference_m, sigma_m, factor, place_m, bands)
    pair = _widest_pair(design, wavelength)
    if pair is None:
        return _NONE
    most = np.ceil(largest * np.hypot(*design[pair].T) / wavelength[pair]).astype(int) + 1
    whole = np.stack(np.meshgrid(*(np.arange(-each, each + 1) for each in most), indexing="ij"), axis=-1).reshape(-1, 2)
    start = np.linalg.solve(design[pair], (delay[pair] + whole * wavelength[pair]).T).T
    start = start[np.hypot(*start.T) <= 1.1 * largest]  # the fit moves them a little
    unwrapped = delay + wavelength * np.rint((start @ design.T - delay) / wavelength)
    weight = np.linalg.inv(covariance)
    own = np.asarray(np.linalg.inv(design.T @ weight @ design), dtype=np.float64)
    vector = unwrapped @ weight @ design @ own
    left = unwrapped - vector @ design.T
    misfit = np.einsum("ni,ij,nj->n", left, weight, left)
    kept = np.hypot(*vector.T) <= largest
    if delay.size > 2:
        kept &= misfit <= chdtri(delay.size - 2, p_lost)
    order = np.argsort(misfit[kept], kind="stable")
    return GradientVectors(vector=vector[kept][order], misfit=misfit[kept][order], covariance=own)


def _observed(
    difference_m: FloatArray, sigma_m: FloatArray, factor: FloatArray, place_m: FloatArray, bands: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Delay, its derivative by the gradient (K, 2), covariance (K, K) and wavelength of all baselines and bands."""
    delay, design, blocks, wavelength = [], [], [], []
    for place, band in enumerate(bands):
        there = np.flatnonzero(np.isfinite(difference_m[:, place]))
        if there.size < 2:
            continue
        first, others = there[0], there[1:]
        delay.append(wrap_m(difference_m[first, place] - difference_m[others, place], float(WAVELENGTH_M[band])))
        design.append(float(IONO_RATIO[band]) * (place_m[others, :2] - place_m[first, :2]))
        blocks.append(sigma_m[place] ** 2 * (np.diag(factor[others] ** 2) + factor[first] ** 2))
        wavelength.append(np.full(others.size, float(WAVELENGTH_M[band])))
    if not delay:
        return np.empty(0), np.empty((0, 2)), np.empty((0, 0)), np.empty(0)
    return np.concatenate(delay), np.concatenate(design), block_diag(*blocks), np.concatenate(wavelength)


def _widest_pair(design: FloatArray, wavelength: FloatArray) -> list[int] | None:
    """The two baselines that span the largest area in wavelengths; None when all have about one direction."""
    cycles = design / wavelength[:, np.newaxis]
    area = np.abs(cycles[:, np.newaxis, 0] * cycles[:, 1] - cycles[:, np.newaxis, 1] * cycles[:, 0])
    length = np.hypot(cycles[:, 0], cycles[:, 1])
    apart = area > np.sin(LEAST_ANGLE_RAD) * length[:, np.newaxis] * length
    if not apart.any():
        return None
    first, second = np.unravel_index(int(np.argmax(np.where(apart, area, 0.0))), area.shape)
    return [int(first), int(second)]


def front_speed_mps(
    vector: FloatArray, covariance: FloatArray, rate_mps: float, rate_sigma_mps: float
) -> tuple[float, float]:
    """Speed of a front across itself, from its gradient and from how its delay grows at a receiver.

    Parameters
    ----------
    vector : (2,) array
        Gradient, towards more delay [m/m].
    covariance : (2, 2) array
        Of it.
    rate_mps, rate_sigma_mps : float
        Growth of the delay on L1 while its slope passes, against a reference satellite, and its sigma [m/s].

    Returns
    -------
    speed_mps, sigma_mps : float
        Relative to the ground and to the satellite's line of sight; positive towards less delay (the delay grows). To
        first order.

    Raises
    ------
    ValueError
        For a gradient of zero.

    Notes
    -----
    A plane front ``d(x, t) = g . (x - v t)`` has ``d' = -g . v``.
    """
    size = float(np.hypot(*vector))
    if not size > 0.0:
        raise ValueError(f"gradient is {vector}: it must not be zero")
    towards = np.asarray(vector) / size
    size_sigma = float(np.sqrt(towards @ covariance @ towards))
    return rate_mps / size, float(np.hypot(rate_sigma_mps, rate_mps / size * size_sigma) / size)
