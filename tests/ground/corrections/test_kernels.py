"""The compiled loops of corrections against whole arrays, over random and edge inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import array_corrections as arrays
from gbas_core.models.error_models import sigma_pr_gnd
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_ground.corrections.kernels import consistency as kernels
from gbas_ground.corrections.sigma import measured_sigma_m, settings_of
from ground_runs import params

NAMES = ("in_use", "common", "weights", "used", "count", "prc_m", "rrc_mps", "b_m", "sigmas_m", "channel_sigma_m")
# Corrections are hundreds of metres with clocks of 1e5 m: sums in another order round at 1e-11 of that.
ROUNDING = {"rtol": 1e-9, "atol": 1e-9}


def scene(seed, receivers, density, strange):
    """Random corrections, of this epoch and the one before; some of them not numbers."""
    rng = np.random.default_rng(seed)
    shape = (2, receivers, N_SATS)
    clocks = rng.normal(0.0, 1e5, (receivers, 1))
    correction = rng.normal(0.0, 100.0, shape) + clocks
    previous = correction + rng.normal(0.0, 1.0, shape)
    usable = rng.random(shape[1:]) < density
    for values, share in ((correction, 0.3 * strange), (previous, strange)):
        values[rng.random(shape) < share] = rng.choice([np.nan, np.inf])
    cause = np.where(rng.random(N_SATS) < 0.1, 32, 0)
    elevation = rng.uniform(-0.1, 1.57, N_SATS)
    elevation[rng.random(N_SATS) < strange] = np.nan
    return correction, previous, usable, cause, elevation


def by_arrays(correction, previous, dt_s, usable, cause, elevation, station):
    """What :func:`form_corrections` returns."""
    settings = settings_of(station)
    weighting = None if settings.plain else elevation
    in_use, common = arrays.common_satellites(
        usable & (cause == 0), min_common=settings.min_common, min_receivers=settings.min_receivers
    )
    weights = arrays.clock_weights(common, weighting)
    adjusted = correction - arrays.receiver_clock_m(correction, weights)
    used = usable & in_use[0][:, np.newaxis] & CLOCK_GROUPS[0] | usable & in_use[1][:, np.newaxis] & CLOCK_GROUPS[1]
    used = used & np.isfinite(adjusted).all(axis=0)
    count = used.sum(axis=0).astype(float)
    base = sigma_pr_gnd(station.accuracy.designator, elevation, count, mask_rad=settings.mask_rad)
    gnd_d = settings.inflation * base
    sigmas = np.stack([settings.inflation_iono * gnd_d, gnd_d, settings.factor_30s * gnd_d])
    both, of_rate = used & np.isfinite(previous).all(axis=0), weights
    if not np.array_equal(both, used):
        of_clock = both & (weights > 0.0).any(axis=0)
        _, again = arrays.common_satellites(of_clock, min_common=settings.min_common, min_receivers=1)
        of_rate = arrays.clock_weights(again, weighting)
        both = both & np.isfinite(arrays.receiver_clock_m(correction, of_rate)).all(axis=0)
    return (
        in_use, common, weights, used, count, arrays.average_m(adjusted, used),
        arrays.rate_mps(correction, previous, dt_s, of_rate, both), arrays.b_values_m(adjusted, used), sigmas,
        arrays.clock_removed_sigma_m(sigmas[1:] * np.sqrt(count), weights),
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    receivers=st.integers(1, 4),
    density=st.sampled_from([0.0, 0.05, 0.5, 0.9, 1.0]),
    strange=st.sampled_from([0.0, 0.02, 0.3]),
    weighting=st.sampled_from(["plain", "elevation"]),
    designator=st.sampled_from("ABC"),
    dt_s=st.sampled_from([0.5, np.nan]),
)
def test_corrections_and_their_checks_are_those_of_arrays(
    seed, receivers, density, strange, weighting, designator, dt_s
):
    station = params(receivers, monitors__clock_weighting=weighting, accuracy__designator=designator)
    given_settings = settings_of(station)
    correction, previous, usable, cause, elevation = scene(seed, receivers, density, strange)
    measured_m = measured_sigma_m(station, elevation)
    found = kernels.form_corrections(correction, previous, dt_s, usable, cause, elevation, measured_m, given_settings)
    with np.errstate(all="ignore"):
        wanted = by_arrays(correction, previous, dt_s, usable, cause, elevation, station)
    for name, ours, theirs in zip(NAMES, found, wanted, strict=True):
        np.testing.assert_allclose(ours, theirs, **ROUNDING, err_msg=name)
    _, _, _, used, count, prc, rrc, b, _, sigma = found
    statistic, threshold, failed, due, n_failed = kernels.summarise_corrections(
        used, count, prc, rrc, b, sigma, given_settings
    )
    size, limit, b_failed = arrays.b_failures(b, sigma, used, given_settings.k_b)
    has_rate = (count > 0) & np.isfinite(rrc).all(axis=0)
    assert np.array_equal(due, [(used & (count >= 2)).any(axis=0), count > 0, has_rate])
    wanted_failed = [
        b_failed.any(axis=(0, 1)),
        ((count > 0) & ~(np.abs(prc) <= given_settings.max_prc_m)).any(axis=0),
        (has_rate & ~(np.abs(rrc) <= given_settings.max_rrc_mps)).any(axis=0),
    ]
    assert np.array_equal(failed, wanted_failed)
    assert n_failed == np.sum(wanted_failed)
    ratio = np.where(np.isnan(size), -np.inf, size / limit)
    worst = np.where(np.isfinite(ratio).any(axis=(0, 1)), ratio.max(axis=(0, 1)), np.nan)
    np.testing.assert_allclose(statistic[0] / threshold[0], worst, **ROUNDING)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), receivers=st.integers(1, 4), strange=st.sampled_from([0.0, 0.05]))
def test_residuals_of_channels_that_are_not_used_are_those_of_arrays(seed, receivers, strange):
    given_settings = settings_of(params(receivers))
    correction, _, usable, _, elevation = scene(seed, receivers, 0.8, strange)
    settled = usable | (np.random.default_rng(seed).random(usable.shape) < 0.5)
    _, common, _, _, _, prc, *_ = kernels.form_corrections(
        correction,
        correction,
        0.5,
        usable,
        np.zeros(N_SATS, dtype=np.int64),
        elevation,
        np.empty((0, N_SATS)),
        given_settings,
    )
    found = kernels.residual_m(correction, settled, common, prc, given_settings)
    with np.errstate(all="ignore"):
        wanted = arrays.unused_residual_m(correction, settled, common, prc, given_settings.min_common)
    np.testing.assert_allclose(found, wanted, **ROUNDING)


def test_measured_sigmas_are_held_beyond_the_nodes_and_missing_below_the_mask():
    station = params(2, accuracy__sigma_elevation_rad=(0.08, 1.08), accuracy__sigma_m=(0.4, 0.2))
    elevation = np.full(N_SATS, np.nan)
    elevation[:3] = 0.05, 0.58, 1.5
    count = np.where(np.arange(N_SATS) < 3, 4.0, 0.0)
    sigmas = kernels.broadcast_sigmas_m(elevation, count, measured_sigma_m(station, elevation), settings_of(station))
    assert sigmas[1, :3] == pytest.approx([np.nan, 0.15, 0.1], nan_ok=True)
    assert np.isnan(sigmas[:, 3:]).all()
