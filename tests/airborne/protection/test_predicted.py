"""Predicted levels along a planned path: those that are then flown, and what is lost on the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import REFERENCE_ECEF_M, constellation, fas_data_set, position_of
from gbas_airborne.params import AirborneParams, ServiceDParams
from gbas_airborne.protection.predicted import (
    ExpectedStation,
    Planned,
    critical_satellites,
    lost_by_type5,
    path_along,
    predicted_levels,
)
from gbas_airborne.receiver import AirborneReceiver, AirborneState
from gbas_airborne.reception.station_data import final_approach
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import ServiceType
from gbas_msgs_py.modes import MODES, Mode, mode_of
from gbas_vdb.messages.types import PredictedSource, Type5
from modes_world import P_D, SIGMA_30_M, SIGMA_D_M, SIGMA_L5_M, ModesWorld, receive_l5

SPEED_MPS = 70.0
LAST_S = 12.0
BEGIN_M = 6000.0
FAS_D = fas_data_set(apd=2, rpi="AEDV")
FAS = final_approach(FAS_D)
PARAMS = AirborneParams(
    settle_s=5.0, inflate_unsettled=False, modes=("all",), authentication=True, rpds=5, max_speed_mps=SPEED_MPS,
    speed_history_s=0.0, gast_d=ServiceDParams(divergence_settle_s=5.0, step_in_s=0.0),
)  # fmt: skip


def expected_station(mode: Mode) -> ExpectedStation:
    """What the small world's station sends for a mode."""
    service_d = mode.service is ServiceType.D
    sizes = {"l1_100": 0.2, "l1_30": SIGMA_30_M, "l1_100_d": SIGMA_D_M, "l5_100": SIGMA_L5_M, "l5_30": SIGMA_L5_M}
    return ExpectedStation(
        reference_m=REFERENCE_ECEF_M,
        n_receivers=4,
        sigma_gnd_m={name: np.full(N_SATS, size) for name, size in sizes.items()},
        sigma_vig=3e-6 if service_d else 4e-6,
        refractivity_uncertainty=20.0,
        scale_height_m=7900.0,
        p=P_D if service_d else 2e-4,
        k_md_e=5.1 if service_d else 5.0,
    )


def planned(
    mode: Mode = MODES[0], distances_m: tuple[float, ...] = (6000.0, 4000.0, 2000.0), **lost: object
) -> Planned:
    world = ModesWorld()
    path = path_along(FAS, world.week, world.start_s, distances_m, SPEED_MPS)
    return Planned(replace(path, **lost), constellation(), expected_station(mode), mode, PARAMS, FAS)


def test_what_is_predicted_is_what_is_flown() -> None:
    """Every mode, at place and time of a flight without errors; sigmas are made there from nothing of the flight."""
    world = ModesWorld(path=lambda t: FAS.position_on_path(BEGIN_M - SPEED_MPS * t), approaches=(FAS_D,))
    state = AirborneState()
    with pytest.MonkeyPatch.context() as patch:
        receive_l5(patch, world)
        for k in range(1 + round(2.0 * LAST_S)):
            state, output = AirborneReceiver.step(state, world.epoch(0.5 * k), PARAMS)
    late_s = world.clock_m(LAST_S) / SPEED_OF_LIGHT_MPS
    lost = ~np.isin(np.arange(N_SATS), world.satellites)[np.newaxis]
    for solution, protection in zip(output.solutions, output.protections, strict=True):
        mode = mode_of(solution.mode)
        path = path_along(FAS, world.week, world.start_s + LAST_S - late_s, (BEGIN_M - SPEED_MPS * LAST_S,), SPEED_MPS)
        path = replace(path, position_m=position_of(solution)[np.newaxis], lost=lost)
        found = predicted_levels(Planned(path, world.truth, expected_station(mode), mode, PARAMS, FAS))
        np.testing.assert_array_equal(found.used[0], np.isfinite(solution.s_vert))
        # D_V is zero to 1e-6; the flight's sigmas are those of up to 5 cm beside
        for name, flown in (("pvpl_m", "vpl_m"), ("plpl_m", "lpl_m"), ("veb_m", "veb_m"), ("leb_m", "leb_m")):
            assert getattr(found, name)[0] == pytest.approx(getattr(protection, flown), rel=1e-5), (mode.name, name)
        assert (found.val_m[0], found.lal_m[0]) == pytest.approx((protection.val_m, protection.lal_m), rel=1e-6)


