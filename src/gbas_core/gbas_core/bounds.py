"""Bounds of parameters: one clear error that names the owner, the key, its value and the bound."""

from __future__ import annotations

from collections.abc import Collection, Mapping


def within(owner: str, key: str, value: float, low: float, high: float) -> None:
    """Refuse a value outside `low` to `high`; NaN is outside.

    Raises
    ------
    ValueError
        Naming `owner`, `key`, `value` and the bound.
    """
    if not low <= value <= high:
        raise ValueError(f"{owner}: {key} = {value!r} is not within {low:g} to {high:g}")


def all_within(owner: str, record: object, bounds: Mapping[str, tuple[float, float]]) -> None:
    """Refuse attributes of a record outside their bounds; each value of a tuple is looked at.

    Raises
    ------
    ValueError
        As :func:`within`.
    """
    for key, (low, high) in bounds.items():
        value = getattr(record, key)
        if isinstance(value, tuple):
            if not all(low <= each <= high for each in value):
                raise ValueError(f"{owner}: {key} = {value!r} is not within {low:g} to {high:g}")
        else:
            within(owner, key, value, low, high)


def one_of(owner: str, key: str, value: str, known: Collection[str]) -> None:
    """Refuse a word that is not known.

    Raises
    ------
    ValueError
        Naming `owner`, `key`, `value` and what is known.
    """
    if value not in known:
        raise ValueError(f"{owner}: {key} = {value!r} is not one of {', '.join(known)}")
