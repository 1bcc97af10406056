"""States of satellites and channels: compiled loops against whole arrays over random inputs."""

from __future__ import annotations

import numpy as np
import pytest

import array_status
from gbas_core.satellites import N_SATS
from gbas_ground.stages.kernels.status import Channels, Satellites, channel_table, satellite_states

MASK_RAD = 0.1


def scene(seed, receivers):
    """Everything that may be against the use of a satellite, often enough that each is sometimes the first."""
    rng = np.random.default_rng(seed)
    shape = (receivers, N_SATS)

    def maybe(share, *size):
        return rng.random(size) < share

    def missing(values, share):
        return np.where(maybe(share, *values.shape), np.nan, values)

    channels = Channels(
        tracked=maybe(0.7, *shape) & maybe(0.8, N_SATS), settled=maybe(0.8, *shape), used=maybe(0.7, *shape),
        age_s=missing(rng.uniform(0.0, 9.0, shape), 0.2), cause=np.where(maybe(0.1, *shape), 33, 0),
        clear_s=np.where(maybe(0.5, *shape), 5.0, 0.0), receiver_cause=np.where(maybe(0.2, receivers), 49, 0),
        receiver_clear_s=np.where(maybe(0.5, receivers), 5.0, 0.0),
    )  # fmt: skip
    satellites = Satellites(
        judged=maybe(0.8, N_SATS), cause=np.where(maybe(0.1, N_SATS), 40, 0),
        clear_s=np.where(maybe(0.5, N_SATS), 5.0, 0.0), elevation_rad=missing(rng.uniform(0.0, 0.6, N_SATS), 0.05),
        ephemeris_crc=missing(np.ones(N_SATS), 0.05), receivers=rng.integers(0, receivers + 1, N_SATS).astype(float),
        prc_m=missing(np.ones((2, N_SATS)), 0.05), rrc_mps=missing(np.ones((2, N_SATS)), 0.05),
        sigmas_m=missing(rng.uniform(0.0, 5.2, (3, N_SATS)), 0.02),
    )  # fmt: skip
    return channels, satellites


@pytest.mark.parametrize("receivers", [1, 2, 4])
def test_states_are_those_of_arrays(receivers):
    met = set()
    for seed in range(150):
        channels, satellites = scene(seed, receivers)
        least = min(2, receivers)
        state, cause = satellite_states(channels, satellites, least, MASK_RAD)
        wanted = array_status.satellites(channels, satellites, least, MASK_RAD)
        assert np.array_equal(state, wanted[0])
        assert np.array_equal(cause, wanted[1])
        before = np.full((3, 5, N_SATS), np.nan)
        table = channel_table(channels, state, cause, before, 0.5, 4)
        of_channels = array_status.of_channels(channels, state, cause)
        assert np.array_equal(table[0, 1 : 1 + receivers], of_channels[0], equal_nan=True)
        assert np.array_equal(table[1, 1 : 1 + receivers], of_channels[1], equal_nan=True)
        assert np.isnan(table[:, 1 + receivers :]).all()
        # nothing changed: every time goes on
        again = channel_table(channels, state, cause, table, 0.5, 4)
        assert np.array_equal(again[2], table[2] + 0.5, equal_nan=True)
        met |= set(cause.tolist())
    assert {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 8.0, 33.0, 40.0, 49.0} <= met
