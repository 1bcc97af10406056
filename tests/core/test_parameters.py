"""One declaration: values from Python and from files, what is refused and in which words, schema, what is declared."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, field, replace
from typing import Annotated, Any, Literal

import pytest
from pydantic import Discriminator, Field, Tag

from gbas_core.parameters import (
    Numbered,
    Parameter,
    ParameterError,
    declared,
    from_mapping,
    json_schema,
    nested,
    parameters,
    to_mapping,
)


@parameters
class Filters:
    """Filters."""

    exclude: Annotated[bool, Parameter("satellites that fail are excluded")] = True
    tau_s: Annotated[float, Parameter("time constant", "s", 1.0, 1000.0)] = 30.0
    mask_rad: Annotated[float, Parameter("lowest elevation", "deg", 0.0, 90.0)] = math.radians(5.0)
    nodes_rad: Annotated[tuple[float, ...], Parameter("nodes", "deg", 0.0, 90.0)] = ()
    form: Annotated[Literal["full_rank", "published"], Parameter("form of the test")] = "full_rank"
    points: Annotated[int, Parameter("points of a fit", "-", 1, 10)] = 3
    natural: Annotated[tuple[float, float], Parameter("of step and rate", "m", 0.0, 1.0)] = (0.1, 0.2)
    limit_m: Annotated[float | None, Parameter("limit, if any", "m", 0.0, 9.0)] = None

    def __post_init__(self) -> None:
        if self.points == 7:
            raise ParameterError("points = 7 is odd")


@parameters
class Station:
    """A station."""

    name: Annotated[str, Parameter("name of the station")]
    filters: Filters = Filters()


def station(**mapping: Any) -> Station:
    return from_mapping(Station, mapping, source="site.yaml", section="ground")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"tau_s": 2000.0}, "tau_s = 2000 is not within 1 to 1000 s"),
        ({"tau_s": "3"}, "tau_s = '3' is not a number"),
        ({"tau_s": True}, "tau_s = True is not a number"),
        ({"tau_s": math.nan}, "tau_s = nan is not a finite number"),
        ({"tau_s": math.inf}, "tau_s = inf is not a finite number"),
        ({"points": 2.5}, "points = 2.5 is not a whole number"),
        ({"points": True}, "points = True is not a whole number"),
        ({"points": 7}, "points = 7 is odd"),
        ({"exclude": 1}, "exclude = 1 is not true or false"),
        ({"form": "x"}, "form = 'x' is not one of 'full_rank', 'published'"),
        ({"natural": (0.1,)}, "natural = (0.1,) has not the right number of values"),
        ({"natural": (0.1, 3.0)}, "natural = 3 is not within 0 to 1 m"),
        ({"limit_m": 10.0}, "limit_m = 10 is not within 0 to 9 m"),
        ({"tau": 3.0}, "tau is unknown; did you mean 'tau_s'?"),
        ({"mask_deg": 3.0}, "mask_deg is unknown; did you mean 'mask_deg'?"),  # from Python it is mask_rad
    ],
)
def test_what_is_wrong_is_named(values: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Filters(**values)
    assert str(caught.value) == words


def test_messages_speak_in_the_units_of_files() -> None:
    with pytest.raises(ParameterError, match=r"^mask_deg = 114\.59\d* is not within 0 to 90 deg$"):
        Filters(mask_rad=2.0)


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({}, "ground.name is missing (name of the station)"),
        ({"name": "A", "filters": {"mask_deg": 95}}, "ground.filters.mask_deg = 95 is not within 0 to 90 deg"),
        ({"name": "A", "filters.nodes_deg": [10, 200]}, "ground.filters.nodes_deg = 200 is not within 0 to"),
        ({"name": "A", "filters": {"mask_rad": 1}}, "ground.filters.mask_rad is unknown; did you mean 'mask_deg'?"),
        ({"name": "A", "filter": {}}, "ground.filter is unknown; did you mean 'filters'?"),
        ({"name": "A", "filters": 3}, "ground.filters = 3 is not a section of keys"),
        ({"name": "A", "filters": {"points": 7}}, "ground.filters.points = 7 is odd"),
        ({"name": 1}, "ground.name = 1 is not a text"),
    ],
)  # fmt: skip
def test_files_are_named_with_section_and_key(mapping: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        station(**mapping)
    assert str(caught.value).startswith(f"site.yaml: {words}")


def test_angles_are_degrees_in_files_and_radians_inside() -> None:
    made = station(name="A", filters={"mask_deg": 264.73e-1, "nodes_deg": [10, 20.5]})
    assert made.filters.mask_rad == math.radians(264.73e-1)
    assert made.filters.nodes_rad == (math.radians(10.0), math.radians(20.5))
    assert to_mapping(made)["filters"]["mask_deg"] == 264.73e-1
    assert from_mapping(Station, to_mapping(made)) == made


def test_keys_may_be_dotted_and_an_empty_ros_list_is_empty() -> None:
    assert station(**{"name": "A", "filters.tau_s": 40, "filters.nodes_deg": [""]}).filters.tau_s == 40.0
    assert nested({"a": {"b": 1}, "a.c": 2, "a.b": 3}) == {"a": {"b": 3, "c": 2}}


def test_sets_are_frozen_and_checked_again_when_changed() -> None:
    made = Filters()
    assert replace(made, tau_s=40.0) != made
    assert hash(replace(made)) == hash(made)
    with pytest.raises(FrozenInstanceError):
        made.tau_s = 40.0  # type: ignore[misc]
    with pytest.raises(ParameterError, match="tau_s"):
        replace(made, tau_s=0.0)


def test_what_is_declared_comes_with_values_in_the_units_of_files() -> None:
    found = {each.key: each for each in declared(station(name="A"))}
    assert found["filters.mask_deg"].value == 5.0
    assert found["filters.mask_deg"].parameter.unit == "deg"
    assert found["filters.tau_s"].kind is float
    assert {each.key for each in declared(Station)} == set(found)


def test_json_schema_has_bounds_units_and_defaults_of_files() -> None:
    schema = json_schema(Station)
    filters = schema["$defs"]["Filters"]["properties"]
    assert filters["mask_deg"] == {
        "type": "number", "minimum": 0.0, "maximum": 90.0, "default": 5.0, "description": "lowest elevation [deg]",
    }  # fmt: skip
    assert filters["nodes_deg"]["items"] == {"type": "number", "minimum": 0.0, "maximum": 90.0}
    assert filters["form"]["enum"] == ["full_rank", "published"]
    assert schema["required"] == ["name"]
    assert schema["additionalProperties"] is False


# --- sections of several kinds


@parameters
class Wall:
    """A wall."""

    kind: Annotated[Literal["wall"], Parameter("kind of the thing")] = "wall"
    width_m: Annotated[float, Parameter("its width", "m", 0.0, 10.0)]
    material: Annotated[str, Parameter("what it is of", choices=("", "brick", "wood"))] = ""


@parameters
class Gate:
    """A gate."""

    kind: Annotated[Literal["gate"], Parameter("kind of the thing")] = "gate"
    open_rad: Annotated[float, Parameter("how far it is open", "deg", 0.0, 90.0)] = 0.0

    def __post_init__(self) -> None:
        if self.open_rad == math.radians(45.0):
            raise ValueError("it sticks")


Thing = Annotated[Wall | Gate, Field(discriminator="kind")]


def _has_stones(section: Any) -> str:
    return "with" if isinstance(section, Stones) or (isinstance(section, dict) and "stones" in section) else "without"


@parameters
class Stones:
    """A way of stones."""

    stones: Annotated[int, Parameter("how many", "-", 1, 9)]


@parameters
class Garden:
    """A garden."""

    things: dict[str, Thing] = field(default_factory=dict)
    row: Annotated[tuple[Thing, ...], Numbered()] = ()
    gate: Gate | None = None
    way: Annotated[Annotated[Stones, Tag("with")] | Annotated[Filters, Tag("without")], Discriminator(_has_stones)] = (
        Filters()
    )


def garden(**mapping: Any) -> Garden:
    return from_mapping(Garden, mapping, source="a.yaml", section="garden")


def test_sections_of_several_kinds_are_read_by_name_in_order_and_dotted() -> None:
    wall, gate = {"kind": "wall", "width_m": 2}, {"kind": "gate", "open_deg": 30}
    made = garden(things={"a": wall, "b": gate}, row={2: gate, 1: wall}, way={"stones": 3})
    assert made.things == {"a": Wall(width_m=2.0), "b": Gate(open_rad=math.radians(30.0))}
    assert made.row == (made.things["a"], made.things["b"])
    assert garden(row=[wall, gate]).row == made.row
    assert garden(**{"things.a.kind": "wall", "things.a.width_m": 2, "row.1.kind": "gate"}).row == (Gate(),)
    assert replace(made, gate=Gate()).things == made.things
    assert made.way == Stones(stones=3)


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({"things": 3}, "things = 3 is not a section of keys"),
        ({"things": {"a": 3}}, "things.a = 3 is not a section of keys"),
        ({"things": {"a": {"kind": "tree"}}}, "things.a.kind = 'tree' is not one of wall, gate"),
        ({"things": {"a": {"width_m": 1}}}, "things.a.kind is missing"),
        ({"things": {"a": {"kind": "wall"}}}, "things.a.width_m is missing (its width)"),
        ({"things": {"a": {"kind": "wall", "width_m": 11}}}, "things.a.width_m = 11 is not within 0 to 10 m"),
        ({"things": {"a": {"kind": "wall", "with_m": 1}}}, "things.a.with_m is unknown; did you mean 'width_m'?"),
        ({"things": {"a": {"kind": "gate", "opn_deg": 1}}}, "things.a.opn_deg is unknown; did you mean 'open_deg'?"),
        ({"things": {"a": {"kind": "gate", "open_deg": 45}}}, "things.a: it sticks"),
        (
            {"things": {"a": {"kind": "wall", "width_m": 1, "material": "tin"}}},
            "things.a.material = 'tin' is not one of brick, wood",
        ),
        ({"row": [{"kind": "gate"}, {"kind": "gate", "open_deg": 91}]}, "row.2.open_deg = 91 is not within 0 to 90"),
        ({"row": {1: {"kind": "gate"}, 3: {"kind": "gate"}}}, "row = keys 1, 3, not 1 to 2"),
        ({"row": 3}, "row = 3 is not a list"),
        ({"row": [3]}, "row.1 = 3 is not a section of keys"),
        ({"gate": {"open_deg": "wide"}}, "gate.open_deg = 'wide' is not a number"),
        ({"way": {"stones": 10}}, "way.stones = 10 is not within 1 to 9"),
        ({"way": {"tau_s": 0.5}}, "way.tau_s = 0.5 is not within 1 to 1000 s"),
    ],
)
def test_what_is_wrong_in_such_a_section_is_named_as_in_a_file(mapping: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        garden(**mapping)
    assert str(caught.value).startswith(f"a.yaml: garden.{words}")


def test_what_such_sections_declare() -> None:
    made = garden(things={"a": {"kind": "gate", "open_deg": 30}}, row=[{"kind": "wall", "width_m": 2}])
    found = {each.key: each.value for each in declared(made)}
    assert found["things.a.open_deg"] == 30.0
    assert found["row.1.width_m"] == 2.0
    assert not any(key.startswith("gate.") for key in found)
    known = {each.key for each in declared(Garden)}
    assert {"things.NAME.width_m", "things.NAME.open_deg", "row.1.kind", "gate.open_deg", "way.tau_s"} <= known


def test_json_schema_of_such_sections() -> None:
    schema = json_schema(Garden)
    wall = schema["$defs"]["Wall"]
    assert set(wall["required"]) == {"kind", "width_m"}
    assert wall["properties"]["kind"]["const"] == "wall"
    assert wall["properties"]["material"]["enum"] == ["", "brick", "wood"]
    assert len(schema["properties"]["things"]["additionalProperties"]["oneOf"]) == 2
    assert [each["type"] for each in schema["properties"]["row"]["anyOf"]] == ["array", "object"]
