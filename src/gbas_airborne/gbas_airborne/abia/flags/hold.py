"""What keeps flags from flickering: warnings come at once and go late, cautions wait only while no loss is near."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_airborne.abia.flags.causes import Level
from gbas_airborne.abia.flags.params import FlagParams
from gbas_core.record import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Held:
    """Memory of some flags, any shape.

    Attributes
    ----------
    caution_for_s : array
        For how long there has been cause for a caution at least, 0 without.
    since_caution_s, since_warning_s : arrays
        How long ago there was last cause, infinite when never; of cautions that were raised.
    """

    caution_for_s: FloatArray
    since_caution_s: FloatArray
    since_warning_s: FloatArray

    @classmethod
    def nothing(cls, shape: tuple[int, ...]) -> Held:
        """Flags that have never been raised."""
        never = np.full(shape, np.inf)
        return cls(caution_for_s=np.zeros(shape), since_caution_s=never, since_warning_s=never)


def held_levels(
    state: Held, raw: IntArray, urgent: BoolArray, elapsed_s: float, params: FlagParams
) -> tuple[Held, IntArray]:
    """Levels after holding.

    Parameters
    ----------
    raw : int array
        Levels by the criteria alone; none of them is lowered but a caution that waits.
    urgent : bool array
        Cautions that do not wait.
    elapsed_s : float
        Since the last epoch.
    """
    cause = raw >= Level.CAUTION
    caution_for_s = np.where(cause, state.caution_for_s + elapsed_s, 0.0)
    # the first epoch counts as a moment: with no wait it raises at once
    waited = cause & (urgent | (caution_for_s - elapsed_s >= params.caution_wait_s) | (raw == Level.WARNING))
    since_caution_s = np.where(waited, 0.0, state.since_caution_s + elapsed_s)
    since_warning_s = np.where(raw == Level.WARNING, 0.0, state.since_warning_s + elapsed_s)
    level = np.where(since_caution_s <= params.caution_hold_s * (since_caution_s > 0.0), Level.CAUTION, Level.CLEAR)
    level = np.where(since_warning_s <= params.warning_hold_s * (since_warning_s > 0.0), Level.WARNING, level)
    memory = Held(caution_for_s=caution_for_s, since_caution_s=since_caution_s, since_warning_s=since_warning_s)
    return memory, level.astype(np.int64)
