"""What the benchmark measured: figures, each against a bound or a peer, and the document they make."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gbas_bringup import __version__

Better = Literal["less", "more"]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One measured figure and what it is compared with.

    Attributes
    ----------
    part : str
        Part of the benchmark it belongs to.
    name : str
    value : float
    unit : str
    against : str
        What `reference` is: a bound or a peer.
    reference : float
        In the same unit.
    better : {"less", "more"}
        Whether a small value is good or a large one.
    """

    part: str
    name: str
    value: float
    unit: str
    against: str
    reference: float
    better: Better

    @property
    def ratio(self) -> float:
        """How many times better than the bound or peer: 1 or more is as good as it, or better."""
        return self.reference / self.value if self.better == "less" else self.value / self.reference

    def as_json(self) -> dict[str, Any]:
        """The figure as JSON-able data."""
        return {
            "part": self.part,
            "name": self.name,
            "value": float(self.value),
            "unit": self.unit,
            "against": self.against,
            "reference": float(self.reference),
            "better": self.better,
            "ratio": float(self.ratio),
        }


@dataclass(frozen=True, kw_only=True)
class Part:
    """What one part of the benchmark gave: figures, or why there are none.

    Attributes
    ----------
    name : str
    about : str
        What was measured and how.
    figures : tuple of Figure
    skipped : str
        Why the part was not measured; empty when it was.
    details : mapping
        More, for the JSON document.
    """

    name: str
    about: str
    figures: tuple[Figure, ...] = ()
    skipped: str = ""
    details: Mapping[str, Any] | None = None

    def as_json(self) -> dict[str, Any]:
        """The part as JSON-able data."""
        return {
            "part": self.name,
            "about": self.about,
            "figures": [figure.as_json() for figure in self.figures],
            **({"skipped": self.skipped} if self.skipped else {}),
            **({"details": dict(self.details)} if self.details else {}),
        }


def environment() -> dict[str, Any]:
    """The machine and its load, without which no figure means anything."""
    return {
        "suite_version": __version__,
        "commit": _commit(),
        "cores": len(os.sched_getaffinity(0)),
        "processor": _processor(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "middleware": os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp (default)"),
        "load_before": round(os.getloadavg()[0], 2),
    }


def document(about: Mapping[str, Any], parts: Sequence[Part]) -> dict[str, Any]:
    """The report: environment and parts."""
    return {
        "environment": {**about, "load_after": round(os.getloadavg()[0], 2)},
        "parts": [part.as_json() for part in parts],
    }


def _commit() -> str:
    """The checkout's commit, marked when something in it has changed; empty for an installed suite."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10.0).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
