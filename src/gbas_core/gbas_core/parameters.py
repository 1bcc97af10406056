"""Parameters: declared once, as fields of frozen dataclasses, for files, ROS, errors and documentation.

A set of parameters is a class under :func:`parameters`; each field is annotated with a :class:`Parameter`, which says
what it means, its unit and its bounds. Sets may hold others as fields: these are the sections of a file::

    @parameters
    class CcdParams:
        tau_s: Annotated[float, Parameter("time constant of both filters", "s", 1.0, 1000.0)] = 30.0
        mask_rad: Annotated[float, Parameter("lowest elevation", "deg", 0.0, 90.0)] = 0.1

Conventions: a field has the key of its name in a file, and SI units. Only angles differ: they are radians in the field
``mask_rad`` and degrees under the key ``mask_deg``; unit and bounds of their declaration are those of the file.

A section may be one of several kinds, told by one of its keys (``kind: Annotated[Literal["front"], Parameter(...)]`` in
each, ``discriminator="kind"`` in a ``pydantic.Field`` of the union), a mapping of names to sections (``dict[str,
Threat]``), or sections in order (:class:`Numbered`).

Values are checked when a set is made, from Python or from a file, by pydantic: the kind exactly (a whole number will do
for a float), bounds, no NaN, no infinity, no unknown key. What is wrong is told by a :class:`ParameterError` that names
key, value and bound in the file's unit.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, Final, TypeVar, dataclass_transform

import pydantic.dataclasses
import pydantic_core
from pydantic import ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag, TypeAdapter, ValidationError
from pydantic.dataclasses import is_pydantic_dataclass
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from gbas_core.errors import GbasError

P = TypeVar("P")

_ANGLES: Final = (("_rad", "_deg"), ("_radps", "_degps"))
_FROM_FILE: Final = {"from_file": True}
_OUT_OF_BOUNDS: Final = "out_of_bounds"
_MOST_SHOWN: Final = 20
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
_UNKNOWN: Final = ("unexpected_keyword_argument", "extra_forbidden")
_TAGS: Final = ("union_tag_invalid", "union_tag_not_found")
_MISSING: Final = ("missing", "missing_keyword_only_argument", "missing_argument")


class ParameterError(GbasError, ValueError):
    """A parameter that is unknown, missing, of the wrong kind or out of bounds; the text names it and its value."""


@dataclasses.dataclass(frozen=True)
class Parameter:
    """What a field means, its unit and its bounds, for ``Annotated``.

    Attributes
    ----------
    doc : str
        What it means.
    unit : str
        Unit in a file; ``"-"`` for numbers without one, texts and flags.
    low, high : float or None
        Bounds in that unit, both allowed; of each value of a list. None: there is no bound.
    choices : tuple of str
        The texts that are known, where they are the names of a table; none: any text, or those of a ``Literal``.
    """

    doc: str
    unit: str = "-"
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Lists become tuples and angles of files radians; then the exact kinds, then the bounds."""
        schema = _strict(handler(source))
        if schema["type"] == "literal":
            texts = all(isinstance(each, str) for each in schema["expected"])  # they may tell the kind of a section
            return schema if texts else core_schema.no_info_before_validator_function(_same_kind(schema), schema)
        inner = core_schema.with_info_before_validator_function(self._in_own_units, schema)
        return core_schema.no_info_after_validator_function(self._within, inner)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        found = self._bounded(handler.resolve_ref_schema(handler(schema)))
        found["description"] = self.doc if self.unit == "-" else f"{self.doc} [{self.unit}]"
        return found

    @property
    def per_unit(self) -> float:
        """The field's value of one unit of the file: radians of a degree, else 1."""
        return math.pi / 180.0 if self.unit in ("deg", "deg/s") else 1.0

    def in_file_units(self, value: Any) -> Any:
        """A value as it stands in a file."""
        if isinstance(value, tuple):
            return tuple(self.in_file_units(each) for each in value)
        if self.per_unit == 1.0 or isinstance(value, bool) or not isinstance(value, (int, float)):
            return value
        # The shortest number of degrees that is these radians: 264.73, not 264.73000000000002.
        exact = value / self.per_unit
        short = round(exact, 12)
        return short if short * self.per_unit == value else exact

    def _in_own_units(self, value: Any, info: core_schema.ValidationInfo[Any]) -> Any:
        from_file = info.context is not None and info.context.get("from_file", False)
        return self._converted(value, self.per_unit if from_file else 1.0)

    def _converted(self, value: Any, factor: float) -> Any:
        if hasattr(value, "__iter__") and not isinstance(value, str | bytes | Mapping):
            values = tuple(value)
            # ROS writes an empty list as a list of one empty text.
            return () if values in (("",), (b"",)) else tuple(self._converted(each, factor) for each in values)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        return float(value) * factor if number and factor != 1.0 else value

    def _within(self, value: Any) -> Any:
        for each in _leaves(value):
            if isinstance(each, str) and self.choices and each not in self.choices:
                raise PydanticCustomError(
                    _OUT_OF_BOUNDS, "{shown} is not one of {bounds}", {"shown": f"{each!r}", "bounds": self.known()}
                )
            if isinstance(each, bool | str):
                continue
            shown = self.in_file_units(each)
            low = -math.inf if self.low is None else self.low
            high = math.inf if self.high is None else self.high
            tolerance = 0.0 if self.per_unit == 1.0 else 1e-12 * max(abs(low), abs(high))  # of the conversion
            if not low - tolerance <= shown <= high + tolerance:
                raise PydanticCustomError(
                    _OUT_OF_BOUNDS,
                    "{shown} is not {bounds}",
                    {"shown": f"{shown:.10g}", "bounds": self.bounds()},
                )
        return value

    def _bounded(self, schema: dict[str, Any]) -> dict[str, Any]:
        """A JSON Schema with the bounds at its numbers and the choices at its texts."""
        found = dict(schema)
        if found.get("type") in ("number", "integer"):
            found |= {} if self.low is None else {"minimum": self.low}
            found |= {} if self.high is None or math.isinf(self.high) else {"maximum": self.high}
        if found.get("type") == "string" and self.choices:
            found["enum"] = list(self.choices)
        for key in ("items", "anyOf", "prefixItems"):
            inner = found.get(key)
            if isinstance(inner, dict):
                found[key] = self._bounded(inner)
            elif isinstance(inner, list):
                found[key] = [self._bounded(each) for each in inner]
        return found

    def known(self) -> str:
        """The choices in words; the first and the last of many."""
        names = [name for name in self.choices if name]
        shown = names if len(names) <= _MOST_SHOWN else [*names[:2], "...", names[-1]]
        return ("; " if any("," in name for name in names) else ", ").join(shown)

    def bounds(self) -> str:
        """Bounds and unit in words."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        if self.high is None or math.isinf(self.high):
            return f"{self.low:.10g}{unit} or more"
        return (
            f"within {self.low:.10g} to {self.high:.10g}{unit}"
            if self.low is not None
            else f"{self.high:.10g}{unit} or less"
        )


@dataclasses.dataclass(frozen=True)
class Derived(Parameter):
    """A field that no file sets: whoever holds the set gives it, because it follows from other parameters."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        inner = super().__get_pydantic_core_schema__(source, handler)
        return core_schema.with_info_before_validator_function(self._not_from_file, inner)

    def _not_from_file(self, value: Any, info: core_schema.ValidationInfo[Any]) -> Any:
        if info.context is not None and info.context.get("from_file", False):
            raise PydanticCustomError(_UNKNOWN[0], "is not set by files")
        return value


