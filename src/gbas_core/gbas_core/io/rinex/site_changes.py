"""What happens to a receiver in the middle of an observation file: a new site, an antenna that moves or is another one.

Source: RINEX 2.11 table A2, 3.05 tables A3 and A4: event flags 2 (start moving antenna), 3 (new site occupation) and 4
(header information follows).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

_MOVING: Final = 2
_NEW_SITE: Final = 3
_HEADER: Final = 4
_OBSERVED_FLAGS: Final = (0, 1)
_LABEL_COLUMN: Final = 60
_SITE_LABELS: Final = ("MARKER NAME", "MARKER NUMBER", "APPROX POSITION XYZ", "ANTENNA: DELTA H/E/N", "ANT # / TYPE")


class SiteChange(NamedTuple):
    """A change of the site or antenna.

    Attributes
    ----------
    after : int
        Place among the parser's epochs of the event.
    what : str
        What the file says, for a note.
    """

    after: int
    what: str


def site_changes(header: Any, epochs: Sequence[Any]) -> Iterator[SiteChange]:
    """Events of a file that change its site or antenna; header lines that say again what was said before do not.

    Parameters
    ----------
    header, epochs
        Of the parser, the latter with their event records.
    """
    known = _of_header(header)
    for place, item in enumerate(epochs):
        if item.flag in _OBSERVED_FLAGS or item.flag > _HEADER:
            continue
        told = [item for item in map(_label_and_value, item.special_records) if item[0] in _SITE_LABELS]
        changed = [f"{label} {value}" for label, value in told if known.get(label) != _comparable(label, value)]
        known |= {label: _comparable(label, value) for label, value in told}
        head = {_MOVING: ["the antenna begins to move"], _NEW_SITE: ["a new site"], _HEADER: []}[item.flag]
        if head or changed:
            yield SiteChange(after=place, what=", ".join([*head, *changed]))


def _label_and_value(record: str) -> tuple[str, str]:
    return record[_LABEL_COLUMN:].strip(), " ".join(record[:_LABEL_COLUMN].split())


def _comparable(label: str, value: str) -> Any:
    """A value that does not depend on how numbers are written."""
    try:
        return tuple(float(part) for part in value.split()) if "XYZ" in label or "DELTA" in label else value
    except ValueError:
        return value


def _of_header(header: Any) -> dict[str, Any]:
    """The same of the file's header; what it does not have is missing."""
    values = {
        "MARKER NAME": header.marker_name,
        "MARKER NUMBER": header.marker_number,
        "APPROX POSITION XYZ": header.approx_position_m,
        "ANTENNA: DELTA H/E/N": header.antenna_delta_hen_m,
        "ANT # / TYPE": " ".join(f"{header.antenna_number or ''} {header.antenna_type or ''}".split()),
    }
    return {
        label: tuple(map(float, value)) if not isinstance(value, str) else " ".join(value.split())
        for label, value in values.items()
        if value is not None
    }
