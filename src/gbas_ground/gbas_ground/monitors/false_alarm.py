"""How high a threshold has to be: the budget of false exclusions and the multipliers that follow from it.

Two ways from an epoch to the exposure. :func:`false_alarm_multiplier` takes epochs as independent, which bounds the
probability whatever their correlation. :func:`exposure_probability` is for thresholds that are given and statistics
whose filters remember far longer than an epoch, such as those of divergences: there the first way counts one excursion
many times.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.special import chdtrc, chndtr, gammaln, ndtri, xlogy

from gbas_core.ranging.divergence import white_noise_correlation

FALSE_EXCLUSION: Final = 1.0e-8
"""False exclusions of one source by one monitor in :data:`EXPOSURE_S`. Known: 2e-7 for all monitors together, a
twentieth of it for each; Jiang, Milner, Macabiau, ENC 2015."""
EXPOSURE_S: Final = 15.0
"""Exposure of the continuity requirement [s]. Known."""
EPOCH_S: Final = 0.5
"""Interval between a ground station's epochs [s]. Known."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(200)


@lru_cache(maxsize=64)
def false_alarm_multiplier(
    probability: float = FALSE_EXCLUSION, *, tests: int = 1, sides: int = 2, interval_s: float = EPOCH_S
) -> float:
    """Standard deviations of a Gaussian statistic that keep a monitor within its budget.

    Parameters
    ----------
    probability : float
        False alarms of all the monitor's tests of one source in :data:`EXPOSURE_S`.
    tests : int
        Statistics of one source tested at each epoch.
    sides : {1, 2}
        Sides of the statistic that alarm.
    interval_s : float
        Time between the epochs [s].

    Returns
    -------
    float
        k.

    Notes
    -----
    Epochs and tests are taken as independent, each with its share: what is correlated alarms together, so the sum of
    the shares bounds the probability whatever the correlation (Boole).
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability is {probability}: it must be between 0 and 1")
    if tests < 1 or sides not in (1, 2) or not interval_s > 0.0:
        raise ValueError(f"tests {tests}, sides {sides}, interval {interval_s} s: at least 1, 1 or 2, above 0 s")
    epochs = max(1.0, EXPOSURE_S / interval_s)
    return float(-ndtri(probability / (epochs * tests * sides)))


@lru_cache(maxsize=64)
def exposure_probability(
    limit: float, correlation: float, *, freedom: int = 1, exposure_s: float = EXPOSURE_S, interval_s: float = EPOCH_S
) -> float:
    """Probability that a correlated statistic passes its threshold within the exposure.

    Parameters
    ----------
    limit : float
        Threshold in standard deviations: of the size of a Gaussian statistic, or of the root of a quadratic form.
    correlation : float
        Of the statistic between successive epochs [-].
    freedom : int
        Independent Gaussian components of the statistic, each with that correlation; 1: one, on both sides.
    exposure_s, interval_s : float
        Exposure, and time between epochs [s].

    Returns
    -------
    float
        Bound: above the threshold at the first epoch, or passing it at one of those that follow.

    Raises
    ------
    ValueError
        When an argument is out of bounds.

    Notes
    -----
    Exactly ``P(first) + (n - 1) P(below, then above)`` bounds ``P(any of n)`` for any stationary process. The pair of
    epochs is bivariate: given the size x at one epoch, the square at the next over ``1 - r^2`` is non-central
    chi-square with non-centrality ``r^2 x^2 / (1 - r^2)``. Only the correlation of neighbours enters.
    """
    if not (limit > 0.0 and 0.0 <= correlation < 1.0 and freedom >= 1 and interval_s > 0.0 and exposure_s > 0.0):
        raise ValueError(
            f"limit {limit}, correlation {correlation}, freedom {freedom}, exposure {exposure_s} s, interval "
            f"{interval_s} s: above 0, 0 to 1, at least 1, above 0 s"
        )
    rest = 1.0 - correlation**2
    # What is 12 deviations of a step below the threshold does not pass it in one step.
    lowest = max(0.0, limit - 12.0 * np.sqrt(rest))
    below = lowest + 0.5 * (limit - lowest) * (1.0 + _NODES)
    log_chi2 = (
        xlogy(freedom / 2.0 - 1.0, below**2) - below**2 / 2.0 - gammaln(freedom / 2.0) - np.log(2.0) * freedom / 2.0
    )
    density = 2.0 * below * np.exp(log_chi2)
    passing = 1.0 - chndtr(limit**2 / rest, float(freedom), correlation**2 * below**2 / rest)
    upward = 0.5 * (limit - lowest) * float(_WEIGHTS @ (density * passing))
    return float(min(1.0, chdtrc(freedom, limit**2) + (max(1.0, exposure_s / interval_s) - 1.0) * upward))


def independent_samples(limit: float, correlation: float, *, freedom: int = 1) -> float:
    """Independent samples in the exposure that pass a threshold as often as the correlated statistic does [-]."""
    return exposure_probability(limit, correlation, freedom=freedom) / float(chdtrc(freedom, limit**2))


def least_correlation(tau_s: float) -> float:
    """Least correlation of a filtered rate between a station's epochs: that of noise without memory [-]."""
    return white_noise_correlation(min(1.0, EPOCH_S / tau_s))
