"""What cautions are worth: how long before a loss they come, which losses they miss, and how many are for nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import BoolArray, FloatArray, IntArray

ENOUGH_S: Final = 2.0
"""Lead the paper found before every warning."""
_ROUNDING_S: Final = 1e-6
_DRAWS: Final = 1000


@dataclass(frozen=True, kw_only=True)
class Score:
    """What the cautions of one flight were worth.

    Attributes
    ----------
    lead_s : tuple of float
        Of each onset of a loss, from the start of the caution that is on when it comes; 0 without one before [s].
    cautions, false : int
        Cautions raised, and those without a loss while they are on or within the horizon of their start.
    caution_s : float
        For how long there was caution without loss [s].
    """

    lead_s: tuple[float, ...]
    cautions: int
    false: int
    caution_s: float


def spells(on: BoolArray) -> tuple[IntArray, IntArray]:
    """First indices of the stretches of True, and the first after each."""
    change = np.diff(np.concatenate([[False], on, [False]]).astype(np.int8))
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)


def held(on: BoolArray, times: int) -> BoolArray:
    """The same, each stretch so many times longer: what is released is released late, nothing is raised late."""
    if times == 0:
        return on
    reach = np.concatenate([[0], np.cumsum(on.astype(np.int64))])
    start = np.maximum(np.arange(on.size) - times, 0)
    result: BoolArray = reach[1:] > reach[start]
    return result


def score(loss: BoolArray, caution: BoolArray, *, tick_s: float, horizon_s: float) -> Score:
    """Score the cautions of a flight, (T,), against its losses, (T,), at times ``tick_s`` apart."""
    starts, ends = spells(caution | loss)
    onsets, _ = spells(loss)
    lead_s = [float(tick_s * (onset - starts[np.searchsorted(starts, onset, side="right") - 1])) for onset in onsets]
    reach = round(horizon_s / tick_s)
    behind = np.concatenate([[0], np.cumsum(loss.astype(np.int64))])
    until = np.minimum(np.maximum(ends, starts + reach + 1), loss.size)
    false = behind[until] == behind[starts]
    return Score(
        lead_s=tuple(lead_s),
        cautions=int(starts.size),
        false=int(false.sum()),
        caution_s=float(tick_s * (caution & ~loss).sum()),
    )


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A share and its 95 % confidence interval over flights."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What the cautions of many flights were worth.

    Attributes
    ----------
    onsets, cautions : int
    enough, missed, false : Interval
        Shares of onsets with a lead of :data:`ENOUGH_S` or more and with none, and of cautions that are false.
    lead_p5_s, lead_p50_s : float
        Percentiles of the lead [s]; NaN without an onset.
    caution_s : float
        Caution without loss, an onset [s].
    """

    onsets: int
    cautions: int
    enough: Interval
    missed: Interval
    false: Interval
    lead_p5_s: float
    lead_p50_s: float
    caution_s: float


def summary(scores: Sequence[Score]) -> Summary:
    """Put the flights together; intervals by drawing flights anew (bootstrap, 1000 draws of a fixed seed)."""
    counts = np.array(
        [
            [
                len(each.lead_s),
                sum(lead >= ENOUGH_S - _ROUNDING_S for lead in each.lead_s),
                sum(lead <= 0.0 for lead in each.lead_s),
                each.cautions,
                each.false,
            ]
            for each in scores
        ],
        dtype=np.float64,
    )
    drawn = np.random.default_rng(0).multinomial(len(scores), np.full(len(scores), 1.0 / len(scores)), size=_DRAWS)
    totals, spread = counts.sum(axis=0), drawn @ counts
    lead_s = np.concatenate([np.array(each.lead_s) for each in scores])
    p5, p50 = np.percentile(lead_s, [5.0, 50.0]) if lead_s.size else (np.nan, np.nan)
    return Summary(
        onsets=int(totals[0]),
        cautions=int(totals[3]),
        enough=_interval(totals, spread, 1, 0),
        missed=_interval(totals, spread, 2, 0),
        false=_interval(totals, spread, 4, 3),
        lead_p5_s=float(p5),
        lead_p50_s=float(p50),
        caution_s=float(sum(each.caution_s for each in scores) / totals[0]) if totals[0] else float("nan"),
    )


def _interval(totals: FloatArray, spread: FloatArray, part: int, whole: int) -> Interval:
    if not totals[whole]:
        return Interval(value=float("nan"), low=float("nan"), high=float("nan"))
    there = spread[:, whole] > 0
    low, high = np.percentile(spread[there, part] / spread[there, whole], [2.5, 97.5])
    return Interval(value=float(totals[part] / totals[whole]), low=float(low), high=float(high))
