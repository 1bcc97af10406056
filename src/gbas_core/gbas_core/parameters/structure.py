"""The types of a set: keys and fields, sections within sections, and which class or type is at a place."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

from pydantic import Tag

from gbas_core.parameters.declaration import Derived, Parameter

ANGLES: Final = (("_rad", "_deg"), ("_radps", "_degps"))


def file_key(name: str) -> str:
    """Key of a field in a file."""
    for own, in_files in ANGLES:
        if name.endswith(own):
            return name.removesuffix(own) + in_files
    return name


hints_of: Callable[[Any], dict[str, Any]] = functools.cache(partial(typing.get_type_hints, include_extras=True))


def parameter_of(hint: Any) -> Parameter | None:
    """What is said of a field, by its annotated type."""
    found = [each for each in getattr(hint, "__metadata__", ()) if isinstance(each, Parameter)]
    return found[0] if found else None


def default_of(item: dataclasses.Field[Any]) -> Any:
    """Default of a field; ``dataclasses.MISSING`` where there is none."""
    return item.default_factory() if item.default_factory is not dataclasses.MISSING else item.default


def keys_of(section: Any) -> list[str]:
    """Keys of a section in a file."""
    derived = {name for name, hint in hints_of(section).items() if isinstance(parameter_of(hint), Derived)}
    return [file_key(each.name) for each in dataclasses.fields(section) if each.name not in derived]


def field_of(key: str) -> str:
    """Field name of a key."""
    for own, in_files in ANGLES:
        if key.endswith(in_files):
            return key.removesuffix(in_files) + own
    return key


def place_of(kind: Any, loc: tuple[int | str, ...]) -> tuple[list[str], Any]:
    """Keys of a file on the way to a place of pydantic's, and the class or type that is there."""
    keys: list[str] = []
    for each in loc:
        kind = bare_type(kind)
        if dataclasses.is_dataclass(kind):
            keys.append(file_key(str(each)))
            kind = hints_of(kind).get(field_of(str(each)))
        elif typing.get_origin(kind) is dict:
            keys.append(str(each))
            kind = typing.get_args(kind)[1]
        elif isinstance(each, int):  # in a list; sections have numbers, values have none
            kind = (typing.get_args(kind) or (None,))[0]
            if any(dataclasses.is_dataclass(inner) for inner in classes_in(kind)):
                keys.append(str(each + 1))
        else:  # which of the kinds of a section it is
            kind = _told(kind, str(each))
    return keys, bare_type(kind)


def is_in_collection(kind: Any, loc: tuple[int | str, ...]) -> bool:
    """Whether a place of pydantic's is within a section that has a name or a number among others."""
    above = (place_of(kind, loc[:length])[1] for length in range(len(loc)))
    return any(typing.get_origin(each) in (dict, tuple) for each in above)


def bare_type(hint: Any) -> Any:
    """A type without its annotations and without None."""
    if hasattr(hint, "__metadata__"):
        return bare_type(hint.__origin__)
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        others = [each for each in typing.get_args(hint) if each is not type(None)]
        return bare_type(others[0]) if len(others) == 1 else hint
    return hint


def _told(union: Any, tag: str) -> Any:
    """The member of a union that a tag stands for: given by a ``pydantic.Tag``, by a literal field, or by its name."""
    for member in typing.get_args(union):
        if any(isinstance(each, Tag) and each.tag == tag for each in getattr(member, "__metadata__", ())):
            return member
    return next((member for member in classes_in(union) if tag in _tags(member)), union)


def _tags(kind: Any) -> set[str]:
    """What may tell that a section is of a class: the values of its literal fields, or its name."""
    found = {kind.__name__}
    for hint in hints_of(kind).values() if dataclasses.is_dataclass(kind) else ():
        if typing.get_origin(bare_type(hint)) is typing.Literal:
            found |= set(typing.get_args(bare_type(hint)))
    return found


def classes_in(hint: Any) -> Iterator[Any]:
    """Every class in a type, those of its arguments included."""
    if isinstance(hint, type):
        yield hint
    for each in typing.get_args(hint):
        yield from classes_in(each)
