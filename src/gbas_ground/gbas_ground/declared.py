"""Parameters as fields of frozen dataclasses: each says once where it stands in a file, its unit, meaning and bounds.

The same declaration serves files, the nodes' parameters and the documentation. A dataclass of parameters derives from
:class:`Declared`, which checks every value when it is made; one may have others as fields (:func:`nested`), so that a
monitor declares its own parameters beside its own code.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Final

from gbas_core.parameters import ParameterError, field_types

REQUIRED: Final = object()
"""Default of a parameter that has none."""
_KEY: Final = "gbas_parameter"
_NESTED: Final = "gbas_nested"


@dataclass(frozen=True, kw_only=True)
class ParameterSpec:
    """How one parameter stands in a file, and its bounds in the file's unit."""

    section: str
    name: str
    unit: str
    doc: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[Any, ...] = ()
    per_unit: float = 1.0

    @property
    def key(self) -> str:
        """Dotted name in a configuration file."""
        return f"{self.section}.{self.name}"


def parameter(section: str, name: str, default: Any, unit: str, doc: str, **limits: Any) -> Any:
    """Declare a parameter; its default is in the file's unit."""
    spec = ParameterSpec(section=section, name=name, unit=unit, doc=doc, **limits)
    if default is REQUIRED:
        return field(metadata={_KEY: spec})
    own = default * spec.per_unit if spec.per_unit != 1.0 and not isinstance(default, tuple) else default
    return field(default=own, metadata={_KEY: spec})


def nested(parameters: Declared) -> Any:
    """Declare a field that holds parameters of its own, with these defaults."""
    return field(default=parameters, metadata={_NESTED: type(parameters)})


class Declared:
    """Base of the dataclasses: refuses values out of their bounds.

    Raises
    ------
    ParameterError
        Naming the parameter as it stands in a file, its value and its bound.
    """

    def __post_init__(self) -> None:
        kinds = _kinds(type(self))
        for name, spec in own_specs(type(self)):
            _check(spec, kinds[name], getattr(self, name))

    def shown(self) -> Iterator[tuple[ParameterSpec, Any]]:
        """Every parameter with its value in the file's unit."""
        for name, spec in own_specs(type(self)):
            yield spec, _in_file_units(spec, getattr(self, name))
        for name in _nested_types(type(self)):
            yield from getattr(self, name).shown()


def _kinds(declared: type[Any]) -> dict[str, Any]:
    return field_types(declared)


def own_specs(declared: type[Any]) -> tuple[tuple[str, ParameterSpec], ...]:
    """Field name and specification of the parameters a dataclass declares itself."""
    return tuple((item.name, item.metadata[_KEY]) for item in fields(declared) if _KEY in item.metadata)


def _nested_types(declared: type[Any]) -> dict[str, type[Any]]:
    return {item.name: item.metadata[_NESTED] for item in fields(declared) if _NESTED in item.metadata}


def all_specs(declared: type[Any]) -> tuple[ParameterSpec, ...]:
    """Specifications of all parameters, those of nested fields last."""
    own = tuple(spec for _, spec in own_specs(declared))
    return own + tuple(spec for each in _nested_types(declared).values() for spec in all_specs(each))


def arguments_from(declared: type[Any], flat: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of a dataclass of parameters; what is used is taken out of `flat`.

    Parameters
    ----------
    declared : type
    flat : dict
        Dotted keys and values in the files' units.
    given : mapping
        Arguments that are known already.

    Raises
    ------
    ParameterError
        For a required parameter that is missing.
    """
    arguments = dict(given)
    defaults = {item.name: item.default for item in fields(declared)}
    for name, spec in own_specs(declared):
        if name in arguments:
            continue
        if spec.key in flat:
            arguments[name] = _from_file(spec, flat.pop(spec.key))
        elif defaults[name] is MISSING:
            raise ParameterError(f"{spec.key} is missing ({spec.doc})")
    for name, kind in _nested_types(declared).items():
        arguments[name] = kind(**arguments_from(kind, flat, {}))
    return arguments


def flatten(mapping: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Sections of keys as dotted keys; what is flat already stays."""
    flat: dict[str, Any] = {}
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            flat.update(flatten(value, f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def listed(value: Any) -> Any:
    """A list of a file or of a ROS parameter as a tuple; anything else as it is."""
    return tuple(value) if hasattr(value, "__iter__") and not isinstance(value, str | bytes) else value


def _from_file(spec: ParameterSpec, value: Any) -> Any:
    """A file's value in the field's unit; what is not a number is left for the check to refuse."""
    value = listed(value)
    if isinstance(value, tuple):
        return tuple(_from_file(spec, each) for each in value)
    if spec.per_unit != 1.0 and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value) * spec.per_unit
    return value


def _in_file_units(spec: ParameterSpec, value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_in_file_units(spec, each) for each in value)
    return value / spec.per_unit if spec.per_unit != 1.0 else value


def _check(spec: ParameterSpec, kind: Any, value: Any) -> None:
    """Refuse a value of the wrong kind or out of its bounds; the message speaks in the file's unit."""
    if spec.choices:
        if isinstance(value, bool) or value not in spec.choices:
            raise ParameterError(f"{spec.key} = {value!r} is not one of {_shortened(spec.choices)}")
    elif kind is bool:
        if not isinstance(value, bool):
            raise ParameterError(f"{spec.key} = {value!r} is not true or false")
    elif spec.low > -math.inf:
        for each in value if isinstance(value, tuple) else (value,):
            _check_number(spec, kind, each)


def _check_number(spec: ParameterSpec, kind: Any, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ParameterError(f"{spec.key} = {value!r} is not a number")
    if kind is int and not isinstance(value, int):
        raise ParameterError(f"{spec.key} = {value!r} is not a whole number")
    tolerance = 1e-12 * max(abs(spec.low), abs(spec.high))  # of the degrees' conversion
    shown = value / spec.per_unit
    if not spec.low - tolerance <= shown <= spec.high + tolerance:
        raise ParameterError(f"{spec.key} = {shown:g} is not within {spec.low:g} to {spec.high:g} {spec.unit}")


def _shortened(choices: tuple[Any, ...]) -> str:
    if len(choices) > 10:
        return f"{choices[0]} to {choices[-2]}, {choices[-1]}"
    return ", ".join(repr(choice) for choice in choices)
