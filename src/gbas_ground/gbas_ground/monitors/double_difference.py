"""Double differences of the carrier over the station's baselines, without the whole wavelengths in them.

What is left of a carrier when geometry, satellite clock and troposphere are taken off is the receiver's clock, an
unknown number of wavelengths, noise and multipath, and whatever the satellite does that it should not: a gradient of
the ionosphere over the site, an orbit that is not the broadcast one. Differences between receivers and satellites
remove the clocks; taking off the nearest multiple of the wavelength removes the unknown number, and every such multiple
of the rest with it.

Geometry is taken off receiver by receiver, with the range between the surveyed antenna and the satellite at the
transmission time of that receiver's own code, instead of the paper's product of the baseline and a difference of unit
vectors. That is exact for any baseline and for receivers that sample at different instants.

A double difference does not say which of its two satellites is the bad one. Each satellite is therefore compared with
several others, the reference satellites, and the middle one of its statistics counts: a gradient on one reference
shifts one statistic of every other satellite, but nearly all of its own.

Axes: baselines B, bands F, satellites N.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach,
eq (1) and (2); Khanafseh, Yang, Pervan, ION GNSS 2010. The choice of reference satellites is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_core.signals import SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.gradient_detectability import Fuse, wrap_m

Pairing = Literal["star", "all"]

NO_REFERENCE: Final = -1
_EARTH_RADIUS_M: Final = 6_371_000.0
_DISTANCE_M: Final = 23.0e6  # of a satellite; its part is small


@dataclass(frozen=True, kw_only=True, eq=False)
class Baselines:
    """Pairs of reference receivers and the vectors between them; made once, by :func:`baselines_of`.

    Attributes
    ----------
    first, second : (B,) int arrays
        Rows of the receivers.
    vector_m : (B, 3) array
        From the first to the second, east, north, up [m].
    place_m : (R, 3) array
        Receivers from the reference point, east, north, up [m].
    """

    first: IntArray
    second: IntArray
    vector_m: FloatArray
    place_m: FloatArray

    def __len__(self) -> int:
        return len(self.first)


def baselines_of(positions_m: FloatArray, reference_m: FloatArray, pairing: Pairing = "all") -> Baselines:
    """Baselines of a station.

    Parameters
    ----------
    positions_m : (R, 3) array
        Surveyed antennas, ECEF [m].
    reference_m : (3,) array
        Reference point, ECEF [m].
    pairing : {"all", "star"}
        Every pair of receivers, or the first receiver with each other one, as in the paper. A star ends with its first
        receiver.

    Returns
    -------
    Baselines
        None (B = 0) for a single receiver.

    Raises
    ------
    ValueError
        For another pairing.
    """
    if pairing not in ("all", "star"):
        raise ValueError(f"pairing is {pairing!r}: it must be all or star")
    latitude, longitude, _ = geodetic_from_ecef(reference_m)
    enu = (np.asarray(positions_m) - reference_m) @ rot_enu_ecef(latitude, longitude).T
    count = len(enu)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count) if pairing == "all" or i == 0]
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    return Baselines(first=first, second=second, vector_m=enu[second] - enu[first], place_m=enu)


@dataclass(frozen=True, kw_only=True)
class Troposphere:
    """The air at the site, as in message type 2.

    Attributes
    ----------
    refractivity : float
        N_r [-].
    scale_height_m : float
        h_0 [m].
    """

    refractivity: float
    scale_height_m: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.refractivity) and self.refractivity >= 0.0):
            raise ValueError(f"troposphere: refractivity is {self.refractivity}: it must be finite and not negative")
        if not (np.isfinite(self.scale_height_m) and self.scale_height_m > 0.0):
            raise ValueError(f"troposphere: scale_height_m is {self.scale_height_m}: it must be above 0 m")

    def delay_m(self, elevation_rad: FloatArray, azimuth_rad: FloatArray, place_m: FloatArray) -> FloatArray:
        """Slant delay at each receiver, ``(R, N)`` [m].

        Parameters
        ----------
        elevation_rad, azimuth_rad : (N,) arrays
            At the reference point.
        place_m : (R, 3) array
            Receivers from the reference point, east, north, up [m].

        Notes
        -----
        The curvature of the Earth matters: a receiver 770 m nearer to the satellite sees it 0.007 degrees
        higher, mostly because its vertical is another, and at 8 degrees the delay is 15 mm less. Two metres of height
        make 4 mm there.

        Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3, the delay whose difference between two heights is TC.
        """
        towards = place_m[:, :1] * np.sin(azimuth_rad) + place_m[:, 1:2] * np.cos(azimuth_rad)
        sine = np.sin(elevation_rad)
        higher = towards * (1.0 / _EARTH_RADIUS_M + sine / _DISTANCE_M)
        sine = sine + np.cos(elevation_rad) * higher
        zenith = self.refractivity * 1e-6 * self.scale_height_m * np.exp(-place_m[:, 2:] / self.scale_height_m)
        return np.asarray(zenith / np.sqrt(0.002 + sine**2))


def carrier_residual_m(
    carrier_m: FloatArray,
    range_m: FloatArray,
    clock_s: FloatArray,
    delay_m: FloatArray,
    bands: tuple[int, ...],
) -> FloatArray:
    """Carriers without geometry, satellite clock and troposphere.

    Parameters
    ----------
    carrier_m : (R, N_BANDS, N) array
        [m].
    range_m, clock_s : (R, N) arrays
        Expected range [m] and satellite clock [s].
    delay_m : (R, N) array
        Of the troposphere, :meth:`Troposphere.delay_m` [m].
    bands : tuple of int
        Bands kept.

    Returns
    -------
    (R, F, N) array
        Receiver clock, ambiguity and minus the ionosphere [m].
    """
    expected = range_m - SPEED_OF_LIGHT_MPS * clock_s + delay_m
    return carrier_m[:, list(bands)] - expected[:, np.newaxis, :]


def reference_satellites(may_refer: BoolArray, elevation_rad: FloatArray, count: int) -> IntArray:
    """The highest satellites of each satellite's constellation, ``(N, count)``; -1 where there are fewer.

    Parameters
    ----------
    may_refer : (N,) bool array
        Satellites that are healthy and tracked.
    elevation_rad : (N,) array
    count : int
        Most reference satellites of one constellation.
    """
    result = np.full((N_SATS, count), NO_REFERENCE)
    for group in CLOCK_GROUPS:
        here = np.flatnonzero(may_refer & group & np.isfinite(elevation_rad))
        highest = here[np.argsort(-elevation_rad[here], kind="stable")[:count]]
        result[group, : len(highest)] = highest
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class DoubleDifferences:
    """One value a baseline, band and satellite: that against the middle one of its reference satellites.

    Attributes
    ----------
    residual_m : (B, F, N) array
        Within half a wavelength [m]; NaN where there is none.
    sigma_m : (B, F, N) array
        Its sigma [m].
    nominal_sigma_m : (B, F, N) array
        Sigma of the one that is the middle one without noise: for what can be detected [m].
    reference : (B, F, N) int array
        The reference satellite; -1 where there is none.
    """

    residual_m: FloatArray
    sigma_m: FloatArray
    nominal_sigma_m: FloatArray
    reference: IntArray


def double_differences(
    residual_m: FloatArray,
    baselines: Baselines,
    references: IntArray,
    elevation_rad: FloatArray,
    noise: CarrierNoise,
    bands: tuple[int, ...],
) -> DoubleDifferences:
    """Double differences of all satellites, each against its reference satellites.

    Parameters
    ----------
    residual_m : (R, F, N) array
        From :func:`carrier_residual_m`; NaN where a channel is not to be used [m].
    baselines : Baselines
    references : (N, P) int array
        From :func:`reference_satellites`.
    elevation_rad : (N,) array
    noise : CarrierNoise
    bands : tuple of int
        The F bands.

    Notes
    -----
    The middle of an even number is the smaller of the two in the middle. With P = 5, a gradient that two reference
    satellites share is found on both, and nobody else is blamed; in general with (P - 1) / 2. Fewer references than
    that, and it is the others that fail. A satellite with a single reference shares its verdict.
    """
    shape = (len(baselines), len(bands), N_SATS)
    single = residual_m[baselines.second] - residual_m[baselines.first]
    factors = noise.factors(len(residual_m))
    scale = np.hypot(factors[baselines.first], factors[baselines.second])
    variance = (scale[:, np.newaxis, np.newaxis] * noise.sigma_m(elevation_rad, bands)) ** 2
    here = np.flatnonzero(np.isfinite(single).any(axis=(0, 1)))
    result = DoubleDifferences(
        residual_m=np.full(shape, np.nan),
        sigma_m=np.full(shape, np.nan),
        nominal_sigma_m=np.full(shape, np.nan),
        reference=np.full(shape, NO_REFERENCE),
    )
    if here.size and len(baselines):
        found = _middle(single, variance, references, here, WAVELENGTH_M[list(bands)])
        for name, value in zip(("residual_m", "sigma_m", "nominal_sigma_m", "reference"), found, strict=True):
            getattr(result, name)[..., here] = value
    return result


def _middle(
    single_m: FloatArray, variance_m2: FloatArray, references: IntArray, here: IntArray, wavelength_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Residual, sigma, nominal sigma and reference of the middle statistic of the satellites `here`."""
    others = references[here]  # (n, P)
    valid = (others != NO_REFERENCE) & (others != here[:, np.newaxis])
    difference = single_m.take(here, axis=-1)[..., np.newaxis] - single_m.take(others, axis=-1)  # (B, F, n, P)
    wrapped = np.where(valid, wrap_m(difference, wavelength_m[:, np.newaxis, np.newaxis]), np.nan)
    variance = variance_m2.take(here, axis=-1)[..., np.newaxis] + variance_m2.take(others, axis=-1)
    there = np.isfinite(wrapped)
    number = there.sum(axis=-1)
    rank = np.maximum(number - 1, 0) // 2
    each = np.arange(number.size).reshape(number.shape) * others.shape[-1]
    order = np.argsort(wrapped**2 / variance, axis=-1).ravel()  # NaN last
    middle = order[each + rank] + each
    # Without noise a gradient is the larger against its sigma the smaller that is: the middle one from above.
    ordered = np.sort(np.where(there, variance, np.nan), axis=-1).ravel()
    nominal = np.sqrt(ordered[each + np.maximum(number - 1 - rank, 0)])
    known = number > 0
    chosen = np.broadcast_to(others, wrapped.shape).reshape(-1)[middle]
    return (
        wrapped.ravel()[middle],
        np.where(known, np.sqrt(variance.ravel()[middle]), np.nan),
        nominal,
        np.where(known, chosen, NO_REFERENCE),
    )


