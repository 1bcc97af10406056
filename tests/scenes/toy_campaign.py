"""A campaign of next to nothing, with trials that end their worker the first time."""

from __future__ import annotations

import math
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbas_studies.campaign import Campaign


@dataclass(frozen=True)
class Toy:
    """Settings: a factor, and the folder in which processes leave their names."""

    factor: float
    notes: Path | None = None


@dataclass(frozen=True)
class Drawn:
    """Result: numbers of all sorts."""

    number: int
    value: float
    none: float
    names: tuple[str, ...]


def prepare(settings: Toy) -> Toy:
    """Leave a note, so that a test can count how often."""
    if settings.notes is not None:
        with open(settings.notes / f"prepared-{os.getpid()}", "a", encoding="utf-8") as file:
            file.write("once\n")
    return settings


def draw(context: Toy, trial: str, seed: np.random.SeedSequence) -> Drawn:
    """Draw a number; ``deadly`` trials kill the process that runs them, unless they have done so before."""
    number = int(seed.spawn_key[0])
    if trial == "deadly":
        assert context.notes is not None
        mark = context.notes / f"killed-{number}"
        if not mark.exists():
            mark.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)
    if trial == "wrong":
        raise ValueError(f"trial {number} is wrong")
    value = context.factor * float(np.random.default_rng(seed).standard_normal())
    return Drawn(number=number, value=value, none=math.inf if number % 2 else -math.inf, names=(trial, "ä"))


def toy_campaign(trials: list[str], *, seed: int = 1, factor: float = 1.0, notes: Path | None = None, batch: int = 3):
    """The campaign."""
    return Campaign(
        study="toy", settings=Toy(factor, notes), trials=trials, prepare=prepare, run_trial=draw, result=Drawn,
        seed=seed, batch=batch,
    )  # fmt: skip
