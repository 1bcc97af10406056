"""The compiled slip tests and filters against the same rules as array expressions, over what may befall channels."""

from __future__ import annotations

import numpy as np
import pytest

import array_channels as oracle
from gbas_core.ranging.slips import ChannelObservations, SlipParams, initial_slips, slip_step
from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.satellites import N_SATS
from gbas_core.signals import N_BANDS, WAVELENGTH_M

MILLISECOND_M = 299_792.458


def eventful(seed: int, receivers: int, satellites: int):
    """Epochs with slips, steps of the clock, frozen and missing values, infinities and lock indicators of all kinds."""
    rng = np.random.default_rng(seed)
    shape = (receivers, N_BANDS, N_SATS)
    here = rng.permutation(N_SATS)[:satellites]
    range_m, speed = 2e7 + 1e6 * rng.uniform(size=satellites), rng.uniform(-700.0, 700.0, satellites)
    ambiguity_m, clock_m = np.zeros((receivers, N_BANDS, satellites)), np.zeros((receivers, 1, 1))
    before = None
    for number in range(40):
        if rng.uniform() < 0.2:
            ambiguity_m += rng.uniform(-2.0, 2.0, ambiguity_m.shape) * (rng.uniform(size=ambiguity_m.shape) < 0.1)
        stepped = (rng.uniform(size=receivers) < 0.1)[:, None, None] * MILLISECOND_M
        clock_m = clock_m + stepped
        ambiguity_m = ambiguity_m - stepped * (rng.uniform() < 0.5)  # the codes alone, or all
        true_m = range_m + speed * number + clock_m
        code, carrier, doppler, lli = np.full((4, *shape), np.nan)
        code[..., here] = true_m + rng.normal(0.0, 0.5, ambiguity_m.shape)
        carrier[..., here] = true_m + ambiguity_m + rng.normal(0.0, 0.003, ambiguity_m.shape)
        doppler[..., here] = -(speed + rng.normal(0.0, 0.05, ambiguity_m.shape)) / WAVELENGTH_M[:, None]
        lli[..., here] = rng.choice([0.0, 0.0, 0.0, 1.0, 2.0, 4.0, np.nan], ambiguity_m.shape)
        for values in (code, carrier, doppler):
            values[rng.uniform(size=shape) < 0.1] = np.nan
        if before is not None:
            frozen = rng.uniform(size=shape) < 0.02
            code, carrier = np.where(frozen, before[0], code), np.where(frozen, before[1], carrier)
        before = code, carrier
        known = np.full((receivers, N_SATS), np.nan)
        known[:, here] = range_m + speed * number
        known[rng.uniform(size=known.shape) < 0.1] = np.nan
        dt_s = float(rng.choice([1.0, 1.0, 1.0, 1.0, 0.5, 0.0, 40.0, np.nan]))
        yield ChannelObservations(code, carrier, doppler, lli, known if rng.uniform() < 0.7 else None), dt_s


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("receivers", "satellites"), [(4, 30), (1, 9), (1, 1), (2, 3), (1, 0)])
@pytest.mark.parametrize("follow", [False, True])
def test_slips_are_those_of_the_array_expressions(seed: int, receivers: int, satellites: int, follow: bool) -> None:
    params = SlipParams(follow_code_steps=follow, receiver_jerk_mps3=0.1 * seed)
    state = reference = initial_slips(receivers)
    for observed, dt_s in eventful(seed, receivers, satellites):
        state, found = slip_step(state, observed, dt_s, params)
        with np.errstate(all="ignore"):
            reference, expected = oracle.slip_step(reference, observed, dt_s, params)
        np.testing.assert_array_equal(found.cause, expected.cause)
        np.testing.assert_array_equal(found.slipped, expected.slipped)
        for name in ("carrier_m", "clock_step_m"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
        for name in ("rate_mps", "acceleration_mps2", "followed_m"):
            # the same operations in the same order
            np.testing.assert_array_equal(getattr(state, name), getattr(reference, name), err_msg=name)


@pytest.mark.parametrize("start", ["variable", "elapsed", "invariant"])
@pytest.mark.parametrize("tau_s", [(100.0, 30.0), (0.0,), (0.7, 1e3)])
def test_smoothed_ranges_are_those_of_the_array_expressions(start, tau_s: tuple[float, ...]) -> None:
    params = SmoothingParams(tau_s=tau_s, start=start)
    state = reference = initial_smoothing(params, 3, N_BANDS)
    rng = np.random.default_rng(1)
    for observed, dt_s in eventful(7, 3, 20):
        slipped = rng.uniform(size=observed.code_m.shape) < 0.05
        state, smoothed = smooth_step(state, observed.code_m, observed.carrier_m, slipped, dt_s, params)
        with np.errstate(all="ignore"):
            reference, expected = oracle.smooth_step(
                reference, observed.code_m, observed.carrier_m, slipped, dt_s, params
            )
        np.testing.assert_array_equal(smoothed, expected)
        for name in ("carrier_m", "count", "elapsed_s"):
            np.testing.assert_array_equal(getattr(state, name), getattr(reference, name), err_msg=name)
