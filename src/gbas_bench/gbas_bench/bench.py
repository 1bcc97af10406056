"""``gbas bench``: how fast the suite is on this machine, each figure against a bound or a peer.

How to read it. Every line has a measured value, what it is compared with, and a ratio: how many times better than the
bound or the peer. A ratio of 1 or more meets it. A ratio against real time is a speed. Nothing is a bound but what says
so; budgets are the suite's own.

==========  ===========================================================================================================
steps       processor time of the steps of one epoch, offline, against their budgets and the VDB's frame of 500 ms
simulator   an hour of simulated observations, against a bound of 20 s
siting      places of three reference receivers judged exactly, against 5 million a second; whole searches
offline     the whole chain without ROS as a multiple of real time
process     ``gbas process`` on recorded files as a multiple of real time, and against RTKLIB on the same files
latency     live nodes at 2 Hz: from observations to bursts and to protection levels, against 50 ms
replay      live nodes with a recorder, data as fast as they are taken, against 100 times real time at 2 Hz
files       the same with recorded receiver files
monitors    all monitors of the station at one epoch with forty satellites, against 2 ms
pieces      what every epoch or ephemeris costs in small things, each against its bound
ccd         the full sweep of the divergence study against 1 s, and its monitors against 2 ms an epoch
==========  ===========================================================================================================

The live parts start each node as its own process. Wall times and speeds hold for this machine with what else runs on
it: look at the load in the header before and after. Processor times suffer less, but programs that share a core's
caches make them longer too, by half on a machine with three times as much to do as it has cores.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

from gbas_bench.figures import Part, document, environment
from gbas_bench.history import changes, mean_ratio, other_machine, read_report
from gbas_bringup.resources import data_folder
from gbas_core.errors import GbasError

PARTS: Final = (
    "steps", "monitors", "pieces", "simulator", "ccd", "siting", "offline", "process", "latency", "replay", "files",
)  # fmt: skip
LATENCY_S: Final = 40.0
QUICK_LATENCY_S: Final = 8.0
_STEP_EPOCHS: Final = (300, 60)
_WORLD_EPOCHS: Final = (1000, 100)
_SITING_CANDIDATES: Final = (4_000_000, 1_000_000)
_MONITOR_EPOCHS: Final = (1000, 100)
_PIECE_REPEATS: Final = (200, 20)
_REPLAY_EPOCHS: Final = (1200, 300)
_BUSY_LOAD: Final = 0.5


def run_bench(
    out: Path,
    *,
    parts: Sequence[str] = PARTS,
    quick: bool = False,
    seconds: float | None = None,
    data: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Measure.

    Parameters
    ----------
    out : Path
        Folder for the bags of the live runs and for ``bench.json``.
    parts : sequence of str
        Which of :data:`PARTS`, in any order.
    quick : bool
        Shorter runs: less exact.
    seconds : float, optional
        Duration of the latency run.
    data : Path, optional
        Folder of the recorded data; that of ``GBAS_DATA`` when not given.
    progress : callable
        Told which part begins.

    Returns
    -------
    dict
        ``environment`` and ``parts``, each with its figures (`value`, `reference`, `ratio`).

    Raises
    ------
    GbasError
        For an unknown part, or when a node of a live run fails.
    """
    unknown = [name for name in parts if name not in PARTS]
    if unknown:
        raise GbasError(f"--part {unknown[0]} is not one of {', '.join(PARTS)}")
    about = environment()
    out.mkdir(parents=True, exist_ok=True)
    measured = []
    for name, measure in _measures(out, quick, seconds, data or data_folder()).items():
        if name in parts:
            progress(name)
            measured.append(measure())
    result = document(about, measured)
    (out / "bench.json").write_text(json.dumps(result, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return result


def _measures(out: Path, quick: bool, seconds: float | None, data: Path | None) -> Mapping[str, Callable[[], Part]]:
    """What measures each part; the libraries are loaded when they are needed."""
    from gbas_bench import ccd as bench_ccd
    from gbas_bench import live as bench_live
    from gbas_bench import monitors as bench_monitors
    from gbas_bench import offline as bench_offline
    from gbas_bench import peer as bench_peer
    from gbas_bench import pieces as bench_pieces
    from gbas_bench import simulator as bench_sim
    from gbas_bench import siting as bench_siting

    make_flight = cache(bench_offline.make_flight)
    step_epochs = bench_offline.SETTLE_EPOCHS + _STEP_EPOCHS[quick]
    latency_s = seconds if seconds is not None else QUICK_LATENCY_S if quick else LATENCY_S
    return {
        "steps": lambda: bench_offline.measure_steps(make_flight(step_epochs)),
        "simulator": lambda: bench_sim.measure_worlds(_WORLD_EPOCHS[quick]),
        "siting": lambda: bench_siting.measure_siting(_SITING_CANDIDATES[quick]),
        "offline": lambda: bench_offline.measure_chain(make_flight(step_epochs)),
        "process": lambda: bench_peer.measure_process(data, repeats=1 if quick else 3),
        "latency": lambda: bench_live.measure_latency(out / "latency", seconds=latency_s),
        "replay": lambda: bench_live.measure_replay(out / "replay", n_epochs=_REPLAY_EPOCHS[quick]),
        "files": lambda: bench_live.measure_files(out / "files", data),
        "monitors": lambda: bench_monitors.measure_monitors(_STEP_EPOCHS[quick]),
        "pieces": lambda: bench_pieces.measure_pieces(_PIECE_REPEATS[quick]),
        "ccd": lambda: bench_ccd.measure_ccd(_MONITOR_EPOCHS[quick]),
    }


def print_report(result: Mapping[str, Any]) -> None:
    """The report for people."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 130, highlight=False)
    about = result["environment"]
    console.print(
        f"{about['processor']}, {about['cores']} cores, {about['system']}; Python {about['python']}, numpy "
        f"{about['numpy']}, {about['middleware']}; load {about['load_before']} before, {about['load_after']} after",
        soft_wrap=True,
    )
    if max(about["load_before"], 0.0) > _BUSY_LOAD * about["cores"]:
        console.print("The machine is busy with something else: wall times and speeds are worse than it can do.")
    table = Table("part", "what", "measured", "against", "ratio", box=None, pad_edge=False)
    for name in ("measured", "ratio"):
        next(column for column in table.columns if column.header == name).justify = "right"
    for part in result["parts"]:
        for figure in part["figures"]:
            value, ratio = f"{_short(figure['value'])} {figure['unit']}", _short(figure["ratio"])
            table.add_row(part["part"], figure["name"], value, figure["against"], ratio)
        if "skipped" in part:
            table.add_row(part["part"], f"not measured: {part['skipped']}", "", "", "")
    console.print(table)
    console.print("ratio: how many times better than what it is compared with; 1 or more meets a bound")


def print_changes(now: Mapping[str, Any], before: Mapping[str, Any]) -> None:
    """How much better each figure is than in an earlier report."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 130, highlight=False)
    old, found = before["environment"], changes(now, before)
    console.print(
        f"\nagainst {old.get('commit') or old['suite_version']}, load {old['load_before']} before it", soft_wrap=True
    )
    for difference in other_machine(now, before):
        console.print(f"another machine, so the ratios say little: {difference}", soft_wrap=True)
    table = Table("part", "what", "before", "now", "times better", box=None, pad_edge=False)
    for column in table.columns[2:]:
        column.justify = "right"
    for each in found:
        was, value = (f"{_short(number)} {each.unit}" for number in (each.before, each.now))
        table.add_row(each.part, each.name, was, value, _short(each.ratio))
    console.print(table)
    console.print(f"{len(found)} figures in both; {_short(mean_ratio(found))} times better in the geometric mean")


def _short(value: float) -> str:
    """Three digits, without an exponent."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def main(arguments: Sequence[str] | None = None) -> int:
    """``python -m gbas_bench.bench``: what ``gbas bench`` does."""
    parser = argparse.ArgumentParser(
        prog="gbas bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--part", action="append", choices=PARTS, help="only this part; may be repeated")
    parser.add_argument("--quick", action="store_true", help="shorter runs: less exact")
    parser.add_argument("--seconds", type=float, help=f"duration of the latency run (default {LATENCY_S:g})")
    parser.add_argument("--data", type=Path, help="folder of recorded data (default: GBAS_DATA)")
    parser.add_argument("--out", type=Path, required=True, help="folder for bags and bench.json")
    parser.add_argument("--against", type=Path, help="an earlier bench.json: print how much better each figure is")
    parser.add_argument("--json", action="store_true", help="print JSON only")
    given = parser.parse_args(arguments)
    try:
        before = None if given.against is None else read_report(given.against)
        result = run_bench(
            given.out,
            parts=given.part or PARTS,
            quick=given.quick,
            seconds=given.seconds,
            data=given.data,
            progress=lambda name: print(f"measuring {name}", file=sys.stderr),
        )
    except GbasError as error:
        print(f"gbas: {error}", file=sys.stderr)
        return error.exit_code
    if given.json:
        print(json.dumps(result, indent=2, allow_nan=False))
        return 0
    print_report(result)
    if before is not None:
        print_changes(result, before)
    return 0


if __name__ == "__main__":
    sys.exit(main())
