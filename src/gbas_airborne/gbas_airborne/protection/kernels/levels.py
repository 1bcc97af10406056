# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Protection levels of all modes of an epoch. Missing is NaN, and nothing is protected with a satellite that lacks
anything.

Source: RTCA DO-253 (approach protection levels); ICAO Annex 10 vol. I, App. B 3.6.5.5.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled

COLUMNS: Final = (
    "s_vert",
    "s_lat",
    "sigma_gnd_m",
    "sigma_air_m",
    "sigma_tropo_m",
    "sigma_iono_m",
    "ephemeris_error_m",
    "elevation_rad",
)
"""Columns of the solution that the kernel is given, in the order of their rows."""
S_VERT, S_LAT, GND, AIR, TROPO, IONO, EPHEMERIS_ERROR, ELEVATION = range(8)


@compiled
def receivers_behind(b_m, i):
    """M_i: number of reference receivers behind a correction, counted from its B values."""
    count = 0
    for j in range(b_m.shape[0]):
        count += np.isfinite(b_m[j, i])
    return count


@compiled
def is_used(columns, i):
    """Whether any of the columns of a satellite that is used is there."""
    projected = np.isfinite(columns[S_VERT, i]) or np.isfinite(columns[S_LAT, i])
    return projected or np.isfinite(columns[GND, i]) or np.isfinite(columns[ELEVATION, i])


@compiled
def is_complete(columns, i):
    """Whether a satellite has all a protection level needs but B values."""
    for row in range(EPHEMERIS_ERROR):
        if not np.isfinite(columns[row, i]) or (row >= GND and columns[row, i] < 0.0):
            return False
    return True


@compiled
def take(columns, b_m, n_receivers, s, gnd2, other2):
    """Fill in projections and variances, 0 for satellites not used; False when no satellite is used or one lacks
    anything.
    """
    most, n_used = 0, 0
    for i in range(columns.shape[1]):
        s[0, i] = s[1, i] = gnd2[i] = other2[i] = 0.0
        if not is_used(columns, i):
            continue
        n_used += 1
        behind = receivers_behind(b_m, i)
        most = max(most, behind)
        if not is_complete(columns, i) or not (behind == 0 if n_receivers == 1.0 else behind >= 2):
            return False
        s[0, i], s[1, i] = columns[S_VERT, i], columns[S_LAT, i]
        gnd2[i] = columns[GND, i] ** 2
        other2[i] = columns[AIR, i] ** 2 + columns[TROPO, i] ** 2 + columns[IONO, i] ** 2
    return n_used > 0 and (n_receivers == 1.0 or n_receivers == most)


@compiled
def fault_free_sigma_m(s, gnd2, other2):
    """sqrt(sum s_i^2 sigma_i^2) of one direction."""
    total = 0.0
    for i in range(s.shape[0]):
        total += s[i] ** 2 * (gnd2[i] + other2[i])
    return np.sqrt(total)


@compiled
def h1_level_m(s, b_m, gnd2, other2, k_md_by_m):
    """Protection level of one direction under the hypotheses that one reference receiver is faulted, without D_V.

    Parameters
    ----------
    s : (N,) array
        Projections on the error, 0 for satellites not used.
    b_m : (4, N) array
        B values, NaN where receiver j is not behind the correction.
    gnd2, other2 : (N,) arrays
        Variances of the ground's correction and of the rest [m^2], 0 for satellites not used.
    k_md_by_m : (5,) array
        K_md by number of receivers.

    Returns
    -------
    float
        max_j (|sum s_i B_ij| + K_md sqrt(sum s_i^2 ((M_i / U_i) gnd2 + other2))) [m]

    Notes
    -----
    M may differ between satellites. Receiver j then takes the largest K_md (smallest M) of the satellites it is used
    on; the text we could read leaves this open, the choice is the conservative one.
    """
    worst_m = 0.0
    for j in range(b_m.shape[0]):
        bias_m, variance, smallest, behind_any = 0.0, 0.0, b_m.shape[0], False
        for i in range(s.shape[0]):
            if gnd2[i] + other2[i] == 0.0 and s[i] == 0.0:
                continue
            m_i, ratio = receivers_behind(b_m, i), 1.0
            if np.isfinite(b_m[j, i]):
                behind_any, smallest, ratio = True, min(smallest, m_i), m_i / (m_i - 1.0)
                bias_m += s[i] * b_m[j, i]
            variance += s[i] ** 2 * (ratio * gnd2[i] + other2[i])
        if behind_any:
            worst_m = np.maximum(worst_m, abs(bias_m) + k_md_by_m[smallest] * np.sqrt(variance))  # NaN stays
    return worst_m


@compiled
def ephemeris_bound_m(s, columns, k_md_e, sigma_m):
    """max |s_i| x P_i + K_md_e sigma of one direction; NaN without any of it."""
    worst_m = 0.0
    for i in range(s.shape[0]):
        if is_used(columns, i):
            error_m = columns[EPHEMERIS_ERROR, i]
            worst_m = np.maximum(worst_m, abs(s[i]) * error_m if error_m >= 0.0 else np.nan)
    return worst_m + k_md_e * sigma_m


@compiled
def all_levels(columns, b_m, n_receivers, k_md_e, separation_m, k_ffmd_by_m, k_md_by_m):
    """Levels ``(M, 4, 2)``: H0, H1, of both, and ephemeris bound; vertical and lateral [m]. NaN where there is none.

    Parameters
    ----------
    columns : (M, 8, N) array
        Rows of :data:`COLUMNS`.
    b_m : (M, 4, N) array
    n_receivers, k_md_e : (M,) arrays
        M and the ephemeris missed detection multiplier of the solution.
    separation_m : (M, 2) array
        D_V and D_L.
    k_ffmd_by_m, k_md_by_m : (5,) arrays
        Multipliers by number of receivers.
    """
    n_modes, _, n_sats = columns.shape
    levels_m = np.full((n_modes, 4, 2), np.nan)
    s, gnd2, other2 = np.empty((2, n_sats)), np.empty(n_sats), np.empty(n_sats)
    for m in range(n_modes):
        if not take(columns[m], b_m[m], n_receivers[m], s, gnd2, other2):
            continue
        single = n_receivers[m] == 1.0
        for k in range(2):
            sigma_m = fault_free_sigma_m(s[k], gnd2, other2)
            apart_m = separation_m[m, k] if separation_m[m, k] >= 0.0 else np.nan
            h0_m = k_ffmd_by_m[int(n_receivers[m])] * sigma_m + apart_m
            h1_m = np.nan if single else h1_level_m(s[k], b_m[m], gnd2, other2, k_md_by_m) + apart_m
            levels_m[m, 0, k], levels_m[m, 1, k] = h0_m, h1_m
            levels_m[m, 2, k] = h0_m if single else np.maximum(h0_m, h1_m)
            levels_m[m, 3, k] = ephemeris_bound_m(s[k], columns[m], k_md_e[m], sigma_m)
    return levels_m
