"""The station's parameters as the ground nodes get them: a file, ROS parameters over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from gbas_ground.params import GroundParams, ground_section, parameter_specs
from gbas_msgs_py.node import GbasNode
from gbas_msgs_py.parameters import ParameterError

PREFIX = "ground."


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
    for name, spec, _ in parameter_specs():
        if name != "receiver_ecef_m":
            node.declare_read_only(PREFIX + spec.key, _shown(getattr(station, name), spec.per_unit), spec.doc)
    for number, position in enumerate(station.receiver_ecef_m, start=1):
        key = f"{PREFIX}receivers.rr{number}_ecef_m"
        node.declare_read_only(key, tuple(float(each) for each in position), "antenna position, ECEF [m]")


def _shown(value: Any, per_unit: float) -> Any:
    if isinstance(value, tuple):
        return tuple(float(each) / per_unit for each in value)
    return value / per_unit if per_unit != 1.0 else value
