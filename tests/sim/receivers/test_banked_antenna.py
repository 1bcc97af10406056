"""An aircraft that banks: its antenna turns with it, and what comes from below the antenna's plane is lost."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import fresnel

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.satellites import N_SATS
from gbas_core.signal.antenna import ANTENNAS, airframe_loss_db
from gbas_core.signals import FREQUENCY_HZ, L1, L2, L5, SPEED_OF_LIGHT_MPS
from gbas_sim.flight.dynamics import AIRLINER, Cruise, Flight, FlightPlan, Start, Turn
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams

SITE = (3840619.039, 715604.228, 5024909.863)
START = Start(latitude_rad=math.radians(52.5), longitude_rad=math.radians(10.5), height_m=2000.0, heading_rad=0.4)
TURN = Turn(heading_change_rad=2.0 * math.pi, bank_rad=math.radians(35.0))
FLIGHT = Flight(
    aircraft=AIRLINER,
    plan=FlightPlan(start=START, speed_mps=130.0, segments=(Cruise(duration_s=20.0), TURN, Cruise(duration_s=20.0))),
)


@pytest.fixture(scope="module")
def world() -> World:
    steady = dataclasses.replace(receiver_preset("aad_b"), cn0_sigma_db=0.0)
    return World(WorldParams(receiver_ecef_m=(SITE,), flight=FLIGHT, airborne=steady, interval_s=1.0))


def above_plane(world: World, number: int) -> np.ndarray:
    """Sine of the elevation above the antenna's plane (N_SATS,), by roll, pitch and heading."""
    state = FLIGHT.flight_state(np.array([float(number)]))
    roll, pitch, heading = (float(each[0]) for each in (state.roll_rad, state.pitch_rad, state.heading_rad))
    latitude, longitude, _ = geodetic_from_ecef(state.position_ecef_m[0])
    enu = rot_enu_ecef(latitude, longitude)
    seen = world.orbits.arc(world.params.start_week, world.params.start_tow_s + number)(
        np.full(N_SATS, world.params.start_tow_s + number - 0.08)
    )
    away = enu @ (seen.position_m - state.position_ecef_m[0][:, np.newaxis])
    east, north, up = away / np.linalg.norm(away, axis=0)
    # Turned by the heading, then by the pitch, then by the roll: what is left along the roof.
    forward, right = (
        north * math.cos(heading) + east * math.sin(heading),
        east * math.cos(heading) - north * math.sin(heading),
    )
    raised = up * math.cos(pitch) - forward * math.sin(pitch)
    return raised * math.cos(roll) + right * math.sin(roll)


def test_knife_edge():
    """Against the integrals that the recommendation's formula stands for."""
    angles = np.radians(np.array([0.0, -2.0, -5.0, -10.0, -20.0, -30.0, -45.0, -60.0, -90.0]))
    loss = airframe_loss_db(np.repeat(angles[:, np.newaxis], N_SATS, axis=1))
    assert np.isnan(loss[:, L2]).all()
    for band in (L1, L5):
        depth = np.sin(-angles) * np.sqrt(2.0 * 2.0 * FREQUENCY_HZ[band] / SPEED_OF_LIGHT_MPS)
        sine, cosine = fresnel(depth)
        exact = -20.0 * np.log10(0.5 * np.sqrt((1.0 - cosine - sine) ** 2 + (cosine - sine) ** 2))
        # The formula is within 0.2 dB of the integrals, at both ends of the difference.
        np.testing.assert_allclose(loss[:, band, 0], exact - 20.0 * math.log10(2.0), atol=0.4)
    assert not airframe_loss_db(np.linspace(0.0, 1.5, N_SATS))[[L1, L5]].any()


def test_antenna_stays_upright_in_level_flight(world):
    axis = FLIGHT.antenna_axis(np.array([0.0, 10.0]))
    state = FLIGHT.flight_state(np.array([0.0, 10.0]))
    latitude, longitude, _ = geodetic_from_ecef(state.position_ecef_m)
    up = rot_enu_ecef(latitude, longitude)[:, 2]
    # The Earth's turning takes a tenth of a degree of roll.
    upright = np.cos(state.pitch_rad) * np.cos(state.roll_rad)
    np.testing.assert_allclose(np.sum(axis * up, axis=-1), upright, rtol=1e-12)
    assert (upright > math.cos(math.radians(6.0))).all()
    np.testing.assert_allclose(np.linalg.norm(axis, axis=-1), 1.0, rtol=1e-12)


