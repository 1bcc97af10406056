"""Which mode guides: the best one that gives its service, and why it is no better one.

Source: RTCA DO-253 (active approach service type); the chain of modes beyond GAST-D is ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from gbas_airborne.conditions import Evaluation, Failure, evaluate
from gbas_airborne.modes import configured_modes, guiding_modes
from gbas_airborne.navigation.position import Withheld
from gbas_airborne.params import AirborneParams
from gbas_airborne.service import ServiceState, next_state, protection_of
from gbas_msgs_py.codes import ApproachState, EventKind, ServiceCause, ServiceType
from gbas_msgs_py.events import Event, EventLog
from gbas_msgs_py.modes import mode_of
from gbas_msgs_py.records import ModesEpoch, ProtectionEpoch, SolutionEpoch

SOURCE: Final = "positioning"


@dataclass(frozen=True, kw_only=True, eq=False)
class SelectionState:
    """What the choice remembers.

    Attributes
    ----------
    guiding : int or None
        Number of the mode that guides; None before the first epoch.
    served : int or None
        Number of the mode that last gave guidance with its service.
    services : mapping from a mode's number to ServiceState
    """

    guiding: int | None = None
    served: int | None = None
    services: Mapping[int, ServiceState] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Selected:
    """The solutions of an epoch, the guiding one first.

    Attributes
    ----------
    solutions : tuple of SolutionEpoch
    worth : tuple of (Evaluation, ServiceState)
        Of the solutions after the first.
    modes : ModesEpoch or None
        All beside one another; None where there is one mode.
    events : tuple of Event
    """

    solutions: tuple[SolutionEpoch, ...]
    worth: tuple[tuple[Evaluation, ServiceState], ...] = ()
    modes: ModesEpoch | None = None
    events: tuple[Event, ...] = ()

    @property
    def others(self) -> tuple[ProtectionEpoch, ...]:
        """Protection of the solutions after the first."""
        return tuple(protection_of(each, *worth) for each, worth in zip(self.solutions[1:], self.worth, strict=True))


def select(
    state: SelectionState,
    solutions: tuple[SolutionEpoch, ...],
    withheld: Mapping[int, Withheld],
    params: AirborneParams,
) -> tuple[SelectionState, Selected]:
    """Choose the solution that guides, from those of the configured modes in their order.

    `withheld` are causes, by number of the mode, that solutions have no position for. One mode is not evaluated here:
    there is nothing to choose.
    """
    if len(configured_modes(params)) == 1:
        return state, Selected(solutions=solutions)
    evaluations = {
        int(each.mode): _with_cause(found, withheld.get(int(each.mode)))
        for each, found in zip(solutions, evaluate(solutions, params), strict=True)
    }
    chain = [mode.number for mode in guiding_modes(params)]
    _hold_back(state.served, chain, evaluations, {int(each.mode): each for each in solutions}, params)
    guiding = _best(chain, evaluations)
    services = {
        int(each.mode): next_state(
            state.services.get(int(each.mode), ServiceState()), each, evaluations[int(each.mode)]
        )
        for each in solutions
    }
    ordered = sorted(solutions, key=lambda each: int(each.mode) != guiding)
    worth = tuple((evaluations[int(each.mode)], services[int(each.mode)]) for each in ordered[1:])
    selected = Selected(
        solutions=tuple(ordered),
        worth=worth,
        modes=_table(solutions, evaluations, services, guiding),
        events=_changes(state.guiding, guiding, chain, evaluations, solutions[0]),
    )
    served = guiding if evaluations[guiding].failure is None else state.served
    return SelectionState(guiding=guiding, served=served, services=services), selected


def _with_cause(evaluation: Evaluation, withheld: Withheld | None) -> Evaluation:
    """The evaluation of a solution without a position, with the cause of that."""
    failure = evaluation.failure
    if withheld is None or failure is None or failure.cause is not ServiceCause.NO_POSITION:
        return evaluation
    return evaluation._replace(failure=Failure(failure.state, *withheld))


def _hold_back(
    served: int | None,
    chain: list[int],
    evaluations: dict[int, Evaluation],
    solutions: Mapping[int, SolutionEpoch],
    params: AirborneParams,
) -> None:
    """Inside the final segment a mode better than the one that served last is not taken up; without an approach there
    is no final segment.
    """
    if served not in chain:
        return
    for number in chain[: chain.index(served)]:
        distance_m, gate_m = solutions[number].distance_to_ltp_m, params.gast_d.upgrade_gate_m
        if evaluations[number].failure is None and distance_m < gate_m:
            held = Failure(ApproachState.DIFFERENTIAL, ServiceCause.FINAL_SEGMENT, distance_m, gate_m)
            evaluations[number] = evaluations[number]._replace(failure=held)


def _best(chain: list[int], evaluations: Mapping[int, Evaluation]) -> int:
    """The best mode with its service; else the best with protection levels; else the last."""
    for number in chain:
        if evaluations[number].failure is None:
            return number
    return next((number for number in chain if _has_levels(evaluations[number])), chain[-1])


def _has_levels(evaluation: Evaluation) -> bool:
    """Whether there are levels, and nothing that the node of the protection levels could not know of."""
    held_back = evaluation.failure is not None and evaluation.failure.cause is ServiceCause.FINAL_SEGMENT
    return not held_back and bool(np.isfinite(evaluation.levels.level_m).all())


def _changes(
    before: int | None,
    guiding: int,
    chain: list[int],
    evaluations: Mapping[int, Evaluation],
    solution: SolutionEpoch,
) -> tuple[Event, ...]:
    """An event when another mode guides: the new one is its subject, the cause is what the next better one lacks."""
    if before == guiding or len(chain) == 1:
        return ()
    events = EventLog(solution.gps_week, solution.tow_s, SOURCE)
    place = chain.index(guiding)
    failure = evaluations[chain[place - 1]].failure if place else None
    cause, value, threshold = (failure.cause.word, *failure[2:]) if failure else ("selected", math.nan, math.nan)
    events.add(EventKind.SERVICE, f"guidance/{mode_of(guiding).name}", cause, value, threshold)
    return events.all()


def _table(
    solutions: tuple[SolutionEpoch, ...],
    evaluations: Mapping[int, Evaluation],
    services: Mapping[int, ServiceState],
    guiding: int,
) -> ModesEpoch:
    rows = [_row(each, evaluations[int(each.mode)], services[int(each.mode)], guiding) for each in solutions]
    columns = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in rows[0]}
    return ModesEpoch(gps_week=solutions[0].gps_week, tow_s=solutions[0].tow_s, **columns)


def _row(solution: SolutionEpoch, evaluation: Evaluation, service: ServiceState, guiding: int) -> dict[str, float]:
    failure, levels = evaluation.failure, evaluation.levels
    return {
        "mode": solution.mode,
        "guides": float(int(solution.mode) == guiding),
        "service": float(service.service if failure is None else ServiceType.NONE),
        "cause": float(failure.cause if failure else ServiceCause.NONE),
        "value": _finite(failure.value) if failure else math.nan,
        "threshold": _finite(failure.threshold) if failure else math.nan,
        **{name: getattr(solution, name) for name in ("x_m", "y_m", "z_m", "n_sats", "d_vert_m", "d_lat_m")},
        "vpl_m": levels.level_m[0],
        "lpl_m": levels.level_m[1],
        "veb_m": levels.ephemeris_bound_m[0],
        "leb_m": levels.ephemeris_bound_m[1],
        "val_m": evaluation.val_m,
        "lal_m": evaluation.lal_m,
    }


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.nan
