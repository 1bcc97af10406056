"""The prediction's attitudes and satellites against vectors turned one by one, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.oracles.tilted_antenna import antenna_elevations_rad, body_axes, first_loss_s

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.prediction.hypotheses import hypotheses_of
from gbas_airborne.abia.prediction.look_ahead import look_ahead, seen_at
from gbas_airborne.abia.prediction.params import PREDICTORS, PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import PredictionEpoch, PredictionState, predict

HORIZON = math.radians(5.0)
OPEN = MaskTable.open_sky(HORIZON)
G = 9.80665


def sky(count: int, seed: int = 1, lowest_deg: float = 5.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    up = rng.uniform(math.sin(math.radians(lowest_deg)), 1.0, count)
    azimuth = rng.uniform(0.0, 2.0 * math.pi, count)
    level = np.sqrt(1.0 - up**2)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), up])


def flying(bank_deg: float = 0.0, roll_deg: float = 0.0, heading_deg: float = 0.0, speed: float = 150.0) -> Attitude:
    return Attitude(
        bank_rad=math.radians(bank_deg), pitch_rad=0.0, heading_rad=math.radians(heading_deg),
        roll_rate_radps=math.radians(roll_deg), speed_mps=speed,
    )  # fmt: skip


def rolling_plan(at_s: float, bank_deg: float, rate_deg: float) -> AttitudePlan:
    """Wings level, and from a time on a turn to the right; points where it changes."""
    points = [0.0, at_s, at_s + bank_deg / rate_deg, 60.0]
    return AttitudePlan.from_points(points, np.radians([0.0, 0.0, bank_deg, bank_deg]), np.zeros(4), step_s=0.05)


def test_satellites_seen_are_those_of_turned_vectors() -> None:
    rng = np.random.default_rng(3)
    los = sky(30)
    for _ in range(200):
        attitude = tuple(rng.uniform([-1.2, -0.4, -7.0], [1.2, 0.4, 7.0]))
        elevations = antenna_elevations_rad(attitude, los)
        clear = np.abs(elevations - HORIZON) > 1e-9  # at the horizon itself rounding decides
        assert np.array_equal(seen_at(np.array(attitude), los, OPEN)[clear], (elevations >= HORIZON)[clear])


def test_an_airframe_hides_what_its_table_says() -> None:
    rng = np.random.default_rng(4)
    blocked = rng.random((72, 36)) < 0.3
    blocked[:, 30:] = False
    mask, los = MaskTable(blocked=blocked, horizon_rad=HORIZON), sky(30)
    for _ in range(100):
        attitude = tuple(rng.uniform([-1.2, -0.4, -7.0], [1.2, 0.4, 7.0]))
        forward, right, up = body_axes(*attitude)
        azimuth = np.arctan2(right @ los, forward @ los)
        assert np.array_equal(seen_at(np.array(attitude), los, mask), ~mask.masked(azimuth, np.arcsin(up @ los)))


def test_what_is_not_finite_is_not_seen() -> None:
    los = sky(5)
    los[:, 2] = math.nan
    assert not seen_at(np.zeros(3), los, OPEN)[2]
    assert not seen_at(np.array([math.nan, 0.0, 0.0]), los, OPEN).any()


def test_a_held_bank_turns_with_g_tan_bank_over_speed() -> None:
    params = PredictionParams(predictor="hold")
    ways = hypotheses_of("hold", params)
    found = look_ahead(ways, ways.values, (0.0, flying(45.0, speed=200.0), None), (sky(8), OPEN), params)
    times = np.arange(26) * 0.2
    assert np.allclose(found.attitudes_rad[0, :, 2], G * times / 200.0, rtol=1e-12)  # tan 45 degrees is 1


def test_a_roll_rate_goes_on_for_two_seconds() -> None:
    params = PredictionParams(predictor="roll_rate")
    ways = hypotheses_of("roll_rate", params)
    found = look_ahead(ways, ways.values, (0.0, flying(10.0, 15.0), None), (sky(8), OPEN), params)
    expected = np.radians(10.0 + 15.0 * np.minimum(np.arange(26) * 0.2, 2.0))
    assert np.allclose(found.attitudes_rad[0, :, 0], expected, rtol=1e-12)


def test_a_late_plan_is_the_plan_of_before() -> None:
    params = PredictionParams(predictor="robust_plan")
    plan = rolling_plan(10.0, 60.0, 30.0)
    ways = hypotheses_of("robust_plan", params)
    found = look_ahead(ways, ways.values, (8.0, flying(), plan), (sky(8), OPEN), params)
    ahead = np.arange(1, 26) * 0.2
    for (late_s, error_rad, _), attitudes in zip(ways.values, found.attitudes_rad, strict=True):
        planned = np.interp(8.0 + ahead - late_s, [10.0, 12.0], np.radians([0.0, 60.0]))
        expected = planned + error_rad * np.minimum(planned / math.radians(10.0), 1.0)
        assert np.allclose(attitudes[1:, 0], expected, atol=1e-12)


def test_the_loss_in_a_roll_comes_when_the_wing_is_as_high_as_the_satellite() -> None:
    """Heading north, rolling right at 20 degrees a second: a satellite in the west at 45 degrees is at the antenna's
    horizon of 5 degrees when the bank is 40 degrees, 2 s after the roll begins; the heading turns by 1 degree until
    then, which moves that by less than the step of 0.2 s.
    """
    west = np.array([[-math.cos(math.radians(45.0)), 0.0, math.sin(math.radians(45.0))]]).T
    high = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, math.sqrt(0.99)], [0.0, 0.1, math.sqrt(0.99)]]).T
    epoch = PredictionEpoch(
        time_s=8.0, attitude=flying(speed=250.0), plan=rolling_plan(10.0, 60.0, 20.0), los_enu=np.hstack([west, high]),
        mask=OPEN,
    )  # fmt: skip
    _, found = predict(PredictionState(), epoch, PredictionParams(predictor="plan"))
    assert found.caution
    assert found.loss_s == pytest.approx(4.0, abs=0.2 + 1e-9)
    assert found.satellite_loss_s[0] == found.loss_s
    assert np.isinf(found.satellite_loss_s[1:]).all()
    _, before = predict(
        PredictionState(), PredictionEpoch(**{**vars(epoch), "time_s": 5.5}), PredictionParams(predictor="plan")
    )
    assert not before.caution
    assert before.loss_s == math.inf


@pytest.mark.parametrize("seed", range(8))
def test_losses_are_found_when_a_second_look_finds_them(seed: int) -> None:
    """Against steps of 0.01 s: a loss is found within a step of either."""
    rng = np.random.default_rng(seed)
    los = sky(8, seed)
    heading_deg, rate = rng.uniform(0.0, 360.0), rng.uniform(15.0, 60.0)
    plan = rolling_plan(2.0, 60.0, rate)
    params = PredictionParams(predictor="plan", required_satellites=5, horizon_s=8.0)
    epoch = PredictionEpoch(time_s=0.5, attitude=flying(heading_deg=heading_deg), plan=plan, los_enu=los, mask=OPEN)
    _, found = predict(PredictionState(), epoch, params)

    def bank(ahead_s: float) -> float:
        return float(np.interp(0.5 + ahead_s, [2.0, 2.0 + 60.0 / rate], np.radians([0.0, 60.0])))

    expected = first_loss_s(bank, math.radians(heading_deg), 150.0, los, (HORIZON, 5), 8.0)
    assert found.loss_s == pytest.approx(expected, abs=0.21) or (math.isinf(found.loss_s) and math.isinf(expected))


@pytest.mark.parametrize("name", PREDICTORS)
def test_what_is_not_known_is_said(name: str) -> None:
    params = PredictionParams(predictor=name)  # type: ignore[arg-type]
    plan, los = rolling_plan(10.0, 60.0, 20.0), sky(8)
    unknown = flying(bank_deg=math.nan)
    _, found = predict(
        PredictionState(), PredictionEpoch(time_s=8.0, attitude=unknown, plan=plan, los_enu=los, mask=OPEN), params
    )
    assert not found.available
    assert found.restriction == "no_attitude"
    assert math.isnan(found.loss_s)
    _, found = predict(
        PredictionState(),
        PredictionEpoch(time_s=8.0, attitude=flying(), plan=plan, los_enu=np.full((3, 8), np.nan), mask=OPEN), params,
    )  # fmt: skip
    assert not found.available
    assert found.restriction == "no_satellites"
    needs_plan = name in ("plan", "robust_plan", "likely_loss")
    for missing in (None, AttitudePlan.from_points([0.0, 9.0], [0.0, 0.0], [0.0, 0.0])):  # none, and one that ends
        _, found = predict(
            PredictionState(),
            PredictionEpoch(time_s=8.0, attitude=flying(), plan=missing, los_enu=los, mask=OPEN),
            params,
        )
        assert found.available
        assert found.restriction == ("no_plan" if needs_plan else "")


def test_degrees_are_not_an_attitude() -> None:
    assert not flying(bank_deg=math.degrees(20.0)).is_known  # 20 degrees, taken for radians
    assert not flying(roll_deg=math.degrees(30.0)).is_known


def test_the_bank_flown_tells_how_late_and_how_wrong() -> None:
    """A turn begun 1 s late and flown 4 degrees too steep: the likeliest of the grid's cells is within one of that."""
    params = PredictionParams()
    plan, state = rolling_plan(10.0, 40.0, 20.0), PredictionState()
    los = sky(8, lowest_deg=60.0)
    for k in range(150):
        time_s = 0.1 * k
        bank_deg = float(np.interp(time_s, [11.0, 13.2], [0.0, 44.0]))
        rate = 20.0 if 11.0 < time_s < 13.2 else 0.0
        epoch = PredictionEpoch(time_s=time_s, attitude=flying(bank_deg, rate), plan=plan, los_enu=los, mask=OPEN)
        state, _ = predict(state, epoch, params)
        if k in (122, 149):
            assert state.weights is not None
            assert state.weights.sum() == pytest.approx(1.0, abs=1e-9)
            ways = hypotheses_of("likely_loss", params)
            late, error = ways.values[int(state.weights[:-1].argmax()), :2]
            if k == 122:  # rolling
                assert late == pytest.approx(1.0, abs=0.75)
            else:
                assert math.degrees(error) == pytest.approx(4.0, abs=2.25)


def test_a_satellite_that_sets_is_not_counted_on() -> None:
    los = sky(4, lowest_deg=30.0)
    epoch = PredictionEpoch(
        time_s=0.0, attitude=flying(), plan=None, los_enu=los, mask=OPEN, setting=np.array([True, False, False, False])
    )
    _, found = predict(PredictionState(), epoch, PredictionParams(predictor="hold"))
    assert found.seen.all()
    assert found.caution
