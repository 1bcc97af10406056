"""Many faults into one settled station: how often and how soon each is found, and by what.

Every case is one kind of fault of one size; its trials differ in satellite and onset, and so in the noise they meet.
Two stations meet the same faults: one that acts, for detection and time to alert, and one whose monitors of signals
only watch, so that every monitor's own time is seen and none is hidden by a faster one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gbas_ground.params import GroundParams, watching
from gbas_sim.world_params import WorldParams
from gbas_studies.campaign import Campaign, Execution, run
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


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What all trials share.

    Attributes
    ----------
    world : WorldParams
        Without threats; it must be long enough for the quiet start and the longest case.
    station : GroundParams
    watch : bool
        Also a station whose monitors exclude nothing.
    """

    world: WorldParams
    station: GroundParams
    watch: bool = False


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One happening of a case.

    Attributes
    ----------
    case : Case
    number : int
        Which one of the case's.
    """

    case: Case
    number: int


@dataclass(frozen=True, kw_only=True)
class Reactions:
    """What a trial did to the stations.

    Attributes
    ----------
    acting : Reaction
    watching : Reaction or None
        Of the station whose monitors exclude nothing, if there is one.
    """

    acting: Reaction
    watching: Reaction | None = None


def run_campaign(
    setting: Setting, cases: Sequence[Case], *, trials: int, execution: Execution | None = None
) -> list[Outcome]:
    """Let every case happen several times.

    Parameters
    ----------
    setting : Setting
    cases : sequence of Case
    trials : int
        Of each case.
    execution : Execution, optional
        Where: the outcome does not depend on it.

    Raises
    ------
    StudyError
        When the world is too short, or the station has no usable satellite after the quiet start.
    CampaignError
        See :func:`gbas_studies.campaign.run`.
    """
    longest = max((case.watch_s for case in cases), default=0.0)
    if setting.world.length_s < QUIET_S + longest + 1.0:
        needed_s = QUIET_S + longest + 1.0
        raise StudyError(f"the world is {setting.world.length_s:g} s long, and the longest case needs {needed_s:g} s")
    campaign = Campaign(
        study="faults",
        settings=setting,
        trials=[Trial(case=case, number=number) for case in cases for number in range(trials)],
        prepare=settled_stations,
        run_trial=run_trial,
        result=Reactions,
        seed=setting.world.seed,
    )
    reactions = run(campaign, execution)
    return [_outcome(case, reactions[at * trials : (at + 1) * trials]) for at, case in enumerate(cases)]


def settled_stations(setting: Setting) -> list[Settled]:
    """The station that acts and, if wanted, the one that only watches, both settled."""
    acting = settle(setting.world, setting.station, QUIET_S)
    if not acting.usable:
        raise StudyError("the station has no usable satellite after the quiet start")
    if not setting.watch:
        return [acting]
    return [acting, settle(setting.world, watching(setting.station), QUIET_S)]


def run_trial(stations: Sequence[Settled], trial: Trial, seed: np.random.SeedSequence) -> Reactions:
    """Satellites take turns; onsets are spread over an epoch by the golden ratio. Nothing is drawn with the seed."""
    acting, case = stations[0], trial.case
    satellite = acting.usable[trial.number % len(acting.usable)]
    onset_s = acting.time_s + acting.world.params.interval_s * (1.0 + (trial.number + 1) * 0.6180339887498949 % 1.0)
    threats = case.threats(satellite, onset_s)
    found = [inject(each, threats, case.subject or satellite, onset_s, case.watch_s) for each in stations]
    # a receiver's fault may show on the satellite it is on
    others = tuple(each for each in found[0].others if each != satellite)
    return Reactions(acting=replace(found[0], others=others), watching=found[1] if len(found) > 1 else None)


def _outcome(case: Case, trials: Sequence[Reactions]) -> Outcome:
    reactions = [each.acting for each in trials]
    watched = [each.watching for each in trials if each.watching is not None]
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