class Numbered:
    """For ``Annotated[tuple[Section, ...], Numbered()]``: sections in order, in a file a list, or keys 1, 2 and so on.

    ROS parameter files hold no lists of sections.
    """

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._in_order, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        found = handler.resolve_ref_schema(handler(schema))
        return {"anyOf": [found, {"type": "object", "additionalProperties": found["items"]}]}

    def _in_order(self, value: Any) -> Any:
        if not isinstance(value, Mapping):
            return tuple(value) if isinstance(value, list) else value
        keys = sorted(value, key=lambda key: (len(str(key)), str(key)))
        if [str(key) for key in keys] != [str(number + 1) for number in range(len(keys))]:
            raise PydanticCustomError(
                _OUT_OF_BOUNDS, "keys {keys}, not 1 to {last}", {"keys": ", ".join(map(str, keys)), "last": len(keys)}
            )
        return tuple(value[key] for key in keys)


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
            raise _explained(made, error) from None

    made.__init__ = checked
    return made


# --- files


def file_key(name: str) -> str:
    """Key of a field in a file."""
    for own, in_files in _ANGLES:
        if name.endswith(own):
            return name.removesuffix(own) + in_files
    return name


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
        found: P = _adapter(kind).validate_python(nested(mapping), by_alias=True, by_name=False, context=_FROM_FILE)
    except (ValidationError, ParameterError) as error:
        problem = _explained(kind, error, section) if isinstance(error, ValidationError) else error
        raise ParameterError(f"{source}: {problem}" if source else str(problem)) from None
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
        made: P = _adapter(kind).validate_python(nested(values), by_alias=False, by_name=True)
    except ValidationError as error:
        raise _explained(kind, error) from None
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


