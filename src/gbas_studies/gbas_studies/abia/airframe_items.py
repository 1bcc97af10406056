"""Aircraft and masking: Table I, figure 7."""

from __future__ import annotations

import math

import numpy as np

from gbas_airborne.abia.airframe.aircraft import FIGHTER_SWEEPS_DEG, fighter
from gbas_airborne.abia.airframe.mask_table import MaskTable, share_unlike_rays
from gbas_core.gnss.attitude import body_azimuth_elevation, rot_euler
from gbas_studies.abia.mask_figure import mask_figure
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value


def airframe_section() -> Section:
    """The paper's fighter and what it hides."""
    aircraft = fighter()
    upper = aircraft.antenna("upper")
    table = MaskTable.of_mesh(aircraft.airframe, upper.place_m)
    return Section(
        title="Aircraft and masking: Table I, figures 4 to 7",
        text="The paper's CATIA model is not published: a mesh of Table I's dimensions stands for it.",
        items=[*_dimension_items(), *_mask_items(table)],
        pictures=[
            Picture(
                name="mask",
                title="Masking of the upper antenna, body frame",
                caption="Fin and canopy are all that rises above the antenna's plane.",
                figure=mask_figure(table, aircraft.airframe, upper.place_m),
            ),
            _envelope_picture(table),
        ],
    )


def _dimension_items() -> list[Value | Claim]:
    items: list[Value | Claim] = []
    for sweep, printed in zip(FIGHTER_SWEEPS_DEG, ("13.91", "8.60"), strict=True):
        size = np.ptp(fighter(sweep).airframe.vertices_m, axis=0)
        items.append(
            Value(
                name=f"Table I, span at {sweep:g}°",
                ours=float(size[1]),
                paper=printed,
                unit="m",
                definition="of the mesh, wings turned about their pivots",
                kind="input",
            )
        )
    length = float(np.ptp(fighter().airframe.vertices_m, axis=0)[0])
    upper, lower = fighter().antennas
    return [
        Value(name="Table I, length", ours=length, paper="16.72", unit="m", definition="of the mesh", kind="input"),
        *items,
        Value(
            name="eq (2), (3): distance of the antennas",
            ours=lower.place_m[2] - upper.place_m[2],
            paper="2.87",
            unit="m",
            definition="2.13 m + 0.74 m, each 5 cm off the skin of the mesh",
            kind="input",
        ),
    ]


def _mask_items(table: MaskTable) -> list[Value | Claim]:
    aircraft = fighter()
    unlike = share_unlike_rays(table, aircraft.airframe, aircraft.antenna("upper").place_m)
    return [
        Value(
            name="hidden by the body",
            ours=100.0 * table.blocked_share(),
            unit="%",
            definition="share of the hemisphere above the antenna's plane",
        ),
        Claim(
            name="table against direct rays",
            holds=unlike <= 0.003,
            paper_text="–",
            ours_text=f"{100.0 * unlike:.3f} % of 65,536 directions differ",
            definition="directions even over the sphere, each with a ray of its own",
            why="More than 0.3 % differ.",
            new=True,
        ),
        Claim(
            name="wings, tail and fuselage obscure satellites in manoeuvres",
            holds=table.blocked_share(math.radians(5.0)) > 0.05,
            paper_text="the airframe masks",
            ours_text=f"it hides {100.0 * table.blocked_share(math.radians(5.0)):.2f} % of what is above 5°",
            definition="share of the sky above 5° in the antenna's frame",
            why="Masking in a turn is the antenna's own horizon, tilted; the body adds fin and canopy.",
        ),
    ]


def _envelope_picture(table: MaskTable) -> Picture:
    """Highest masked elevation over the horizon around the aircraft, by bank, pitch 0; figure 7's counterpart."""
    azimuth = np.radians(np.arange(0.0, 360.0, 2.0))
    elevation = np.radians(np.arange(-5.0, 90.5, 0.5))
    los = np.stack(
        np.broadcast_arrays(
            np.cos(elevation)[:, np.newaxis] * np.sin(azimuth),
            np.cos(elevation)[:, np.newaxis] * np.cos(azimuth),
            np.sin(elevation)[:, np.newaxis],
        )
    ).reshape(3, -1)
    figure = new_figure()
    axis = figure.axes[0]
    data = {"azimuth_from_heading_deg": np.degrees(azimuth)}
    for bank_deg in (0.0, 20.0, 40.0, 60.0):
        directions = body_azimuth_elevation(rot_euler(math.radians(bank_deg), 0.0, 0.0), los)
        masked = table.masked(*directions).reshape(len(elevation), len(azimuth))
        highest = np.where(masked, np.degrees(elevation)[:, np.newaxis], -np.inf).max(axis=0)
        axis.plot(np.degrees(azimuth), highest, label=f"bank {bank_deg:g}°")
        data[f"masked_below_deg_bank_{bank_deg:g}"] = highest
    axis.set_xlabel("azimuth from the heading [deg]")
    axis.set_ylabel("masked up to [deg]")
    axis.set_ylim(-5.0, 90.0)
    axis.legend()
    return Picture(
        name="fig-7",
        title="Figure 7: masking envelope by bank",
        caption="Highest masked elevation above the local horizon, bank to the right, pitch 0, antenna horizon 5°.",
        figure=figure,
        data=data,
    )
