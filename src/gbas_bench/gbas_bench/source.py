"""The source of the benchmark's live runs: a simulated world made beforehand, so that its making costs no time then."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from gbas_bench.world import crowded
from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_node.pacing import Playback
from gbas_node.serving import run
from gbas_sim.nodes.simulator import Simulator, SimulatorParams
from gbas_sim.simulated_epochs import SimulatedEpoch
from gbas_sim.world import World


@parameters
class BenchSourceParams(SimulatorParams):
    """Parameters of the source."""

    epochs: Annotated[int, Parameter("how many are sent", "epochs", 1, 4000)] = 100
    ahead_epochs: Annotated[
        int,
        Parameter(
            "so many of the first are sent as fast as the readers take them, to settle the filters", "epochs", 0, 4000
        ),
    ] = 0

    def __post_init__(self) -> None:
        if self.ahead_epochs > self.epochs:
            raise ParameterError(f"ahead_epochs = {self.ahead_epochs} is more than epochs = {self.epochs}")


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
