"""Every processing mode: position without errors, weights and S by dense matrices, levels, families of sigmas."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import dense_modes as dense
from airborne_world import GPA_RAD, above, fas_data_set, position_of
from gbas_airborne import receiver
from gbas_airborne.params import AirborneParams, ServiceDParams
from gbas_airborne.receiver import AirborneOutput, AirborneReceiver, AirborneState
from gbas_airborne.reception.columns import B_VALUES
from gbas_airborne.reception.station_data import final_approach
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_msgs_py.codes import ServiceCause, ServiceType, Signal
from gbas_msgs_py.modes import COMBINATIONS, MODES, Mode, mode_of
from modes_world import P_D, SIGMA_30_M, SIGMA_D_M, SIGMA_L5_M, ModesWorld, receive_l5

SPEED_MPS = 70.0
LAST_S = 15.0
FAST = ServiceDParams(divergence_settle_s=5.0, step_in_s=1.0)
PARAMS = AirborneParams(
    settle_s=5.0, inflate_unsettled=False, modes=("all",), authentication=True, gast_d=FAST, speed_history_s=0.0,
    max_speed_mps=SPEED_MPS,
)  # fmt: skip
APPROACH = replace(PARAMS, rpds=5)
FAS = final_approach(fas_data_set(apd=2, rpi="AEDV"))


def along(t: float) -> np.ndarray:
    """On the path, towards the threshold."""
    distance = 6000.0 - SPEED_MPS * t
    return FAS.ecef_from_approach(np.array([-distance, 0.0, float(FAS.path_height_m(distance))]))


def world(**changes: object) -> ModesWorld:
    return ModesWorld(path=along, approaches=(fas_data_set(apd=2, rpi="AEDV"),), **changes)


def fly(seen: ModesWorld, params: AirborneParams, last_s: float = LAST_S) -> list[AirborneOutput]:
    state, outputs = AirborneState(), []
    for k in range(1 + round(2.0 * last_s)):
        state, output = AirborneReceiver.step(state, seen.epoch(0.5 * k), params)
        outputs.append(output)
    return outputs


@pytest.fixture(scope="module", params=[PARAMS, APPROACH], ids=["no approach", "approach"])
def flown(request: pytest.FixtureRequest) -> tuple[ModesWorld, AirborneParams, AirborneOutput]:
    """The last epoch of a flight in which every mode runs."""
    seen = world()
    with pytest.MonkeyPatch.context() as patch:
        receive_l5(patch, seen)
        return seen, request.param, fly(seen, request.param)[-1]


def test_every_mode_is_where_the_aircraft_is(flown: tuple[ModesWorld, AirborneParams, AirborneOutput]) -> None:
    seen, _, output = flown
    place = seen.path(LAST_S - seen.clock_m(LAST_S) / SPEED_OF_LIGHT_MPS)
    assert len(output.solutions) == len(MODES) == 18
    for solution in output.solutions:
        # nothing errs: what is left are steps that end within 5 cm, of geometries that amplify little
        assert np.linalg.norm(position_of(solution) - place) < 1e-3, mode_of(solution.mode).name
    assert {int(p.service) for p in output.protections} == set(ServiceType) - {ServiceType.NONE}


def geometry(seen: ModesWorld, solution, params: AirborneParams) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Places of the used satellites; their lines of sight in the frame of the levels; elevations; distance."""
    week, tow_s = seen.time(LAST_S)
    place = position_of(solution)
    late_s = seen.clock_m(LAST_S) / SPEED_OF_LIGHT_MPS
    satellite = predicted_state(seen.truth, week, tow_s - late_s, place)
    _, los = rotated_range(place, satellite.position_m)
    lat, lon, _ = geodetic_from_ecef(place)
    enu = rot_enu_ecef(lat, lon) @ los
    frame = np.vstack([enu[1], -enu[0], enu[2]])
    if params.rpds >= 0:
        frame = FAS.rot_approach_ecef @ los
    used = np.flatnonzero(np.isfinite(solution.s_vert))
    distance_m = float(np.linalg.norm(place - above(0.0)))
    return used, frame[:, used], np.arcsin(enu[2, used]), distance_m


