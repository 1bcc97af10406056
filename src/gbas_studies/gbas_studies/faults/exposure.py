"""When does a user's differential error pass its limit while a fault goes undetected?

The differential error of a code-carrier divergence is that of two smoothing filters of different age: the station's is
settled, and the worst user's started whenever it hurts most, but at least the delay to incorporation ago. Errors that
code and carrier share reach the user only through the age of the corrections.

Source of the limits: range-domain requirement of GAST D, ICAO Annex 10 vol. I, att. D: a ranging source malfunction of
more than 1.6 m must not stay undetected (known). Of fronts: :mod:`~.front_exposure`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_studies.ccd.smoothed_error import Smoothing, largest_error_s

MALFUNCTION_LIMIT_M: Final = 1.6
CORRECTION_AGE_S: Final = 1.5
"""Oldest correction a user extrapolates while nothing is lost: 0.5 s from Z-count to burst, two frames. Ours."""
TIME_TO_ALERT_S: Final = 1.5
"""Of the ground station, GAST D (known)."""
_SEARCH_S: Final = 600.0


def divergence_limit_s(
    rate_mps: float, smoothing: Smoothing, limit_m: float = MALFUNCTION_LIMIT_M, *, watch_s: float = _SEARCH_S
) -> float:
    """When the worst user's error under a divergence passes the limit, since the onset [s]; infinite if never.

    Parameters
    ----------
    rate_mps : float
        Rate of code minus carrier [m/s].
    smoothing : Smoothing
    limit_m : float
    watch_s : float
        How long to look [s].
    """
    since_s, error_s = _worst_error(smoothing, watch_s)
    beyond = np.abs(rate_mps) * error_s > limit_m
    return float(since_s[beyond.argmax()]) if beyond.any() else math.inf


@lru_cache(maxsize=8)
def _worst_error(smoothing: Smoothing, watch_s: float) -> tuple[FloatArray, FloatArray]:
    """Times since the onset [s], and the worst user's error over the rate: the same for every rate and mode."""
    since_s = np.arange(0.0, watch_s, smoothing.interval_s)
    return since_s, largest_error_s(since_s, smoothing)


def extrapolation_limit_s(
    step_m: float, rate_mps: float, acceleration_mps2: float, limit_m: float = MALFUNCTION_LIMIT_M
) -> float:
    """The same for an error that code and carrier share: what the corrections cannot know yet.

    Parameters
    ----------
    step_m, rate_mps, acceleration_mps2 : float
        The fault grows as ``step + rate t + acceleration t^2 / 2``.
    limit_m : float

    Notes
    -----
    With corrections of age L and range rates over T, a step shows in full until the next correction, a new ramp by
    ``rate L``, and an acceleration by ``acceleration (L^2 + L T) / 2`` for good.
    """
    interval_s = 0.5
    since = np.arange(0.0, CORRECTION_AGE_S + 1e-9, 0.01)
    early = step_m + since * (rate_mps + 0.5 * acceleration_mps2 * since)
    beyond = np.abs(early) > limit_m
    if beyond.any():
        return float(since[beyond.argmax()])
    lasting = 0.5 * acceleration_mps2 * (CORRECTION_AGE_S**2 + CORRECTION_AGE_S * interval_s)
    return CORRECTION_AGE_S if abs(lasting) > limit_m else math.inf
