"""Which nodes a configuration file starts. The file is an ordinary ROS parameter file.

Every section that names a node of the suite starts it: ``/gbas/positioning`` in the usual namespace,
``/gbas/second/positioning`` as that of a second aircraft. Beside these, parameters for all (``/**``) start what they
are for: ``ground`` the ground station, ``airborne`` the receiver, ``sim`` the simulator. The recorder is added by
whoever runs the file.

A file with ``base: FILE`` beside its sections holds only what differs from that file, which is looked for beside it.
ROS does not know this: a run writes the whole of it into its folder, and its nodes read that.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance, Stage
from gbas_core.configuration import Configuration, read_configuration
from gbas_core.errors import ConfigError
from gbas_core.parameters import ParameterError
from gbas_msgs_py.topics import DEFAULT_NAMESPACE

_PARAMETERS: Final = "ros__parameters"
_ALL: Final = "/**"
_SECTIONS: Final = {kind.needs for kind in NODE_KINDS.values() if kind.needs}
MODELINE: Final = "# yaml-language-server:"
"""Begin of the comment that tells editors the schema of a file."""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """A parameter file and the nodes it starts.

    Attributes
    ----------
    path : Path
    nodes : tuple of NodeInstance
        In order of their stages.
    parameters : mapping of str to mapping
        Parameters by full node name; those for all under ``"/**"``.
    whole : str
        Text of the file with what it is based on, when it is; empty otherwise.
    """

    path: Path
    nodes: tuple[NodeInstance, ...]
    parameters: Mapping[str, Mapping[str, Any]]
    whole: str = ""

    def written(self, directory: Path) -> RunConfig:
        """The same with everything in one ROS parameter file: in the folder, if it is not so already."""
        if not self.whole:
            return self
        directory.mkdir(parents=True, exist_ok=True)
        path = directory / self.path.name
        path.write_text(self.whole, encoding="utf-8")
        return replace(self, path=path, whole="")

    @property
    def drivers(self) -> tuple[NodeInstance, ...]:
        """Nodes that drive time."""
        return tuple(node for node in self.nodes if node.kind.stage is Stage.DRIVER)

    def with_nodes(self, *, driver: NodeInstance | None = None, recorder: bool = True) -> RunConfig:
        """The same with another driver in place of its own, and with a recorder or without."""
        kept = [node for node in self.nodes if node.kind.stage is not Stage.RECORDER]
        if driver is not None:
            kept = [driver, *(node for node in kept if node.kind.stage is not Stage.DRIVER)]
        if recorder:
            kept.append(NodeInstance(kind=NODE_KINDS["recorder"]))
        return replace(self, nodes=tuple(sorted(kept, key=lambda node: node.kind.stage)))

    def given(self, node: NodeInstance, name: str) -> bool:
        """Whether the file sets a parameter of a node."""
        return self.value(node, name) is not None

    def value(self, node: NodeInstance, name: str) -> Any:
        """What the file sets a parameter of a node to; None if it does not."""
        for section in (node.full_name, f"/**/{node.kind.name}", _ALL):
            if name in self.parameters.get(section, {}):
                return self.parameters[section][name]
        return None

    @property
    def files(self) -> dict[str, str]:
        """Further configuration files that nodes read (their parameter ``config``), by full node name."""
        named = {node.full_name: self.value(node, "config") for node in self.nodes}
        return {name: file for name, file in named.items() if isinstance(file, str) and file}


def read_run_config(path: Path) -> RunConfig:
    """Read a configuration file.

    Raises
    ------
    ConfigError
        When it cannot be read, is not a ROS parameter file, names an unknown node, or has not one driver of time.
    """
    configuration = _read(path)
    _, document = configuration.layers[0]
    whole = ""
    if len(configuration.layers) > 1:
        document = configuration.content()
        whole = _heading(path) + yaml.safe_dump(document, sort_keys=False, width=120)
    if plain := [name for name in document if name in _SECTIONS]:
        where = f"below '{_ALL}: {_PARAMETERS}:'"
        raise ConfigError(path, f"stands at the top of the file, where nodes do not read it; put it {where}", plain[0])
    parameters = dict(named_sections(document, path))
    nodes = {node.full_name: node for node in _named(parameters, path)}
    for node in _implied(parameters, has_driver=any(n.kind.stage is Stage.DRIVER for n in nodes.values())):
        if not any(known.kind == node.kind for known in nodes.values()):
            nodes[node.full_name] = node
    ordered = tuple(sorted(nodes.values(), key=lambda node: node.kind.stage))
    if not ordered:
        known = ", ".join(f"{DEFAULT_NAMESPACE}/{name}" for name in NODE_KINDS)
        raise ConfigError(path, f"starts no node; sections may be ground, airborne, sim, or one of {known}")
    return RunConfig(path=path, nodes=ordered, parameters=parameters, whole=whole)


def one_driver(config: RunConfig) -> NodeInstance:
    """The node that drives time.

    Raises
    ------
    ConfigError
        When there is none, or more than one.
    """
    if len(config.drivers) != 1:
        names = " and ".join(node.label for node in config.drivers) or "none"
        kinds = ", ".join(name for name, kind in NODE_KINDS.items() if kind.stage is Stage.DRIVER)
        raise ConfigError(config.path, f"exactly one of {kinds} must drive time, and it starts {names}")
    return config.drivers[0]


def _read(path: Path) -> Configuration:
    try:
        return read_configuration(path)
    except ParameterError as error:
        raise ConfigError(path, str(error).removeprefix(f"{path}: ")) from None


def _heading(path: Path) -> str:
    """Comment at the head of a configuration file, and where it comes from."""
    head = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    kept = [line for line in head if not line.startswith(MODELINE)]  # the schema is not beside the file that is written
    return "\n".join([*kept, f"# Written from {path.name} and what it is based on."]) + "\n"


def named_sections(
    document: Mapping[str, Any], path: Path, prefix: str = ""
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Full node name and parameters of each section; namespaces may be written as levels of their own."""
    for key, value in document.items():
        name = f"{prefix}/{str(key).strip('/')}"
        if not isinstance(value, Mapping):
            raise ConfigError(path, f"is {value!r}, expected '{_PARAMETERS}:' below it", str(key))
        if _PARAMETERS in value:
            parameters = value[_PARAMETERS] or {}
            if not isinstance(parameters, Mapping):
                raise ConfigError(path, f"is {parameters!r}, expected names and values", f"{key}.{_PARAMETERS}")
            yield name, parameters
        else:
            yield from named_sections(value, path, name)


