"""Sections of keys as mappings: dotted keys as sections, one mapping above another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gbas_core.parameters.messages import ParameterError


def nested(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys as sections; a key without a value gives way to a section of its name.

    Raises
    ------
    ParameterError
        For keys below something that is no section.
    """
    found: dict[str, Any] = {}
    for key, value in mapping.items():
        first, dot, rest = str(key).partition(".")
        inner = nested({rest: value}) if dot else nested(value) if isinstance(value, Mapping) else value
        found[first] = _joined(found.get(first), inner, str(key))
    return found


def _joined(below: Any, above: Any, key: str) -> Any:
    """Two values of one key; sections together."""
    if isinstance(below, dict) and isinstance(above, dict):
        return below | {name: _joined(below.get(name), each, key) for name, each in above.items()}
    if below is not None and above is not None and isinstance(below, dict) != isinstance(above, dict):
        raise ParameterError(f"{key} is given, and a part of it is both a value and a section")
    return above


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Sections of two mappings; where both have a value, that of the second."""
    both = dict(below)
    for key, value in above.items():
        inner = both.get(key)
        both[key] = merged(inner, value) if isinstance(inner, Mapping) and isinstance(value, Mapping) else value
    return both