def test_the_truth_has_the_attitude(world):
    for number in (5, round(0.5 * FLIGHT.duration_s)):
        truth, state = world.epoch(number).truth, FLIGHT.flight_state(np.array([float(number)]))
        # The receiver's clock is a millisecond off at most, and it turns by less than a radian a second.
        for name in ("roll_rad", "pitch_rad", "heading_rad"):
            assert getattr(truth, name) == pytest.approx(float(getattr(state, name)[0]), abs=1e-3)


def test_cn0_follows_attitude(world):
    """By the antenna's gain at the elevation above its own plane, less what the roof's edge takes."""
    budget = world.params.airborne.cn0
    middle = round(0.5 * FLIGHT.duration_s)
    assert abs(float(FLIGHT.flight_state(np.array([float(middle)])).roll_rad[0]) - math.radians(35.0)) < 0.02
    for number in (10, middle):
        own = np.arcsin(above_plane(world, number))
        cn0 = world.epoch(number).airborne.cn0_dbhz
        gain = ANTENNAS["patch"].gain_at_dbic(own)
        level = budget.cn0_dbhz(world.elevations_rad(number)[-1])
        level -= ANTENNAS["patch"].gain_at_dbic(world.elevations_rad(number)[-1])
        expected = level + gain - airframe_loss_db(own)
        known = np.isfinite(cn0)
        assert known[L1].sum() >= 8
        # Satellites 0.003 s off their place and axes turned by the Earth meanwhile: a hundredth of a degree at most.
        np.testing.assert_allclose(cn0[known], expected[known], atol=0.02)


def test_satellites_behind_the_wing_are_lost_and_found(world):
    """On L1, all that are 20 degrees below the antenna's plane, though high enough; later they count from elsewhere."""
    mask = world.params.airborne.elevation_mask_rad
    hidden, carriers = np.zeros(N_SATS, dtype=bool), {}
    for number in range(len(world)):
        epoch = world.epoch(number).airborne
        deep = above_plane(world, number) < math.sin(math.radians(-20.0))
        high = world.elevations_rad(number)[-1] >= mask
        assert not np.isfinite(epoch.code_m[L1, deep]).any()
        above = above_plane(world, number) > 0.02
        assert np.isfinite(epoch.code_m[L1, above & high]).all()
        hidden |= deep & high
        if number in (15, len(world) - 1):
            carriers[number] = epoch.carrier_m[L1] - epoch.code_m[L1]
    before, after = carriers.values()
    both = np.isfinite(before) & np.isfinite(after)
    assert (hidden & both).sum() >= 3
    # Whole wavelengths away; noise of codes is metres at most.
    assert (np.abs(after - before)[hidden & both] > 20.0).all()
    assert (np.abs(after - before)[both & (world.elevations_rad(15)[-1] > math.radians(60.0))] < 20.0).all()


def test_the_simple_receiver_banks_too(world):
    """Its C/N0 goes with the sine, from 36 dB-Hz on L1 at the horizon to 48 at the zenith; below, with the edge."""
    simple = World(WorldParams(receiver_ecef_m=(SITE,), flight=FLIGHT, airborne=AIRBORNE_RECEIVER, interval_s=1.0))
    lowest = 0.0
    for number in range(30, len(world) - 30, 5):
        sine = above_plane(world, number)
        cn0 = simple.epoch(number).airborne.cn0_dbhz[L1]
        known = np.isfinite(cn0)
        expected = 36.0 + 12.0 * sine - airframe_loss_db(np.arcsin(sine))[L1]
        np.testing.assert_allclose(cn0[known], expected[known], atol=0.02)
        lowest = min(lowest, float(sine[known].min()))
        assert (expected[known] >= 20.0).all()
    assert lowest < math.sin(math.radians(-15.0))
