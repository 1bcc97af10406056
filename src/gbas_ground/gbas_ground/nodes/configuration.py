"""The station's parameters as the ground nodes get them: a file, ROS parameters over it."""

from __future__ import annotations

from typing import Any, Final

from gbas_core.configuration import read_configuration
from gbas_core.parameters import ParameterError, merged, nested
from gbas_ground.params import SECTION, GroundParams
from gbas_node.node import GbasNode

PREFIX: Final = f"{SECTION}."


def station_params(node: GbasNode, config: str) -> GroundParams:
    """Parameters from the file `config` (if any) and from the node's ROS parameters ``ground.*``, which count more.

    Raises
    ------
    ParameterError
        Naming the file, the parameter, its value and its bound.
    """
    section: dict[str, Any] = read_configuration(config).section(SECTION) if config else {}
    overrides = nested(node.overrides(PREFIX))
    if not section and not overrides:
        raise ParameterError("no station: give its file as parameter 'config', or parameters 'ground.*'")
    station = GroundParams.from_mapping(merged(section, overrides), source=config or "ROS parameters")
    node.show_parameters(station, PREFIX)
    return station
