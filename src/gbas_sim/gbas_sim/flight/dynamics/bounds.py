"""Bounds of parameters: one way to say that a value is not what it may be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

Bounds = Mapping[str, tuple[float, float]]


def check_bounds(subject: str, owner: Any, bounds: Bounds) -> None:
    """Check attributes of a parameter set; those that are None are left out.

    Raises
    ------
    ValueError
        Naming the subject, the attribute, its value and its bounds. NaN is never within bounds.
    """
    for key, (low, high) in bounds.items():
        value = getattr(owner, key)
        if value is not None and not low <= value <= high:
            raise ValueError(f"{subject}: {key} = {shown(key, value)} is not within {low:g} to {high:g}")


def check_one_of(subject: str, owner: Any, *keys: str) -> None:
    """Check that exactly one of some attributes is given.

    Raises
    ------
    ValueError
        Naming them.
    """
    given = [key for key in keys if getattr(owner, key) is not None]
    if len(given) != 1:
        problem = f"{given[0]} and {given[1]} are" if given else "neither is"
        raise ValueError(f"{subject}: {problem} given, exactly one of {' and '.join(keys)} must be")


def shown(key: str, value: float) -> str:
    """A value as messages show it: angles in degrees too."""
    if key.endswith(("_rad", "_radps")):
        return f"{value:g} ({math.degrees(value):g} deg{'/s' if key.endswith('ps') else ''})"
    return f"{value!r}"
