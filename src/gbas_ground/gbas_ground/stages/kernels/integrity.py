"""Columns of the integrity record."""

from __future__ import annotations

import math

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.claims.orbit_claim import claimed_decorrelation_of
from gbas_ground.stages.kernels.status import USABLE, has_row


@compiled
def rows_of(
    state: FloatArray, cause: FloatArray, elevation_rad: FloatArray, iod: FloatArray, ephemeris_crc: FloatArray
) -> FloatArray:
    """The five of satellites of which there is anything to say, ``(5, N)``."""
    rows = np.full((5, len(state)), np.nan)
    for i in range(len(state)):
        if has_row(state[i], cause[i]):
            rows[0, i], rows[1, i], rows[2, i] = state[i], cause[i], elevation_rad[i]
            rows[3, i], rows[4, i] = iod[i], ephemeris_crc[i]
    return rows


@compiled
def claims_of_usable(
    state: FloatArray,
    orbit_bound: FloatArray,
    least: tuple[float, float],
    external: bool,
    sent_m: FloatArray,
    sigmas_m: FloatArray,
    n_products: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """P and sigma ``(n_products, N)`` and the sigma without inflation ``(N,)`` of usable satellites.

    The first products are those of the station's smoothing constants, in their order; it makes no others.
    """
    p, sigma_m = np.full((n_products, len(state)), np.nan), np.full((n_products, len(state)), np.nan)
    sigma_d_m = np.full(len(state), np.nan)
    for i in range(len(state)):
        if state[i] == USABLE:
            p[0, i] = claimed_decorrelation_of(orbit_bound[i], least[0], external)
            p[1, i] = claimed_decorrelation_of(orbit_bound[i], least[1], external)
            sigma_m[0, i], sigma_m[1, i], sigma_d_m[i] = sent_m[i], sigmas_m[2, i], sigmas_m[1, i]
    return p, sigma_m, sigma_d_m


@compiled
def corrections_of_usable(
    state: FloatArray, cause: FloatArray, used: BoolArray, prc_m: FloatArray, rrc_mps: FloatArray, b_m: FloatArray,
    n_products: int, n_rows: int,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """PRC and RRC ``(n_products, N)``, B values and 1 where a channel is used ``(n_products, n_rows, N)``."""
    n_sats = len(state)
    prc, rrc = np.full((n_products, n_sats), np.nan), np.full((n_products, n_sats), np.nan)
    b = np.full((n_products, n_rows, n_sats), np.nan)
    flags = np.full((n_products, n_rows, n_sats), np.nan)
    for t in range(b_m.shape[0]):
        for i in range(n_sats):
            if state[i] == USABLE:
                prc[t, i], rrc[t, i] = prc_m[t, i], rrc_mps[t, i]
            for m in range(b_m.shape[1]):
                b[t, m, i] = b_m[t, m, i] if state[i] == USABLE else math.nan
                if has_row(state[i], cause[i]):
                    flags[t, m, i] = 1.0 if used[m, i] else 0.0
    return prc, rrc, b, flags
