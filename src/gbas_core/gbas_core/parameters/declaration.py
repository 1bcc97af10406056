"""What is said of a parameter where it is declared: its meaning, unit and bounds, and how pydantic checks them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

OUT_OF_BOUNDS: Final = "out_of_bounds"
_MOST_SHOWN: Final = 20
UNKNOWN: Final = ("unexpected_keyword_argument", "extra_forbidden")


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
                    OUT_OF_BOUNDS, "{shown} is not one of {bounds}", {"shown": f"{each!r}", "bounds": self.known()}
                )
            if isinstance(each, bool | str):
                continue
            shown = self.in_file_units(each)
            low = -math.inf if self.low is None else self.low
            high = math.inf if self.high is None else self.high
            tolerance = 0.0 if self.per_unit == 1.0 else 1e-12 * max(abs(low), abs(high))  # of the conversion
            if not low - tolerance <= shown <= high + tolerance:
                raise PydanticCustomError(
                    OUT_OF_BOUNDS,
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
            raise PydanticCustomError(UNKNOWN[0], "is not set by files")
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
                OUT_OF_BOUNDS, "keys {keys}, not 1 to {last}", {"keys": ", ".join(map(str, keys)), "last": len(keys)}
            )
        return tuple(value[key] for key in keys)


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
