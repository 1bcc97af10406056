"""What each satellite may be used for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import L1
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.correct import Corrected
from gbas_ground.stages.kernels.status import USABLE, Channels, Satellites, satellite_states
from gbas_msgs_py.codes import ChannelState, ExclusionCause


@dataclass(frozen=True, kw_only=True, eq=False)
class SatelliteStatus:
    """State (:class:`ChannelState`) and cause (:class:`ExclusionCause`) of every satellite, ``(N,)``."""

    state: FloatArray
    cause: FloatArray

    @cached_property
    def usable(self) -> BoolArray:
        """Satellites that may be used, ``(N,)``."""
        return np.asarray(self.state == USABLE)


def channels_of(corrected: Corrected) -> Channels:
    """What is known of the channels."""
    tracked, exclusions = corrected.monitored.tracked, corrected.exclusions
    return Channels(
        tracked=tracked.tracked,
        settled=corrected.inputs.settled,
        used=corrected.corrections.used,
        age_s=np.ascontiguousarray(tracked.tracks.age_of(L1)),
        cause=exclusions.channels.cause,
        clear_s=exclusions.channels.clear_s,
        receiver_cause=exclusions.receivers.cause,
        receiver_clear_s=exclusions.receivers.clear_s,
    )


def satellite_status(corrected: Corrected, channels: Channels, station: PreparedStation) -> SatelliteStatus:
    """Status of every satellite; where several reasons are against its use, the first applicable is reported."""
    inputs, corrections, latch = corrected.inputs, corrected.corrections, corrected.exclusions.satellites
    satellites = Satellites(
        judged=inputs.judged,
        cause=latch.cause,
        clear_s=latch.clear_s,
        elevation_rad=inputs.elevation_rad,
        ephemeris_crc=corrected.monitored.tracked.received.known.crc,
        receivers=corrections.count,
        prc_m=corrections.prc_m,
        rrc_mps=corrections.rrc_mps,
        sigmas_m=corrections.sigmas_m,
    )
    settings = station.consistency
    state, cause = satellite_states(channels, satellites, settings.min_receivers, settings.mask_rad)
    return SatelliteStatus(state=state, cause=cause)


def withheld(status: SatelliteStatus) -> SatelliteStatus:
    """The condition when no usable satellite may be used for want of protection against ionospheric fronts."""
    usable = status.usable
    return SatelliteStatus(
        state=np.where(usable, float(ChannelState.EXCLUDED), status.state),
        cause=np.where(usable, float(ExclusionCause.IONOSPHERE_UNPROTECTED), status.cause),
    )
