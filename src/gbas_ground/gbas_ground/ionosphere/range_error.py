r"""Worst error of one corrected, smoothed range in an ionospheric front, whatever the front does.

With I the slant delay, d = I(air) - I(station) and a smoothing filter of time constant tau on both sides, the corrected
range is wrong by ``e = 2 EMA(d) - d``, EMA being the exponential mean over the past: code and carrier diverge. The
place where the path to a satellite meets the station's plane is x from the station and closes at v. A front whose slope
is g at most never makes d larger than ``g (x + v a)`` at age a.

- A front still, or so slow that it looks still, and not yet, or no longer, over the station: d is at most
  ``g (x + v a)`` and at present ``g x``, so ``e = g (x + 2 v tau)`` (the known worst case). Nothing at the station sees
  it.
- A front that comes to lie between station and aircraft after it covered both makes d small at present while the past
  was full. With the edge p from the station, moving away from it at v_r, ``e = g (x + 2 v tau + 2 v_r tau (1 -
  exp(-p / (v_r tau))) - p)``: worst at ``p = v_r tau ln 2`` with ``0.31 v_r tau`` more, and for fast fronts p more, at
  most ``e = 2 g (x + v tau)``. Such a front has just swept the station, where the divergence monitor sees ``2 g v_r``;
  the satellite is then excluded until the monitor has passed again for the re-admission time. That is all that is
  credited.

The monitor of gradients is credited nothing: it sees slopes over the antennas only, along the runway only, and has
blind gradients; a front that ends short of the antennas, which are 450 m wide, is hardly less harmful (2.6 % at 2.6
km).

Sources: gbas_core.ranging.smoothing (filter); Pullen, Park, Enge, Radio Science 44 (2009) RS0A21
(``g (x + 2 tau v)``). The receding front and its credit are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray
from gbas_ground.ionosphere.threat import FrontThreat

_SHARES: Final = 1.1 ** np.arange(-24.0, 1.0)  # of the largest gradient: a gentler front is seen less
_FRONT_SPEEDS: Final = 40
_FARTHEST_M: Final = 80_000.0
_DISTANCE_STEP_M: Final = 1_000.0
_FASTEST_MPS: Final = 240.0
_SPEED_STEP_MPS: Final = 20.0
_CLOCK_S: Final = np.arange(0.0, 1500.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class DivergenceCredit:
    """What the station's divergence monitor excludes for certain.

    Attributes
    ----------
    threshold_mps : float
        Of the filtered rate [m/s].
    margin_mps : float
        Noise it may lack: the multiplier of missed detection times the statistic's sigma [m/s].
    tau_s : float
        Of both its filters [s].
    readmission_s : float
        A satellite stays excluded this long after its last failure [s].
    """

    threshold_mps: float
    margin_mps: float
    tau_s: float
    readmission_s: float


def away_s(gradient: ArrayLike, speed_mps: ArrayLike, width_m: float, credit: DivergenceCredit | None) -> FloatArray:
    """How long after a front has left the station its satellite is still excluded [s]; 0 when it is not for certain.

    Parameters
    ----------
    gradient, speed_mps : arrays that broadcast
        Of the front [m/m], [m/s].
    width_m : float
        The front's: how long it is over the station [m].
    credit : DivergenceCredit or None
        None credits nothing.

    Source: response of two filters in a row to a rate that begins and ends, gbas_core.ranging.divergence.
    """
    slope, speed = np.broadcast_arrays(np.asarray(gradient, dtype=np.float64), np.asarray(speed_mps, dtype=np.float64))
    if credit is None:
        return np.zeros(slope.shape)
    since = _CLOCK_S / credit.tau_s
    over = width_m / np.maximum(speed[..., np.newaxis], 1e-3) / credit.tau_s
    rate = 2.0 * (slope * speed)[..., np.newaxis] * (_step(over + since) - _step(since))
    surely = rate >= credit.threshold_mps + credit.margin_mps
    last = _CLOCK_S.size - 1 - np.argmax(surely[..., ::-1], axis=-1)
    return np.where(surely.any(axis=-1), _CLOCK_S[last] + credit.readmission_s, 0.0)


def _step(times: FloatArray) -> FloatArray:
    """Response of two equal filters in a row to a step, times in their time constant."""
    return np.asarray(1.0 - (1.0 + times) * np.exp(-times))


class TracedPoint(NamedTuple):
    """Where an aircraft's path to a satellite meets the station's plane.

    Attributes
    ----------
    offset_m : (..., 2) array
        From the station, east and north [m].
    velocity_mps : (..., 2) array
        Of that point [m/s].
    """

    offset_m: FloatArray
    velocity_mps: FloatArray


def worst_range_error_m(
    gradient: FloatArray,
    traced: TracedPoint,
    tau_s: float,
    threat: FrontThreat,
    credit: DivergenceCredit | None,
    *,
    radius_m: float = 0.0,
) -> FloatArray:
    """Largest differential error of a smoothed range over all fronts of a threat model.

    Parameters
    ----------
    gradient : (...) array
        Largest gradient at the satellite's elevation [m/m].
    traced : TracedPoint
    tau_s : float
        Time constant of the smoothing [s].
    threat : FrontThreat
    credit : DivergenceCredit or None
        What the divergence monitor excludes; None credits nothing.
    radius_m : float
        Distance of the farthest antenna from the station: corrections are means over antennas [m].

    Returns
    -------
    (...) array
        Size of the error [m]; never more than twice the largest delay.

    Notes
    -----
    Exact for the worst direction of a front that stands still. What fronts add that move is taken for an aircraft that
    flies straight in, from the next worse place of a table: an upper bound.
    """
    offset_m, velocity_mps = traced
    past = offset_m - 2.0 * tau_s * velocity_mps
    still_m = np.hypot(past[..., 0], past[..., 1]) + radius_m
    distance = np.hypot(offset_m[..., 0], offset_m[..., 1]) / _DISTANCE_STEP_M
    speed = np.hypot(velocity_mps[..., 0], velocity_mps[..., 1]) / _SPEED_STEP_MPS
    table = _receding_m(threat, credit, tau_s, radius_m)
    row, column = np.floor(distance).astype(np.int64), np.floor(speed).astype(np.int64)
    if row.max(initial=0) + 1 >= table.shape[0] or column.max(initial=0) + 1 >= table.shape[1]:
        raise ValueError(f"ionospheric fronts: an aircraft is beyond {_FARTHEST_M:g} m or {_FASTEST_MPS:g} m/s")
    corners = [table[row + i, column + j] for i in (0, 1) for j in (0, 1)]
    of_slope = _SHARES * (still_m[..., np.newaxis] + np.maximum.reduce(corners))
    return np.asarray(np.minimum(gradient * of_slope.max(axis=-1), 2.0 * threat.max_delay_m))


@lru_cache(maxsize=32)
def _receding_m(threat: FrontThreat, credit: DivergenceCredit | None, tau_s: float, radius_m: float) -> FloatArray:
    """What fronts that have swept the station add to ``x + 2 v tau``, per unit of gradient [m].

    Over distance, the aircraft's speed and the share of the largest gradient, ``(X, V, G)``. Of each step of speed of
    the fronts the faster end, of each step of gradient the less steep, and of both the earlier return of the satellite.
    """
    front_mps = np.geomspace(0.5, threat.max_speed_mps, _FRONT_SPEEDS)
    shares = np.concatenate([_SHARES[:1] / 1.1, _SHARES])[:, np.newaxis]
    away = away_s(min(threat.gradient) * shares, front_mps, threat.min_width_m, credit)
    away = np.minimum(away[:-1], away[1:])
    away = np.minimum(away[:, :-1], away[:, 1:])
    x_m = np.arange(0.0, _FARTHEST_M + 1.0, _DISTANCE_STEP_M)[:, np.newaxis, np.newaxis, np.newaxis]
    v_mps = np.arange(0.0, _FASTEST_MPS + 1.0, _SPEED_STEP_MPS)[:, np.newaxis, np.newaxis]
    return np.asarray(_more_m(x_m, v_mps, tau_s, front_mps[1:], away, radius_m).max(axis=-1))


def _more_m(
    x_m: FloatArray, v_mps: FloatArray, tau_s: float, front_mps: FloatArray, away: FloatArray, radius_m: float
) -> FloatArray:
    """The same of each front at the worst place its edge may have by now; may be negative."""
    decay_m = front_mps * tau_s
    least_m = np.maximum(front_mps * away - radius_m, 0.0)
    edge_m = np.clip(decay_m * math.log(2.0), least_m, np.maximum(x_m, least_m))
    between_m = 2.0 * decay_m * -np.expm1(-edge_m / decay_m) - edge_m
    # where the edge is beyond the aircraft already, the difference is gone and its mean fades
    beyond_s = np.maximum(edge_m - x_m, 0.0) / (v_mps + front_mps)
    mean_m = (v_mps * tau_s + decay_m) * np.exp(-beyond_s / tau_s) - decay_m * np.exp(-edge_m / decay_m)
    return np.where(edge_m <= x_m, between_m, 2.0 * (mean_m - v_mps * tau_s) - x_m)
