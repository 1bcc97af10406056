# mypy: disable-error-code="no-untyped-call"
"""What each reference receiver measured, slips found and smoothed by :mod:`gbas_core.ranging.channel_filter`.

Axes are receivers, bands and satellites, ``(R, N_BANDS, N)``. A receiver that misses an epoch keeps its filters: when
it comes back within the longest gap, its carrier bridges the gap, if no slip is found. Receivers are therefore stepped
in groups of those that share their last epoch; there is one group while nobody misses anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.ranging.channel_filter import (
    ChannelFilterParams,
    ChannelFilterState,
    FilteredChannels,
    channel_filter_step,
    initial_channel_filter,
)
from gbas_core.ranging.slips import ChannelObservations, SlipParams, SlipState
from gbas_core.ranging.smoothing import SmoothingParams, SmoothingState
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import missing
from gbas_core.signals import L1, N_BANDS
from gbas_ground.channels.kernels.channels import keep_sensible
from gbas_ground.params import GroundParams

_OBSERVED: Final = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")
SMOOTHED_BANDS: Final = (L1,)
"""Bands whose codes every station smooths: those there are always corrections of."""


class RawEpoch(NamedTuple):
    """Raw observations of all receivers, ``(R, N_BANDS, N)``; missing is NaN."""

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    cn0_dbhz: FloatArray
    lli: FloatArray
    present: BoolArray
    """Receivers that delivered this epoch, ``(R,)``."""

    def channels(self, range_m: FloatArray) -> ChannelObservations:
        """What slips are sought in; with known ranges ``(R, N)`` [m]."""
        return ChannelObservations(self.code_m, self.carrier_m, self.doppler_hz, self.lli, range_m)


def stack(observations: Sequence[ObservationEpoch | None], satellites: BoolArray) -> RawEpoch:
    """Bring the receivers' records of one epoch together; nonsense and satellites not in use become missing."""
    values = missing(len(_OBSERVED), len(observations), N_BANDS)
    for row, each in enumerate(observations):
        if each is not None:
            for place, name in enumerate(_OBSERVED):
                values[place, row] = getattr(each, name)
    keep_sensible(values, satellites)
    present = np.array([each is not None for each in observations])
    code, carrier, doppler, cn0, lli = values
    return RawEpoch(code, carrier, doppler, cn0, lli, present)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackGroup:
    """Filters of the receivers that share their last epoch.

    Attributes
    ----------
    receivers : tuple of int
        Rows, rising.
    filters : ChannelFilterState
    """

    receivers: tuple[int, ...]
    filters: ChannelFilterState


Tracks = FilteredChannels
"""Result of one epoch, all receivers; NaN for those that are not there."""


def filter_params(params: GroundParams, bands: tuple[int, ...] = SMOOTHED_BANDS) -> ChannelFilterParams:
    """Settings of the channels' filters."""
    return ChannelFilterParams(
        bands=bands,
        slips=SlipParams(max_gap_s=params.smoothing.max_gap_s, follow_code_steps=True),
        smoothing=SmoothingParams(tau_s=params.smoothing.tau_s, max_gap_s=params.smoothing.max_gap_s),
    )


def initial_tracking(filters: ChannelFilterParams, n_receivers: int) -> tuple[TrackGroup, ...]:
    """Filters of a station that has seen nothing."""
    return (TrackGroup(receivers=tuple(range(n_receivers)), filters=initial_channel_filter(filters, n_receivers)),)


def track(
    groups: tuple[TrackGroup, ...], raw: RawEpoch, epoch_ms: int, range_m: FloatArray, filters: ChannelFilterParams
) -> tuple[tuple[TrackGroup, ...], Tracks]:
    """Find slips and smooth one epoch.

    Parameters
    ----------
    groups : tuple of TrackGroup
        From the epoch before.
    raw : RawEpoch
    epoch_ms : int
        Epoch [ms since the start of GPS time].
    range_m : (R, N) array
        Expected range less satellite clock [m]; NaN where it must not be compared with the epoch before.
    filters : ChannelFilterParams
        As the groups began with.
    """
    if len(groups) == 1 and raw.present.all():
        state, tracks = channel_filter_step(groups[0].filters, raw.channels(range_m), epoch_ms, filters)
        return (TrackGroup(receivers=groups[0].receivers, filters=state),), tracks
    n_receivers, n_bands = len(raw.present), len(filters.bands)
    smoothed_m = missing(len(filters.smoothing.tau_s), n_receivers, n_bands)
    age_s = missing(n_receivers, n_bands)
    carrier_m, slipped = missing(n_receivers, N_BANDS), np.zeros(raw.carrier_m.shape, dtype=bool)
    stepped, waiting = [], []
    for group in groups:
        here = tuple(row for row in group.receivers if raw.present[row])
        away = tuple(row for row in group.receivers if not raw.present[row])
        if away:
            waiting.append(_part(group, away))
        if here:
            rows = list(here)
            observed = ChannelObservations(*(each[rows] for each in raw.channels(range_m) if each is not None))
            state, found = channel_filter_step(_part(group, here).filters, observed, epoch_ms, filters)
            smoothed_m[:, rows], age_s[rows] = found.smoothed_m, found.age_s
            carrier_m[rows], slipped[rows] = found.carrier_m, found.slipped
            stepped.append(TrackGroup(receivers=here, filters=state))
    tracks = Tracks(bands=filters.bands, smoothed_m=smoothed_m, age_s=age_s, carrier_m=carrier_m, slipped=slipped)
    return (*_merged(stepped), *waiting), tracks


_State = TypeVar("_State", SlipState, SmoothingState)


def _receiver_axis(name: str) -> int:
    """Axis of the receivers: the smoothed range has the time constants before it."""
    return 1 if name == "smoothed_m" else 0


def _arrays(state: Any) -> list[tuple[str, FloatArray]]:
    values = [(item.name, getattr(state, item.name)) for item in fields(state)]
    return [(name, value) for name, value in values if isinstance(value, np.ndarray)]


def _taken(state: _State, places: list[int]) -> _State:
    taken: dict[str, Any] = {name: np.take(value, places, axis=_receiver_axis(name)) for name, value in _arrays(state)}
    return replace(state, **taken)


def _joined(states: Sequence[_State], order: list[int]) -> _State:
    joined: dict[str, Any] = {}
    for name, _ in _arrays(states[0]):
        axis = _receiver_axis(name)
        joined[name] = np.take(np.concatenate([getattr(state, name) for state in states], axis=axis), order, axis=axis)
    return replace(states[0], **joined)


def _part(group: TrackGroup, receivers: tuple[int, ...]) -> TrackGroup:
    """The group of some of its receivers."""
    if receivers == group.receivers:
        return group
    places = [group.receivers.index(row) for row in receivers]
    old = group.filters
    filters = replace(old, slips=_taken(old.slips, places), smoothing=_taken(old.smoothing, places))
    return TrackGroup(receivers=receivers, filters=filters)


def _merged(groups: Sequence[TrackGroup]) -> tuple[TrackGroup, ...]:
    """Groups just stepped become one again when their histories have the same interval."""
    if len(groups) < 2 or any(group.filters.slips.dt_s != groups[0].filters.slips.dt_s for group in groups):
        return tuple(groups)
    rows = [row for group in groups for row in group.receivers]
    order = [rows.index(row) for row in sorted(rows)]
    filters = replace(
        groups[0].filters,
        slips=_joined([group.filters.slips for group in groups], order),
        smoothing=_joined([group.filters.smoothing for group in groups], order),
    )
    return (TrackGroup(receivers=tuple(sorted(rows)), filters=filters),)
