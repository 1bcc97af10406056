"""GAST-D in the air: monitors, what they leave out, and steps down with cause, value and bound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import fas_data_set
from gbas_airborne.params import AirborneParams, ServiceDParams
from gbas_airborne.receiver import AirborneOutput, AirborneReceiver, AirborneState
from gbas_airborne.reception.station_data import final_approach
from gbas_core.satellites import N_SATS, SAT_IDS
from gbas_msgs_py.codes import EventKind, Rejection, ServiceCause, ServiceType
from gbas_msgs_py.events import Event
from gbas_msgs_py.modes import mode_of
from modes_world import ADB3, SIGMA_D_M, ModesWorld, service_d_data

SETTLE_S = 5.0
SPEED_MPS = 70.0
FAST = ServiceDParams(divergence_settle_s=SETTLE_S, step_in_s=0.0)
PARAMS = AirborneParams(
    service="D", settle_s=SETTLE_S, inflate_unsettled=False, authentication=True, gast_d=FAST, rpds=5
)
BEGIN_S = 12.0
FAS_D = fas_data_set(apd=2, rpi="AEDV")
FAS = final_approach(FAS_D)


class Approach:
    """A flight down the path from a distance, kept epoch by epoch."""

    def __init__(self, params: AirborneParams = PARAMS, *, distance_m: float = 9000.0, **world: object) -> None:
        def path(t: float) -> np.ndarray:
            along = distance_m - SPEED_MPS * t
            return FAS.ecef_from_approach(np.array([-along, 0.0, float(FAS.path_height_m(along))]))

        self.params = params
        self.world = ModesWorld(path=path, approaches=(FAS_D,), **world)
        self.state, self.t = AirborneState(), 0.0
        self.outputs: list[AirborneOutput] = []
        self.events: list[Event] = []

    def run(self, until_s: float) -> AirborneOutput:
        while self.t < until_s:
            self.step()
        return self.outputs[-1]

    def step(self, **changes: object) -> AirborneOutput:
        self.state, output = AirborneReceiver.step(self.state, self.world.epoch(self.t, **changes), self.params)
        self.t += 0.5
        self.outputs.append(output)
        self.events += output.events
        return output

    @property
    def services(self) -> list[ServiceType]:
        """Services in their order."""
        found = [ServiceType(int(output.protections[0].service)) for output in self.outputs]
        return [service for k, service in enumerate(found) if k == 0 or service != found[k - 1]]

    def cause(self, service: ServiceType = ServiceType.D) -> ServiceCause:
        """Why the mode of a service does not serve at the last epoch."""
        table = self.outputs[-1].modes
        assert table is not None
        row = [mode_of(number).service for number in table.mode.tolist()].index(service)
        return ServiceCause(int(table.cause[row]))

    def told(self, subject: str, cause: str) -> Event:
        """The last event of a subject and cause."""
        return [event for event in self.events if (event.subject, event.cause) == (subject, cause)][-1]


def serving() -> Approach:
    flight = Approach()
    output = flight.run(BEGIN_S)
    assert output.protections[0].service == ServiceType.D
    assert output.protections[0].alert == 0.0
    return flight


def test_it_serves_and_says_so() -> None:
    flight = serving()
    assert flight.services == [ServiceType.NONE, ServiceType.D]
    assert mode_of(flight.outputs[-1].solutions[0].mode).name == "l1_30"
    assert flight.outputs[-1].solutions[0].d_vert_m == pytest.approx(0.0, abs=1e-6)


# --- messages


@pytest.mark.parametrize(("distance_m", "height_ft", "timeout_s"), [(9000.0, 1000.0, 3.5), (1750.0, 150.0, 1.5)])
def test_without_type_11_it_falls_back_when_the_time_is_over(
    distance_m: float, height_ft: float, timeout_s: float
) -> None:
    """3.5 s above 200 ft and 1.5 s below; type 1 goes on, so GAST-C takes over at the same epoch."""
    flight = Approach(distance_m=distance_m)
    flight.run(BEGIN_S)
    flight.world.sends_type11 = lambda t: False
    for k in range(1, 9):
        output = flight.step()
        late = 0.5 * k > timeout_s
        assert output.protections[0].service == (ServiceType.C if late else ServiceType.D)
        assert output.protections[0].alert == 0.0
    assert output.solutions[0].height_above_ltp_m < height_ft * 0.3048 * 2.0
    assert flight.cause() is ServiceCause.MT11_TIMEOUT
    event = flight.told("guidance/l1_100", "mt11_timeout")
    assert (event.kind, event.value, event.threshold) == (EventKind.SERVICE, timeout_s + 0.5, timeout_s)


def test_without_any_message_there_is_none() -> None:
    flight = serving()
    for _ in range(9):
        flight.step(bursts=())
    assert flight.services == [ServiceType.NONE, ServiceType.D, ServiceType.NONE]
    assert flight.told("navigation", "mt1_timeout").threshold == 3.5


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"adb3": None}, ServiceCause.NO_SERVICE_D_DATA),
        ({"adb3": replace(ADB3, k_md_e_d_gps=0.0)}, ServiceCause.NO_SERVICE_D_DATA),
        ({"gcid": 1}, ServiceCause.STATION_NOT_FOR_SERVICE),
    ],
)
def test_what_the_station_no_longer_claims_is_over_at_once(changes: dict[str, object], cause: ServiceCause) -> None:
    flight = serving()
    flight.world.station_message = service_d_data(**changes)
    output = flight.step()
    assert output.protections[0].service == ServiceType.C
    assert flight.cause() is cause
    assert flight.told("guidance/l1_100", cause.word).kind is EventKind.SERVICE


def test_an_unhealthy_station_ends_both() -> None:
    flight = serving()
    flight.world.station_message = service_d_data(gcid=7)
    assert flight.step().protections[0].service == ServiceType.NONE
    assert flight.cause(ServiceType.C) is ServiceCause.STATION_UNHEALTHY


def test_an_approach_that_is_not_for_it() -> None:
    flight = Approach()
    flight.world.approaches = (fas_data_set(apd=1, rpi="AEDV"),)
    flight.run(BEGIN_S)
    assert flight.services == [ServiceType.NONE, ServiceType.C]
    assert flight.cause() is ServiceCause.APPROACH_NOT_FOR_SERVICE


def test_without_authentication_there_is_only_c() -> None:
    flight = Approach(replace(PARAMS, authentication=False))
    assert flight.run(BEGIN_S).protections[0].service == ServiceType.C
    assert flight.cause() is ServiceCause.NOT_AUTHENTICATED


def test_type_11_of_another_instant_or_half_a_pair_adds_nothing() -> None:
    """Messages are kept until the next good ones, and no longer than the time-out."""
    flight = serving()
    for drop in ("half", "old"):
        for k in range(1, 9):
            bursts = flight.world.bursts(flight.t)
            if drop == "half":
                assert len(flight.world.type11(flight.t)) == 1
                bursts = tuple(burst for burst in bursts if burst.slot != 2)
            else:
                old = [burst for burst in flight.world.bursts(flight.t - 20.0) if burst.slot == 2]
                week, tow_s = flight.world.time(flight.t)
                old = [replace(burst, gps_week=week, tow_s=tow_s) for burst in old]
                bursts = (*(burst for burst in bursts if burst.slot != 2), *old)
            output = flight.step(bursts=bursts)
            assert (output.protections[0].service == ServiceType.D) == (0.5 * k <= 3.5)
        flight.run(flight.t + 1.0)
        assert flight.outputs[-1].protections[0].service == ServiceType.D


# --- stepping up again


@pytest.mark.parametrize(("gate_m", "comes_back"), [(100.0, True), (20000.0, False)])
def test_no_better_service_inside_the_final_segment(gate_m: float, comes_back: bool) -> None:
    flight = Approach(replace(PARAMS, gast_d=replace(FAST, upgrade_gate_m=gate_m)))
    flight.run(BEGIN_S)
    flight.world.sends_type11 = lambda t: False
    flight.run(flight.t + 5.0)
    flight.world.sends_type11 = lambda t: True
    output = flight.run(flight.t + 2.0)
    assert output.protections[0].service == (ServiceType.D if comes_back else ServiceType.C)
    assert flight.cause() is (ServiceCause.NONE if comes_back else ServiceCause.FINAL_SEGMENT)


# --- ionosphere: the 30 s and the 100 s solution


def front(victim: int, rate_mps: float, begin_s: float):
    """A delay that grows on one satellite from a time on."""

    def iono_m(t: float) -> np.ndarray:
        found = np.zeros(N_SATS)
        found[victim] = rate_mps * max(t - begin_s, 0.0)
        return found

    return iono_m


def filtered(rate_mps: float, begin_s: float, until_s: float, tau_s: float) -> float:
    """Error of a Hatch filter under that delay: code +I, carrier -I, written out."""
    error, before = 0.0, 0.0
    for n in range(1, 1 + round(2.0 * until_s)):
        now = rate_mps * max(0.5 * n - begin_s, 0.0)
        weight = max(1.0 / (n + 1), 0.5 / tau_s)
        error, before = weight * now + (1.0 - weight) * (error - (now - before)), now
    return error


def overhead(flight: Approach) -> int:
    """The satellite the vertical rests on most."""
    return int(np.nanargmax(np.abs(flight.outputs[-1].solutions[0].s_vert)))


def test_d_v_is_the_difference_of_the_filters_projected() -> None:
    """And it is in the protection level: |s_vert| times the difference of 30 s and 100 s smoothing of one ramp."""
    begin_s, rate_mps, last_s = 20.0, 0.03, 60.0
    quiet = Approach()
    quiet.run(BEGIN_S)
    victim = overhead(quiet)
    params = replace(PARAMS, gast_d=replace(FAST, divergence_mps=1.0))
    flight = Approach(params, iono_m=front(victim, rate_mps, begin_s))
    output = flight.run(last_s + 0.5)
    solution, protection = output.solutions[0], output.protections[0]
    difference = filtered(rate_mps, begin_s, last_s, 30.0) - filtered(rate_mps, begin_s, last_s, 100.0)
    assert abs(difference) > 0.1
    # the filters know codes to a micrometre; S is of the same epoch
    assert solution.d_vert_m == pytest.approx(abs(solution.s_vert[victim] * difference), abs=1e-5)
    assert solution.d_lat_m == pytest.approx(abs(solution.s_lat[victim] * difference), abs=1e-5)
    used = np.isfinite(solution.s_vert)
    variance = solution.sigma_gnd_m**2 + solution.sigma_air_m**2 + solution.sigma_tropo_m**2 + solution.sigma_iono_m**2
    sigma = math.sqrt(float((solution.s_vert[used] ** 2 * variance[used]).sum()))
    assert protection.vpl_h0_m == pytest.approx(6.673 * sigma + solution.d_vert_m, rel=1e-4)  # K has four digits


def test_the_dual_solution_leaves_out_the_satellite_in_the_front() -> None:
    """The satellite whose ranges differ is found by leaving each out; service goes on without it."""
    quiet = Approach()
    quiet.run(BEGIN_S)
    victim = overhead(quiet)
    params = replace(PARAMS, range_test_floor_m=100.0, gast_d=replace(FAST, divergence_mps=1.0))
    # the code alone, which no slip detector takes for a slip of the carrier
    flight = Approach(params, code_error_m=front(victim, 0.5, 14.0))
    while flight.t < 90.0 and not any(event.cause == "dual_solution" for event in flight.events):
        flight.step()
        assert flight.outputs[-1].solutions[0].d_vert_m <= 2.0 or math.isnan(flight.outputs[-1].solutions[0].d_vert_m)
    event = flight.told(SAT_IDS[victim], "dual_solution")
    assert event.kind is EventKind.EXCLUSION
    assert event.value > event.threshold == 2.0
    solution = flight.outputs[-1].solutions[0]
    assert flight.outputs[-1].protections[0].service == ServiceType.D
    assert np.isnan(solution.s_vert[victim])
    assert max(solution.d_vert_m, solution.d_lat_m) < 1e-3
    flight.step()
    assert np.isnan(flight.outputs[-1].solutions[0].s_vert[victim])  # it is held out


def test_a_front_over_every_second_satellite_takes_the_service_down_to_c() -> None:
    flight = serving()
    uneven = np.arange(N_SATS) % 2 == 0
    flight.params = replace(PARAMS, gast_d=replace(FAST, divergence_mps=1.0))
    flight.world.code_error_m = lambda t: np.where(uneven, 0.5 * max(t - 14.0, 0.0), 0.0)
    while flight.t < 90.0 and flight.outputs[-1].protections[0].service == ServiceType.D:
        flight.step()
    assert flight.outputs[-1].protections[0].service == ServiceType.C
    cause = flight.cause()
    assert cause in (ServiceCause.D_VERT, ServiceCause.D_LAT)
    event = flight.told("guidance/l1_100", cause.word)
    assert event.value > event.threshold == 2.0
    assert flight.told("position", cause.word).value == event.value
    assert np.isnan(next(s for s in flight.outputs[-1].solutions if mode_of(s.mode).service is ServiceType.D).x_m)


# --- divergence at the aircraft


def test_a_divergence_that_only_the_aircraft_sees_excludes_the_satellite_and_lets_it_back() -> None:
    """Twice the rate of the delay is that of code minus carrier; filtered with 100 s twice it passes 0.0125 m/s.

    Closed form of two filters in a row: d (1 - (1 + a n)(1 - a)^n), here with a = 0.5 / 100.
    """
    begin_s, rate_mps = 20.0, 0.1
    quiet = Approach()
    quiet.run(BEGIN_S)
    victim = overhead(quiet)
    params = replace(PARAMS, gast_d=replace(FAST, dual_solution_m=100.0, divergence_clear_s=3.0))
    flight = Approach(params, iono_m=lambda t: front(victim, rate_mps, begin_s)(min(t, 62.0)))
    n = np.arange(400)
    over = np.flatnonzero(2.0 * rate_mps * (1.0 - (1.0 + 0.005 * n) * 0.995**n) > 0.0125)[0]
    flight.run(begin_s + 0.5 * (over - 1))
    assert flight.outputs[-1].protections[0].service == ServiceType.D
    assert not any(event.cause == "divergence" for event in flight.events)
    while not any(event.cause == "divergence" for event in flight.events):
        flight.step()
    assert abs(flight.t - 0.5 - (begin_s + 0.5 * over)) <= 0.5  # an epoch: the ramp begins between two
    event = flight.told(SAT_IDS[victim], "divergence")
    assert (event.kind, event.threshold) == (EventKind.EXCLUSION, 0.0125)
    assert 0.0125 < event.value < 0.0140
    assert np.isnan(flight.outputs[-1].solutions[0].s_vert[victim])
    # GAST-C has no such monitor: the satellite is in its solution still
    of_c = next(s for s in flight.outputs[-1].solutions if mode_of(s.mode).service is ServiceType.C)
    assert np.isfinite(of_c.s_vert[victim])


def test_a_satellite_comes_back_when_it_was_calm_for_long_enough() -> None:
    from gbas_airborne.ranging.divergence import DivergenceMemory, monitor_divergence

    params = replace(PARAMS, gast_d=replace(FAST, divergence_tau_s=2.0, divergence_clear_s=20.0))
    memory = DivergenceMemory.initial(params)
    code, none = np.full((3, N_SATS), 2e7), np.zeros((3, N_SATS), bool)
    excluded = []
    for k in range(200):
        ramp = 0.1 * min(max(0.5 * k - 10.0, 0.0), 20.0)  # from 10 s to 30 s
        carrier = np.full((3, N_SATS), 2e7 - ramp)
        memory, found = monitor_divergence(memory, code, carrier, none, 0.5 if k else math.nan, params)
        excluded.append(bool(found.excluded[0, 0]))
    times = 0.5 * np.flatnonzero(excluded)
    assert 10.0 < times[0] < 13.0
    # the filters of 2 s need some seconds to forget 0.1 m/s, and then 20 s pass
    assert 50.0 < times[-1] < 62.0
    assert len(times) == round(2.0 * (times[-1] - times[0])) + 1


# --- reference receivers, corrections, geometry


def test_b_values_of_a_receiver_that_add_up_take_its_satellite_out() -> None:
    """A bias of receiver 1 on one satellite: its B value there, beyond K_fd_B sigma_D / sqrt(U) in the position."""
    flight = serving()
    victim = overhead(flight)
    least = 5.26 * SIGMA_D_M / math.sqrt(3.0)
    for bias_m, excluded in ((0.8 * least, False), (6.0 * least, True)):
        b_m = round(bias_m / 0.05) * 0.05
        flight.world.b_values_m = lambda s, b_m=b_m: (b_m, *(-b_m / 3.0,) * 3) if s == victim else (0.0,) * 4
        output = flight.step()
        solution = output.solutions[0]
        assert np.isnan(solution.s_vert[victim]) == excluded
        assert output.protections[0].service == ServiceType.D
    event = flight.told(SAT_IDS[victim], "receiver_fault")
    assert event.value > event.threshold > 0.0


def test_a_receiver_that_is_off_everywhere_ends_it() -> None:
    flight = serving()
    s_vert = flight.outputs[-1].solutions[0].s_vert
    signs = np.sign(np.nan_to_num(s_vert))
    flight.world.b_values_m = lambda s: (1.5 * signs[s], *(-0.5 * signs[s],) * 3)
    assert flight.step().protections[0].service != ServiceType.D
    assert flight.cause() in (ServiceCause.B_VERT, ServiceCause.B_LAT)


@pytest.mark.parametrize(("size_m", "believed"), [(190.0, True), (210.0, False)])
def test_corrections_that_move_the_position_far_are_not_believed(size_m: float, believed: bool) -> None:
    """PRCs like those of a station that is as far off to the north: the position moves by as much."""
    solution = serving().outputs[-1].solutions[0]
    north = np.nan_to_num(np.cos(solution.elevation_rad) * np.cos(solution.azimuth_rad))
    flight = Approach()
    flight.world.bias_m, flight.world.drift_mps = np.round(size_m * north, 2), np.zeros(N_SATS)
    output = flight.run(BEGIN_S)
    assert output.protections[0].service == (ServiceType.D if believed else ServiceType.C)
    if not believed:
        assert flight.cause() is ServiceCause.CORRECTION_SHIFT
        # lines of sight turn by a thousandth in the time until then
        assert flight.told("position", "correction_shift").value == pytest.approx(size_m, abs=1.0)


@pytest.mark.parametrize(
    ("limits", "cause"),
    [
        ({"s_vert": 0.2}, ServiceCause.S_VERT),
        ({"s_vert_pair": 0.3}, ServiceCause.S_VERT_PAIR),
        ({"s_lat": 0.1}, ServiceCause.S_LAT),
        ({"s_lat_pair": 0.1}, ServiceCause.S_LAT_PAIR),
    ],
)
def test_geometry_that_rests_on_too_few_satellites(limits: dict[str, float], cause: ServiceCause) -> None:
    """Limits of the aircraft, on the largest projection and on the sum of the two largest."""
    flight = serving()
    solution = flight.outputs[-1].solutions[0]
    flight.params = replace(PARAMS, gast_d=replace(FAST, **limits))
    assert flight.step().protections[0].service == ServiceType.C
    assert flight.cause() is cause
    event = flight.told("position", cause.word)
    s = np.sort(np.abs(solution.s_vert if "vert" in cause.word else solution.s_lat)[np.isfinite(solution.s_vert)])[::-1]
    # the projections of the epoch before; half a second changes them by less than a percent
    assert event.value == pytest.approx(s[0] + (s[1] if "pair" in cause.word else 0.0), rel=1e-2)


def test_a_satellite_steps_in_after_its_time() -> None:
    flight = Approach(replace(PARAMS, gast_d=replace(FAST, step_in_s=4.0)))
    flight.run(BEGIN_S + 4.0)
    victim = overhead(flight)
    everyone = flight.world.satellites
    flight.world.satellites = [each for each in everyone if each != victim]
    flight.run(flight.t + 1.0)
    flight.world.satellites, back_s = everyone, flight.t
    usable = None
    while flight.t < back_s + 15.0:
        output = flight.step()
        c = next(s for s in output.solutions if mode_of(s.mode).service is ServiceType.C)
        usable = flight.t if usable is None and np.isfinite(c.s_vert[victim]) else usable
        d = next(s for s in output.solutions if mode_of(s.mode).service is ServiceType.D)
        expected = usable is not None and flight.t - usable >= 4.0
        assert np.isfinite(d.s_vert[victim]) == expected
    assert Rejection.STEP_IN.word in {event.cause for event in flight.events}
