"""Flags of flights whose flags are known, of thresholds that are published, and of what is not known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.flags.causes import Cause, Level
from gbas_airborne.abia.flags.epoch import Approach, FlagEpoch, Flags
from gbas_airborne.abia.flags.generator import FlagState, step
from gbas_airborne.abia.flags.hold import Held, held_levels
from gbas_airborne.abia.flags.params import FlagParams
from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.prediction.plan import Attitude, AttitudePlan
from gbas_airborne.abia.prediction.predictors import PredictionEpoch
from gbas_core.gnss.frames import ecef_from_geodetic, los_and_range, rot_enu_ecef
from gbas_core.satellites import CLOCK_GROUPS
from gbas_studies.abia.flights import nominal_positions_m

OPEN = MaskTable.open_sky(math.radians(5.0))
G = 9.80665


def directions(azimuth_deg: list[float], elevation_deg: list[float]) -> np.ndarray:
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.stack([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])


def level_plan(to_s: float = 1000.0) -> AttitudePlan:
    return AttitudePlan.from_points([-10.0, to_s], [0.0, 0.0], [0.0, 0.0])


def epoch_of(los: np.ndarray, *, time_s: float = 0.0, bank_rad: float = 0.0, heading_rad: float = 0.0,
             speed_mps: float = 100.0, plan: AttitudePlan | None = None) -> FlagEpoch:  # fmt: skip
    n = los.shape[1]
    attitude = Attitude(
        bank_rad=bank_rad, pitch_rad=0.0, heading_rad=heading_rad, roll_rate_radps=0.0, speed_mps=speed_mps
    )
    return FlagEpoch(
        ahead=PredictionEpoch(time_s=time_s, attitude=attitude, plan=plan, los_enu=los, mask=OPEN),
        cn0_dbhz=np.full(n, 45.0),
        acceleration_mps2=np.zeros(n),
        jerk_mps3=np.zeros(n),
        clock_groups=np.ones((1, n), dtype=bool),
    )


EIGHT = directions(
    [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0], [30.0, 60.0, 30.0, 60.0, 30.0, 60.0, 30.0, 60.0]
)


def once(epoch: FlagEpoch, params: FlagParams | None = None) -> Flags:
    return step(FlagState(), epoch, params or FlagParams())[1]


def test_a_day_straight_and_level_has_no_flag_of_masking() -> None:
    """Both nominal constellations in full, seen from Braunschweig every five minutes."""
    place = math.radians(52.3), math.radians(10.55)
    at, turned = ecef_from_geodetic(*place, 3000.0), rot_enu_ecef(*place)
    params = FlagParams(prediction=PredictionParams(required_satellites=5))
    for tow_s in range(0, 86_400, 300):
        los = turned @ los_and_range(at, nominal_positions_m(float(tow_s)))[0]
        epoch = epoch_of(los, plan=level_plan())
        flags = once(replace(epoch, clock_groups=CLOCK_GROUPS, cn0_dbhz=np.full(los.shape[1], 45.0)), params)
        assert flags.system[Cause.MASKING] == Level.CLEAR, tow_s
        assert flags.system[Cause.PREDICTION] == Level.CLEAR


def test_warnings_in_a_turn_are_a_revolution_apart() -> None:
    """Bank 40 degrees at 100 m/s: one satellite of four is low, and is lost once each turn of 360 degrees."""
    los = directions([0.0, 120.0, 240.0, 30.0], [80.0, 75.0, 78.0, 30.0])
    bank, speed = math.radians(40.0), 100.0
    rate = G * math.tan(bank) / speed
    plan = AttitudePlan.from_points([-10.0, 300.0], [bank, bank], [0.0, 0.0])
    state, levels = FlagState(), []
    for k in range(round(2.6 * 2.0 * math.pi / rate / 0.1)):
        at_s = 0.1 * k
        epoch = epoch_of(los, time_s=at_s, bank_rad=bank, heading_rad=rate * at_s, speed_mps=speed, plan=plan)
        state, flags = step(state, epoch, FlagParams())
        levels.append(flags.system[Cause.MASKING])
    masking = np.array(levels)
    onsets = np.flatnonzero((masking[1:] == Level.WARNING) & (masking[:-1] != Level.WARNING)) + 1
    assert onsets.size >= 2
    assert 0.1 * np.diff(onsets) == pytest.approx(2.0 * math.pi / rate, abs=2.0)
    for onset in onsets[1:]:  # and the caution is there for the whole horizon before
        assert (masking[onset - 45 : onset] == Level.CAUTION).all()


def test_a_warning_is_there_in_the_epoch_of_its_cause() -> None:
    los = directions([0.0, 120.0, 240.0, 270.0], [80.0, 75.0, 78.0, 30.0])
    state, plan = FlagState(), level_plan()
    state, flags = step(state, epoch_of(los, plan=plan), FlagParams())
    assert flags.system[Cause.MASKING] == Level.CLEAR
    # banked 30 degrees to the right the satellite in the west at 30 degrees is on the antenna's plane
    _, flags = step(state, epoch_of(los, time_s=0.1, bank_rad=math.radians(30.0), plan=plan), FlagParams())
    assert flags.system[Cause.MASKING] == Level.WARNING
    assert flags.time_to_warning_s[Cause.MASKING] == 0.0
    assert flags.satellites[Cause.MASKING].tolist() == [Level.CLEAR] * 3 + [Level.WARNING]


@pytest.mark.parametrize(
    ("cn0_dbhz", "level"), [(32.1, Level.CLEAR), (31.9, Level.CAUTION), (30.1, Level.CAUTION), (29.8, Level.WARNING)]
)
def test_signals_by_the_papers_criteria(cn0_dbhz: float, level: Level) -> None:
    """10 and 12 dB after correlation are 30 and 32 dB-Hz with the paper's receiver."""
    epoch = replace(epoch_of(EIGHT, plan=level_plan()), cn0_dbhz=np.full(8, cn0_dbhz))
    flags = once(epoch)
    assert (flags.satellites[Cause.SIGNAL] == level).all()
    assert flags.system[Cause.SIGNAL] == level


