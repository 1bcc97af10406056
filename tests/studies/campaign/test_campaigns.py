"""Campaigns in this process, in local workers and on a scheduler's: one result; stopped, continued, refused, survived.

Scheduler and workers are processes of their own that talk over the loopback, on ports that the system gives.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from distributed import Client, LocalCluster

from gbas_studies.campaign import Execution, run
from gbas_studies.campaign.errors import CampaignError, CampaignInterrupted
from gbas_studies.campaign.plan import digest
from gbas_studies.campaign.version import suite_version
from toy_campaign import Drawn, toy_campaign

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "tests" / "scenes"
TRIALS = ["plain"] * 40


@contextmanager
def program(*arguments, path=(SCENES,)):
    """A program of dask, ended at the end by its process id."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, path))},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class Cluster:
    """A scheduler and its workers.

    Attributes
    ----------
    address : str
    workers : list of Popen
    """

    def __init__(self, stack, folder):
        self._stack, self._folder = stack, folder
        self.workers: list[subprocess.Popen] = []
        place = folder / "scheduler.json"
        process = stack.enter_context(
            program("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", place)
        )
        while not place.exists() or not place.read_text(encoding="utf-8").strip().endswith("}"):
            assert process.poll() is None
            time.sleep(0.02)
        self.address = json.loads(place.read_text(encoding="utf-8"))["address"]

    def add_worker(self):
        """One more, as long as the cluster lives."""
        self.workers.append(self._stack.enter_context(worker(self.address, self._folder)))


def worker(address, folder, path=(SCENES,)):
    """A worker without a nanny: if it is killed, nobody starts it anew."""
    return program(
        "worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", folder, path=path
    )


