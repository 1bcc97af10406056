"""Many faults into one settled station: how often and how soon each is found, and by what.

Every case is one kind of fault of one size; its trials differ in satellite, onset within the epoch and seed of the
noise. Two stations meet the same faults: one that acts, for detection and time to alert, and one whose monitors of
signals only watch, so that every monitor's own time is seen and none is hidden by a faster one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from typing import Any, Final

import numpy as np

from gbas_ground.params import GroundParams, watching
from gbas_sim.world_params import WorldParams
from gbas_studies.ccd.smoothed_error import StudyError
from gbas_studies.faults.cases import WATCH_S, Case
from gbas_studies.faults.exposure import TIME_TO_ALERT_S
from gbas_studies.faults.injection import Reaction, Settled, inject, settle

QUIET_S: Final = 260.0
"""Before the faults: the filters settle for 230 s."""
WORLD_S: Final = QUIET_S + WATCH_S + 10.0
"""A world long enough for every case [s]."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """All trials of a case.

    Attributes
    ----------
    case : Case
    trials : int
    burst_s : tuple of float
        Ends of the bursts that told users, sorted, since the onset [s]; one for each fault the acting station found.
    late_s : tuple of float
        Time to alert of each trial: from the passing of the limit to the end of the burst that says so; negative when
        that comes first. Of undetected faults whose error passes the limit: infinite [s].
    causes : mapping from a cause's word to the number of trials
    monitors_s : mapping from a monitor's name to its sorted times in the station that watches [s]
    false : int
        Exclusions of satellites without a fault.
    """

    case: Case
    trials: int
    burst_s: tuple[float, ...]
    late_s: tuple[float, ...]
    causes: Mapping[str, int]
    monitors_s: Mapping[str, tuple[float, ...]]
    false: int

    @property
    def detected(self) -> int:
        """Trials in which users were told."""
        return len(self.burst_s)

    @property
    def worst_late_s(self) -> float:
        """Largest time to alert; NaN where the error never passes its limit."""
        return max(self.late_s, default=math.nan)

    @property
    def in_time(self) -> bool:
        """Whether every alert came within the time to alert."""
        return not self.late_s or self.worst_late_s <= TIME_TO_ALERT_S

    def as_json(self) -> dict[str, Any]:
        """The outcome as JSON-able data."""
        return {
            "kind": self.case.kind,
            "case": self.case.name,
            "trials": self.trials,
            "detected": self.detected,
            "burst_s": _spread(self.burst_s),
            "limit_s": self.case.limit_s if math.isfinite(self.case.limit_s) else None,
            "time_to_alert_s": _spread([each for each in self.late_s if math.isfinite(each)]),
            "undetected_beyond_limit": sum(math.isinf(each) for each in self.late_s),
            "in_time": self.in_time,
            "causes": dict(self.causes),
            "monitors_s": {name: {"found": len(times), **_spread(times)} for name, times in self.monitors_s.items()},
            "false_exclusions": self.false,
        }


def _spread(values: Sequence[float]) -> dict[str, float | None]:
    """Smallest, median and largest."""
    if not values:
        return {"min": None, "median": None, "max": None}
    return {"min": min(values), "median": float(np.median(values)), "max": max(values)}


def run_campaign(
    world: WorldParams,
    station: GroundParams,
    cases: Sequence[Case],
    *,
    trials: int,
    watch: bool = False,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Outcome]:
    """Let every case happen several times.

    Parameters
    ----------
    world : WorldParams
        Without threats; it must be long enough for the quiet start and the longest case.
    station : GroundParams
    cases : sequence of Case
    trials : int
        Of each case.
    watch : bool
        Also a station whose monitors exclude nothing.
    workers : int
        Processes. The outcome does not depend on how many.
    progress : callable
        Told how many of the cases are done.

    Raises
    ------
    StudyError
        When the world is too short, or the station has no usable satellite after the quiet start.
    """
    longest = max((case.watch_s for case in cases), default=0.0)
    if world.length_s < QUIET_S + longest + 1.0:
        needed_s = QUIET_S + longest + 1.0
        raise StudyError(f"the world is {world.length_s:g} s long, and the longest case needs {needed_s:g} s")
    if workers == 1:
        stations = _stations(world, station, watch)
        results = map(partial(_run_case, stations, trials), cases)
        return list(_counted(results, len(cases), progress))
    # A settled station does not travel between processes: each worker settles its own, with the same bits.
    with ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_prepare, initargs=(world, station, watch)
    ) as pool:
        return list(_counted(pool.map(partial(_run_prepared, trials), cases), len(cases), progress))


def _counted(results: Iterable[Outcome], total: int, progress: Callable[[int, int], None]) -> Iterator[Outcome]:
    for done, outcome in enumerate(results, start=1):
        progress(done, total)
        yield outcome


def _stations(world: WorldParams, station: GroundParams, watch: bool) -> list[Settled]:
    """The station that acts and, if wanted, the one that only watches, both settled."""
    acting = settle(world, station, QUIET_S)
    if not acting.usable:
        raise StudyError("the station has no usable satellite after the quiet start")
    if not watch:
        return [acting]
    return [acting, settle(world, watching(station), QUIET_S)]


_prepared: list[Settled] = []
"""The settled stations of a worker process."""


def _prepare(world: WorldParams, station: GroundParams, watch: bool) -> None:
    _prepared[:] = _stations(world, station, watch)


def _run_prepared(trials: int, case: Case) -> Outcome:
    return _run_case(_prepared, trials, case)


def _run_case(stations: Sequence[Settled], trials: int, case: Case) -> Outcome:
    """Satellites take turns; onsets are spread over an epoch by the golden ratio."""
    acting, reactions, watched = stations[0], [], []
    interval_s = acting.world.params.interval_s
    for trial in range(trials):
        satellite = acting.usable[trial % len(acting.usable)]
        onset_s = acting.time_s + interval_s * (1.0 + (trial + 1) * 0.6180339887498949 % 1.0)
        threats = case.threats(satellite, onset_s)
        subject = case.subject or satellite
        reaction = inject(acting, threats, subject, onset_s, case.watch_s)
        # a receiver's fault may show on the satellite it is on
        reactions.append(replace(reaction, others=tuple(each for each in reaction.others if each != satellite)))
        watched += [inject(each, threats, subject, onset_s, case.watch_s) for each in stations[1:]]
    return _outcome(case, reactions, watched)


def _outcome(case: Case, reactions: Sequence[Reaction], watched: Sequence[Reaction]) -> Outcome:
    found = [each for each in reactions if math.isfinite(each.burst_s)]
    late: list[float] = []
    if math.isfinite(case.limit_s):
        late = [each.burst_s - case.limit_s if math.isfinite(each.burst_s) else math.inf for each in reactions]
    names = sorted({name for each in watched for name in each.failed_s})
    return Outcome(
        case=case,
        trials=len(reactions),
        burst_s=tuple(sorted(each.burst_s for each in found)),
        late_s=tuple(sorted(late)),
        causes=Counter(each.cause for each in found),
        monitors_s={name: tuple(sorted(r.failed_s[name] for r in watched if name in r.failed_s)) for name in names},
        false=sum(len(each.others) for each in reactions),
    )
