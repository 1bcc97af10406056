"""The source of the benchmark's live runs: a simulated world made beforehand, so that its making costs no time then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from gbas_bench.world import crowded
from gbas_node.node import require, run
from gbas_node.pacing import Playback
from gbas_sim.nodes.simulator import Simulator, SimulatorParams
from gbas_sim.world import SimulatedEpoch, World


@dataclass(frozen=True, kw_only=True)
class BenchSourceParams(SimulatorParams):
    """Parameters of the source.

    Attributes
    ----------
    epochs : int
        How many are sent.
    ahead_epochs : int
        So many of the first are sent as fast as the readers take them, to settle the filters.
    """

    epochs: int = 100
    ahead_epochs: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        require("epochs", self.epochs, 1 <= self.epochs <= 4000, "1 to 4000")
        require("ahead_epochs", self.ahead_epochs, 0 <= self.ahead_epochs <= self.epochs, "0 to epochs")


class BenchSource(Simulator):
    """Sends the benchmark's world."""

    params_type = BenchSourceParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._made = [self.world.epoch(number) for number in range(self.params.epochs)]
        ahead = self.params.ahead_epochs
        if ahead:
            self._playback = _PacedFrom(self.params.speed, self._made[min(ahead, len(self._made) - 1)].key)

    def make_world(self) -> World:
        return crowded(super().make_world().params)

    def epochs(self) -> Iterator[SimulatedEpoch]:
        return iter(self._made)


class _PacedFrom(Playback):
    """Plays back at its speed from an epoch on; what comes before is due at once."""

    def __init__(self, speed: float, first_key: int) -> None:
        super().__init__(speed)
        self._first_key = first_key

    def delay_s(self, key: int, now_s: float) -> float:
        return 0.0 if key < self._first_key else super().delay_s(key, now_s)


def main() -> None:
    """Console script."""
    run(BenchSource)


if __name__ == "__main__":
    main()
