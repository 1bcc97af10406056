"""The executive's table: satellites and receivers, what state each channel is in, why, and for how long."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.satellites import missing
from gbas_core.signals import L1
from gbas_ground.stages.decide import Decided
from gbas_msgs_py.codes import ChannelState, ExclusionCause
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, ChannelEpoch


class _Entries(NamedTuple):
    """State and cause of things of one kind; NaN where there is nothing to say."""

    state: FloatArray
    cause: FloatArray


def channel_epoch(decided: Decided, before: ChannelEpoch | None) -> ChannelEpoch:
    """The table of one epoch; durations go on from the table `before`."""
    corrected, status = decided.corrected, decided.status
    now, tracked = corrected.monitored.tracked.received.now, corrected.monitored.tracked.tracked
    exclusions = corrected.exclusions
    row = (status.state != ChannelState.NOT_TRACKED) | (status.cause != ExclusionCause.NONE)
    satellites = _Entries(np.where(row, status.state, np.nan), np.where(row, status.cause, np.nan))
    channels = _channels(decided)
    shown = row & (tracked.any(axis=0) | exclusions.channels.excluded.any(axis=0))
    state, cause = missing(MAX_REFERENCE_RECEIVERS), missing(MAX_REFERENCE_RECEIVERS)
    state[: len(tracked)] = np.where(shown, channels.state, np.nan)
    cause[: len(tracked)] = np.where(shown, channels.cause, np.nan)
    elapsed_s = now.dt_s if now.dt_s > 0.0 else 0.0
    since_s, channel_since_s = missing(), missing(MAX_REFERENCE_RECEIVERS)
    if before is not None:
        since_s = _same_for(satellites, _Entries(before.state, before.cause), before.since_s + elapsed_s)
        old = _Entries(before.channel_state, before.channel_cause)
        channel_since_s = _same_for(_Entries(state, cause), old, before.channel_since_s + elapsed_s)
    return ChannelEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        state=satellites.state,
        cause=satellites.cause,
        since_s=np.where(np.isnan(since_s) & row, 0.0, since_s),
        channel_state=state,
        channel_cause=cause,
        channel_since_s=np.where(np.isnan(channel_since_s) & np.isfinite(state), 0.0, channel_since_s),
    )


def _same_for(now: _Entries, before: _Entries, since_s: FloatArray) -> FloatArray:
    """Durations of what is as it was; NaN for the rest."""
    return np.where((now.state == before.state) & (now.cause == before.cause), since_s, np.nan)


def _channels(decided: Decided) -> _Entries:
    """Channels ``(R, N)``: what is wrong with a channel itself comes before what is wrong with its satellite."""
    corrected, status = decided.corrected, decided.status
    tracked, tracks = corrected.monitored.tracked.tracked, corrected.monitored.tracked.tracks
    exclusions, settled = corrected.exclusions, corrected.inputs.settled
    by_receiver = np.broadcast_to(exclusions.receivers.excluded[:, np.newaxis], tracked.shape)
    settling = np.isfinite(tracks.age_of(L1)) & ~settled & (status.cause != ExclusionCause.BELOW_MASK)
    usable = corrected.corrections.used & (status.state == ChannelState.USABLE)
    reasons = (
        (exclusions.channels.excluded, exclusions.channels.state, exclusions.channels.cause),
        (by_receiver, exclusions.receivers.state[:, np.newaxis], exclusions.receivers.cause[:, np.newaxis]),
        (~tracked, float(ChannelState.NOT_TRACKED), float(ExclusionCause.NOT_TRACKED)),
        (usable, float(ChannelState.USABLE), float(ExclusionCause.NONE)),
        (settling, float(ChannelState.SETTLING), float(ExclusionCause.SETTLING)),
    )
    state = np.broadcast_to(np.where(status.state == ChannelState.USABLE, np.nan, status.state), tracked.shape)
    cause = np.broadcast_to(status.cause, tracked.shape)
    # a channel that is ready and not used has its satellite's reason, or its receiver is not in use
    state = np.where(np.isnan(state), float(ChannelState.EXCLUDED), state)
    cause = np.where(cause == ExclusionCause.NONE, float(ExclusionCause.TOO_FEW_COMMON_SATELLITES), cause)
    for mask, its_state, its_cause in reversed(reasons):
        state, cause = np.where(mask, its_state, state), np.where(mask, its_cause, cause)
    return _Entries(state, cause)
