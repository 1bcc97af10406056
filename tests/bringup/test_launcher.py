"""Supervision: started, watched, and ended in order; a node that dies is named with its last words.

Small programs stand for the nodes, so that what happens is known: they write down when they were told to end.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from gbas_bringup import launcher as module
from gbas_bringup.environment import ament_prefix_path, free_domain, process_environment
from gbas_bringup.launcher import Interrupted, Launcher, Program, RunPlan
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance, Stage
from gbas_bringup.run_config import RunConfig
from gbas_bringup.single_process import factory_of, split_arguments
from gbas_core.errors import GbasError, NodeDied

PATIENT = """
import signal, sys, time
from pathlib import Path
name, folder = sys.argv[1], Path(sys.argv[2])
def end(*_):
    (folder / name).write_text(str(time.monotonic()))
    print(name, "ends", flush=True)
    sys.exit(0)
signal.signal(signal.SIGINT, end)
print(name, "is ready", flush=True)
(folder / f"{name}.ready").write_text("")
while True:
    time.sleep(0.02)
"""
WHEN_ALL_ARE_READY = """
import sys, time
from pathlib import Path
folder, names = Path(sys.argv[1]), sys.argv[2].split(",")
while not all((folder / f"{name}.ready").exists() for name in names):
    time.sleep(0.02)
"""
STUBBORN = """
import signal, sys, time
from pathlib import Path
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
(Path(sys.argv[2]) / f"{sys.argv[1]}.ready").write_text("")
time.sleep(600)
"""
OTHERS = ("ground", "aircraft", "recorder")
STAGES = {"ground": Stage.GROUND, "aircraft": Stage.AIRBORNE, "recorder": Stage.RECORDER}


def program(folder: Path, text: str, stage: Stage, *arguments: str) -> Program:
    """A module of its own with a text as its ``main``."""
    name = f"program_{len(list(folder.glob('program_*.py')))}_{folder.name}"
    (folder / f"{name}.py").write_text(f"def main():\n{textwrap.indent(text, '    ')}\n")
    return Program(name, arguments, stage)


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[Launcher, list[tuple[str, str]]]]:
    """A launcher of small programs: three patient ones, and a driver that runs `driver` when they are ready."""

    def make(driver: str, others: dict[str, str] | None = None) -> tuple[Launcher, list[tuple[str, str]]]:
        texts = others or dict.fromkeys(OTHERS, PATIENT)
        programs = {name: program(tmp_path, text, STAGES[name], name, str(tmp_path)) for name, text in texts.items()}
        text = WHEN_ALL_ARE_READY + driver
        programs["driver"] = program(tmp_path, text, Stage.DRIVER, str(tmp_path), ",".join(texts))
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setattr(module, "programs", lambda plan: programs)
        config = RunConfig(path=tmp_path / "c.yaml", nodes=(NodeInstance(kind=NODE_KINDS["simulator"]),), parameters={})
        lines: list[tuple[str, str]] = []
        plan = RunPlan(config=config, directory=tmp_path / "run")
        return Launcher(plan, echo=lambda label, line: lines.append((label, line))), lines

    return make


def ended(tmp_path: Path) -> list[str]:
    """The patient programs in the order in which they were told to end."""
    told = {name: float((tmp_path / name).read_text()) for name in OTHERS if (tmp_path / name).exists()}
    return sorted(told, key=lambda name: told[name])


def test_all_are_ended_in_order_when_the_driver_is_done(launch: Any, tmp_path: Path) -> None:
    launcher, lines = launch("print('all sent')")
    launcher.run()
    assert ended(tmp_path) == ["ground", "aircraft", "recorder"]
    assert launcher.late == ()
    assert ("driver", "all sent") in lines
    assert ("recorder", "recorder ends") in lines


def test_node_that_dies_is_named_with_code_and_last_lines(launch: Any, tmp_path: Path) -> None:
    others = {"ground": "print('cannot go on'); raise SystemExit(7)", "recorder": PATIENT}
    launcher, _ = launch("time.sleep(600)", others)
    with pytest.raises(NodeDied) as caught:
        launcher.run()
    assert (caught.value.name, caught.value.returncode) == ("ground", 7)
    assert "cannot go on" in str(caught.value)
    assert caught.value.exit_code == 1
    assert ended(tmp_path) in (["recorder"], [])


def test_driver_that_fails_is_named(launch: Any, tmp_path: Path) -> None:
    launcher, _ = launch("print('no progress'); sys.exit(3)")
    with pytest.raises(NodeDied, match="node driver exited with code 3"):
        launcher.run()
    assert ended(tmp_path) == ["ground", "aircraft", "recorder"]


def test_killed_node_is_named_with_the_signal(launch: Any) -> None:
    launcher, _ = launch("import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    with pytest.raises(NodeDied, match="node driver was killed by signal 9"):
        launcher.run()


def test_refused_parameters_are_passed_on_as_they_are(launch: Any) -> None:
    """A node ends with exit code 2 and one line when its parameters or files cannot be used."""
    launcher, _ = launch("print('site.yaml: gcid is 9, expected 1 to 7'); sys.exit(2)")
    with pytest.raises(GbasError) as caught:
        launcher.run()
    assert str(caught.value) == "site.yaml: gcid is 9, expected 1 to 7"
    assert caught.value.exit_code == 2


def test_interrupt_ends_all_in_order(launch: Any, tmp_path: Path) -> None:
    launcher, _ = launch("Path(folder / 'driver.ready').write_text(''); time.sleep(600)")

    def interrupt() -> None:
        while not (tmp_path / "driver.ready").exists():
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(Interrupted) as caught:
        launcher.run()
    thread.join()
    assert caught.value.exit_code == 130
    assert ended(tmp_path) == ["ground", "aircraft", "recorder"]
    assert signal.getsignal(signal.SIGINT) is before


def test_node_that_does_not_end_is_killed_and_named(
    launch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_STOP_S", dict.fromkeys(Stage, 0.5))
    monkeypatch.setattr(module, "_TERMINATE_S", 0.2)
    launcher, _ = launch("", {"ground": STUBBORN, "recorder": PATIENT})
    launcher.run()
    assert launcher.late == ("ground",)
    assert ended(tmp_path) == ["recorder"]


def test_nodes_end_when_the_launcher_is_killed(tmp_path: Path, wait_until: Any) -> None:
    """They get SIGINT, so that the recorder closes its bag."""
    patient = program(tmp_path, PATIENT, Stage.DRIVER, "recorder", str(tmp_path))
    code = f"""
