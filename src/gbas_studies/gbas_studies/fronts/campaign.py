"""Thousands of fronts on one approach: named ones, random ones, and the worst there are.

Every front is within the threat model it is drawn from, for the elevation of its satellite; a pair are two fronts that
move together, one for each satellite. A position is misleading when its error exceeds its protection level with service
and without alert. Epochs in which the aircraft lacks more of the satellites that are sent than the station's subset
rule allows are outside what the station claims, and counted apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gbas_airborne.params import AirborneParams
from gbas_core.record import FloatArray
from gbas_core.satellites import SAT_IDS
from gbas_ground.ionosphere.threat import FrontThreat
from gbas_ground.params import GroundParams
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.world_params import WorldParams
from gbas_studies.campaign import Campaign, Execution, run
from gbas_studies.fronts.quiet import Flight, Observed, fly, observe
from gbas_studies.fronts.response import RangeErrors, range_errors, respond

WORST_CASE: Final = ("still", "still pair", "with the aircraft", "swept", "swept pair")
RANDOM: Final = ("random", "random pair")
KINDS: Final = (*RANDOM, *WORST_CASE)
_NEAREST_M: Final = 450.0  # the antennas are within this of the station: nearer fronts are over them


@dataclass(frozen=True, kw_only=True)
class Run:
    """One set of fronts.

    Attributes
    ----------
    kind : str
    fronts : tuple of WedgeFront
        Each of one satellite.
    missing : tuple of int
        Satellites the aircraft does not use, on the satellite axis.
    """

    kind: str
    fronts: tuple[WedgeFront, ...]
    missing: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a run did to one flight.

    Attributes
    ----------
    kind : str
    served, lost : int
        Epochs with service, and without although there was some in the quiet flight.
    misleading : int
        Epochs with service whose vertical or lateral error exceeds the protection level.
    outside : int
        Epochs with service in which the aircraft lacks more satellites than the station's rule allows.
    excluded : bool
        Whether the station's divergence monitor took a satellite out.
    ratio, error_m, level_m : float
        Largest error over its protection level, with both [m]; 0 without service.
    vertical_m : float
        Largest vertical error with service [m].
    """

    kind: str
    served: int
    lost: int
    misleading: int
    outside: int
    excluded: bool
    ratio: float
    error_m: float
    level_m: float
    vertical_m: float


def judge(
    run: Run, errors: RangeErrors, observed: Observed, flight: Flight, station: GroundParams, within_m: float
) -> Outcome:
    """Let a run happen; epochs farther from the threshold than `within_m` are not looked at."""
    near = flight.distance_m <= within_m
    response = respond(errors, observed, flight, station, looked_at=near, missing=run.missing)
    sent, used = flight.used.any(axis=1), flight.s[:, 0] != 0.0
    used[:, list(run.missing)] = False
    allowed = (sent & ~used).sum(axis=-1) <= station.ionosphere.max_missing
    served = response.served & near
    claimed = served & allowed
    error, level = np.abs(response.error_m[claimed]), response.level_m[claimed]
    ratios = error / level
    worst = np.unravel_index(int(ratios.argmax()), ratios.shape) if ratios.size else None
    return Outcome(
        kind=run.kind,
        served=int(served.sum()),
        lost=int((flight.served & near & ~served).sum()),
        misleading=int((ratios > 1.0).any(axis=-1).sum()),
        outside=int((served & ~allowed).sum()),
        excluded=bool(response.excluded[near].any()),
        ratio=float(ratios[worst]) if worst else 0.0,
        error_m=float(error[worst]) if worst else 0.0,
        level_m=float(level[worst]) if worst else 0.0,
        vertical_m=float(error[:, 0].max()) if worst else 0.0,
    )


