"""The same flights with and without guidance: losses avoided, deviation paid, limits kept.

With guidance the aircraft flies the alternate plan from a moment after it is commanded, with the error of bank of the
turn it is in; without, it flies on as it did. Guided flights are flown in time, for each command changes what follows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.kernels.trajectories import FADE_RAD, GRAVITY_MPS2
from gbas_airborne.abia.prediction.look_ahead import seen_at
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import PredictionEpoch, PredictionState, predict
from gbas_airborne.abia.steering.guidance import Steering, SteeringEpoch, steer
from gbas_airborne.abia.steering.params import SteeringParams
from gbas_core.record import BoolArray, FloatArray
from gbas_studies.abia.cautions import TIMES_A_SKY, losses
from gbas_studies.abia.flights import TICK_S, FlightParams, FlownFlight, drawn_flight
from gbas_studies.abia.scoring import spells
from gbas_studies.campaign import Campaign, Execution, run

PREDICT_EVERY: Final = 2
"""Times from one prediction to the next."""
COMMAND_EVERY_S: Final = 1.0
"""Least time between commands."""
DELAY_S: Final = 0.4
"""From a command to its being flown."""
HEIGHT_M: Final = 1500.0
_AFTER_S: Final = 30.0
_ROUNDING: Final = 1e-9

AIRCRAFT: Final[dict[str, tuple[FlightParams, SteeringParams]]] = {
    "fighter": (
        FlightParams(duration_s=100.0, turn_s=(20.0, 50.0), straight_s=(10.0, 15.0)),
        SteeringParams(max_bank_rad=math.radians(70.0), max_roll_rate_radps=math.radians(60.0), min_speed_mps=75.0),
    ),
    "airliner": (
        FlightParams(
            duration_s=100.0, speed_mps=(90.0, 130.0), bank_rad=(math.radians(20.0), math.radians(45.0)),
            roll_rate_radps=(math.radians(15.0), math.radians(20.0)), turn_s=(20.0, 50.0), straight_s=(10.0, 15.0),
        ),
        SteeringParams(
            max_bank_rad=math.radians(50.0), max_roll_rate_radps=math.radians(15.0), min_speed_mps=68.0,
            max_load_factor=2.0, max_speed_mps=180.0,
        ),
    ),
    "uav": (
        FlightParams(
            duration_s=100.0, speed_mps=(25.0, 40.0), bank_rad=(math.radians(20.0), math.radians(55.0)),
            turn_s=(20.0, 50.0), straight_s=(10.0, 15.0),
        ),
        SteeringParams(
            max_bank_rad=math.radians(60.0), max_roll_rate_radps=math.radians(60.0), min_speed_mps=15.0,
            max_load_factor=2.5, max_speed_mps=60.0,
        ),
    ),
}  # fmt: skip
"""Aircraft: what they fly and what they can. Ours, with a clean stall in level flight as the lowest speed."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is flown: an aircraft of :data:`AIRCRAFT`, and the prediction."""

    aircraft: str
    prediction: PredictionParams


@dataclass(frozen=True, kw_only=True)
class Pair:
    """One flight without and with guidance.

    Attributes
    ----------
    losses, guided_losses : int
        Onsets.
    loss_s, guided_loss_s : float
    commands : int
    bank_change_rad, heading_rad, place_m : float
        Largest difference of bank and of heading, and distance in place at the end.
    limits_kept : bool
        Bank (but for the error it is flown with), roll rate and speed.
    """

    losses: int
    guided_losses: int
    loss_s: float
    guided_loss_s: float
    commands: int
    bank_change_rad: float
    heading_rad: float
    place_m: float
    limits_kept: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class _Guided:
    """A guided flight: (T, 5) as flown, losses (T,), commands."""

    flown: FloatArray
    loss: BoolArray
    commands: int


def error_of_turn_rad(flight: FlownFlight, time_s: float, planned_rad: float) -> float:
    """Error of bank at a time and planned bank: that of the turn flown then or, before it, flown next."""
    for planned, flown in zip(flight.turns, flight.flown_turns, strict=True):
        if time_s <= max(planned.end_s, flown.end_s) + _AFTER_S / 3.0:
            sense = min(max(planned_rad / FADE_RAD, -1.0), 1.0)
            return (flown.bank_rad - planned.bank_rad) * math.copysign(1.0, planned.bank_rad) * sense
    return 0.0


