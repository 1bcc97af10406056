# mypy: disable-error-code="no-untyped-call"
"""What a service needs of a solution: protection levels, alert limits, and the first condition that does not hold.

Fail-safe: the service is given only when every condition of the list holds; the first that does not is the cause. A
comparison with a missing number never holds.

Without a selected approach there are no alert limits. A service then means that position and protection levels are
valid, the alert limits are NaN, and whoever uses the position compares the levels with limits of their own.

Source: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253 (approach service types, time-outs).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from gbas_airborne.modes import configured_modes
from gbas_airborne.navigation.guidance import alert_limits_m
from gbas_airborne.params import NO_FAS, AirborneParams
from gbas_airborne.protection.levels import NOT_PROTECTED, Multipliers, ProtectionLevels, levels_of_all
from gbas_airborne.reception.station_data import HEALTHY_GCID
from gbas_core.positioning.approach import APD_C, APD_CD
from gbas_msgs_py.codes import ApproachState, ServiceCause, ServiceType
from gbas_msgs_py.modes import Mode
from gbas_msgs_py.records import SolutionEpoch

# Known: designators of approaches (APD) and stations (GCID) that are for a service; what no standard has is as C.
APPROACHES_FOR: Final = {ServiceType.D: (float(APD_CD),)}
APPROACHES_FOR_C: Final = (float(APD_C), float(APD_CD))
STATIONS_FOR: Final = {ServiceType.D: (2.0, 3.0, 4.0)}
_ANY_STATION: Final = tuple(float(gcid) for gcid in HEALTHY_GCID)
_FOOT_M: Final = 0.3048
# Known (RTCA DO-253D, by way of gbas_facts 3.5 uncertain): below 200 ft above the threshold GAST-D waits less long.
LOW_HEIGHT_M: Final = 200.0 * _FOOT_M


class Failure(NamedTuple):
    """A condition that does not hold: the state it leaves the receiver in, its name, the number and its bound."""

    state: ApproachState
    cause: ServiceCause
    value: float
    threshold: float


class Evaluation(NamedTuple):
    """What a solution is worth; without levels and limits these are NaN. The service is the one its mode can give."""

    levels: ProtectionLevels
    val_m: float
    lal_m: float
    failure: Failure | None
    service: ServiceType


def evaluate(solutions: Sequence[SolutionEpoch], params: AirborneParams) -> tuple[Evaluation, ...]:
    """Evaluate solutions of one epoch, of different modes.

    Protection levels are NaN unless messages, station and position are all good; with `params.use_unhealthy` the
    station need not be, and with a service that this station or approach is not for there are levels, too.
    """
    known = {mode.number: mode for mode in configured_modes(params)}
    modes = [known.get(_number(solution.mode)) for solution in solutions]
    failures = [
        _message_failure(solution, mode, params) or _position_failure(solution, mode, params)
        for solution, mode in zip(solutions, modes, strict=True)
    ]
    usable = [row for row, failure in enumerate(failures) if failure is None]
    levels = dict(zip(usable, _levels([(solutions[row], modes[row]) for row in usable], params), strict=True))
    found: list[Evaluation] = []
    for row, (solution, mode, failure) in enumerate(zip(solutions, modes, failures, strict=True)):
        val_m, lal_m = alert_limits_m(solution) if params.rpds != NO_FAS else (math.nan, math.nan)
        protected = levels.get(row, NOT_PROTECTED)
        if failure is None and mode is not None:
            failure = (
                _station_failure(solution)
                or _service_failure(solution, mode, params)
                or _protection_failure(protected, val_m, lal_m, params)
            )
        found.append(Evaluation(protected, val_m, lal_m, failure, ServiceType.NONE if mode is None else mode.service))
    return tuple(found)


def _number(mode: float) -> int:
    """Number of a mode in a table; none has 0."""
    return int(mode) if math.isfinite(mode) and mode == int(mode) else 0


def _levels(known: list[tuple[SolutionEpoch, Mode | None]], params: AirborneParams) -> tuple[ProtectionLevels, ...]:
    """Levels, with the multipliers of each solution's service."""
    of_d = [mode is not None and mode.service is ServiceType.D for _, mode in known]
    found: dict[int, ProtectionLevels] = {}
    for service_d in (False, True):
        rows = [row for row, each in enumerate(of_d) if each == service_d]
        if rows:
            levels = levels_of_all([known[row][0] for row in rows], _multipliers(params, service_d=service_d))
            found |= dict(zip(rows, levels, strict=True))
    return tuple(found[row] for row in range(len(known)))


def _multipliers(params: AirborneParams, *, service_d: bool) -> Multipliers:
    probability = params.gast_d.protection_probability if service_d else params.protection_probability
    return Multipliers.generate(probability, params.receiver_fault_prior, params.k_ffmd_single)


