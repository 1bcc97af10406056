"""How often errors exceed a bound, counted with as many trials as there are independent errors.

Smoothed errors of neighbouring epochs are nearly the same, so a count is worth as many trials as there are correlation
times (:func:`correlation_time_s`).
Source: Clopper and Pearson, Biometrika 26, 1934 (interval); Tossaint et al., The Stanford - ESA integrity diagram, ION
GNSS 2006 (regions).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import beta, norm

from gbas_core.record import FloatArray

CONFIDENCE: Final = 0.95


def correlation_time_s(values: FloatArray, interval_s: float) -> float:
    """Time after which another error counts as a trial of its own [s]: the integral of the autocorrelation.

    Parameters
    ----------
    values : (T,) or (T, K) array
        Normalised errors of evenly spaced epochs, one or several series; NaN where missing.
    interval_s : float
        Between epochs [s].

    Returns
    -------
    float
        ``interval (1 + 2 sum rho_k)``, about zero (a constant error is one trial) and up to the first lag whose
        correlation is not positive; the whole record where there is none.
    """
    series = values.reshape(len(values), -1)
    there = np.isfinite(series)
    filled = np.where(there, series, 0.0)
    power = (filled**2).sum() / max(there.sum(), 1)
    total = 1.0
    for lag in range(1, len(series)):
        pairs = (there[lag:] & there[:-lag]).sum()
        rho = (filled[lag:] * filled[:-lag]).sum() / pairs / power if pairs and power > 0.0 else 0.0
        if rho <= 0.0:
            break
        total += 2.0 * rho
    return float(interval_s * min(total, len(series)))


@dataclass(frozen=True, kw_only=True)
class Exceedance:
    """How often errors were beyond K sigma, against the probability that K stands for.

    Attributes
    ----------
    probability : float
        Two-sided, of a normal error with that sigma.
    count, total : int
        Errors beyond, and all.
    trials : float
        What `total` correlated errors are worth.
    low, high : float
        Confidence interval of the true probability.
    """

    probability: float
    count: int
    total: int
    trials: float
    low: float
    high: float

    @property
    def can_fail(self) -> bool:
        """Whether errors that all exceed would be called ``exceeded``."""
        return interval(self.trials, self.trials)[0] > self.probability

    @property
    def visible_ratio(self) -> float:
        """How many times too small sigmas would have to be for so many trials to show it; inf: never."""

        def excess(share: float) -> float:
            return interval(share * self.trials, self.trials)[0] - self.probability

        if not self.can_fail:
            return np.inf
        share = float(brentq(excess, self.probability, 1.0))
        return float(norm.isf(self.probability / 2.0) / norm.isf(share / 2.0))

    @property
    def verdict(self) -> str:
        """What the interval says.

        ``exceeded`` when all of it is above the probability: the sigmas are too small. ``bounded`` when all is below.
        Else ``consistent``, or ``too short`` when not even errors that all exceed could have shown it.
        """
        if self.low > self.probability:
            return "exceeded"
        if self.high < self.probability:
            return "bounded"
        return "consistent" if self.can_fail else "too short"


def interval(successes: float, trials: float, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Clopper-Pearson interval of a probability; both numbers may be fractions of correlated counts."""
    tail = (1.0 - confidence) / 2.0
    low = float(beta.ppf(tail, successes, trials - successes + 1.0)) if successes > 0.0 else 0.0
    high = float(beta.isf(tail, successes + 1.0, trials - successes)) if successes < trials else 1.0
    return low, high


def exceedance(normalised: FloatArray, probability: float, *, interval_s: float, correlation_s: float) -> Exceedance:
    """Count normalised errors (error over sigma, NaN where missing) beyond K = Q^-1(p / 2).

    The correlation time of the errors themselves is taken: indicators of large errors are less correlated, so that the
    interval is rather too wide.
    """
    there = np.isfinite(normalised)
    total = int(there.sum())
    count = int((np.abs(normalised[there]) > norm.isf(probability / 2.0)).sum())
    trials = total * min(1.0, interval_s / correlation_s)
    low, high = interval(count / max(total, 1) * trials, trials) if total else (0.0, 1.0)
    return Exceedance(probability=probability, count=count, total=total, trials=trials, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class StanfordCounts:
    """Epochs by region of the Stanford diagram: error e, protection level PL, alert limit AL.

    Attributes
    ----------
    normal : int
        e <= PL <= AL.
    unavailable : int
        e <= PL, PL > AL or none: no service, nobody misled.
    misleading : int
        PL < e <= AL.
    unavailable_misleading : int
        AL < PL < e: exceeded, but out of service.
    hazardous : int
        PL <= AL < e: hazardously misleading.
    """

    normal: int
    unavailable: int
    misleading: int
    unavailable_misleading: int
    hazardous: int


def stanford_counts(error_m: FloatArray, level_m: FloatArray, alert_limit_m: float) -> StanfordCounts:
    """Count epochs ``(T,)`` by region; unknown errors are left out, a missing level is no service."""
    error, level = np.abs(error_m), level_m
    known = np.isfinite(error)
    served = level <= alert_limit_m
    within = ~(error > level)
    beyond = error > alert_limit_m
    return StanfordCounts(
        normal=int((known & served & within).sum()),
        unavailable=int((known & ~served & within).sum()),
        misleading=int((known & served & ~within & ~beyond).sum()),
        unavailable_misleading=int((known & ~served & ~within).sum()),
        hazardous=int((known & served & ~within & beyond).sum()),
    )