def decided(statistic: FloatArray, threshold: FloatArray, fuse: Fuse = "any") -> tuple[FloatArray, FloatArray]:
    """Statistic and threshold of the baseline and band that decide about each satellite.

    Parameters
    ----------
    statistic, threshold : (B, F, N) arrays
        NaN where there is none.
    fuse : {"any", "all"}
        The worst of all; or the worst of the bands' best baselines, so that all of a band have to fail.

    Returns
    -------
    (N,) arrays
        NaN for a satellite without a statistic.
    """
    n_sats = statistic.shape[-1]
    if statistic.size == 0:  # a single receiver
        return np.full(n_sats, np.nan), np.full(n_sats, np.nan)
    place, each = _deciding(statistic / threshold, fuse), np.arange(n_sats)
    return statistic.reshape(-1, n_sats)[place, each], threshold.reshape(-1, n_sats)[place, each]


def _deciding(ratio: FloatArray, fuse: Fuse) -> IntArray:
    """Baseline and band (N,), flattened, that decide: the worst, or the worst of the bands' best; NaN is none."""
    n_bands, n_sats = ratio.shape[1:]
    if fuse == "any":
        flat = ratio.reshape(-1, n_sats)
        return np.asarray(np.argmax(np.where(np.isnan(flat), -1.0, flat), axis=0))
    best = np.argmin(np.where(np.isnan(ratio), np.inf, ratio), axis=0)  # (F, N)
    least = np.take_along_axis(ratio, best[np.newaxis], axis=0)[0]
    band = np.argmax(np.where(np.isnan(least), -1.0, least), axis=0)
    return np.asarray(best[band, np.arange(n_sats)] * n_bands + band)
