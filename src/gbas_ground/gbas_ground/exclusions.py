"""Exclusions: who is excluded, why, and when use may begin again.

Channels (receiver and satellite), satellites and receivers each have a :class:`Latch`. A monitor's failure sets it. It
opens again only after the re-admission time in which every monitor that applies was seen to pass: an epoch in which
that could not be seen starts the time anew, and a gap in the data counts nothing.

What is excluded again soon after it came back waits twice as long, and so on up to a longest time: a fault that hides
from its monitor for a minute at a time must not come back every minute. Something that was free for the longest time
starts anew. A false exclusion costs the re-admission time, a second one within the longest time twice that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_msgs_py.codes import ChannelState, ExclusionCause

_NONE = int(ExclusionCause.NONE)  # comparing arrays with members of an enumeration is slow


@dataclass(frozen=True, kw_only=True, eq=False)
class Latch:
    """Exclusions of one kind of thing.

    Attributes
    ----------
    cause : (...) int array
        :class:`ExclusionCause`; 0 where there is no exclusion. The first cause stays until the exclusion ends.
    clear_s : (...) array
        Time since the last epoch that failed or could not be judged [s]; of what is free and has been excluded not long
        ago, the time since then.
    wait_s : (...) array
        Time that the exclusion lasts at least, or the next one would; 0 is the re-admission time [s].
    """

    cause: IntArray
    clear_s: FloatArray
    wait_s: FloatArray

    @cached_property
    def excluded(self) -> BoolArray:
        """Mask of what is excluded."""
        return np.asarray(self.cause != _NONE)

    @cached_property
    def remembers(self) -> bool:
        """Whether anything is excluded, or was not long ago."""
        return bool(self.excluded.any() or (self.wait_s > 0.0).any())

    @cached_property
    def state(self) -> FloatArray:
        """:class:`ChannelState` of what is excluded: RECOVERING where the clear time counts, else EXCLUDED."""
        return np.where(self.clear_s > 0.0, float(ChannelState.RECOVERING), float(ChannelState.EXCLUDED))


def initial_latch(*shape: int) -> Latch:
    """A latch with nothing excluded."""
    return Latch(cause=np.zeros(shape, dtype=np.int64), clear_s=np.zeros(shape), wait_s=np.zeros(shape))


def release(latch: Latch, readmission_s: float, longest_s: float) -> tuple[Latch, BoolArray]:
    """End the exclusions that have been clear long enough; returns the mask of those. Called when an epoch begins.

    Parameters
    ----------
    latch : Latch
    readmission_s : float
        Clear time of a first exclusion [s].
    longest_s : float
        Clear time of any, and the time after which one counts as the first again; not less than the other counts [s].
    """
    longest_s = max(longest_s, readmission_s)
    if not latch.remembers:
        return latch, latch.excluded
    wait_s = np.maximum(latch.wait_s, readmission_s)
    ended = latch.excluded & (latch.clear_s >= wait_s)
    forgotten = ~latch.excluded & (latch.clear_s >= longest_s)
    if not (ended | forgotten).any():
        return latch, ended
    next_s = np.where(ended, np.minimum(2.0 * wait_s, longest_s), latch.wait_s)
    return (
        Latch(
            cause=np.where(ended, 0, latch.cause),
            clear_s=np.where(ended | forgotten, 0.0, latch.clear_s),
            wait_s=np.where(forgotten, 0.0, next_s),
        ),
        ended,
    )


def exclude(latch: Latch, failed: BoolArray, cause: ExclusionCause) -> Latch:
    """Exclude what failed; what is excluded already keeps its cause and starts its clear time anew."""
    if not failed.any():
        return latch
    return replace(
        latch,
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
    if not latch.remembers:
        return latch
    counted = dt_s if 0.0 < dt_s <= max_gap_s else 0.0
    counts = np.where(latch.excluded, passed, latch.wait_s > 0.0)
    return replace(latch, clear_s=np.where(counts, latch.clear_s + counted, 0.0))
