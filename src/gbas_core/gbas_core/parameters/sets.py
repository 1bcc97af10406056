"""Sets of parameters: made of values or of the keys of a file, and as keys again."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar, dataclass_transform

import pydantic.dataclasses
from pydantic import ConfigDict, TypeAdapter, ValidationError

from gbas_core.parameters.listing import declared
from gbas_core.parameters.mappings import nested
from gbas_core.parameters.messages import ParameterError, explained
from gbas_core.parameters.structure import file_key

P = TypeVar("P")
_FROM_FILE: Final = {"from_file": True}


@dataclass_transform(kw_only_default=True, frozen_default=True)
def parameters(cls: type[P]) -> type[P]:
    """A frozen dataclass whose values are checked when it is made; see the module.

    Checks that concern several fields go into ``__post_init__``, and raise :class:`ParameterError` or ValueError.

    Raises
    ------
    ParameterError
        By the class, when it is made of values that it refuses.
    """
    config = ConfigDict(
        extra="forbid", allow_inf_nan=False, alias_generator=file_key, validate_by_name=True, validate_by_alias=False
    )
    made: type[Any] = pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=config)(cls)
    original = made.__init__

    @functools.wraps(original)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            original(self, *args, **kwargs)
        except ValidationError as error:
            raise explained(made, error) from None

    made.__init__ = checked
    return made


def from_mapping(kind: type[P], mapping: Mapping[str, Any], *, source: str = "", section: str = "") -> P:
    """A set of parameters from the keys of a file or of ROS parameters.

    Parameters
    ----------
    kind : type
        Class under :func:`parameters`.
    mapping : mapping
        Sections of keys; keys may be dotted (``ccd.tau_s``).
    source, section : str
        Where the mapping came from and the section it is, for messages.

    Raises
    ------
    ParameterError
        Naming source, key, value and bound.
    """
    try:
        found: P = adapter_of(kind).validate_python(nested(mapping), by_alias=True, by_name=False, context=_FROM_FILE)
    except (ValidationError, ParameterError) as error:
        problem = explained(kind, error, section) if isinstance(error, ValidationError) else error
        raise ParameterError.at(f"{source}: " if source else "", problem) from None
    return found


def to_mapping(params: Any) -> dict[str, Any]:
    """Keys and values as a file has them, sections within sections."""
    return nested({each.key: each.value for each in declared(params)})


def made_of(kind: type[P], values: Mapping[str, Any]) -> P:
    """A set of parameters from dotted names of fields, in their own units; for programs that make a set.

    Raises
    ------
    ParameterError
        As the set does when it is made.
    """
    try:
        made: P = adapter_of(kind).validate_python(nested(values), by_alias=False, by_name=True)
    except ValidationError as error:
        raise explained(kind, error) from None
    return made


def replaced(params: P, values: Mapping[str, Any]) -> P:
    """The same with other values of some fields, by their dotted names and in their own units.

    Raises
    ------
    ParameterError
        As the set does when it is made.
    """
    parts = nested(values)
    inner = {
        name: replaced(getattr(params, name), value) if isinstance(value, Mapping) else value
        for name, value in parts.items()
    }
    return dataclasses.replace(params, **inner)  # type: ignore[type-var]


adapter_of: Callable[[Any], TypeAdapter[Any]] = functools.cache(TypeAdapter)
