"""Live runs of the benchmark: every node a process of its own, and what their bag tells of time.

Times are those the middleware stamps when a message reaches the recorder's process, on the system's clock; the recorder
keeps them as log times (``log_time: wall``). Nothing else has to listen, and the bag stays as evidence. A run during
which the system's clock was set is refused.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from gbas_bags import epochs
from gbas_bags.bags import END_METADATA, BagReader
from gbas_bench.figures import Figure, Part
from gbas_bench.offline import INTERVAL_S, SETTLE_EPOCHS
from gbas_bench.peer import GROUND, GROUND_XYZ_M, NAVIGATION, USER, why_not
from gbas_bench.world import bench_config
from gbas_bringup.environment import free_domain
from gbas_bringup.launcher import Launcher, RunPlan
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance, NodeKind, Stage
from gbas_bringup.resources import config_path
from gbas_bringup.run_config import RunConfig, read_run_config
from gbas_chain.process import NOMINAL_STATION
from gbas_core.errors import GbasError
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.record import FloatArray
from gbas_msgs_py import tables, topics

LATENCY_BOUND_S: Final = 0.050
SPEED_BOUND: Final = 100.0
"""Replay through live nodes, multiple of real time at 2 Hz."""
RATE_BOUND: Final = SPEED_BOUND / INTERVAL_S
BOUND_CORES: Final = 2
"""Cores of the machine the bound of the speed is meant for."""
_SEGMENTS: Final = 5
_PROTECTED_PART: Final = 0.95
_FILE_EPOCHS: Final = 1500

SOURCE: Final = NodeKind(
    name="simulator", module="gbas_bench.source", class_name="BenchSource", stage=Stage.DRIVER, needs="sim"
)
_CLOCK_TICKS: Final = os.sysconf("SC_CLK_TCK")
_GROUND: Final = frozenset(topics.resolve(name) for name in topics.GROUND_OBSERVATIONS)
_AIRBORNE: Final = topics.resolve(topics.AIRBORNE_OBSERVATIONS)
_PROTECTION: Final = topics.resolve(topics.AIRBORNE_PROTECTION)
_VPL: Final = tables.PROTECTION.columns.index("vpl_m")
_OF_INTEREST: Final = (*sorted(_GROUND), _AIRBORNE, topics.VDB, _PROTECTION)


@dataclass(frozen=True, kw_only=True)
class Arrivals:
    """When the messages of each epoch reached the recorder, in seconds; arrays of one length, in order of the epochs.

    Attributes
    ----------
    key : (n,) int array
    first_ground_s : (n,) array
        First reference receiver's observations.
    last_ground_s : (n,) array
        Last reference receiver's observations.
    airborne_s : (n,) array
        The aircraft's observations.
    burst_s : (n,) array
        Last burst of the frame.
    protection_s : (n,) array
        Protection levels.
    protected : (n,) bool array
        Whether there was a vertical protection level.
    n_bytes : int
        Of all messages, as they travel.
    n_messages : int
    """

    key: np.ndarray
    first_ground_s: FloatArray
    last_ground_s: FloatArray
    airborne_s: FloatArray
    burst_s: FloatArray
    protection_s: FloatArray
    protected: NDArray[np.bool_]
    n_bytes: int
    n_messages: int

    def of(self, epochs: slice) -> Arrivals:
        """The arrivals of some of the epochs."""
        arrays = (item.name for item in fields(self) if item.name not in ("n_bytes", "n_messages"))
        return replace(self, **{name: getattr(self, name)[epochs] for name in arrays})


class ProcessorClock:
    """Processor time of processes as it goes on."""

    def __init__(self) -> None:
        self._seen: dict[str, list[tuple[float, float]]] = {}

    def look(self, processes: Mapping[str, int]) -> None:
        now_s = time.time()
        for label, pid in processes.items():
            try:
                fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
            except OSError:
                continue
            self._seen.setdefault(label, []).append((now_s, (int(fields[11]) + int(fields[12])) / _CLOCK_TICKS))

    def between(self, begin_s: float, end_s: float) -> dict[str, float]:
        """Processor time of each process between two times [s]; interpolated between looks."""
        used = {label: np.interp([begin_s, end_s], *np.transpose(seen)) for label, seen in self._seen.items()}
        return {label: float(end - begin) for label, (begin, end) in used.items()}


@dataclass(frozen=True, kw_only=True)
class LiveRun:
    """A finished run: its bag's arrivals, the processor time of its processes, and messages lost in transport."""

    arrivals: Arrivals
    clock: ProcessorClock
    lost: int


# --- parts of the benchmark


