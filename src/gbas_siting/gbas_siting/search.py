"""The best places of reference receivers, with a proof: branch and bound over boxes of places.

A box is a set of places. What no places in it can exceed is exact to compute (:meth:`SitingProblem.bound_m`): at any
gradient a baseline's statistic changes by at most the gradient times the change of its length. Boxes that cannot beat
the best places found by more than the gap are dropped; the others lose what cannot reach that much
(:mod:`~gbas_siting.contraction`, for the baselines of one receiver) and are halved where they are widest for
their distance.
When none is left, nothing beats the result by more than the gap; when the budget ends first, the largest bound that is
left says what could.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.signals import IONO_RATIO, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import coverage_percent
from gbas_siting.chain import chain_lengths_m
from gbas_siting.contraction import contract
from gbas_siting.problem import SitingProblem

GAP_M: Final = 1.0e-8
"""Of the statistic: 1.3 nm of sigma."""
BUDGET: Final = 6_000_000
"""Work before the search ends without closing the gap: sets of places and boxes, of four baselines. Some seconds."""
# Two places are compared by their width over their distance, as if they were this much farther away [m].
_NEAR_M: Final = 5.0
_SCATTERED: Final = 2000
_STARTS: Final = 6
_POLISH_ROUNDS: Final = 40
_POLISH_TRIALS: Final = 400


@dataclass(frozen=True, kw_only=True, eq=False)
class Siting:
    """Places of receivers and what they are worth.

    Attributes
    ----------
    problem : SitingProblem
    new_m : (n_new,) array
        Places of the new receivers along the runway, from the first receiver [m].
    statistic_m : float
        Statistic of the gradient seen worst, D: the largest threshold with which all gradients are detected [m].
    bound_m : float
        What D cannot exceed anywhere [m].
    worst_gradient : float
        A gradient along the runway that has the statistic D [m/m].
    evaluations : int
        Sets of places and boxes that were computed.
    closed : bool
        Whether the search ended by closing the gap.
    """

    problem: SitingProblem
    new_m: FloatArray
    statistic_m: float
    bound_m: float
    worst_gradient: float
    evaluations: int
    closed: bool

    @property
    def sigma_m(self) -> float:
        """Largest double-difference sigma with which every gradient is detected [m]."""
        return self.statistic_m / self.problem.k

    @property
    def sigma_bound_m(self) -> float:
        """What no places allow more than [m]."""
        return self.bound_m / self.problem.k

    @property
    def length_m(self) -> float:
        """Longest monitored baseline, along the runway [m]."""
        return float(self.baselines_m.max())

    @property
    def length_limited(self) -> bool:
        """Whether a new receiver stands at the length limit: more length could allow more."""
        return bool((np.abs(self.new_m) >= self.problem.length_limit_m * (1.0 - 1e-9)).any())

    @property
    def baselines_m(self) -> FloatArray:
        """Lengths along the runway of the monitored baselines, as :attr:`SitingProblem.pairs` [m]."""
        places = self.problem.places_m(self.new_m[np.newaxis])[0]
        result: FloatArray = np.abs(places[self.problem.pairs[:, 1]] - places[self.problem.pairs[:, 0]])
        return result

    @property
    def detectability_percent(self) -> float:
        """Share of the range of gradients that is detected at :attr:`sigma_m` [%]."""
        monitors = self.problem.monitors(self.new_m, self.sigma_m)
        return coverage_percent(monitors, self.problem.k, gradient_range=self.problem.gradient_range)


@dataclass
class _Search:
    """Best places so far, and how much was computed."""

    problem: SitingProblem
    best_m: FloatArray
    statistic_m: float = 0.0
    evaluations: int = 0

    @property
    def work(self) -> float:
        """In the unit of the budget: every two monitors can meet, and on several bands they take twice as long."""
        n_bands, n_monitors = len(self.problem.bands), self.problem.wavelength_m.size
        return self.evaluations * max(1.0, (n_monitors / 4.0) ** 2) * min(n_bands, 2)

    def offer(self, new_m: FloatArray) -> bool:
        """Take the best of places ``(n, n_new)`` if they beat what there is."""
        value = self.problem.guaranteed(new_m, enough_m=self.statistic_m).statistic_m
        self.evaluations += value.size
        at = int(value.argmax())
        if not value[at] > self.statistic_m:
            return False
        self.best_m, self.statistic_m = new_m[at].copy(), float(value[at])
        return True

    def scatter(self, low_m: FloatArray, high_m: FloatArray) -> None:
        """Start from several places, the same in every run: a good start spares the search much of its work."""
        random = np.random.default_rng(2)
        trials = np.sort(low_m + (high_m - low_m) * random.random((_SCATTERED, low_m.size)) ** 2, axis=1)
        value = self.problem.guaranteed(trials).statistic_m
        self.evaluations += value.size
        best_m, statistic_m = self.best_m, self.statistic_m
        for start in np.argsort(-value, kind="stable")[:_STARTS]:
            self.best_m, self.statistic_m = trials[start], float(value[start])
            self.polish(low_m, high_m, 0.1 * float((high_m - low_m).max()))
            if self.statistic_m > statistic_m:
                best_m, statistic_m = self.best_m, self.statistic_m
        self.best_m, self.statistic_m = best_m, statistic_m

    def polish(self, low_m: FloatArray, high_m: FloatArray, scale_m: float) -> None:
        """Try places around the best, nearer each time that none is better; the same trials in every run."""
        random = np.random.default_rng(1)
        for _ in range(_POLISH_ROUNDS):
            trials = self.best_m + scale_m * random.standard_normal((_POLISH_TRIALS, self.best_m.size))
            if not self.offer(np.clip(trials, low_m, high_m)):
                scale_m *= 0.5


def best_siting(problem: SitingProblem, *, gap_m: float = GAP_M, budget: int = BUDGET) -> Siting:
    """The places that allow the largest sigma with every gradient detected by at least one monitor.

    Parameters
    ----------
    problem : SitingProblem
    gap_m : float
        The search ends when nothing can beat the result by more than this, in the statistic [m].
    budget : int
        Or after so much work: then :attr:`Siting.bound_m` says what is left open. The unit is one set of places, or one
        box, of four baselines on one band; more of them take more.

    Returns
    -------
    Siting
        New receivers ascending along the runway.
    """
    limit = problem.length_limit_m
    low = np.full((1, problem.n_new), -limit if problem.two_sided else 0.0)
    high = np.full((1, problem.n_new), limit)
    search = _Search(problem, best_m=np.zeros(problem.n_new))
    if problem.n_new == 0:
        search.offer(np.zeros((1, 0)))
        return _siting(search, search.statistic_m, gap_m)
    search.offer(np.clip(_chain(problem), low, high))
    search.scatter(low[0], high[0])
    bound = _branch_and_bound(search, low, high, gap_m, budget)
    search.best_m = np.sort(search.best_m)
    return _siting(search, bound, gap_m)


def _chain(problem: SitingProblem) -> FloatArray:
    """The chain of the new receivers on each band ``(bands, n_new)``: a start that is often good."""
    lengths = [
        chain_lengths_m(float(WAVELENGTH_M[band]), problem.gradient_range, problem.n_new) / IONO_RATIO[band]
        for band in problem.bands
    ]
    return np.array(lengths)


def _branch_and_bound(search: _Search, low_m: FloatArray, high_m: FloatArray, gap_m: float, budget: int) -> float:
    """Improve the search's best; return what nothing exceeds."""
    problem, first = search.problem, (low_m[0], high_m[0])
    while low_m.size:
        if search.offer(0.5 * (low_m + high_m)):
            search.polish(*first, float((high_m - low_m).max()))
        bound = problem.bound_m(low_m, high_m, enough_m=search.statistic_m + gap_m)
        search.evaluations += bound.size
        kept = bound > search.statistic_m + gap_m
        if not kept.any():
            return search.statistic_m + gap_m
        low_m, high_m = low_m[kept], high_m[kept]
        if search.work >= budget:
            return float(bound.max())
        if problem.baselines == "star":
            low_m, high_m = _contracted(problem, low_m, high_m, search.statistic_m + gap_m)
        low_m, high_m = _halved(low_m, high_m)
    return search.statistic_m + gap_m


