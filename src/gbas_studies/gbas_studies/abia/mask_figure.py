"""Picture of a masking table: what an antenna does not see, beside the airframe from two sides."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gbas_airborne.abia.airframe.mask_table import MaskTable, antenna_elevation_rad
from gbas_airborne.abia.airframe.mesh import Airframe
from gbas_core.record import FloatArray
from gbas_studies.reproduction.drawing import COLOURS, LIMIT_COLOUR, new_figure

_OPEN, _BELOW, _BODY = "#FFFFFF", "#BBBBBB", COLOURS[0]
_HEADINGS_DEG: Final = {0: "nose", 90: "right wing", 180: "tail", 270: "left wing", 360: "nose"}


def mask_figure(table: MaskTable, mesh: Airframe, antenna_m: tuple[float, float, float]) -> Figure:
    """Map of the sky in the body frame above; the airframe from above and from the right with its antenna below."""
    figure = new_figure(2, 2, width=9.0, height=7.6, height_ratios=(1.3, 1.0))
    sky, unused, above, side = figure.axes
    unused.remove()
    grid = sky.get_gridspec()
    assert grid is not None
    sky.set_subplotspec(grid[0, :])
    _draw_sky(sky, table)
    from_above = mesh.corners_m[:, :, [1, 0]]
    from_right = mesh.corners_m[:, :, [0, 2]] * [1.0, -1.0]
    forward, right, down = antenna_m
    _draw_airframe(above, from_above, (right, forward), ("right [m]", "forward [m]"))
    _draw_airframe(side, from_right, (forward, -down), ("forward [m]", "up [m]"))
    sky.set_title(f"{mesh.name}: {100.0 * table.blocked_share():.2f} % of the antenna's hemisphere is hidden by it")
    return figure


def _draw_sky(axis: Axes, table: MaskTable) -> None:
    columns, rows = table.blocked.shape
    azimuth = (np.arange(columns) + 0.5) * (2.0 * math.pi / columns)
    elevation = (np.arange(rows) + 0.5) * (math.pi / rows) - 0.5 * math.pi
    seen = antenna_elevation_rad(azimuth[:, np.newaxis], elevation[np.newaxis, :], table.axis)
    shown = np.where(table.blocked, 2, np.where(seen < table.horizon_rad, 1, 0))
    axis.imshow(
        shown.T,
        origin="lower",
        extent=(0.0, 360.0, -90.0, 90.0),
        aspect="auto",
        cmap=ListedColormap([_OPEN, _BELOW, _BODY]),
        vmin=0,
        vmax=2,
        interpolation="nearest",
    )
    axis.set_xticks(list(_HEADINGS_DEG), list(_HEADINGS_DEG.values()))
    axis.set_yticks(range(-90, 91, 30))
    axis.set_ylabel("elevation in the body frame [deg]")
    axis.legend(
        handles=[
            Patch(facecolor=_BODY, label="hidden by the airframe"),
            Patch(facecolor=_BELOW, label=f"less than {math.degrees(table.horizon_rad):g}° above the antenna's plane"),
            Patch(facecolor=_OPEN, edgecolor="black", label="seen"),
        ],
        loc="upper right",
        fontsize="small",
    )


def _draw_airframe(axis: Axes, triangles: FloatArray, antenna: tuple[float, float], labels: tuple[str, str]) -> None:
    axis.add_collection(PolyCollection(list(triangles), facecolor=COLOURS[6], edgecolor=COLOURS[7], linewidth=0.1))
    axis.plot(*antenna, "o", color=LIMIT_COLOUR, markersize=5, label="antenna")
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.set_xlabel(labels[0])
    axis.set_ylabel(labels[1])
    axis.legend(loc="upper right", fontsize="small")
