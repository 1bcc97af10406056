"""The station's parameters as the ground nodes get them: a file, ROS parameters over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import yaml

from gbas_core.parameters import ParameterError
from gbas_ground.params import GroundParams, ground_section
from gbas_node.node import GbasNode

PREFIX: Final = "ground."
_RECEIVERS: Final = "receivers.rr1_ecef_m"


def station_params(node: GbasNode, config: str) -> GroundParams:
    """Parameters from the file `config` (if any) and from the node's ROS parameters ``ground.*``, which count more.

    Raises
    ------
    ParameterError
        Naming the file, the parameter, its value and its bound.
    """
    section: dict[str, Any] = {}
    if config:
        try:
            section = dict(ground_section(yaml.safe_load(Path(config).read_text(encoding="utf-8")), config))
        except (OSError, UnicodeDecodeError) as error:
            raise ParameterError(f"{config}: cannot be read: {error}") from None
        except yaml.YAMLError as error:
            raise ParameterError(f"{config}: is not YAML: {error}") from None
    overrides = node.overrides(PREFIX)
    if not section and not overrides:
        raise ParameterError("no station: give its file as parameter 'config', or parameters 'ground.*'")
    station = GroundParams.from_mapping({**section, **overrides}, source=config or "ROS parameters")
    _show(node, station)
    return station


def _show(node: GbasNode, station: GroundParams) -> None:
    for spec, value in station.shown():
        if spec.key != _RECEIVERS:  # one parameter a receiver, below
            node.declare_read_only(PREFIX + spec.key, value, spec.doc)
    for number, position in enumerate(station.receiver_ecef_m, start=1):
        key = f"{PREFIX}receivers.rr{number}_ecef_m"
        node.declare_read_only(key, tuple(float(each) for each in position), "antenna position, ECEF [m]")
