"""Echoes of the airframe and the ground: a plate by hand, our aircraft against the paper's delays, code errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from gbas_airborne.abia.airframe.aircraft import BODY_DOWN, Antenna, aircraft_of
from gbas_airborne.abia.airframe.mesh import Airframe, AirframeError
from gbas_airborne.abia.multipath.airframe_echoes import (
    airframe_echoes,
    error_envelope,
    ground_echo,
    reached_by_ground_m,
)
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.tracking_loops import BOC_1_1, BPSK_1, BPSK_10
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

PATTERN = ANTENNAS["fighter"]
MIRROR_M = 0.4


def sky(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Directions evenly over the sky above 5 degrees."""
    random = np.random.default_rng(1)
    elevation = np.arcsin(random.uniform(math.sin(math.radians(5.0)), 1.0, count))
    return random.uniform(0.0, 2.0 * math.pi, count), elevation


def plate(down_m: float) -> Airframe:
    """Ten metres square, a decimetre thick, its top at a depth."""
    mesh = trimesh.creation.box((10.0, 10.0, 0.1))
    mesh.apply_translation((0.0, 0.0, down_m + 0.05))
    return Airframe.outward("plate", np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)])
def test_plate_by_the_image_method(axis):
    """Eq (30): 2 h sin(E), E above the plate, where the point of reflection is on it; right of it none beyond 5 m."""
    up = -axis[2]
    body = plate(MIRROR_M) if up > 0.0 else plate(-MIRROR_M - 0.1)
    azimuth, elevation = np.radians([0.3, 90.0, 200.0, 90.0, 90.0]), np.radians([85.0, 30.0, 60.0, 4.0, -20.0])
    found = airframe_echoes(body, Antenna("a", (0.0, 0.0, 0.0), axis), PATTERN, (azimuth, up * elevation))
    assert sorted(found.direction.tolist()) == [0, 1, 2]
    # At 30 degrees it comes from 0.69 m away, at 4 from 5.7 m, beyond the edge.
    order = np.argsort(found.direction)
    np.testing.assert_allclose(found.delay_m[order], 2.0 * MIRROR_M * np.sin(elevation[:3]), rtol=1e-9)
    assert set(found.part) == {"airframe"}
    # Metal turns the polarisation: what arrives from below has the cross gain there, over the direct gain.
    expected = 10.0 ** (0.05 * (PATTERN.cross_at_dbic(-elevation[:3]) - PATTERN.gain_at_dbic(elevation[:3])))
    np.testing.assert_allclose(np.abs(found.amplitude[order]), expected, rtol=0.01)


def test_what_stands_between_takes_the_echo():
    """A second plate over the first, from 1 m to 2 m to the right, hides what comes back at 30 degrees."""
    roof = trimesh.creation.box((4.0, 1.0, 0.02))
    roof.apply_translation((0.0, 1.5, -0.1))
    lower = trimesh.creation.box((10.0, 10.0, 0.1))
    lower.apply_translation((0.0, 0.0, MIRROR_M + 0.05))
    both = trimesh.util.concatenate([lower, roof])
    body = Airframe.outward("plates", np.asarray(both.vertices), np.asarray(both.faces))
    found = airframe_echoes(
        body, Antenna("a", (0.0, 0.0, 0.0)), PATTERN, (np.radians([90.0, 270.0]), np.radians([30.0] * 2))
    )
    assert found.direction.tolist() == [1]


@pytest.mark.parametrize("name", ["fighter", "fighter_swept"])
def test_delays_of_the_fighter(name):
    """At most 0.1 m by the fuselage 5 cm below (3.3e-10 s; the paper's 1.7e-10 is one way), below 3 m by the fin.

    Wings are low beside the antenna. No echo comes near a metre of code error: at an amplitude of 0.5 that takes 1 m.
    """
    aircraft = aircraft_of(name)
    found = airframe_echoes(aircraft.airframe, aircraft.antenna("upper"), PATTERN, sky())
    longest = {part: max(d for d, p in zip(found.delay_m, found.part, strict=True) if p == part) for part in found.part}
    assert 0.09 < longest["fuselage"] <= 0.1
    assert longest["fuselage"] / SPEED_OF_LIGHT_MPS == pytest.approx(3.3e-10, abs=0.1e-10)
    assert max(longest.values()) < 3.0
    assert longest.get("wing", 0.0) < 0.2
    # Nearly every satellite has the fuselage's echo: it dominates by number.
    assert np.mean([part == "fuselage" for part in found.part]) > 0.9
    errors = error_envelope(found.delay_m, found.amplitude, BPSK_1, 1.0)
    assert np.abs([errors.code_highest_m, errors.code_lowest_m]).max() < 1.0


