"""What a run leaves behind: the solution table and its summary.

The same rows are written by ``gbas process``, by the demo and from a bag, so that files of the three can be compared
byte by byte.
"""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import calendar_text
from gbas_msgs_py.codes import ServiceType
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

SOLUTION_HEADER = (
    "gps_week",
    "tow_s",
    "x_m",
    "y_m",
    "z_m",
    "lat_deg",
    "lon_deg",
    "height_m",
    "n_sats",
    "service",
    "vpl_m",
    "lpl_m",
    "val_m",
    "lal_m",
    "alert",
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One epoch as the outside world sees it: without a valid protection level there is no position.

    Attributes
    ----------
    position_m : (3,) array or None
        ECEF position [m]; None when there is no position or no protection level to go with it.
    """

    gps_week: int
    tow_s: float
    position_m: np.ndarray | None
    n_sats: int
    service: str
    vpl_m: float
    lpl_m: float
    val_m: float
    lal_m: float
    alert: bool

    @classmethod
    def of(cls, solution: SolutionEpoch, protection: ProtectionEpoch) -> Row:
        """Join a solution and its protection levels.

        Raises
        ------
        ValueError
            When the two are of different epochs.
        """
        if (solution.gps_week, solution.tow_s) != (protection.gps_week, protection.tow_s):
            raise ValueError(
                f"solution of {solution.gps_week}/{solution.tow_s} s joined with protection levels of "
                f"{protection.gps_week}/{protection.tow_s} s"
            )
        position = np.array([solution.x_m, solution.y_m, solution.z_m])
        protected = bool(
            np.isfinite(position).all() and math.isfinite(protection.vpl_m) and math.isfinite(protection.lpl_m)
        )
        service = ServiceType(int(protection.service)) if math.isfinite(protection.service) else ServiceType.NONE
        return cls(
            gps_week=solution.gps_week,
            tow_s=solution.tow_s,
            position_m=position if protected else None,
            n_sats=int(solution.n_sats) if protected else 0,
            service="none" if service is ServiceType.NONE else service.option,
            vpl_m=protection.vpl_m,
            lpl_m=protection.lpl_m,
            val_m=protection.val_m,
            lal_m=protection.lal_m,
            alert=protection.alert != 0.0,  # a missing flag is an alert
        )

    def fields(self) -> tuple[str, ...]:
        """The row as text; missing is empty, and floats are written so that they read back to the same bits."""
        if self.position_m is None:
            place = [""] * 6
        else:
            latitude, longitude, height = geodetic_from_ecef(self.position_m)
            degrees = [f"{float(angle):.10f}" for angle in np.degrees([latitude, longitude])]
            place = [*(repr(float(value)) for value in self.position_m), *degrees, f"{float(height):.4f}"]
        levels = [
            "" if math.isnan(value) else repr(float(value))
            for value in (self.vpl_m, self.lpl_m, self.val_m, self.lal_m)
        ]
        head = (str(self.gps_week), repr(float(self.tow_s)))
        return (*head, *place, str(self.n_sats), self.service, *levels, str(int(self.alert)))


def write_solution_csv(path: Path, rows: Iterable[Row]) -> None:
    """Write ``solution.csv`` (see :data:`SOLUTION_HEADER`)."""
    with path.open("w", newline="", encoding="ascii") as sink:
        writer = csv.writer(sink, lineterminator="\n")
        writer.writerow(SOLUTION_HEADER)
        writer.writerows(row.fields() for row in rows)


@dataclass(frozen=True, kw_only=True)
class PositionErrors:
    """Absolute errors of the protected positions ``(n,)`` [m]; NaN where there is no position or no truth."""

    horizontal_m: np.ndarray
    vertical_m: np.ndarray
    lateral_m: np.ndarray


def position_errors(rows: Sequence[Row], truth_m: np.ndarray, *, course_rad: float = 0.0) -> PositionErrors:
    """Errors of each epoch against the truth ``(3,)`` or ``(len(rows), 3)``; arguments as :func:`error_statistics`."""
    truth = np.broadcast_to(truth_m, (len(rows), 3))
    missing = np.full(3, np.nan)
    position = np.array([missing if row.position_m is None else row.position_m for row in rows]).reshape(-1, 3)
    known = truth[np.isfinite(truth).all(axis=1)]
    latitude, longitude, _ = geodetic_from_ecef(known[-1]) if len(known) else (np.nan, np.nan, np.nan)
    east, north, up = ((position - truth) @ rot_enu_ecef(latitude, longitude).T).T
    return PositionErrors(
        horizontal_m=np.hypot(east, north),
        vertical_m=np.abs(up),
        lateral_m=np.abs(east * np.cos(course_rad) - north * np.sin(course_rad)),
    )


def error_statistics(rows: Sequence[Row], truth_m: np.ndarray, *, course_rad: float = 0.0) -> dict[str, Any]:
    """Errors of the protected positions against the truth.

    Parameters
    ----------
    truth_m : (3,) or (len(rows), 3) array
        True antenna position [m], ECEF; NaN where unknown.
    course_rad : float
        True course about which the lateral protection level holds [rad]; north when there is no final approach.

    Returns
    -------
    dict
        Root mean square and largest errors [m], and in how many epochs the vertical and the lateral error stayed within
        the protection levels; ``worst_ratio`` is the largest error over its protection level.
    """
    errors = position_errors(rows, truth_m, course_rad=course_rad)
    used = np.flatnonzero(np.isfinite(errors.vertical_m))
    if not used.size:
        return {"epochs": 0}
    horizontal, vertical, lateral = errors.horizontal_m[used], errors.vertical_m[used], errors.lateral_m[used]
    vpl = np.array([row.vpl_m for row in rows])[used]
    lpl = np.array([row.lpl_m for row in rows])[used]
    return {
        "epochs": int(used.size),
        "horizontal_rms_m": float(np.sqrt(np.mean(horizontal**2))),
        "vertical_rms_m": float(np.sqrt(np.mean(vertical**2))),
        "horizontal_max_m": float(horizontal.max()),
        "vertical_max_m": float(vertical.max()),
        "lateral_max_m": float(lateral.max()),
        "vertical_bounded_epochs": int((vertical <= vpl).sum()),
        "lateral_bounded_epochs": int((lateral <= lpl).sum()),
        "vertical_worst_ratio": float((vertical / vpl).max()),
        "lateral_worst_ratio": float((lateral / lpl).max()),
    }


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """What a run gave, in counts and ranges (the body of ``summary.json``)."""
    solved = [row for row in rows if row.position_m is not None]
    vpl = [row.vpl_m for row in solved]
    lpl = [row.lpl_m for row in solved]
    return {
        "epochs": len(rows),
        "epochs_solved": len(solved),
        "epochs_alert": sum(row.alert for row in rows),
        "service_epochs": dict(sorted(Counter(row.service for row in rows).items())),
        "first_epoch": [rows[0].gps_week, rows[0].tow_s] if rows else None,
        "last_epoch": [rows[-1].gps_week, rows[-1].tow_s] if rows else None,
        "first_solved_epoch": [solved[0].gps_week, solved[0].tow_s] if solved else None,
        "satellites_min_max": [min(r.n_sats for r in solved), max(r.n_sats for r in solved)] if solved else None,
        "vpl_m_min_median_max": _three(vpl),
        "lpl_m_min_median_max": _three(lpl),
    }


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """A summary as a person reads it."""
    total, solved = summary["epochs"], summary["epochs_solved"]
    lines = [f"epochs       {total}{_span(summary['first_epoch'], summary['last_epoch'])}"]
    if not solved:
        return [*lines, "positions    none with a protection level"]
    service = ", ".join(f"{name} in {count}" for name, count in summary["service_epochs"].items())
    low, high = summary["satellites_min_max"]
    lines += [
        f"positions    {solved}, from {calendar_text(*summary['first_solved_epoch'])[11:19]} on; service {service}",
        f"satellites   {low} to {high}",
        f"VPL, LPL     median {summary['vpl_m_min_median_max'][1]:.2f} m, {summary['lpl_m_min_median_max'][1]:.2f} m; "
        f"largest {summary['vpl_m_min_median_max'][2]:.2f} m, {summary['lpl_m_min_median_max'][2]:.2f} m",
    ]
    errors = summary.get("errors", {})
    if errors.get("epochs"):
        lines += [
            f"errors, rms  {errors['horizontal_rms_m']:.3f} m horizontal, {errors['vertical_rms_m']:.3f} m vertical",
            f"protected    vertical error within VPL in {errors['vertical_bounded_epochs']} of {errors['epochs']}, "
            f"lateral within LPL in {errors['lateral_bounded_epochs']}; "
            f"worst error/PL {max(errors['vertical_worst_ratio'], errors['lateral_worst_ratio']):.3f}",
        ]
    if summary.get("rests_on"):
        lines.append(f"rests on     {', '.join(summary['rests_on'])}")
    if summary.get("simulated"):
        lines.append("data         simulated")
    return lines


def _span(first: list[Any] | None, last: list[Any] | None) -> str:
    if first is None or last is None:
        return ""
    return f", {calendar_text(*first)[:19]} to {calendar_text(*last)[11:19]} (GPS time)"


def _three(values: Sequence[float]) -> list[float] | None:
    return [min(values), float(np.median(values)), max(values)] if values else None


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a JSON document for people and programs to read."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
