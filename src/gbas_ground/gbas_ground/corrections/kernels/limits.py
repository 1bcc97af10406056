"""Thresholds of B values, of one satellite."""

from __future__ import annotations

import math
from typing import Final

from gbas_core.compiled import compiled

MAX_B_VALUE_M: Final = 6.35
"""Largest B value the type 1 message can carry. Source: ICAO Annex 10 vol. I, table B-63."""


@compiled
def b_limit_m(sigma_m: float, count: float, k_b: float) -> float:
    """Threshold of a B value [m]; NaN without a sigma. What the message cannot carry fails whatever its sigma.

    Parameters
    ----------
    sigma_m : float
        Sigma of one receiver's correction after removal of its clock [m].
    count : float
        Receivers used on the satellite, M.
    k_b : float

    Notes
    -----
    With independent receivers of sigma s the variance of B is s^2 / (M (M - 1)), that is sigma_pr_gnd^2 / (M - 1). The
    noise that the removal of the clock brings in is part of s here (it is not part of sigma_pr_gnd, because it vanishes
    in the user's clock); without it high satellites would fail too often.

    Source: threshold K_B sigma_pr_gnd / sqrt(M - 1) with K_B = 5.5 (known for an early LAAS prototype, uncertain for
    fielded stations, FAA specification: 5.6).
    """
    limit = k_b * sigma_m / math.sqrt(max(count * (count - 1.0), 1.0))
    return MAX_B_VALUE_M if limit > MAX_B_VALUE_M else limit


@compiled
def unused_limit_m(sigma_m: float, count: float, k_b: float) -> float:
    """Threshold of the correction of a channel less the PRC of `count` others, K_B s sqrt(1 + 1/M) [m]."""
    return k_b * sigma_m * math.sqrt(1.0 + 1.0 / max(count, 1.0))