def test_lower_antenna_and_unknown_directions():
    aircraft = aircraft_of("fighter")
    azimuth, elevation = sky(50)
    below = airframe_echoes(aircraft.airframe, aircraft.antenna("lower"), PATTERN, (azimuth, -elevation))
    assert len(below.delay_m) > 20
    assert aircraft.antenna("lower").axis == BODY_DOWN
    none = airframe_echoes(aircraft.airframe, aircraft.antenna("upper"), PATTERN, ([math.nan], [0.5]))
    assert none.delay_m.shape == (0,)
    with pytest.raises(AirframeError, match="inside the body"):
        airframe_echoes(aircraft.airframe, Antenna("a", (0.0, 0.0, 1.0)), PATTERN, ([0.0], [0.5]))


def test_one_metre_of_code_error():
    """Out of phase, for short delays, -delay a / (1 - a); in phase +delay a / (1 + a): Braasch. At a = 0.5, 1 m."""
    for modulation, spacing in ((BPSK_1, 1.0), (BPSK_1, 0.1), (BOC_1_1, 0.1), (BPSK_10, 1.0)):
        found = error_envelope([0.5, 1.0], [0.5, 0.5], modulation, spacing)
        np.testing.assert_allclose(found.code_lowest_m, [-0.5, -1.0], rtol=1e-3)
        np.testing.assert_allclose(found.code_highest_m, [0.5 / 3.0, 1.0 / 3.0], rtol=1e-3)
        # The largest phase error is where the sum is square to the echo: asin(a); a metre of 29 takes 3 % of the echo.
        np.testing.assert_allclose(found.phase_largest_rad, math.asin(0.5), rtol=0.04)


def test_narrow_correlators_bound_long_echoes():
    """Beyond the spacing the error of a narrow loop is a d / 2, 7.3 m at 0.1 chips with a = 0.5."""
    for spacing in (0.1, 0.2):
        found = error_envelope([0.6 * BPSK_1.chip_m], [0.5], BPSK_1, spacing)
        assert found.code_highest_m[0] == pytest.approx(0.5 * 0.5 * spacing * BPSK_1.chip_m, rel=0.15)


def test_ground_echo():
    """Eq (34), and where it is out of reach: 0.75 chips of C/A, 219.8 m (224.8 with 1.5 microseconds)."""
    found = ground_echo(np.array([100.0, 100.0]), np.radians([30.0, -5.0]), PATTERN)
    assert found.delay_m[0] == pytest.approx(100.0)
    assert np.isnan(found.delay_m[1])
    assert float(reached_by_ground_m(1.023e6, 0.5 * math.pi)) == pytest.approx(219.8, abs=0.1)
    assert float(reached_by_ground_m(1.0 / 1.0e-6, 0.5 * math.pi)) == pytest.approx(224.8, abs=0.1)
    # 1.5 microseconds are 449.7 m; the paper prints 448.5.
    # Soil at 30 degrees sends back half of what arrives, mostly turned: with gain below the horizon, well below 1.
    assert 0.05 < abs(found.amplitude[0]) < 0.8
    echoes = airframe_echoes(
        aircraft_of("fighter").airframe, aircraft_of("fighter").antenna("upper"), PATTERN, ([1.0], [0.8])
    )
    turned = echoes.with_phase(float(WAVELENGTH_M[L1]))
    np.testing.assert_allclose(np.abs(turned), np.abs(echoes.amplitude))
