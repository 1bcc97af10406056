"""JSON Schema (draft 2020-12) of configuration files, for editors: what stands where, in which unit and bounds.

The schema describes single keys, in their nested form. It requires none: a file may be based on another, and ROS
parameters may add to it; ``gbas config check`` says what is missing. A key without a value (null) takes away what the
file below says, so every key may be null.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from gbas_bringup.node_kinds import NODE_KINDS
from gbas_cli.config_sections import SECTIONS, node_model
from gbas_core.parameters import json_schema
from gbas_msgs_py.topics import DEFAULT_NAMESPACE
from gbas_node.params import NodeParams

DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
FILE: Final = "gbas.schema.json"
_FINITE: Final = {"$ref": "#/$defs/finite"}
_FINITE_RULE: Final = {
    "description": "A number, not .nan or an infinity.",
    "not": {"type": "number", "exclusiveMaximum": -1.0e308},  # what is no number is not below any
}
_OF_ROS: Final = {
    "qos_overrides": {"type": "object", "description": "quality of service of topics, as ROS has it"},
    "use_sim_time": {"type": "boolean", "description": "time is that of /clock"},
}


def section_schema(name: str) -> dict[str, Any]:
    """Schema of one section."""
    definitions: dict[str, Any] = {"finite": _FINITE_RULE}
    return {"$schema": DRAFT, **_section(name, definitions), "$defs": definitions}


def file_schema() -> dict[str, Any]:
    """Schema of a whole file: sections at its top, or below ``/**`` and names of nodes as a ROS parameter file."""
    definitions: dict[str, Any] = {"finite": _FINITE_RULE}
    for name in SECTIONS:
        definitions[name] = _section(name, definitions)
    sections = {name: {"$ref": f"#/$defs/{name}"} for name in SECTIONS}
    of_all = _in_files(json_schema(NodeParams), "nodes", definitions)["properties"] | sections | _OF_ROS
    nodes = {}
    for name in NODE_KINDS:
        own = _in_files(json_schema(node_model(name)), name, definitions)
        definitions[f"node.{name}"] = _wrapped({**own, "properties": own["properties"] | sections | _OF_ROS})
        nodes[f"^(/\\*\\*|{DEFAULT_NAMESPACE}(/\\w+)*)/{name}$"] = {"$ref": f"#/$defs/node.{name}"}
    return {
        "$schema": DRAFT,
        "title": "Configuration of the GBAS suite",
        "description": "Sections ground, airborne and sim, at the top or wrapped as a ROS parameter file.",
        "type": "object",
        "properties": {
            "base": {"type": "string", "description": "file that this one is based on, relative to it"},
            **sections,
            "/**": _wrapped({
                "type": "object", "title": "parameters for all nodes", "properties": of_all,
                "additionalProperties": False,
            }),
        },
        "patternProperties": nodes,
        "additionalProperties": False,
        "$defs": definitions,
    }  # fmt: skip


def text_of(schema: dict[str, Any]) -> str:
    """A schema as it stands in a file."""
    return json.dumps(schema, indent=1, allow_nan=False) + "\n"


def _section(name: str, definitions: dict[str, Any]) -> dict[str, Any]:
    return _in_files(SECTIONS[name].schema(), name, definitions)


def _wrapped(parameters: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": ["object", "null"],
        "properties": {"ros__parameters": {**parameters, "type": ["object", "null"]}},
        "additionalProperties": False,
    }


def _in_files(schema: dict[str, Any], name: str, definitions: dict[str, Any]) -> dict[str, Any]:
    """A set's schema for files that may leave out and take away; its definitions go to those of the whole."""
    inner = schema.pop("$defs", {})
    for key, each in inner.items():
        definitions[f"{name}.{key}"] = _open(_together(each, inner), name)
    return _open({**_together(schema, inner), "title": name}, name)


def _together(schema: Any, definitions: dict[str, Any]) -> Any:
    """The same with sections whose kind is told by the keys that are there as one with the keys of all kinds."""
    if isinstance(schema, list):
        return [_together(each, definitions) for each in schema]
    if not isinstance(schema, dict):
        return schema
    if "oneOf" not in schema or "discriminator" in schema:
        return {key: _together(each, definitions) for key, each in schema.items()}
    kinds = [definitions[each.removeprefix("#/$defs/")]["properties"] for each in _references(schema)]
    properties = {}
    for key in {key: None for kind in kinds for key in kind}:
        found = [kind[key] for kind in kinds if key in kind]
        distinct = [each for number, each in enumerate(found) if each not in found[:number]]
        properties[key] = distinct[0] if len(distinct) == 1 else {"anyOf": distinct}
    rest = {key: each for key, each in schema.items() if key != "oneOf"}
    return rest | {"type": "object", "properties": properties, "additionalProperties": False}


def _references(schema: dict[str, Any]) -> Iterator[str]:
    """References to the kinds of a section, those of kinds of kinds included."""
    for each in schema["oneOf"]:
        if "oneOf" in each:
            yield from _references(each)
        else:
            yield each["$ref"]


def _open(schema: dict[str, Any], name: str, *, in_list: bool = False) -> dict[str, Any]:
    """The same with every value of a key allowed to be null, none required, numbers finite, references to `name`."""
    if "$ref" in schema:
        reference = schema["$ref"].removeprefix("#/$defs/")
        return {**schema, "$ref": f"#/$defs/{name}.{reference}"}
    if "discriminator" in schema:
        return _by_kind(schema, name)
    found = {key: value for key, value in schema.items() if key != "required"}
    found |= _without_null_choice(found)
    if "$ref" in found:
        return _open(found, name)
    for key in ("properties", "patternProperties"):
        if key in found:
            found[key] = {each: _open(inner, name) for each, inner in found[key].items()}
    for key in ("items", "additionalProperties"):
        if isinstance(found.get(key), dict):
            found[key] = _open(found[key], name, in_list=key == "items")
    for key in ("prefixItems", "anyOf", "allOf"):
        if key in found:
            found[key] = [_open(each, name, in_list=in_list or key == "prefixItems") for each in found[key]]
    if found.get("type") == "number":
        found |= _FINITE
    return found if in_list else _nullable(found)


def _by_kind(schema: dict[str, Any], name: str) -> dict[str, Any]:
    """A section of one of several kinds: which one is told by a key, and what is wrong by that kind alone."""
    key, kinds = schema["discriminator"]["propertyName"], schema["discriminator"]["mapping"]
    rest = {each: value for each, value in schema.items() if each not in ("discriminator", "oneOf", "default")}
    return rest | {
        "type": ["object", "null"],
        "properties": {key: {"enum": list(kinds)}},
        "allOf": [
            {
                "if": {"properties": {key: {"const": kind}}, "required": [key]},
                "then": _open({"$ref": reference}, name),
            }
            for kind, reference in kinds.items()
        ],
    }


def _without_null_choice(schema: dict[str, Any]) -> dict[str, Any]:
    """Of a choice between something and null the something: null is allowed everywhere."""
    choices = [each for each in schema.get("anyOf", ()) if each != {"type": "null"}]
    if len(choices) != 1:
        return {"anyOf": choices} if choices else {}
    schema.pop("anyOf")
    return {**choices[0], **({"default": schema["default"]} if schema.get("default") is not None else {})}


def _nullable(schema: dict[str, Any]) -> dict[str, Any]:
    if schema.get("default", ...) is None:
        schema.pop("default")
    if "const" in schema:
        schema["enum"] = [schema.pop("const")]
    if "enum" in schema:
        schema["enum"] = [*schema["enum"], None]
    kind = schema.get("type")
    if isinstance(kind, str) and kind != "null":
        schema["type"] = [kind, "null"]
    return schema
