"""The campaign of cautions: its loops against the prediction step by step, its scores on series counted by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.oracles.tilted_antenna import antenna_elevations_rad
from typer.testing import CliRunner

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import PredictionEpoch, PredictionState, predict
from gbas_cli.main import app
from gbas_studies.abia.campaign import Plan, run_campaign
from gbas_studies.abia.cautions import EVERY, NAMES, TIMES_A_SKY, counted_on, losses, probability
from gbas_studies.abia.flights import TICK_S, FlightParams, FlownFlight, bank_profile, drawn_flight
from gbas_studies.abia.guided import Plan as GuidedPlan
from gbas_studies.abia.guided import run_guided, table
from gbas_studies.abia.scoring import held, score, summary
from gbas_studies.campaign import Execution

SHORT = FlightParams(
    duration_s=60.0, turn_s=(20.0, 30.0), straight_s=(8.0, 10.0), bank_rad=(math.radians(55.0), math.radians(62.0))
)
MASK = MaskTable.open_sky(SHORT.antenna_horizon_rad)
PARAMS = PredictionParams(required_satellites=6)


def flight(seed: int) -> FlownFlight:
    return drawn_flight(SHORT, np.random.default_rng(seed))


def test_losses_are_those_of_turned_vectors() -> None:
    flown = flight(1)
    found = losses(flown, MASK, 6)
    for t in range(0, 600, 7):
        los = flown.los_enu[t // TIMES_A_SKY]
        los = los[:, np.isfinite(los[2])]
        elevations = antenna_elevations_rad(tuple(flown.flown[t, :3]), los)
        assert found[t] == ((elevations >= SHORT.antenna_horizon_rad).sum() < 6)
    assert found.any()


@pytest.mark.parametrize("name", ["hold", "roll_rate", "plan", "robust_plan", "likely_loss"])
def test_a_flight_at_once_is_the_prediction_step_by_step(name: str) -> None:
    """Nothing that is passed over for speed changes a probability."""
    flown, params = flight(2), replace(PARAMS, predictor=name)
    found = probability(name, flown, MASK, params, {})
    counted = counted_on(flown, params)
    bank = np.append(flown.plan_bank_rad, np.full(100, flown.plan_bank_rad[-1]))
    plan = AttitudePlan(start_s=0.0, step_s=TICK_S, bank_rad=bank, pitch_rad=np.zeros_like(bank))
    state, expected = PredictionState(), []
    for t in range(0, 600, EVERY):
        values = map(float, flown.flown[t])
        attitude = Attitude(**dict(zip(Attitude.__dataclass_fields__, values, strict=True)))
        los = flown.los_enu[t // TIMES_A_SKY]
        epoch = PredictionEpoch(
            time_s=t * TICK_S, attitude=attitude, plan=plan, los_enu=los, mask=MASK,
            setting=np.isnan(counted[t // TIMES_A_SKY, 2]),
        )  # fmt: skip
        state, prediction = predict(state, epoch, params)
        expected.append(prediction.probability)
    assert found[::EVERY] == pytest.approx(np.array(expected), abs=1e-9)
    assert found.max() > 0.0


def test_turns_are_rolled_into_and_out_of() -> None:
    flown = flight(3)
    time_s = TICK_S * np.arange(600.0)
    turn = flown.turns[0]
    bank = bank_profile((turn,), time_s)
    roll_s = abs(turn.bank_rad) / turn.roll_rate_radps
    assert bank[round((turn.start_s + roll_s) / TICK_S) + 1] == pytest.approx(turn.bank_rad, rel=1e-9)
    assert bank[round((turn.end_s + roll_s) / TICK_S) + 1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.gradient(bank, TICK_S)).max() == pytest.approx(turn.roll_rate_radps, rel=1e-6)


def test_errors_of_the_plan_are_as_asked_for() -> None:
    """Three hundred turns: mean and standard deviation within four of their own standard errors."""
    late, later, wrong = [], [], []
    for seed in range(75):
        flown = drawn_flight(replace(SHORT, duration_s=250.0, straight_s=(15.0, 20.0)), np.random.default_rng(seed))
        for planned, actual in zip(flown.turns, flown.flown_turns, strict=True):
            late.append(actual.start_s - planned.start_s)
            later.append(actual.end_s - planned.end_s)
            wrong.append(math.degrees(actual.bank_rad - planned.bank_rad))
    for errors, sigma in ((late, 1.0), (later, 1.0), (wrong, 3.0)):
        n = len(errors)
        assert n > 250
        assert abs(np.mean(errors)) < 4.0 * sigma / math.sqrt(n)
        assert np.std(errors) == pytest.approx(sigma, abs=4.0 * sigma / math.sqrt(2.0 * n))


def series(text: str) -> np.ndarray:
    return np.array([each == "x" for each in text])


def test_scores_counted_by_hand() -> None:
    """Times a second apart. The first loss has a lead of 3 s, the second none; the last caution is for nothing."""
    loss = series("......xx.....x...........")
    caution = series("...xxxxx..............xx.")
    found = score(loss, caution, tick_s=1.0, horizon_s=2.0)
    assert found.lead_s == (3.0, 0.0)
    assert (found.cautions, found.false) == (3, 1)
    assert found.caution_s == 5.0
    late = score(series("......x."), series("...x...."), tick_s=1.0, horizon_s=2.0)
    assert late.false == 1
    assert late.lead_s == (0.0,)
    whole = summary([found, found])
    assert (whole.onsets, whole.cautions) == (4, 6)
    assert whole.enough.value == 0.5
    assert whole.missed.value == 0.5
    assert whole.false.value == pytest.approx(1.0 / 3.0)
    assert whole.enough.low == whole.enough.high == 0.5  # all flights alike


def test_holding_lengthens_and_never_delays() -> None:
    assert held(series("..x.....x"), 2).tolist() == series("..xxx...x").tolist()


def test_the_same_in_two_workers() -> None:
    plan = Plan(flights=SHORT, prediction=PARAMS, names=("hold", "plan"))
    alone = run_campaign(plan, flights=6, seed=3)
    assert alone == run_campaign(plan, flights=6, seed=3, execution=Execution(workers=2))


def test_robust_plan_warns_early_and_likely_loss_is_seldom_wrong() -> None:
    """A short form of the campaign: the order of the predictors, which 40 flights show beyond doubt."""
    flights = FlightParams(duration_s=300.0)
    found = run_campaign(Plan(flights=flights, prediction=PARAMS), flights=40, seed=1)
    assert set(found) == set(NAMES)
    assert found["margin"].enough.high < found["hold"].enough.value < found["robust_plan"].enough.value
    assert found["likely_loss"].false.value < found["robust_plan"].false.value
    assert found["likely_loss"].enough.value > 0.9


def test_the_command_prints_what_is_published() -> None:
    result = CliRunner().invoke(app, ["study", "abia", "--flights", "2", "--minutes", "3", "--seed", "4", "--json"])
    assert result.exit_code == 0, result.output
    rows = json.loads(result.stdout)["predictors"]
    assert [each["name"] for each in rows] == list(NAMES)
    for each in rows:
        assert list(each) == ["name", "onsets", "lead_ge_2s", "missed", "false_share", "lead_s"]
        assert list(each["lead_s"]) == ["p5", "p50"]


def test_guidance_costs_no_satellites_and_keeps_the_limits() -> None:
    """Flights with losses: fewer seconds without satellites, no new loss, limits kept in each."""
    pairs = run_guided(GuidedPlan(aircraft="fighter", prediction=PARAMS), flights=5, seed=1)
    found = table(pairs)
    assert found["loss_s"] > 0.0
    assert found["guided_loss_s"] < 0.5 * found["loss_s"]
    assert found["new_losses"] == 0
    assert found["limits_kept"] == 5
