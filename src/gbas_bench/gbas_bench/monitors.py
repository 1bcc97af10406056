"""The station's monitors in the benchmark: all of them, in the running station, with a crowded sky."""

from __future__ import annotations

import statistics
import time
from typing import Any, Final
from unittest import mock

import yaml

from gbas_bench.figures import Figure, Part
from gbas_bench.offline import SETTLE_EPOCHS
from gbas_bench.world import bench_config, bench_world
from gbas_core.errors import GbasError
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_ground.params import GroundParams
from gbas_ground.stages import correct, monitor
from gbas_ground.station import GroundEpoch, GroundStation
from gbas_msgs_py.codes import ChannelState

BUDGET_S: Final = 2e-3
SATELLITES_A_SYSTEM: Final = 20
_MEASURED: Final = ((monitor, "run_monitors"), (correct, "monitor_sigmas"))
"""The station's functions that run the monitors of signals and of B values."""


def measure_monitors(n_epochs: int) -> Part:
    """Processor time of all monitors at one epoch, median of so many epochs after the filters have settled."""
    world = bench_world(SATELLITES_A_SYSTEM)
    ground = yaml.safe_load(bench_config().read_text(encoding="utf-8"))["/**"]["ros__parameters"]["ground"]
    params = GroundParams.from_mapping(ground)
    station = GroundStation(params)
    state, spent_s = station.initial_integrity(), []
    ephemerides: tuple[Ephemeris, ...] = (world.ephemeris,)
    with _Timer() as timer:
        for number in range(SETTLE_EPOCHS + n_epochs):
            made = world.epoch(number)
            week, tow_s = from_epoch_key(made.key)
            epoch = GroundEpoch(gps_week=week, tow_s=tow_s, observations=made.ground, ephemerides=ephemerides)
            timer.spent_s = 0.0
            state, monitored = station.monitor(state, epoch)
            spent_s.append(timer.spent_s)
            ephemerides = ()
    used = int((monitored.integrity.state == ChannelState.USABLE).sum())
    if used != 2 * SATELLITES_A_SYSTEM:
        raise GbasError(f"the benchmark's station uses {used} satellites, not {2 * SATELLITES_A_SYSTEM}")
    figure = Figure(
        part="monitors", name=f"all monitors, {params.n_receivers} receivers x {used} satellites x 2 bands, an epoch",
        value=1e3 * statistics.median(spent_s[SETTLE_EPOCHS:]), unit="ms", against=f"bound {1e3 * BUDGET_S:g} ms",
        reference=1e3 * BUDGET_S, better="less",
    )  # fmt: skip
    about = f"Processor time within the station's step, median of {n_epochs} epochs; one processor core."
    return Part(name="monitors", about=about, figures=(figure,))


class _Timer:
    """Times the calls of the station's monitors while it is open."""

    def __init__(self) -> None:
        self.spent_s = 0.0
        self._patches = [
            mock.patch.object(module, name, self._timed(getattr(module, name))) for module, name in _MEASURED
        ]

    def _timed(self, function: Any) -> Any:
        def timed(*arguments: Any) -> Any:
            begin_s = time.thread_time()
            result = function(*arguments)
            self.spent_s += time.thread_time() - begin_s
            return result

        return timed

    def __enter__(self) -> _Timer:
        for patch in self._patches:
            patch.start()
        return self

    def __exit__(self, *_: object) -> None:
        for patch in self._patches:
            patch.stop()
