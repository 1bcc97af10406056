# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Double differences of the carrier; axes and sources as in :mod:`gbas_ground.monitors.double_difference`."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.signals import SPEED_OF_LIGHT_MPS

_EARTH_RADIUS_M: Final = 6_371_000.0
_DISTANCE_M: Final = 23.0e6  # of a satellite; its part is small


@compiled
def wrapped(value_m, wavelength_m):
    """What is left of a double difference when the nearest multiple of the wavelength is taken off [m].

    Source: Khanafseh, Yang, Pervan, ION GNSS 2010; the paper, eq (2).
    """
    return value_m - wavelength_m * np.rint(value_m / wavelength_m)


@compiled
def obliquity(sine):
    """Slant over zenith delay of the troposphere, by the sine of the elevation.

    Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3.
    """
    return 1.0 / np.sqrt(0.002 + sine * sine)


@compiled
def slant_delays_m(elevation_rad, azimuth_rad, place_m, refractivity, scale_height_m, delay):
    """Delay of the troposphere at each receiver, into ``(R, N)`` [m].

    Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3, the delay whose difference between two heights is TC.
    """
    for sat in range(len(elevation_rad)):
        sine, cosine = np.sin(elevation_rad[sat]), np.cos(elevation_rad[sat])
        east, north = np.sin(azimuth_rad[sat]), np.cos(azimuth_rad[sat])
        for row in range(len(place_m)):
            towards = place_m[row, 0] * east + place_m[row, 1] * north
            higher = towards * (1.0 / _EARTH_RADIUS_M + sine / _DISTANCE_M)
            delay[row, sat] = obliquity(sine + cosine * higher)
    for row in range(len(place_m)):
        zenith = refractivity * 1e-6 * scale_height_m * np.exp(-place_m[row, 2] / scale_height_m)
        for sat in range(len(elevation_rad)):
            delay[row, sat] *= zenith


@compiled
def residuals_m(carrier_m, range_m, clock_s, delay_m, bands, residual):
    """Carriers without geometry, satellite clock and troposphere, into ``(R, F, N)`` [m]."""
    for row in range(residual.shape[0]):
        for place in range(residual.shape[1]):
            for sat in range(residual.shape[2]):
                expected = range_m[row, sat] - SPEED_OF_LIGHT_MPS * clock_s[row, sat] + delay_m[row, sat]
                residual[row, place, sat] = carrier_m[row, bands[place], sat] - expected


@compiled
def highest(may_refer, elevation_rad, groups, found):
    """The highest satellites of each satellite's constellation, into ``(N, P)``; -1 where there are fewer."""
    n_sats, count = found.shape
    found[:] = -1
    for group in range(len(groups)):
        best = np.full(count, -1)
        for sat in range(n_sats):
            if not (may_refer[sat] and groups[group, sat] and np.isfinite(elevation_rad[sat])):
                continue
            place = count
            while place > 0 and (best[place - 1] < 0 or elevation_rad[best[place - 1]] < elevation_rad[sat]):
                place -= 1
            for each in range(count - 1, place, -1):
                best[each] = best[each - 1]
            if place < count:
                best[place] = sat
        for sat in range(n_sats):
            if groups[group, sat]:
                found[sat] = best


@compiled
def _insert(values, keys, count, value, key):
    """Keep values sorted by their keys, NaN last, the first of equals first."""
    place = count
    while place > 0 and (key < keys[place - 1] or (np.isnan(keys[place - 1]) and not np.isnan(key))):
        keys[place], values[place] = keys[place - 1], values[place - 1]
        place -= 1
    keys[place], values[place] = key, value


@compiled
def middle(residual_m, first, second, factor, sigma_m, references, wavelength_m, found, chosen):
    """Of every baseline, band and satellite the middle one of the statistics against its reference satellites.

    Parameters
    ----------
    residual_m : (R, F, N) array
        [m].
    first, second : (B,) int arrays
        Receivers of the baselines.
    factor : (R,) array
        Of the receivers' noise.
    sigma_m : (F, N) array
        Of a receiver of factor 1 [m].
    references : (N, P) int array
    wavelength_m : (F,) array
    found : (3, B, F, N) array
        Filled in: double differences, their sigmas and nominal sigmas [m].
    chosen : (B, F, N) int array
        Filled in: the reference satellite.
    """
    n_bands, n_sats = sigma_m.shape
    left, sigma, nominal = found[0], found[1], found[2]
    found[:] = np.nan
    chosen[:] = -1
    most = references.shape[1]
    keys, order = np.empty(most), np.empty(most, dtype=np.int64)
    sizes, values, others = np.empty(most), np.empty(most), np.empty(most, dtype=np.int64)
    single, variance = np.empty(n_sats), np.empty(n_sats)
    for row in range(len(first)):
        scale = np.hypot(factor[first[row]], factor[second[row]])
        for band in range(n_bands):
            for sat in range(n_sats):
                single[sat] = residual_m[second[row], band, sat] - residual_m[first[row], band, sat]
                own = scale * sigma_m[band, sat]
                variance[sat] = own * own
            for sat in range(n_sats):
                if not np.isfinite(single[sat]):
                    continue
                count = 0
                for each in range(most):
                    other = references[sat, each]
                    if other < 0 or other == sat or not np.isfinite(single[other]):
                        continue
                    values[count] = wrapped(single[sat] - single[other], wavelength_m[band])
                    others[count] = other
                    both = variance[sat] + variance[other]
                    _insert(order, keys, count, count, values[count] * values[count] / both)
                    # Without noise a gradient is the larger against its sigma the smaller that is: the middle one
                    # from above.
                    _insert(sizes, sizes, count, both, both)
                    count += 1
                if count == 0:
                    continue
                rank = (count - 1) // 2
                place = order[rank]
                chosen[row, band, sat] = others[place]
                left[row, band, sat] = values[place]
                sigma[row, band, sat] = np.sqrt(variance[sat] + variance[others[place]])
                nominal[row, band, sat] = np.sqrt(sizes[count - 1 - rank])


