"""A campaign: what its trials are, what they share, and what one trial is."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, TypeVar

import numpy as np

from gbas_studies.campaign.version import library_versions, suite_version

FORMAT = "gbas/campaign/1"

Settings = TypeVar("Settings")
Context = TypeVar("Context")
Trial = TypeVar("Trial")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class Campaign(Generic[Settings, Context, Trial, Result]):
    """Independent trials of one study.

    Functions are those of a module, so that a worker finds them by name.

    Attributes
    ----------
    study : str
        Its name, such as ``"faults"``.
    settings : Settings
        All that the context is made from: small, for it travels to the workers.
    trials : sequence of Trial
        What each trial is, small too.
    prepare : callable
        From the settings to the context: what is costly and the same for all trials, made once in each worker.
    run_trial : callable
        From context, trial and the trial's own seed to its result, which depends on nothing else.
    result : type
        Of a result: a dataclass of numbers, texts, tuples and mappings, or one of these itself.
    seed : int
        Of the campaign; trial number n has ``SeedSequence(seed, spawn_key=(n,))``.
    batch : int
        Most trials that go to a worker at once: as many as take about a second.
    """

    study: str
    settings: Settings
    trials: Sequence[Trial]
    prepare: Callable[[Settings], Context]
    run_trial: Callable[[Context, Trial, np.random.SeedSequence], Result]
    result: Any
    seed: int = 0
    batch: int = 1

    def header(self) -> dict[str, Any]:
        """What must be the same for results to belong together."""
        return {
            "format": FORMAT,
            "study": self.study,
            "seed": self.seed,
            "trials": len(self.trials),
            "plan": digest((self.settings, tuple(self.trials), self.prepare, self.run_trial)),
            "suite": suite_version(),
            "libraries": library_versions(),
        }


def trial_seed(seed: int, number: int) -> np.random.SeedSequence:
    """Seed of a trial: the child of this number that ``SeedSequence(seed).spawn()`` would give."""
    return np.random.SeedSequence(seed, spawn_key=(number,))


def digest(value: Any) -> str:
    """SHA-256 of parameters and other plain data, the same in every process and on every machine.

    Raises
    ------
    TypeError
        For a type whose values have no such form.
    """
    return hashlib.sha256(json.dumps(_canonical(value)).encode()).hexdigest()


def _canonical(value: Any) -> Any:
    """The value in lists, texts and whole numbers; what differs in type or in the last bit differs here."""
    if isinstance(value, Enum):
        return [_name(type(value)), value.name]
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        return ["array", value.dtype.str, value.shape, hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, np.generic):
        return _canonical(value.item())
    if is_dataclass(value) and not isinstance(value, type):
        return [_name(type(value)), [[each.name, _canonical(getattr(value, each.name))] for each in fields(value)]]
    if isinstance(value, Mapping):
        return ["mapping", [[_canonical(key), _canonical(item)] for key, item in value.items()]]
    if isinstance(value, list | tuple | range):
        return ["sequence", [_canonical(each) for each in value]]
    if isinstance(value, Set):
        return ["set", sorted(json.dumps(_canonical(each)) for each in value)]
    if isinstance(value, partial):
        return ["partial", _name(value.func), _canonical(value.args), _canonical(value.keywords)]
    if isinstance(value, FunctionType | type):
        return _name(value)
    if isinstance(value, Path):
        return ["path", str(value)]
    raise TypeError(f"{_name(type(value))} has no place in a plan")


def _name(thing: Any) -> str:
    return f"{thing.__module__}.{thing.__qualname__}"
