"""Records from the keys of a configuration file: names, kinds and angles.

A record is a frozen dataclass; its fields are the keys of its section. Fields in radians are degrees in files: a field
``direction_rad`` is the key ``direction_deg``. Bounds are checked by the record itself.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Literal, TypeVar

R = TypeVar("R")


def record_from_keys(kind: type[R], section: Mapping[str, Any], path: str, **given: Any) -> R:
    """A record of a section.

    Parameters
    ----------
    kind : type
        Frozen dataclass whose fields are numbers, texts, flags, and tuples of these.
    section : mapping
        Keys; those of records within records are dotted.
    path : str
        Of the section, with a dot at its end, for messages.
    given
        Fields that are no keys.

    Raises
    ------
    ValueError
        Naming the key that is unknown, missing or of the wrong kind, or what the record itself refuses.
    """
    hints = typing.get_type_hints(kind)
    names = {in_files(item.name): item.name for item in fields(kind) if item.name not in given}  # type: ignore[arg-type]
    values, inner = dict(given), _inner(section, hints)
    for name, keys in inner.items():
        values[name] = record_from_keys(hints[name], keys, f"{path}{name}.")
    for key, value in section.items():
        if key.partition(".")[0] in inner:
            continue
        if key not in names:
            raise ValueError(f"{path}{key} is unknown; known are {', '.join(sorted(names))}")
        values[names[key]] = _converted(f"{path}{key}", value, hints[names[key]], degrees=key != names[key])
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path.removesuffix('.')}: {_plain(error)}") from None


def _inner(section: Mapping[str, Any], hints: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Keys of records within the record, by the field they are in."""
    found: dict[str, dict[str, Any]] = {}
    for key, value in section.items():
        first, dot, rest = key.partition(".")
        if dot and is_dataclass(hints.get(first)):
            found.setdefault(first, {})[rest] = value
    return found


def keys_of(record: Any, prefix: str, *, leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Keys and values of a record in the units of files; fields that are None or records are left out."""
    found = {}
    for item in fields(record):
        value = getattr(record, item.name)
        key = in_files(item.name)
        if item.name in leave_out or not isinstance(value, bool | int | float | str | tuple):
            continue
        if isinstance(value, tuple) and not all(isinstance(each, bool | int | float | str) for each in value):
            continue
        found[f"{prefix}{key}"] = _degrees(value) if key != item.name else value
    return found


def in_files(name: str) -> str:
    """A field's name in files."""
    for ending, in_degrees in (("_rad", "_deg"), ("_radps", "_degps")):
        if name.endswith(ending):
            return name.removesuffix(ending) + in_degrees
    return name


def _degrees(value: Any) -> Any:
    return tuple(math.degrees(each) for each in value) if isinstance(value, tuple) else math.degrees(value)


def _converted(path: str, value: Any, kind: Any, *, degrees: bool) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        (kind,) = [each for each in arguments if each is not type(None)]
        return _converted(path, value, kind, degrees=degrees)
    if origin is tuple:
        return _tuple(path, value, arguments, degrees=degrees)
    if origin is Literal:
        kind = str
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise ValueError(f"{path} = {value!r} is not a {getattr(kind, '__name__', kind)}")
    return math.radians(value) if degrees else value


def _tuple(path: str, value: Any, arguments: tuple[Any, ...], *, degrees: bool) -> tuple[Any, ...]:
    if value in ([""], ("",)):  # how ROS writes an empty list
        value = ()
    if not isinstance(value, list | tuple):
        raise ValueError(f"{path} = {value!r} is not a list")
    if arguments[-1] is Ellipsis:
        return tuple(_converted(path, each, arguments[0], degrees=degrees) for each in value)
    if len(value) != len(arguments):
        raise ValueError(f"{path} = {value!r} has not {len(arguments)} values")
    return tuple(_converted(path, each, kind, degrees=degrees) for each, kind in zip(value, arguments, strict=True))


def _plain(error: Exception) -> str:
    """A missing argument as a missing key."""
    text = str(error)
    return f"{in_files(text.split(chr(39))[1])} is missing" if "required keyword-only" in text else text
