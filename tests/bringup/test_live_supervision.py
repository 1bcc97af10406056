"""Real nodes under the gbas command: interrupted, and one of them killed, in the middle of a run."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gbas_bags.check import check
from gbas_bags.info import info
from gbas_bags.recovery import recover

pytestmark = pytest.mark.ros

ENOUGH_BYTES = 100_000  # of a bag: some seconds of data


class Run:
    """``gbas run braunschweig``, faster than real time but not over before a test is."""

    def __init__(self, out: Path, domain: int, *options: str) -> None:
        command = [sys.executable, "-m", "gbas_cli.main", "run", "braunschweig", "--out", str(out)]
        command += ["--speed", "20", "--isolated", "--domain", str(domain), *options]
        self.bag = out / "bag"
        self.popen = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def recording(self) -> bool:
        assert self.popen.poll() is None, self.popen.communicate()
        return sum(file.stat().st_size for file in self.bag.glob("*.mcap")) > ENOUGH_BYTES

    def node(self, module: str) -> int:
        """Process identifier of one of its nodes, by the command line that ``ps`` shows."""
        out = str(self.bag.parent)
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                command = (folder / "cmdline").read_text()
            except OSError:
                continue
            if module in command and out in command:
                return int(folder.name)
        pytest.fail(f"no process of {module}")

    def end(self) -> tuple[int, str, str]:
        out, err = self.popen.communicate(timeout=90)
        return self.popen.returncode, out, err


@pytest.fixture
def run(tmp_path: Path, domain: int, wait_until: Callable[..., None]) -> Iterator[Callable[..., Run]]:
    started: list[Run] = []

    def start(*options: str) -> Run:
        started.append(Run(tmp_path / "run", domain, *options))
        wait_until(started[-1].recording, "a bag that grows")
        return started[-1]

    yield start
    for each in started:
        if each.popen.poll() is None:
            each.popen.kill()
            each.popen.communicate()


@pytest.mark.parametrize("options", [(), ("--single-process",)])
def test_interrupt_leaves_a_good_bag(run: Callable[..., Run], options: tuple[str, ...]) -> None:
    process = run(*options)
    process.popen.send_signal(signal.SIGINT)
    code, _, err = process.end()
    assert code == 130
    assert err.splitlines()[-1] == f"gbas: interrupted; the nodes were ended in order; the bag is {process.bag}"
    result = check(process.bag)
    assert result.ok, [str(problem) for problem in result.problems]
    document = info(process.bag).as_json()
    assert document["lost_in_transport"] == 0
    assert document["origin"] == "simulated"
    assert document["configuration"] == ["braunschweig.yaml"]


def test_killed_node_is_named_and_the_bag_is_closed(run: Callable[..., Run]) -> None:
    process = run("--json")
    subprocess.run(["kill", "-9", str(process.node("gbas_airborne.nodes.positioning"))], check=True)
    code, out, err = process.end()
    assert code == 1
    assert "node positioning was killed by signal 9" in err
    assert "node positioning was killed by signal 9" in json.loads(out)["error"]
    assert info(process.bag).closed


def test_killed_recorder_is_named_and_the_bag_can_be_saved(run: Callable[..., Run]) -> None:
    process = run()
    subprocess.run(["kill", "-9", str(process.node("gbas_bags.recorder"))], check=True)
    code, _, err = process.end()
    assert code == 1
    assert "node recorder was killed by signal 9" in err
    assert not info(process.bag).closed
    saved = recover(process.bag).target
    assert info(saved).closed
    assert [str(problem) for problem in check(saved).problems] == []
