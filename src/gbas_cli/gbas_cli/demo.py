"""``gbas demo``: one simulated approach through running nodes, and what a person wants to see of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gbas_bags.records import read_records
from gbas_bringup.environment import free_domain
from gbas_bringup.launcher import RunPlan
from gbas_bringup.resources import config_path
from gbas_bringup.run_config import read_run_config
from gbas_bringup.runs import execute
from gbas_chain.report import plot_approach
from gbas_chain.results import Row, error_statistics, position_errors, summarise, write_json, write_solution_csv
from gbas_core.errors import GbasError
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import Record
from gbas_ground.claims.broadcast_claims import statements
from gbas_ground.params import GroundParams
from gbas_msgs_py import topics
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch
from gbas_msgs_py.tables import TruthEpoch

DEMO_CONFIG = "braunschweig.yaml"
_SOLUTION = topics.resolve(topics.AIRBORNE_SOLUTION)
_PROTECTION = topics.resolve(topics.AIRBORNE_PROTECTION)
_TRUTH = topics.resolve(topics.TRUTH_AIRBORNE)


@dataclass(frozen=True, kw_only=True)
class DemoResult:
    """Files a demo wrote, and its summary."""

    bag: Path
    csv: Path
    picture: Path
    summary_file: Path
    summary: dict[str, Any]


def demo_plan(
    directory: Path,
    *,
    config: Path | None = None,
    speed: float = 0.0,
    single_process: bool = False,
    command: str = "",
) -> RunPlan:
    """The run that flies the approach of a configuration through live nodes and records it.

    Parameters
    ----------
    directory : Path
        Folder for everything that is written; made if need be.
    config : Path, optional
        A configuration with a simulator and one final approach; by default the one of Braunschweig.
    speed : float
        Multiple of real time, 0 for as fast as the nodes go.

    Raises
    ------
    GbasError
        When the configuration cannot be run.
    """
    run_config = read_run_config(config or config_path(DEMO_CONFIG)).with_nodes().written(directory)
    return RunPlan(
        config=run_config,
        directory=directory,
        speed=speed,
        single_process=single_process,
        domain=free_domain(),
        isolated=True,
        command=command,
    )


def demo(plan: RunPlan, *, verbose: bool = False, quiet: bool = False) -> DemoResult:
    """Run it, and report from the bag.

    Raises
    ------
    GbasError
        When the run fails.
    """
    execute(plan, title="approach", verbose=verbose, quiet=quiet)
    return report_bag(plan.bag_path, plan.directory, config=plan.config.path)


def report_bag(bag: Path, directory: Path, *, config: Path) -> DemoResult:
    """Write table, summary and picture of a recorded approach, flown with the (whole) configuration `config`."""
    directory.mkdir(parents=True, exist_ok=True)
    flown = read_flown(bag, config)
    if not flown.pairs:
        raise GbasError(f"{bag}: holds no airborne solution")
    result = DemoResult(
        bag=bag,
        csv=directory / "solution.csv",
        picture=directory / "approach.png",
        summary_file=directory / "summary.json",
        summary={**flown.summary(), "simulated": True},
    )
    write_solution_csv(result.csv, flown.rows)
    write_json(result.summary_file, result.summary)
    errors = position_errors(flown.rows, flown.truth_m, course_rad=flown.course_rad)
    runway = f" to runway {flown.approach.runway}" if flown.approach else ""
    plot_approach(
        [solution for solution, _ in flown.pairs],
        [protection for _, protection in flown.pairs],
        result.picture,
        title=f"Simulated approach{runway}, station {flown.station_id}, service type C",
        errors_m=(errors.vertical_m, errors.lateral_m),
    )
    return result


@dataclass(frozen=True, kw_only=True)
class Flown:
    """What the aircraft of a bag made of it, and the truth where the bag has it."""

    pairs: list[tuple[SolutionEpoch, ProtectionEpoch]]
    rows: list[Row]
    truth_m: np.ndarray
    approach: FinalApproach | None
    station_id: str
    rests_on: list[str]

    @property
    def course_rad(self) -> float:
        """Course about which the lateral protection level holds."""
        return self.approach.course_rad if self.approach else 0.0

    def summary(self) -> dict[str, Any]:
        """Counts and ranges, and errors where the truth is known."""
        errors = error_statistics(self.rows, self.truth_m, course_rad=self.course_rad) if self.rows else {"epochs": 0}
        return {**summarise(self.rows), "errors": errors, "rests_on": self.rests_on}


def read_flown(bag: Path, config: Path) -> Flown:
    """The aircraft's records in a bag of a run with the (whole) configuration `config`."""
    records = read_records(bag, (_SOLUTION, _PROTECTION, _TRUTH))
    protections = {_key(item): item for item in records[_PROTECTION] if isinstance(item, ProtectionEpoch)}
    pairs = [
        (item, protections[_key(item)])
        for item in records[_SOLUTION]
        if isinstance(item, SolutionEpoch) and _key(item) in protections
    ]
    rows = [Row.of(solution, protection) for solution, protection in pairs]
    station = GroundParams.from_yaml(config)
    return Flown(
        pairs=pairs,
        rows=rows,
        truth_m=_truth_m(records[_TRUTH], rows).reshape(-1, 3),
        approach=station.approaches[0] if station.approaches else None,
        station_id=station.station.id,
        rests_on=list(statements(station)),
    )


def _key(record: Record) -> int:
    return epoch_key(record.gps_week, record.tow_s)


def _truth_m(records: list[Record], rows: list[Row]) -> np.ndarray:
    known = {_key(item): (item.x_m, item.y_m, item.z_m) for item in records if isinstance(item, TruthEpoch)}
    missing = (np.nan, np.nan, np.nan)
    return np.array([known.get(epoch_key(row.gps_week, row.tow_s), missing) for row in rows])
