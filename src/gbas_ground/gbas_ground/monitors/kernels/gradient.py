# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Gradients of the ionosphere, and the P of orbits; axes as in :mod:`gbas_ground.monitors.double_difference`."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.carrier_noise import differenced_sigma_m
from gbas_ground.monitors.kernels.double_difference import deciding


@compiled
def seen(residual_m, n_bands, code):
    """Which baselines and bands see each satellite, into ``(N,)``: bit ``b F + f``, of so many of the bands."""
    code[:] = 0
    for row in range(residual_m.shape[0]):
        for band in range(n_bands):
            for sat in range(residual_m.shape[2]):
                if np.isfinite(residual_m[row, band, sat]):
                    code[sat] |= np.int64(1) << (row * n_bands + band)


@compiled
def sky(residual_m, nominal_sigma_m, scale, per_step, found):
    """What the choice of tests rests on, into ``(1 + F, N)``: :func:`seen`, and the noise of each band.

    That is the largest sigma over the baselines' scales, in steps of its logarithm, rounded up.
    """
    n_baselines, n_bands, n_sats = residual_m.shape
    seen(residual_m, n_bands, found[0])
    for band in range(n_bands):
        for sat in range(n_sats):
            largest = 0.0
            for row in range(n_baselines):
                if np.isfinite(residual_m[row, band, sat]):
                    largest = max(largest, nominal_sigma_m[row, band, sat] / scale[row])
            found[1 + band, sat] = np.int64(np.ceil(np.log(largest) * per_step)) if largest > 0.0 else 0


@compiled
def looked(residual_m, sigma_m, k_ffd, half_wavelength_m, tested):
    """Statistic and threshold of a double difference; NaN statistic where it is not tested, or never could fail."""
    threshold = k_ffd * sigma_m
    if tested and np.isfinite(residual_m) and threshold < half_wavelength_m:
        return np.abs(residual_m), threshold
    return np.nan, threshold


@compiled
def test(residual_m, sigma_m, chosen, masks, k_ffd, half_wavelength_m, all_of_band, due, found, exceeded):
    """Test every satellite by the baseline and band that decides.

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
    found : (2, N) array
        Filled in: statistic and threshold [m].
    exceeded : (N,) bool array
        Filled in.
    """
    n_baselines, n_bands, n_sats = residual_m.shape
    found[:] = np.nan
    exceeded[:] = False
    ratio, each = np.empty((n_baselines, n_bands)), np.empty((2, n_baselines, n_bands))
    for sat in range(n_sats if n_baselines > 0 else 0):
        for row in range(n_baselines):
            for band in range(n_bands):
                each[0, row, band], each[1, row, band] = looked(
                    residual_m[row, band, sat], sigma_m[row, band, sat], k_ffd[chosen[sat]],
                    half_wavelength_m[band], masks[chosen[sat], band],
                )  # fmt: skip
                ratio[row, band] = each[0, row, band] / each[1, row, band]
        row, band = deciding(ratio, all_of_band)
        found[0, sat], found[1, sat] = each[0, row, band], each[1, row, band]
        exceeded[sat] = due[sat] and found[0, sat] > found[1, sat]


@compiled
def noise_excess(residual_m, sigma_m, nominal_sigma_m, own_sigma_m, scale, reference_m, code, excess):
    """How much noisier the first band of each satellite is than assumed, on its worst baseline, into ``(N,)``.

    1 at least. ``own_sigma_m`` (N,), ``scale`` (B,), ``reference_m``: what is assumed; ``code`` (N,) is filled in:
    :func:`seen` of the first band.
    """
    seen(residual_m, 1, code)
    excess[:] = 1.0
    for row in range(residual_m.shape[0]):
        for sat in range(residual_m.shape[2]):
            if np.isfinite(residual_m[row, 0, sat]):
                sigma = np.fmax(sigma_m[row, 0, sat], nominal_sigma_m[row, 0, sat])
                ratio = sigma / differenced_sigma_m(scale[row], own_sigma_m[sat], reference_m)
                if not (ratio <= excess[sat] or np.isnan(excess[sat])):
                    excess[sat] = ratio


@compiled
def supported(elevation_rad, table):
    """P at an elevation by a table of whole degrees; infinite for one that is not known, or not above the ground."""
    degrees = np.degrees(elevation_rad)
    return table[int(degrees)] if degrees >= 0.0 and degrees <= 90.0 else np.inf


@compiled
def bound_by(bound, code, which, excess, elevation_rad, table):
    """Fill in P of the satellites that the baselines of one code see."""
    for sat in range(len(bound)):
        if code[sat] == which:
            bound[sat] = excess[sat] * supported(elevation_rad[sat], table)


@compiled
def spread(residual_m, band, rows, table):
    """Double differences of a band in the rows of the table's baselines, ``(K, N)``; NaN in the others."""
    table[:] = np.nan
    for row in range(len(rows)):
        for sat in range(table.shape[1]):
            table[rows[row], sat] = residual_m[row, band, sat]
