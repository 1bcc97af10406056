"""Worst code errors: the bound against discriminators with every phase, and tables of our aircraft."""

from __future__ import annotations

import math

import numpy as np

from gbas_airborne.abia.airframe.aircraft import aircraft_of
from gbas_airborne.abia.multipath.airframe_echoes import AirframeEchoes
from gbas_airborne.abia.multipath.echo_table import EchoTable, worst_code_error_m
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.discriminator import discriminator_errors
from gbas_core.signal.tracking_loops import BPSK_1


def echoes_of(delay_m: np.ndarray, amplitude: np.ndarray, direction: np.ndarray) -> AirframeEchoes:
    return AirframeEchoes(direction, ["airframe"] * len(delay_m), delay_m, amplitude.astype(np.complex128))


def test_bound_holds_and_is_met():
    """Three echoes of 1 to 3 m: 20,000 draws of their phases stay below; all opposite to the signal meet it."""
    delay, strength = np.array([1.0, 2.0, 3.0]), np.array([0.2, 0.1, 0.15])
    (bound,) = worst_code_error_m(echoes_of(delay, strength, np.zeros(3, dtype=np.int64)), 1)
    np.testing.assert_allclose(bound, (0.2 + 0.2 + 0.45) / 0.55, rtol=1e-12)
    phases = np.exp(2j * np.pi * np.random.default_rng(2).uniform(size=(3, 20_000)))
    phases[:, 0] = -1.0
    found = discriminator_errors(
        np.repeat(delay[:, np.newaxis] / BPSK_1.chip_m, 20_000, axis=1),
        strength[:, np.newaxis] * phases,
        np.full(20_000, 0.1),
    )
    errors = np.abs(found.code_chips * BPSK_1.chip_m)
    np.testing.assert_allclose(errors[0], bound, rtol=1e-3)
    assert errors.max() <= bound * (1.0 + 1e-3)


def test_too_strong_and_none():
    found = worst_code_error_m(echoes_of(np.array([1.0, 1.0]), np.array([0.6, 0.5]), np.array([1, 1])), 3)
    assert found.tolist() == [0.0, math.inf, 0.0]


def test_table_of_the_uav():
    aircraft = aircraft_of("small_uav")
    table = EchoTable.of_mesh(aircraft.airframe, aircraft.antenna("upper"), ANTENNAS["patch"])
    assert np.isnan(table.at([0.0, math.nan, 0.0, 1.0], [-0.5, 0.5, math.nan, 2.0])).all()
    azimuth, elevation = np.meshgrid(np.radians(np.arange(2.0, 360.0, 4.0)), np.radians(np.arange(12.0, 88.0, 4.0)))
    found = table.at(azimuth, elevation)
    # Twice the 0.02 m above the pod at an amplitude of at most a half, and wings a quarter of a metre away.
    assert 0.0 < np.median(found) < 0.05
    assert found.max() < 1.0
    np.testing.assert_array_equal(table.at(azimuth + 2.0 * math.pi, elevation), found)
