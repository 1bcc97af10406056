"""The filter of a receiver's channels, the same at both ends: find slips, then smooth code with carrier.

Slips are sought on all bands, because the bands test one another; smoothed are the bands asked for. Axes are, in this
order, time constants, receivers, bands and satellites; only the smoothed ranges have the first.

Observations that mean nothing (infinite, or larger than any) have to be missing (NaN) already:
:func:`sensible`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gbas_core.gnss.observations import LARGEST_OBSERVATION
from gbas_core.ranging.slips import ChannelObservations, SlipParams, SlipState, initial_slips, slip_step
from gbas_core.ranging.smoothing import Measured, SmoothingParams, SmoothingState, initial_smoothing, smooth_bands
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.signals import N_BANDS


@dataclass(frozen=True, kw_only=True)
class ChannelFilterParams:
    """What the filter is set to.

    Attributes
    ----------
    bands : tuple of int
        Bands that are smoothed, indices of :data:`gbas_core.signals.BANDS`.
    slips : SlipParams
    smoothing : SmoothingParams
        With the time constants; each is run on every band.
    """

    bands: tuple[int, ...]
    slips: SlipParams
    smoothing: SmoothingParams

    def __post_init__(self) -> None:
        if not self.bands or len(set(self.bands)) != len(self.bands) or not set(self.bands) <= set(range(N_BANDS)):
            raise ValueError(f"bands is {self.bands}: it must be distinct numbers of 0 to {N_BANDS - 1}, at least one")

    @cached_property
    def band_array(self) -> IntArray:
        """The bands as an array."""
        return np.array(self.bands, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelFilterState:
    """What the filter remembers of receivers that share their last epoch.

    Attributes
    ----------
    last_ms : int or None
        That epoch [ms since the start of GPS time].
    slips : SlipState
        Arrays (R, N_BANDS, N_SATS).
    smoothing : SmoothingState
        Arrays (R, bands, N_SATS).
    """

    last_ms: int | None
    slips: SlipState
    smoothing: SmoothingState


@dataclass(frozen=True, kw_only=True, eq=False)
class FilteredChannels:
    """Result of one epoch.

    Attributes
    ----------
    bands : tuple of int
        The bands axis of the smoothed ranges and their ages.
    smoothed_m : (tau, R, bands, N_SATS) array
        Smoothed ranges [m].
    age_s : (R, bands, N_SATS) array
        Time the filters have run [s], NaN where there is none.
    carrier_m : (R, N_BANDS, N_SATS) array
        Carriers, continued over steps of the receivers' clocks [m].
    slipped : (R, N_BANDS, N_SATS) bool array
        Where the carrier before and this one do not belong together.
    """

    bands: tuple[int, ...]
    smoothed_m: FloatArray
    age_s: FloatArray
    carrier_m: FloatArray
    slipped: BoolArray

    def smoothed_of(self, band: int) -> FloatArray:
        """Smoothed ranges of one band, (tau, R, N_SATS) [m].

        Raises
        ------
        ValueError
            When that band is not smoothed.
        """
        return self.smoothed_m[:, :, self.bands.index(band)]

    def age_of(self, band: int) -> FloatArray:
        """Time the filters of one band have run, (R, N_SATS) [s]; raises as :meth:`smoothed_of`."""
        return self.age_s[:, self.bands.index(band)]


def initial_channel_filter(params: ChannelFilterParams, n_receivers: int = 1) -> ChannelFilterState:
    """State of a filter that has seen nothing."""
    return ChannelFilterState(
        last_ms=None,
        slips=initial_slips(n_receivers),
        smoothing=initial_smoothing(params.smoothing, n_receivers, len(params.bands)),
    )


def channel_filter_step(
    state: ChannelFilterState, observed: ChannelObservations, epoch_ms: int, params: ChannelFilterParams
) -> tuple[ChannelFilterState, FilteredChannels]:
    """Find slips and smooth one epoch of receivers that share their last epoch.

    Parameters
    ----------
    state : ChannelFilterState
        From :func:`initial_channel_filter` or the previous step.
    observed : ChannelObservations
        Arrays (R, N_BANDS, N_SATS).
    epoch_ms : int
        The epoch [ms since the start of GPS time].
    params : ChannelFilterParams
    """
    dt_s = float("nan") if state.last_ms is None else (epoch_ms - state.last_ms) / 1000.0
    slips, found = slip_step(state.slips, observed, dt_s, params.slips)
    measured = Measured(observed.code_m, found.carrier_m, found.slipped)
    smoothing, smoothed_m = smooth_bands(state.smoothing, measured, params.band_array, dt_s, params.smoothing)
    filtered = FilteredChannels(
        bands=params.bands,
        smoothed_m=smoothed_m,
        age_s=smoothing.elapsed_s,
        carrier_m=found.carrier_m,
        slipped=found.slipped,
    )
    return ChannelFilterState(last_ms=epoch_ms, slips=slips, smoothing=smoothing), filtered


def sensible(values: FloatArray, largest: FloatArray | float = LARGEST_OBSERVATION) -> FloatArray:
    """The values with what is no measurement (infinite, or larger than any can be) missing."""
    return np.where(np.abs(values) <= largest, values, np.nan)
