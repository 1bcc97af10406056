"""The contract as a page to read: ``python -m gbas_msgs_py.document > docs/contract.md`` makes it anew.

It is made of the dictionary that nodes publish and bags carry, and nothing else: a product, mode, monitor or column
that is added to its table stands here too.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from typing import Any

from gbas_msgs_py.tables import schema_dictionary

_OPTIONAL = "; optional"
_HEAD = """# The contract: tables, codes, products, modes and monitors

Made by `python -m gbas_msgs_py.document`; the same stands as JSON on `/gbas/schemas` and in the metadata of every bag.
Numbers are never given a second meaning. NaN is missing everywhere. A table has its optional columns where
one of them has a value."""


def contract_text() -> str:
    """The page, Markdown."""
    contract = json.loads(schema_dictionary())
    return (
        "\n".join(
            [
                _HEAD,
                *_products(contract),
                *_modes(contract),
                *_monitors(contract),
                *_codes(contract),
                *_tables(contract),
            ]
        )
        + "\n"
    )


def _table(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    names = list(head)
    yield f"| {' | '.join(names)} |"
    yield f"|{'---|' * len(names)}"
    for row in rows:
        yield f"| {' | '.join(str(cell) for cell in row)} |"


def _products(contract: dict[str, Any]) -> Iterator[str]:
    yield "\n## Products: the corrections\n"
    yield from _table(
        ("product", "signal", "smoothing", "VDB message type", "meaning"),
        (
            (f"`{each['name']}`", each["signal"], f"{each['smoothing_s']:g} s", each["message_type"], each["doc"])
            for each in contract["products"]
        ),
    )


def _modes(contract: dict[str, Any]) -> Iterator[str]:
    yield "\n## Modes: what an aircraft makes of them\n"
    yield from _table(
        (
            "number", "mode", "signal", "smoothing", "products", "systems", "service", "sigmas of levels",
            "sigma_iono", "falls back to", "monitors", "meaning",
        ),
        (
            (
                each["number"],
                f"`{each['name']}`",
                each["signal"],
                f"{each['smoothing_s']:g} s",
                _words(each["products"]),
                each["systems"],
                each["service"],
                _words(each["levels"] or each["products"]),
                f"{each['levels_smoothing_s'] or each['smoothing_s']:g} s, x {each['iono_factor']:.4g}",
                _words([each["fallback"]] if each["fallback"] else []),
                _words(each["monitors"]),
                each["doc"],
            )
            for each in contract["modes"]
        ),
    )  # fmt: skip
    yield "\n## Monitors of the aircraft\n"
    named = contract["airborne_monitors"].items()
    yield from _table(("monitor", "looks at"), ((f"`{name}`", doc) for name, doc in named))


def _words(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _monitors(contract: dict[str, Any]) -> Iterator[str]:
    yield "\n## Monitors of the ground station\n"
    yield from _table(
        ("monitor", "test", "numbers", "judges", "cause", "unit", "statistic"),
        (
            (
                f"`{monitor['name']}`",
                f"`{test['name']}`",
                f"{monitor['number']}, {test['number']}",
                ", ".join(monitor["judges"]),
                f"`{test['cause']}`",
                test["unit"],
                test["doc"],
            )
            for monitor in contract["monitors"]
            for test in monitor["tests"]
        ),
    )


def _codes(contract: dict[str, Any]) -> Iterator[str]:
    for name, members in contract["enumerations"].items():
        yield f"\n## {name}\n"
        yield from _table(
            ("value", "word", "meaning"), ((each["value"], f"`{each['name']}`", each["doc"]) for each in members)
        )


def _tables(contract: dict[str, Any]) -> Iterator[str]:
    for schema in contract["schemas"]:
        yield f"\n## {schema['schema']}\n\n{schema['doc']}\n"
        yield from _table(
            ("column", "unit", "meaning"),
            (
                (f"`{column['name']}`", column["unit"], column["doc"] + (_OPTIONAL if column.get("optional") else ""))
                for column in schema["columns"]
            ),
        )


if __name__ == "__main__":
    sys.stdout.write(contract_text())
