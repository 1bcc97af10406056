"""Run a campaign wherever it is wanted, and go on with what was done before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from gbas_studies.campaign.errors import CampaignInterrupted
from gbas_studies.campaign.executors import executor
from gbas_studies.campaign.plan import Campaign
from gbas_studies.campaign.store import Store, open_store
from gbas_studies.campaign.work import Work

Progress = Callable[[int, int], None]
"""Told how many of how many trials are done."""

Result = TypeVar("Result")


def _unseen(done: int, total: int) -> None:
    """Progress nobody watches."""


@dataclass(frozen=True, kw_only=True)
class Execution:
    """Where trials run, and where their results go: nothing of it changes them.

    Attributes
    ----------
    workers : int
        Processes on this machine; 1: this process.
    scheduler : str or None
        Address of a scheduler of dask, whose workers are used instead, such as ``tcp://10.0.0.1:8786``.
    out : Path or None
        File of the results; if there is one of the same campaign, only what it lacks is done.
    progress : callable
    """

    workers: int = 1
    scheduler: str | None = None
    out: Path | None = None
    progress: Progress = _unseen


def run(campaign: Campaign[Any, Any, Any, Result], execution: Execution | None = None) -> list[Result]:
    """Results of all trials, in their order.

    They are the same whoever made them, also when the run was stopped in between or workers were lost: each trial
    depends on context, trial and its own seed alone, and all results come out of their JSON.

    Raises
    ------
    CampaignError
        When file, scheduler or a worker cannot be used.
    CampaignInterrupted
        On Ctrl-C, if there is a file that has what is done.
    """
    how = execution or Execution()
    with open_store(how.out, campaign.header()) as store:
        try:
            _complete(campaign, how, store)
        except KeyboardInterrupt:
            if how.out is None:
                raise
            done = f"{len(store.lines)} of {len(campaign.trials)} trials are in {how.out}"
            raise CampaignInterrupted(f"interrupted; {done}, and the same command goes on from there") from None
    read = TypeAdapter(campaign.result).validate_json
    return [read(store.lines[number]) for number in range(len(campaign.trials))]


def _complete(campaign: Campaign[Any, Any, Any, Any], how: Execution, store: Store) -> None:
    """Do the trials that the store lacks."""
    left = [(number, trial) for number, trial in enumerate(campaign.trials) if number not in store.lines]
    how.progress(len(store.lines), len(campaign.trials))
    if not left:
        return
    with executor(how.workers, how.scheduler) as execute:
        for lines in execute(Work.of(campaign), left, campaign.batch):
            store.add(lines)
            how.progress(len(store.lines), len(campaign.trials))
