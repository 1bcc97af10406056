# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Gradients of the ionosphere, and the P of orbits; axes as in :mod:`gbas_ground.monitors.double_difference`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.double_difference import deciding, picked


@compiled
def seen(residual_m, n_bands):
    """Which baselines and bands see each satellite, ``(N,)``: bit ``b F + f``; only the first bands are looked at."""
    code = np.zeros(residual_m.shape[2], dtype=np.int64)
    for row in range(residual_m.shape[0]):
        for band in range(n_bands):
            for sat in range(residual_m.shape[2]):
                if np.isfinite(residual_m[row, band, sat]):
                    code[sat] |= np.int64(1) << (row * n_bands + band)
    return code


@compiled
def noise_steps(residual_m, nominal_sigma_m, scale, per_step):
    """Largest sigma of each band over the baselines' scales, in steps of its logarithm, rounded up, ``(F, N)``."""
    n_baselines, n_bands, n_sats = residual_m.shape
    steps = np.zeros((n_bands, n_sats), dtype=np.int64)
    for band in range(n_bands):
        for sat in range(n_sats):
            largest = 0.0
            for row in range(n_baselines):
                if np.isfinite(residual_m[row, band, sat]):
                    largest = max(largest, nominal_sigma_m[row, band, sat] / scale[row])
            if largest > 0.0:
                steps[band, sat] = np.int64(np.ceil(np.log(largest) * per_step))
    return steps


@compiled
def tested(residual_m, sigma_m, chosen, masks, k_ffd, half_wavelength_m, all_of_band, due):
    """Test every baseline and band that looks at a satellite.

    Parameters
    ----------
    residual_m, sigma_m : (B, F, N) arrays
        [m].
    chosen : (N,) int array
        What each satellite is tested on, a place in the two that follow.
    masks : (T, F) bool array
        Bands.
    k_ffd : (T,) array
        Multiplier of the thresholds.
    half_wavelength_m : (F,) array
        A threshold beyond this can never be exceeded.
    all_of_band : bool
        Whether all baselines of a band have to fail.
    due : (N,) bool array

    Returns
    -------
    statistic, threshold : (B, F, N) arrays
        NaN statistic where it was not looked.
    failed : (B, F, N) bool array
    decided, limit : (N,) arrays
        Of the baseline and band that decides.
    exceeded : (N,) bool array
    """
    n_baselines, n_bands, n_sats = residual_m.shape
    statistic, threshold = np.full(residual_m.shape, np.nan), np.empty(residual_m.shape)
    failed = np.zeros(residual_m.shape, dtype=np.bool_)
    for row in range(n_baselines):
        for band in range(n_bands):
            for sat in range(n_sats):
                limit = k_ffd[chosen[sat]] * sigma_m[row, band, sat]
                threshold[row, band, sat] = limit
                size = np.abs(residual_m[row, band, sat])
                if masks[chosen[sat], band] and np.isfinite(size) and limit < half_wavelength_m[band]:
                    statistic[row, band, sat] = size
                    failed[row, band, sat] = not size <= limit
    place = deciding(statistic, threshold, all_of_band)
    decided, limits = picked(statistic, place), picked(threshold, place)
    exceeded = np.empty(n_sats, dtype=np.bool_)
    for sat in range(n_sats):
        exceeded[sat] = due[sat] and decided[sat] > limits[sat]
    return statistic, threshold, failed, decided, limits, exceeded


@compiled
def noise_excess(residual_m, sigma_m, nominal_sigma_m, assumed_sigma_m):
    """How much noisier the first band of each satellite is than assumed, on its worst baseline, ``(N,)``; 1 at least.

    ``assumed_sigma_m`` (B, N).
    """
    n_baselines, _, n_sats = residual_m.shape
    excess = np.ones(n_sats)
    for row in range(n_baselines):
        for sat in range(n_sats):
            if np.isfinite(residual_m[row, 0, sat]):
                sigma = np.fmax(sigma_m[row, 0, sat], nominal_sigma_m[row, 0, sat])
                ratio = sigma / assumed_sigma_m[row, sat]
                if not (ratio <= excess[sat] or np.isnan(excess[sat])):
                    excess[sat] = ratio
    return excess
