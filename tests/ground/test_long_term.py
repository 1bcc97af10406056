"""The sigma monitor in the station: what it excluded stays out until its estimates are forgotten."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gbas_core.satellites import N_SATS
from gbas_ground.consistency import no_exclusions
from gbas_ground.exclusions import Latch
from gbas_ground.long_term import initial_long_term, monitor_sigmas
from gbas_msgs_py.codes import ExclusionCause
from ground_runs import params

TEN = np.arange(N_SATS) < 10


def bad_receiver(station):
    """Full windows in which the second receiver's B values had ten times their sigma on ten satellites."""
    state = initial_long_term(station)
    estimates, samples = state.estimates.copy(), state.samples.copy()
    estimates[1], samples[0] = 1.0, np.where(TEN, 1000.0, 0.0)
    estimates[1, :, :, 1] = 100.0
    return replace(state, estimates=estimates, samples=samples)


def excluded(latch, row):
    cause = latch.cause.copy()
    cause[row] = int(ExclusionCause.SIGMA_SPREAD)
    return Latch(cause=cause, clear_s=np.where(cause > 0, 50.0, 0.0), wait_s=np.zeros(cause.shape))


def nothing_used():
    """Corrections in which nobody has a part: all that is judged is what is remembered."""
    return SimpleNamespace(
        used=np.zeros((4, N_SATS), dtype=bool),
        count=np.zeros(N_SATS),
        b_m=np.full((2, 4, N_SATS), np.nan),
        channel_sigma_m=np.full((2, N_SATS), np.nan),
    )


@pytest.mark.parametrize(("since_s", "clear_s"), [(10.0, 0.0), (1e5, 50.0)])
def test_an_excluded_receiver_is_not_clear_while_its_estimates_are_remembered(since_s, clear_s):
    station = params(4)
    state = bad_receiver(station)
    state.samples[1] = since_s
    before = no_exclusions(station)
    before = replace(before, receivers=excluded(before.receivers, 1))
    _, after, findings, _ = monitor_sigmas(state, nothing_used(), before, 0.5, station)
    assert after.receivers.clear_s[1] == clear_s
    assert after.receivers.cause[1] == ExclusionCause.SIGMA_SPREAD
    assert not after.receivers.excluded[[0, 2, 3]].any()
    assert all(finding.subject != "rr2" for finding in findings)  # it is told once


def test_an_excluded_channel_likewise():
    station = params(4)
    before = no_exclusions(station)
    before = replace(before, channels=excluded(before.channels, (1, 3)))
    _, after, findings, _ = monitor_sigmas(bad_receiver(station), nothing_used(), before, 0.5, station)
    assert after.channels.clear_s[1, 3] == 0.0
    assert after.channels.excluded.sum() == 1
    # the mean over the receiver, of which this channel is all there is to judge, fails as well
    assert [finding.subject for finding in findings] == ["rr2"]
