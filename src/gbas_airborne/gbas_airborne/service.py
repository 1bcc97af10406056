"""The GAST-C service: from a solution to protection levels, alert limits, a state, an alert, and why.

Fail-safe: the service is given only when every condition of the list holds; the first that does not is the cause. A
comparison with a missing number never holds.

Without a selected approach there are no alert limits. Service C then means that position and protection levels are
valid, the alert limits are NaN, and whoever uses the position compares the levels with limits of their own.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 (approach service type C, time-outs).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from gbas_airborne.modes import configured_modes, subject_prefix
from gbas_airborne.navigation.guidance import alert_limits_m
from gbas_airborne.params import NO_FAS, AirborneParams
from gbas_airborne.protection.levels import NOT_PROTECTED, Multipliers, ProtectionLevels, protection_levels
from gbas_airborne.reception.station_data import HEALTHY_GCID
from gbas_core.positioning.approach import APD_C, APD_CD
from gbas_msgs_py.codes import ApproachState, EventKind, ServiceType
from gbas_msgs_py.events import Event, EventLog
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

SERVICE_C_APD: Final = (float(APD_C), float(APD_CD))
SOURCE: Final = "protection_level"


class Failure(NamedTuple):
    """A condition that does not hold: the state it leaves the receiver in, its name, the number and its bound."""

    state: ApproachState
    cause: str
    value: float
    threshold: float


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
    failure = _message_failure(solution, params) or _position_failure(solution, params)
    levels, val_m, lal_m = NOT_PROTECTED, math.nan, math.nan
    if params.rpds != NO_FAS:
        val_m, lal_m = alert_limits_m(solution)
    if failure is None:
        multipliers = Multipliers.generate(
            params.protection_probability, params.receiver_fault_prior, params.k_ffmd_single
        )
        levels = protection_levels(solution, multipliers)
        failure = _station_failure(solution) or _protection_failure(levels, val_m, lal_m, params)
    new = _next_state(state, solution, failure)
    protection = ProtectionEpoch(
        gps_week=solution.gps_week,
        tow_s=solution.tow_s,
        mode=solution.mode,
        service=float(new.service),
        alert=float(failure is not None),
        vpl_m=float(levels.level_m[0]),
        lpl_m=float(levels.level_m[1]),
        vpl_h0_m=float(levels.h0_m[0]),
        lpl_h0_m=float(levels.h0_m[1]),
        vpl_h1_m=float(levels.h1_m[0]),
        lpl_h1_m=float(levels.h1_m[1]),
        veb_m=float(levels.ephemeris_bound_m[0]),
        leb_m=float(levels.ephemeris_bound_m[1]),
        val_m=val_m,
        lal_m=lal_m,
        state=float(new.state),
    )
    return new, protection, _events(state, new, solution, failure, subject_prefix(solution.mode, params))


def _message_failure(solution: SolutionEpoch, params: AirborneParams) -> Failure | None:
    """The first condition on the messages that does not hold."""
    gcid, age_s = solution.gcid, solution.message_age_s
    if math.isnan(gcid) and math.isnan(age_s):
        return Failure(ApproachState.NO_SIGNAL, "no_signal", math.nan, math.nan)
    acquired = ApproachState.VDB_ACQUIRED
    if math.isnan(gcid):
        return Failure(acquired, "no_station_data", math.nan, math.nan)
    if not params.use_unhealthy and (unhealthy := _station_failure(solution)):
        return unhealthy
    if math.isnan(age_s):
        return Failure(acquired, "no_corrections", math.nan, math.nan)
    if not -params.correction_wait_s <= age_s <= params.mt1_timeout_s:
        return Failure(acquired, "mt1_timeout", age_s, params.mt1_timeout_s)
    if params.rpds != NO_FAS and math.isnan(solution.apd):
        return Failure(acquired, "no_approach_data", math.nan, math.nan)
    if params.rpds != NO_FAS and solution.apd not in SERVICE_C_APD:
        return Failure(acquired, "approach_not_for_service", solution.apd, float(APD_C))
    return None


def _station_failure(solution: SolutionEpoch) -> Failure | None:
    """A station that claims nothing gives no service, whatever is computed with its corrections."""
    if solution.gcid in HEALTHY_GCID:
        return None
    return Failure(ApproachState.VDB_ACQUIRED, "station_unhealthy", solution.gcid, math.nan)


def _position_failure(solution: SolutionEpoch, params: AirborneParams) -> Failure | None:
    """The first condition on the position that does not hold."""
    valid = ApproachState.DATA_VALID
    if not -params.correction_wait_s <= solution.correction_age_s <= params.correction_timeout_s:
        return Failure(valid, "correction_age", solution.correction_age_s, params.correction_timeout_s)
    if not math.isfinite(solution.x_m + solution.y_m + solution.z_m):
        return Failure(valid, "no_position", solution.n_sats, math.nan)
    if solution.mode not in [mode.number for mode in configured_modes(params)]:
        return Failure(valid, "mode_without_service", solution.mode, math.nan)
    if params.require_ephemeris_bound and not solution.k_md_e > 0.0:
        return Failure(valid, "no_ephemeris_bound", solution.k_md_e, math.nan)
    return None


def _protection_failure(levels: ProtectionLevels, val_m: float, lal_m: float, params: AirborneParams) -> Failure | None:
    """The first condition on the protection levels that does not hold."""
    vpl_m, lpl_m = map(float, levels.level_m)
    veb_m, leb_m = map(float, levels.ephemeris_bound_m)
    if not math.isfinite(vpl_m + lpl_m):
        return Failure(ApproachState.DATA_VALID, "not_protected", vpl_m, math.nan)
    if params.require_ephemeris_bound and not math.isfinite(veb_m + leb_m):
        return Failure(ApproachState.DATA_VALID, "no_ephemeris_bound", veb_m, math.nan)
    if params.rpds == NO_FAS:
        return None
    # NaN bounds only get here when the operator does without them.
    for cause, value, limit, optional in (
        ("vpl_above_val", vpl_m, val_m, False),
        ("lpl_above_lal", lpl_m, lal_m, False),
        ("veb_above_val", veb_m, val_m, True),
        ("leb_above_lal", leb_m, lal_m, True),
    ):
        bounded = value <= limit or (optional and math.isnan(value))
        if not (bounded and math.isfinite(limit)):
            return Failure(ApproachState.DIFFERENTIAL, cause, value, limit)
    return None


def _next_state(state: ServiceState, solution: SolutionEpoch, failure: Failure | None) -> ServiceState:
    if failure is None:
        on_path = math.isfinite(solution.lateral_ddm + solution.vertical_ddm)
        approach = ApproachState.APPROACH if on_path else ApproachState.DIFFERENTIAL
        return ServiceState(state=approach, service=ServiceType.C, cause="", served=True)
    lost = ApproachState.LOSS if state.served else failure.state
    return replace(state, state=lost, service=ServiceType.NONE, cause=failure.cause)


def _events(
    old: ServiceState, new: ServiceState, solution: SolutionEpoch, failure: Failure | None, prefix: str
) -> tuple[Event, ...]:
    if (old.state, old.service, old.cause) == (new.state, new.service, new.cause):
        return ()
    found = failure or Failure(new.state, "protected", math.nan, math.nan)
    events = EventLog(solution.gps_week, solution.tow_s, SOURCE)
    if new.cause != old.cause:
        if failure is None:
            events.add(EventKind.ALERT, prefix + "navigation", "cleared", 0.0)
        else:
            events.add(EventKind.ALERT, prefix + "navigation", found.cause, found.value, found.threshold)
    if new.service != old.service:
        events.add(EventKind.SERVICE, prefix + "service", found.cause, float(new.service))
    if new.state != old.state:
        events.add(EventKind.SERVICE, prefix + "approach_state", new.state.name.lower(), float(new.state))
    return events.all()
