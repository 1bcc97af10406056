"""JSON Schema of a set of parameters, as editors use it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pydantic_core
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from gbas_core.parameters.declaration import Derived
from gbas_core.parameters.sets import adapter_of
from gbas_core.parameters.structure import default_of, file_key, hints_of, parameter_of


def json_schema(kind: type[Any]) -> dict[str, Any]:
    """JSON Schema of a set in a file, defaults in the file's units."""
    return adapter_of(kind).json_schema(by_alias=True, schema_generator=_InFileUnits)


class _InFileUnits(GenerateJsonSchema):
    """JSON Schemas whose defaults stand as a file has them; a section's are those of its keys."""

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> dict[str, Any]:
        found: dict[str, Any] = super().dataclass_schema(schema)
        for each in dataclasses.fields(schema["cls"]):
            parameter, place = parameter_of(hints_of(schema["cls"])[each.name]), file_key(each.name)
            entry = found.get("properties", {}).get(place, {})
            entry.pop("title", None)
            if "const" in entry:  # tells the kind of the section
                found["required"] = [place, *found.get("required", [])]
            if isinstance(parameter, Derived):
                found["properties"].pop(place, None)
            elif parameter is None:
                entry.pop("default", None)
            elif "default" in entry:
                default = parameter.in_file_units(default_of(each))
                entry["default"] = pydantic_core.to_jsonable_python(default)
                if default == math.inf:  # JSON has none
                    del entry["default"]
        return found