def measure_latency(directory: Path, *, seconds: float) -> Part:
    """Time from observations to bursts and to protection levels, at 2 Hz in real time."""
    epochs_measured = max(round(seconds / INTERVAL_S), 2)
    driver = {"epochs": SETTLE_EPOCHS + epochs_measured, "ahead_epochs": SETTLE_EPOCHS}
    run = run_live(crowded_config(bench_config()), directory, speed=1.0, driver=driver)
    # The first one still stands in the queue of those before it.
    seen = _settled(run.arrivals, -epochs_measured + 1)
    pairs = (
        ("last ground observation to last burst", seen.last_ground_s, seen.burst_s),
        ("airborne observation and burst to protection level",
         np.maximum(seen.airborne_s, seen.burst_s), seen.protection_s),
        ("last observation of all to protection level",
         np.maximum(seen.airborne_s, seen.last_ground_s), seen.protection_s),
    )  # fmt: skip
    figures = [_latency(name, 1e3 * (end - begin), percent) for name, begin, end in pairs for percent in (50, 99)]
    largest_ms = {name: 1e3 * float((end - begin).max()) for name, begin, end in pairs}
    return Part(
        name="latency",
        about="Live nodes, each its own process, recorder included; 4+1 receivers x 30 satellites at 2 Hz in real "
        f"time; {len(seen.key)} epochs after the filters have settled. From the arrival of one message at the "
        "recorder to that of another.",
        figures=tuple(figures),
        details={"epochs": len(seen.key), "lost": run.lost, "largest_ms": largest_ms},
    )


def _settled(arrivals: Arrivals, first: int) -> Arrivals:
    """The arrivals from an epoch on; refused unless the nodes did all their work there."""
    seen = arrivals.of(slice(first, None))
    if not (len(seen.key) and seen.protected.mean() > _PROTECTED_PART):
        raise GbasError(
            f"{np.sum(seen.protected)} of {len(seen.key)} epochs have protection levels; nothing to measure"
        )
    return seen


def _latency(name: str, taken_ms: FloatArray, percent: int) -> Figure:
    return Figure(
        part="latency",
        name=f"{name}, p{percent}",
        value=float(np.percentile(taken_ms, percent)),
        unit="ms",
        against=f"bound {1e3 * LATENCY_BOUND_S:g} ms",
        reference=1e3 * LATENCY_BOUND_S,
        better="less",
    )


def measure_replay(directory: Path, *, n_epochs: int) -> Part:
    """Speed of live nodes with a recorder when the data come as fast as the nodes take them."""
    config = crowded_config(bench_config())
    run = run_live(config, directory, speed=0.0, driver={"epochs": SETTLE_EPOCHS + n_epochs})
    part = _speed(run, INTERVAL_S, SETTLE_EPOCHS, "replay", "4+1 receivers x 30 satellites at 2 Hz")
    about = f"Live nodes, each its own process, recorder included; {n_epochs} epochs after the filters have settled"
    return replace(part, about=f"{about}; median of {_SEGMENTS} parts of the run. {_PROCESSOR_ABOUT}")


def measure_files(directory: Path, data: Path | None) -> Part:
    """The same with recorded receiver files."""
    about = f"Recorded files ({GROUND}, {USER}) through live nodes, recorder included."
    reason = why_not(data)
    if reason or data is None:
        return Part(name="files", about=about, skipped=reason)
    config = _files_config(directory)
    driver = {
        "ground_files": [str(data / GROUND)], "user_file": str(data / USER), "nav_files": [str(data / NAVIGATION)],
        "systems": "G", "stop_s": float(_FILE_EPOCHS - 1),
    }  # fmt: skip
    run = run_live(config, directory, speed=0.0, driver=driver)
    settle = round(SETTLE_EPOCHS * INTERVAL_S)
    return replace(_speed(run, 1.0, settle, "files", "1+1 recorded receivers at 1 Hz"), about=about)


_PROCESSOR_ABOUT: Final = (
    "Processor time is that of all processes together: what two cores can do at best when nothing else runs."
)


def _speed(run: LiveRun, interval_s: float, settle: int, part: str, what: str) -> Part:
    seen = _settled(run.arrivals, settle)
    marks = np.linspace(0, len(seen.key) - 1, _SEGMENTS + 1).round().astype(int)
    rates = np.diff(marks) / np.diff(seen.protection_s[marks])
    rate = float(np.median(rates))
    used_s = run.clock.between(seen.first_ground_s[0], seen.protection_s[-1])
    spent_ms = {name: 1e3 * each / len(seen.key) for name, each in used_s.items()}
    bound = SPEED_BOUND * interval_s / INTERVAL_S  # the same number of epochs a second at any interval
    figures = (
        Figure(part=part, name=f"speed, {what}", value=rate * interval_s, unit="x real time",
               against=f"bound {bound:g} x, {RATE_BOUND:g} epochs/s", reference=bound, better="more"),
        Figure(part=part, name="processor time of all nodes an epoch", value=sum(spent_ms.values()), unit="ms",
               against=f"{BOUND_CORES} cores for {RATE_BOUND:g} epochs/s", reference=1e3 * BOUND_CORES / RATE_BOUND,
               better="less"),
    )  # fmt: skip
    details = {
        "epochs": len(seen.key),
        "epochs_per_s": rate,
        "epochs_per_s_of_parts": rates.tolist(),
        "processor_ms_by_process": spent_ms,
        "messages_per_epoch": run.arrivals.n_messages / len(run.arrivals.key),
        "bytes_per_epoch": run.arrivals.n_bytes / len(run.arrivals.key),
        "lost": run.lost,
    }
    return Part(name=part, about="", figures=figures, details=details)


