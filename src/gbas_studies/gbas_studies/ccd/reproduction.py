"""``gbas reproduce ccd``: every table and figure of the paper."""

from __future__ import annotations

from gbas_studies.ccd import tables
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
        tables.thresholds(), tables.algebra(), tables.table_3(), tables.table_4(), tables.critical_mappings(),
        tables.table_5(), tables.table_6(),
    ]  # fmt: skip
    return Reproduction(
        study="ccd",
        title="Code-carrier divergence monitoring for GAST D and GAST F",
        source=SOURCE,
        about="",
        sections=sections,
    )
