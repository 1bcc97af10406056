"""The picture of an approach: protection levels and errors against the alert limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

_ALERT = "#b2182b"
_LEVEL = "#2166ac"
_ERROR = "#4d4d4d"


def plot_approach(
    solutions: Sequence[SolutionEpoch],
    protections: Sequence[ProtectionEpoch],
    path: Path,
    *,
    title: str,
    errors_m: tuple[np.ndarray, np.ndarray] | None = None,
) -> None:
    """Draw VPL and LPL against VAL and LAL over the distance to the threshold.

    Parameters
    ----------
    solutions, protections
        The same epochs, in order. Epochs without a position or a protection level leave a gap.
    path : Path
        Picture to write (its suffix chooses the format).
    title : str
        Says what was flown, and whether it was simulated.
    errors_m : pair of (n,) arrays, optional
        Absolute vertical and lateral position errors [m] where the truth is known.
    """
    distance_km = np.array([solution.distance_to_ltp_m for solution in solutions]) / 1000.0
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9.0, 7.0), layout="constrained")
    figure.suptitle(title)
    for axis, name, level, limit, index in (
        (axes[0], "vertical", "vpl_m", "val_m", 0),
        (axes[1], "lateral", "lpl_m", "lal_m", 1),
    ):
        levels = np.array([getattr(epoch, level) for epoch in protections])
        limits = np.array([getattr(epoch, limit) for epoch in protections])
        _panel(axis, distance_km, levels, limits, name)
        if errors_m is not None:
            axis.plot(distance_km, errors_m[index], color=_ERROR, linewidth=0.9, label=f"{name} error")
        _shade_alerts(axis, distance_km, np.array([epoch.alert for epoch in protections]) != 0.0)
        axis.legend(loc="upper right", ncols=4, fontsize="small", framealpha=0.9)
    axes[1].set_xlabel("distance to the threshold [km]  (the aircraft flies to the right)")
    if np.isfinite(distance_km).any():
        axes[1].set_xlim(np.nanmax(distance_km), min(0.0, np.nanmin(distance_km)))
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _panel(axis: Axes, distance_km: np.ndarray, level: np.ndarray, limit: np.ndarray, name: str) -> None:
    short = name[0].upper()
    axis.plot(distance_km, limit, color=_ALERT, linewidth=1.6, label=f"{short}AL (alert limit)")
    axis.plot(distance_km, level, color=_LEVEL, linewidth=1.4, label=f"{short}PL (protection level)")
    axis.set_ylabel(f"{name} [m]")
    # Errors are centimetres, protection levels metres and limits tens of metres: only a logarithm shows all three.
    axis.set_yscale("log")
    axis.set_ylim(0.003, 600.0)
    axis.yaxis.set_major_formatter("{x:g}")
    axis.grid(alpha=0.3, which="both", linewidth=0.5)


def _shade_alerts(axis: Axes, distance_km: np.ndarray, alert: np.ndarray) -> None:
    places = np.flatnonzero(alert & np.isfinite(distance_km))
    if places.size:
        runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
        for number, run in enumerate(runs):
            label = "no service" if number == 0 else None
            axis.axvspan(distance_km[run[0]], distance_km[run[-1]], color=_ALERT, alpha=0.12, label=label)
