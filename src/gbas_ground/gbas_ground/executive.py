"""The executive: who is excluded, why, and when use may begin again.

Channels (receiver and satellite), satellites and receivers each have a :class:`Latch`. A monitor's failure sets it. It
opens again only after the re-admission time in which every monitor that applies was seen to pass: an epoch in which
that could not be seen starts the time anew, and a gap in the data counts nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import FloatArray
from gbas_ground.causes import ExclusionCause
from gbas_ground.corrections import BoolArray
from gbas_msgs_py.records import ChannelState

IntArray = NDArray[np.int64]
_NONE = int(ExclusionCause.NONE)  # comparing arrays with members of an enumeration is slow


@dataclass(frozen=True, kw_only=True, eq=False)
class Latch:
    """Exclusions of one kind of thing.

    Attributes
    ----------
    cause : (...) int array
        :class:`ExclusionCause`; 0 where there is no exclusion. The first cause stays until the exclusion ends.
    clear_s : (...) array
        Time since the last epoch that failed or could not be judged [s].
    """

    cause: IntArray
    clear_s: FloatArray

    @cached_property
    def excluded(self) -> BoolArray:
        """Mask of what is excluded."""
        return np.asarray(self.cause != _NONE)

    @cached_property
    def state(self) -> FloatArray:
        """:class:`ChannelState` of what is excluded: RECOVERING where the clear time counts, else EXCLUDED."""
        return np.where(self.clear_s > 0.0, float(ChannelState.RECOVERING), float(ChannelState.EXCLUDED))


def initial_latch(*shape: int) -> Latch:
    """A latch with nothing excluded."""
    return Latch(cause=np.zeros(shape, dtype=np.int64), clear_s=np.zeros(shape))


def release(latch: Latch, readmission_s: float) -> tuple[Latch, BoolArray]:
    """End the exclusions that have been clear long enough; returns the mask of those. Called when an epoch begins."""
    ended = latch.excluded & (latch.clear_s >= readmission_s)
    if not ended.any():
        return latch, ended
    return Latch(cause=np.where(ended, 0, latch.cause), clear_s=np.where(ended, 0.0, latch.clear_s)), ended


def exclude(latch: Latch, failed: BoolArray, cause: ExclusionCause) -> Latch:
    """Exclude what failed; what is excluded already keeps its cause and starts its clear time anew."""
    if not failed.any():
        return latch
    return Latch(
        cause=np.where(failed & ~latch.excluded, int(cause), latch.cause),
        clear_s=np.where(failed, 0.0, latch.clear_s),
    )


def advance(latch: Latch, passed: BoolArray, dt_s: float, max_gap_s: float) -> Latch:
    """Count the clear time of one epoch. Called when an epoch ends.

    Parameters
    ----------
    latch : Latch
    passed : (...) bool array
        What every monitor that applies was seen to pass at this epoch.
    dt_s : float
        Time since the epoch before [s]; NaN when there was none.
    max_gap_s : float
        A longer time counts nothing [s].
    """
    if not latch.excluded.any():
        return latch
    counted = dt_s if 0.0 < dt_s <= max_gap_s else 0.0
    return Latch(cause=latch.cause, clear_s=np.where(latch.excluded & passed, latch.clear_s + counted, 0.0))
