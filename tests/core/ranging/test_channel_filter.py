"""The channels' filter: slips on every band, smoothing on those asked for, whatever is beside them."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.channel_filter import (
    ChannelFilterParams,
    channel_filter_step,
    initial_channel_filter,
    sensible,
)
from gbas_core.ranging.slips import ChannelObservations, SlipParams
from gbas_core.ranging.smoothing import SmoothingParams
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5, N_BANDS

SATELLITES = slice(0, 8)
RECEIVERS = 3


def observed(k: int, *, slip: tuple[int, int, int] | None = None, lli: bool = False) -> ChannelObservations:
    """An epoch of receivers that stand still below satellites that move evenly, with noise of its own."""
    rng = np.random.default_rng(k)
    shape = (RECEIVERS, N_BANDS, N_SATS)
    code, carrier, loss = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    range_m = 2e7 + 1e5 * np.arange(8) + 100.0 * k * np.linspace(-1.0, 1.0, 8)
    code[..., SATELLITES] = range_m + rng.normal(0.0, 0.3, (RECEIVERS, N_BANDS, 8))
    carrier[..., SATELLITES] = range_m + 50.0 * np.arange(N_BANDS)[:, None]
    loss[..., SATELLITES] = 0.0
    if slip is not None and lli:
        loss[slip] = 1.0
    return ChannelObservations(code, carrier, np.full(shape, np.nan), loss)


def params(*bands: int, tau_s: tuple[float, ...] = (100.0, 30.0)) -> ChannelFilterParams:
    return ChannelFilterParams(bands=bands, slips=SlipParams(), smoothing=SmoothingParams(tau_s=tau_s))


def run(
    filters: ChannelFilterParams, n_epochs: int = 20, *, slip_at: int = -1, where: tuple[int, int, int] = (0, 0, 0)
):
    state, result = initial_channel_filter(filters, RECEIVERS), None
    for k in range(n_epochs):
        epoch = observed(k, slip=where if k == slip_at else None, lli=True)
        state, result = channel_filter_step(state, epoch, 1000 * k, filters)
    return result


def test_axes_are_time_constants_receivers_bands_satellites() -> None:
    result = run(params(L1, L5))
    assert result.smoothed_m.shape == (2, RECEIVERS, 2, N_SATS)
    assert result.age_s.shape == (RECEIVERS, 2, N_SATS)
    assert result.carrier_m.shape == result.slipped.shape == (RECEIVERS, N_BANDS, N_SATS)
    assert np.isfinite(result.smoothed_m[..., SATELLITES]).all()
    assert np.isnan(result.smoothed_m[..., 8:]).all()
    np.testing.assert_array_equal(result.age_s[..., SATELLITES], 19.0)


def test_smoothed_ranges_are_the_running_mean_of_code_less_carrier() -> None:
    """Below tau the filter is a mean: carrier, plus the mean of what the codes were above theirs, written out here."""
    result = run(params(L1, L5))
    epochs = [observed(k) for k in range(20)]
    for band in (L1, L5):
        above = np.mean([each.code_m[:, band] - each.carrier_m[:, band] for each in epochs], axis=0)
        expected = epochs[-1].carrier_m[:, band] + above
        # 2e7 m has a spacing of 4e-9 m; twenty steps
        np.testing.assert_allclose(result.smoothed_of(band)[0], expected, atol=1e-7)


def test_a_band_is_the_same_whatever_bands_are_beside_it() -> None:
    alone, all_bands = run(params(L5)), run(params(L1, L2, L5))
    np.testing.assert_array_equal(alone.smoothed_of(L5), all_bands.smoothed_of(L5))
    np.testing.assert_array_equal(alone.age_of(L5), all_bands.age_of(L5))


def test_a_time_constant_is_the_same_whatever_others_are_beside_it() -> None:
    both, one = run(params(L1), 80), run(params(L1, tau_s=(30.0,)), 80)
    np.testing.assert_array_equal(both.smoothed_m[1], one.smoothed_m[0])


def test_a_slip_restarts_its_band_and_receiver_alone() -> None:
    result = run(params(L1, L5), slip_at=15, where=(1, L5, 3))
    restarted = np.argwhere(result.age_s == 4.0).tolist()
    assert restarted == [[1, 1, 3]]  # receiver 2, second band asked for


def test_no_smoothing_is_the_code() -> None:
    result = run(params(L1, tau_s=(0.0, 100.0)))
    np.testing.assert_array_equal(result.smoothed_m[0, :, 0], observed(19).code_m[:, L1])


def test_a_band_that_is_not_smoothed_is_asked_for() -> None:
    result = run(params(L1), 2)
    for ask in (result.smoothed_of, result.age_of):
        with pytest.raises(ValueError, match="not in tuple"):
            ask(L5)


@pytest.mark.parametrize("bands", [(), (0, 0), (3,), (-1,)])
def test_bands_that_are_none(bands: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="bands is"):
        params(*bands)


def test_what_is_no_measurement_is_missing() -> None:
    values = np.array([1.0, -1e12, 1.1e12, np.inf, -np.inf, np.nan, 2e9])
    np.testing.assert_array_equal(np.isfinite(sensible(values)), [True, True, False, False, False, False, True])
    assert np.isnan(sensible(values, 1e9)[-1])