def fly_guided(flight: FlownFlight, mask: MaskTable, plan: Plan) -> _Guided:
    """Fly with guidance, time by time."""
    limits = AIRCRAFT[plan.aircraft][1]
    flown = flight.flown.copy()
    following = _plan_of(flight)
    count = flown.shape[0]
    state, command, since, commands = PredictionState(), Steering(commanded=False, reason=""), -math.inf, 0
    loss = np.zeros(count, dtype=bool)
    for k in range(count):
        time_s = TICK_S * k
        if k and commands and time_s >= since + DELAY_S:
            flown[k] = _flown_on(flown[k - 1], command, flight, time_s, limits)
        elif k and commands:
            flown[k] = _held(flown[k - 1])
        los = flight.los_enu[k // TIMES_A_SKY]
        loss[k] = seen_at(flown[k, :3], los, mask).sum() < plan.prediction.required_satellites
        if k % PREDICT_EVERY:
            continue
        ahead = PredictionEpoch(
            time_s=time_s, attitude=Attitude(**dict(zip(_NAMES, map(float, flown[k]), strict=True))), plan=following,
            los_enu=los, mask=mask,
        )  # fmt: skip
        state, prediction = predict(state, ahead, plan.prediction)
        if not prediction.caution or time_s < since + COMMAND_EVERY_S:
            continue
        found = steer(SteeringEpoch(ahead=ahead, prediction=prediction, height_m=HEIGHT_M), plan.prediction, limits)
        if found.commanded and found.plan is not None:
            command, following, since, commands = found, found.plan, time_s, commands + 1
            state = PredictionState()
    return _Guided(flown=flown, loss=loss, commands=commands)


_NAMES: Final = ("bank_rad", "pitch_rad", "heading_rad", "roll_rate_radps", "speed_mps")


def _plan_of(flight: FlownFlight) -> AttitudePlan:
    """The plan, with some level flight after it."""
    bank = np.append(flight.plan_bank_rad, np.zeros(round(_AFTER_S / TICK_S)))
    return AttitudePlan(start_s=0.0, step_s=TICK_S, bank_rad=bank, pitch_rad=np.zeros_like(bank))


def _flown_on(
    before: FloatArray, command: Steering, flight: FlownFlight, time_s: float, limits: SteeringParams
) -> FloatArray:
    """One time on along the alternate plan, rolling no faster than the limit."""
    assert command.plan is not None
    place = min(command.plan.place(time_s), command.plan.bank_rad.size - 1.0)
    planned = float(np.interp(place, np.arange(command.plan.bank_rad.size), command.plan.bank_rad))
    wanted = planned + error_of_turn_rad(flight, time_s, planned)
    largest = limits.max_roll_rate_radps * TICK_S
    bank = before[0] + min(max(wanted - before[0], -largest), largest)
    return _after(before, bank, command.speed_mps)


def _held(before: FloatArray) -> FloatArray:
    """One time on with the bank as it is: a command is not flown yet."""
    return _after(before, before[0], before[4])


def _after(before: FloatArray, bank_rad: float, speed_mps: float) -> FloatArray:
    rates = [GRAVITY_MPS2 * math.tan(each) / speed_mps for each in (before[0], bank_rad)]
    heading = before[2] + 0.5 * TICK_S * sum(rates)
    return np.array([bank_rad, 0.0, heading, (bank_rad - before[0]) / TICK_S, speed_mps])


def _pair(context: tuple[Plan, MaskTable], number: int, seed: np.random.SeedSequence) -> Pair:
    plan, mask = context
    flights, limits = AIRCRAFT[plan.aircraft]
    flight = drawn_flight(flights, np.random.default_rng(seed))
    loss = losses(flight, mask, plan.prediction.required_satellites)
    guided = fly_guided(flight, mask, plan)
    changed = guided.flown - flight.flown
    return Pair(
        losses=int(spells(loss)[0].size), guided_losses=int(spells(guided.loss)[0].size),
        loss_s=float(TICK_S * loss.sum()), guided_loss_s=float(TICK_S * guided.loss.sum()), commands=guided.commands,
        bank_change_rad=float(np.abs(changed[:, 0]).max()), heading_rad=float(np.abs(changed[:, 2]).max()),
        place_m=float(np.hypot(*(_place_m(guided.flown) - _place_m(flight.flown)))),
        limits_kept=_within(guided, flight, limits),
    )  # fmt: skip


def _place_m(flown: FloatArray) -> FloatArray:
    """Where a flight ends, east and north of its start."""
    return TICK_S * np.array([(flown[:, 4] * np.sin(flown[:, 2])).sum(), (flown[:, 4] * np.cos(flown[:, 2])).sum()])


def _within(guided: _Guided, flight: FlownFlight, limits: SteeringParams) -> bool:
    """Whether what was flown by command is within the limits; what was flown as planned may be beyond."""
    other = (np.abs(guided.flown - flight.flown) > _ROUNDING).any(axis=1)
    flown = guided.flown[other]
    errors = [abs(a.bank_rad - b.bank_rad) for a, b in zip(flight.turns, flight.flown_turns, strict=True)]
    bank_rad = max(limits.max_bank_rad, np.abs(flight.flown[:, 0]).max()) + max(errors, default=0.0)
    return bool(
        (np.abs(flown[:, 0]) <= bank_rad + _ROUNDING).all()
        and (np.abs(flown[:, 3]) <= limits.max_roll_rate_radps + _ROUNDING).all()
        and (flown[:, 4] <= limits.max_speed_mps).all()
        and (flown[:, 4] >= limits.min_speed_mps).all()
    )


def run_guided(plan: Plan, *, flights: int, seed: int, execution: Execution | None = None) -> list[Pair]:
    """Fly so many flights without and with guidance."""
    campaign = Campaign(
        study="abia-guidance", settings=plan, trials=range(flights), prepare=_prepare, run_trial=_pair, result=Pair,
        seed=seed, batch=4,
    )  # fmt: skip
    return run(campaign, execution)


def _prepare(plan: Plan) -> tuple[Plan, MaskTable]:
    return plan, MaskTable.open_sky(AIRCRAFT[plan.aircraft][0].antenna_horizon_rad)


def table(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Losses avoided and the deviation paid, of flights that were commanded something."""
    hit = [each for each in pairs if each.losses]
    commanded = [each for each in pairs if each.commands]
    middle = {
        name: float(np.median([getattr(each, name) for each in commanded])) if commanded else None
        for name in ("bank_change_rad", "heading_rad", "place_m")
    }
    return {
        "flights": len(pairs),
        "flights_with_loss": len(hit),
        "flights_saved": sum(each.guided_losses == 0 for each in hit),
        "new_losses": sum(each.losses == 0 and each.guided_losses > 0 for each in pairs),
        "loss_s": sum(each.loss_s for each in pairs),
        "guided_loss_s": sum(each.guided_loss_s for each in pairs),
        "commanded": len(commanded),
        "limits_kept": sum(each.limits_kept for each in pairs),
        "median": middle,
    }