# --- what is declared


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
        hint = _hints(kind)[item.name]
        key = f"{prefix}{file_key(item.name)}"
        value = _default(item) if params is kind else getattr(params, item.name)
        parameter = _parameter_of(hint)
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
    outer = typing.get_origin(_bare(hint))
    inner = ".NAME" if outer is dict else ".1" if outer is tuple else ""
    for each in _classes(hint):
        if dataclasses.is_dataclass(each):
            yield from declared(each, f"{key}{inner}.")


def json_schema(kind: type[Any]) -> dict[str, Any]:
    """JSON Schema of a set in a file, defaults in the file's units."""
    return _adapter(kind).json_schema(by_alias=True, schema_generator=_InFileUnits)


def unknown_parameters(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise ParameterError for the first name that is not known."""
    known = list(known)
    for name in names:
        if name not in known:
            raise ParameterError(f"parameter '{name}' is unknown{_nearest(name, known)}")


# --- inside


class _InFileUnits(GenerateJsonSchema):
    """JSON Schemas whose defaults stand as a file has them; a section's are those of its keys."""

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> dict[str, Any]:
        found: dict[str, Any] = super().dataclass_schema(schema)
        for each in dataclasses.fields(schema["cls"]):
            parameter, place = _parameter_of(_hints(schema["cls"])[each.name]), file_key(each.name)
            entry = found.get("properties", {}).get(place, {})
            entry.pop("title", None)
            if "const" in entry:  # tells the kind of the section
                found["required"] = [place, *found.get("required", [])]
            if isinstance(parameter, Derived):
                found["properties"].pop(place, None)
            elif parameter is None:
                entry.pop("default", None)
            elif "default" in entry:
                default = parameter.in_file_units(_default(each))
                entry["default"] = pydantic_core.to_jsonable_python(default)
                if default == math.inf:  # JSON has none
                    del entry["default"]
        return found


_adapter: Callable[[Any], TypeAdapter[Any]] = functools.cache(TypeAdapter)
_hints: Callable[[Any], dict[str, Any]] = functools.cache(partial(typing.get_type_hints, include_extras=True))


def _parameter_of(hint: Any) -> Parameter | None:
    found = [each for each in getattr(hint, "__metadata__", ()) if isinstance(each, Parameter)]
    return found[0] if found else None


def _default(item: dataclasses.Field[Any]) -> Any:
    return item.default_factory() if item.default_factory is not dataclasses.MISSING else item.default


def _leaves(value: Any) -> Iterator[Any]:
    """Numbers, texts and flags of a value."""
    if isinstance(value, tuple):
        for each in value:
            yield from _leaves(each)
    elif isinstance(value, (int, float, str)):
        yield value


def _same_kind(schema: Any) -> Callable[[Any], Any]:
    """Refuse what only equals a choice: True is no 1."""
    choices = schema["expected"]

    def checked(value: Any) -> Any:
        if type(value) not in map(type, choices):
            raise PydanticCustomError("literal_error", "is no choice", {"expected": ", ".join(map(repr, choices))})
        return value

    return checked


_SCALARS: Final = ("float", "int", "bool", "str")


def _strict(schema: Any) -> Any:
    """The same with no conversion between numbers, texts and flags, in lists too."""
    if isinstance(schema, dict):
        inner = {key: _strict(value) for key, value in schema.items() if key != "metadata"}
        strict = {"strict": True} if schema.get("type") in _SCALARS else {}
        return {**schema, **inner, **strict}
    return [_strict(each) for each in schema] if isinstance(schema, list) else schema


# --- errors


def _explained(kind: type[Any], error: ValidationError, section: str = "") -> ParameterError:
    """The first thing that is wrong, in the words of a file; what is missing comes after what is there and wrong."""
    found = min(error.errors(include_url=False), key=_is_missing)
    reason, value, loc = found["type"], found["input"], found["loc"]
    path, there = _along(kind, loc)
    key = ".".join((*([section] if section else []), *path))
    if reason in ("too_long", "too_short") or (reason in _MISSING and isinstance(loc[-1], int)):
        key = key.removesuffix(f".{loc[-1] + 1}") if isinstance(loc[-1], int) else key
        return ParameterError(f"{key} = {value!r} has not the right number of values")
    if reason in _UNKNOWN:
        known = _keys(_along(kind, loc[:-1])[1])
        name = str(loc[-1])
        return ParameterError(f"{'.'.join((*key.split('.')[:-1], name))} is unknown{_nearest(name, known)}")
    if reason in _MISSING:
        return ParameterError(_missing(_hints(_along(kind, loc[:-1])[1]).get(_field_of(str(loc[-1]))), key))
    if reason == _OUT_OF_BOUNDS:
        return ParameterError(f"{key} = {found['msg']}")
    if reason in ("value_error", "assertion_error"):
        return ParameterError(_below(there, key, str(found["ctx"]["error"])))
    if reason in _TAGS:
        return _of_no_kind(key, value, found["ctx"])
    if reason == "literal_error":
        return ParameterError(f"{key} = {value!r} is not one of {found['ctx']['expected'].replace(' or ', ', ')}")
    return ParameterError(f"{key} = {value!r} {_KINDS.get(reason, found['msg'])}")


def _is_missing(problem: Mapping[str, Any]) -> bool:
    return problem["type"] in _MISSING and not isinstance(problem["loc"][-1], int)


def _missing(hint: Any, key: str) -> str:
    """A parameter that is missing; of a section the first one it needs."""
    while dataclasses.is_dataclass(hint):
        section = hint
        needed = [each for each in dataclasses.fields(section) if _default(each) is dataclasses.MISSING]
        if not needed:
            break
        key, hint = f"{key}.{file_key(needed[0].name)}", _hints(section)[needed[0].name]
    parameter = _parameter_of(hint)
    return f"{key} is missing" + (f" ({parameter.doc})" if parameter else "")


def _below(there: Any, key: str, text: str) -> str:
    """What a section, or a field with sections in it, says of itself; it may begin with one of its own keys."""
    if not key:
        return text
    first = re.split(r"[ .:=]", text, maxsplit=1)[0]
    is_section = isinstance(there, type) and is_pydantic_dataclass(there)
    return f"{key}.{text}" if not is_section or first in _keys(there) else f"{key}: {text}"


def _of_no_kind(key: str, value: Any, context: Mapping[str, Any]) -> ParameterError:
    """The key that tells the kind of a section is missing, or its value unknown."""
    if not isinstance(value, Mapping):
        return ParameterError(f"{key} = {value!r} is not a section of keys")
    teller = f"{key}.{context['discriminator'].strip(chr(39))}"
    if "tag" not in context:
        return ParameterError(f"{teller} is missing")
    known = context["expected_tags"].replace("'", "")
    return ParameterError(f"{teller} = {context['tag']!r} is not one of {known}")


def _nearest(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(sorted(known))}"


def _keys(section: Any) -> list[str]:
    """Keys of a section in a file."""
    derived = {name for name, hint in _hints(section).items() if isinstance(_parameter_of(hint), Derived)}
    return [file_key(each.name) for each in dataclasses.fields(section) if each.name not in derived]


def _field_of(key: str) -> str:
    """Field name of a key."""
    for own, in_files in _ANGLES:
        if key.endswith(in_files):
            return key.removesuffix(in_files) + own
    return key


def _along(kind: Any, loc: tuple[int | str, ...]) -> tuple[list[str], Any]:
    """Keys of a file on the way to a place of pydantic's, and the class or type that is there."""
    keys: list[str] = []
    for each in loc:
        kind = _bare(kind)
        if dataclasses.is_dataclass(kind):
            keys.append(file_key(str(each)))
            kind = _hints(kind).get(_field_of(str(each)))
        elif typing.get_origin(kind) is dict:
            keys.append(str(each))
            kind = typing.get_args(kind)[1]
        elif isinstance(each, int):  # in a list; sections have numbers, values have none
            kind = (typing.get_args(kind) or (None,))[0]
            if any(dataclasses.is_dataclass(inner) for inner in _classes(kind)):
                keys.append(str(each + 1))
        else:  # which of the kinds of a section it is
            kind = _told(kind, str(each))
    return keys, _bare(kind)


def _bare(hint: Any) -> Any:
    """A type without its annotations and without None."""
    if hasattr(hint, "__metadata__"):
        return _bare(hint.__origin__)
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        others = [each for each in typing.get_args(hint) if each is not type(None)]
        return _bare(others[0]) if len(others) == 1 else hint
    return hint


def _told(union: Any, tag: str) -> Any:
    """The member of a union that a tag stands for: given by a ``pydantic.Tag``, by a literal field, or by its name."""
    for member in typing.get_args(union):
        if any(isinstance(each, Tag) and each.tag == tag for each in getattr(member, "__metadata__", ())):
            return member
    return next((member for member in _classes(union) if tag in _tags(member)), union)


def _tags(kind: Any) -> set[str]:
    """What may tell that a section is of a class: the values of its literal fields, or its name."""
    found = {kind.__name__}
    for hint in _hints(kind).values() if dataclasses.is_dataclass(kind) else ():
        if typing.get_origin(_bare(hint)) is typing.Literal:
            found |= set(typing.get_args(_bare(hint)))
    return found


def _classes(hint: Any) -> Iterator[Any]:
    if isinstance(hint, type):
        yield hint
    for each in typing.get_args(hint):
        yield from _classes(each)
