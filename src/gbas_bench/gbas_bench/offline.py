"""Offline parts of the benchmark: the time of single steps, and of the whole chain without ROS."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar

import yaml

from gbas_airborne.params import AirborneParams
from gbas_airborne.receiver import AirborneReceiver, PositionState
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_airborne.service import ServiceState
from gbas_bench.figures import Figure, Part
from gbas_bench.world import bench_config, bench_world
from gbas_chain.chain import AirborneOutput, Chain
from gbas_core.errors import GbasError
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.io.recording import RecordedEpoch
from gbas_ground.broadcast import BroadcastState
from gbas_ground.params import GroundParams
from gbas_ground.sections import SECOND_PRODUCTS, SmoothingSection
from gbas_ground.station import GroundEpoch, GroundStation, StationReport
from gbas_msgs_py import tables
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch
from gbas_vdb.transmission.burst import SLOT_NAMES
from gbas_vdb.transmission.receive import decode_burst

INTERVAL_S: Final = 0.5
"""Interval of the benchmark's epochs: 2 Hz, the rate of the VDB."""
SETTLE_EPOCHS: Final = round((SmoothingSection.settle_time_s + 30.0) / INTERVAL_S)
"""Epochs until every satellite is used: those of the filters, and some for the ephemeris CRCs to go round."""
GROUND_BUDGET_S: Final = 5e-3
"""Corrections and broadcast 3 ms, monitors 2 ms."""
AIRBORNE_BUDGET_S: Final = 2e-3
VDB_BUDGET_S: Final = 2e-3
TABLE_BUDGET_S: Final = 2e-3
_REPEATS: Final = 3

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The benchmark's world made beforehand."""

    ground: GroundParams
    airborne: AirborneParams
    ephemeris: Ephemeris
    epochs: tuple[RecordedEpoch, ...]

    def chain(self) -> Chain:
        """A chain that has seen nothing yet."""
        return Chain(self.ground, self.airborne, (self.ephemeris,), (self.ephemeris,))


