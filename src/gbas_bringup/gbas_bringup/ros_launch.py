"""What the launch files share: the nodes of a configuration as actions of ``ros2 launch``.

Which nodes there are, and who waits for whom, comes from the same functions that ``gbas run`` uses; the configuration
is the same ROS parameter file. Needs ``launch`` and ``launch_ros``, which a ROS installation has and the package index
has not.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from gbas_bringup.launcher import RunPlan, launch_parameters
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance, Stage
from gbas_bringup.resources import named_config
from gbas_bringup.run_config import one_driver, read_run_config, speed_of
from gbas_bringup.runs import new_directory
from launch import LaunchContext, LaunchDescription  # type: ignore[attr-defined]  # there without ROS: our folder

_ARGUMENTS = {
    "config": "ROS parameter file, or the name of one that comes with the suite",
    "speed": "'max', a multiple of real time, or 'configured'",
    "record": "true: write a bag",
    "out": "folder for the bag; empty: out/<config>-<number>",
}
_PLAYER = NodeInstance(kind=NODE_KINDS["player"])


def describe(*, config: str | None, play: bool = False) -> LaunchDescription:
    """The launch description of a configuration.

    Parameters
    ----------
    config : str or None
        Configuration when the person gives none; None when one must be given.
    play : bool
        A bag, given as argument ``bag``, drives time instead of the configuration's own driver.
    """
    defaults = {"config": config, "speed": "configured", "record": "true", "out": ""}
    arguments = [
        DeclareLaunchArgument(name, description=text, default_value=defaults[name])  # None: must be given
        for name, text in _ARGUMENTS.items()
    ]
    if play:
        arguments.append(DeclareLaunchArgument("bag", description="folder of a bag, or a .mcap file"))
    return LaunchDescription([*arguments, OpaqueFunction(function=_actions, kwargs={"play": play})])


def _actions(context: LaunchContext, *, play: bool) -> list[Any]:
    """The nodes, and the end of all when the driver of time has sent everything."""
    plan = _plan(context, play=play)
    parameters = launch_parameters(plan)
    driver = one_driver(plan.config)
    plan.directory.mkdir(parents=True, exist_ok=True)
    nodes = {node: _node(plan, node, parameters[node.full_name]) for node in plan.config.nodes}
    end = EmitEvent(event=Shutdown(reason=f"{driver.label} has ended"))
    return [*nodes.values(), RegisterEventHandler(OnProcessExit(target_action=nodes[driver], on_exit=[end]))]


def _plan(context: LaunchContext, *, play: bool) -> RunPlan:
    given = {name: LaunchConfiguration(name).perform(context) for name in (*_ARGUMENTS, *(["bag"] if play else []))}
    path = named_config(given["config"])
    config = read_run_config(path).with_nodes(
        driver=_PLAYER if play else None, recorder=given["record"].lower() in ("true", "1", "yes")
    )
    directory = Path(given["out"]) if given["out"] else new_directory(Path("out"), path.stem)
    return RunPlan(
        config=config.written(directory),
        directory=directory,
        speed=None if given["speed"] == "configured" else speed_of(given["speed"]),
        overrides={_PLAYER.full_name: {"bag": given["bag"]}} if play else {},
        command=f"ros2 launch gbas_bringup, with {given}",
    )


def _node(plan: RunPlan, node: NodeInstance, parameters: dict[str, Any]) -> Node:
    return Node(
        package=node.kind.module.partition(".")[0],
        executable=node.kind.name,
        name=node.kind.name,
        namespace=node.namespace,
        parameters=[str(plan.config.path), parameters],
        output="screen",
        # The recorder takes what is on its way before it closes the bag.
        sigterm_timeout="20" if node.kind.stage is Stage.RECORDER else "5",
    )
