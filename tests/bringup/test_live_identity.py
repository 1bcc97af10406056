"""The same recording offline, through live nodes at several speeds, and from a bag: the same bits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from gbas_bags.records import read_records
from gbas_bringup.environment import free_domain
from gbas_bringup.launcher import RunPlan
from gbas_bringup.run_config import read_run_config
from gbas_bringup.runs import execute
from gbas_chain.process import ProcessResult, process, write_results
from gbas_chain.results import Row, write_solution_csv
from gbas_cli.replay import ReplayRequest, replay
from gbas_msgs_py import tables, topics
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch
from recorded_sets import request

pytestmark = pytest.mark.ros

SET = "mosaic_base_rover"
SOLUTION = topics.resolve(topics.AIRBORNE_SOLUTION)
PROTECTION = topics.resolve(topics.AIRBORNE_PROTECTION)


def _live(run_file: Path, directory: Path, *, speed: float, single_process: bool = False) -> Path:
    plan = RunPlan(
        config=read_run_config(run_file).with_nodes(),
        directory=directory,
        speed=speed,
        single_process=single_process,
        domain=free_domain(),
        isolated=True,
    )
    execute(plan, title="test", quiet=True)
    return plan.bag_path


def _recorded(bag: Path) -> tuple[list[bytes], list[bytes], tuple[Row, ...]]:
    """Solutions and protection levels of a bag as the bytes of their tables, and as rows."""
    records = read_records(bag, (SOLUTION, PROTECTION))
    solutions = [item for item in records[SOLUTION] if isinstance(item, SolutionEpoch)]
    protections = [item for item in records[PROTECTION] if isinstance(item, ProtectionEpoch)]
    rows = tuple(Row.of(*pair) for pair in zip(solutions, protections, strict=True))
    return (
        [tables.SOLUTION.encode(item).tobytes() for item in solutions],
        [tables.PROTECTION.encode(item).tobytes() for item in protections],
        rows,
    )


def _offline(result: ProcessResult, count: int | None = None) -> tuple[list[bytes], list[bytes]]:
    outputs = result.outputs[:count]
    return (
        [tables.SOLUTION.encode(output.solution).tobytes() for output in outputs],
        [tables.PROTECTION.encode(output.protection).tobytes() for output in outputs],
    )


@pytest.fixture(scope="module")
def offline(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[ProcessResult, Path]:
    """The recording processed offline; the folder has its ``run.yaml`` and ``solution.csv``."""
    folder = tmp_path_factory.mktemp("offline")
    result = process(request(SET, data_dir))
    write_results(result, folder)
    return result, folder


@pytest.mark.parametrize("single_process", [False, True])
def test_live_nodes_at_full_speed_and_their_bag(
    offline: tuple[ProcessResult, Path], tmp_path: Path, single_process: bool
) -> None:
    result, folder = offline
    bag = _live(folder / "run.yaml", tmp_path, speed=0.0, single_process=single_process)
    solutions, protections, rows = _recorded(bag)
    assert (solutions, protections) == _offline(result)
    assert sum(row.position_m is not None for row in rows) > 50
    write_solution_csv(tmp_path / "solution.csv", rows)
    assert (tmp_path / "solution.csv").read_bytes() == (folder / "solution.csv").read_bytes()
    if not single_process:
        again = replay(ReplayRequest(bag=bag, out=tmp_path / "replayed", quiet=True))
        assert again.identical
        assert _recorded(again.replayed)[:2] == _offline(result)


def test_live_nodes_in_real_time(data_dir: Path, tmp_path: Path) -> None:
    """Real time takes its time, so: 12 s of the recording, with filters that need not settle."""
    station: dict[str, Any] = yaml.safe_load(
        """
        ground:
          station: {id: LIVE, gcid: 1}
          smoothing: {settle_time_s: 0.0}
          monitors: {readmission_time_s: 0.0}
          atmosphere: {sigma_vert_iono_gradient: 4.0e-6, refractivity_uncertainty: 20.0}
          ephemeris: {k_md_e_c: 5.0}
        """
    )
    (tmp_path / "station.yaml").write_text(yaml.safe_dump(station), encoding="utf-8")
    (tmp_path / "airborne.yaml").write_text("airborne: {settle_s: 0.0}\n", encoding="utf-8")
    result = process(request(SET, data_dir, station=tmp_path / "station.yaml", airborne=tmp_path / "airborne.yaml"))
    result.run_file["/gbas/receiver_replay"]["ros__parameters"]["stop_s"] = 12.0
    write_results(result, tmp_path)
    solutions, protections, rows = _recorded(_live(tmp_path / "run.yaml", tmp_path, speed=1.0))
    assert len(rows) == 13
    assert (solutions, protections) == _offline(result, 13)
    assert sum(row.position_m is not None for row in rows) > 5
