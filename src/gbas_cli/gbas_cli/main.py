"""The ``gbas`` command.

Commands are imported when they are used, so that help and errors come at once. Results go to standard output (only JSON
with ``--json``); progress, warnings and errors go to standard error.
"""

from __future__ import annotations

import itertools
import re
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from gbas_bringup import __version__
from gbas_cli import abia as cli_abia
from gbas_cli import bag as cli_bag
from gbas_cli import config as cli_config
from gbas_cli import reproduce as cli_reproduce
from gbas_cli import sim as cli_sim
from gbas_cli import siting as cli_siting
from gbas_cli import study as cli_study
from gbas_cli import vdb as cli_vdb
from gbas_cli.base import (
    BagPath,
    GbasGroup,
    Json,
    ListsCommand,
    command_line,
    new_out,
    position_of,
    print_json,
    print_places,
    print_table,
    speed_option,
)
from gbas_core.errors import EXIT_INTERNAL, ConfigError

app = typer.Typer(
    name="gbas",
    cls=GbasGroup,
    help="A whole Ground Based Augmentation System as ROS 2 nodes. Not certified equipment; not for navigation.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(cli_abia.app, name="abia")
app.add_typer(cli_bag.app, name="bag")
app.add_typer(cli_config.app, name="config")
app.add_typer(cli_sim.app, name="sim")
app.add_typer(cli_vdb.app, name="vdb")
cli_reproduce.register(app)
cli_siting.register(app)
cli_study.register(app)

Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Show every line the nodes write.")]
Speed = Annotated[str, typer.Option("--speed", help="'max', or a multiple of real time.", metavar="max|N")]
SingleProcess = Annotated[bool, typer.Option("--single-process", help="All nodes in one process.")]
Domain = Annotated[int | None, typer.Option("--domain", help="ROS domain, 0 to 232.", metavar="N")]


def _version(value: bool) -> None:
    if value:
        print(f"gbas {__version__}")
        raise typer.Exit()


@app.callback()
def top(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")] = False,
) -> None:
    """A whole Ground Based Augmentation System as ROS 2 nodes. Not certified equipment; not for navigation."""


# --- running nodes


@app.command()
def demo(
    out: Annotated[Path | None, typer.Option(help="Folder for what is written (default: out/demo-N).")] = None,
    config: Annotated[
        str | None,
        typer.Option(metavar="CONFIG", help="A simulated approach: a .yaml file, or a name as for `gbas run`."),
    ] = None,
    speed: Speed = "max",
    single_process: SingleProcess = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Fly one simulated approach through running nodes; write a bag, a table and a picture."""
    from gbas_bringup.resources import named_config
    from gbas_cli import demo as body

    plan = body.demo_plan(
        new_out(out, "demo"),
        config=None if config is None else named_config(config),
        speed=speed_option(speed),
        single_process=single_process,
        command=command_line(),
    )
    result = body.demo(plan, verbose=verbose, quiet=as_json)
    places = {"bag": result.bag, "table": result.csv, "picture": result.picture, "summary": result.summary_file}
    if as_json:
        print_json({**result.summary, "files": {name: str(path) for name, path in places.items()}})
        return
    _print_summary(result.summary)
    print_places(places)


@app.command()
def run(
    config: Annotated[str, typer.Argument(metavar="CONFIG", help="A .yaml file, or a name from `gbas launch-list`.")],
    out: Annotated[Path | None, typer.Option(help="Folder for what is written (default: out/CONFIG-N).")] = None,
    speed: Annotated[
        str | None, typer.Option(metavar="max|N", help="'max', or a multiple of real time (default: as configured).")
    ] = None,
    single_process: SingleProcess = False,
    record: Annotated[bool, typer.Option("--record/--no-record", help="Write a bag.")] = True,
    domain: Domain = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="Keep to this machine.")] = False,
    remap: Annotated[list[str] | None, typer.Option(metavar="FROM:=TO", help="Rename a topic, in every node.")] = None,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Run a site configuration or a scenario: each node its own process, or all in one. Ctrl-C ends it in order."""
    from gbas_bringup.launcher import RunPlan
    from gbas_bringup.resources import named_config
    from gbas_bringup.run_config import one_driver, read_run_config
    from gbas_bringup.runs import execute

    path = named_config(config)
    run_config = read_run_config(path).with_nodes(recorder=record)
    one_driver(run_config)
    plan = RunPlan(
        config=run_config,
        directory=new_out(out, path.stem),
        speed=None if speed is None else speed_option(speed),
        single_process=single_process,
        domain=domain,
        isolated=isolated,
        remaps=tuple(_remap(each) for each in remap or ()),
        command=command_line(),
    )
    execute(plan, title=path.stem, verbose=verbose, quiet=as_json)
    if not record:
        if as_json:
            print_json({"bag": None})
        return
    from gbas_bags.info import info

    document = info(plan.bag_path).as_json()
    if as_json:
        print_json(document)
        return
    whole = run_config.written(plan.directory).path
    _print_run(plan.bag_path, whole, simulated=document["origin"] == "simulated")
    print_places({"bag": plan.bag_path})


def _print_run(bag: Path, config: Path, *, simulated: bool) -> None:
    """What a recorded run gave, and what happened in it; a run without an aircraft has no positions to tell of."""
    from gbas_cli.demo import read_flown
    from gbas_cli.event_summary import event_lines, read_events

    flown = read_flown(bag, config)
    if flown.rows:
        _print_summary({**flown.summary(), "simulated": simulated})
    print("\n".join(event_lines(read_events(bag))) or "no exclusion, alert or change of service")


def _remap(text: str) -> str:
    source, separator, target = text.partition(":=")
    if not (source and separator and target):
        raise typer.BadParameter(f"--remap {text!r} is not FROM:=TO")
    return text


@app.command("launch-list")
def launch_list(as_json: Json = False) -> None:
    """List the configurations that come with the suite, the launch files, and the nodes."""
    from gbas_bringup.node_kinds import NODE_KINDS
    from gbas_bringup.resources import configurations, resources

    paths = [path for path in configurations() if _can_run(path)]
    configs = {path.stem: _first_sentence(path) for path in paths}
    launches = [path.name for path in resources("launch", "*.launch.py")]
    nodes = {name: kind.module for name, kind in NODE_KINDS.items()}
    if as_json:
        print_json({"configurations": configs, "launch_files": launches, "nodes": nodes})
        return
    print_table("configurations, for gbas run", ("name", "what it is"), list(configs.items()))
    print_table("launch files, for ros2 launch gbas_bringup", ("name",), [(name,) for name in launches])
    print_table("nodes", ("name", "python -m"), list(nodes.items()))


def _can_run(path: Path) -> bool:
    from gbas_bringup.run_config import read_run_config

    try:
        return len(read_run_config(path).drivers) == 1
    except ConfigError:
        return False  # parameters of one part, to be used with others


def _first_sentence(path: Path) -> str:
    """First sentence of the comment at the head of a configuration file."""
    head = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    text = " ".join(line.lstrip("# ") for line in head)
    return re.split(r"(?<=[a-z)])[.:,] ", text, maxsplit=1)[0]


@app.command()
def replay(
    bag: BagPath,
    speed: Speed = "max",
    out: Annotated[Path | None, typer.Option(help="Folder for the new bag (default: out/replay-N).")] = None,
    config: Annotated[Path | None, typer.Option(help="Configuration in place of the one in the bag.")] = None,
    single_process: SingleProcess = False,
    play_only: Annotated[
        bool, typer.Option("--play-only", help="Publish everything as recorded and start no nodes.")
    ] = False,
    domain: Domain = None,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Put a bag's inputs through running nodes again and compare every output with the recorded one, bit for bit."""
    from gbas_cli import replay as body

    request = body.ReplayRequest(
        bag=bag,
        out=new_out(out, "replay"),
        speed=speed_option(speed),
        config=config,
        single_process=single_process,
        domain=domain,
        verbose=verbose,
        quiet=as_json,
        command=command_line(),
    )
    if play_only:
        body.play(request)
        if as_json:
            print_json({"bag": str(bag), "played": True})
        return
    result = body.replay(request)
    if as_json:
        print_json(result.as_json())
    else:
        for topic in result.topics:
            print(topic.verdict())
            if topic.explanation():
                print(f"  {topic.explanation()}")
        print_places({"bag": result.replayed})
    if result.differs:
        raise typer.Exit(EXIT_INTERNAL)


# --- recorded files, offline


@app.command(cls=ListsCommand)
def process(
    ground: Annotated[list[Path], typer.Option(metavar="A.obs [B.obs ...]", help="1 to 4 reference receivers.")],
    user: Annotated[Path, typer.Option(metavar="U.obs", help="Observation file of the user.")],
    nav: Annotated[list[Path], typer.Option(metavar="N [N2 ...]", help="Navigation files.")],
    ground_xyz: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,Z [...]", help="Antennas of the receivers, ECEF [m] (default: from the files)."),
    ] = None,
    user_nav: Annotated[list[Path] | None, typer.Option(metavar="N [N2 ...]", help="The user's, if others.")] = None,
    gps_week: Annotated[
        int | None, typer.Option(metavar="WEEK", help="GPS week in which RTCM 3 streams without ephemerides begin.")
    ] = None,
    service: Annotated[
        str,
        typer.Option(
            metavar="C|D|L5-30|L5-100|IF-30|IF-100|all",
            help="Approach service type, or all processing modes beside one another (modes.csv).",
        ),
    ] = "C",
    systems: Annotated[str, typer.Option(metavar="G|E|GE", help="GPS, Galileo, or both.")] = "G",
    fas: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Final approach, YAML or an ARINC 424 path point record.")
    ] = None,
    station: Annotated[Path | None, typer.Option(metavar="station.yaml", help="Station (default: nominal).")] = None,
    airborne: Annotated[Path | None, typer.Option(metavar="receiver.yaml", help="Airborne receiver.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results (default: out/process-N).")] = None,
    as_json: Json = False,
) -> None:
    """Put recorded RINEX or RTCM 3 through the whole chain, offline; write solution.csv and summary.json."""
    from gbas_bringup.progress import progress
    from gbas_chain import process as body
    from gbas_chain.mode_results import mode_lines

    request = body.ProcessRequest(
        ground=tuple(ground),
        user=user,
        navigation=tuple(nav),
        ground_xyz_m=tuple(position_of(each) for each in ground_xyz or ()),
        user_navigation=tuple(user_nav or ()),
        gps_week=gps_week,
        service=service,
        systems=systems,
        station=station,
        fas=fas,
        airborne=airborne,
    )
    folder = new_out(out, "process")
    with progress("processing", enabled=not as_json) as update:
        result = body.process(request, progress=lambda done, total: update(done, total, ""))
    summary = body.write_results(result, folder)
    if as_json:
        print_json({**summary, "out": str(folder)})
        return
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
    _print_summary(summary)
    for line in mode_lines(summary.get("modes", {})):
        print(line)
    places = {"table": folder / "solution.csv", "summary": folder / "summary.json"}
    print_places(places | ({"modes": folder / "modes.csv"} if "modes" in summary else {}))


@app.command()
def bench(
    part: Annotated[
        list[str] | None,
        typer.Option(
            help="One of steps, monitors, pieces, simulator, ccd, siting, offline, process, latency, replay, files; "
            "repeatable."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Short runs: less exact.")] = False,
    seconds: Annotated[float | None, typer.Option(help="Duration of the latency run (default: 40).")] = None,
    data: Annotated[Path | None, typer.Option(help="Folder of recorded data (default: GBAS_DATA).")] = None,
    against: Annotated[
        Path | None, typer.Option(help="An earlier bench.json: also print how much better each figure has become.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for what is written (default: out/bench-N).")] = None,
    as_json: Json = False,
) -> None:
    """Measure the speed of the suite on this machine, each figure against a bound or a peer.

    Steps of one epoch, the simulator, the whole chain offline, `gbas process` beside RTKLIB, latency and replay speed
    of live nodes, each its own process. The ratio says how many times better a figure is than what it is compared with:
    1 or more meets a bound. Wall times hold for this machine with all that runs on it: see the load in the header.
    """
    from gbas_bench import bench as body
    from gbas_bench.history import read_report
    from gbas_bringup.progress import progress

    before = None if against is None else read_report(against)
    folder = new_out(out, "bench")
    with progress("measuring", enabled=not as_json) as update:
        result = body.run_bench(
            folder,
            parts=part or body.PARTS,
            quick=quick,
            seconds=seconds,
            data=data,
            progress=lambda name: update(0, None, name),
        )
    if as_json:
        print_json(result)
        return
    body.print_report(result)
    if before is not None:
        body.print_changes(result, before)
    print_places({"report": folder / "bench.json"})


# --- for people


def _print_summary(summary: dict[str, Any]) -> None:
    from gbas_chain.results import summary_lines

    print("\n".join(summary_lines(summary)))


def main() -> None:
    """Console script."""
    app(prog_name="gbas")


if __name__ == "__main__":
    main()
