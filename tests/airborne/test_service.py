"""The service: states, alerts, time-outs, and that no failure leaves a position with a protection level."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import (
    GPA_RAD,
    Flight,
    World,
    burst_of,
    fas_data_set,
    position_of,
    station_data,
)
from gbas_airborne.navigation.guidance import alert_limits_m, in_service_volume
from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.station_data import final_approach
from gbas_airborne.service import ServiceState, service_step
from gbas_msgs_py.codes import ApproachState, EventKind, ServiceType
from gbas_msgs_py.records import SolutionEpoch
from gbas_vdb.messages.types import Type4

SETTLE_S = 5.0
PLAIN = AirborneParams(settle_s=SETTLE_S, inflate_unsettled=False)
APPROACH = replace(PLAIN, rpds=5)
DURATION_S = 12.0
FAS = final_approach(fas_data_set())


def on_approach(distance_m: float = 5000.0, speed_mps: float = 70.0, *, left_m: float = 0.0, **world: object) -> World:
    """An aircraft on the path, or beside it."""

    def path(t: float) -> np.ndarray:
        along = distance_m - speed_mps * t
        return FAS.ecef_from_approach(np.array([-along, left_m, float(FAS.path_height_m(along))]))

    return World(path=path, approaches=(fas_data_set(),), **world)


def flying(world: World, params: AirborneParams = APPROACH) -> Flight:
    flight = Flight(world, params)
    flight.run(0.0, DURATION_S)
    return flight


def states(flight: Flight) -> list[ApproachState]:
    found = [ApproachState(int(p.state)) for p in flight.protections]
    return [state for k, state in enumerate(found) if k == 0 or state != found[k - 1]]


def assert_no_guidance(flight: Flight, cause: str) -> None:
    protection = flight.protections[-1]
    assert protection.alert == 1.0
    assert protection.service == ServiceType.NONE
    assert math.isnan(protection.vpl_m)
    assert math.isnan(protection.lpl_m)
    assert flight.state.service.cause == cause
    assert any(e.kind == EventKind.ALERT and e.cause == cause for e in flight.events)


# --- the way up


def test_states_on_the_way_to_the_approach() -> None:
    flight = flying(on_approach())
    assert states(flight) == [ApproachState.VDB_ACQUIRED, ApproachState.DATA_VALID, ApproachState.APPROACH]
    last = flight.protections[-1]
    assert (last.service, last.alert) == (ServiceType.C, 0.0)
    assert last.vpl_m <= last.val_m
    assert last.lpl_m <= last.lal_m


def test_silence_is_no_signal() -> None:
    flight = Flight(on_approach(), APPROACH)
    for k in range(4):
        flight.step(0.5 * k, bursts=())
    assert states(flight) == [ApproachState.NO_SIGNAL]
    assert_no_guidance(flight, "no_signal")


def test_without_approach_the_service_is_differential() -> None:
    """No alert limits: service C when protected, limits NaN, no alert."""
    flight = flying(World(), PLAIN)
    last = flight.protections[-1]
    assert last.state == ApproachState.DIFFERENTIAL
    assert (last.service, last.alert) == (ServiceType.C, 0.0)
    assert math.isnan(last.val_m)
    assert math.isnan(last.lal_m)
    assert math.isnan(flight.solutions[-1].lateral_ddm)


def test_outside_the_service_volume_there_is_no_angular_guidance() -> None:
    flight = flying(on_approach(left_m=6000.0))
    solution, last = flight.solutions[-1], flight.protections[-1]
    assert last.state == ApproachState.DIFFERENTIAL
    assert (last.service, last.alert) == (ServiceType.C, 0.0)
    assert math.isnan(solution.lateral_ddm)
    assert solution.lateral_m == pytest.approx(6000.0, abs=0.1)


def test_deviations_to_the_left_and_above_are_positive() -> None:
    """Full scale deviation at the threshold is the course width over the distance to the GARP."""
    flight = flying(on_approach(left_m=20.0))
    solution = flight.solutions[-1]
    distance = solution.distance_to_ltp_m
    garp = 2500.0 + 305.0
    full_scale = math.atan(105.0 / garp)
    assert solution.lateral_m == pytest.approx(20.0, abs=0.02)
    expected = 0.155 * math.atan(20.0 / (distance + garp)) / full_scale
    assert solution.lateral_ddm == pytest.approx(expected, rel=2e-3)  # the message's runway is rounded to 1.5 cm


# --- the way down: messages


def test_silence_of_the_station_ends_guidance_after_3_5_seconds() -> None:
    flight = flying(on_approach())
    for k in range(1, 9):
        _, protection, _ = flight.step(DURATION_S - 0.5 + 0.5 * k, bursts=())
        assert protection.alert == float(0.5 * k > 3.5)
        assert math.isfinite(protection.vpl_m) == (0.5 * k <= 3.5)
    assert_no_guidance(flight, "mt1_timeout")
    assert flight.protections[-1].state == ApproachState.LOSS
    event = [e for e in flight.events if e.cause == "mt1_timeout" and e.kind == EventKind.ALERT][-1]
    assert (event.value, event.threshold) == (4.0, 3.5)
    assert (event.gps_week, event.tow_s) == (flight.solutions[-1].gps_week, flight.solutions[-1].tow_s)


def test_guidance_comes_back_with_the_station() -> None:
    flight = flying(on_approach())
    for k in range(8):
        flight.step(DURATION_S + 0.5 * k, bursts=())
    assert flight.protections[-1].state == ApproachState.LOSS
    flight.step(DURATION_S + 4.0)
    assert flight.protections[-1].state == ApproachState.APPROACH
    assert flight.protections[-1].alert == 0.0


def test_other_messages_do_not_keep_guidance_alive() -> None:
    flight = flying(on_approach())
    for k in range(1, 9):
        t = DURATION_S - 0.5 + 0.5 * k
        flight.step(t, bursts=(burst_of([station_data()], *flight.world.time(t), slot=6),))
    assert_no_guidance(flight, "mt1_timeout")


def test_missing_station_data() -> None:
    world = on_approach()
    flight = Flight(world, APPROACH)
    for k in range(24):
        flight.step(0.5 * k, bursts=tuple(b for b in world.bursts(0.5 * k) if b.slot != 6))
    assert_no_guidance(flight, "no_signal")


def test_missing_corrections() -> None:
    world = on_approach()
    flight = Flight(world, APPROACH)
    for k in range(24):
        flight.step(0.5 * k, bursts=tuple(b for b in world.bursts(0.5 * k) if b.slot >= 6))
    assert states(flight) == [ApproachState.VDB_ACQUIRED]
    assert_no_guidance(flight, "no_corrections")


def test_missing_approach_data() -> None:
    world = on_approach()
    world.approaches = (fas_data_set(rpds=6),)
    assert_no_guidance(flying(world), "no_approach_data")


@pytest.mark.parametrize("gcid", [0, 7, 5])
def test_unhealthy_station(gcid: int) -> None:
    flight = flying(on_approach())
    flight.world.station_message = station_data(gcid=gcid)
    flight.step(DURATION_S)
    assert_no_guidance(flight, "station_unhealthy")
    assert flight.protections[-1].state == ApproachState.LOSS
    assert np.isnan(position_of(flight.solutions[-1])).all()


def test_levels_of_an_unhealthy_station_are_no_service() -> None:
    """Whoever asks for them gets positions and levels as from a healthy station, an alert and never a service."""
    healthy = flying(on_approach())
    unhealthy = flying(on_approach(station_message=station_data(gcid=7)), replace(APPROACH, use_unhealthy=True))
    last = unhealthy.protections[-1]
    assert (last.service, last.alert, last.state) == (ServiceType.NONE, 1.0, ApproachState.VDB_ACQUIRED)
    assert (last.vpl_m, last.lpl_m, last.veb_m) == (
        healthy.protections[-1].vpl_m, healthy.protections[-1].lpl_m, healthy.protections[-1].veb_m,
    )  # fmt: skip
    assert np.array_equal(position_of(unhealthy.solutions[-1]), position_of(healthy.solutions[-1]))
    assert ServiceType.C not in {protection.service for protection in unhealthy.protections}
    assert "station_unhealthy" in {event.cause for event in unhealthy.events}


def test_asking_for_levels_of_unhealthy_stations_changes_nothing_for_healthy_ones() -> None:
    one, other = (flying(on_approach(), replace(APPROACH, use_unhealthy=each)) for each in (False, True))
    assert one.protections[-1].alert == other.protections[-1].alert == 0.0
    assert one.protections[-1].service == other.protections[-1].service == ServiceType.C


def test_station_in_test_mode() -> None:
    flight = flying(on_approach())
    week, tow_s = flight.world.time(DURATION_S)
    flight.step(DURATION_S, bursts=tuple(burst_of([m], week, tow_s, test=True) for m in flight.world.type1(DURATION_S)))
    assert_no_guidance(flight, "no_signal")


def test_station_without_ephemeris_bound() -> None:
    bare = replace(station_data(), adb1=None)
    assert_no_guidance(flying(on_approach(station_message=bare)), "no_ephemeris_bound")


def test_operator_may_do_without_the_ephemeris_bound() -> None:
    bare = replace(station_data(), adb1=None)
    flight = flying(on_approach(station_message=bare), replace(APPROACH, require_ephemeris_bound=False))
    assert flight.protections[-1].alert == 0.0
    assert math.isnan(flight.protections[-1].veb_m)


@pytest.mark.parametrize("apd", [0, 3])
def test_approach_without_service_c(apd: int) -> None:
    world = on_approach()
    world.approaches = (fas_data_set(apd=apd),)
    assert_no_guidance(flying(world), "approach_not_for_service")


@pytest.mark.parametrize("limits", [{"fasval_m": math.nan}, {"faslal_m": math.nan}])
def test_approach_without_limits(limits: dict[str, float]) -> None:
    """0xFF: no vertical guidance, or not to be used. A level is never within a limit that is not there."""
    world = on_approach()
    world.approaches = (fas_data_set(**limits),)
    flight = flying(world)
    assert flight.protections[-1].alert == 1.0
    assert flight.protections[-1].service == ServiceType.NONE
    assert flight.state.service.cause in ("vpl_above_val", "lpl_above_lal")


def test_approach_withdrawn() -> None:
    """The limits turn to 0xFF during the approach."""
    flight = flying(on_approach())
    flight.world.approaches = (fas_data_set(fasval_m=math.nan, faslal_m=math.nan),)
    flight.step(DURATION_S)
    assert flight.protections[-1].alert == 1.0
    assert flight.protections[-1].state == ApproachState.LOSS


# --- the way down: position and levels


def test_no_observations_no_position() -> None:
    flight = flying(on_approach())
    _, protection, events = flight.step(DURATION_S, observations=None)
    assert_no_guidance(flight, "no_position")
    assert np.isnan(position_of(flight.solutions[-1])).all()
    assert "missing" in {event.cause for event in events}
    assert protection.state == ApproachState.LOSS
    flight.step(DURATION_S + 0.5)
    assert flight.protections[-1].alert == 0.0


@pytest.mark.parametrize(("sigma_m", "cause"), [(5.0, "vpl_above_val")])
def test_levels_above_the_limits(sigma_m: float, cause: str) -> None:
    flight = flying(on_approach())
    before = len(flight.events)
    flight.world.sigma_m = sigma_m
    _, protection, _ = flight.step(DURATION_S)
    assert protection.alert == 1.0
    assert protection.service == ServiceType.NONE
    assert protection.vpl_m > protection.val_m
    event = next(e for e in flight.events[before:] if e.kind == EventKind.ALERT)
    assert (event.cause, event.value, event.threshold) == (cause, protection.vpl_m, protection.val_m)


def test_lateral_level_above_the_limit() -> None:
    """B values of one receiver that all pull to one side: the level of its fault is lateral."""
    world = on_approach(1500.0)
    world.approaches = (fas_data_set(fasval_m=25.0, faslal_m=5.0),)
    flight = flying(world)
    assert flight.protections[-1].alert == 0.0
    side = np.sign(flight.solutions[-1].s_lat)
    world.b_values_m = lambda satellite: (6.0 * side[satellite], -2.0, -2.0, -2.0)
    _, protection, _ = flight.step(DURATION_S)
    assert protection.vpl_m <= protection.val_m
    assert protection.lpl_m > protection.lal_m
    assert protection.alert == 1.0
    assert flight.state.service.cause == "lpl_above_lal"


def test_ephemeris_bound_above_the_limit() -> None:
    """The protection level is within the limit, the bound with its larger multiplier is not."""
    flight = flying(on_approach())
    flight.world.station_message = station_data(k_md_e=12.75)
    flight.world.sigma_m = 2.2
    _, protection, _ = flight.step(DURATION_S)
    assert protection.vpl_m <= protection.val_m < protection.veb_m
    assert protection.alert == 1.0
    assert flight.state.service.cause == "veb_above_val"


@pytest.mark.parametrize("name", ["x_m", "gcid", "message_age_s", "correction_age_s", "n_receivers", "apd", "k_md_e"])
def test_a_missing_scalar_is_an_alert(name: str) -> None:
    solution = flying(on_approach()).solutions[-1]
    assert service_step(ServiceState(), solution, APPROACH)[1].alert == 0.0
    _, protection, _ = service_step(ServiceState(), replace(solution, **{name: math.nan}), APPROACH)
    assert protection.alert == 1.0
    assert math.isnan(protection.vpl_m)
    assert protection.service == ServiceType.NONE


@pytest.mark.parametrize("name", ["fasval_m", "faslal_m"])
def test_a_missing_limit_is_an_alert(name: str) -> None:
    solution = flying(on_approach()).solutions[-1]
    _, protection, _ = service_step(ServiceState(), replace(solution, **{name: math.nan}), APPROACH)
    assert protection.alert == 1.0


@pytest.mark.parametrize(
    "name",
    ["s_vert", "s_lat", "sigma_gnd_m", "sigma_air_m", "sigma_tropo_m", "sigma_iono_m", "b_m", "ephemeris_error_m"],
)
def test_a_missing_number_of_one_satellite_is_an_alert(name: str) -> None:
    solution = flying(on_approach()).solutions[-1]
    values = getattr(solution, name).copy()
    values[..., np.flatnonzero(np.isfinite(solution.s_vert))[0]] = np.nan
    _, protection, _ = service_step(ServiceState(), replace(solution, **{name: values}), APPROACH)
    assert protection.alert == 1.0
    assert protection.service == ServiceType.NONE


def test_an_empty_solution_is_an_alert() -> None:
    _, protection, _ = service_step(ServiceState(), SolutionEpoch(gps_week=2300, tow_s=0.0), APPROACH)
    assert protection.alert == 1.0
    assert protection.state == ApproachState.NO_SIGNAL


# --- events


def test_events_come_with_changes_only_and_name_the_epoch() -> None:
    flight = flying(on_approach())
    alerts = [e for e in flight.events if e.kind == EventKind.ALERT]
    assert [e.cause for e in alerts] == ["no_corrections", "no_position", "cleared"]
    services = [e for e in flight.events if e.subject == "service"]
    assert [(e.value, e.cause) for e in services] == [(1.0, "protected")]
    shown = next(p for p in flight.protections if p.alert == 0.0)
    assert alerts[-1].epoch == services[-1].epoch
    assert (alerts[-1].gps_week, alerts[-1].tow_s) == (shown.gps_week, shown.tow_s)


# --- alert limits and service volume


@pytest.mark.parametrize(
    ("distance_m", "path_height_m", "val_m", "lal_m"),
    [
        (200.0, 20.0, 10.0, 40.0),
        (873.0, 60.0, 10.0, 40.0),
        (5000.0, 1000.0 * 0.3048, 0.02925 * 1000.0 + 10.0 - 5.85, 0.0044 * 5000.0 + 40.0 - 3.85),
        (8000.0, 2000.0 * 0.3048, 43.35, 69.15),
        (-400.0, 5.0, 10.0, 40.0),
    ],
)
def test_published_alert_limits(distance_m: float, path_height_m: float, val_m: float, lal_m: float) -> None:
    """Annex 10, tables B-68 and B-69, for FASVAL 10 m and FASLAL 40 m; the aircraft is 50 m above the path."""
    solution = SolutionEpoch(
        gps_week=2300, tow_s=0.0, fasval_m=10.0, faslal_m=40.0, apd=1.0,
        distance_to_ltp_m=distance_m, height_above_ltp_m=path_height_m + 50.0, vertical_m=50.0,
    )  # fmt: skip
    assert alert_limits_m(solution) == (pytest.approx(val_m, abs=1e-9), pytest.approx(lal_m, abs=1e-9))


def test_without_deviation_the_limits_are_the_largest() -> None:
    solution = SolutionEpoch(gps_week=2300, tow_s=0.0, fasval_m=10.0, faslal_m=40.0, apd=1.0)
    assert alert_limits_m(solution) == (pytest.approx(43.35), pytest.approx(69.15))


@pytest.mark.parametrize(
    ("distance_m", "left_m", "angle_rad", "inside"),
    [
        (5000.0, 0.0, GPA_RAD, True),
        (5000.0, 137.0 + 5000.0 * math.tan(math.radians(34.9)), GPA_RAD, True),
        (5000.0, -(137.0 + 5000.0 * math.tan(math.radians(35.1))), GPA_RAD, False),
        (30_000.0, 137.0 + 30_000.0 * math.tan(math.radians(9.9)), GPA_RAD, True),
        (30_000.0, 137.0 + 30_000.0 * math.tan(math.radians(10.1)), GPA_RAD, False),
        (36_900.0, 0.0, GPA_RAD, True),
        (37_100.0, 0.0, GPA_RAD, False),
        (10_000.0, 0.0, 0.44 * GPA_RAD, False),
        (10_000.0, 0.0, 0.46 * GPA_RAD, True),
        (10_000.0, 0.0, math.radians(6.9), True),
        (10_000.0, 0.0, math.radians(7.1), False),
        (35_000.0, 0.0, math.radians(6.0), False),  # above 3000 m
        (-1000.0, 0.0, GPA_RAD, False),
    ],
)
def test_service_volume(distance_m: float, left_m: float, angle_rad: float, inside: bool) -> None:
    to_gpip_m = distance_m + float(FAS.gpip_m[0])
    place = FAS.ecef_from_approach(np.array([-distance_m, left_m, to_gpip_m * math.tan(angle_rad)]))
    assert in_service_volume(FAS, FAS.deviations(place)) == inside


# --- nothing unprotected leaves the receiver


def test_no_failure_leaves_a_level_without_its_conditions() -> None:
    """A storm of faults: with a level, all it depends on is there; without, there is an alert."""
    rng = np.random.default_rng(42)
    world = on_approach(9000.0)
    flight = Flight(world, APPROACH)
    type4 = Type4(data_sets=world.approaches)
    for k in range(240):
        t = 0.5 * k
        epoch = world.epoch(t)
        bursts = [b for b in epoch.bursts if rng.random() > 0.2]
        if rng.random() < 0.1:
            bursts = []
        if rng.random() < 0.05:
            bursts.append(burst_of([station_data(gcid=7)], *world.time(t), slot=6))
        if rng.random() < 0.02:
            bursts.append(burst_of([type4], *world.time(t), slot=7, test=True))
        observations = epoch.observations if rng.random() > 0.05 else None
        if observations is not None and rng.random() < 0.1:
            code = observations.code_m.copy()
            code[0, rng.integers(0, 68)] = rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e300])
            observations = replace(observations, code_m=code)
        solution, protection, _ = flight.step(t, epoch=replace(epoch, bursts=tuple(bursts), observations=observations))
        if math.isfinite(protection.vpl_m):
            assert math.isfinite(solution.x_m + protection.lpl_m)
            assert solution.gcid in (1.0, 2.0, 3.0, 4.0)
            assert solution.message_age_s <= 3.5
            assert solution.correction_age_s <= 10.0
            place = world.path(t - world.clock_m(t) / 299_792_458.0)
            assert np.linalg.norm(position_of(solution) - place) < min(protection.vpl_m, protection.lpl_m)
        if protection.alert == 0.0:
            assert protection.service == ServiceType.C
            assert protection.vpl_m <= protection.val_m
            assert protection.lpl_m <= protection.lal_m
        else:
            assert protection.service == ServiceType.NONE
    assert any(p.alert == 0.0 for p in flight.protections)
    assert any(p.alert == 1.0 for p in flight.protections[40:])
