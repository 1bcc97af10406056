"""What is wrong with a parameter, in the words of a file: key, value and bound."""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, Self

from pydantic import ValidationError
from pydantic.dataclasses import is_pydantic_dataclass

from gbas_core.errors import GbasError
from gbas_core.parameters.declaration import OUT_OF_BOUNDS, UNKNOWN
from gbas_core.parameters.structure import (
    default_of,
    field_of,
    file_key,
    hints_of,
    is_in_collection,
    keys_of,
    parameter_of,
    place_of,
)

_KINDS: Final = {
    "float_type": "is not a number",
    "float_parsing": "is not a number",
    "finite_number": "is not a finite number",
    "int_type": "is not a whole number",
    "int_from_float": "is not a whole number",
    "int_parsing": "is not a whole number",
    "bool_type": "is not true or false",
    "bool_parsing": "is not true or false",
    "string_type": "is not a text",
    "tuple_type": "is not a list",
    "dict_type": "is not a section of keys",
    "mapping_type": "is not a section of keys",
    "dataclass_type": "is not a section of keys",
    "model_attributes_type": "is not a section of keys",
}
_TAGS: Final = ("union_tag_invalid", "union_tag_not_found")
_MISSING: Final = ("missing", "missing_keyword_only_argument", "missing_argument")


class ParameterError(GbasError, ValueError):
    """A parameter that is unknown, missing, of the wrong kind or out of bounds; the text names it and its value.

    Attributes
    ----------
    missing : bool
        Nothing is wrong with what is given; a key is lacking that another file may add. A named or numbered section
        that is given stands in one file: what is lacking in it is wrong.
    """

    def __init__(self, text: str, *, missing: bool = False) -> None:
        super().__init__(text)
        self.missing = missing

    @classmethod
    def at(cls, where: str, error: Exception) -> Self:
        """The same problem, told with where it is."""
        return cls(f"{where}{error}", missing=getattr(error, "missing", False))


def unknown_parameters(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise ParameterError for the first name that is not known."""
    known = list(known)
    for name in names:
        if name not in known:
            raise ParameterError(f"parameter '{name}' is unknown{nearest_name(name, known)}")


def explained(kind: type[Any], error: ValidationError, section: str = "") -> ParameterError:
    """The first thing that is wrong, in the words of a file; what is missing comes after what is there and wrong."""
    found = min(error.errors(include_url=False), key=_is_missing)
    reason, value, loc = found["type"], found["input"], found["loc"]
    path, there = place_of(kind, loc)
    key = ".".join((*([section] if section else []), *path))
    if reason in ("too_long", "too_short") or (reason in _MISSING and isinstance(loc[-1], int)):
        key = key.removesuffix(f".{loc[-1] + 1}") if isinstance(loc[-1], int) else key
        return ParameterError(f"{key} = {value!r} has not the right number of values")
    if reason in UNKNOWN:
        known = keys_of(place_of(kind, loc[:-1])[1])
        name = str(loc[-1])
        return ParameterError(f"{'.'.join((*key.split('.')[:-1], name))} is unknown{nearest_name(name, known)}")
    if reason in _MISSING:
        hint = hints_of(place_of(kind, loc[:-1])[1]).get(field_of(str(loc[-1])))
        return ParameterError(_missing(hint, key), missing=not is_in_collection(kind, loc))
    if reason == OUT_OF_BOUNDS:
        return ParameterError(f"{key} = {found['msg']}")
    if reason in ("value_error", "assertion_error"):
        cause = found["ctx"]["error"]
        missing = getattr(cause, "missing", False) and not is_in_collection(kind, loc)
        return ParameterError(_below(there, key, str(cause)), missing=missing)
    if reason in _TAGS:
        return _of_no_kind(key, value, found["ctx"], missing=not is_in_collection(kind, loc))
    if reason == "literal_error":
        return ParameterError(f"{key} = {value!r} is not one of {found['ctx']['expected'].replace(' or ', ', ')}")
    return ParameterError(f"{key} = {value!r} {_KINDS.get(reason, found['msg'])}")


def _is_missing(problem: Mapping[str, Any]) -> bool:
    return problem["type"] in _MISSING and not isinstance(problem["loc"][-1], int)


def _missing(hint: Any, key: str) -> str:
    """A parameter that is missing; of a section the first one it needs."""
    while dataclasses.is_dataclass(hint):
        section = hint
        needed = [each for each in dataclasses.fields(section) if default_of(each) is dataclasses.MISSING]
        if not needed:
            break
        key, hint = f"{key}.{file_key(needed[0].name)}", hints_of(section)[needed[0].name]
    parameter = parameter_of(hint)
    return f"{key} is missing" + (f" ({parameter.doc})" if parameter else "")


def _below(there: Any, key: str, text: str) -> str:
    """What a section, or a field with sections in it, says of itself; it may begin with one of its own keys."""
    if not key:
        return text
    first = re.split(r"[ .:=]", text, maxsplit=1)[0]
    is_section = isinstance(there, type) and is_pydantic_dataclass(there)
    return f"{key}.{text}" if not is_section or first in keys_of(there) else f"{key}: {text}"


def _of_no_kind(key: str, value: Any, context: Mapping[str, Any], *, missing: bool) -> ParameterError:
    """The key that tells the kind of a section is missing, or its value unknown."""
    if not isinstance(value, Mapping):
        return ParameterError(f"{key} = {value!r} is not a section of keys")
    teller = f"{key}.{context['discriminator'].strip(chr(39))}"
    if "tag" not in context:
        return ParameterError(f"{teller} is missing", missing=missing)
    known = context["expected_tags"].replace("'", "")
    return ParameterError(f"{teller} = {context['tag']!r} is not one of {known}")


def nearest_name(name: str, known: list[str]) -> str:
    """The known name that is most alike; else all of them."""
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(sorted(known))}"
