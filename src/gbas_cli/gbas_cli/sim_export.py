"""``gbas sim export``: a scenario as files other software reads, and as a bag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gbas_bringup.environment import free_domain
from gbas_bringup.launcher import RunPlan
from gbas_bringup.run_config import one_driver, read_run_config
from gbas_bringup.runs import execute
from gbas_core.errors import ConfigError
from gbas_sim.rinex_files import ExportedFiles, export
from gbas_sim.scenario import ScenarioError, world_from_yaml


def export_rinex(scenario: Path, folder: Path, *, progress: Callable[[int, int], None]) -> ExportedFiles:
    """Observation, navigation and truth files of a scenario.

    Raises
    ------
    ConfigError
        When the scenario cannot be simulated.
    """
    try:
        world = world_from_yaml(scenario)
    except ScenarioError as error:
        raise ConfigError(scenario, str(error).removeprefix(f"{scenario}: ")) from error
    return export(world, folder, progress=progress)


def export_bag(scenario: Path, folder: Path, *, quiet: bool, command: str) -> Path:
    """A bag of the scenario: what the simulator sends, and what the nodes of the scenario make of it.

    Raises
    ------
    GbasError
        When the scenario cannot be simulated, or the bag is there already.
    """
    config = read_run_config(scenario).with_nodes()
    one_driver(config)
    plan = RunPlan(
        config=config,
        directory=folder,
        speed=0.0,
        domain=free_domain(),
        isolated=True,
        command=command,
    )
    execute(plan, title=scenario.stem, quiet=quiet)
    return plan.bag_path