def test_limits_along_the_path_are_the_published_ones() -> None:
    """FASVAL 10 m and FASLAL 40 m: 43.35 m and 69.15 m far out, the sloping parts between, the least at the end."""
    distances = (20000.0, 7000.0, 3000.0, 870.0, 500.0)
    found = predicted_levels(planned(distances_m=distances))
    feet = np.array([float(FAS.path_height_m(d)) for d in distances]) / 0.3048
    val = np.where(feet > 1340.0, 43.35, np.where(feet > 200.0, 0.02925 * feet + 10.0 - 5.85, 10.0))
    lal = [69.15, 0.0044 * 7000.0 + 40.0 - 3.85, 0.0044 * 3000.0 + 40.0 - 3.85, 40.0, 40.0]
    np.testing.assert_allclose(found.val_m, val, atol=1e-3)
    np.testing.assert_allclose(found.lal_m, lal, atol=1e-3)  # the approach is rounded as its message is
    assert found.available.all()


def test_a_lost_satellite_is_not_used_from_its_time_on() -> None:
    whole = predicted_levels(planned())
    victim = int(np.flatnonzero(whole.used.all(axis=0))[0])
    lost = np.zeros((3, N_SATS), dtype=bool)
    lost[1:, victim] = True
    found = predicted_levels(planned(lost=lost))
    assert found.used[:, victim].tolist() == [True, False, False]
    assert found.pvpl_m[0] == whole.pvpl_m[0]
    assert (found.pvpl_m[1:] > whole.pvpl_m[1:]).all()


def test_with_too_few_satellites_nothing_is_predicted() -> None:
    whole = predicted_levels(planned())
    lost = np.zeros((3, N_SATS), dtype=bool)
    lost[1, np.flatnonzero(whole.used[1])[3:]] = True  # a position needs four
    found = predicted_levels(planned(lost=lost))
    assert np.isfinite(found.pvpl_m).tolist() == [True, False, True]
    assert not found.available[1]
    assert not found.used[1].any()


def test_what_the_station_says_it_will_lose() -> None:
    """G05 ceases after 60 s, G06 starts after 120 s, E03 ceases after "1270 s or more", G08 starts then: not known."""
    message = Type5(
        modified_z_count_s=0.0,
        sources=(
            PredictedSource(ranging_source_id=5, becomes_available=False, duration_s=60.0),
            PredictedSource(ranging_source_id=6, becomes_available=True, duration_s=120.0),
            PredictedSource(ranging_source_id=73, becomes_available=False, duration_s=1270.0),
            PredictedSource(ranging_source_id=8, becomes_available=True, duration_s=1270.0),
            PredictedSource(ranging_source_id=255, becomes_available=False, duration_s=0.0),
        ),
    )
    lost = lost_by_type5(message, np.array([0.0, 60.0, 119.0, 120.0, 2000.0]))
    assert lost[:, SAT_INDEX["G05"]].tolist() == [False, True, True, True, True]
    assert lost[:, SAT_INDEX["G06"]].tolist() == [True, True, True, False, False]
    assert not lost[:, SAT_INDEX["E03"]].any()
    assert lost[:, SAT_INDEX["G08"]].all()
    assert lost.any(axis=0).sum() == 3


def test_the_satellites_an_approach_hangs_on() -> None:
    """With all there is none; with as many as there are unknowns each is critical."""
    assert not critical_satellites(planned(distances_m=(3000.0,))).any()
    used = predicted_levels(planned(distances_m=(3000.0,))).used[0]
    gps = np.flatnonzero(used[:32])
    keep = gps[:5]
    lost = np.ones((1, N_SATS), dtype=bool)
    lost[0, keep] = False
    few = planned(distances_m=(3000.0,), lost=lost)
    critical = np.flatnonzero(critical_satellites(few)).tolist()
    vpl_m = float(predicted_levels(few).pvpl_m[0])
    assert math.isfinite(vpl_m)
    # four satellites for four unknowns: far beyond any limit, or no position
    assert set(critical) <= set(keep.tolist())
    assert critical


def test_a_path_that_does_not_come_nearer_is_refused() -> None:
    with pytest.raises(ValueError, match="have to fall"):
        path_along(FAS, 2300, 0.0, (1000.0, 2000.0), SPEED_MPS)
