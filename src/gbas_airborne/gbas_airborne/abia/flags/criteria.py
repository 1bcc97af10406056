"""The rules of each cause at one time, without memory.

Comparisons are written such that one with a missing number is the worse outcome.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gbas_airborne.abia.flags.causes import Level
from gbas_airborne.abia.flags.epoch import Approach, FlagEpoch
from gbas_airborne.abia.flags.params import FlagParams
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.signal.loop_thresholds import (
    PHASE_LIMIT_RAD,
    Motion,
    code_three_sigma_chips,
    frequency_limit_hz,
    frequency_three_sigma_hz,
    phase_three_sigma_rad,
)


class Limits(NamedTuple):
    """Bounds a value has to keep."""

    caution: float
    warning: float


def above(value: FloatArray, limits: Limits) -> IntArray:
    """Levels of values that are to stay at or below limits."""
    return _levels(value <= limits.caution, value <= limits.warning)


def below(value: FloatArray, limits: Limits) -> IntArray:
    """Levels of values that are to stay at or above limits."""
    return _levels(value >= limits.caution, value >= limits.warning)


def _levels(well: BoolArray, still: BoolArray) -> IntArray:
    return np.where(still, np.where(well, Level.CLEAR, Level.CAUTION), Level.WARNING).astype(np.int64)


def signal_levels(epoch: FlagEpoch, params: FlagParams) -> IntArray:
    """C/N0 of satellites, (N,): below 25 dB-Hz or 10 dB after correlation is a warning, 27 and 12 a caution.

    Source: Sabatini et al., IV.H; with its numbers the second criterion, 30 and 32 dB-Hz, is the one that binds.
    """
    return below(epoch.cn0_dbhz, Limits(params.signal.caution_dbhz, params.signal.warning_dbhz))


def tracking_levels(epoch: FlagEpoch, params: FlagParams) -> IntArray:
    """Loops of satellites, (N,): three sigmas with dynamic stress beyond 45 degrees, 1/(4T) or the spacing d.

    Source: Sabatini et al., eq (42), (50), (53) and IV.H.
    """
    motion = Motion(0.0, epoch.acceleration_mps2, epoch.jerk_mps3)
    loops, share = params.loops, params.loop_caution_share
    worst = np.zeros(epoch.cn0_dbhz.size, dtype=np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        for value, limit in (
            (phase_three_sigma_rad(loops, epoch.cn0_dbhz, motion), PHASE_LIMIT_RAD),
            (frequency_three_sigma_hz(loops, epoch.cn0_dbhz, motion), frequency_limit_hz(loops)),
            (code_three_sigma_chips(loops, epoch.cn0_dbhz, motion), loops.spacing_chips),
        ):
            worst = np.maximum(worst, above(value, Limits(share * limit, limit)))
    return worst


def multipath_levels(epoch: FlagEpoch, params: FlagParams) -> IntArray | None:
    """Multipath of satellites, (N,): early-late phase is caution, range error a warning; None with neither.

    A satellite that lacks what others have is cautioned of.

    Source: Sabatini et al., IV.H.
    """
    if epoch.early_late_rad is None and epoch.multipath_m is None:
        return None
    worst = np.zeros(epoch.cn0_dbhz.size, dtype=np.int64)
    if epoch.early_late_rad is not None:
        quiet = np.abs(epoch.early_late_rad) <= params.early_late_caution_rad
        worst = np.where(quiet, worst, Level.CAUTION)
    if epoch.multipath_m is not None:
        error_m = np.abs(epoch.multipath_m)
        worst = np.where(error_m > params.multipath_warning_m, Level.WARNING, worst)
        worst = np.where(np.isnan(error_m), np.maximum(worst, Level.CAUTION), worst)
    return worst.astype(np.int64)


def system_level(satellites: IntArray, seen: BoolArray, required: int) -> Level:
    """Level for the aircraft of a cause of satellites: whether enough of those seen have no flag of it."""
    if int((seen & (satellites < Level.WARNING)).sum()) < required:
        return Level.WARNING
    return Level.CLEAR if int((seen & (satellites == Level.CLEAR)).sum()) >= required else Level.CAUTION


def protection_level(approach: Approach | None) -> Level | None:
    """Warning when a protection level exceeds its alert limit, or one of them is missing; None without an approach.

    Source: Sabatini et al., IV.H.
    """
    if approach is None:
        return None
    within = approach.vpl_m <= approach.val_m and approach.lpl_m <= approach.lal_m
    return Level.CLEAR if within else Level.WARNING


def service_level(approach: Approach | None) -> Level | None:
    """Warning without the service an approach is flown on; None without an approach."""
    if approach is None:
        return None
    return Level.CLEAR if approach.served else Level.WARNING