@pytest.mark.parametrize(("cn0_dbhz", "level"), [(28.10, Level.WARNING), (28.25, Level.CAUTION), (31.0, Level.CLEAR)])
def test_tracking_under_the_papers_jerk(cn0_dbhz: float, level: Level) -> None:
    """The phase loop's threshold is 28.16 dB-Hz at 18 Hz, 20 ms and 10 g/s; 5 % before it there is caution."""
    epoch = replace(epoch_of(EIGHT, plan=level_plan()), cn0_dbhz=np.full(8, cn0_dbhz), jerk_mps3=np.full(8, 98.0665))
    flags = once(epoch, FlagParams())
    assert (flags.satellites[Cause.TRACKING] == level).all()


def test_multipath_by_phase_and_error() -> None:
    epoch = epoch_of(EIGHT, plan=level_plan())
    assert Cause.MULTIPATH in once(epoch).unmonitored
    early_late, error_m = np.full(8, 0.05), np.full(8, 0.5)
    early_late[1], error_m[2], error_m[3] = -0.11, 1.01, math.nan
    flags = once(replace(epoch, early_late_rad=early_late, multipath_m=error_m))
    expected = [Level.CLEAR, Level.CAUTION, Level.WARNING, Level.CAUTION] + [Level.CLEAR] * 4
    assert flags.satellites[Cause.MULTIPATH].tolist() == expected
    assert Cause.MULTIPATH not in flags.unmonitored


def approach(**changes: float) -> Approach:
    values = {"vpl_m": 4.0, "lpl_m": 3.0, "val_m": 10.0, "lal_m": 40.0, "served": True, "course_rad": 0.0} | changes
    return Approach(**values)  # type: ignore[arg-type]


