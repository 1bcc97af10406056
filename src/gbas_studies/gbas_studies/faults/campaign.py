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

from gbas_ground.monitor_params import MonitorParams
from gbas_ground.params import GroundParams
from gbas_sim.faults import FAULT_MODES, CodeCarrierDivergence, ExcessiveAcceleration, LowPower
from gbas_sim.world import WorldParams
from gbas_studies.ccd.monitors import cmc_rate
from gbas_studies.ccd.smoothed_error import Smoothing
from gbas_studies.faults.exposure import TIME_TO_ALERT_S, divergence_limit_s, extrapolation_limit_s
from gbas_studies.faults.injection import Reaction, Settled, Threat, inject, settle

QUIET_S: Final = 260.0
"""Before the faults: the filters settle for 230 s."""

MakeThreats = Callable[[str, float], tuple[Threat, ...]]
"""Threats of a case from the satellite and the onset [s]."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One kind of fault of one size.

    Attributes
    ----------
    kind, name : str
        Such as ``"divergence"``, ``"Code L1, 0.05 m/s"``.
    threats : callable
        From satellite and onset to what happens.
    limit_s : float
        When the worst user's differential error passes its limit if nobody acts, since the onset; infinite if never
        [s].
    watch_s : float
        How long to look [s].
    """

    kind: str
    name: str
    threats: MakeThreats
    limit_s: float
    watch_s: float = 120.0


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """All trials of a case.

    Attributes
    ----------
    case : Case
    trials : int
    detected : int
        By the station that acts.
    detected_s : tuple of float
        When, sorted, since the onset [s].
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
    detected: int
    detected_s: tuple[float, ...]
    late_s: tuple[float, ...]
    causes: Mapping[str, int]
    monitors_s: Mapping[str, tuple[float, ...]]
    false: int

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
            "detected_s": _spread(self.detected_s),
            "limit_s": self.case.limit_s if math.isfinite(self.case.limit_s) else None,
            "time_to_alert_s": _spread(self.late_s),
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


def divergence_cases(
    rates_mps: Iterable[float], modes: Iterable[str] = tuple(FAULT_MODES), smoothing: Smoothing | None = None
) -> Iterator[Case]:
    """The fifteen modes of ENC 2015 at several rates; the user's ranges are 30 s smoothed, of L1 or L5."""
    filters = smoothing or Smoothing()
    for mode in modes:
        rates = [abs(cmc_rate(mode, band)) for band in ("L1", "L5")]
        for rate in rates_mps:
            limit_s = min((divergence_limit_s(each * rate, filters) for each in rates if each > 0.0), default=math.inf)
            yield Case(
                kind="divergence",
                name=f"{mode}, {rate:g} m/s",
                threats=partial(_divergence, mode, rate),
                limit_s=limit_s,
            )


def _divergence(mode: str, rate_mps: float, satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (CodeCarrierDivergence(satellite=satellite, mode=mode, ramp_mps=rate_mps, start_s=onset_s),)


def acceleration_cases() -> Iterator[Case]:
    """Steps, ramps and accelerations that code and carrier share."""
    sizes = (
        ("step", "m", (0.02, 0.05, 0.1, 0.5, 1.6, 2.0, 10.0)),
        ("ramp", "m/s", (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)),
        ("acceleration", "m/s2", (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 1.0)),
    )
    for place, (name, unit, values) in enumerate(sizes):
        for value in values:
            step, ramp, acceleration = (value if place == each else 0.0 for each in range(3))
            yield Case(
                kind="acceleration",
                name=f"{name} {value:g} {unit}",
                threats=partial(_acceleration, step, ramp, acceleration),
                limit_s=extrapolation_limit_s(step, ramp, acceleration),
                watch_s=60.0,
            )


def _acceleration(
    step_m: float, ramp_mps: float, acceleration_mps2: float, satellite: str, onset_s: float
) -> tuple[Threat, ...]:
    fault = ExcessiveAcceleration(
        satellite=satellite,
        start_s=onset_s,
        step_m=step_m,
        ramp_mps=ramp_mps,
        acceleration_mps2=acceleration_mps2,
    )
    return (fault,)


def power_cases() -> Iterator[Case]:
    """Drops of power; they add noise and no error of their own."""
    for drop_db in (3.0, 6.0, 10.0, 20.0):
        yield Case(
            kind="low power",
            name=f"drop {drop_db:g} dB",
            threats=partial(_low_power, drop_db),
            limit_s=math.inf,
        )


def _low_power(drop_db: float, satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (LowPower(satellite=satellite, drop_db=drop_db, start_s=onset_s),)


def run_campaign(
    world: WorldParams,
    station: GroundParams,
    cases: Sequence[Case],
    *,
    trials: int,
    watching: MonitorParams | None = None,
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
    watching : MonitorParams, optional
        Monitors that exclude nothing; without them the station that only watches is left out.
    workers : int
        Processes. The outcome does not depend on how many.
    progress : callable
        Told how many of the cases are done.

    Raises
    ------
    ValueError
        When the world is too short, or the station has no usable satellite after the quiet start.
    """
    longest = max((case.watch_s for case in cases), default=0.0)
    if world.length_s < QUIET_S + longest + 1.0:
        needed_s = QUIET_S + longest + 1.0
        raise ValueError(f"the world is {world.length_s:g} s long, and the longest case needs {needed_s:g} s")
    acting = settle(world, station, QUIET_S)
    if not acting.usable:
        raise ValueError("the station has no usable satellite after the quiet start")
    stations = [acting]
    if watching is not None:
        stations.append(settle(world, replace(station, monitors=watching), QUIET_S))
    outcomes: list[Outcome] = []
    if workers == 1:
        for case in cases:
            outcomes.append(_run_case(stations, trials, case))
            progress(len(outcomes), len(cases))
        return outcomes
    with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
        for outcome in pool.map(partial(_run_case, stations, trials), cases, chunksize=4):
            outcomes.append(outcome)
            progress(len(outcomes), len(cases))
    return outcomes


def _run_case(stations: Sequence[Settled], trials: int, case: Case) -> Outcome:
    """Satellites take turns; onsets are spread over an epoch by the golden ratio."""
    acting, reactions, watched = stations[0], [], []
    interval_s = acting.world.params.interval_s
    for trial in range(trials):
        satellite = acting.usable[trial % len(acting.usable)]
        onset_s = acting.time_s + interval_s * (1.0 + (trial + 1) * 0.6180339887498949 % 1.0)
        threats = case.threats(satellite, onset_s)
        reactions.append(inject(acting, threats, satellite, onset_s, case.watch_s))
        watched += [inject(each, threats, satellite, onset_s, case.watch_s) for each in stations[1:]]
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
        detected=len(found),
        detected_s=tuple(sorted(each.burst_s for each in found)),
        late_s=tuple(sorted(late)),
        causes=Counter(each.cause for each in found),
        monitors_s={name: tuple(sorted(r.failed_s[name] for r in watched if name in r.failed_s)) for name in names},
        false=sum(len(each.others) for each in reactions),
    )
