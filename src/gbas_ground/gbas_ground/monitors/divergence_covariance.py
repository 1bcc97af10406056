"""Covariance of the filtered two-frequency statistics: the paper's, the one noise gives, and one calibrated from data.

Statistics are in the order (DF, DF of the other band, IF carrier): divergence-free code minus carrier of each band,
ionosphere-free compensated carrier. The paper's fourth, ionosphere-free code minus carrier, is a combination of the
first two, so that a covariance of all four is singular.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (16) and (18).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.divergence import white_noise_gain
from gbas_core.record import FloatArray
from gbas_ground.monitors.kernels.ccd_f import covariances

Matrix3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
Triple = tuple[float, float, float]
Triangle = tuple[float, float, float, float, float, float]
_UPPER: Final = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))

# Known: ENC 2015, eq (18) [(m/s)^2]: DF1, DF5, IF code, IF carrier, of one receiver with a multipath limiting antenna.
PRINTED_COVARIANCE: Final[FloatArray] = 1e-5 * np.array(
    [
        [0.1484, 0.0001, 0.3353, 0.0003],
        [0.0001, 0.1356, -0.1709, 0.0004],
        [0.3353, -0.1709, 0.9735, 0.0],
        [0.0003, 0.0004, 0.0, 0.0724],
    ]
)
INDEPENDENT: Final = (0, 1, 3)
"""Places of the three independent statistics among the paper's four."""


_ZERO: Final[Matrix3] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def triangle(matrix: Matrix3) -> Triangle:
    """Upper triangle of a symmetric matrix, by rows."""
    return tuple(matrix[row][column] for row, column in _UPPER)  # type: ignore[return-value]


def matrix_of(values: Triangle) -> Matrix3:
    """Symmetric matrix of an upper triangle."""
    a, b, c, d, e, f = values
    return ((a, b, c), (b, d, e), (c, e, f))


def _matrix3(values: FloatArray) -> Matrix3:
    first, second, third = (tuple(float(value) for value in row) for row in values)
    return first, second, third  # type: ignore[return-value]


def measurement_covariance(
    sigma_m: FloatArray, band: int, other: int, *, alpha: float, interval_s: float, clock_satellites: float, white: str
) -> FloatArray:
    """Covariance of the four filtered statistics for independent white noise on the four measurements.

    Parameters
    ----------
    sigma_m : (4,) array
        Standard deviations of code, other code, carrier, other carrier [m].
    band, other : int
    alpha, interval_s : float
        T / tau, and T [s].
    clock_satellites : float
        Satellites averaged for the receiver clock, n; ``inf``: a known clock.
    white : {"rate", "measurement"}
        What is white: the rates, as in the paper's eq (7) and (16), or the measurements, which makes the covariance
        smaller by about alpha^2 / 2.

    Returns
    -------
    (4, 4) array
        Of rank 3 [(m/s)^2].

    Notes
    -----
    For the rate, this is eq (16), ``(alpha / 4 T^2) 2 A diag(sigma^2) A^T`` with ``1 + 1/n`` on the variance of the
    carrier statistic. Departures: the printed Q(4,4) has code variances where the carrier's own belong, and Q(3,4) has
    a code variance where that of the carrier of the first band belongs.
    """
    matrix = combination_matrix(band, other)
    gains = {"rate": 0.5 * alpha, "measurement": white_noise_gain(alpha) ** 2}
    if white not in gains:
        raise ValueError(f"white is {white!r}: it must be one of {', '.join(gains)}")
    covariance: FloatArray = gains[white] / interval_s**2 * (matrix * np.asarray(sigma_m) ** 2) @ matrix.T
    covariance[3, 3] *= 1.0 + 1.0 / clock_satellites
    return covariance


