"""Guidance where the smallest change is known in closed form, and where nothing may be commanded."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import PredictionEpoch, PredictionState, predict
from gbas_airborne.abia.steering.candidates import candidates
from gbas_airborne.abia.steering.guidance import Steering, SteeringEpoch, steer
from gbas_airborne.abia.steering.params import SteeringParams

OPEN = MaskTable.open_sky(math.radians(5.0))
PREDICTION = PredictionParams(predictor="plan")
LIMITS = SteeringParams()
G = 9.80665


def to_the(azimuth_deg: float, elevation_deg: float) -> list[float]:
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    return [math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth), math.sin(elevation)]


# three satellites high up, and one in the west at 35 degrees: a right bank above 30 degrees heading north hides it
LOS = np.array([to_the(0.0, 85.0), to_the(120.0, 80.0), to_the(240.0, 80.0), to_the(270.0, 35.0)]).T


def turn_plan(bank_deg: float = 40.0, at_s: float = 3.0, until_s: float = 60.0) -> AttitudePlan:
    roll_s = bank_deg / 30.0
    times = [0.0, at_s, at_s + roll_s, until_s, until_s + roll_s, 120.0]
    return AttitudePlan.from_points(times, np.radians([0.0, 0.0, bank_deg, bank_deg, 0.0, 0.0]), np.zeros(6))


def asked(plan: AttitudePlan | None, *, time_s: float = 0.0, bank_deg: float = 0.0, height_m: float = 2000.0,
          limits: SteeringParams = LIMITS, los: np.ndarray = LOS) -> Steering:  # fmt: skip
    attitude = Attitude(
        bank_rad=math.radians(bank_deg), pitch_rad=0.0, heading_rad=0.0, roll_rate_radps=0.0, speed_mps=200.0
    )
    ahead = PredictionEpoch(time_s=time_s, attitude=attitude, plan=plan, los_enu=los, mask=OPEN)
    _, prediction = predict(PredictionState(), ahead, PREDICTION)
    return steer(SteeringEpoch(ahead=ahead, prediction=prediction, height_m=height_m), PREDICTION, limits)


def test_the_smallest_change_that_keeps_the_satellite() -> None:
    """40 degrees hide it, 36 too, with the margin of 3 degrees 28 and 24 do not: 30 - 3 = 27 is the bound, the heading
    turns by less than 15 degrees until the end of the horizon, which moves the bound by less than a step of 4.
    """
    found = asked(turn_plan())
    assert found.commanded
    assert found.keeps
    assert found.reason == "avoid"
    assert found.kind == "shallower"
    assert found.plan is not None
    steepest = math.degrees(np.abs(found.plan.bank_rad[:80]).max())
    assert 24.0 - 1e-6 <= steepest <= 28.0 + 1e-6
    assert math.degrees(found.change_rad) == pytest.approx(40.0 - steepest, abs=1e-6)


def test_the_planned_heading_is_rejoined() -> None:
    """The turn is made longer until it has turned as far: to half a sample of the turn."""
    plan, found = turn_plan(), asked(turn_plan())
    assert found.plan is not None

    def turned(flown: AttitudePlan) -> float:
        return G / 200.0 * flown.step_s * float(np.tan(flown.bank_rad).sum())

    assert turned(found.plan) == pytest.approx(turned(plan), abs=G / 200.0 * plan.step_s * math.tan(math.radians(40.0)))
    assert found.plan.bank_rad[-1] == plan.bank_rad[-1] == 0.0


def test_after_a_loss_the_satellite_is_back_when_the_wing_is_down() -> None:
    """Banked 40 degrees: at the limit of 30 degrees a second the bank is below 30 less 3 for the error after 0.43 s."""
    found = asked(turn_plan(), time_s=10.0, bank_deg=40.0)
    assert found.commanded
    assert found.reason == "recover"
    assert found.keeps
    assert found.time_s == pytest.approx((40.0 - 27.0) / 30.0, abs=0.2)


def test_commands_keep_within_the_aircraft() -> None:
    rng = np.random.default_rng(1)
    for _ in range(40):
        limits = SteeringParams(
            max_bank_rad=math.radians(rng.uniform(30.0, 60.0)),
            max_roll_rate_radps=math.radians(rng.uniform(5.0, 40.0)),
            max_load_factor=rng.uniform(1.3, 3.0), min_speed_mps=rng.uniform(90.0, 180.0), max_speed_mps=210.0,
        )  # fmt: skip
        plan = turn_plan(rng.uniform(25.0, 60.0))
        attitude = Attitude(
            bank_rad=math.radians(rng.uniform(-20.0, 20.0)), pitch_rad=0.0, heading_rad=0.0, roll_rate_radps=0.0,
            speed_mps=200.0,
        )  # fmt: skip
        for each in candidates(0.5, attitude, plan, limits):
            bank = np.abs(each.plan.bank_rad[6:])
            rolled = np.abs(np.diff(each.plan.bank_rad[5 : 5 + round(limits.horizon_s / 0.1)]))
            assert bank.max() <= limits.max_bank_rad
            assert 1.0 / math.cos(bank.max()) <= limits.max_load_factor
            assert limits.min_speed_mps / math.sqrt(math.cos(bank.max())) <= each.speed_mps <= limits.max_speed_mps
            if each.kind != "speed":
                assert rolled.max() <= limits.max_roll_rate_radps * 0.1 + 1e-12


def test_nothing_is_commanded_without_what_it_rests_on() -> None:
    plan = turn_plan()
    assert asked(plan, height_m=250.0).reason == "height"
    assert asked(plan, height_m=math.nan).reason == "height"
    assert asked(None).reason == "no_plan"
    assert asked(plan, bank_deg=math.nan).reason == "no_attitude"
    assert asked(plan, los=np.full((3, 4), np.nan)).reason == "no_satellites"
    assert asked(turn_plan(at_s=50.0)).reason == "no_caution"
    for found in (asked(plan, height_m=250.0), asked(None)):
        assert not found.commanded
        assert found.plan is None
        assert math.isnan(found.bank_rad)


def test_a_plan_that_is_the_best_is_left() -> None:
    """A satellite in the zenith with three below every wing: no attitude brings four."""
    los = np.array([to_the(0.0, 85.0), to_the(90.0, 80.0), to_the(180.0, 80.0)]).T
    assert asked(turn_plan(), los=los).reason == "nothing_better"


def test_a_small_step_finds_a_smaller_change() -> None:
    coarse, fine = asked(turn_plan()), asked(turn_plan(), limits=replace(LIMITS, share=0.02))
    assert fine.keeps
    assert fine.change_rad <= coarse.change_rad
