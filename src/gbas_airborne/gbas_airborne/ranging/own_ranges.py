"""Second stage of an epoch: the own ranges, with slips found and smoothed for every mode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from gbas_airborne.modes import bands_of
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.divergence import Divergence, DivergenceMemory, monitor_divergence
from gbas_airborne.reception.receive import Received
from gbas_core.gnss.observations import LARGEST_OBSERVATION
from gbas_core.ranging.channel_filter import (
    ChannelFilterParams,
    ChannelFilterState,
    FilteredChannels,
    channel_filter_step,
    initial_channel_filter,
    sensible,
)
from gbas_core.ranging.slips import ChannelObservations, SlipParams
from gbas_core.ranging.smoothing import SmoothingParams
from gbas_core.record import FloatArray
from gbas_msgs_py.modes import Mode

# A pseudorange is some 2e7 m, and a receiver clock is not three seconds off: anything larger is no measurement.
LARGEST_CODE_M: Final = 1e9
DIVERGENCE: Final = "divergence"
"""Name of its monitor in the table of modes."""
_LARGEST: Final = np.array([LARGEST_CODE_M, *[LARGEST_OBSERVATION] * 3])[:, np.newaxis, np.newaxis]


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothedRanges:
    """What the receiver measured on one signal: raw and smoothed code and the age of the filter, (N_SATS,) arrays."""

    code_m: FloatArray
    smoothed_m: FloatArray
    settled_s: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackState:
    """What this stage remembers: filters, and those of the divergence where a mode needs it."""

    filters: ChannelFilterState
    divergence: DivergenceMemory | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracked:
    """What was received, with the own ranges.

    Attributes
    ----------
    received : Received
    code_m : (N_BANDS, N_SATS) array
        Raw pseudoranges [m].
    channels : FilteredChannels
        Of one receiver.
    tau_s : tuple of float
        Time constants of the smoothed ranges [s].
    divergence : Divergence or None
        Of code and carrier, where a mode needs to know.
    """

    received: Received
    code_m: FloatArray
    channels: FilteredChannels
    tau_s: tuple[float, ...]
    divergence: Divergence | None = None

    def ranges(self, mode: Mode) -> tuple[SmoothedRanges, ...]:
        """The ranges a mode works with, one a signal; modes of one signal and time constant share them."""
        return tuple(self._smoothed[band, mode.smoothing_s] for band in bands_of(mode))

    @cached_property
    def _smoothed(self) -> dict[tuple[int, float], SmoothedRanges]:
        """By band and time constant."""
        return {
            (band, tau_s): SmoothedRanges(
                code_m=self.code_m[band],
                smoothed_m=self.channels.smoothed_of(band)[place, 0],
                settled_s=self.channels.age_of(band)[0],
            )
            for band in self.channels.bands
            for place, tau_s in enumerate(self.tau_s)
        }


@lru_cache(maxsize=8)
def filter_params(modes: tuple[Mode, ...], params: AirborneParams) -> ChannelFilterParams:
    """Settings of the filters: every band and time constant that a mode works with.

    Carriers follow steps of the code by whole milliseconds: some receivers step their clock and apply it to the code
    alone, which would look like a slip on every satellite.
    """
    return ChannelFilterParams(
        bands=tuple(sorted({band for mode in modes for band in bands_of(mode)})),
        slips=SlipParams(
            max_gap_s=params.max_gap_s, receiver_jerk_mps3=params.receiver_jerk_mps3, follow_code_steps=True
        ),
        smoothing=SmoothingParams(
            tau_s=tuple(sorted({mode.smoothing_s for mode in modes}, reverse=True)), max_gap_s=params.max_gap_s
        ),
    )


def track(
    state: TrackState | None, received: Received, modes: tuple[Mode, ...], params: AirborneParams
) -> tuple[TrackState, Tracked]:
    """Smooth the own codes of an epoch with observations; `state` is None before the first."""
    observations = received.observations
    assert observations is not None
    filters = filter_params(modes, params)
    given = observations.code_m, observations.carrier_m, observations.doppler_hz, observations.lli
    code_m, carrier_m, doppler_hz, lli = sensible(np.array(given), _LARGEST)[:, np.newaxis]
    observed = ChannelObservations(code_m, carrier_m, doppler_hz, lli)
    state = TrackState(filters=initial_channel_filter(filters)) if state is None else state
    after, channels = channel_filter_step(state.filters, observed, received.epoch_ms, filters)
    memory, verdict = state.divergence, None
    if any(DIVERGENCE in mode.monitors for mode in modes):
        last_ms = state.filters.last_ms
        dt_s = math.nan if last_ms is None else (received.epoch_ms - last_ms) / 1000.0
        memory, verdict = monitor_divergence(
            memory or DivergenceMemory.initial(params),
            code_m[0],
            channels.carrier_m[0],
            channels.slipped[0],
            dt_s,
            params,
        )
    return TrackState(filters=after, divergence=memory), Tracked(
        received=received, code_m=code_m[0], channels=channels, tau_s=filters.smoothing.tau_s, divergence=verdict
    )