def sigmas(mode: Mode, theta: np.ndarray, distance_m: float) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Parts of the levels' sigmas and the ground and airborne part of the weights', from the published formulas."""
    degrees, tau = np.degrees(theta), mode.smoothing_s
    iono = dense.iono(theta, 4e-6, distance_m, SPEED_MPS, tau)
    one, gamma = np.ones_like(theta), (154.0 / 115.0) ** 2
    if mode.service is ServiceType.C:
        gnd, air = 0.2 * one, dense.air_l1(degrees, 100.0)
        weights = gnd, air
    elif mode.service is ServiceType.D:
        # the gradient is that of GAST-D, over 100 s
        iono = dense.iono(theta, 3e-6, distance_m, SPEED_MPS, 100.0)
        gnd, air = SIGMA_D_M * one, dense.air_l1(degrees, 100.0)
        weights = SIGMA_30_M * one, dense.air_l1(degrees, 30.0)
    elif mode.signal is Signal.L5:
        gnd, air, iono = SIGMA_L5_M * one, dense.air_l5(degrees, tau), gamma * iono
        weights = gnd, air
    else:
        l1_m = 0.2 if tau == 100.0 else SIGMA_30_M
        gnd = np.hypot(dense.IF_1 * l1_m, dense.IF_5 * SIGMA_L5_M) * one
        air = np.hypot(dense.IF_1 * dense.air_l1(degrees, tau), dense.IF_5 * dense.air_l5(degrees, tau))
        iono = 0.0 * iono
        weights = gnd, air
    return {"sigma_gnd_m": gnd, "sigma_air_m": air, "sigma_iono_m": iono}, np.hypot(*weights)


def test_weights_and_projections_by_dense_matrices(flown: tuple[ModesWorld, AirborneParams, AirborneOutput]) -> None:
    seen, params, output = flown
    tan_gpa = math.tan(GPA_RAD) if params.rpds >= 0 else 0.0
    for solution in output.solutions:
        mode = mode_of(solution.mode)
        used, los, theta, distance_m = geometry(seen, solution, params)
        levels, weight = sigmas(mode, theta, distance_m)
        for name, expected in levels.items():
            # fields of messages are rounded before both; 1e-6: the last step moved the aircraft by up to 5 cm
            np.testing.assert_allclose(
                getattr(solution, name)[used], expected, rtol=2e-5, err_msg=f"{mode.name} {name}"
            )
        tropo_m, iono_m = solution.sigma_tropo_m[used], levels["sigma_iono_m"]
        total = np.sqrt(weight**2 + tropo_m**2 + iono_m**2)
        s = dense.projection(los, total, CLOCK_GROUPS[:, used].astype(float))
        np.testing.assert_allclose(solution.s_vert[used], s[2] + tan_gpa * s[0], atol=1e-5, err_msg=mode.name)
        np.testing.assert_allclose(solution.s_lat[used], s[1], atol=1e-5, err_msg=mode.name)
        assert set(mode.systems) == {"GE"[int(number >= 32)] for number in used}


def test_levels_are_of_the_services_multipliers(flown: tuple[ModesWorld, AirborneParams, AirborneOutput]) -> None:
    """K_ffmd of four receivers is 5.847 (Annex 10) and 6.673 for GAST-D; P of the orbit is that of the service."""
    _, _, output = flown
    for solution, protection in zip(output.solutions, output.protections, strict=True):
        mode = mode_of(solution.mode)
        used = np.isfinite(solution.s_vert)
        variance = (
            solution.sigma_gnd_m**2 + solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2
        )
        sigma = math.sqrt(float((solution.s_vert[used] ** 2 * variance[used]).sum()))
        service_d = mode.service is ServiceType.D
        apart_m = solution.d_vert_m
        # the published multipliers have four digits
        assert (protection.vpl_h0_m - apart_m) / sigma == pytest.approx(6.673 if service_d else 5.847, abs=5e-4)
        assert apart_m == pytest.approx(0.0, abs=1e-6)
        p = P_D if service_d else 2e-4
        k_md_e = 5.1 if service_d else 5.0
        bound = (np.abs(solution.s_vert[used]) * np.linalg.norm(position_of(solution) - above(0.0)) * p).max()
        assert protection.veb_m == pytest.approx(bound + k_md_e * sigma, rel=1e-4)


def test_the_table_has_a_row_a_mode(flown: tuple[ModesWorld, AirborneParams, AirborneOutput]) -> None:
    _, _, output = flown
    table = output.modes
    assert table is not None
    by_number = {int(s.mode): (s, p) for s, p in zip(output.solutions, output.protections, strict=True)}
    assert sorted(table.mode.tolist()) == sorted(by_number)
    for row, number in enumerate(table.mode.tolist()):
        solution, protection = by_number[int(number)]
        assert (table.x_m[row], table.vpl_m[row], table.lpl_m[row]) == (
            solution.x_m,
            protection.vpl_m,
            protection.lpl_m,
        )
        assert (table.service[row], table.cause[row]) == (protection.service, ServiceCause.NONE)
        assert table.guides[row] == float(number == 1.0)


def test_other_modes_change_nothing_of_the_one_that_guides() -> None:
    seen = world()
    alone = fly(seen, replace(APPROACH, modes=()), 8.0)
    beside = fly(world(), replace(APPROACH, modes=("l1_30", "l5_30")), 8.0)
    for one, both in zip(alone, beside, strict=True):
        assert len(one.solutions) == 1
        for name in vars(one.solutions[0]):
            np.testing.assert_array_equal(getattr(one.solutions[0], name), getattr(both.solutions[0], name))
        for name in vars(one.protections[0]):
            np.testing.assert_array_equal(getattr(one.protections[0], name), getattr(both.protections[0], name))


def test_modes_whose_corrections_are_not_sent_say_so() -> None:
    output = fly(world(), replace(APPROACH, modes=("l5_100", "if_30")), 8.0)[-1]
    table = output.modes
    assert table is not None
    cause = dict(zip(table.mode.tolist(), table.cause.tolist(), strict=True))
    assert cause == {1.0: ServiceCause.NONE, 3.0: ServiceCause.NO_CORRECTIONS, 6.0: ServiceCause.NO_CORRECTIONS}
    assert np.isnan(table.vpl_m[table.cause != ServiceCause.NONE]).all()


def test_weights_of_gast_d_may_be_those_of_the_levels() -> None:
    """Then S is that of 100 s sigmas."""
    seen = world()
    params = replace(PARAMS, modes=("l1_30",), gast_d=replace(FAST, weights="100 s"))
    output = fly(seen, params)[-1]
    solution = next(each for each in output.solutions if mode_of(each.mode).service is ServiceType.D)
    used, los, _, _ = geometry(seen, solution, params)
    variance = solution.sigma_gnd_m**2 + solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2
    s = dense.projection(los, np.sqrt(variance[used]), CLOCK_GROUPS[:, used].astype(float))
    np.testing.assert_allclose(solution.s_vert[used], s[2], atol=1e-5)


@pytest.mark.parametrize("gradient_mps", [0.05, -0.2])
def test_ionosphere_moves_single_frequencies_and_not_the_combination(
    monkeypatch: pytest.MonkeyPatch, gradient_mps: float
) -> None:
    """A delay that grows on every second satellite: L5 errs 1.793 times as much as L1, the combination not at all."""
    uneven = np.arange(N_SATS) % 2 == 0
    seen = world(iono_m=lambda t: np.where(uneven, gradient_mps * t, 0.0))
    receive_l5(monkeypatch, seen)
    params = replace(PARAMS, gast_d=replace(FAST, divergence_mps=1.0, dual_solution_m=100.0))
    output = fly(seen, params)[-1]
    place = seen.path(LAST_S - seen.clock_m(LAST_S) / SPEED_OF_LIGHT_MPS)
    for solution in output.solutions:
        mode, used = mode_of(solution.mode), np.isfinite(solution.s_vert)
        lat, lon, _ = geodetic_from_ecef(place)
        up_m = float((rot_enu_ecef(lat, lon) @ (position_of(solution) - place))[2])
        # 31 epochs of a filter that is filling: the mean of (t_k) codes on the carrier's (t - t_k), from 0 to 15 s
        smoothed = _ramp_error(gradient_mps, mode.smoothing_s)
        factor = {Signal.L1: 1.0, Signal.L5: (154.0 / 115.0) ** 2, Signal.L1_L5: 0.0}[mode.signal]
        expected = factor * float((solution.s_vert[used] * np.where(uneven, smoothed, 0.0)[used]).sum())
        assert up_m == pytest.approx(expected, abs=2e-3), mode.name


def _ramp_error(gradient_mps: float, tau_s: float) -> float:
    """Error at LAST_S of a Hatch filter whose code errs by +I and whose carrier by -I, I a ramp from the start."""
    error = 0.0
    for n in range(1, 1 + round(2.0 * LAST_S)):
        weight = max(1.0 / (n + 1), 0.5 / tau_s)
        error = weight * gradient_mps * 0.5 * n + (1.0 - weight) * (error - gradient_mps * 0.5)
    return error


def test_combining_after_smoothing_is_smoothing_the_combination() -> None:
    """What the air forms of single-frequency corrections is what the ground would form: below 1 mm (statement 6).

    The filter is linear; the two orders differ by rounding of numbers of 2e7 m.
    """
    rng = np.random.default_rng(5)
    (_, a1), (_, a5) = COMBINATIONS[Signal.L1_L5]
    assert (a1, a5) == pytest.approx((2.26060, -1.26060), abs=5e-6)  # gbas_facts, published
    for tau_s in (100.0, 30.0):
        params = SmoothingParams(tau_s=(tau_s,))
        states = [initial_smoothing(params) for _ in range(3)]
        for k in range(400):
            true = 2.2e7 + 500.0 * 0.5 * k + rng.normal(size=N_SATS)
            iono = 5.0 + 0.02 * k
            code1, code5 = (true + g * iono + rng.normal(size=N_SATS) for g in (1.0, 1.79327))
            phase1, phase5 = true - iono, true - 1.79327 * iono
            given = ((code1, phase1), (code5, phase5), (a1 * code1 + a5 * code5, a1 * phase1 + a5 * phase5))
            smoothed = []
            for place, (code, phase) in enumerate(given):
                states[place], out = smooth_step(states[place], code, phase, np.zeros(N_SATS, bool), 0.5, params)
                smoothed.append(out[0])
        assert np.abs(a1 * smoothed[0] + a5 * smoothed[1] - smoothed[2]).max() < 1e-6


def test_without_the_second_frequency_the_next_mode_guides(monkeypatch: pytest.MonkeyPatch) -> None:
    """IF, then L5, then C: what a mode lacks is the cause of the event of the one that guides instead."""
    seen = world(sends_l5=lambda t: t < 10.0)
    receive_l5(monkeypatch, seen)
    outputs = fly(seen, replace(APPROACH, service="IF-30", modes=()), 12.0)
    services = [int(output.protections[0].service) for output in outputs]
    assert services[19] == ServiceType.IF_30  # 9.5 s
    assert services[20:] == [ServiceType.C] * 5
    assert all(output.protections[0].alert == 0.0 for output in outputs[19:])
    event = next(e for e in outputs[20].events if e.subject.startswith("guidance/"))
    assert (event.subject, event.cause) == ("guidance/l1_100", "no_corrections")
    alone = fly(seen, replace(APPROACH, service="IF-30", modes=(), fallback=False), 12.0)
    assert [int(output.protections[0].service) for output in alone][20:] == [ServiceType.NONE] * 5


def test_b_values_of_a_combination_are_combined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Receiver 1 is off on L1, receiver 2 on L5; a satellite with other receivers on L5 is in no combination."""
    seen = world(b_values_m=lambda s: (0.3, -0.1, -0.1, -0.1))
    other = seen.satellites[0]
    receive_l5(monkeypatch, seen)
    with_l1 = receiver.receive

    def with_b(state, epoch, params):
        state, received = with_l1(state, epoch, params)
        sets = dict(received.corrections)
        for name in ("l5_100", "l5_30"):
            if name in sets:
                columns = sets[name].columns.copy()
                columns[B_VALUES:] = np.array([-0.05, 0.15, -0.05, -0.05])[:, np.newaxis]
                columns[B_VALUES + 3, other] = np.nan
                sets[name] = replace(sets[name], columns=columns)
        return state, replace(received, corrections=sets)

    monkeypatch.setattr(receiver, "receive", with_b)
    output = fly(seen, PARAMS)[-1]
    for solution, protection in zip(output.solutions, output.protections, strict=True):
        if mode_of(solution.mode).signal is not Signal.L1_L5:
            continue
        used = np.flatnonzero(np.isfinite(solution.s_vert))
        assert other not in used
        expected = dense.IF_1 * np.array([0.3, -0.1, -0.1, -0.1]) + dense.IF_5 * np.array([-0.05, 0.15, -0.05, -0.05])
        for satellite in used:
            np.testing.assert_allclose(solution.b_m[:, satellite], expected, rtol=1e-12)
        # H1 of the worst receiver, by the published formula and K_md of four receivers
        s, sigma_gnd = solution.s_vert[used], solution.sigma_gnd_m[used]
        rest = solution.sigma_air_m[used] ** 2 + solution.sigma_tropo_m[used] ** 2 + solution.sigma_iono_m[used] ** 2
        spread = math.sqrt(float((s**2 * (4.0 / 3.0 * sigma_gnd**2 + rest)).sum()))
        h1 = max(abs(float((s * value).sum())) + 2.878 * spread for value in expected)
        assert protection.vpl_h1_m == pytest.approx(h1, rel=2e-4)  # the multiplier has four digits
