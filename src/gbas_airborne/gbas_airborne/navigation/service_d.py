"""Airborne monitors of GAST-D that look at a position: dual solution, reference receivers, corrections, geometry.

Each test is a pure function of the projections of one position; what fails may pass without one satellite or more,
which :func:`monitored` looks for.

Source: RTCA DO-253D by way of published descriptions (known: dual solution 2 m, corrections 200 m; uncertain: limits of
projections, K_fd_B); the search for satellites to leave out is ours.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from gbas_airborne.navigation.position import PositionInputs, PositionResult, Withheld
from gbas_airborne.params import AirborneParams, ServiceDParams
from gbas_airborne.ranging.corrected_ranges import RangingSources
from gbas_airborne.reception.columns import B_VALUES, PRC, SIGMA
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.wls import vertical_lateral
from gbas_core.record import BoolArray, FloatArray
from gbas_msgs_py.codes import Rejection, ServiceCause

Solve = Callable[[list[PositionInputs]], list[PositionResult]]
"""Positions of several sets of sources."""
_EXCLUDING: Final = {
    ServiceCause.D_VERT: Rejection.DUAL_SOLUTION,
    ServiceCause.D_LAT: Rejection.DUAL_SOLUTION,
    ServiceCause.B_VERT: Rejection.RECEIVER_FAULT,
    ServiceCause.B_LAT: Rejection.RECEIVER_FAULT,
}
"""Failures that may be one satellite's, and what that one is then left out for."""
DUAL_SOLUTION, REFERENCE_RECEIVER, CORRECTION_SHIFT, GEOMETRY = (
    "dual_solution",
    "reference_receiver",
    "correction_shift",
    "geometry",
)


class Projected(NamedTuple):
    """A position's used satellites (n of them): projections on the vertical and the lateral error, on the horizontal
    position, and what is projected.
    """

    used: BoolArray
    s: FloatArray
    horizontal: FloatArray
    sources: RangingSources


def projected(result: PositionResult, approach: FinalApproach | None) -> Projected | None:
    """The projections of a position; None without one."""
    if result.fix is None:
        return None
    used = result.reason == int(Rejection.NONE)
    projection = result.fix.projection[:, used]
    s = np.array(vertical_lateral(projection, approach.gpa_rad if approach is not None else 0.0))
    return Projected(used, s, projection[:2], result.sources)


def separation_m(found: Projected) -> tuple[float, float]:
    """D_V and D_L: how far the solution beside is from this one, with the same projections [m].

    0 for a mode without one beside; NaN where a satellite used lacks its range.
    """
    beside = found.sources.beside
    if beside is None:
        return 0.0, 0.0
    difference_m = (found.sources.range_m - beside.range_m)[found.used]
    vertical, lateral = np.abs((found.s * difference_m).sum(axis=1)).tolist()
    return vertical, lateral


def dual_solution(found: Projected, params: ServiceDParams) -> Withheld | None:
    """Whether the 30 s and 100 s solutions agree."""
    for cause, apart_m in zip((ServiceCause.D_VERT, ServiceCause.D_LAT), separation_m(found), strict=True):
        if not apart_m <= params.dual_solution_m:
            return Withheld(cause, apart_m, params.dual_solution_m)
    return None


def reference_receivers(found: Projected, params: ServiceDParams) -> Withheld | None:
    """Whether the B values of each reference receiver are in the position what their sigmas allow.

    The B value of receiver j is PRC less that of the others, its variance sigma^2 / U_i with U_i = M_i - 1 receivers
    behind the other one.
    """
    b_m = found.sources.applied[B_VALUES:, found.used]
    present = np.isfinite(b_m)
    others = np.maximum(present.sum(axis=0) - 1, 1)
    variance = np.where(present, found.sources.applied[SIGMA, found.used] ** 2 / others, 0.0)
    s = found.s[:, np.newaxis]
    value_m = np.abs((s * np.where(present, b_m, 0.0)).sum(axis=2))
    threshold_m = params.k_fd_b * np.sqrt((s**2 * variance).sum(axis=2))
    for row, cause in enumerate((ServiceCause.B_VERT, ServiceCause.B_LAT)):
        failed = ~(value_m[row] <= threshold_m[row])
        if failed.any():
            worst = int(np.argmax(np.where(failed, value_m[row] / np.maximum(threshold_m[row], 1e-9), -1.0)))
            return Withheld(cause, float(value_m[row, worst]), float(threshold_m[row, worst]))
    return None