@dataclass(frozen=True, kw_only=True)
class StatisticCovariance:
    """Covariance of the mean of three statistics over M receivers, at an elevation.

    ``Q = s s^T * (common + receiver / M)``, with ``1 + 1/n`` on the carrier statistic's variance for the n satellites
    that give the receiver clock; s are factors that depend on elevation.

    Attributes
    ----------
    receiver : 3 x 3
        Part that is independent from receiver to receiver [(m/s)^2].
    common : 3 x 3
        Part that all receivers have together, which averaging does not reduce [(m/s)^2].
    elevation_rad : tuple of float
        Nodes, rising; none: no dependence [rad].
    factor : tuple of triples
        Factors on the standard deviations at the nodes, linear between and held beyond [-].

    Notes
    -----
    The default is the paper's printed bound on all receivers together, so more receivers do not make it smaller: how
    much of it is common is not known of antennas nobody has measured. Two ordinary antennas a metre apart share so much
    multipath that half of the codes' variance would alarm without a fault. A station calibrates its own with
    :func:`calibrate`, which finds the common part; :func:`published_by_origin` divides what physics allows.
    """

    receiver: Matrix3 = _ZERO
    common: Matrix3 = _matrix3(PRINTED_COVARIANCE[np.ix_(INDEPENDENT, INDEPENDENT)])
    elevation_rad: tuple[float, ...] = ()
    factor: tuple[Triple, ...] = ()

    def __post_init__(self) -> None:
        total = np.array(self.receiver) + np.array(self.common)
        if total.shape != (3, 3) or not np.isfinite(total).all() or not np.allclose(total, total.T, rtol=1e-9):
            raise ValueError("receiver + common is not a symmetric 3 x 3 matrix")
        for name in ("receiver", "common"):
            smallest = np.linalg.eigvalsh(np.array(getattr(self, name))).min()
            if not smallest >= -1e-12 * np.trace(total):
                raise ValueError(f"{name} has a negative eigenvalue, {smallest:g}: it is not a covariance")
        if not np.linalg.eigvalsh(total).min() > 0.0:
            raise ValueError("receiver + common is singular: the three statistics must be independent")
        if len(self.elevation_rad) != len(self.factor) or (np.diff(self.elevation_rad) <= 0.0).any():
            raise ValueError("elevation_rad must rise and have one triple of factors each")
        if not all(np.isfinite(value) and value > 0.0 for triple in self.factor for value in triple):
            raise ValueError(f"factor is {self.factor}: all must be above 0")

    def at(self, elevation_rad: FloatArray, receivers: FloatArray, clock_satellites: FloatArray) -> FloatArray:
        """Covariances.

        Parameters
        ----------
        elevation_rad, receivers, clock_satellites : (N,) arrays
            Elevation [rad], M and n; where one is not known (NaN) the covariance is not, either.

        Returns
        -------
        (N, 3, 3) array
            [(m/s)^2].
        """
        elevation, number, others = np.array([elevation_rad, receivers, clock_satellites], dtype=np.float64)
        found: FloatArray = covariances(elevation, number, others, *self.tables)
        return found

    @cached_property
    def tables(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Both parts ``(3, 3)``, nodes ``(K,)`` and factors ``(K, 3)``."""
        factor = np.array(self.factor, dtype=np.float64).reshape(-1, 3)
        return np.array(self.receiver), np.array(self.common), np.array(self.elevation_rad, dtype=np.float64), factor


def published_by_origin() -> StatisticCovariance:
    """The printed covariance with the codes' part as each receiver's own, for antennas whose multipath is independent.

    Divergence-free code minus carrier has nothing in it but noise and multipath of one antenna. The compensated carrier
    also has what all receivers see alike: satellite clock and orbit, and the troposphere; its variance, its covariances
    and what these explain of the codes' variances are taken as common. The paper divides all by M.
    """
    printed = PRINTED_COVARIANCE[np.ix_(INDEPENDENT, INDEPENDENT)]
    common = np.outer(printed[:, -1], printed[:, -1]) / printed[-1, -1]
    return StatisticCovariance(receiver=_matrix3(printed - common), common=_matrix3(common))


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A calibrated covariance, and how it compares with the data it was made from.

    Attributes
    ----------
    covariance : StatisticCovariance
        Overbounds the data.
    samples : int
        Statistics used.
    effective_samples : float
        Independent ones among them, after the filters' correlation.
    inflation : float
        Factor on the fitted covariance that the tails needed, times that for the small sample [-].
    tail_inflation, sample_inflation : float
        The two [-].
    common_known : bool
        Whether several receivers told what they have in common; otherwise everything counts as common.
    """

    covariance: StatisticCovariance
    samples: int
    effective_samples: float
    inflation: float
    tail_inflation: float
    sample_inflation: float
    common_known: bool


def calibrate(
    statistics_mps: FloatArray,
    elevation_rad: FloatArray,
    *,
    clock_satellites: FloatArray | float = np.inf,
    interval_s: float,
    tau_s: float,
    edges_rad: FloatArray | None = None,
    confidence: float = 0.95,
    tail_from: float = 0.5,
) -> Calibration:
    """Covariance whose Gaussian bounds recorded statistics in the tails, not only in variance.

    Parameters
    ----------
    statistics_mps : (E, R, 3, N) array
        Filtered statistics of fault-free epochs, NaN where they do not count [m/s].
    elevation_rad : (E, N) array
    clock_satellites : (E, N) array or float
        n behind each carrier statistic, whose factor ``1 + 1/n`` is taken out.
    interval_s, tau_s : float
        Of the epochs and of the filter [s].
    edges_rad : (k + 1,) array, optional
        Bins of elevation for the factors; without them there is no dependence on elevation [rad].
    confidence : float
        One-sided confidence that the variance is not above the fitted one, from the independent samples there are.
    tail_from : float
        Quantiles from this one to the largest sample are bounded.

    Returns
    -------
    Calibration

    Raises
    ------
    ValueError
        When there are fewer than 30 complete statistics, or less than two independent ones.

    Notes
    -----
    Zero is taken as the mean: a constant rate counts as spread. What receivers have in common is the mean product of
    different receivers' statistics; its negative eigenvalues, which only noise can bring, are set to zero. Each
    receiver's quadratic form ``x^T Q^-1 x`` is then sorted, and Q is inflated by the largest ratio of a sample to
    the quantile of chi-square with 3 degrees of freedom at its rank, ``i / (m + 1)``. Beyond the largest sample the
    bound is an extrapolation, as for every empirical bound at 1e-9. The filtered rates are correlated over about
    4 tau: so many seconds of one channel count as one sample.
    """
    x = np.moveaxis(np.asarray(statistics_mps, dtype=np.float64), 2, -1).copy()  # (E, R, N, 3)
    x[..., 2] /= np.sqrt(1.0 + 1.0 / np.broadcast_to(clock_satellites, elevation_rad.shape))[:, np.newaxis]
    complete = np.isfinite(x).all(axis=-1) & np.isfinite(elevation_rad)[:, np.newaxis]
    samples = int(complete.sum())
    independent = samples * interval_s / (4.0 * tau_s)
    if samples < 30 or independent < 2.0:
        raise ValueError(f"{samples} statistics ({independent:.1f} independent ones) are too few to calibrate from")
    nodes, factor = _elevation_factors(x, complete, elevation_rad, edges_rad)
    scaled = x / _interpolated(elevation_rad, nodes, factor)[:, np.newaxis]
    common, known = _common_part(scaled, complete)
    total = _mean_product(scaled[complete])
    if not known:
        common = total
    receiver = _without_negative(total - common)
    common = _without_negative(common)
    tail = _tail_inflation(scaled[complete], receiver + common, tail_from)
    sample = max(1.0, independent / float(chdtri(independent, confidence)))
    scale = tail * sample
    covariance = StatisticCovariance(
        receiver=_matrix3(scale * receiver),
        common=_matrix3(scale * common),
        elevation_rad=tuple(float(node) for node in nodes),
        factor=tuple((float(a), float(b), float(c)) for a, b, c in factor),
    )
    return Calibration(
        covariance=covariance,
        samples=samples,
        effective_samples=independent,
        inflation=scale,
        tail_inflation=tail,
        sample_inflation=sample,
        common_known=known,
    )


def _elevation_factors(
    x: FloatArray, complete: NDArray[np.bool_], elevation_rad: FloatArray, edges_rad: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Nodes (k,) and root mean squares of the bins over that of all, (k, 3); bins without enough data have no node."""
    if edges_rad is None:
        return np.empty(0), np.empty((0, 3))
    place = np.broadcast_to(elevation_rad[:, np.newaxis], complete.shape)[complete]
    values = x[complete]
    overall = np.sqrt((values**2).mean(axis=0))
    nodes, factors = [], []
    for low, high in pairwise(edges_rad):
        inside = values[(place >= low) & (place < high)]
        if len(inside) >= 30:
            nodes.append(0.5 * (low + high))
            factors.append(np.sqrt((inside**2).mean(axis=0)) / overall)
    return np.array(nodes), np.array(factors).reshape(-1, 3)


def _interpolated(elevation_rad: FloatArray, nodes: FloatArray, factor: FloatArray) -> FloatArray:
    if not len(nodes):
        return np.ones((*elevation_rad.shape, 3))
    return np.stack([np.interp(elevation_rad, nodes, column) for column in factor.T], axis=-1)


def _mean_product(values: FloatArray) -> FloatArray:
    return np.asarray(values.T @ values / len(values))


def _common_part(x: FloatArray, complete: NDArray[np.bool_]) -> tuple[FloatArray, bool]:
    """Mean product of different receivers' statistics, (3, 3), and whether there are any."""
    filled = np.where(complete[..., np.newaxis], x, 0.0)
    total = filled.sum(axis=1)
    own = np.einsum("erni,ernj->ij", filled, filled)
    count = complete.sum(axis=1)
    pairs = float((count * (count - 1)).sum())
    if pairs < 30:
        return np.zeros((3, 3)), False
    return (np.einsum("eni,enj->ij", total, total) - own) / pairs, True


def _without_negative(matrix: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _tail_inflation(values: FloatArray, covariance: FloatArray, tail_from: float) -> float:
    """Largest ratio of a sorted quadratic form to its chi-square quantile; 1 at least."""
    form = np.sort(np.einsum("mi,ij,mj->m", values, np.linalg.inv(covariance), values))
    upper = 1.0 - np.arange(1, len(form) + 1) / (len(form) + 1.0)
    bounded = upper <= 1.0 - tail_from
    return max(1.0, float((form[bounded] / chdtri(3.0, upper[bounded])).max()))