def test_levels_ahead_are_those_of_the_satellites_left() -> None:
    """A roll to 35 degrees hides the satellites in the west at 30: levels grow like the standard deviation without
    them, by normal equations written out here.
    """
    plan = AttitudePlan.from_points([-10.0, 1.0, 2.0, 60.0], np.radians([0.0, 0.0, 35.0, 35.0]), np.zeros(4))
    params = FlagParams(prediction=PredictionParams(predictor="plan", horizon_s=3.0))
    epoch = replace(epoch_of(EIGHT, plan=plan), sigma_m=np.full(8, 0.7), approach=approach())
    flags = once(epoch, params)

    def vertical(used: list[int]) -> float:
        design = np.column_stack([EIGHT.T[used], np.ones(len(used))])
        covariance = np.linalg.inv(design.T @ design)
        along = np.array(
            [0.0, math.tan(math.radians(3.0)), 1.0, 0.0]
        )  # flying north: up, and forward by the glide path
        return math.sqrt(along @ covariance @ along)

    hidden = [i for i in range(8) if i not in (6,)]
    assert flags.predicted_vpl_m == pytest.approx(4.0 * vertical(hidden) / vertical(list(range(8))), rel=1e-9)
    assert flags.system[Cause.PROTECTION] == Level.CLEAR
    tight = once(replace(epoch, approach=approach(val_m=flags.predicted_vpl_m - 1e-6)), params)
    assert tight.system[Cause.PROTECTION] == Level.CAUTION
    assert 1.0 < tight.time_to_warning_s[Cause.PROTECTION] <= 2.0
    assert once(replace(epoch, approach=approach(val_m=3.9)), params).system[Cause.PROTECTION] == Level.WARNING


def test_an_approach_without_service_or_level_warns() -> None:
    epoch = epoch_of(EIGHT, plan=level_plan())
    assert set(once(epoch).unmonitored) >= {Cause.PROTECTION, Cause.SERVICE}
    assert once(replace(epoch, approach=approach(served=False))).system[Cause.SERVICE] == Level.WARNING
    assert once(replace(epoch, approach=approach(vpl_m=math.nan))).system[Cause.PROTECTION] == Level.WARNING
    # levels ahead cannot be predicted without sigmas: that is not quiet
    assert once(replace(epoch, approach=approach())).system[Cause.PROTECTION] == Level.CAUTION


def test_what_is_not_known_is_not_quiet() -> None:
    unknown = once(epoch_of(EIGHT, bank_rad=math.nan, plan=level_plan()))
    assert unknown.system[Cause.PREDICTION] == Level.CAUTION
    assert unknown.system[Cause.MASKING] == Level.WARNING
    assert np.isnan(unknown.time_to_warning_s[Cause.MASKING]) or unknown.time_to_warning_s[Cause.MASKING] == 0.0
    assert once(epoch_of(EIGHT)).system[Cause.PREDICTION] == Level.CAUTION  # no plan
    nothing = once(epoch_of(np.full((3, 8), np.nan), plan=level_plan()))
    assert nothing.system[Cause.PREDICTION] == Level.CAUTION
    assert nothing.level == Level.WARNING
    lost = replace(epoch_of(EIGHT, plan=level_plan()), cn0_dbhz=np.full(8, np.nan))
    assert once(lost).system[Cause.SIGNAL] == Level.WARNING


def test_holding_never_delays_a_warning() -> None:
    rng = np.random.default_rng(1)
    raw = rng.integers(0, 3, (200, 5))
    params = FlagParams(caution_wait_s=0.5)
    state = Held.nothing((5,))
    for k in range(200):
        state, level = held_levels(state, raw[k], rng.random(5) < 0.1, 0.1, params)
        assert (level[raw[k] == Level.WARNING] == Level.WARNING).all()


def test_cautions_wait_unless_urgent_and_stay_for_a_while() -> None:
    params = FlagParams(caution_wait_s=0.3, caution_hold_s=0.5)
    state, found = Held.nothing((2,)), []
    for k in range(20):
        raw = np.full(2, Level.CAUTION if 2 <= k < 8 else Level.CLEAR)
        state, level = held_levels(state, raw, np.array([False, True]), 0.1, params)
        found.append(level)
    raised = [np.flatnonzero(np.array(found)[:, i]).tolist() for i in range(2)]
    assert raised == [list(range(5, 13)), list(range(2, 13))]  # 0.3 s later, or at once; 0.5 s longer


def test_waiting_longer_than_the_horizon_allows_is_refused() -> None:
    with pytest.raises(ValueError, match="above the horizon"):
        FlagParams(caution_wait_s=3.0)
