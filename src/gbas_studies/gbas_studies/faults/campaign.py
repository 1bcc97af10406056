"""Many faults into one settled station: how often and how soon each is found, and by what.

Every case is one kind of fault of one size; its trials differ in satellite and onset, and so in the noise they meet.
Two stations meet the same faults: one that acts, for detection and time to alert, and one whose monitors of signals
only watch, so that every monitor's own time is seen and none is hidden by a faster one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from gbas_ground.params import GroundParams, watching
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.faults.kinds import (
    FAULT_MODES,
    CodeCarrierDivergence,
    ExcessiveAcceleration,
    FrozenOutput,
    LowPower,
    NoiseBurst,
    OrbitFault,
    RangeFault,
)
from gbas_sim.world import WorldParams
from gbas_studies.campaign import Campaign, Execution, run
from gbas_studies.ccd.monitors import cmc_rate
from gbas_studies.ccd.smoothed_error import Smoothing, StudyError
from gbas_studies.faults.exposure import TIME_TO_ALERT_S, divergence_limit_s, extrapolation_limit_s
from gbas_studies.faults.front_exposure import SITE_RADIUS_M, front_limit
from gbas_studies.faults.injection import Reaction, Settled, Threat, inject, settle

QUIET_S: Final = 260.0
"""Before the faults: the filters settle for 230 s."""
WATCH_S: Final = 120.0
WORLD_S: Final = QUIET_S + WATCH_S + 10.0
"""A world long enough for every case [s]."""
RECEIVER: Final = "rr2"
"""The reference receiver that has the receivers' faults."""

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
        When the worst user's differential error passes its limit if nobody acts, since the onset; negative: the
        user has the fault before the station; infinite if never [s].
    watch_s : float
        How long to look [s].
    subject : str
        Whose fault it is: a receiver, or the satellite of the trial if empty.
    """

    kind: str
    name: str
    threats: MakeThreats
    limit_s: float = math.inf
    watch_s: float = WATCH_S
    subject: str = ""


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
        yield Case(kind="power", name=f"power {drop_db:g} dB lower", threats=partial(_low_power, drop_db))


def _low_power(drop_db: float, satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (LowPower(satellite=satellite, drop_db=drop_db, start_s=onset_s),)


def orbit_cases() -> Iterator[Case]:
    """A satellite that leaves its orbit across the track; the error grows with the distance from the station alone."""
    for rate_mps in (1.0, 10.0, 100.0):
        yield Case(kind="orbit", name=f"orbit, {rate_mps:g} m/s across", threats=partial(_orbit, rate_mps))


def _orbit(rate_mps: float, satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (OrbitFault(satellite=satellite, cross_mps=rate_mps, start_s=onset_s),)


def receiver_cases() -> Iterator[Case]:
    """Faults of one reference receiver; the protection level under its fault bounds them until they are found."""
    makers: dict[str, MakeThreats] = {
        "code 1 m long": partial(_ranges, 1.0, 0.0, ("code_l1", "code_l5")),
        "code 5 m long": partial(_ranges, 5.0, 0.0, ("code_l1", "code_l5")),
        "code, 0.05 m/s": partial(_ranges, 0.0, 0.05, ("code_l1", "code_l5")),
        "carrier, 0.05 m/s": partial(_ranges, 0.0, 0.05, ("carrier_l1", "carrier_l5")),
        "noise of 3 m": _noise,
        "frozen": _frozen,
    }
    for name, maker in makers.items():
        yield Case(kind="receiver", name=f"{RECEIVER} {name}", threats=maker, subject=RECEIVER)


def _ranges(
    step_m: float, ramp_mps: float, quantities: tuple[str, ...], satellite: str, onset_s: float
) -> tuple[Threat, ...]:
    fault = RangeFault(
        receiver=RECEIVER, satellites=(satellite,), quantities=quantities, step_m=step_m, ramp_mps=ramp_mps,
        start_s=onset_s,
    )  # fmt: skip
    return (fault,)


def _noise(satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (NoiseBurst(receiver=RECEIVER, satellites=(satellite,), code_m=3.0, start_s=onset_s),)


def _frozen(satellite: str, onset_s: float) -> tuple[Threat, ...]:
    return (FrozenOutput(receiver=RECEIVER, start_s=onset_s),)


def front_cases(
    gradients: Iterable[float] = (300e-6, 425e-6, 600e-6, 860e-6, 1200e-6, 2000e-6),
    *,
    speed_mps: float = 100.0,
    direction_rad: float = 4.62,
    smoothing: Smoothing | None = None,
) -> Iterator[Case]:
    """Fronts over the station, each for one satellite, along the approach: they overtake the worst aircraft first.

    Limits count from the touch of the first antenna, and are negative where the aircraft is beyond its own before.
    """
    filters = smoothing or Smoothing()
    for gradient in gradients:
        yield Case(
            kind="front",
            name=f"front, {1e6 * gradient:g} mm/km at {speed_mps:g} m/s",
            threats=partial(_front, gradient, speed_mps, direction_rad),
            limit_s=front_limit(gradient, speed_mps, filters).since_touch_s,
            watch_s=60.0,
        )


def _front(
    gradient: float, speed_mps: float, direction_rad: float, satellite: str, onset_s: float
) -> tuple[Threat, ...]:
    """A leading edge that touches the first receivers at the onset."""
    front = WedgeFront(
        gradient=gradient,
        width_m=30_000.0,
        edge="leading",
        direction_rad=direction_rad,
        speed_mps=speed_mps,
        start_m=-SITE_RADIUS_M,
        start_s=onset_s,
        satellites=(satellite,),
    )
    return (front,)


KINDS: Final = ("divergence", "acceleration", "power", "orbit", "receiver", "front")


def cases_of(
    kinds: Sequence[str], *, rates_mps: Sequence[float] = (0.01, 0.02, 0.05, 0.1), modes: Sequence[str] = ()
) -> list[Case]:
    """Cases of these kinds.

    Raises
    ------
    StudyError
        For a kind or mode that there is not.
    """
    for mode in modes:
        if mode not in FAULT_MODES:
            raise StudyError(f"mode {mode!r} is not one of: {'; '.join(FAULT_MODES)}")
    makers: dict[str, Callable[[], Iterator[Case]]] = {
        "divergence": partial(divergence_cases, rates_mps, modes or tuple(FAULT_MODES)),
        "acceleration": acceleration_cases,
        "power": power_cases,
        "orbit": orbit_cases,
        "receiver": receiver_cases,
        "front": front_cases,
    }
    cases: list[Case] = []
    for kind in kinds:
        if kind not in makers:
            raise StudyError(f"kind {kind!r} is not one of {', '.join(KINDS)}")
        cases += makers[kind]()
    return cases


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
