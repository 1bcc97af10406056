"""The launch files: each starts the nodes of a configuration as ``gbas run`` does.

``launch`` and ``launch_ros`` come with a ROS installation; without them only what needs none of them is tested.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

from gbas_bringup.resources import resources

FILES = {path.name: path for path in resources("launch", "*.launch.py")}
CHAIN = ["integrity_monitor", "correction_broadcast", "positioning", "protection_level"]


def test_there_are_launch_files() -> None:
    assert set(FILES) == {"approach.launch.py", "site.launch.py", "replay.launch.py"}


@pytest.mark.parametrize("path", FILES.values(), ids=FILES)
def test_file_describes_a_launch_and_says_how_it_is_used(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert functions == ["generate_launch_description"]
    assert f"ros2 launch gbas_bringup {path.name}" in (ast.get_docstring(tree) or "")


# --- with a ROS installation


@pytest.fixture
def entities(tmp_path: Path) -> Any:
    """What a launch file starts with some arguments."""
    pytest.importorskip("launch_ros", reason="comes with a ROS installation")
    from launch.actions import DeclareLaunchArgument
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    from launch import LaunchContext

    def load(name: str, **arguments: str) -> list[Any]:
        context = LaunchContext()
        context.launch_configurations.update({"out": str(tmp_path / "run"), **arguments})
        started: list[Any] = []
        for entity in get_launch_description_from_python_launch_file(str(FILES[name])).entities:
            if isinstance(entity, DeclareLaunchArgument):
                entity.execute(context)
            else:
                started += entity.execute(context) or []
        return started

    return load


def nodes(entities: list[Any]) -> dict[str, Any]:
    from launch_ros.actions import Node

    return {entity.node_executable: entity for entity in entities if isinstance(entity, Node)}


def test_approach_starts_the_chain(entities: Any) -> None:
    found = nodes(entities("approach.launch.py"))
    assert list(found) == ["simulator", *CHAIN, "recorder"]
    assert [node.node_package for node in found.values()] == [
        "gbas_sim", "gbas_ground", "gbas_ground", "gbas_airborne", "gbas_airborne", "gbas_bringup",
    ]  # fmt: skip


def test_recorder_can_be_left_out(entities: Any) -> None:
    assert "recorder" not in nodes(entities("approach.launch.py", record="false"))


def test_bag_drives_time_in_a_replay(entities: Any, tmp_path: Path) -> None:
    found = nodes(entities("replay.launch.py", bag=str(tmp_path / "bag"), config="braunschweig", speed="max"))
    assert list(found) == ["player", *CHAIN, "recorder"]


def test_configuration_must_be_given_for_a_site(entities: Any) -> None:
    with pytest.raises(RuntimeError, match="config"):
        entities("site.launch.py")


def test_everything_ends_with_the_driver(entities: Any) -> None:
    from launch.actions import RegisterEventHandler

    found = entities("approach.launch.py")
    assert sum(isinstance(entity, RegisterEventHandler) for entity in found) == 1
