"""``gbas reproduce ccd``: every table and figure of the paper."""

from __future__ import annotations

from collections.abc import Sequence

from gbas_studies.ccd import (
    availability,
    beyond,
    compliance_items,
    empirical,
    figures,
    station_items,
    structure,
    tables,
)
from gbas_studies.reproduction.items import Reproduction, Section, Value, Verdict
from gbas_studies.reproduction.registry import Options

SOURCE = (
    "Y. Jiang, C. Milner, C. Macabiau, Code-Carrier Divergence Monitoring for GAST-F GBAS, European Navigation "
    "Conference, Bordeaux 2015 (hal-01294478)"
)


def reproduce(options: Options) -> Reproduction:
    """Recompute the paper."""
    options.progress("tables")
    results = (tables.table_3(), tables.table_4(), tables.table_5(), tables.table_6())
    sections = [
        tables.thresholds(),
        structure.algebra(),
        *empirical.sections(options),
        figures.figure_5_and_6(),
        *results[:2],
        figures.figure_7_and_8(),
        figures.figure_9_and_10(),
        tables.critical_mappings(),
        *results[2:],
        compliance_items.section(),
        *station_items.sections(),
        availability.section(quick=options.quick),
        beyond.rare_events(options),
        *beyond.simulated(options),
    ]
    return Reproduction(
        study="ccd",
        title="Code-carrier divergence monitoring for GAST D and GAST F",
        source=SOURCE,
        about="All of the paper's tables and figures. Values that follow from definitions are recomputed from these; "
        "recorded figures are made anew from other recordings and from simulation. What the paper leaves out is added "
        f"at the end and in the rows of finer grids. Of the values in its tables 3 to 6, {met(results)} are reproduced "
        "to the printed digits; most of the other ticks are coefficients of its equations.",
        sections=sections,
    )


def met(sections: Sequence[Section]) -> str:
    """How many of the paper's values in some sections are reproduced, as "7 of 18"."""
    given = [item for section in sections for item in section.items if isinstance(item, Value) and item.paper]
    return f"{sum(item.verdict is Verdict.REPRODUCED for item in given)} of {len(given)}"
