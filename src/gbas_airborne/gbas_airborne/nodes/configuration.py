"""The receiver's parameters as the airborne nodes get them: a file, ROS parameters over it."""

from __future__ import annotations

from typing import Any

from gbas_airborne.params import SECTION, AirborneParams, airborne_section
from gbas_core.parameters import merged, nested
from gbas_node.node import GbasNode

PREFIX = f"{SECTION}."


def receiver_params(node: GbasNode, config: str) -> AirborneParams:
    """Parameters from the file `config` (if any) and from the node's ROS parameters ``airborne.*``, which count more.

    Raises
    ------
    ParameterError
        Naming the file, the parameter, its value and its bound.
    """
    given: dict[str, Any] = airborne_section(config) if config else {}
    values = merged(nested(given), nested(node.overrides(PREFIX)))
    receiver = AirborneParams.from_mapping(values, source=config or "ROS parameters")
    node.show_parameters(receiver, PREFIX)
    return receiver
