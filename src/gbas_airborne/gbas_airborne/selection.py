"""Which mode guides: the best one that gives its service, and why it is no better one.

Source: RTCA DO-253 (active approach service type); the chain of modes beyond GAST-D is ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from gbas_airborne.conditions import Evaluation, evaluate
from gbas_airborne.modes import configured_modes, guiding_modes
from gbas_airborne.params import AirborneParams
from gbas_airborne.service import ServiceState, next_state, protection_of
from gbas_msgs_py.codes import EventKind, ServiceCause, ServiceType
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
    services : mapping from a mode's number to ServiceState
    """

    guiding: int | None = None
    services: Mapping[int, ServiceState] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Selected:
    """The solutions of an epoch, the guiding one first.

    Attributes
    ----------
    solutions : tuple of SolutionEpoch
    others : tuple of ProtectionEpoch
        Of the solutions after the first.
    modes : ModesEpoch or None
        All beside one another; None where there is one mode.
    events : tuple of Event
    """

    solutions: tuple[SolutionEpoch, ...]
    others: tuple[ProtectionEpoch, ...] = ()
    modes: ModesEpoch | None = None
    events: tuple[Event, ...] = ()


def select(
    state: SelectionState, solutions: tuple[SolutionEpoch, ...], params: AirborneParams
) -> tuple[SelectionState, Selected]:
    """Choose the solution that guides, from those of the configured modes in their order.

    One mode is not evaluated here: there is nothing to choose.
    """
    if len(configured_modes(params)) == 1:
        return state, Selected(solutions=solutions)
    evaluations = {int(each.mode): found for each, found in zip(solutions, evaluate(solutions, params), strict=True)}
    chain = [mode.number for mode in guiding_modes(params)]
    guiding = _best(chain, evaluations)
    services = {
        int(each.mode): next_state(
            state.services.get(int(each.mode), ServiceState()), each, evaluations[int(each.mode)].failure, params
        )
        for each in solutions
    }
    ordered = sorted(solutions, key=lambda each: int(each.mode) != guiding)
    others = tuple(protection_of(each, evaluations[int(each.mode)], services[int(each.mode)]) for each in ordered[1:])
    selected = Selected(
        solutions=tuple(ordered),
        others=others,
        modes=_table(solutions, evaluations, services, guiding),
        events=_changes(state.guiding, guiding, chain, evaluations, solutions[0]),
    )
    return SelectionState(guiding=guiding, services=services), selected


def _best(chain: list[int], evaluations: Mapping[int, Evaluation]) -> int:
    """The best mode with its service; else the best with protection levels; else the last."""
    for number in chain:
        if evaluations[number].failure is None:
            return number
    return next((number for number in chain if np.isfinite(evaluations[number].levels.level_m).all()), chain[-1])


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
