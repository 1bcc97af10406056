"""What a configuration file may hold: the sections of parameters, and the parameters of the nodes themselves."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from gbas_airborne.params import AirborneParams
from gbas_bringup.node_kinds import NODE_KINDS
from gbas_core.parameters import Declared, declared, from_mapping, json_schema
from gbas_core.positioning.approach_keys import ApproachSection
from gbas_ground.params import GroundParams
from gbas_sim.params import SimParams
from gbas_sim.scenario import open_world, scenario_from_mapping, sim_params
from gbas_sim.world_params import WorldParams

Sections = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of a configuration file.

    Attributes
    ----------
    reads : tuple of str
        Sections it is made from, itself last.
    make : callable
        Sections and where they came from, to the parameters.
    shown : callable
        Parameters and the sections they were made from, to all their values in the file's units.
    models : tuple of type
        Classes under :func:`gbas_core.parameters.parameters` it consists of, the section's own first.
    start : callable
        What a run does with the parameters at its start, as far as that may be refused.
    taken : mapping
        Keys that have the value of another section's key as long as they are not given.
    """

    reads: tuple[str, ...]
    make: Callable[[Sections, str], Any]
    shown: Callable[[Any, Sections], Iterable[Declared]]
    models: tuple[type[Any], ...] = ()
    start: Callable[[Any, str], Any] = lambda params, source: None
    taken: Mapping[str, str] = field(default_factory=dict)

    def schema(self) -> dict[str, Any]:
        """JSON Schema of the section as it stands in a file."""
        return json_schema(self.models[0]) if self.models else {"type": "object"}


def _ground_shown(station: GroundParams, sections: Sections) -> Iterator[Declared]:
    yield from declared(station)
    for name, keys in sorted(sections["ground"].get("approaches", {}).items()):
        approach = from_mapping(ApproachSection, keys)
        yield from (each for each in declared(approach, f"approaches.{name}.") if each.value is not None)


def _sim_shown(world: WorldParams, sections: Sections) -> Iterator[Declared]:
    """The troposphere that is left out is the station's."""
    for each in declared(sim_params(sections)):
        of_station = each.key in _STATION_AIR and each.value is None
        yield replace(each, value=getattr(world.troposphere, each.key.rpartition(".")[2])) if of_station else each


_STATION_AIR: Final = {
    "troposphere.refractivity": "ground.atmosphere.refractivity",
    "troposphere.scale_height_m": "ground.atmosphere.scale_height_m",
    "troposphere.reference_height_m": "ground.station.height_m",
}

SECTIONS: Final[dict[str, Section]] = {
    "ground": Section(
        reads=("ground",),
        make=lambda sections, source: GroundParams.from_mapping(sections["ground"], source=source),
        shown=_ground_shown,
        models=(GroundParams, ApproachSection),
    ),
    "airborne": Section(
        reads=("airborne",),
        make=lambda sections, source: AirborneParams.from_mapping(sections["airborne"], source=source),
        shown=lambda receiver, _: declared(receiver),
        models=(AirborneParams,),
    ),
    "sim": Section(
        reads=("ground", "sim"),
        make=lambda sections, source: scenario_from_mapping(sections, source=source),
        shown=_sim_shown,
        models=(SimParams,),
        start=lambda world, source: open_world(world, source=source),
        taken=_STATION_AIR,
    ),
}
"""Every section of the suite; what reads, shows, checks and describes configurations goes through this table."""


def node_model(kind: str) -> type[Any]:
    """Class of a node's own parameters, by the name of the node."""
    node = NODE_KINDS[kind]
    model: type[Any] = getattr(importlib.import_module(node.module), node.class_name).params_type
    return model
