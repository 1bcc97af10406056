"""What a worker does: it makes what the trials share once, and runs batches of them."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic_core import to_json

from gbas_studies.campaign.errors import CampaignError
from gbas_studies.campaign.plan import Campaign, trial_seed
from gbas_studies.campaign.version import library_versions, suite_version

Numbered = tuple[int, Any]
"""A trial with its number."""
Line = tuple[int, str]
"""Number of a trial, and its result as JSON."""


@dataclass(frozen=True, kw_only=True)
class Work:
    """A campaign without its trials: what every worker needs to know.

    Attributes
    ----------
    plan : str
        Hash of the campaign's plan.
    settings, prepare, run_trial, seed
        Of the campaign.
    """

    plan: str
    settings: Any
    prepare: Callable[[Any], Any]
    run_trial: Callable[[Any, Any, np.random.SeedSequence], Any]
    seed: int

    @classmethod
    def of(cls, campaign: Campaign[Any, Any, Any, Any]) -> Work:
        """The work of a campaign."""
        return cls(
            plan=campaign.header()["plan"],
            settings=campaign.settings,
            prepare=campaign.prepare,
            run_trial=campaign.run_trial,
            seed=campaign.seed,
        )


def run_batch(work: Work, context: Any, batch: Sequence[Numbered]) -> list[Line]:
    """Run some trials; a result that is no number travels as the word ``NaN`` or ``Infinity``."""
    lines = []
    for number, trial in batch:
        result = work.run_trial(context, trial, trial_seed(work.seed, number))
        lines.append((number, to_json(result, inf_nan_mode="strings").decode()))
    return lines


_context: dict[str, Any] = {}
"""What the trials of the present campaign share, in this worker, by the plan's hash."""


def run_packed_batch(packed_work: bytes, packed_batch: bytes, versions: tuple[str, dict[str, str]]) -> list[Line]:
    """Run some trials in a worker of dask.

    Parameters
    ----------
    packed_work, packed_batch : bytes
        Pickled, so that nothing of the suite is read before its version is known to be the same.
    versions : (str, dict)
        Suite and libraries of the campaign.

    Raises
    ------
    CampaignError
        When this worker has others, or several threads.
    """
    _check_worker(*versions)
    work: Work = pickle.loads(packed_work)
    if work.plan not in _context:
        _context.clear()
        _context[work.plan] = work.prepare(work.settings)
    return run_batch(work, _context[work.plan], pickle.loads(packed_batch))


def _check_worker(suite: str, libraries: dict[str, str]) -> None:
    from distributed import get_worker

    worker = get_worker()
    if suite_version() != suite:
        raise CampaignError(
            f"worker {worker.address} has suite {suite_version()}, and this campaign is of {suite}; "
            "install the same there and start it anew"
        )
    for name, theirs in library_versions().items():
        if theirs != libraries.get(name):
            raise CampaignError(
                f"worker {worker.address} has {name} {theirs}, and this campaign is of {libraries.get(name)}; "
                "install the same there and start it anew"
            )
    # compiled functions and contexts are for one trial at a time
    if worker.state.nthreads != 1:
        raise CampaignError(
            f"worker {worker.address} has {worker.state.nthreads} threads; start it with --nthreads 1 and as many "
            "--nworkers as there are cores"
        )
