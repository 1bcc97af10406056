"""Where batches of trials run: in this process, in local workers, or on the workers of a scheduler."""

from __future__ import annotations

import logging
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any

from gbas_studies.campaign.errors import CampaignError
from gbas_studies.campaign.version import library_versions, suite_version
from gbas_studies.campaign.work import Line, Numbered, Work, run_batch

if TYPE_CHECKING:
    from distributed import Client

Executor = Callable[[Work, Sequence[Numbered], int], Iterator[list[Line]]]
"""Gives the results of numbered trials, in batches of at most so many, in the order in which they are done."""

_BATCHES_A_WORKER = 8  # so that the last to finish are not waited for long
_WAIT_S = 30.0  # for a scheduler and its first worker
_LOOK_S = 60.0  # without a batch done: is there any worker left?
_LOST_S = 30.0  # for a worker to come back


def in_this_process(work: Work, trials: Sequence[Numbered], batch: int) -> Iterator[list[Line]]:
    """Run trials one by one."""
    context = work.prepare(work.settings)
    for each in trials:
        yield run_batch(work, context, [each])


@contextmanager
def executor(workers: int, scheduler: str | None) -> Iterator[Executor]:
    """Open what runs the trials.

    Parameters
    ----------
    workers : int
        Processes on this machine, with one thread each; 1: this process itself, without dask.
    scheduler : str or None
        Address of a scheduler of dask, whose workers are used instead.

    Raises
    ------
    CampaignError
        When no scheduler answers there, or it has no worker.
    """
    if scheduler is not None:
        with _client(scheduler) as client:
            yield _OnDask(client)
    elif workers == 1:
        yield in_this_process
    else:
        with _local_cluster(workers) as address, _client(address) as client:
            yield _OnDask(client)


@contextmanager
def _local_cluster(workers: int) -> Iterator[str]:
    from distributed import LocalCluster

    # its processes have OMP_NUM_THREADS=1 and the like from dask
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
        preload=["gbas_studies.campaign.local_worker"],
    ) as cluster:
        yield cluster.scheduler_address


@contextmanager
def _client(address: str) -> Iterator[Client]:
    from distributed import Client

    try:
        client = Client(address, timeout=_WAIT_S)
    except (OSError, ValueError) as error:
        raise CampaignError(f"no scheduler of dask answers at {address}: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_WAIT_S)
        except TimeoutError:
            raise CampaignError(f"the scheduler {address} has no worker: start some with dask worker") from None
        yield client


class _OnDask:
    """Batches as tasks of dask, which gives those of a lost worker to another."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def __call__(self, work: Work, trials: Sequence[Numbered], batch: int) -> Iterator[list[Line]]:
        workers = len(self._client.nthreads())
        size = max(1, min(batch, math.ceil(len(trials) / (_BATCHES_A_WORKER * workers))))
        # what all batches need is a task of its own: it goes once to each worker, and is made anew when one is lost
        packed = self._client.submit(bytes, pickle.dumps(work), pure=False)
        versions, task = (suite_version(), library_versions()), _task()
        pending = {
            self._client.submit(task, packed, pickle.dumps(trials[at : at + size]), versions, pure=False)
            for at in range(0, len(trials), size)
        }
        done: Queue[Any] = Queue()
        for future in pending:
            future.add_done_callback(done.put)
        try:
            while pending:
                future = self._next(done)
                with _explained():
                    lines = self._lines(future)
                yield lines
                pending.remove(future)
                future.release()
        finally:
            with suppress(Exception):  # the scheduler may be what was lost
                self._client.cancel(list(pending))

    def _next(self, done: Queue[Any]) -> Any:
        """The next batch that is done."""
        while True:
            try:
                return done.get(timeout=_LOOK_S)
            except Empty:
                self._check_workers()

    def _lines(self, future: Any) -> list[Line]:
        """Results of a batch; when a worker is lost with them before they are here, they are made anew."""
        while True:
            try:
                lines: list[Line] = future.result(timeout=_LOOK_S)
            except TimeoutError:
                if future.status == "error":  # of a trial
                    raise
                self._check_workers()
            else:
                return lines

    def _check_workers(self) -> None:
        """As long as there is a worker its batch is waited for; a local one that was lost is back soon."""
        try:
            self._client.wait_for_workers(1, timeout=_LOST_S)
        except TimeoutError:
            raise CampaignError("no worker is left; what is done is kept, if there is a file for it") from None


def _task() -> Callable[..., list[Line]]:
    """What a worker is told to do: a function sent by value, so that one without the suite can say that it has none."""

    def run_there(*arguments: Any) -> list[Line]:
        from gbas_studies.campaign.work import run_packed_batch

        return run_packed_batch(*arguments)

    return run_there


@contextmanager
def _explained() -> Iterator[None]:
    """Say what a person can do about errors of dask; those of a trial stay."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        yield
    except KilledWorker as error:
        raise CampaignError(
            f"the same trials ended {error.allowed_failures + 1} workers: is there memory for them?"
        ) from None
    except (CancelledError, CommClosedError):
        raise CampaignError("the scheduler is lost; what is done is kept, if there is a file for it") from None
    except (ModuleNotFoundError, AttributeError) as error:
        if "gbas_" not in str(error):
            raise
        raise CampaignError(f"a worker has another suite, or none: {error}; install the same there") from None
