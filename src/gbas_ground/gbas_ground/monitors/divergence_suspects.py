"""Whose divergence is it? Means over the receivers, with receiver clocks that do without satellites under suspicion.

A fault as large as d appears on the n others of a clock as -d/n, and passes the threshold there first if their sigma is
smaller. When a satellite fails, suspicion falls on all whose carrier rate is beyond half the threshold from the median
of both constellations, whose clocks run alike; then on the largest carrier rate of its constellation, and on the next,
where that halves what is above the threshold. Where suspicion leaves too few satellites of a constellation, the clock
is that of both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_ground.monitors.kernels import ccd_f as kernels
from gbas_ground.monitors.kernels.median import median
from gbas_ground.monitors.result import MonitorResult

if TYPE_CHECKING:
    from gbas_ground.monitors.ccd_f import TwoFrequencyInput, TwoFrequencyParams

# Uncertain, ours: more satellites at once are no satellites' faults, and all of them fail.
_MOST_SUSPECTS: Final = 4
# Uncertain, ours: of the threshold; a satellite that is in no clock costs little, a faulty one that is in them much.
_SUSPICION: Final = 0.5
_ALL: Final = np.ones((1, N_SATS), dtype=bool)
_NOBODY: Final = np.zeros(N_SATS, dtype=bool)


class TwoFrequencyEpoch(NamedTuple):
    """Result of one epoch.

    Attributes
    ----------
    receiver_mps : (3, R, N) array
        Filtered DF, DF of the other band and IF carrier of each channel; the carrier only where enough other channels
        have settled to give the clock [m/s].
    settled : (R, N) bool array
        Where all three count.
    mean_mps : (4, N) array
        Means over the settled receivers in use, with IF code minus carrier in the paper's third place [m/s].
    receivers : (N,) array
        How many those are; 0: the satellite is not monitored.
    clock_satellites : (N,) array
        Fewest satellites behind the clock of a receiver averaged.
    covariance : (N, 3, 3) array
        Of the full-rank form's means [(m/s)^2].
    published, full_rank : MonitorResult
        ``(N,)``: quadratic form against its threshold [-].
    """

    receiver_mps: FloatArray
    settled: BoolArray
    mean_mps: FloatArray
    receivers: FloatArray
    clock_satellites: FloatArray
    covariance: FloatArray
    published: MonitorResult
    full_rank: MonitorResult


class Judge(NamedTuple):
    """What satellites are judged by at one epoch.

    Attributes
    ----------
    rates_mps : (3, R, N) array
        Filtered DF, DF of the other band, and IF carrier less the mean of all [m/s].
    settled : (R, N) bool array
        Where all three count.
    epoch : TwoFrequencyInput
    params : TwoFrequencyParams
    """

    rates_mps: FloatArray
    settled: BoolArray
    epoch: TwoFrequencyInput
    params: TwoFrequencyParams

    def verdict(self, suspect: BoolArray) -> TwoFrequencyEpoch:
        """Statistics and verdicts with receiver clocks that do without the satellites under suspicion, ``(N,)``."""
        epoch, params = self.epoch, self.params
        receiver, counts = np.empty(self.rates_mps.shape), np.empty(self.settled.shape, dtype=bool)
        found, failed = np.empty((8, N_SATS)), np.empty((2, N_SATS), dtype=bool)
        covariance = np.empty((N_SATS, 3, 3))
        kernels.judge(
            self.rates_mps,
            self.settled,
            epoch.used,
            epoch.clock_used,
            suspect,
            CLOCK_GROUPS,
            _ALL,
            params.min_clock_satellites,
            epoch.elevation_rad,
            *params.covariance.tables,
            params.published_inverse,
            params.weights,
            params.limits,
            receiver,
            counts,
            found,
            covariance,
            failed,
        )
        return TwoFrequencyEpoch(
            receiver_mps=receiver,
            settled=counts,
            mean_mps=found[:4],
            receivers=found[4],
            clock_satellites=found[5],
            covariance=covariance,
            published=MonitorResult(statistic=found[6], threshold=params.limits[0], failed=failed[0]),
            full_rank=MonitorResult(statistic=found[7], threshold=params.limits[1], failed=failed[1]),
        )


def without_suspects(judge: Judge) -> TwoFrequencyEpoch:
    """Judge one epoch; what fails for another satellite's sake, through the clock, does not."""
    suspect = _NOBODY
    result = judge.verdict(suspect)
    if not result.full_rank.failed.any():
        return result
    in_clock = np.logical_or.reduce(judge.epoch.clock_used, axis=0)  # what is in no clock disturbs none
    if (result.full_rank.failed & in_clock).any():
        apart = _apart(result, judge)
        if apart.any():
            without = judge.verdict(apart)
            if _explains(without, result, ~apart, 1.0):
                suspect, result = apart, without
    for group in CLOCK_GROUPS & in_clock:
        for _ in range(_MOST_SUSPECTS):
            if not (result.full_rank.failed & group & ~suspect).any():
                break
            more = suspect | _most_deviant(result, group & ~suspect)
            without = judge.verdict(more)
            if not _explains(without, result, group & ~more, 0.5):
                break
            suspect, result = more, without
    return result


def _apart(result: TwoFrequencyEpoch, judge: Judge) -> BoolArray:
    """Satellites in the clocks whose carrier rate is far from the median, which a minority does not move, ``(N,)``."""
    rate = np.where(judge.settled & judge.epoch.clock_used, judge.rates_mps[2], np.nan)
    deviation = rate - np.array([[median(each)] for each in rate])
    there = np.isfinite(deviation)
    mean = np.where(there, deviation, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    variance = result.covariance[:, 2, 2]
    return np.asarray(mean**2 > _SUSPICION**2 * judge.params.limits[1, 0] * variance)


def _explains(without: TwoFrequencyEpoch, result: TwoFrequencyEpoch, rest: BoolArray, share: float) -> bool:
    """Whether it was the clock: all that failed can be judged, and of what the rest had too much a share is left."""
    judged = np.isfinite(without.full_rank.statistic[result.full_rank.failed]).all()
    return bool(judged and _excess(without, rest) <= share * _excess(result, rest))


def _most_deviant(result: TwoFrequencyEpoch, candidates: BoolArray) -> BoolArray:
    """The monitored candidate with the largest carrier rate, as a mask."""
    size = np.where(candidates & (result.receivers > 0), np.abs(result.mean_mps[3]), -1.0)
    found: BoolArray = (np.arange(N_SATS) == size.argmax()) & (size >= 0.0)
    return found


def _excess(result: TwoFrequencyEpoch, satellites: BoolArray) -> float:
    """Sum of the failed metrics of some satellites."""
    return float(result.full_rank.statistic[result.full_rank.failed & satellites].sum())