@compiled
def any_beyond(residual_m, sigma_m, k, due):
    """Whether a double difference of a satellite that is due is beyond k sigma."""
    for row in range(residual_m.shape[0]):
        for band in range(residual_m.shape[1]):
            for sat in range(residual_m.shape[2]):
                if due[sat] and np.abs(residual_m[row, band, sat]) > k * sigma_m[row, band, sat]:
                    return True
    return False


@compiled
def _worst_of_bands(ratio):
    """Baseline and band of the worst of the bands' best of ``(B, F)``; NaN is none."""
    worst, place, band = -1.0, 0, 0
    for each in range(ratio.shape[1]):
        best, least = 0, np.inf
        for row in range(ratio.shape[0]):
            if ratio[row, each] < least:
                best, least = row, ratio[row, each]
        if worst < least < np.inf:
            worst, place, band = least, best, each
    return place, band


@compiled
def _worst(ratio):
    """Baseline and band of the worst of ``(B, F)``; NaN is none."""
    worst, place, band = -1.0, 0, 0
    for row in range(ratio.shape[0]):
        for each in range(ratio.shape[1]):
            if ratio[row, each] > worst:
                worst, place, band = ratio[row, each], row, each
    return place, band


@compiled
def deciding(ratio, all_of_band):
    """Baseline and band that decide about a satellite, by statistics over thresholds ``(B, F)``; of equals the first.

    The worst of all; or, where all baselines of a band have to fail, the worst of the bands' best.
    """
    return _worst_of_bands(ratio) if all_of_band else _worst(ratio)


@compiled
def follow(
    before, residual_m, sigma_m, first, second, shift_m, due, dt_s, max_gap_s, k, wavelength_m, after, found, failed
):
    """Double differences followed through the half wavelengths, and tested.

    Parameters
    ----------
    before, after : (2, B, F, N) arrays
        As they were followed [m], and time since each was last there [s]; `after` is filled in.
    residual_m, sigma_m : (B, F, N) arrays
        Of this epoch [m].
    first, second : (B,) int arrays
    shift_m : (R, N) array
        What a new ephemeris changes [m].
    due : (N,) bool array
    dt_s, max_gap_s, k : float
        Time since the epoch before, longest gap, multiplier of the threshold.
    wavelength_m : (F,) array
    found : (2, N) array
        Filled in: size and threshold of the baseline and band that is worst [m].
    failed : (N,) bool array
        Filled in.
    """
    n_baselines, n_bands, n_sats = residual_m.shape
    for row in range(n_baselines):
        for band in range(n_bands):
            for sat in range(n_sats):
                elapsed = before[1, row, band, sat] + dt_s
                earlier = before[0, row, band, sat] + (shift_m[second[row], sat] - shift_m[first[row], sat])
                now = residual_m[row, band, sat]
                if not np.isfinite(now):
                    after[0, row, band, sat], after[1, row, band, sat] = earlier, elapsed
                    continue
                if 0.0 < elapsed <= max_gap_s:
                    now += wavelength_m[band] * np.rint((earlier - now) / wavelength_m[band])
                after[0, row, band, sat], after[1, row, band, sat] = now, 0.0
    found[:] = np.nan
    ratio = np.empty((n_baselines, n_bands))
    for sat in range(n_sats if n_baselines > 0 else 0):
        for row in range(n_baselines):
            for band in range(n_bands):
                size = np.abs(after[0, row, band, sat]) / (k * sigma_m[row, band, sat])
                ratio[row, band] = size if np.isfinite(residual_m[row, band, sat]) else np.nan
        row, band = deciding(ratio, False)
        found[1, sat] = k * sigma_m[row, band, sat]
        if np.isfinite(residual_m[row, band, sat]):
            found[0, sat] = np.abs(after[0, row, band, sat])
    for sat in range(n_sats):
        failed[sat] = due[sat] and np.isfinite(found[0, sat]) and not found[0, sat] <= found[1, sat]