@pytest.fixture(scope="module")
def expected():
    return run(toy_campaign(TRIALS))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler with two workers."""
    with ExitStack() as stack:
        made = Cluster(stack, tmp_path_factory.mktemp("cluster"))
        made.add_worker()
        made.add_worker()
        with Client(made.address) as client:
            client.wait_for_workers(2, timeout=60.0)
        yield made


@pytest.fixture
def lonely_scheduler():
    """Address of a scheduler without workers, in this process."""
    options = {"dashboard": False}
    with LocalCluster(
        n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0", scheduler_kwargs=options
    ) as scheduler:
        yield scheduler.scheduler_address


def test_seeds_are_the_children_of_one_seed(expected):
    children = np.random.SeedSequence(1).spawn(len(TRIALS))
    assert [each.value for each in expected] == [np.random.default_rng(c).standard_normal() for c in children]
    assert [each.number for each in expected] == list(range(len(TRIALS)))
    assert expected[3] == Drawn(number=3, value=expected[3].value, none=math.inf, names=("plain", "ä"))


def test_two_workers_of_a_scheduler_find_the_same(cluster, expected, tmp_path):
    (notes := tmp_path / "notes").mkdir()
    here, there = tmp_path / "here.jsonl", tmp_path / "there.jsonl"
    seen: list[tuple[int, int]] = []
    execution = Execution(scheduler=cluster.address, out=there, progress=lambda done, total: seen.append((done, total)))
    assert run(toy_campaign(TRIALS, notes=notes), execution) == expected
    assert run(toy_campaign(TRIALS, notes=notes), Execution(out=here)) == expected
    assert there.read_bytes() == here.read_bytes()
    assert seen == sorted(seen)
    assert seen[0] == (0, 40)
    assert seen[-1] == (40, 40)
    prepared = [each.read_text(encoding="utf-8") for each in notes.glob("prepared-*")]
    assert prepared == ["once\n"] * 3  # once in each worker, and once here


def test_a_lost_local_worker_is_survived(expected, tmp_path):
    """Trial 7 kills the process that runs it, and dask starts another."""
    trials = ["deadly" if number == 7 else "plain" for number in range(len(TRIALS))]
    found = run(toy_campaign(trials, notes=tmp_path), Execution(workers=2))
    assert [each.value for each in found] == [each.value for each in expected]
    assert (tmp_path / "killed-7").exists()


def test_a_lost_worker_of_a_scheduler_is_survived(cluster, expected, tmp_path):
    """Trial 11 kills one worker of three; nobody starts it anew, and two are left for other tests."""
    trials = ["deadly" if number == 11 else "plain" for number in range(len(TRIALS))]
    cluster.add_worker()
    found = run(toy_campaign(trials, notes=tmp_path), Execution(scheduler=cluster.address))
    assert [each.value for each in found] == [each.value for each in expected]
    killed = int((tmp_path / "killed-11").read_text(encoding="utf-8"))
    assert [each.pid for each in cluster.workers if each.poll() is not None] == [killed]


def stopped_after(count):
    """Progress that stops the run, as Ctrl-C does, when so many trials are done."""

    def progress(done, total):
        if done >= count:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("where", ["here", "there"])
def test_stopped_and_continued(where, request, expected, tmp_path):
    how = {"scheduler": request.getfixturevalue("cluster").address} if where == "there" else {}
    whole, parts = tmp_path / "whole.jsonl", tmp_path / "parts.jsonl"
    run(toy_campaign(TRIALS), Execution(out=whole))
    with pytest.raises(CampaignInterrupted, match=r"interrupted; \d+ of 40 trials are in .*parts.jsonl") as error:
        run(toy_campaign(TRIALS), Execution(out=parts, progress=stopped_after(13), **how))
    assert error.value.exit_code == 130
    kept = parts.read_bytes()
    done = kept.count(b"\n") - 1
    assert 13 <= done < 40
    parts.write_bytes(kept + b'{"trial":39,"resu')  # what a killed process leaves
    seen: list[int] = []
    assert run(toy_campaign(TRIALS), Execution(out=parts, progress=lambda n, _: seen.append(n), **how)) == expected
    assert seen[0] == done
    assert parts.read_bytes() == whole.read_bytes()


def test_a_whole_file_needs_no_worker(expected, tmp_path):
    out = tmp_path / "all.jsonl"
    run(toy_campaign(TRIALS), Execution(out=out))
    assert run(toy_campaign(TRIALS), Execution(out=out, scheduler="tcp://127.0.0.1:1")) == expected


def test_another_campaign_does_not_continue_a_file(tmp_path, monkeypatch):
    out = tmp_path / "begun.jsonl"
    with pytest.raises(CampaignInterrupted):
        run(toy_campaign(TRIALS), Execution(out=out, progress=stopped_after(5)))
    before = out.read_bytes()
    for other, words in (
        (toy_campaign(TRIALS, seed=2), "its seed is 1, and that of this campaign 2"),
        (toy_campaign(TRIALS, factor=1.0 + 2.0**-52), "its plan is "),
        (toy_campaign([*TRIALS[1:], "other"]), "its plan is "),
        (toy_campaign(TRIALS[1:]), "its trials is 40, and that of this campaign 39"),
    ):
        with pytest.raises(CampaignError, match=words):
            run(other, Execution(out=out))
    monkeypatch.setattr("gbas_studies.campaign.plan.suite_version", lambda: "0.1.0+000000000000")
    with pytest.raises(CampaignError, match="its suite is .*that of this campaign 0.1.0.000000000000"):
        run(toy_campaign(TRIALS), Execution(out=out))
    assert out.read_bytes() == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: b"a,b\n1,2\n", "not a file of a campaign's results"),
        (lambda text: text.replace(b'{"trial":2,', b'{"trial":3,'), "line 5 has trial 3"),
        (lambda text: text.replace(b'"number":2', b'"number":2"'), "line 4 is damaged"),
    ],
)
def test_damaged_files(change, words, tmp_path):
    out = tmp_path / "results.jsonl"
    run(toy_campaign(TRIALS), Execution(out=out))
    out.write_bytes(change(out.read_bytes()))
    before = out.read_bytes()
    with pytest.raises(CampaignError, match=words):
        run(toy_campaign(TRIALS), Execution(out=out))
    assert out.read_bytes() == before


def test_two_runs_do_not_write_one_file(tmp_path):
    out = tmp_path / "results.jsonl"

    def begin_another(done, total):
        run(toy_campaign(TRIALS), Execution(out=out))

    with pytest.raises(CampaignError, match="another campaign is writing it"):
        run(toy_campaign(TRIALS), Execution(out=out, progress=begin_another))


def test_a_worker_with_another_suite_is_refused(lonely_scheduler, tmp_path):
    """The same packages but for one comment."""
    for package in (ROOT / "src").glob("gbas_*"):
        shutil.copytree(package / package.name, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    with open(tmp_path / "gbas_core" / "satellites.py", "a", encoding="utf-8") as file:
        file.write("# of another day\n")
    with worker(lonely_scheduler, tmp_path, path=(tmp_path, SCENES)), pytest.raises(CampaignError) as error:
        run(toy_campaign(TRIALS), Execution(scheduler=lonely_scheduler))
    assert re.match(r"worker tcp://127.0.0.1:\d+ has suite 0\.1\.0\+[0-9a-f]{12}, and this campaign", str(error.value))
    assert f"is of {suite_version()}; install the same there" in str(error.value)


def test_a_worker_without_the_suite_is_refused(lonely_scheduler, tmp_path):
    hiding = "import sys\nsys.meta_path[:] = [each for each in sys.meta_path if 'editable' not in repr(each)]\n"
    (tmp_path / "sitecustomize.py").write_text(hiding, encoding="utf-8")
    with (
        worker(lonely_scheduler, tmp_path, path=(tmp_path,)),
        pytest.raises(CampaignError, match="a worker has another suite, or none: No module named 'gbas_studies'"),
    ):
        run(toy_campaign(TRIALS), Execution(scheduler=lonely_scheduler))


def test_a_worker_with_threads_is_refused():
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0") as threads,
        pytest.raises(CampaignError, match="has 2 threads; start it with --nthreads 1"),
    ):
        run(toy_campaign(TRIALS), Execution(scheduler=threads.scheduler_address))


def test_without_any_worker_left_it_ends(lonely_scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr("gbas_studies.campaign.executors._LOOK_S", 0.2)
    monkeypatch.setattr("gbas_studies.campaign.executors._LOST_S", 0.2)
    trials = ["deadly" if number == 20 else "plain" for number in range(len(TRIALS))]
    out = tmp_path / "kept.jsonl"
    with worker(lonely_scheduler, tmp_path), pytest.raises(CampaignError, match="no worker is left"):
        run(toy_campaign(trials, notes=tmp_path), Execution(scheduler=lonely_scheduler, out=out))
    found = run(toy_campaign(trials, notes=tmp_path), Execution(out=out))
    assert [each.number for each in found] == list(range(len(TRIALS)))


def test_no_scheduler(monkeypatch):
    monkeypatch.setattr("gbas_studies.campaign.executors._WAIT_S", 0.5)
    with pytest.raises(CampaignError, match="no scheduler of dask answers at tcp://127.0.0.1:1"):
        run(toy_campaign(TRIALS), Execution(scheduler="tcp://127.0.0.1:1"))
    with pytest.raises(CampaignError, match="no scheduler of dask answers at nowhere"):
        run(toy_campaign(TRIALS), Execution(scheduler="nowhere"))


def test_what_goes_wrong_in_a_trial_is_told(cluster):
    for execution in (Execution(), Execution(scheduler=cluster.address)):
        with pytest.raises(ValueError, match="trial 1 is wrong"):
            run(toy_campaign(["plain", "wrong"], batch=1), execution)


def test_a_plan_is_its_values_to_the_last_bit():
    assert digest({"a": (1, 2.0)}) == digest({"a": (1, 2.0)})
    different = [1, 1.0, True, "1", None, [1], {"1": 1}, {1}, math.nan, np.ones(1), np.ones(1, dtype=int), digest, int]
    assert len({digest(each) for each in different}) == len(different)
    with pytest.raises(TypeError, match="has no place in a plan"):
        digest(object())
