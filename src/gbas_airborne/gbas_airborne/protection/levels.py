# mypy: disable-error-code="no-untyped-call"
"""Protection levels: how far the position may be wrong, with the probability the service promises, without notice.

Pure functions of one epoch's projection, sigmas and B values. A satellite is used when any of its columns is there;
whatever else is then missing for it (a sigma, a B value) makes the protection level NaN: not protected.

Source: RTCA DO-253 (approach protection levels); ICAO Annex 10 vol. I, App. B 3.6.5.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gbas_airborne.protection.kernels.levels import COLUMNS, all_levels
from gbas_core.models.missed_detection import k_ffmd, k_md
from gbas_core.record import FloatArray
from gbas_msgs_py.records import SolutionEpoch


@dataclass(frozen=True, kw_only=True)
class Multipliers:
    """The K factors by number of receivers; index M, NaN where there is none."""

    k_ffmd: FloatArray
    k_md: FloatArray

    @classmethod
    @lru_cache(maxsize=32)
    def generate(cls, probability: float, receiver_fault_prior: float, k_ffmd_single: float) -> Multipliers:
        """Multipliers for M = 1 to 4 from the probabilities; M = 1 has no receiver fault hypothesis."""
        many = range(2, 5)
        return cls(
            k_ffmd=np.array([np.nan, k_ffmd_single, *(k_ffmd(m, probability) for m in many)]),
            k_md=np.array([np.nan, np.nan, *(k_md(m, probability, receiver_fault_prior) for m in many)]),
        )


@dataclass(frozen=True, kw_only=True)
class ProtectionLevels:
    """Protection levels and ephemeris bounds; each array is (vertical, lateral) [m], NaN where there is none."""

    h0_m: FloatArray
    h1_m: FloatArray
    level_m: FloatArray
    ephemeris_bound_m: FloatArray


NOT_PROTECTED = ProtectionLevels(
    h0_m=np.full(2, np.nan), h1_m=np.full(2, np.nan), level_m=np.full(2, np.nan), ephemeris_bound_m=np.full(2, np.nan)
)


def protection_levels(solution: SolutionEpoch, multipliers: Multipliers) -> ProtectionLevels:
    """Protection levels of one epoch: VPL = max(VPL_H0, VPL_H1), LPL alike, and the ephemeris bounds VEB, LEB.

    Parameters
    ----------
    solution : SolutionEpoch
        Projections, sigmas and B values of the satellites used.
    multipliers : Multipliers
        K factors.

    Returns
    -------
    ProtectionLevels
        All NaN when a used satellite lacks anything. With one receiver `h1_m` is NaN and the level is `h0_m`. Without
        K_md_e the bounds are NaN.

    Source: ICAO Annex 10 vol. I, App. B 3.6.5.5.
    """
    return levels_of_all((solution,), multipliers)[0]


def levels_of_all(solutions: Sequence[SolutionEpoch], multipliers: Multipliers) -> tuple[ProtectionLevels, ...]:
    """The same of several solutions at once."""
    found = all_levels(
        np.array([[getattr(each, name) for name in COLUMNS] for each in solutions]),
        np.array([each.b_m for each in solutions]),
        np.array([float(each.n_receivers) for each in solutions]),
        np.array([float(each.k_md_e) for each in solutions]),
        np.array([(float(each.d_vert_m), float(each.d_lat_m)) for each in solutions]),
        multipliers.k_ffmd,
        multipliers.k_md,
    )
    return tuple(
        ProtectionLevels(h0_m=h0_m, h1_m=h1_m, level_m=level_m, ephemeris_bound_m=bound_m)
        for h0_m, h1_m, level_m, bound_m in found
    )
