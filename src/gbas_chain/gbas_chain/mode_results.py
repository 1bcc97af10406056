"""What every processing mode gave in a run: a table, and a summary with the reason where a mode gave nothing."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_msgs_py.codes import ServiceCause, ServiceType
from gbas_msgs_py.modes import Mode, mode_of
from gbas_msgs_py.records import ModesEpoch

MODES_HEADER: Final = (
    "gps_week",
    "tow_s",
    "mode",
    "systems",
    "x_m",
    "y_m",
    "z_m",
    "n_sats",
    "vpl_m",
    "lpl_m",
    "d_vert_m",
    "d_lat_m",
)
_NUMBERS: Final = MODES_HEADER[4:]
_PERCENTILES: Final = (50, 95, 99)


def systems_of(mode: Mode, systems: str) -> str:
    """The systems of a mode that a receiver uses, in the order GE."""
    return "".join(letter for letter in "GE" if letter in mode.systems and letter in systems)


def write_modes_csv(path: Path, epochs: Iterable[ModesEpoch], systems: str) -> None:
    """Write ``modes.csv`` (see :data:`MODES_HEADER`): a row for each epoch and mode, numbers empty where missing.

    As in ``solution.csv`` there is no position without its protection levels.
    """
    with path.open("w", newline="", encoding="ascii") as sink:
        writer = csv.writer(sink, lineterminator="\n")
        writer.writerow(MODES_HEADER)
        for epoch in epochs:
            writer.writerows(_rows(epoch, systems))


def _rows(epoch: ModesEpoch, systems: str) -> Iterator[tuple[str, ...]]:
    protected = _protected(epoch)
    for row, number in enumerate(epoch.mode.tolist()):
        mode = mode_of(number)
        values = [float(getattr(epoch, name)[row]) if protected[row] else math.nan for name in _NUMBERS]
        texts = ["" if math.isnan(value) else repr(value) for value in values]
        if texts[3]:
            texts[3] = str(int(values[3]))
        yield (str(epoch.gps_week), repr(float(epoch.tow_s)), mode.service.option, systems_of(mode, systems), *texts)


def _protected(epoch: ModesEpoch) -> BoolArray:
    protected: BoolArray = np.isfinite(epoch.x_m + epoch.y_m + epoch.z_m + epoch.vpl_m + epoch.lpl_m)
    return protected


def mode_summary(epochs: Sequence[ModesEpoch], systems: str) -> dict[str, dict[str, Any]]:
    """By mode and systems: epochs with a protected position, percentiles of levels, and causes of no service.

    ``not_solved`` says in how many of the other epochs which cause stood against a position with levels.
    """
    found: dict[str, dict[str, Any]] = {}
    if not epochs:
        return found
    columns = {name: np.array([getattr(epoch, name) for epoch in epochs]) for name in (*_NUMBERS, "cause", "service")}
    protected = np.array([_protected(epoch) for epoch in epochs])
    for row, number in enumerate(epochs[0].mode.tolist()):
        mode, solved = mode_of(number), protected[:, row]
        own = {name: column[solved, row] for name, column in columns.items()}
        summary: dict[str, Any] = {"epochs": int(solved.sum())}
        if solved.any():
            summary |= {name: _percentiles(own[name]) for name in ("vpl_m", "lpl_m")}
            summary["n_sats"] = {"min": int(own["n_sats"].min()), "max": int(own["n_sats"].max())}
            if mode.beside:
                summary |= {name: _percentiles(own[name]) for name in ("d_vert_m", "d_lat_m")}
        summary["service_epochs"] = int((columns["service"][:, row] != ServiceType.NONE).sum())
        summary["no_service"] = _causes(own["cause"])
        summary["not_solved"] = _causes(columns["cause"][~solved, row])
        found.setdefault(mode.service.option, {})[systems_of(mode, systems)] = summary
    return found


def _percentiles(values: FloatArray) -> dict[str, float]:
    at = np.percentile(values, _PERCENTILES)
    named = {f"p{percent}": float(value) for percent, value in zip(_PERCENTILES, at, strict=True)}
    return named | {"max": float(values.max())}


def _causes(numbers: FloatArray) -> dict[str, int]:
    words = (ServiceCause(int(number)) for number in numbers.tolist())
    return dict(sorted(Counter(cause.word for cause in words if cause is not ServiceCause.NONE).items()))


def mode_lines(summary: dict[str, dict[str, Any]]) -> list[str]:
    """The summary as a person reads it."""
    lines = []
    for option, by_systems in summary.items():
        for systems, found in by_systems.items():
            text = f"{option:<12} {systems:<2} {found['epochs']:>6} epochs"
            if found["epochs"]:
                text += f", VPL {found['vpl_m']['p50']:.2f} m, LPL {found['lpl_m']['p50']:.2f} m (medians)"
            if found["not_solved"]:
                text += "; not: " + ", ".join(f"{cause} {count}" for cause, count in found["not_solved"].items())
            lines.append(text)
    return lines
