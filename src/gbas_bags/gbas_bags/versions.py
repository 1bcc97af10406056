"""Tables that an older version of the suite wrote: which they are, and what can be done with such a bag."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from gbas_bags import epochs
from gbas_msgs_py.tables import SCHEMAS

REMEDY: Final = "its observations and ephemerides are read: gbas replay makes the rest anew"


def table_identifier(data: bytes) -> str:
    """Schema and version of a table's message, ``gbas/<name>/<version>``; empty when it has no such label.

    Raises
    ------
    PayloadError
        When the bytes are no array's.
    """
    labels = [label for label, _ in epochs.dimensions(data)[0] if label.startswith("gbas/")]
    return labels[0].partition(":")[0] if labels else ""


def version_read(identifier: str) -> str | None:
    """The version this suite reads in place of an older one; None for a table that is not an older version's."""
    parts = identifier.split("/")
    schema = SCHEMAS.get(parts[1]) if len(parts) == 3 else None
    if schema is None or not parts[2].isdigit() or int(parts[2]) >= schema.version:
        return None
    return schema.identifier


def older_tables(identifiers: Iterable[str]) -> dict[str, str]:
    """Of schemas found in a bag those of an older version, each with the one this suite reads."""
    found = {identifier: version_read(identifier) for identifier in identifiers}
    return {identifier: read for identifier, read in sorted(found.items()) if read is not None}


def older_text(older: Mapping[str, str]) -> str:
    """What a person is told of a bag with older tables."""
    names = {found.removeprefix("gbas/"): read.rpartition("/")[2] for found, read in older.items()}
    tables = ", ".join(f"{name} (read: {version})" for name, version in names.items())
    inputs = all(name not in found for found in older for name in ("/observations/", "/ephemeris/"))
    return f"older versions of {tables}" + (f"; {REMEDY}" if inputs else "")
