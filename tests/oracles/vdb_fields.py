"""Records and their bits made from tests/tables/vdb_fields.yaml: the second formulation of the message tables."""

from __future__ import annotations

import math
import string
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

from vdb_oracle import field_bits

TABLES: dict[str, list[dict[str, Any]]] = yaml.safe_load(
    (Path(__file__).parents[1] / "tables" / "vdb_fields.yaml").read_text()
)
SPECIAL = {"nan": math.nan, "none": None, "inf": math.inf}
ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 "


def lsb_of(entry: dict[str, Any]) -> float:
    """Value of one count in the units of the published table (degrees for angles)."""
    return entry["arcsec"] / 3600.0 if "arcsec" in entry else entry.get("lsb", 1)


def raw_bounds(entry: dict[str, Any]) -> tuple[int, int]:
    """Raw counts of the published bounds."""
    offset = entry.get("offset", 0)
    return round((entry["low"] - offset) / lsb_of(entry)), round((entry["high"] - offset) / lsb_of(entry))


def value_of(entry: dict[str, Any], raw: int) -> Any:
    """Attribute value of a raw count, special codes included (raw as unsigned for those)."""
    codes = entry.get("codes", {})
    if raw & ((1 << entry["bits"]) - 1) in codes:
        return SPECIAL[codes[raw & ((1 << entry["bits"]) - 1)]]
    if entry.get("integer"):
        return raw
    value = entry.get("offset", 0) + raw * lsb_of(entry)
    return math.radians(value) if entry.get("deg") else float(value)


def text_bits(text: str, characters: int, bits_per_character: int) -> str:
    """Rightmost character first, each by its six lowest IA-5 bits, least significant first."""
    padded = text.ljust(characters)
    return "".join(field_bits(ord(character) & 0x3F, bits_per_character) for character in reversed(padded))


def drawn_raw(draw: Callable[[Any], Any], entry: dict[str, Any]) -> int:
    """A raw count: often an extreme or a special code."""
    low, high = raw_bounds(entry)
    special = list(entry.get("codes", {}))
    return draw(st.one_of(st.integers(low, high), st.sampled_from([low, high, *special])))


def drawn_record(
    draw: Callable[[Any], Any],
    name: str,
    records: dict[str, Callable[..., Any]],
    *,
    counts: dict[str, int] | None = None,
) -> tuple[Any, str]:
    """A record of a layout, and its bits on the air as text.

    `counts` fixes how many items a group has.
    """
    values: dict[str, Any] = {}
    items: dict[str, list[tuple[Any, str]]] = {}
    in_feet: dict[str, tuple[str, float]] = {}
    bits = ""
    for entry in TABLES[name]:
        if "count" in entry:
            group = next(other for other in TABLES[name] if other.get("group") == entry["count"])
            fixed = (counts or {}).get(entry["count"])
            count = draw(st.integers(0, entry["high"])) if fixed is None else fixed
            items[entry["count"]] = [drawn_record(draw, group["layout"], records) for _ in range(count)]
            bits += field_bits(count, entry["bits"])
        elif "group" in entry:
            values[entry["group"]] = tuple(record for record, _ in items[entry["group"]])
            bits += "".join(text for _, text in items[entry["group"]])
        elif "spare" in entry:
            bits += "0" * entry["bits"]
        elif "text" in entry:
            text = draw(st.text(ALPHABET, max_size=4)).rstrip()
            values[entry["name"]] = text
            bits += text_bits(text, 4, entry["text"])
        elif "letters" in entry:
            letter = draw(st.sampled_from(["", *entry["letters"]]))
            values[entry["name"]] = letter
            bits += field_bits(f" {string.ascii_uppercase}".index(letter or " "), entry["bits"])
        elif "values" in entry:
            raw = draw(st.integers(0, len(entry["values"]) - 1))
            values[entry["name"]] = entry["values"][raw]
            bits += field_bits(raw, entry["bits"])
        elif "length" in entry:
            raws = [drawn_raw(draw, entry) for _ in range(entry["length"])]
            values[entry["name"]] = tuple(value_of(entry, raw) for raw in raws)
            bits += "".join(field_bits(raw, entry["bits"]) for raw in raws)
        elif "needs" in entry and not items[entry["needs"]]:
            values[entry["name"]] = None if entry.get("integer") else math.nan
            bits += "0" * entry["bits"]
        else:
            raw = drawn_raw(draw, entry)
            values[entry["name"]] = value_of(entry, raw)
            bits += field_bits(raw, entry["bits"])
            in_feet |= {entry["feet_if"]: (entry["name"], raw * entry["feet_lsb"])} if "feet_if" in entry else {}
    for condition, (field, value) in in_feet.items():
        values[field] = value if values[condition] else values[field]
    bits = _blanked(TABLES[name], values, bits)
    return records[name](**values), bits


def _blanked(table: list[dict[str, Any]], values: dict[str, Any], bits: str) -> str:
    """Corrections marked invalid have no value, and zero bits."""
    for entry in table:
        value = values.get(entry.get("name", ""))
        if "blanks" in entry and value is not None and value != value:
            for blank in entry["blanks"]:
                values[blank] = math.nan
                start = 0
                for other in table:
                    if other.get("name") == blank:
                        bits = bits[:start] + "0" * other["bits"] + bits[start + other["bits"] :]
                        break
                    start += other["bits"] * other.get("length", 1)
    return bits


def same(a: Any, b: Any, tolerance: float = 1e-9) -> bool:
    """Whether two records are equal; missing equals missing, floats to a billionth (a count is never that small)."""
    if a is None or b is None or isinstance(a, (str, bool, bytes)):
        return type(a) is type(b) and a == b
    if isinstance(a, Sequence):
        return len(a) == len(b) and all(same(x, y, tolerance) for x, y in zip(a, b, strict=True))
    if isinstance(a, int) and isinstance(b, int):
        return a == b
    if isinstance(a, (int, float)):
        return (a != a and b != b) or a == b or math.isclose(a, b, rel_tol=tolerance, abs_tol=1e-12)
    return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in a.__slots__)