def make_flight(n_epochs: int) -> Flight:
    """So many epochs of the benchmark's world, with the parameters of its station and receiver."""
    world = bench_world()
    parameters = yaml.safe_load(bench_config().read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    made = (world.epoch(number) for number in range(n_epochs))
    return Flight(
        ground=GroundParams.from_mapping(parameters["ground"]),
        airborne=AirborneParams.from_mapping(parameters["airborne"]),
        ephemeris=world.ephemeris,
        epochs=tuple(RecordedEpoch(key=each.key, ground=each.ground, user=each.airborne) for each in made),
    )


# --- the chain


def measure_chain(flight: Flight) -> Part:
    """Epochs a second of the whole chain, in this process, after it has settled."""
    rates, spent_ms = [], []
    for _ in range(_REPEATS):
        chain = flight.chain()
        list(chain.run(flight.epochs[:SETTLE_EPOCHS]))
        measured = flight.epochs[SETTLE_EPOCHS:]
        begin_s, begin_spent_s = time.perf_counter(), time.process_time()
        outputs = list(chain.run(measured))
        rates.append(len(measured) / (time.perf_counter() - begin_s))
        spent_ms.append(1e3 * (time.process_time() - begin_spent_s) / len(measured))
    used = statistics.median(each.solution.n_sats for each in outputs if isinstance(each, AirborneOutput))
    if not used > 0:
        raise GbasError("the benchmark's flight has no positions; nothing to measure")
    rate = statistics.median(rates)
    figure = Figure(
        part="offline",
        name=f"whole chain, 4+1 receivers x {used:.0f} satellites",
        value=rate * INTERVAL_S,
        unit="x real time",
        against="real time, 2 Hz",
        reference=1.0,
        better="more",
    )
    return Part(
        name="offline",
        about="Epochs of data through station and receiver in one process without ROS, wall time, median of "
        f"{_REPEATS} runs of {len(measured)} epochs of 0.5 s.",
        figures=(figure,),
        details={
            "epochs_per_s": rate,
            "epochs_per_s_of_runs": rates,
            "processor_ms_an_epoch": statistics.median(spent_ms),
            "satellites_used": used,
        },
    )


# --- single steps


@dataclass
class _Clock:
    """Processor time of calls, by name."""

    spent_s: dict[str, list[float]] = field(default_factory=dict)

    def time(self, name: str, function: Callable[..., T], *arguments: Any) -> T:
        """Call, and note the time it took."""
        begin_s = time.thread_time()
        result = function(*arguments)
        self.spent_s.setdefault(name, []).append(time.thread_time() - begin_s)
        return result

    def median_s(self, *names: str) -> float:
        """Median over the epochs of the sum of these calls, after the filters have settled."""
        taken = [self.spent_s[name][SETTLE_EPOCHS:] for name in names]
        return statistics.median(map(sum, zip(*taken, strict=True)))


def measure_steps(flight: Flight) -> Part:
    """Processor time of each step of the chain and of its messages' conversion, an epoch."""
    clock = _Clock()
    _step_through(flight, clock)
    return Part(
        name="steps",
        about=f"Processor time of one epoch, median of {len(flight.epochs) - SETTLE_EPOCHS} epochs with 4+1 receivers "
        "and 30 satellites. Budgets are the suite's own; the frame of the VDB has 500 ms.",
        figures=tuple(_step_figures(clock)),
        details={f"{name} [us]": round(1e6 * clock.median_s(name), 1) for name in clock.spent_s},
    )


def _step_through(flight: Flight, clock: _Clock) -> None:
    """The steps one by one, as the nodes take them."""
    station = GroundStation(flight.ground)
    monitor, broadcast = station.initial_integrity(), BroadcastState()
    both_bands = GroundStation(_with_second_band(flight.ground))
    of_both = both_bands.initial_integrity(), BroadcastState()
    position, service = PositionState(), ServiceState()
    ephemerides: tuple[Ephemeris, ...] = (flight.ephemeris,)
    for epoch in flight.epochs:
        week, tow_s = from_epoch_key(epoch.key)
        seen = GroundEpoch(gps_week=week, tow_s=tow_s, observations=epoch.ground, ephemerides=ephemerides)
        monitor, monitored = clock.time("monitor", station.monitor, monitor, seen)
        broadcast, bursts = clock.time("broadcast", station.broadcast, broadcast, monitored.integrity)
        integrity, made = clock.time("monitor, two bands", both_bands.monitor, of_both[0], seen)
        sent, _ = clock.time("broadcast, two bands", both_bands.broadcast, of_both[1], made.integrity)
        of_both = integrity, sent
        heard = AirborneEpoch(
            gps_week=week, tow_s=tow_s, observations=epoch.user, bursts=bursts, ephemerides=ephemerides
        )
        position, selected = clock.time("position", AirborneReceiver.position, position, heard, flight.airborne)
        solution = selected.solutions[0]
        service, protection, _ = clock.time("protect", AirborneReceiver.protect, service, solution, flight.airborne)
        clock.time("vdb decode", lambda bursts=bursts: [decode_burst(burst) for burst in bursts])
        _convert(clock, epoch, monitored, solution, protection)
        ephemerides = ()


def _with_second_band(params: GroundParams) -> GroundParams:
    """The same station with all corrections of L5/E5a, and the slots for them."""
    second = replace(params.second_band, products=SECOND_PRODUCTS)
    return replace(params, second_band=second, vdb=replace(params.vdb, slots="".join(SLOT_NAMES)))


def _convert(
    clock: _Clock,
    epoch: RecordedEpoch,
    monitored: StationReport,
    solution: SolutionEpoch,
    protection: ProtectionEpoch,
) -> None:
    """Every table of an epoch, encoded once and decoded once."""
    records: list[tuple[Any, Any]] = [(tables.OBSERVATIONS, each) for each in (*epoch.ground, epoch.user)]
    records += [(tables.INTEGRITY, monitored.integrity), (tables.CHANNELS, monitored.channels)]
    records += [(tables.MONITORS, monitored.statistics), (tables.MONITOR_DETAILS, monitored.details)]
    records += [(tables.SOLUTION, solution), (tables.PROTECTION, protection)]
    encoded = clock.time("table encode", lambda: [(schema, schema.encode(record)) for schema, record in records])
    clock.time("table decode", lambda: [schema.decode(schema.label_of(table), table) for schema, table in encoded])


def _step_figures(clock: _Clock) -> Iterator[Figure]:
    rows = (
        ("ground step: monitor", ("monitor",), GROUND_BUDGET_S),
        ("ground step: broadcast, with VDB encode", ("broadcast",), GROUND_BUDGET_S),
        ("ground step, both", ("monitor", "broadcast"), GROUND_BUDGET_S),
        ("ground step, both, with L5/E5a", ("monitor, two bands", "broadcast, two bands"), GROUND_BUDGET_S),
        ("airborne step: position, with VDB decode", ("position",), AIRBORNE_BUDGET_S),
        ("airborne step: protect", ("protect",), AIRBORNE_BUDGET_S),
        ("airborne step, both", ("position", "protect"), AIRBORNE_BUDGET_S),
        ("VDB encode (all of broadcast) and decode", ("broadcast", "vdb decode"), VDB_BUDGET_S),
        ("all 11 tables, encode", ("table encode",), TABLE_BUDGET_S),
        ("all 11 tables, decode", ("table decode",), TABLE_BUDGET_S),
    )
    for name, steps, budget_s in rows:
        yield Figure(
            part="steps",
            name=name,
            value=1e3 * clock.median_s(*steps),
            unit="ms",
            against=f"budget {1e3 * budget_s:g} ms",
            reference=1e3 * budget_s,
            better="less",
        )
    whole = clock.median_s("monitor", "broadcast", "position", "protect", "table encode", "table decode")
    yield Figure(
        part="steps",
        name="all steps and tables together",
        value=1e3 * whole,
        unit="ms",
        against="VDB frame, 500 ms",
        reference=500.0,
        better="less",
    )