def correction_shift(found: Projected, params: ServiceDParams) -> Withheld | None:
    """Whether the 100 s corrections move the position horizontally by no more than they may."""
    sources = found.sources.beside or found.sources
    east_m, north_m = (found.horizontal * sources.applied[PRC, found.used]).sum(axis=1).tolist()
    shift_m = math.hypot(east_m, north_m)
    if shift_m <= params.correction_shift_m:
        return None
    return Withheld(ServiceCause.CORRECTION_SHIFT, shift_m, params.correction_shift_m)


def geometry(found: Projected, params: ServiceDParams) -> Withheld | None:
    """Whether the position rests on no satellite, and on no two of them, more than the aircraft allows."""
    largest = np.sort(np.abs(found.s), axis=1)[:, ::-1]
    for row, causes, single, pair in (
        (0, (ServiceCause.S_VERT, ServiceCause.S_VERT_PAIR), params.s_vert, params.s_vert_pair),
        (1, (ServiceCause.S_LAT, ServiceCause.S_LAT_PAIR), params.s_lat, params.s_lat_pair),
    ):
        for cause, value, limit in zip(
            causes, (float(largest[row, 0]), float(largest[row, :2].sum())), (single, pair), strict=True
        ):
            if not value <= limit:
                return Withheld(cause, value, limit)
    return None


_TESTS: Final = {
    GEOMETRY: geometry,
    CORRECTION_SHIFT: correction_shift,
    REFERENCE_RECEIVER: reference_receivers,
    DUAL_SOLUTION: dual_solution,
}


def failure_of(result: PositionResult, approach: FinalApproach | None, params: ServiceDParams) -> Withheld | None:
    """The first test of the mode's monitors that a position fails; None without a position."""
    found = projected(result, approach)
    if found is None:
        return None
    for name, test in _TESTS.items():
        if name in result.sources.mode.monitors and (failed := test(found, params)):
            return failed
    return None


def monitored(
    result: PositionResult,
    inputs: PositionInputs,
    approach: FinalApproach | None,
    solve: Solve,
    params: AirborneParams,
) -> PositionResult:
    """The position if it passes the mode's monitors, or one without as few satellites as it takes; else none.

    Of several sets of as many satellites the one without which the solutions agree best is left out.
    """
    failure = failure_of(result, approach, params.gast_d)
    if failure is None:
        return result
    if (reason := _EXCLUDING.get(failure.cause)) is not None:
        for count in range(1, params.gast_d.exclusions + 1):
            passing = [
                (max(separation_m(found)), number, each)
                for number, each in enumerate(solve(list(_without(count, result, inputs, reason))))
                if (found := projected(each, approach)) and failure_of(each, approach, params.gast_d) is None
            ]
            if passing:
                return replace(min(passing, key=lambda each: each[:2])[2], failed=failure)
    return replace(result, fix=None, withheld=failure, failed=failure)


def _without(count: int, result: PositionResult, inputs: PositionInputs, reason: Rejection) -> Iterator[PositionInputs]:
    """Inputs without each set of as many of the satellites used."""
    used = np.flatnonzero(result.reason == int(Rejection.NONE))
    held = np.where(result.reason == int(Rejection.RANGE_TEST), result.reason, inputs.reason)
    for left_out in itertools.combinations(used.tolist(), count):
        reasons = held.copy()
        reasons[list(left_out)] = int(reason)
        yield inputs._replace(reason=reasons)
