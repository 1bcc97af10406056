"""Protection levels: how far the position may be wrong, with the probability the service promises, without notice.

Pure functions of one epoch's projection, sigmas and B values. A satellite is used when any of its columns is there;
whatever else is then missing for it (a sigma, a B value) makes the protection level NaN: not protected.

Source: RTCA DO-253 (approach protection levels); ICAO Annex 10 vol. I, App. B 3.6.5.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gbas_core.models.missed_detection import k_ffmd, k_md
from gbas_core.record import BoolArray, FloatArray
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
    used = _used(solution)
    m_i = receivers_behind(solution.b_m)
    n_receivers = solution.n_receivers
    single = n_receivers == 1.0
    if not used.any() or not _complete(solution, used, m_i, single):
        return NOT_PROTECTED
    s = np.where(used, np.array([solution.s_vert, solution.s_lat]), 0.0)
    gnd2 = np.where(used, solution.sigma_gnd_m**2, 0.0)
    other2 = np.where(used, solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2, 0.0)
    sigma = np.sqrt((s**2 * (gnd2 + other2)).sum(axis=-1))
    separation = _not_negative(np.array([solution.d_vert_m, solution.d_lat_m]))
    h0 = multipliers.k_ffmd[int(n_receivers)] * sigma + separation
    h1 = np.full(2, np.nan) if single else h1_levels(s, solution.b_m, gnd2, other2, multipliers.k_md) + separation
    ephemeris = np.where(used, _not_negative(solution.ephemeris_error_m), 0.0)
    return ProtectionLevels(
        h0_m=h0,
        h1_m=h1,
        level_m=h0 if single else np.maximum(h0, h1),
        ephemeris_bound_m=np.max(np.abs(s) * ephemeris, axis=-1) + solution.k_md_e * sigma,
    )


def _not_negative(values: FloatArray) -> FloatArray:
    """Sizes; a negative one is none, and missing."""
    return np.where(values >= 0.0, values, np.nan)


def receivers_behind(b_m: FloatArray) -> FloatArray:
    """Number of reference receivers behind each correction, M_i, counted from its B values (4, N_SATS)."""
    count: FloatArray = np.isfinite(b_m).sum(axis=0).astype(np.float64)
    return count


def h1_levels(
    s: FloatArray, b_m: FloatArray, gnd2: FloatArray, other2: FloatArray, k_md_by_m: FloatArray
) -> FloatArray:
    """Protection levels under the hypotheses that one reference receiver is faulted, without D_V.

    Parameters
    ----------
    s : (2, N_SATS) array
        Projections on the vertical and lateral error, 0 for satellites not used.
    b_m : (4, N_SATS) array
        B values, NaN where receiver j is not behind the correction.
    gnd2, other2 : (N_SATS,) arrays
        Variances of the ground's correction and of the rest [m^2], 0 for satellites not used.
    k_md_by_m : (5,) array
        K_md by number of receivers.

    Returns
    -------
    (2,) array
        max_j (|sum s_i B_ij| + K_md sqrt(sum s_i^2 ((M_i / U_i) gnd2 + other2))) [m]

    Notes
    -----
    M may differ between satellites. Receiver j then takes the largest K_md (smallest M) of the satellites it is used
    on; the text we could read leaves this open, the choice is the conservative one.
    """
    used = s.any(axis=0)
    behind = np.isfinite(b_m) & used
    m_i = np.where(used, receivers_behind(b_m), 1.0)
    without_j = np.where(behind, m_i - 1.0, m_i)
    variance = m_i / without_j * gnd2 + other2
    sigma = np.sqrt((s[:, None, :] ** 2 * variance).sum(axis=-1))
    bias = np.abs((s[:, None, :] * np.where(behind, b_m, 0.0)).sum(axis=-1))
    smallest_m = np.where(behind, m_i, 0.0 + b_m.shape[0]).min(axis=-1).astype(np.int64)
    levels = bias + k_md_by_m[smallest_m] * sigma
    in_use = behind.any(axis=-1)
    worst: FloatArray = np.where(in_use, levels, 0.0).max(axis=-1)
    return worst


def _used(solution: SolutionEpoch) -> BoolArray:
    columns = (solution.s_vert, solution.s_lat, solution.sigma_gnd_m, solution.elevation_rad)
    return np.asarray(np.isfinite(np.array(columns)).any(axis=0))


def _complete(solution: SolutionEpoch, used: BoolArray, m_i: FloatArray, single: bool) -> bool:
    """Whether every used satellite has all a protection level needs."""
    needed = np.array(
        [
            solution.s_vert,
            solution.s_lat,
            solution.sigma_gnd_m,
            solution.sigma_air_m,
            solution.sigma_tropo_m,
            solution.sigma_iono_m,
        ]
    )
    if not np.isfinite(needed[:, used]).all() or (needed[2:, used] < 0.0).any():
        return False
    if single:
        return bool((m_i[used] == 0.0).all())
    return bool((m_i[used] >= 2.0).all() and solution.n_receivers == m_i[used].max())
