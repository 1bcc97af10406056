"""Which positions a front of the threat model may spoil, and the least inflation after which none of them is used.

Screened are the places an aircraft may be at, its speed and accuracy designator (a *case*), and the satellites it may
use (a *subset* of those corrected). In each the position is formed as the airborne receiver does: weights from the
broadcast sigmas, one clock a constellation, projections on the vertical and lateral error. The worst error is that of
the worst satellite, or of the worst two, at their largest range errors, plus a multiple of the nominal error. A
position is safe when that is within the protection level or within what is tolerable; or when the protection level
is above the alert limit, so that no aircraft has service with it.

Source: position-domain geometry screening, Lee, Seo, Park, Pullen, Enge, GPS Solutions 15 (2011), pp. 29-47; Pullen,
Park, Enge, Radio Science 44 (2009) RS0A21. The strict rule (tolerable error 0) is ours.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Final

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_ground.ionosphere.cases import Cases
from gbas_ground.ionosphere.position_errors import Geometries, geometries

SIGMA_STEP_M: Final = 0.02
"""Resolution of sigma_pr_gnd in a type 1 message [m]; sigmas are sent rounded up."""
_ROUNDING: Final = 1e-6


@lru_cache(maxsize=64)
def _without(count: int, max_missing: int) -> BoolArray:
    """All ways to leave out up to `max_missing` of `count`, ``(B, count)``."""
    left_out = [each for k in range(max_missing + 1) for each in itertools.combinations(range(count), k)]
    mask = np.ones((len(left_out), count), dtype=bool)
    for row, each in enumerate(left_out):
        mask[row, list(each)] = False
    return mask


def subsets_of(groups: BoolArray, combinations: Iterable[tuple[int, ...]], max_missing: int) -> BoolArray:
    """Sets of satellites an aircraft may use.

    Parameters
    ----------
    groups : (k, n) bool array
        Satellites of each constellation.
    combinations : iterable of tuple of int
        Constellations an aircraft may use together.
    max_missing : int
        Most satellites of those it may lack.

    Returns
    -------
    (B, n) bool array
        Without those that give no position (fewer satellites than unknowns).
    """
    rows = []
    for combination in combinations:
        available = np.flatnonzero(groups[list(combination)].any(axis=0))
        chosen = _without(len(available), max_missing)
        mask = np.zeros((len(chosen), groups.shape[1]), dtype=bool)
        mask[:, available] = chosen
        rows.append(mask)
    found = np.unique(np.concatenate(rows), axis=0)
    unknowns = 3 + (groups[np.newaxis] & found[:, np.newaxis]).any(axis=-1).sum(axis=-1)
    return np.asarray(found[found.sum(axis=-1) >= unknowns])


def sent_sigma_m(base_m: FloatArray, shape_m: FloatArray, factor: float) -> FloatArray:
    """Ground sigmas with inflation, rounded up as they are sent [m]."""
    steps = np.sqrt(base_m**2 + (factor * shape_m) ** 2) / SIGMA_STEP_M
    return np.asarray(np.ceil(steps - _ROUNDING) * SIGMA_STEP_M)


def judge(
    cases: Cases, groups: BoolArray, subsets: BoolArray, sigma_vig: float, factor: float, *, first_only: bool = False
) -> Geometries:
    """Judge every case with every subset under an inflation.

    Parameters
    ----------
    cases : Cases
    groups, subsets : (k, n), (B, n) bool arrays
    sigma_vig : float
        As broadcast [m/m].
    factor : float
        Of the inflation of sigma_pr_gnd, see :func:`sent_sigma_m`.
    first_only : bool
        End at the first geometry that is not safe.
    """
    gnd2 = sent_sigma_m(cases.base_m, cases.shape_m, factor) ** 2
    variance = gnd2 + cases.air2_m2 + (sigma_vig * cases.iono_m) ** 2
    nominal = cases.base_m**2 + cases.air2_m2 + (cases.nominal_vig * cases.iono_m) ** 2
    return geometries(cases, variance, nominal, groups, subsets, first_only=first_only)


def least_safe(is_safe: Callable[[int], bool], largest: int, start: int) -> int | None:
    """A step that is safe while the one below is not, or 0; None when the largest is not safe.

    Parameters
    ----------
    is_safe : callable
        From a step, 0 to `largest`, to whether it is safe.
    largest : int
    start : int
        Where to look first: near the answer of the minute before, few steps have to be tried. Were a position to
        become worse with more inflation there might be several answers; what is returned was seen to be safe.
    """
    low, high, stride = -1, largest + 1, 1  # not safe, safe: so far assumed
    here = min(max(start, 0), largest)
    while high - low > 1:
        if is_safe(here):
            high = here
        else:
            low = here
        if low < 0:
            here = max(high - stride, 0)
        elif high > largest:
            here = min(low + stride, largest)
        else:
            here = (low + high) // 2
        stride *= 2
    return high if high <= largest else None
