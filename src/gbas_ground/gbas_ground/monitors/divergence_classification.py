"""Which of the fifteen fault modes a two-frequency divergence looks like.

A mode is a set of measurements that diverge, each at a rate of its own: the means of the three statistics lie in the
span of the columns of the combination matrix that belong to the set. One measurement spans a line, two a plane, three
or four all there is: those five modes explain whatever is seen, equally well, and no statistic can tell them apart.
The likelihood is maximised over the rates, so a larger set is never less likely than a smaller one in it; the
posterior therefore counts one for every free rate (Akaike's weights). It is a ranking, not a probability anybody
should build an integrity case on.

Source: fault modes, Jiang, Milner, Macabiau, ENC 2015, 2.2; weights, Burnham and Anderson, Model Selection and
Multimodel Inference, 2nd ed. 2002, 2.9; their use here is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.record import FloatArray
from gbas_ground.monitors.divergence_covariance import INDEPENDENT

NO_FAULT: Final = "No fault"
MODES: Final[tuple[str, ...]] = (*FAULT_MODES, NO_FAULT)
_MEMBERS: Final = tuple(np.flatnonzero(members) for members in FAULT_MODES.values())
FREE_RATES: Final[FloatArray] = np.array([*(min(len(members), 3) for members in _MEMBERS), 0], dtype=np.float64)
"""Dimension of each mode's span, 0 for no fault."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Classification:
    """How well each mode of :data:`MODES` explains what is seen; arrays ``(16, N)``.

    Attributes
    ----------
    log_likelihood : array
        Maximised over the rates, without the constant all modes share: 0 is a perfect fit [-].
    posterior : array
        Sums to one over the modes; NaN where the statistics are not known [-].
    """

    log_likelihood: FloatArray
    posterior: FloatArray

    def best(self, satellite: int) -> tuple[str, ...]:
        """Modes of the largest posterior; several when they cannot be told apart."""
        column = self.posterior[:, satellite]
        if not np.isfinite(column).all():
            return ()
        return tuple(MODES[place] for place in np.flatnonzero(column >= column.max() * (1.0 - 1e-9)))

    def plausible(self, satellite: int, mass: float = 0.95) -> tuple[str, ...]:
        """Fewest modes that together have so much of the posterior, from the most to the least likely."""
        column = self.posterior[:, satellite]
        if not np.isfinite(column).all():
            return ()
        order = np.argsort(-column, kind="stable")
        count = int(np.searchsorted(np.cumsum(column[order]), mass)) + 1
        # Modes that cannot be told apart come together or not at all.
        least = column[order[min(count, len(order)) - 1]] * (1.0 - 1e-9)
        return tuple(MODES[place] for place in order if column[place] >= least)


@lru_cache(maxsize=8)
def _columns(band: int, other: int) -> FloatArray:
    """Effect of the four measurements on the three statistics, (3, 4)."""
    return combination_matrix(band, other)[list(INDEPENDENT)]


def classify(
    rates_mps: FloatArray, covariance: FloatArray, band: int, other: int, *, prior: FloatArray | None = None
) -> Classification:
    """Compare the modes.

    Parameters
    ----------
    rates_mps : (3, N) array
        Means of the filtered statistics: DF, DF of the other band, IF carrier [m/s].
    covariance : (N, 3, 3) array
        Theirs [(m/s)^2].
    band, other : int
    prior : (16,) array, optional
        Weight of each mode; all the same when not given [-].

    Notes
    -----
    While a fault grows through the filters all rates grow in proportion, so the direction holds before the steady
    state, too.
    """
    known = np.asarray(np.isfinite(rates_mps).all(axis=0) & np.isfinite(covariance).all(axis=(1, 2)))
    root = np.linalg.cholesky(np.where(known[:, np.newaxis, np.newaxis], covariance, np.eye(3)))
    x = np.where(known, rates_mps, 0.0).T[..., np.newaxis]
    columns = np.broadcast_to(_columns(band, other), (len(root), 3, 4))
    white = np.linalg.solve(root, np.concatenate([x, columns], axis=-1))  # (N, 3, 5)
    seen, effect = white[..., 0], white[..., 1:]
    misfit = np.stack([*(_misfit(seen, effect[..., members]) for members in _MEMBERS), (seen**2).sum(axis=-1)])
    log_likelihood = np.where(known, -0.5 * misfit, np.nan)
    weight = np.ones(len(MODES)) if prior is None else np.asarray(prior, dtype=np.float64)
    if weight.shape != (len(MODES),) or not (weight >= 0.0).all() or not weight.sum() > 0.0:
        raise ValueError(f"prior must be {len(MODES)} weights, none negative and not all zero")
    score = log_likelihood - FREE_RATES[:, np.newaxis]
    relative = weight[:, np.newaxis] * np.exp(score - score.max(axis=0))
    return Classification(log_likelihood=log_likelihood, posterior=relative / relative.sum(axis=0))


def _misfit(seen: FloatArray, effect: FloatArray) -> FloatArray:
    """Squared distance (N,) of whitened statistics (N, 3) from the span of whitened columns (N, 3, k)."""
    if effect.shape[-1] >= 3:
        return np.zeros(len(seen))
    if effect.shape[-1] == 2:
        normal = np.cross(effect[..., 0], effect[..., 1])
        return np.asarray((seen * normal).sum(axis=-1) ** 2 / (normal**2).sum(axis=-1))
    line = effect[..., 0]
    along = (seen * line).sum(axis=-1) ** 2 / (line**2).sum(axis=-1)
    return np.asarray(np.maximum((seen**2).sum(axis=-1) - along, 0.0))
