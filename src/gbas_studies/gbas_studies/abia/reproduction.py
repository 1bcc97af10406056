"""``gbas reproduce abia``: the paper's tables and figures, but those of the flags."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gbas_studies.abia.airframe_items import airframe_section
from gbas_studies.abia.echo_items import echo_section
from gbas_studies.abia.flight_items import flight_section
from gbas_studies.abia.link_items import link_section
from gbas_studies.abia.loop_items import loop_section
from gbas_studies.abia.recorded_items import recorded_section
from gbas_studies.abia.requirement_items import requirement_section
from gbas_studies.reproduction.items import Claim, Reproduction, Section
from gbas_studies.reproduction.registry import Options

SOURCE: Final = (
    "R. Sabatini, T. Moore, C. Hill, A Novel GNSS Integrity Augmentation System for Civil and Military Aircraft, "
    "International Journal of Mechanical, Industrial and Aerospace Sciences 7 (12), 2013."
)
_ABOUT: Final = (
    "Equations are recomputed with their misprints corrected, each named. The aircraft's model, the flight, its place "
    "and date are not published: figures of them are counterparts with a mesh of Table I's dimensions, a simulated "
    "flight and nominal constellations. Figures 1 to 6, 13, 15, 16 and 20 are drawings."
)


def reproduce(options: Options) -> Reproduction:
    """The study; recordings are for what the paper has not measured."""
    steps: dict[str, Callable[[], Section]] = {
        "link budget": link_section,
        "tracking loops": loop_section,
        "airframe": airframe_section,
        "multipath": lambda: echo_section(options),
        "requirements": requirement_section,
        "flight": flight_section,
        "recorded": lambda: recorded_section(options),
        "flags": flag_section,
    }
    return Reproduction(
        study="abia",
        title="Avionics based integrity augmentation",
        source=SOURCE,
        about=_ABOUT,
        sections=options.made(steps),
    )


def flag_section() -> Section:
    """What of the tables of flags can never be reproduced."""
    return Section(
        title="Integrity flags: Tables IV and V",
        items=[
            Claim(
                name="Table IV, satellites in view and exact times of the flags",
                holds=None,
                paper_text="16 satellites, cautions and warnings by the second",
                ours_text="–",
                definition="–",
                why="Not reproducible: those 16 are never in view together; date and place are not given.",
            )
        ],
    )
