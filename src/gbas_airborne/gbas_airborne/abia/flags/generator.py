"""The integrity flag generator: one epoch of what is known in, the flags of all causes out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gbas_airborne.abia.airframe.mask_table import MaskTable
from gbas_airborne.abia.flags.ahead import (
    GeometryAhead,
    LevelsAhead,
    geometries,
    geometry_ahead,
    levels_ahead,
)
from gbas_airborne.abia.flags.causes import SATELLITE_CAUSES, Cause, Level
from gbas_airborne.abia.flags.criteria import (
    multipath_levels,
    protection_level,
    service_level,
    signal_levels,
    system_level,
    tracking_levels,
)
from gbas_airborne.abia.flags.epoch import FlagEpoch, Flags
from gbas_airborne.abia.flags.hold import Held, held_levels
from gbas_airborne.abia.flags.params import FlagParams
from gbas_airborne.abia.prediction.look_ahead import seen_at, usable_los
from gbas_airborne.abia.prediction.predictors import Prediction, PredictionState, predict
from gbas_core.record import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FlagState:
    """What is remembered between epochs; satellites None before the first."""

    time_s: float = math.nan
    prediction: PredictionState = field(default_factory=PredictionState)
    system: Held | None = None
    satellites: Held | None = None


def step(state: FlagState, epoch: FlagEpoch, params: FlagParams) -> tuple[FlagState, Flags]:
    """Advance the flags by one epoch.

    Parameters
    ----------
    state : FlagState
    epoch : FlagEpoch
    params : FlagParams

    Returns
    -------
    state : FlagState
    flags : Flags
        A warning is in the flags of the epoch that has its cause.
    """
    memory, prediction = predict(state.prediction, epoch.ahead, params.prediction)
    raw, unmonitored = _satellites(epoch, prediction, params)
    found = geometries(epoch, prediction, params)
    geometry, levels = geometry_ahead(epoch, found, params), levels_ahead(epoch, found)
    system, times_s, more = _system(epoch, prediction, raw, (geometry, levels), params)
    urgent = ~(times_s > params.urgent_s)
    near = np.broadcast_to(~(prediction.satellite_loss_s > params.urgent_s), raw.shape)
    elapsed_s = epoch.ahead.time_s - state.time_s
    if not 0.0 < elapsed_s <= params.max_gap_s:  # nor after the first epoch
        elapsed_s, state = 0.0, FlagState()
    system_held, system = held_levels(_held(state.system, system.shape), system, urgent, elapsed_s, params)
    satellites_held, satellites = held_levels(_held(state.satellites, raw.shape), raw, near, elapsed_s, params)
    flags = Flags(
        time_s=epoch.ahead.time_s,
        system=system,
        satellites=satellites,
        unmonitored=(*unmonitored, *more),
        time_to_warning_s=np.where(system == Level.WARNING, 0.0, times_s),
        satellite_time_to_warning_s=np.where(raw[Cause.MASKING] == Level.WARNING, 0.0, prediction.satellite_loss_s),
        predicted_vpl_m=levels.vpl_m if levels else math.nan,
        predicted_lpl_m=levels.lpl_m if levels else math.nan,
        prediction=prediction,
    )
    return (
        FlagState(time_s=epoch.ahead.time_s, prediction=memory, system=system_held, satellites=satellites_held),
        flags,
    )


def _held(memory: Held | None, shape: tuple[int, ...]) -> Held:
    """What is remembered of flags of that shape, or nothing."""
    return memory if memory is not None and memory.caution_for_s.shape == shape else Held.nothing(shape)


def _satellites(epoch: FlagEpoch, prediction: Prediction, params: FlagParams) -> tuple[IntArray, tuple[Cause, ...]]:
    """Levels of the causes of satellites, (4, N), and what cannot be looked at; of satellites that are due only."""
    due = np.isfinite(usable_los(epoch.ahead.los_enu, params.prediction.elevation_mask_rad)[2])
    raw = np.zeros((len(SATELLITE_CAUSES), due.size), dtype=np.int64)
    raw[Cause.MASKING] = np.where(
        prediction.seen,
        np.where(prediction.satellite_probability >= params.prediction.caution_probability, Level.CAUTION, Level.CLEAR),
        Level.WARNING,
    )
    raw[Cause.SIGNAL] = signal_levels(epoch, params)
    raw[Cause.TRACKING] = tracking_levels(epoch, params)
    multipath = multipath_levels(epoch, params)
    if multipath is not None:
        raw[Cause.MULTIPATH] = multipath
    raw[:, ~due] = Level.CLEAR
    # a satellite that is masked is not blamed for its signal
    raw[Cause.SIGNAL :, ~prediction.seen] = Level.CLEAR
    return raw, () if multipath is not None else (Cause.MULTIPATH,)


def _system(
    epoch: FlagEpoch, prediction: Prediction, raw: IntArray, ahead: tuple[GeometryAhead, LevelsAhead | None],
    params: FlagParams,
) -> tuple[IntArray, FloatArray, tuple[Cause, ...]]:  # fmt: skip
    """Levels for the aircraft, (8,), times to warnings, (8,), and what cannot be looked at."""
    geometry, levels = ahead
    unknown = math.inf if prediction.available else math.nan
    times_s = np.full(len(Cause), unknown)
    system = np.zeros(len(Cause), dtype=np.int64)
    required = params.prediction.required_satellites
    for cause in SATELLITE_CAUSES[1:]:
        system[cause] = system_level(raw[cause], prediction.seen, required)
    system[Cause.MASKING] = _masking(epoch, prediction, params)
    times_s[Cause.MASKING] = prediction.loss_s
    system[Cause.GEOMETRY] = _level(geometry.exceeded, geometry.missed or geometry.missed_s < math.inf)
    times_s[Cause.GEOMETRY] = geometry.exceeded_s if prediction.available else math.nan
    system[Cause.PREDICTION] = _level(False, not prediction.available or bool(prediction.restriction))
    unmonitored = []
    protection, service = protection_level(epoch.approach), service_level(epoch.approach)
    if protection is None or service is None:
        unmonitored += [Cause.PROTECTION, Cause.SERVICE]
    else:
        predicted_s = levels.exceeded_s if levels else math.nan
        system[Cause.PROTECTION] = max(protection, _level(False, predicted_s != math.inf))
        times_s[Cause.PROTECTION] = predicted_s
        system[Cause.SERVICE] = service
    return system, times_s, tuple(unmonitored)


def _level(warning: bool, caution: bool) -> Level:
    return Level.WARNING if warning else Level.CAUTION if caution else Level.CLEAR


def _masking(epoch: FlagEpoch, prediction: Prediction, params: FlagParams) -> Level:
    """Too few satellites are seen, or just enough and one of them is too low in the antenna's frame: warning.

    Without attitude or satellites nothing is known to be seen: that is a warning, too.

    Source: Sabatini et al., IV.H.
    """
    count, required = int(prediction.seen.sum()), params.prediction.required_satellites
    if count < required:
        return Level.WARNING
    if count == required and _any_low(epoch, prediction.seen, params):
        return Level.WARNING
    return _level(False, prediction.caution)


def _any_low(epoch: FlagEpoch, seen: BoolArray, params: FlagParams) -> bool:
    mask, attitude = epoch.ahead.mask, epoch.ahead.attitude
    low = MaskTable(
        blocked=mask.blocked, horizon_rad=max(params.warning_elevation_rad, mask.horizon_rad), axis=mask.axis
    )
    los = usable_los(epoch.ahead.los_enu, params.prediction.elevation_mask_rad)
    angles = np.array([attitude.bank_rad, attitude.pitch_rad, attitude.heading_rad])
    return bool((seen & ~seen_at(angles, los, low)).any())
