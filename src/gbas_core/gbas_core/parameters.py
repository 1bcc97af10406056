"""Node parameters from frozen dataclasses: defaults are read from them, values are checked against their types.

A field is a ``bool``, ``int``, ``float``, ``str``, ``tuple[str, ...]`` or ``tuple[float, ...]``; its bounds are checked
by the dataclass itself (``__post_init__``), which raises :class:`ParameterError`.
"""

from __future__ import annotations

import dataclasses
import difflib
import typing
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeVar

P = TypeVar("P")

_KINDS: Final = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


class ParameterError(ValueError):
    """A parameter that is unknown, of the wrong type, or out of bounds; the text names it, its value and the bound."""


def require(name: str, value: object, condition: bool, expected: str) -> None:
    """Raise ParameterError unless `condition` holds."""
    if not condition:
        raise ParameterError(f"parameter '{name}' is {value!r}, expected {expected}")


def parameters_from(params_type: type[P], values: Mapping[str, Any]) -> P:
    """An instance of `params_type` with `values` over its defaults.

    Raises
    ------
    ParameterError
        For a name that is not a field, or a value of another type (an integer will do for a float), or whatever the
        dataclass itself refuses.
    """
    types = field_types(params_type)
    unknown_parameters(values, types)
    return params_type(**{name: _coerced(name, value, types[name]) for name, value in values.items()})


def field_types(params_type: type[Any]) -> dict[str, Any]:
    """Name and type of each field."""
    hints = typing.get_type_hints(params_type)
    return {item.name: hints[item.name] for item in dataclasses.fields(params_type)}


def unknown_parameters(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise ParameterError for the first name that is not known."""
    known = list(known)
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(sorted(known))}"
            raise ParameterError(f"parameter '{name}' is unknown{hint}")


def _coerced(name: str, value: Any, kind: Any) -> Any:
    if kind is float and type(value) is int:
        return float(value)
    if typing.get_origin(kind) is tuple:
        return _coerced_tuple(name, value, typing.get_args(kind)[0])
    require(name, value, type(value) is kind, _KINDS[kind])
    return value


def _coerced_tuple(name: str, value: Any, kind: Any) -> tuple[Any, ...]:
    # An empty ROS array has no type of its own; [""] is the ROS way to write an empty list of strings.
    if value is None or (kind is str and value in ([""], [b""], ("",))):
        return ()
    iterable = hasattr(value, "__iter__") and not isinstance(value, str | bytes)
    require(name, value, iterable, "a list")
    return tuple(_coerced(name, each, kind) for each in value)
