"""Which nodes a configuration starts, and what is said of one that cannot be used."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from gbas_airborne.params import AirborneParams
from gbas_bringup.launcher import RunPlan, launch_parameters, programs
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance, Stage
from gbas_bringup.resources import config_path, named_config, resources
from gbas_bringup.run_config import one_driver, read_run_config
from gbas_core.errors import ConfigError
from gbas_ground.params import GroundParams
from gbas_sim.scenario import scenario_from_yaml

CHAIN = ["integrity_monitor", "correction_broadcast", "positioning", "protection_level"]
REPLAY = """
/**:
  ros__parameters:
    ground: {station: {id: TEST}}
    airborne: {service: C}
/gbas/receiver_replay:
  ros__parameters:
    ground_files: [a.obs]
    user_file: u.obs
    nav_files: [n.nav]
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "run.yaml"
    path.write_text(text)
    return path


def test_sections_start_what_they_are_for(tmp_path: Path) -> None:
    config = read_run_config(written(tmp_path, REPLAY))
    assert [node.label for node in config.nodes] == ["receiver_replay", *CHAIN]
    assert one_driver(config).full_name == "/gbas/receiver_replay"
    assert [node.label for node in config.with_nodes().nodes] == ["receiver_replay", *CHAIN, "recorder"]


def test_simulator_is_started_by_its_section() -> None:
    config = read_run_config(config_path("braunschweig.yaml"))
    assert [node.label for node in config.nodes] == ["simulator", *CHAIN]


def test_second_aircraft_is_a_second_namespace(tmp_path: Path) -> None:
    second = "/gbas/second/positioning: {ros__parameters: {}}\n/gbas/second/protection_level: {ros__parameters: {}}\n"
    first = "/gbas/positioning: {ros__parameters: {}}\n/gbas/protection_level: {ros__parameters: {}}\n"
    config = read_run_config(written(tmp_path, REPLAY + first + second))
    labels = [node.label for node in config.nodes]
    assert labels.count("positioning") == labels.count("second/positioning") == 1
    plan = RunPlan(config=config, directory=tmp_path)
    waits = launch_parameters(plan)["/gbas/receiver_replay"]["wait_for"]
    assert sorted(waits) == ["/gbas/second/progress/protection_level", "protection_level"]
    assert "__ns:=/gbas/second" in programs(plan)["second/positioning"].arguments


def test_player_takes_the_place_of_the_driver(tmp_path: Path) -> None:
    player = NodeInstance(kind=NODE_KINDS["player"])
    config = read_run_config(written(tmp_path, REPLAY)).with_nodes(driver=player)
    assert [node.label for node in config.nodes] == ["player", *CHAIN, "recorder"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("/gbas/positoning: {ros__parameters: {}}", "did you mean 'positioning'"),
        ("positioning: {ros__parameters: {}}", "its name must be /gbas/positioning"),
        ("/**:\n  ros__parameters:\n    a: [1, 2\n", "is not YAML: line 4, column 1"),
        ("- 1\n- 2\n", "holds no sections of parameters"),
        ("/**: 3\n", "expected 'ros__parameters:' below it"),
        ("/**: {ros__parameters: {colour: red}}\n", "starts no node"),
        ("/**: {ros__parameters: 7}\n", "expected names and values"),
    ],
)
def test_what_cannot_be_used_is_named(text: str, problem: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        read_run_config(path)
    assert problem in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_run_needs_one_driver(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="exactly one of .* must drive time, and it starts none"):
        one_driver(read_run_config(written(tmp_path, "/**: {ros__parameters: {ground: {}}}\n")))
    both = REPLAY + "/gbas/simulator: {ros__parameters: {}}\n"
    with pytest.raises(ConfigError, match="receiver_replay and simulator"):
        one_driver(read_run_config(written(tmp_path, both)))


def test_deadlines_are_long_unless_in_real_time(tmp_path: Path) -> None:
    config = read_run_config(written(tmp_path, REPLAY))
    fast = launch_parameters(RunPlan(config=config, directory=tmp_path, speed=0.0))
    assert fast["/gbas/positioning"]["join_timeout_s"] == 30.0
    real_time = launch_parameters(RunPlan(config=config, directory=tmp_path, speed=1.0))
    assert "join_timeout_s" not in real_time["/gbas/positioning"]
    own = REPLAY + "/gbas/positioning: {ros__parameters: {join_timeout_s: 2.0}}\n"
    kept = launch_parameters(RunPlan(config=read_run_config(written(tmp_path, own)), directory=tmp_path, speed=0.0))
    assert "join_timeout_s" not in kept["/gbas/positioning"]


def test_everybody_waits_for_the_recorder(tmp_path: Path) -> None:
    config = read_run_config(written(tmp_path, REPLAY)).with_nodes()
    parameters = launch_parameters(RunPlan(config=config, directory=tmp_path / "run"))
    assert all(parameters[f"/gbas/{name}"]["recorders"] == 1 for name in (*CHAIN, "receiver_replay"))
    assert parameters["/gbas/receiver_replay"]["wait_for_ground"] == ["correction_broadcast", "recorder"]
    assert parameters["/gbas/recorder"]["out"] == str(tmp_path / "run" / "bag")
    assert parameters["/gbas/recorder"]["config_files"] == [str(tmp_path / "run.yaml")]


def test_single_process_is_one_command(tmp_path: Path) -> None:
    config = read_run_config(written(tmp_path, REPLAY)).with_nodes()
    (program,) = programs(RunPlan(config=config, directory=tmp_path, single_process=True)).values()
    assert program.stage is Stage.DRIVER
    named = [part for part in program.arguments if part.startswith("/gbas/")]
    assert named == [node.full_name for node in config.nodes]


def test_every_site_file_is_read_by_those_it_is_for() -> None:
    path = config_path("braunschweig.yaml")
    station, receiver, world = GroundParams.from_yaml(path), AirborneParams.from_yaml(path), scenario_from_yaml(path)
    assert station.n_receivers == 4
    assert receiver.rpds == station.approaches[0].rpds
    assert world.receiver_ecef_m == station.receivers.ecef_m
    # Published antenna positions of three of the receivers.
    published = [[3840619.039, 715604.228, 5024909.863], [3840835.113, 714861.969, 5024848.587]]
    published.append([3841202.939, 715429.959, 5024488.675])
    assert [list(place) for place in station.receivers.ecef_m[:3]] == published


def test_configurations_that_come_along_are_ros_parameter_files() -> None:
    for path in resources("config", "*.yaml"):
        document = yaml.safe_load(path.read_text())
        assert isinstance(document, dict), path


def test_configuration_by_name() -> None:
    assert named_config("braunschweig") == named_config("braunschweig.yaml") == config_path("braunschweig.yaml")
    with pytest.raises(ConfigError, match="it is none of"):
        named_config("berlin")


def test_further_files_of_the_nodes_go_into_the_bag(tmp_path: Path) -> None:
    """A node may read its station from a file of its own; a replay needs it as it was."""
    own = REPLAY + "/gbas/positioning: {ros__parameters: {config: receiver.yaml}}\n"
    config = read_run_config(written(tmp_path, own)).with_nodes()
    assert config.files == {"/gbas/positioning": "receiver.yaml"}
    recorder = launch_parameters(RunPlan(config=config, directory=tmp_path))["/gbas/recorder"]
    assert recorder["config_files"] == [str(tmp_path / "run.yaml"), "receiver.yaml"]
    copies = {"/gbas/positioning": {"config": "copy/receiver.yaml"}}
    replayed = launch_parameters(RunPlan(config=config, directory=tmp_path, overrides=copies))
    assert replayed["/gbas/recorder"]["config_files"] == [str(tmp_path / "run.yaml"), "copy/receiver.yaml"]
    assert replayed["/gbas/positioning"]["config"] == "copy/receiver.yaml"
