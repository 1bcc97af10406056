"""A report of the benchmark against an earlier one: how many times better each figure has become."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gbas_core.errors import ConfigError

_MACHINE = ("processor", "cores", "system", "python", "numpy", "middleware")


@dataclass(frozen=True, kw_only=True)
class Change:
    """A figure that both reports have.

    Attributes
    ----------
    part, name, unit : str
    before, now : float
    ratio : float
        How many times better than before: 1 is as before, 2 half the time or twice the speed.
    """

    part: str
    name: str
    unit: str
    before: float
    now: float
    ratio: float


def read_report(path: Path) -> dict[str, Any]:
    """A report that ``gbas bench`` wrote.

    Raises
    ------
    ConfigError
        When it cannot be read, or is something else.
    """
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
        for _ in _figures(report):
            pass
        report["environment"]["load_before"]
    except OSError as error:
        raise ConfigError(path, f"cannot be read: {error.strerror}") from error
    except (ValueError, LookupError, TypeError) as error:
        raise ConfigError(path, f"is not a report of gbas bench (bench.json): {error!r}") from error
    return dict(report)


def changes(now: Mapping[str, Any], before: Mapping[str, Any]) -> tuple[Change, ...]:
    """Figures of both reports, by part and name, in the order of the new one."""
    earlier = dict(_figures(before))
    found = []
    for key, figure in _figures(now):
        old = earlier.get(key)
        if old is None or old["unit"] != figure["unit"]:
            continue
        value, was = float(figure["value"]), float(old["value"])
        ratio = was / value if figure["better"] == "less" else value / was
        found.append(Change(part=key[0], name=key[1], unit=figure["unit"], before=was, now=value, ratio=ratio))
    return tuple(found)


def other_machine(now: Mapping[str, Any], before: Mapping[str, Any]) -> tuple[str, ...]:
    """What differs between the machines of two reports; figures can be compared when nothing does."""
    new, old = now["environment"], before["environment"]
    return tuple(f"{name} {old.get(name)}, now {new[name]}" for name in _MACHINE if old.get(name) != new[name])


def mean_ratio(found: tuple[Change, ...]) -> float:
    """Geometric mean of the ratios; NaN without any."""
    return math.exp(math.fsum(math.log(each.ratio) for each in found) / len(found)) if found else math.nan


def _figures(report: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str], Mapping[str, Any]]]:
    for part in report["parts"]:
        for figure in part["figures"]:
            if not (figure["value"] > 0.0 and figure["better"] in ("less", "more") and figure["unit"]):
                raise ValueError(f"figure {figure['name']!r} has no value")
            yield (str(part["part"]), str(figure["name"])), figure
