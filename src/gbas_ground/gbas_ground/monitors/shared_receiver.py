"""Is it the receiver? Double differences that are wrong on several satellites wherever one receiver takes part.

A wrong survey, a code clock that is not the carriers' clock, half wavelengths in the carriers of one receiver: each
shows on many satellites, and on no baseline without that receiver. A satellite *points* to a receiver when

- each of the receiver's baselines is beyond half its threshold,
- each of the others is within half its threshold,
- and the least of the first is so much more than the most of the others that no plane, that is neither a gradient of
  the ionosphere nor an orbit, goes through the receivers: through three others that agree, and are not in a line, only
  the level plane goes.

Three receivers always have a plane, and two always a line: there nobody can tell, and the satellites are excluded.

The edge of a front may have reached one antenna alone: then the satellites it hits point to that receiver. The edge is
a line, and it passes between antennas some hundred metres apart for those satellites only whose pierce points lie along
it; pierce points are hundreds of kilometres apart. A receiver is therefore named when several satellites point to it
whose pierce points are not along a line; and only when at least half of all satellites that can tell do so are the
satellites judged without it at once. Otherwise they are excluded as if nothing were known of the receiver, and come
back when they have passed for the re-admission time with the receivers that are left.

False alarms: one double difference at least is beyond its whole threshold, so that naming a receiver is part of the
budget of the gradient monitor; two satellites more at half the threshold leave nothing to speak of.

What it does not see: a gradient that makes whole wavelengths over two baselines of the other three at once.

Source: ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_ground.corrections import BoolArray
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences
from gbas_ground.monitors.result import MonitorResult

# Uncertain, ours.
_SHARE: Final = 0.5  # of the threshold: half is more than three sigmas
_MARGIN: Final = 2.0  # over what a plane could do, for the noise
_ACROSS_M: Final = 50.0e3  # pierce points within such a strip may be along one edge; a hundred times a baseline
_SHELL_M: Final = 350.0e3
_EARTH_RADIUS_M: Final = 6_371_000.0
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
    baselines: Baselines,
    gains: FloatArray,
    due: BoolArray,
    elevation_rad: FloatArray,
    azimuth_rad: FloatArray,
    least: int,
) -> SharedReceiver:
    """Look for a receiver behind the double differences of one epoch.

    Parameters
    ----------
    differences : DoubleDifferences
    threshold_m : (B, F, N) array
        [m].
    baselines : Baselines
    gains : (R,) array
        From :func:`plane_gains`.
    due : (N,) bool array
        Satellites that count.
    elevation_rad, azimuth_rad : (N,) arrays
    least : int
        Satellites that have to point to a receiver.
    """
    pointing, tells = pointing_satellites(differences, threshold_m, baselines, gains)
    pointing = pointing & due
    number = pointing.sum(axis=1)
    beyond = (np.abs(differences.residual_m) > threshold_m).any(axis=(0, 1))
    worst = int(number.argmax())
    theirs = pointing[worst]
    named = (
        number[worst] >= max(1, least)
        and (number == number[worst]).sum() == 1
        and bool((theirs & beyond).any())
        and across_m(elevation_rad[theirs], azimuth_rad[theirs]) >= _ACROSS_M
    )
    failed = (np.arange(len(number)) == worst) & named
    result = MonitorResult(
        statistic=number.astype(np.float64), threshold=np.full(len(number), float(least)), failed=failed
    )
    return SharedReceiver(receivers=result, most=named and 2 * int(number[worst]) >= int((tells & due).sum()))


def pointing_satellites(
    differences: DoubleDifferences, threshold_m: FloatArray, baselines: Baselines, gains: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Which satellites point to which receiver ``(R, N)``, and which could point to one at all ``(N,)``."""
    size = np.abs(differences.residual_m)
    share = size / threshold_m
    count, n_sats = len(baselines.place_m), size.shape[-1]
    pointing, tells = np.zeros((count, n_sats), dtype=bool), np.zeros(n_sats, dtype=bool)
    for receiver, gain in enumerate(gains):
        own = _of(receiver, baselines)
        if (~own).sum() < _OTHERS or not np.isfinite(gain):
            continue
        # a missing one is neither
        shared = (share[own] >= _SHARE).all(axis=0) & (share[~own] <= _SHARE).all(axis=0)
        no_plane = size[own].min(axis=0) > _MARGIN * gain * size[~own].max(axis=0)
        pointing[receiver] = (shared & no_plane).any(axis=0)
        tells |= np.isfinite(size).all(axis=0).any(axis=0)
    return pointing, tells


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
    angle = angle - np.arcsin(np.cos(elevation_rad) * _EARTH_RADIUS_M / (_EARTH_RADIUS_M + _SHELL_M))
    away_m = (_EARTH_RADIUS_M + _SHELL_M) * angle
    east, north = away_m * np.sin(azimuth_rad), away_m * np.cos(azimuth_rad)
    if east.size < _OTHERS:
        return 0.0
    turn = np.arange(_DIRECTIONS)[:, np.newaxis] * (np.pi / _DIRECTIONS)
    return float(np.ptp(east * np.sin(turn) + north * np.cos(turn), axis=1).min())


def _of(receiver: int, baselines: Baselines) -> BoolArray:
    return (baselines.first == receiver) | (baselines.second == receiver)


def plane_gains(baselines: Baselines) -> FloatArray:
    """How much the least of a receiver's baselines can be, over the most of the others, when a plane makes both, (R,).

    With the receiver's place ``p = sum a_j p_j`` of the other three and ``sum a_j = 1``, a plane has there
    ``v - v_i = sum over j other than i of a_j (v_j - v_i)``. Infinite where the others are in a line, and without three
    of them; made once.
    """
    place = baselines.place_m[:, :2] * 1e-3
    gains = np.full(len(place), np.inf)
    for row in range(len(place)):
        others = np.delete(place, row, axis=0)
        system = np.vstack([others.T, np.ones(len(others))])
        if len(others) == _OTHERS and np.linalg.cond(system) < _IN_A_LINE:
            share = np.abs(np.linalg.solve(system, np.append(place[row], 1.0)))
            gains[row] = max(1.0, float(share.sum() - share.max()))
    return gains