import sys
from pathlib import Path
from gbas_bringup import launcher as module
from gbas_bringup.node_kinds import *
from gbas_bringup.run_config import RunConfig
folder = Path({str(tmp_path)!r})
sys.path.insert(0, str(folder))
module.programs = lambda plan: {{"recorder": module.Program({patient.module!r}, {patient.arguments!r}, Stage.DRIVER)}}
config = RunConfig(path=folder / "c.yaml", nodes=(NodeInstance(kind=NODE_KINDS["simulator"]),), parameters={{}})
module.Launcher(module.RunPlan(config=config, directory=folder / "run")).run()
"""
    process = subprocess.Popen([sys.executable, "-c", code])
    wait_until(lambda: (tmp_path / "recorder.ready").exists(), "the program to be ready")
    process.kill()
    process.wait()
    wait_until(lambda: (tmp_path / "recorder").exists(), "the program to be told to end", 20.0)


def test_what_the_launcher_sets_is_written_down(launch: Any, tmp_path: Path) -> None:
    launcher, _ = launch("")
    launcher.run()
    document = yaml.safe_load((tmp_path / "run" / "overrides.yaml").read_text())
    assert document["/gbas/simulator"]["ros__parameters"]["wait_for_ground"] == [""]


def test_environment_of_a_process() -> None:
    environment = process_environment(domain=17, isolated=True, log_dir=Path("/somewhere/log"))
    assert environment["ROS_DOMAIN_ID"] == "17"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert environment["ROS_LOG_DIR"] == "/somewhere/log"
    assert sys.prefix in environment["AMENT_PREFIX_PATH"].split(os.pathsep)
    assert Path(environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()


def test_sourced_ros_installation_keeps_its_place() -> None:
    assert ament_prefix_path({"AMENT_PREFIX_PATH": "/opt/ros"}).split(os.pathsep) == ["/opt/ros", sys.prefix]
    assert ament_prefix_path({"AMENT_PREFIX_PATH": sys.prefix}) == sys.prefix


def test_profile_of_the_user_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "/mine.xml")
    assert process_environment()["FASTRTPS_DEFAULT_PROFILES_FILE"] == "/mine.xml"


@pytest.mark.parametrize("domain", [-1, 233])
def test_domain_is_checked(domain: int) -> None:
    with pytest.raises(GbasError, match="expected 0 to 232"):
        process_environment(domain=domain)


def test_free_domains_differ() -> None:
    assert len({free_domain() for _ in range(3)}) == 3


def test_arguments_of_a_single_process() -> None:
    assert split_arguments(["/gbas/positioning", "--ros-args", "-p", "a:=1"]) == (
        ["/gbas/positioning"],
        ["--ros-args", "-p", "a:=1"],
    )
    with pytest.raises(GbasError, match="/gbas/flying is no node of the suite"):
        factory_of("/gbas/flying")
    factory: Any = factory_of("/gbas/second/positioning")
    assert factory.keywords == {"namespace": "/gbas/second"}
