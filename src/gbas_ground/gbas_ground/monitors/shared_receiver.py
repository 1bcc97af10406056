"""Is it the receiver? Double differences that are wrong on several satellites wherever one receiver takes part.

A wrong survey, a code clock that is not the carriers' clock, half wavelengths in the carriers of one receiver: each
shows on many satellites, and on no baseline without that receiver. A satellite *points* to a receiver when

- each of the receiver's baselines is beyond half its threshold,
- each of the others is within half its threshold, on both bands where there are two,
- the least of the first is so much more than the most of the others that no plane, that is neither a gradient of the
  ionosphere nor an orbit, goes through the receivers: through three others that agree, and are not in a line, only the
  level plane goes,
- nor does a plane that is whole wavelengths higher at some of the others, up to a gradient of 600 mm/km, and on both
  bands where there are two.

Three receivers always have a plane, and two always a line: there nobody can tell, and the satellites are excluded.

The edge of a front may have reached one antenna alone: then the satellites it hits point to that receiver. The edge is
a line, and it passes between antennas some hundred metres apart for those satellites only whose pierce points lie along
it; pierce points are hundreds of kilometres apart. A receiver is therefore named when several satellites point to it,
half of those at least that are beyond a threshold, with pierce points that are not along a line. Only when at least
half of all satellites that can tell point to it are the satellites judged without it at once. Otherwise they are
excluded as if nothing were known of the receiver, and come back when they have passed for the re-admission time with
the receivers that are left.

False alarms: one double difference at least is beyond its whole threshold, so that naming a receiver is part of the
budget of the gradient monitor; two satellites more at half the threshold leave nothing to speak of.

Source: ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gbas_core.models.error_models import IONO_EARTH_RADIUS_M, IONO_SHELL_HEIGHT_M
from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import IONO_RATIO, WAVELENGTH_M
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences
from gbas_ground.monitors.gradient_detectability import wrap_m
from gbas_ground.monitors.result import MonitorResult

# Uncertain, ours.
_SHARE: Final = 0.5  # of the threshold: half is more than three sigmas
_MARGIN: Final = 2.0  # over what a plane could do, for the noise
_ACROSS_M: Final = 50.0e3  # pierce points within such a strip may be along one edge; a hundred times a baseline
_LARGEST: Final = 600.0e-6  # gradient whose whole wavelengths are reckoned with [m/m]; threat models end at 425 mm/km
_OTHERS: Final = 3  # baselines of the three receivers that have to agree
_DIRECTIONS: Final = 36
_IN_A_LINE: Final = 1e3  # condition of places in kilometres


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedReceiver:
    """What the double differences of one epoch say of the receivers.

    Attributes
    ----------
    receivers : MonitorResult
        ``(R,)``: satellites that point to each receiver, and the number that names it; at most one fails.
    most : bool
        At least half of the satellites that can tell point to the receiver that fails.
    """

    receivers: MonitorResult
    most: bool


def shared_receiver(
    differences: DoubleDifferences,
    threshold_m: FloatArray,
    planes: tuple[Planes, ...],
    due: BoolArray,
    direction_rad: tuple[FloatArray, FloatArray],
    least: int,
) -> SharedReceiver:
    """Look for a receiver behind the double differences of one epoch.

    Parameters
    ----------
    differences : DoubleDifferences
    threshold_m : (B, F, N) array
        [m].
    planes : tuple of Planes
        From :func:`planes_of`.
    due : (N,) bool array
        Satellites that count.
    direction_rad : pair of (N,) arrays
        Elevations and azimuths.
    least : int
        Satellites that have to point to a receiver.
    """
    pointing, tells = pointing_satellites(differences, threshold_m, planes)
    pointing = pointing & due
    number = pointing.sum(axis=1)
    beyond = due & tells & (np.abs(differences.residual_m) > threshold_m).any(axis=(0, 1))
    worst = int(number.argmax())
    theirs = pointing[worst]
    failing = int((theirs & beyond).sum())
    named = (
        number[worst] >= max(1, least)
        and (number == number[worst]).sum() == 1
        and failing > 0
        and 2 * failing >= int(beyond.sum())
        and across_m(*(each[theirs] for each in direction_rad)) >= _ACROSS_M
    )
    failed = (np.arange(len(number)) == worst) & named
    result = MonitorResult(
        statistic=number.astype(np.float64), threshold=np.full(len(number), float(least)), failed=failed
    )
    return SharedReceiver(receivers=result, most=named and 2 * int(number[worst]) >= int((tells & due).sum()))


def pointing_satellites(
    differences: DoubleDifferences, threshold_m: FloatArray, planes: tuple[Planes, ...]
) -> tuple[BoolArray, BoolArray]:
    """Which satellites point to which receiver ``(R, N)``, and which could point to one at all ``(N,)``."""
    size = np.abs(differences.residual_m)
    share = size / threshold_m
    n_sats = size.shape[-1]
    pointing, tells = np.zeros((len(planes), n_sats), dtype=bool), np.zeros(n_sats, dtype=bool)
    for receiver, each in enumerate(planes):
        if not np.isfinite(each.gain):
            continue
        own = each.own
        # a missing one is neither; what is quiet on one band must not be whole wavelengths that the other one tells
        shared = (share[own] >= _SHARE).all(axis=0) & (share[~own] <= _SHARE).all(axis=0)
        shared &= ~(share[~own] > _SHARE).any(axis=(0, 1))
        largest = _MARGIN * each.gain * size[~own].max(axis=0)
        found = (shared & (size[own].min(axis=0) > largest)).any(axis=0)
        for satellite in np.flatnonzero(found):
            tolerance = _SHARE * threshold_m[..., satellite]
            tolerance[own] = np.maximum(tolerance[own], largest[:, satellite])
            found[satellite] = not _whole_wavelengths(differences.residual_m[..., satellite], tolerance, each)
        pointing[receiver] = found
        tells |= np.isfinite(size).all(axis=0).any(axis=0)
    return pointing, tells


def _whole_wavelengths(residual_m: FloatArray, tolerance_m: FloatArray, planes: Planes) -> bool:
    """Whether a plane with whole wavelengths between the other receivers explains all of a satellite's ``(B, F)``."""
    misfit = np.abs(wrap_m(residual_m - planes.whole_m, planes.wavelength_m))
    return bool(((misfit <= tolerance_m) | np.isnan(misfit)).all(axis=(1, 2)).any())