def _contracted(
    problem: SitingProblem, low_m: FloatArray, high_m: FloatArray, reach_m: float
) -> tuple[FloatArray, FloatArray]:
    """Boxes without what cannot reach a statistic."""
    alive = np.ones(low_m.shape[0], dtype=np.bool_)
    contract(
        low_m,
        high_m,
        IONO_RATIO[list(problem.bands)],
        np.abs(problem.fixed_m[1:]),
        WAVELENGTH_M[list(problem.bands)],
        problem.tolerance_m,
        *problem.gradient_range,
        reach_m,
        alive,
    )
    return low_m[alive], high_m[alive]


def _halved(low_m: FloatArray, high_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both halves of each box, without those whose receivers cannot be in ascending order."""
    width = (high_m - low_m) / (0.5 * np.abs(low_m + high_m) + _NEAR_M)
    box, axis = np.arange(low_m.shape[0]), width.argmax(axis=1)
    middle = 0.5 * (low_m[box, axis] + high_m[box, axis])
    upper_low, lower_high = low_m.copy(), high_m.copy()
    upper_low[box, axis] = lower_high[box, axis] = middle
    low, high = np.concatenate([low_m, upper_low]), np.concatenate([lower_high, high_m])
    ordered = (low[:, :-1] <= high[:, 1:]).all(axis=1)
    return low[ordered], high[ordered]


def _siting(search: _Search, bound_m: float, gap_m: float) -> Siting:
    problem = search.problem
    new_m = search.best_m if problem.two_sided else search.best_m * _side(problem)
    worst = problem.guaranteed(new_m[np.newaxis])
    return Siting(
        problem=problem,
        new_m=new_m,
        statistic_m=float(worst.statistic_m[0]),
        bound_m=max(bound_m, float(worst.statistic_m[0])),
        worst_gradient=float(worst.gradient[0]),
        evaluations=search.evaluations,
        closed=bound_m <= search.statistic_m + gap_m,
    )


def _side(problem: SitingProblem) -> float:
    """The side of the first receiver on which the farthest existing one stands: plus or minus one."""
    farthest = problem.fixed_m[np.abs(problem.fixed_m).argmax()]
    return -1.0 if farthest < 0.0 else 1.0
