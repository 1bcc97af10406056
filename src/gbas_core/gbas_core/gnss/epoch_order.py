"""Epochs go forward: which epoch of a stream is taken, which is refused, and when time begins anew.

An epoch that is not later than the last one taken is refused. One epoch with a time far ahead would then make
everything after it late for ever; so a stream that goes on in the past is believed in the end.

Uncertain, ours: the standards leave this to the manufacturer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

RESTART_AFTER_REFUSED: Final = 10
"""Epochs refused in a row, each later than the one before, after which they are the time now."""


class Arrival(Enum):
    """What becomes of an epoch."""

    TAKEN = "taken"
    REFUSED = "refused"
    RESTART = "restart"
    """Taken, and all that was remembered of the time before has to be forgotten."""


@dataclass(frozen=True, kw_only=True)
class RefusedEpochs:
    """Epochs refused in a row.

    Attributes
    ----------
    count : int
        How many, each later than the one before.
    last_ms : int
        The last of them [ms since the start of GPS time].
    """

    count: int = 0
    last_ms: int = 0

    def then(self, epoch_ms: int) -> RefusedEpochs:
        """With another one: an earlier one begins the count anew, the same again (of another source) adds nothing."""
        if self.count > 0 and epoch_ms == self.last_ms:
            return self
        later = self.count > 0 and epoch_ms > self.last_ms
        return RefusedEpochs(count=self.count + 1 if later else 1, last_ms=epoch_ms)

    @property
    def restart(self) -> bool:
        """Whether time begins anew with the last of them."""
        return self.count >= RESTART_AFTER_REFUSED


@dataclass(frozen=True, kw_only=True)
class EpochOrder:
    """Where a stream stands in time.

    Attributes
    ----------
    last_ms : int or None
        Last epoch taken [ms since the start of GPS time]; None before the first.
    refused : RefusedEpochs
        Since then.
    """

    last_ms: int | None = None
    refused: RefusedEpochs = RefusedEpochs()

    def step(self, epoch_ms: int) -> tuple[EpochOrder, Arrival]:
        """Where the stream stands after an epoch, and what becomes of that."""
        taken = EpochOrder(last_ms=epoch_ms)
        if self.last_ms is None or epoch_ms > self.last_ms:
            return taken, Arrival.TAKEN
        refused = self.refused.then(epoch_ms)
        return (taken, Arrival.RESTART) if refused.restart else (replace(self, refused=refused), Arrival.REFUSED)

    def since_last_s(self, epoch_ms: int) -> float:
        """Time from the last epoch taken to another one [s]; NaN before the first."""
        return float("nan") if self.last_ms is None else (epoch_ms - self.last_ms) / 1000.0
