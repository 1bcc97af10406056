"""What each satellite may be used for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1
from gbas_ground.consistency import Corrections, Exclusions
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.params import GroundParams
from gbas_ground.stages.correct import Corrected
from gbas_msgs_py.codes import FIRST_LATCHED, ChannelState, ExclusionCause


@dataclass(frozen=True, kw_only=True, eq=False)
class SatelliteStatus:
    """State (:class:`ChannelState`) and cause (:class:`ExclusionCause`) of every satellite, ``(N,)``."""

    state: FloatArray
    cause: FloatArray


def satellite_status(corrected: Corrected, params: GroundParams) -> SatelliteStatus:
    """Status of every satellite; where several reasons are against its use, the first applicable is reported."""
    tracked, tracks = corrected.monitored.tracked.tracked, corrected.monitored.tracked.tracks
    known = corrected.monitored.tracked.received.known
    correction_inputs, corrections, exclusions = corrected.inputs, corrected.corrections, corrected.exclusions
    seen = tracked.any(axis=0)
    visible = correction_inputs.elevation_rad >= params.monitors.elevation_mask_rad
    usable = exclusions.usable_channels()
    ready = (usable & correction_inputs.ready).sum(axis=0)
    settling = (usable & np.isfinite(tracks.age_of(L1)) & ~correction_inputs.ready).sum(axis=0)
    short = corrections.count < params.receivers.minimum
    waiting = short & (ready < params.receivers.minimum) & (ready + settling >= params.receivers.minimum)
    unmonitored = (
        waiting
        & ~correction_inputs.judged
        & ((usable & correction_inputs.settled).sum(axis=0) >= params.receivers.minimum)
    )
    channel_cause = _channel_cause(tracked, exclusions)
    no_rate = ~np.isfinite(corrections.prc_m + corrections.rrc_mps).all(axis=0)

    excluded = ChannelState.EXCLUDED
    reasons: tuple[tuple[BoolArray | np.bool, ArrayLike, ArrayLike], ...] = (
        (~seen & ~visible, ChannelState.NOT_TRACKED, ExclusionCause.NONE),
        (~seen, ChannelState.NOT_TRACKED, ExclusionCause.NOT_TRACKED),
        (np.isnan(correction_inputs.elevation_rad + known.crc), excluded, ExclusionCause.NO_EPHEMERIS),
        (~visible, excluded, ExclusionCause.BELOW_MASK),
        (exclusions.satellites.excluded, exclusions.satellites.state, exclusions.satellites.cause),
        (unmonitored, ChannelState.SETTLING, ExclusionCause.UNMONITORED),
        (waiting, ChannelState.SETTLING, ExclusionCause.SETTLING),
        (short & (channel_cause >= float(FIRST_LATCHED)), excluded, channel_cause),
        (short & (ready >= params.receivers.minimum), excluded, ExclusionCause.TOO_FEW_COMMON_SATELLITES),
        (short, excluded, ExclusionCause.TOO_FEW_RECEIVERS),
        (~_sigma_fits(corrections), excluded, ExclusionCause.SIGMA_TOO_LARGE),
        (no_rate, excluded, ExclusionCause.NO_RATE),
    )
    state: FloatArray = np.full(N_SATS, float(ChannelState.USABLE))
    cause = np.zeros(N_SATS)
    for mask, its_state, its_cause in reversed(reasons):
        if mask.any():
            state = np.where(mask, its_state, state)
            cause = np.where(mask, its_cause, cause)
    return SatelliteStatus(state=state, cause=cause)


def _channel_cause(tracked: BoolArray, exclusions: Exclusions) -> FloatArray:
    """Cause of the exclusions of a satellite's channels, ``(N,)``; the largest number where there are several."""
    by_receiver = tracked & exclusions.receivers.excluded[:, np.newaxis]
    causes = np.where(by_receiver, exclusions.receivers.cause[:, np.newaxis], exclusions.channels.cause)
    return np.asarray(causes.max(axis=0), dtype=np.float64)


def _sigma_fits(corrections: Corrections) -> BoolArray:
    sigmas = np.array(corrections.sigmas)
    return np.asarray(((sigmas > 0.0) & (sigmas <= MAX_SIGMA_M)).all(axis=0))


def withheld(status: SatelliteStatus) -> SatelliteStatus:
    """The condition when no usable satellite may be used for want of protection against ionospheric fronts."""
    usable = status.state == ChannelState.USABLE
    return SatelliteStatus(
        state=np.where(usable, float(ChannelState.EXCLUDED), status.state),
        cause=np.where(usable, float(ExclusionCause.IONOSPHERE_UNPROTECTED), status.cause),
    )
