"""The receiver's parameters as the airborne nodes get them: a file, ROS parameters over it."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from gbas_airborne.params import AirborneParams
from gbas_core.parameters import ParameterError
from gbas_node.node import GbasNode

PREFIX = "airborne."


def receiver_params(node: GbasNode, config: str) -> AirborneParams:
    """Parameters from the file `config` (if any) and from the node's ROS parameters ``airborne.*``, which count more.

    Raises
    ------
    ValueError
        Naming the file, the parameter, its value and its bound.
    """
    given: dict[str, Any] = {} if not config else asdict(AirborneParams.from_yaml(config))
    overrides = node.overrides(PREFIX)
    try:
        receiver = AirborneParams.from_mapping({**given, **overrides})
    except ValueError as error:
        raise ParameterError(f"{config or 'ROS parameters'}: {error}") from None
    for item in fields(receiver):
        node.declare_read_only(PREFIX + item.name, getattr(receiver, item.name), str(item.type))
    return receiver
