"""A few ways to fly on within the limits of the aircraft, each a plan that rejoins the planned heading.

All of them are level turns or straight: none descends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gbas_airborne.abia.prediction.kernels.trajectories import GRAVITY_MPS2
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.steering.params import SteeringParams
from gbas_core.record import FloatArray

SHALLOWER, STRAIGHT, STEEPER, OTHER_WAY, SPEED = "shallower", "straight", "steeper", "other_way", "speed"


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """One way to fly on.

    Attributes
    ----------
    kind : str
    plan : AttitudePlan
    speed_mps : float
    change_rad : float
        Largest change of bank against the plan over the horizon, with a tenth of a radian for each tenth of the speed:
        what candidates are ordered by. After the horizon the turn is only longer or shorter.
    """

    kind: str
    plan: AttitudePlan
    speed_mps: float
    change_rad: float


def candidates(time_s: float, attitude: Attitude, plan: AttitudePlan, params: SteeringParams) -> list[Candidate]:
    """Ways to fly on from now that the aircraft can fly, the smallest change first; the plan itself is not among them.

    Parameters
    ----------
    time_s : float
        Now; the plan covers the horizon from here.
    attitude : Attitude
    plan : AttitudePlan
    params : SteeringParams
    """
    first = max(math.floor(plan.place(time_s)), 0)
    places = slice(first, first + round(params.horizon_s / plan.step_s))
    found = [
        Candidate(kind=kind, plan=flown, speed_mps=speed_mps, change_rad=_change_rad(flown, plan, places) + speed)
        for kind, flown, speed_mps, speed in _all(time_s, attitude, plan, params)
        if _is_flyable(flown, time_s, speed_mps, params)
    ]
    return sorted(found, key=lambda each: each.change_rad)


def _all(
    time_s: float, attitude: Attitude, plan: AttitudePlan, params: SteeringParams
) -> Iterator[tuple[str, AttitudePlan, float, float]]:
    speed_mps = attitude.speed_mps
    steps = round(1.0 / params.share)
    for k in range(1, steps + 1):
        share = 1.0 - k * params.share
        kind = STRAIGHT if k == steps else SHALLOWER
        yield kind, _scaled(time_s, attitude, plan, share, params), speed_mps, 0.0
    for k in range(1, 4):
        yield STEEPER, _scaled(time_s, attitude, plan, 1.0 + k * params.share, params), speed_mps, 0.0
    yield OTHER_WAY, _scaled(time_s, attitude, plan, -1.0, params), speed_mps, 0.0
    for factor in (1.0 - params.speed_share, 1.0 + params.speed_share):
        yield SPEED, plan, factor * speed_mps, params.speed_share


def _scaled(
    time_s: float, attitude: Attitude, plan: AttitudePlan, share: float, params: SteeringParams
) -> AttitudePlan:
    """The plan with a share of its bank over the horizon, rolled to within the limit, and its turn made longer or
    shorter such that the heading after it is the planned one.
    """
    step_s = plan.step_s
    first = max(math.floor(plan.place(time_s)), 0)
    last = min(first + round(params.horizon_s / step_s), plan.bank_rad.size)
    wanted = plan.bank_rad.copy()
    wanted[first:last] *= share
    bank = _rolled(wanted, first, attitude.bank_rad, params.max_roll_rate_radps * step_s)
    lost_rad = _turned(plan.bank_rad[first:], attitude.speed_mps, step_s) - _turned(
        bank[first:], attitude.speed_mps, step_s
    )
    bank, pitch = _with_heading_regained(bank, plan.pitch_rad, last, lost_rad * attitude.speed_mps / step_s)
    return AttitudePlan(start_s=plan.start_s, step_s=step_s, bank_rad=bank, pitch_rad=pitch)


def _rolled(wanted: FloatArray, first: int, bank_rad: float, largest: float) -> FloatArray:
    """Bank from a sample on that follows the wanted one from what is flown, rolling no faster than a bound a sample."""
    bank = wanted.copy()
    bank[first] = bank_rad
    for k in range(first + 1, bank.size):
        bank[k] = bank[k - 1] + min(max(wanted[k] - bank[k - 1], -largest), largest)
    return bank


def _turned(bank_rad: FloatArray, speed_mps: float, step_s: float) -> float:
    """Change of heading along a bank [rad]."""
    return float(GRAVITY_MPS2 / speed_mps * step_s * np.tan(bank_rad).sum())


def _with_heading_regained(
    bank: FloatArray, pitch: FloatArray, last: int, tangents: float
) -> tuple[FloatArray, FloatArray]:
    """Repeat, or leave out, samples of the steepest bank after the horizon until the heading is the planned one.

    tangents is the sum of tan(bank) that is lacking, times the standard gravity's inverse. Without a turn in that sense
    after the horizon the heading is left as it is.
    """
    rest = bank[last:]
    wanted = tangents / GRAVITY_MPS2
    if not rest.size or abs(wanted) < 1e-9:
        return bank, pitch
    steepest = float(rest[np.abs(rest).argmax()])
    if abs(steepest) < math.radians(5.0):
        return bank, pitch
    count = round(wanted / math.tan(steepest))
    steady = last + np.flatnonzero(np.abs(rest - steepest) < math.radians(1.0))
    if count >= 0:
        at = int(steady[-1])
        more = np.full(count, bank[at])
        return np.insert(bank, at, more), np.insert(pitch, at, np.full(count, pitch[at]))
    left_out = steady[: min(-count, steady.size - 1)]
    return np.delete(bank, left_out), np.delete(pitch, left_out)


def _change_rad(flown: AttitudePlan, plan: AttitudePlan, places: slice) -> float:
    one, other = flown.bank_rad[places], plan.bank_rad[places]
    shared = min(one.size, other.size)
    return float(np.abs(one[:shared] - other[:shared]).max(initial=0.0))


def _is_flyable(flown: AttitudePlan, time_s: float, speed_mps: float, params: SteeringParams) -> bool:
    """Whether banks, load factors of level turns and speeds are within the limits from now on."""
    bank = np.abs(flown.bank_rad[max(math.floor(flown.place(time_s)) + 1, 0) :])
    steepest = float(bank.max(initial=0.0))
    load_factor = 1.0 / math.cos(steepest)
    slowest_mps = params.min_speed_mps * math.sqrt(load_factor)
    return (
        steepest <= params.max_bank_rad
        and load_factor <= params.max_load_factor
        and slowest_mps <= speed_mps <= params.max_speed_mps
    )
