"""How high a threshold has to be: the budget of false exclusions and the multipliers that follow from it."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from scipy.stats import norm

FALSE_EXCLUSION: Final = 1.0e-8
"""False exclusions of one source by one monitor in :data:`EXPOSURE_S`. Known: 2e-7 for all monitors together, a
twentieth of it for each; Jiang, Milner, Macabiau, ENC 2015."""
EXPOSURE_S: Final = 15.0
"""Exposure of the continuity requirement [s]. Known."""
EPOCH_S: Final = 0.5
"""Interval between a ground station's epochs [s]. Known."""


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
    return float(norm.isf(probability / (epochs * tests * sides)))
