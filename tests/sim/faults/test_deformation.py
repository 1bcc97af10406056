"""Deformed signals: closed forms in the limits, and late edges on a random code as second formulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.signal.tracking_loops import BPSK_1, TrackingParams
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_sim.faults.deformation import Correlator, Deformation, correlator_of, deformation_bias_m, deformed_correlation

CHIP_M = SPEED_OF_LIGHT_MPS / 1.023e6
WIDE = 60.0e6


@pytest.mark.parametrize("lag_chips", [0.12, 0.05, -0.05, -0.12])
@pytest.mark.parametrize(("spacing_chips", "front_end_hz"), [(0.2, 16.0e6), (0.5, 8.0e6), (1.0, 2.1e6)])
def test_late_edges_move_the_peak_by_half_of_it(lag_chips, spacing_chips, front_end_hz):
    """Where the correlators sit beside the flat top, all see it half its width late, whatever their filter."""
    bias_m = deformation_bias_m(Deformation(lag_chips=lag_chips), Correlator(spacing_chips, front_end_hz))
    assert bias_m == pytest.approx(0.5 * lag_chips * CHIP_M, abs=0.01 * CHIP_M)
    assert bias_m == pytest.approx(0.5 * lag_chips * CHIP_M, rel=0.01)


def test_correlation_of_late_edges_by_a_random_code():
    samples, chips, late = 50, 40_000, 6
    code = np.random.default_rng(1).choice([-1.0, 1.0], chips)
    replica = np.repeat(code, samples)
    deformed = replica.copy()
    falling = samples * (np.flatnonzero((code[:-1] > 0.0) & (code[1:] < 0.0)) + 1)
    for sample in range(late):
        deformed[falling + sample] = 1.0
    lag, peak = deformed_correlation(Deformation(lag_chips=late / samples), 1.0e9, BPSK_1)
    for shift in (-60, -25, -3, 0, 3, 6, 10, 30, 49, 60):
        measured = float((deformed * np.roll(replica, shift)).mean())
        # Of 40,000 chips: 1 / sqrt(40,000) = 0.005.
        assert measured == pytest.approx(float(np.interp(shift / samples, lag, peak)), abs=0.025)


@pytest.mark.parametrize(("ring_hz", "damping_neperps"), [(10e6, 0.8e6), (10e6, 8.8e6), (17e6, 8.8e6), (7.3e6, 3.0e6)])
def test_narrow_front_end_sees_only_the_delay_of_the_ringing_system(ring_hz, damping_neperps):
    """Far below its resonance a second-order system is a delay of 2 s / (s^2 + w^2)."""
    deformation = Deformation(ring_hz=ring_hz, damping_neperps=damping_neperps)
    bias_m = deformation_bias_m(deformation, Correlator(1.0, 2.0e6))
    delay_s = 2.0 * damping_neperps / (damping_neperps**2 + (2.0 * math.pi * ring_hz) ** 2)
    # What is left goes with the square of the band's edge over the resonance: (1 / 7.3)^2 = 2 % at most.
    assert bias_m == pytest.approx(delay_s * SPEED_OF_LIGHT_MPS, rel=0.02, abs=0.005)


def test_receivers_differ_and_the_same_do_not():
    ringing = Deformation(ring_hz=8.0e6, damping_neperps=2.0e6)
    ground, airborne = Correlator(0.1, 16.0e6), Correlator(0.2, 20.0e6)
    assert deformation_bias_m(ringing, ground) == deformation_bias_m(ringing, Correlator(0.1, 16.0e6))
    assert abs(deformation_bias_m(ringing, ground) - deformation_bias_m(ringing, airborne)) > 0.05
    both = Deformation(lag_chips=0.06, ring_hz=8.0e6, damping_neperps=2.0e6)
    assert deformation_bias_m(both, ground) == pytest.approx(
        deformation_bias_m(ringing, ground) + 0.03 * CHIP_M, rel=0.25
    )


def test_no_deformation_no_bias():
    for signal in range(3):
        correlator = correlator_of(TrackingParams(), signal)
        assert deformation_bias_m(Deformation(), correlator, signal) == pytest.approx(0.0, abs=1e-6)


def test_peak_is_the_filtered_triangle():
    lag, peak = deformed_correlation(Deformation(), WIDE, BPSK_1)
    assert peak.max() == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(np.interp([-0.5, 0.25, 2.0], lag, peak), [0.5, 0.75, 0.0], atol=0.002)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Deformation(lag_chips=0.7), "lag_chips = 0.7 is not within -0.5 to 0.5 chips"),
        (lambda: Deformation(damping_neperps=0.0), "damping_neperps = 0 is not within 100000 to 100000000 neper/s"),
        (lambda: deformation_bias_m(Deformation(lag_chips=0.1), Correlator(0.1, WIDE), 1), "no model for E1"),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)