def draw(
    kind: str,
    observed: Observed,
    flight: Flight,
    threat: FrontThreat,
    *,
    within_m: float,
    max_missing: int,
    seed: int,
) -> Run:
    """One run of a kind.

    Parameters
    ----------
    kind : str
        Of :data:`KINDS`: ``random`` draws slope, width, speed, direction, place and satellites; the others take the
        steepest slope, satellites of the largest influence, and the direction in which the aircraft comes. ``still``
        ends just short of the antennas; ``swept`` has just left them at about the speed the divergence monitor sees.
    observed, flight
        The approach; a flight without protection, so that there are solutions to take the satellites from.
    threat : FrontThreat
    within_m : float
        The front is where it is meant to be when the aircraft is at a random distance within this [m].
    max_missing : int
        Most satellites the aircraft lacks: none in half of the runs.
    seed : int
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    rows = np.flatnonzero((flight.distance_m <= within_m) & flight.served & (flight.distance_m > 0.0))
    row = int(rng.choice(rows))
    used = np.flatnonzero(flight.s[row, 0])
    elevation = observed.elevation_rad[row]
    influence = np.abs(flight.s[row, 0]) * threat.largest_gradient(elevation)
    count = 2 if kind.endswith("pair") else 1
    if kind in RANDOM:
        satellites = rng.choice(used, size=count, replace=False)
    else:
        ranked = used[np.argsort(-influence[used])]
        satellites = rng.choice(ranked[: max(3, count + 1)], size=count, replace=False)
    line = _random_line(rng, threat) if kind in RANDOM else _worst_line(kind, rng, observed, row, satellites, threat)
    edges = _edges(kind, rng, flight.s[row, 0, satellites], line)
    fronts = []
    for satellite, edge in zip(satellites.tolist(), edges, strict=True):
        share = rng.uniform(0.3, 1.0) if kind in RANDOM else 1.0
        # the satellite rises or sets meanwhile: the slope is within the model at all its elevations
        lowest = np.nanmin(observed.elevation_rad[:, satellite])
        slope = share * float(threat.largest_gradient(lowest))
        widest_m = min(200_000.0, threat.max_delay_m / slope)
        width_m = threat.min_width_m * (widest_m / threat.min_width_m) ** rng.uniform()
        fronts.append(_front(line, slope, width_m, edge, observed.since_s[row], SAT_IDS[satellite]))
    others = [each for each in used.tolist() if each not in satellites]
    lacks = rng.integers(max_missing + 1) if rng.integers(2) else 0
    missing = tuple(int(each) for each in rng.choice(others, size=min(lacks, len(others)), replace=False))
    return Run(kind=kind, fronts=tuple(fronts), missing=missing)


@dataclass(frozen=True, kw_only=True)
class _Line:
    """An edge: where it is in the direction of its motion, and whether the slope is ahead of it or behind."""

    direction_rad: float
    speed_mps: float
    start_m: float
    ahead: bool


def _random_line(rng: np.random.Generator, threat: FrontThreat) -> _Line:
    speed = float(
        rng.choice([0.0, 70.0, rng.uniform(0.0, 120.0), math.exp(rng.uniform(2.0, math.log(threat.max_speed_mps)))])
    )
    return _Line(
        direction_rad=rng.uniform(0.0, 2.0 * math.pi),
        speed_mps=speed,
        start_m=rng.uniform(-15_000.0, 15_000.0),
        ahead=bool(rng.integers(2)),
    )


def _worst_line(
    kind: str, rng: np.random.Generator, observed: Observed, row: int, satellites: FloatArray, threat: FrontThreat
) -> _Line:
    """Across the way the aircraft's paths have come; the slope lies between the station and them."""
    first = int(satellites[0])
    east, north = observed.east_m[: row + 1, -1, first], observed.north_m[: row + 1, -1, first]
    step_s = observed.since_s[1]
    past_s = 200.0
    east_m = east[-1] + past_s * (east[-2] - east[-1]) / step_s
    north_m = north[-1] + past_s * (north[-2] - north[-1]) / step_s
    outward = math.atan2(east_m, north_m) + rng.normal(0.0, 0.05)
    if kind.startswith("swept"):
        speed = float(rng.choice([rng.uniform(20.0, 60.0), rng.uniform(60.0, 300.0)]))
        return _Line(
            direction_rad=outward, speed_mps=speed, start_m=rng.uniform(_NEAREST_M, 1.5 * speed * 100.0), ahead=True
        )
    if kind == "with the aircraft":
        start_m = -_NEAREST_M - rng.uniform(0.0, 500.0)
        inward = outward + math.pi
        return _Line(direction_rad=inward, speed_mps=rng.uniform(50.0, 90.0), start_m=start_m, ahead=False)
    speed = float(rng.choice([0.0, rng.uniform(0.0, 15.0)]))
    return _Line(direction_rad=outward, speed_mps=speed, start_m=_NEAREST_M + rng.uniform(-900.0, 600.0), ahead=True)


def _edges(kind: str, rng: np.random.Generator, s: FloatArray, line: _Line) -> list[bool]:
    """Whether each satellite has its delay on the far side of the slope: so that errors of a pair add up."""
    if kind in RANDOM:
        return [bool(each) for each in rng.integers(2, size=len(s))]
    sign = bool(rng.integers(2))
    return [(each > 0.0) == sign for each in s.tolist()]


