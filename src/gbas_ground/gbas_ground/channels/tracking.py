"""What each reference receiver measured, slip by slip smoothed.

Receivers are on the second last axis, ``(R, N)``, and bands before it in raw data, ``(R, N_BANDS, N)``. A receiver that
misses an epoch keeps its filters: when it comes back within the longest gap, its carrier bridges the gap, if no slip is
found. Receivers are therefore stepped in groups of those that share their last epoch; there is one group while nobody
misses anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from gbas_core.gnss.observations import LARGEST_OBSERVATION, ObservationEpoch
from gbas_core.ranging.slips import SlipParams, SlipResult, SlipState, initial_slips, slip_step
from gbas_core.ranging.smoothing import SmoothingParams, SmoothingState, initial_smoothing, smooth_step
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import missing
from gbas_core.signals import L1, N_BANDS
from gbas_ground.params import GroundParams

_OBSERVED: Final = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")
_MAX_LLI: Final = 9  # one decimal digit in RINEX
_NO_SMOOTHING_TAU_S: Final = 1e-9  # far below any interval: the filter's weight is 1 and its output the raw code


class RawEpoch(NamedTuple):
    """Raw observations of all receivers, ``(R, N_BANDS, N)``; missing is NaN."""

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    cn0_dbhz: FloatArray
    lli: FloatArray
    present: BoolArray
    """Receivers that delivered this epoch, ``(R,)``."""


def stack(observations: Sequence[ObservationEpoch | None], satellites: BoolArray) -> RawEpoch:
    """Bring the receivers' records of one epoch together; nonsense and satellites not in use become missing."""
    values = missing(len(_OBSERVED), len(observations), N_BANDS)
    for row, each in enumerate(observations):
        if each is not None:
            for place, name in enumerate(_OBSERVED):
                values[place, row] = getattr(each, name)
    sensible = (np.abs(values) <= LARGEST_OBSERVATION) & satellites
    code, carrier, doppler, cn0, lli = np.where(sensible, values, np.nan)
    lli = np.where((lli < 0.0) | (lli > _MAX_LLI), 1.0, lli)  # an indicator that means nothing counts as lock lost
    present = np.array([each is not None for each in observations])
    return RawEpoch(code, carrier, doppler, cn0, lli, present)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackGroup:
    """Filters of the receivers that share their last epoch.

    Attributes
    ----------
    receivers : tuple of int
        Rows, rising.
    key : int or None
        Their last epoch [ms since the start of GPS time].
    """

    receivers: tuple[int, ...]
    key: int | None
    slips: SlipState
    smoothing: SmoothingState


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracks:
    """Result of one epoch.

    Attributes
    ----------
    smoothed_m : (tau, R, N) array
        Smoothed ranges [m].
    age_s : (R, N) array
        Time the filters have run [s], NaN where there is none.
    carrier_m : (R, N_BANDS, N) array
        Carriers, continued over steps of the receivers' clocks [m].
    slipped : (R, N_BANDS, N) bool array
        Where the carrier before and this one do not belong together.
    """

    smoothed_m: FloatArray
    age_s: FloatArray
    carrier_m: FloatArray
    slipped: BoolArray


def smoothing_params(params: GroundParams) -> SmoothingParams:
    """Settings of the smoothing filters."""
    return SmoothingParams(
        tau_s=tuple(tau or _NO_SMOOTHING_TAU_S for tau in params.smoothing.tau_s), max_gap_s=params.smoothing.max_gap_s
    )


def initial_tracking(params: GroundParams) -> tuple[TrackGroup, ...]:
    """Filters of a station that has seen nothing."""
    count = params.n_receivers
    smoothing = initial_smoothing(smoothing_params(params), count)
    return (TrackGroup(receivers=tuple(range(count)), key=None, slips=initial_slips(count), smoothing=smoothing),)


def track(
    groups: tuple[TrackGroup, ...], raw: RawEpoch, key: int, range_m: FloatArray, params: GroundParams
) -> tuple[tuple[TrackGroup, ...], Tracks]:
    """Find slips and smooth one epoch.

    Parameters
    ----------
    groups : tuple of TrackGroup
        From the epoch before.
    raw : RawEpoch
    key : int
        Epoch [ms].
    range_m : (R, N) array
        Expected range less satellite clock [m]; NaN where it must not be compared with the epoch before.
    params : GroundParams
    """
    n_receivers = len(raw.present)
    smoothed_m = missing(len(params.smoothing.tau_s), n_receivers)
    age_s = missing(n_receivers)
    carrier_m, slipped = missing(n_receivers, N_BANDS), np.zeros(raw.carrier_m.shape, dtype=bool)
    stepped, waiting = [], []
    for group in groups:
        here = tuple(row for row in group.receivers if raw.present[row])
        away = tuple(row for row in group.receivers if not raw.present[row])
        if away:
            waiting.append(_part(group, away))
        if here:
            new, found = _step(_part(group, here), raw, key, range_m, params)
            rows = list(here)
            smoothed_m[:, rows] = new.smoothing.smoothed_m
            age_s[rows] = new.smoothing.elapsed_s
            carrier_m[rows], slipped[rows] = found.carrier_m, found.slipped
            stepped.append(new)
    tracks = Tracks(smoothed_m=smoothed_m, age_s=age_s, carrier_m=carrier_m, slipped=slipped)
    return (*_merged(stepped), *waiting), tracks


def _step(
    group: TrackGroup, raw: RawEpoch, key: int, range_m: FloatArray, params: GroundParams
) -> tuple[TrackGroup, SlipResult]:
    rows = slice(None) if len(group.receivers) == len(raw.present) else list(group.receivers)
    dt_s = float("nan") if group.key is None else (key - group.key) / 1000.0
    slips, found = slip_step(
        group.slips,
        raw.code_m[rows],
        raw.carrier_m[rows],
        raw.doppler_hz[rows],
        raw.lli[rows],
        dt_s,
        SlipParams(max_gap_s=params.smoothing.max_gap_s, follow_code_steps=True),
        range_m=range_m[rows],
    )
    smoothing, _ = smooth_step(
        group.smoothing,
        raw.code_m[rows][:, L1],
        found.carrier_m[:, L1],
        found.slipped[:, L1],
        dt_s,
        smoothing_params(params),
    )
    return TrackGroup(receivers=group.receivers, key=key, slips=slips, smoothing=smoothing), found


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
    return replace(
        group, receivers=receivers, slips=_taken(group.slips, places), smoothing=_taken(group.smoothing, places)
    )


def _merged(groups: Sequence[TrackGroup]) -> tuple[TrackGroup, ...]:
    """Groups just stepped become one again when their histories have the same interval."""
    if len(groups) < 2 or any(group.slips.dt_s != groups[0].slips.dt_s for group in groups):
        return tuple(groups)
    rows = [row for group in groups for row in group.receivers]
    order = [rows.index(row) for row in sorted(rows)]
    slips = _joined([group.slips for group in groups], order)
    smoothing = _joined([group.smoothing for group in groups], order)
    return (TrackGroup(receivers=tuple(sorted(rows)), key=groups[0].key, slips=slips, smoothing=smoothing),)
