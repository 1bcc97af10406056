"""The service: from a solution and its evaluation to a state, an alert, and why.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 (approach service types, time-outs).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from gbas_airborne.conditions import Evaluation, Failure, evaluate
from gbas_airborne.params import AirborneParams
from gbas_msgs_py.codes import ApproachState, EventKind, ServiceType
from gbas_msgs_py.events import Event, EventLog
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

SOURCE: Final = "protection_level"


@dataclass(frozen=True, kw_only=True)
class ServiceState:
    """What the service remembers between epochs."""

    state: ApproachState = ApproachState.NO_SIGNAL
    service: ServiceType = ServiceType.NONE
    cause: str = "start"
    served: bool = False


def service_step(
    state: ServiceState, solution: SolutionEpoch, params: AirborneParams
) -> tuple[ServiceState, ProtectionEpoch, tuple[Event, ...]]:
    """Protect one epoch and decide on the service.

    Parameters
    ----------
    state : ServiceState
    solution : SolutionEpoch
        The position of the epoch, with or without.
    params : AirborneParams

    Returns
    -------
    state : ServiceState
    protection : ProtectionEpoch
        Protection levels are NaN unless messages, station and position are all good (with `params.use_unhealthy` the
        station need not be); `alert` is 1 unless the service is given.
    events : tuple of Event
        One for each change of state, service and cause of alert.
    """
    evaluation = evaluate((solution,), params)[0]
    new = next_state(state, solution, evaluation)
    return new, protection_of(solution, evaluation, new), _events(state, new, solution, evaluation.failure)


def protection_of(solution: SolutionEpoch, evaluation: Evaluation, state: ServiceState) -> ProtectionEpoch:
    """The record of a solution's protection."""
    levels = evaluation.levels
    return ProtectionEpoch(
        gps_week=solution.gps_week,
        tow_s=solution.tow_s,
        mode=solution.mode,
        service=float(state.service),
        alert=float(evaluation.failure is not None),
        vpl_m=float(levels.level_m[0]),
        lpl_m=float(levels.level_m[1]),
        vpl_h0_m=float(levels.h0_m[0]),
        lpl_h0_m=float(levels.h0_m[1]),
        vpl_h1_m=float(levels.h1_m[0]),
        lpl_h1_m=float(levels.h1_m[1]),
        veb_m=float(levels.ephemeris_bound_m[0]),
        leb_m=float(levels.ephemeris_bound_m[1]),
        val_m=evaluation.val_m,
        lal_m=evaluation.lal_m,
        state=float(state.state),
    )


def next_state(state: ServiceState, solution: SolutionEpoch, evaluation: Evaluation) -> ServiceState:
    """State after a solution and what it is worth."""
    failure = evaluation.failure
    if failure is None:
        on_path = math.isfinite(solution.lateral_ddm + solution.vertical_ddm)
        approach = ApproachState.APPROACH if on_path else ApproachState.DIFFERENTIAL
        return ServiceState(state=approach, service=evaluation.service, cause="", served=True)
    lost = ApproachState.LOSS if state.served else failure.state
    return replace(state, state=lost, service=ServiceType.NONE, cause=failure.cause.word)


def _events(
    old: ServiceState, new: ServiceState, solution: SolutionEpoch, failure: Failure | None
) -> tuple[Event, ...]:
    if (old.state, old.service, old.cause) == (new.state, new.service, new.cause):
        return ()
    cause, value, threshold = (failure.cause.word, *failure[2:]) if failure else ("protected", math.nan, math.nan)
    events = EventLog(solution.gps_week, solution.tow_s, SOURCE)
    if new.cause != old.cause:
        if failure is None:
            events.add(EventKind.ALERT, "navigation", "cleared", 0.0)
        else:
            events.add(EventKind.ALERT, "navigation", cause, value, threshold)
    if new.service != old.service:
        events.add(EventKind.SERVICE, "service", cause, float(new.service))
    if new.state != old.state:
        events.add(EventKind.SERVICE, "approach_state", new.state.name.lower(), float(new.state))
    return events.all()
