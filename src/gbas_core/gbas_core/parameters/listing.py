"""Every parameter of a set or of a class of them, with its value or default."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from gbas_core.parameters.declaration import Derived, Parameter
from gbas_core.parameters.structure import bare_type, classes_in, default_of, file_key, hints_of, parameter_of


@dataclasses.dataclass(frozen=True)
class Declared:
    """One parameter of a set.

    Attributes
    ----------
    key : str
        Dotted key in a file.
    parameter : Parameter
    kind : type
        Of its value, without its declaration.
    value
        Value, or default when a class was asked for, in the file's unit; ``dataclasses.MISSING`` where there is none.
    """

    key: str
    parameter: Parameter
    kind: Any
    value: Any


def declared(params: Any, prefix: str = "") -> Iterator[Declared]:
    """Every parameter of a set (with its value) or of a class of them (with its default), those of sections included.

    Fields without a :class:`Parameter` that are no sections, and sections that are None, are left out. Of a class
    sections are shown with what they may hold: every kind, ``NAME`` for names, ``1`` for sections in order.
    """
    kind = params if isinstance(params, type) else type(params)
    for item in dataclasses.fields(params):
        hint = hints_of(kind)[item.name]
        key = f"{prefix}{file_key(item.name)}"
        value = default_of(item) if params is kind else getattr(params, item.name)
        parameter = parameter_of(hint)
        if isinstance(parameter, Derived):
            continue
        if parameter is not None:
            shown = value if value is dataclasses.MISSING else parameter.in_file_units(value)
            yield Declared(key=key, parameter=parameter, kind=hint.__origin__, value=shown)
        elif dataclasses.is_dataclass(value):
            yield from declared(value, f"{key}.")
        elif params is kind:
            yield from _of_classes(hint, key)
        elif isinstance(value, Mapping | tuple):
            named = value.items() if isinstance(value, Mapping) else enumerate(value, 1)
            for name, each in named:
                if dataclasses.is_dataclass(each):
                    yield from declared(each, f"{key}.{name}.")


def _of_classes(hint: Any, key: str) -> Iterator[Declared]:
    """Parameters of the sections that a field may hold."""
    outer = typing.get_origin(bare_type(hint))
    inner = ".NAME" if outer is dict else ".1" if outer is tuple else ""
    for each in classes_in(hint):
        if dataclasses.is_dataclass(each):
            yield from declared(each, f"{key}{inner}.")