def _named(parameters: Mapping[str, Any], path: Path) -> Iterator[NodeInstance]:
    for full_name in parameters:
        if full_name == _ALL:
            continue
        namespace, _, name = full_name.rpartition("/")
        if name not in NODE_KINDS:
            near = difflib.get_close_matches(name, NODE_KINDS, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(NODE_KINDS)}"
            raise ConfigError(path, f"is no node of the suite; {hint}", full_name)
        if namespace == _ALL:
            namespace = DEFAULT_NAMESPACE
        if not f"{namespace}/".startswith(f"{DEFAULT_NAMESPACE}/"):
            raise ConfigError(path, f"its name must be {DEFAULT_NAMESPACE}/{name}, or ROS will not find it", full_name)
        yield NodeInstance(kind=NODE_KINDS[name], namespace=namespace)


def _implied(parameters: Mapping[str, Mapping[str, Any]], *, has_driver: bool) -> Iterator[NodeInstance]:
    """Nodes for which there are parameters among those for all."""
    shared = {str(name).partition(".")[0] for name in parameters.get(_ALL, {})}
    for kind in NODE_KINDS.values():
        if kind.needs in shared and not (kind.stage is Stage.DRIVER and has_driver):
            yield NodeInstance(kind=kind)


def speed_of(text: str) -> float:
    """Speed of a run: ``max`` or a multiple of real time.

    Raises
    ------
    ValueError
        For anything else.
    """
    if text == "max":
        return 0.0
    try:
        speed = float(text)
    except ValueError:
        speed = -1.0
    if not 0.0 < speed <= 1e6:
        raise ValueError(f"{text!r} is neither 'max' nor a multiple of real time above 0, up to 1e6")
    return speed
