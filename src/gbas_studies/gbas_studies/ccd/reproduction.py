"""``gbas reproduce ccd``: every table and figure of the paper."""

from __future__ import annotations

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
from gbas_studies.reproduction.items import Reproduction
from gbas_studies.reproduction.registry import Options

SOURCE = (
    "Y. Jiang, C. Milner, C. Macabiau, Code-Carrier Divergence Monitoring for GAST-F GBAS, European Navigation "
    "Conference, Bordeaux 2015 (hal-01294478)"
)


def reproduce(options: Options) -> Reproduction:
    """Recompute the paper."""
    options.progress("tables")
    sections = [
        tables.thresholds(),
        structure.algebra(),
        *empirical.sections(options),
        figures.figure_5_and_6(),
        tables.table_3(),
        tables.table_4(),
        figures.figure_7_and_8(),
        figures.figure_9_and_10(),
        tables.critical_mappings(),
        tables.table_5(),
        tables.table_6(),
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
        "at "
        "the end and in the rows of finer grids.",
        sections=sections,
    )
