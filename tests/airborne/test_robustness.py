"""What a receiver meets: epochs that are missing, late or backwards, clocks that jump, numbers that are none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import Flight, World, position_of
from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_core.gnss.epoch_order import RESTART_AFTER_REFUSED
from gbas_core.gnss.gpstime import add_seconds
from gbas_core.satellites import missing
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS

MILLISECOND_M = 1e-3 * SPEED_OF_LIGHT_MPS
PARAMS = AirborneParams(settle_s=5.0, inflate_unsettled=False)
DURATION_S = 12.0


def settled(world: World | None = None, params: AirborneParams = PARAMS) -> Flight:
    flight = Flight(world or World(), params)
    flight.run(0.0, DURATION_S)
    assert flight.protections[-1].alert == 0.0
    return flight


def error_m(flight: Flight, t: float) -> float:
    place = flight.world.path(t - flight.world.clock_m(t) / SPEED_OF_LIGHT_MPS)
    return float(np.linalg.norm(position_of(flight.solutions[-1]) - place))


# --- time


def test_a_repeated_epoch_is_refused() -> None:
    flight = settled()
    solution, protection, events = flight.step(DURATION_S - 0.5)
    assert math.isnan(solution.x_m)
    assert protection.alert == 1.0
    assert "time_backwards" in {event.cause for event in events}
    flight.step(DURATION_S)
    assert flight.protections[-1].alert == 0.0
    assert error_m(flight, DURATION_S) < 1e-3


def test_an_epoch_out_of_order_changes_nothing() -> None:
    flight, other = settled(), settled()
    flight.step(DURATION_S - 3.0)
    flight.step(DURATION_S)
    other.step(DURATION_S)
    np.testing.assert_array_equal(position_of(flight.solutions[-1]), position_of(other.solutions[-1]))


def test_time_that_goes_on_from_earlier_starts_the_receiver_anew() -> None:
    """A replay that begins again: after a few refused epochs, all is settled from nothing."""
    flight = settled()
    for k in range(RESTART_AFTER_REFUSED - 1):
        _, protection, _ = flight.step(0.5 * k)
        assert protection.alert == 1.0
    assert "time_restart" not in flight.causes()
    start = 0.5 * (RESTART_AFTER_REFUSED - 1)
    epoch = flight.world.epoch(start, ephemerides=(flight.world.aircraft,))
    flight.step(start, epoch=epoch)
    assert "time_restart" in flight.causes()
    flight.run(start + 0.5, start + DURATION_S)
    assert flight.protections[-1].alert == 0.0


def test_one_epoch_from_the_future_costs_a_restart_and_no_more() -> None:
    flight = settled()
    future = replace(flight.world.observations(DURATION_S), gps_week=flight.world.week + 1)
    epoch = AirborneEpoch(gps_week=future.gps_week, tow_s=future.tow_s, observations=future)
    _, protection, _ = flight.step(0.0, epoch=epoch)
    assert protection.alert == 1.0
    for k in range(1, 40):
        t = DURATION_S + 0.5 * k
        again = {"ephemerides": (flight.world.aircraft,)} if k == RESTART_AFTER_REFUSED else {}
        flight.step(t, **again)
    assert flight.protections[-1].alert == 0.0


def test_a_gap_starts_the_filters_anew() -> None:
    flight = settled()
    flight.step(DURATION_S + 4.0)
    assert flight.protections[-1].alert == 1.0
    assert "not_settled" in flight.causes("G02") | flight.causes("G01")
    flight.run(DURATION_S + 4.5, DURATION_S + 10.0)
    assert flight.protections[-1].alert == 0.0


def test_a_short_gap_is_bridged() -> None:
    flight = settled()
    flight.step(DURATION_S + 2.0)
    assert flight.protections[-1].alert == 0.0
    assert error_m(flight, DURATION_S + 2.0) < 1e-3


def test_slow_recordings_need_a_longer_gap() -> None:
    params = replace(PARAMS, max_gap_s=35.0, settle_s=60.0)
    world = World()
    world.satellites = world.satellites[:7]  # 60 frames on, each time another one comes first
    flight = Flight(world, params)
    flight.run(0.0, 12 * 30.0, interval_s=30.0)
    assert flight.protections[-1].alert == 0.0
    assert error_m(flight, 330.0) < 1e-3


def test_observations_of_another_epoch_are_not_used() -> None:
    flight = settled()
    stale = flight.world.observations(DURATION_S - 0.5)
    flight.step(DURATION_S, epoch=replace(flight.world.epoch(DURATION_S), observations=stale))
    assert math.isnan(flight.solutions[-1].x_m)
    assert flight.protections[-1].alert == 1.0


# --- clocks


@pytest.mark.parametrize("milliseconds", [1, -1, 3])
def test_a_clock_step_of_code_and_carrier(milliseconds: int) -> None:
    world = World()
    steady = world.clock_m
    world.clock_m = lambda t: steady(t) + (MILLISECOND_M * milliseconds if t >= DURATION_S else 0.0)
    flight = settled(world)
    for k in range(10):
        flight.step(DURATION_S + 0.5 * k)
        assert flight.protections[-1].alert == 0.0
        assert error_m(flight, DURATION_S + 0.5 * k) < 1e-3


@pytest.mark.parametrize("milliseconds", [1, -2])
def test_a_clock_step_of_the_code_alone(milliseconds: int) -> None:
    """Some receivers step the code and not the carrier: the filters go on, aligned with the code."""
    world = World()
    steady = world.clock_m
    step = MILLISECOND_M * milliseconds
    world.clock_m = lambda t: steady(t) + (step if t >= DURATION_S else 0.0)
    flight = settled(world)
    for k in range(10):
        t = DURATION_S + 0.5 * k
        observations = world.observations(t)
        carrier = observations.carrier_m.copy()
        carrier[L1] -= step
        flight.step(t, observations=replace(observations, carrier_m=carrier))
        assert flight.protections[-1].alert == 0.0
        assert error_m(flight, t) < 1e-3


# --- numbers that are none


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, -2e7, 1e300])
@pytest.mark.parametrize("field", ["code_m", "carrier_m"])
def test_a_broken_measurement_of_one_satellite_costs_that_satellite(field: str, value: float) -> None:
    flight = settled()
    victim = flight.world.satellites[2]
    observations = flight.world.observations(DURATION_S)
    broken = getattr(observations, field).copy()
    broken[L1, victim] = value
    flight.step(DURATION_S, observations=replace(observations, **{field: broken}))
    assert not np.isfinite(flight.solutions[-1].s_vert[victim])
    assert flight.protections[-1].alert == 0.0
    assert error_m(flight, DURATION_S) < 1e-3


@pytest.mark.parametrize("field", ["doppler_hz", "lli", "cn0_dbhz"])
def test_missing_auxiliary_observations_do_no_harm(field: str) -> None:
    flight = settled()
    observations = replace(flight.world.observations(DURATION_S), **{field: missing(3)})
    flight.step(DURATION_S, observations=observations)
    assert flight.protections[-1].alert == 0.0


def test_everything_missing_is_no_position() -> None:
    flight = settled()
    nothing = replace(flight.world.observations(DURATION_S), code_m=missing(3), carrier_m=missing(3))
    flight.step(DURATION_S, observations=nothing)
    assert math.isnan(flight.solutions[-1].x_m)
    assert flight.protections[-1].alert == 1.0


def test_an_ephemeris_of_nothing_does_no_harm() -> None:
    flight = settled()
    empty = {name: missing() for name in ("iod", "message", "sqrt_a", "af0_s")}
    flight.step(DURATION_S, ephemerides=(replace(flight.world.aircraft, **empty),))
    assert flight.protections[-1].alert == 0.0


def test_an_ephemeris_of_nonsense_is_not_used() -> None:
    flight = settled()
    week, tow_s = add_seconds(flight.world.week, flight.world.start_s, DURATION_S)
    nonsense = replace(
        flight.world.aircraft, gps_week=week, tow_s=tow_s,
        sqrt_a=flight.world.aircraft.sqrt_a * 0.5, e=flight.world.aircraft.e + 0.9,
    )  # fmt: skip
    flight.step(DURATION_S, ephemerides=(nonsense,))
    assert math.isnan(flight.solutions[-1].x_m)
    assert flight.protections[-1].alert == 1.0
    assert "ephemeris_crc_mismatch" in flight.causes()


def test_states_are_never_written_to() -> None:
    """A state kept from before gives the same result again."""
    flight = settled()
    kept = flight.state
    first, _, _ = flight.step(DURATION_S)
    flight.run(DURATION_S + 0.5, DURATION_S + 5.0)
    flight.state = kept
    second, _, _ = flight.step(DURATION_S)
    np.testing.assert_array_equal(position_of(first), position_of(second))


def test_input_arrays_are_not_written_to() -> None:
    flight = settled()
    epoch = flight.world.epoch(DURATION_S)
    copies = [getattr(epoch.observations, name).copy() for name in ("code_m", "carrier_m", "doppler_hz", "lli")]
    flight.step(DURATION_S, epoch=epoch)
    for name, copy in zip(("code_m", "carrier_m", "doppler_hz", "lli"), copies, strict=True):
        np.testing.assert_array_equal(getattr(epoch.observations, name), copy)
