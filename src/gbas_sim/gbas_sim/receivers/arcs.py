"""Arcs: since when each carrier is held without a break, and what it counts from.

A receiver that loses a carrier and finds it again counts from other whole wavelengths than before. Arcs have numbers:
0 is the one the run begins with, and a carrier that comes back has another. The whole wavelengths are a function of
the seed, the receiver, the signal and the arc's number.

A number has two parts. Satellites set and rise: of that a coarse grid of epochs tells. Everything that interrupts a
signal in the sky (scintillation, power, buildings, an aircraft that banks) has to be followed epoch by epoch from where
it can first happen; epochs asked for out of order make up for what was left out, and are the same to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import BoolArray, IntArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import N_BANDS

LARGEST_JUMP: Final = 1_000_000
"""Whole wavelengths by which later arcs are away from the first, at most."""
# What is kept of earlier answers: the last ones, and some at marks so that going backwards is not from the start.
_RECENT: Final = 8
_MARKED: Final = 128
_MARKS: Final = 32
_PASS: Final = 1 << 40  # more epochs than a run can have
_NO_BREAK: Final[IntArray] = np.zeros((1, 1, 1), dtype=np.int64)


class Breaks:
    """When each signal was last not held.

    Parameters
    ----------
    held : callable
        Which signals are held at an epoch, (R, N_BANDS, N_SATS).
    first : int
        Epoch from which it matters.
    """

    def __init__(self, held: Callable[[int], BoolArray], first: int) -> None:
        self._held, self._first = held, first
        self._recent: dict[int, IntArray] = {}
        self._marks: dict[int, IntArray] = {}

    def at(self, number: int) -> IntArray:
        """Epochs from the first that matters, which is 1, to the last without the signal; 0 if there is none.

        Shape (R, N_BANDS, N_SATS); the epoch `number` itself counts.
        """
        if number < self._first:
            return _NO_BREAK
        known = max((each for each in (*self._recent, *self._marks) if each <= number), default=self._first - 1)
        last = self._recent.get(known, self._marks.get(known, _NO_BREAK))
        for each in range(known + 1, number + 1):
            last = np.where(self._held(each), last, each - self._first + 1)
            if each % _MARKED == 0:
                _keep(self._marks, each, last, _MARKS)
        _keep(self._recent, number, last, _RECENT)
        return last


def _keep(kept: dict[int, IntArray], number: int, value: IntArray, most: int) -> None:
    """Put a value last, and forget the first beyond so many."""
    kept.pop(number, None)
    kept[number] = value
    if len(kept) > most:
        del kept[next(iter(kept))]


class Passes:
    """How often each satellite has been below the mask, on a coarse grid of epochs.

    Parameters
    ----------
    above : callable
        Which satellites are above the mask at an epoch, (R, N_SATS).
    spacing : int
        Of the grid [epochs]. A satellite that is below the mask for less may keep its number.
    """

    def __init__(self, above: Callable[[int], BoolArray], spacing: int) -> None:
        self._above, self._spacing = above, spacing
        self._counts: list[NDArray[np.int16]] = []

    def at(self, number: int) -> IntArray:
        """Places of the grid up to an epoch at which satellites were below the mask, (R, N_SATS)."""
        place = max(number, 0) // self._spacing
        while len(self._counts) <= place:
            below = ~self._above(len(self._counts) * self._spacing)
            self._counts.append(below.astype(np.int16) + (self._counts[-1] if self._counts else 0))
        return self._counts[place].astype(np.int64)


def arc_numbers(passes: IntArray, breaks: IntArray | None) -> IntArray:
    """Numbers of arcs ``(R, N_BANDS, N_SATS)`` of passes ``(R, N_SATS)`` and breaks."""
    numbers = np.broadcast_to((_PASS * passes)[:, np.newaxis, :], (len(passes), N_BANDS, N_SATS))
    return numbers if breaks is None else numbers + breaks


def jumps(seed: int, receivers: tuple[int, ...], arcs: IntArray) -> IntArray:
    """Whole wavelengths ``(R, N_BANDS, N_SATS)`` that arcs are away from the first: from -10^6 to 10^6, but 0 for it.

    Source of the mixing: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
    """
    words = np.uint64(seed) ^ _mixed(np.array(receivers, dtype=np.uint64))[:, np.newaxis, np.newaxis]
    words = _mixed(words + np.arange(N_BANDS * N_SATS, dtype=np.uint64).reshape(N_BANDS, N_SATS))
    words = _mixed(words ^ arcs.astype(np.uint64))
    drawn = (words % np.uint64(2 * LARGEST_JUMP)).astype(np.int64) - LARGEST_JUMP
    return np.where(arcs == 0, 0, np.where(drawn >= 0, drawn + 1, drawn))


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The 64-bit mixing of SplitMix."""
    words = words + np.uint64(0x9E3779B97F4A7C15)
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))