def _message_failure(solution: SolutionEpoch, mode: Mode | None, params: AirborneParams) -> Failure | None:
    """The first condition on the messages that does not hold."""
    gcid, age_s = solution.gcid, solution.message_age_s
    if math.isnan(gcid) and math.isnan(age_s):
        return Failure(ApproachState.NO_SIGNAL, ServiceCause.NO_SIGNAL, math.nan, math.nan)
    acquired = ApproachState.VDB_ACQUIRED
    if math.isnan(gcid):
        return Failure(acquired, ServiceCause.NO_STATION_DATA, math.nan, math.nan)
    if not params.use_unhealthy and (unhealthy := _station_failure(solution)):
        return unhealthy
    if math.isnan(age_s):
        return Failure(acquired, ServiceCause.NO_CORRECTIONS, math.nan, math.nan)
    timeout_s = _timeout_s(solution, mode, params)
    if not -params.correction_wait_s <= age_s <= timeout_s:
        return Failure(acquired, _timeout_cause(mode), age_s, timeout_s)
    if params.rpds != NO_FAS and math.isnan(solution.apd):
        return Failure(acquired, ServiceCause.NO_APPROACH_DATA, math.nan, math.nan)
    if params.rpds != NO_FAS and solution.apd not in APPROACHES_FOR_C:
        return Failure(acquired, ServiceCause.APPROACH_NOT_FOR_SERVICE, solution.apd, float(APD_C))
    return None


def _timeout_s(solution: SolutionEpoch, mode: Mode | None, params: AirborneParams) -> float:
    """Longest time without a message; GAST-D has the shorter one near the ground, and where the height is unknown."""
    if mode is None or mode.service is not ServiceType.D or params.rpds == NO_FAS:
        return params.mt1_timeout_s
    return params.mt1_timeout_s if solution.height_above_ltp_m >= LOW_HEIGHT_M else params.gast_d.low_timeout_s


def _timeout_cause(mode: Mode | None) -> ServiceCause:
    if mode is None or mode.service is ServiceType.C:
        return ServiceCause.MT1_TIMEOUT
    return ServiceCause.MT11_TIMEOUT if mode.service is ServiceType.D else ServiceCause.MESSAGE_TIMEOUT


def _station_failure(solution: SolutionEpoch) -> Failure | None:
    """A station that claims nothing gives no service, whatever is computed with its corrections."""
    if solution.gcid in HEALTHY_GCID:
        return None
    return Failure(ApproachState.VDB_ACQUIRED, ServiceCause.STATION_UNHEALTHY, solution.gcid, math.nan)


def _position_failure(solution: SolutionEpoch, mode: Mode | None, params: AirborneParams) -> Failure | None:
    """The first condition on the position that does not hold."""
    valid = ApproachState.DATA_VALID
    if not -params.correction_wait_s <= solution.correction_age_s <= params.correction_timeout_s:
        return Failure(valid, ServiceCause.CORRECTION_AGE, solution.correction_age_s, params.correction_timeout_s)
    if not math.isfinite(solution.x_m + solution.y_m + solution.z_m):
        return Failure(valid, ServiceCause.NO_POSITION, solution.n_sats, math.nan)
    if mode is None:
        return Failure(valid, ServiceCause.MODE_WITHOUT_SERVICE, solution.mode, math.nan)
    if params.require_ephemeris_bound and not solution.k_md_e > 0.0:
        return Failure(valid, ServiceCause.NO_EPHEMERIS_BOUND, solution.k_md_e, math.nan)
    return None


def _service_failure(solution: SolutionEpoch, mode: Mode, params: AirborneParams) -> Failure | None:
    """A station or an approach that is not for this service."""
    acquired, service = ApproachState.VDB_ACQUIRED, mode.service
    stations = STATIONS_FOR.get(service, _ANY_STATION)
    if solution.gcid not in stations:
        return Failure(acquired, ServiceCause.STATION_NOT_FOR_SERVICE, solution.gcid, stations[0])
    approaches = APPROACHES_FOR.get(service, APPROACHES_FOR_C)
    if params.rpds != NO_FAS and solution.apd not in approaches:
        return Failure(acquired, ServiceCause.APPROACH_NOT_FOR_SERVICE, solution.apd, approaches[0])
    return None


def _protection_failure(levels: ProtectionLevels, val_m: float, lal_m: float, params: AirborneParams) -> Failure | None:
    """The first condition on the protection levels that does not hold."""
    vpl_m, lpl_m = map(float, levels.level_m)
    veb_m, leb_m = map(float, levels.ephemeris_bound_m)
    if not math.isfinite(vpl_m + lpl_m):
        return Failure(ApproachState.DATA_VALID, ServiceCause.NOT_PROTECTED, vpl_m, math.nan)
    if params.require_ephemeris_bound and not math.isfinite(veb_m + leb_m):
        return Failure(ApproachState.DATA_VALID, ServiceCause.NO_EPHEMERIS_BOUND, veb_m, math.nan)
    if params.rpds == NO_FAS:
        return None
    # NaN bounds only get here when the operator does without them.
    for cause, value, limit, optional in (
        (ServiceCause.VPL_ABOVE_VAL, vpl_m, val_m, False),
        (ServiceCause.LPL_ABOVE_LAL, lpl_m, lal_m, False),
        (ServiceCause.VEB_ABOVE_VAL, veb_m, val_m, True),
        (ServiceCause.LEB_ABOVE_LAL, leb_m, lal_m, True),
    ):
        bounded = value <= limit or (optional and math.isnan(value))
        if not (bounded and math.isfinite(limit)):
            return Failure(ApproachState.DIFFERENTIAL, cause, value, limit)
    return None