def _files_config(directory: Path) -> RunConfig:
    """The nominal station at the recorded receiver, and a receiver."""
    station = yaml.safe_load(config_path(NOMINAL_STATION).read_text(encoding="utf-8"))["ground"]
    latitude, longitude, height_m = (float(each) for each in geodetic_from_ecef(np.array(GROUND_XYZ_M)))
    place = {"latitude_deg": math.degrees(latitude), "longitude_deg": math.degrees(longitude), "height_m": height_m}
    station["station"] |= {**place, "systems": "G"}
    station["receivers"] = {"rr1_ecef_m": list(GROUND_XYZ_M), "minimum": 1}
    station["signal_power"] = {"require_cn0": False}
    airborne = {"service": "C", "systems": "G", "use_unhealthy": True}  # this station claims no service
    document = {"/**": {"ros__parameters": {"ground": station, "airborne": airborne}}}
    path = directory / "files.yaml"
    directory.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return read_run_config(path).with_nodes(driver=NodeInstance(kind=NODE_KINDS["receiver_replay"]))


# --- running


def run_live(config: RunConfig, directory: Path, *, speed: float, driver: Mapping[str, Any]) -> LiveRun:
    """Run a configuration to its end and read its bag.

    Parameters
    ----------
    config : RunConfig
    directory : Path
        For bag and logs; must not exist.
    speed : float
        Multiple of real time; 0 for as fast as the nodes go.
    driver : mapping
        Parameters of the node that drives time.
    """
    recorder = next(node for node in config.nodes if node.kind.name == "recorder")
    plan = RunPlan(
        config=config,
        directory=directory,
        speed=speed,
        domain=free_domain(),
        isolated=True,
        overrides={config.drivers[0].full_name: driver, recorder.full_name: {"log_time": "wall"}},
        command="gbas bench",
    )
    clock = ProcessorClock()
    launcher = Launcher(plan, on_tick=lambda: clock.look(launcher.processes))
    offset_s = time.time() - time.monotonic()
    launcher.run()
    if abs(time.time() - time.monotonic() - offset_s) > 1e-3:
        raise GbasError("the system's clock was set during the run, so its times mean nothing; run it again")
    arrivals, lost = read_arrivals(plan.bag_path)
    return LiveRun(arrivals=arrivals, clock=clock, lost=lost)


def crowded_config(path: Path) -> RunConfig:
    """The benchmark's configuration with its own source and a recorder."""
    return read_run_config(path).with_nodes(driver=NodeInstance(kind=SOURCE))


def read_arrivals(bag: Path) -> tuple[Arrivals, int]:
    """Times of arrival from a bag, and how many messages the transport lost."""
    times: dict[str, dict[int, list[float]]] = {name: {} for name in _OF_INTEREST}
    protected: dict[int, bool] = {}
    n_bytes = n_messages = 0
    reader = BagReader(bag)
    for message in reader.messages():
        n_bytes += len(message.data)
        n_messages += 1
        of_topic = times.get(message.channel.topic)
        if of_topic is not None:
            key = epochs.epoch_of(message.channel.schema.name, message.data)
            of_topic.setdefault(key or 0, []).append(message.log_time_ns * 1e-9)
            if message.channel.topic == _PROTECTION:
                protected[key or 0] = math.isfinite(epochs.table_head(message.data, _VPL + 1)[_VPL])
    ground = [of_topic for name, of_topic in times.items() if name in _GROUND and of_topic]
    whole = set.intersection(
        *(set(each) for each in (*ground, times[_AIRBORNE], times[topics.VDB], times[_PROTECTION]))
    )
    keys = sorted(whole)
    arrivals = Arrivals(
        key=np.array(keys),
        first_ground_s=np.array([min(each[key][0] for each in ground) for key in keys]),
        last_ground_s=np.array([max(each[key][0] for each in ground) for key in keys]),
        airborne_s=np.array([times[_AIRBORNE][key][0] for key in keys]),
        burst_s=np.array([max(times[topics.VDB][key]) for key in keys]),
        protection_s=np.array([times[_PROTECTION][key][0] for key in keys]),
        protected=np.array([protected[key] for key in keys], dtype=bool),
        n_bytes=n_bytes,
        n_messages=n_messages,
    )
    return arrivals, int(reader.metadata.get(END_METADATA, {}).get("lost", "0"))