def _front(
    line: _Line, slope: float, width_m: float, delayed_ahead: bool, since_s: float, satellite: str
) -> WedgeFront:
    """A front whose slope begins at the line, ahead of it or behind, with the delay on the side it is meant to be."""
    # trailing: the delay grows from the start onwards; leading: it grows from the start backwards
    if line.ahead:
        start_m = line.start_m if delayed_ahead else line.start_m + width_m
    else:
        start_m = line.start_m - width_m if delayed_ahead else line.start_m
    return WedgeFront(
        gradient=slope,
        width_m=width_m,
        edge="trailing" if delayed_ahead else "leading",
        direction_rad=math.remainder(line.direction_rad, 2.0 * math.pi),
        speed_mps=line.speed_mps,
        start_m=start_m,
        start_s=float(since_s),
        satellites=(satellite,),
    )


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A campaign.

    Attributes
    ----------
    world : WorldParams
    stations : mapping from a name to GroundParams
        The same fronts meet all of them.
    aircraft : AirborneParams
    threat : FrontThreat
    kinds : tuple of str
    runs : int
        Altogether, shared by the kinds.
    within_m : float
        Distance to the threshold within which epochs are looked at [m].
    seed : int
    """

    world: WorldParams
    stations: dict[str, GroundParams]
    aircraft: AirborneParams
    threat: FrontThreat
    kinds: tuple[str, ...] = KINDS
    runs: int = 700
    within_m: float = 6_000.0
    seed: int = 1

    @property
    def max_missing(self) -> int:
        """Satellites an aircraft may lack by the rule of all stations that are protected; 0 without any."""
        return min(
            (each.ionosphere.max_missing for each in self.stations.values() if each.ionosphere.protects), default=0
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Everything made once: observations, a flight without protection, and one with each station."""

    plan: Plan
    observed: Observed
    unprotected: Flight
    flights: dict[str, Flight]


def prepare(plan: Plan) -> Stage:
    """Observe the world and fly with every station."""
    observed = observe(plan.world)
    first = next(iter(plan.stations.values()))
    bare = replace(first, ionosphere=replace(first.ionosphere, threat_model="none", elevation_rad=(), gradient=()))
    unprotected = fly(observed, bare, plan.aircraft)
    flights = {
        name: unprotected if not station.ionosphere.protects else fly(observed, station, plan.aircraft)
        for name, station in plan.stations.items()
    }
    return Stage(plan=plan, observed=observed, unprotected=unprotected, flights=flights)


def run_campaign(plan: Plan, execution: Execution | None = None) -> list[dict[str, Any]]:
    """The table of a campaign, one row a station and kind; it does not depend on where its trials run."""
    campaign = Campaign(
        study="fronts",
        settings=plan,
        trials=range(plan.runs),
        prepare=prepare,
        run_trial=run_trial,
        result=dict[str, Outcome],
        seed=plan.seed,
        batch=10,
    )
    return _table(run(campaign, execution))


def run_trial(stage: Stage, number: int, seed: np.random.SeedSequence) -> dict[str, Outcome]:
    """Let one set of fronts meet all stations; kinds take turns.

    Fronts are drawn with seed and number as the published ones were, not with the trial's own `seed`.
    """
    plan = stage.plan
    drawn = draw(
        plan.kinds[number % len(plan.kinds)], stage.observed, stage.unprotected, plan.threat,
        within_m=plan.within_m, max_missing=plan.max_missing, seed=plan.seed * 1_000_000 + number,
    )  # fmt: skip
    errors = range_errors(drawn.fronts, stage.observed, next(iter(plan.stations.values())))
    return {
        name: judge(drawn, errors, stage.observed, stage.flights[name], station, plan.within_m)
        for name, station in plan.stations.items()
    }


def _table(found: Sequence[dict[str, Outcome]]) -> list[dict[str, Any]]:
    return [
        row_of(name, kind, [each[name] for each in found if each[name].kind == kind])
        for name in found[0]
        for kind in dict.fromkeys(each[name].kind for each in found)
    ]


def row_of(station: str, kind: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """One row of the table as JSON-able data."""
    worst = max(outcomes, key=lambda each: each.ratio)
    return {
        "station": station,
        "kind": kind,
        "runs": len(outcomes),
        "epochs": sum(each.served for each in outcomes),
        "misleading_epochs": sum(each.misleading for each in outcomes),
        "misleading_runs": sum(each.misleading > 0 for each in outcomes),
        "outside_rule_epochs": sum(each.outside for each in outcomes),
        "largest_ratio": worst.ratio,
        "error_m": worst.error_m,
        "level_m": worst.level_m,
        "largest_vertical_m": max(each.vertical_m for each in outcomes),
        "excluded_runs": sum(each.excluded for each in outcomes),
        "lost_epochs": sum(each.lost for each in outcomes),
    }


def availability(flight: Flight, reference: Flight, within_m: float) -> float:
    """Share of a reference flight's epochs with service that have service in a flight too."""
    near = reference.served & (reference.distance_m <= within_m)
    return float((flight.served & near).sum() / near.sum()) if near.any() else math.nan