def seen_quiet(
    differences: DoubleDifferences, threshold_m: FloatArray, baselines: Baselines, receiver: int, least: int
) -> bool | None:
    """Whether a receiver's own baselines are quiet: none beyond its threshold, no satellite beyond half of all of them.

    Satellites that are wrong without it, too, do not count.

    Returns
    -------
    bool or None
        None when fewer than `least` satellites could be looked at.
    """
    own = _of(receiver, baselines)
    share = np.abs(differences.residual_m) / threshold_m
    healthy = ~(share[~own] > 1.0).any(axis=(0, 1))
    share = np.where(healthy, share[own], np.nan)
    there = np.isfinite(share)
    if int(there.any(axis=(0, 1)).sum()) < max(1, least):
        return None
    together = np.where(there, share, np.inf).min(axis=0, initial=np.inf)
    return not bool((share > 1.0).any() or (np.isfinite(together) & (together >= _SHARE)).any())


def across_m(elevation_rad: FloatArray, azimuth_rad: FloatArray) -> float:
    """Width of the narrowest strip that holds the pierce points of satellites [m]; 0 for two."""
    angle = 0.5 * np.pi - elevation_rad
    shell_m = IONO_EARTH_RADIUS_M + IONO_SHELL_HEIGHT_M
    angle = angle - np.arcsin(np.cos(elevation_rad) * IONO_EARTH_RADIUS_M / shell_m)
    away_m = shell_m * angle
    east, north = away_m * np.sin(azimuth_rad), away_m * np.cos(azimuth_rad)
    if east.size < _OTHERS:
        return 0.0
    turn = np.arange(_DIRECTIONS)[:, np.newaxis] * (np.pi / _DIRECTIONS)
    return float(np.ptp(east * np.sin(turn) + north * np.cos(turn), axis=1).min())


def _of(receiver: int, baselines: Baselines) -> BoolArray:
    return np.asarray((baselines.first == receiver) | (baselines.second == receiver))


class Planes(NamedTuple):
    """What planes through the antennas can do to the baselines of one receiver and to the others.

    Attributes
    ----------
    own : (B,) bool array
        Baselines of the receiver.
    gain : float
        The least of the receiver's baselines over the most of the others is at most this; infinite without three others
        that are not in a line.
    whole_m : (K, B, F) array
        Double differences of the planes with whole wavelengths between the others, not all zero [m].
    wavelength_m : (F,) array
    """

    own: BoolArray
    gain: float
    whole_m: FloatArray
    wavelength_m: FloatArray


def planes_of(baselines: Baselines, bands: tuple[int, ...]) -> tuple[Planes, ...]:
    """Of each receiver; made once for a station.

    Notes
    -----
    With the receiver's place ``p = sum a_j p_j`` of the other three and ``sum a_j = 1``, a plane has there
    ``v - v_i = sum over j other than i of a_j (v_j - v_i)``.
    """
    place = baselines.place_m[:, :2]
    wavelength = WAVELENGTH_M[list(bands)]
    result = []
    for row in range(len(place)):
        own = _of(row, baselines)
        others = np.delete(place, row, axis=0)
        system = np.vstack([others.T * 1e-3, np.ones(len(others))])
        gain, whole = np.inf, np.zeros((0, len(own), len(bands)))
        if (~own).sum() == _OTHERS and np.linalg.cond(system) < _IN_A_LINE:
            share = np.abs(np.linalg.solve(system, np.append(place[row] * 1e-3, 1.0)))
            gain = max(1.0, float(share.sum() - share.max()))
            whole = _whole_planes(baselines.vector_m[:, :2], ~own, wavelength[0], IONO_RATIO[list(bands)])
        result.append(Planes(own=own, gain=gain, whole_m=whole, wavelength_m=wavelength))
    return tuple(result)


def _whole_planes(vector_m: FloatArray, others: BoolArray, wavelength_m: float, ratio: FloatArray) -> FloatArray:
    """Double differences ``(K, B, F)`` of the gradients that make whole wavelengths of the first band over `others`."""
    two = vector_m[others][:2]
    most = int(np.ceil(_LARGEST * ratio[0] * np.hypot(*two.T).max() / wavelength_m))
    number = np.stack(np.meshgrid(*[np.arange(-most, most + 1)] * 2), axis=-1).reshape(-1, 2)
    gradient = number[number.any(axis=1)] * wavelength_m @ np.linalg.inv(two).T / ratio[0]
    gradient = gradient[np.hypot(*gradient.T) <= _LARGEST]
    return np.asarray((gradient @ vector_m.T)[..., np.newaxis] * ratio)
