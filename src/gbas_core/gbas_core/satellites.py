"""The satellite axis: the fixed trailing axis every per-satellite array of the suite has.

All per-satellite arrays have shape ``(..., N_SATS)``: GPS PRN 1-32 first, then Galileo SVID 1-36. A satellite that is
not there is NaN. A fixed axis needs no re-indexing between epochs, receivers and messages, and makes every sum run
over the same places in the same order, so that live, replayed and offline runs agree bit for bit.

Ranging source identifiers follow the VDB (GPS: the PRN). The standard assigns none to Galileo; the suite uses
70 + SVID, a range the standard leaves free, and says so wherever it matters (docs/conventions.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

N_GPS: Final = 32
N_GALILEO: Final = 36
N_SATS: Final = N_GPS + N_GALILEO
GALILEO_SOURCE_ID_OFFSET: Final = 70

SAT_IDS: Final[tuple[str, ...]] = tuple(
    [f"G{prn:02d}" for prn in range(1, N_GPS + 1)] + [f"E{svid:02d}" for svid in range(1, N_GALILEO + 1)]
)
SAT_INDEX: Final[dict[str, int]] = {sat_id: index for index, sat_id in enumerate(SAT_IDS)}

RANGING_SOURCE_ID: Final[NDArray[np.int64]] = np.concatenate(
    [np.arange(1, N_GPS + 1), GALILEO_SOURCE_ID_OFFSET + np.arange(1, N_GALILEO + 1)]
)
SOURCE_ID_INDEX: Final[dict[int, int]] = {int(source): index for index, source in enumerate(RANGING_SOURCE_ID)}

IS_GPS: Final[NDArray[np.bool_]] = np.arange(N_SATS) < N_GPS
IS_GALILEO: Final[NDArray[np.bool_]] = ~IS_GPS
SYSTEM_MASKS: Final[dict[str, NDArray[np.bool_]]] = {"G": IS_GPS, "E": IS_GALILEO}
CLOCK_GROUPS: Final[NDArray[np.bool_]] = np.stack([IS_GPS, IS_GALILEO])
"""Satellites that share one receiver clock in the corrections: one row a constellation, ``(k, N)``."""


def satellites_of(systems: Sequence[str]) -> NDArray[np.bool_]:
    """Mask of the satellites of the named systems.

    Parameters
    ----------
    systems : sequence of str
        System letters as in RINEX, ``"G"`` or ``"E"``; a string such as ``"GE"`` will do.

    Returns
    -------
    (N_SATS,) bool array

    Raises
    ------
    ValueError
        For a letter the suite does not know.
    """
    mask = np.zeros(N_SATS, dtype=bool)
    for letter in systems:
        if letter not in SYSTEM_MASKS:
            raise ValueError(f"satellite system {letter!r} is not one of {', '.join(SYSTEM_MASKS)}")
        mask |= SYSTEM_MASKS[letter]
    return mask


def missing(*leading: int) -> NDArray[np.float64]:
    """Array of shape ``(*leading, N_SATS)`` in which every value is missing (NaN)."""
    return np.full((*leading, N_SATS), np.nan)
