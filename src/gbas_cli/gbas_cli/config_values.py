"""Effective values of a configuration file: what a run of it would have, and where each value came from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import partial, reduce
from pathlib import Path
from typing import Any, Final

from gbas_airborne.params import airborne_section
from gbas_bringup.launcher import RunPlan, launch_parameters
from gbas_bringup.node_kinds import NodeInstance
from gbas_bringup.run_config import RunConfig, named_sections, one_driver, read_run_config
from gbas_cli.config_sections import SECTIONS, Section, Sections, node_model
from gbas_core.configuration import Configuration, read_configuration, unwrapped
from gbas_core.errors import ConfigError
from gbas_core.parameters import Declared, ParameterError, declared, from_mapping, merged, nested

ALL_NODES: Final = "/**"
DEFAULT: Final = "default"
BY_RUN: Final = "set by the run"
_OF_ROS: Final = ("use_sim_time", "qos_overrides")
_FILES: Final = ("ground_files", "user_file", "nav_files", "user_nav_files")
"""Parameters of nodes that name files to read."""


@dataclass(frozen=True, kw_only=True)
class Value:
    """One effective value, in the file's unit, and where it came from: a file, ``default``, or the run itself."""

    declared: Declared
    source: str

    @property
    def given(self) -> bool:
        """Whether a file sets it."""
        return self.source not in (DEFAULT, BY_RUN)


@dataclass(frozen=True, kw_only=True)
class Effective:
    """A configuration as a run would have it.

    Attributes
    ----------
    path : Path
    files : tuple of Path
        Every file that was read, the configuration itself first.
    nodes : tuple of str
        Labels of the nodes it starts, in the order of their stages; none: it is used together with others.
    values : mapping
        By section, or full name of a node for the parameters of its own.
    lacking : tuple of str
        What a file that starts nothing leaves to others, in the words of the error it would be.
    """

    path: Path
    files: tuple[Path, ...]
    nodes: tuple[str, ...]
    values: Mapping[str, tuple[Value, ...]]
    lacking: tuple[str, ...] = ()


def effective(path: Path, *, start: bool = False) -> Effective:
    """Read a configuration file as a run would.

    Parameters
    ----------
    path : Path
    start : bool
        Do also what nodes do at their start with what they are told: make the simulated world, look for recorded files.

    Raises
    ------
    ParameterError, ScenarioError, GbasError
        For whatever a run would refuse at its start, naming file, key, value and bound.
    """
    configuration = read_configuration(path)
    if not _is_plain(configuration):
        config = read_run_config(path)
        if config.drivers:
            one_driver(config)
            return _Run(configuration, config, start=start).effective()
    return _sections_only(configuration)


def _is_plain(configuration: Configuration) -> bool:
    """Whether sections stand at the top of the file, without the wrapping of a ROS parameter file."""
    content = configuration.content()
    return unwrapped(content) is content and bool(set(nested(content)) & set(SECTIONS))


def _sections_only(configuration: Configuration) -> Effective:
    """A file that starts nothing: each section it has is checked by itself, and may leave something to others."""
    path, sections = configuration.path, configuration.sections()
    if unknown := [name for name in sections if name not in SECTIONS]:
        raise ConfigError(path, f"is no section; known are {', '.join(SECTIONS)}", unknown[0])
    values: dict[str, tuple[Value, ...]] = {}
    shown: Iterable[Declared]
    lacking = []
    for name, section in SECTIONS.items():
        if name not in sections:
            continue
        try:
            params = section.make({each: _mapping(sections, each, path) for each in section.reads}, str(path))
        except ParameterError as error:
            if not error.missing:
                raise
            lacking.append(f"{name}: {str(error).removeprefix(f'{path}: ')}")
            shown = _as_far_as_given(section, _mapping(sections, name, path))
        else:
            shown = section.shown(params, sections)
        values[name] = tuple(_sourced(name, each, partial(_origin, configuration)) for each in shown)
    return Effective(path=path, files=configuration.files, nodes=(), values=values, lacking=tuple(lacking))


def _as_far_as_given(section: Section, given: Mapping[str, Any]) -> Iterator[Declared]:
    """Values of a section that is not whole."""
    for each in declared(section.models[0]):
        if _has(given, each.key):
            yield replace(each, value=_at(given, each.key))
        elif each.value is not MISSING:
            yield each


def _sourced(name: str, item: Declared, origin: Callable[[str], str]) -> Value:
    """A value of a section with where it came from, be it another section's key."""
    source, other = origin(f"{name}.{item.key}"), SECTIONS[name].taken.get(item.key)
    return Value(declared=item, source=origin(other) if source == DEFAULT and other is not None else source)


def _mapping(sections: Mapping[str, Any], name: str, path: Path) -> Mapping[str, Any]:
    found = sections.get(name, {})
    if not isinstance(found, Mapping):
        raise ParameterError(f"{path}: {name} = {found!r} is not a section of keys")
    return found


def _origin(configuration: Configuration, key: str) -> str:
    found = configuration.origin(key)
    return DEFAULT if found is None else str(found)


class _Run:
    """A configuration that starts nodes, with what its run would tell them."""

    def __init__(self, configuration: Configuration, config: RunConfig, *, start: bool) -> None:
        self.path = configuration.path
        self.config = config.with_nodes()
        self.start = start
        self.files = list(configuration.files)
        self.by_run = launch_parameters(RunPlan(config=self.config, directory=Path("out") / self.path.stem))
        self.layers = [
            (path, {name: nested(keys) for name, keys in named_sections(content, path)})
            for path, content in configuration.layers
        ]
        self.configs: dict[str, Configuration] = {}

    def effective(self) -> Effective:
        values: dict[str, tuple[Value, ...]] = {}
        for node in self.config.nodes:
            given = self.given(node)
            values[node.full_name] = self.own(node, given)
            needed = node.kind.needs
            if not needed:
                continue
            found = self.section(node, needed, given)
            if needed in values and values[needed] != found:
                values[f"{node.full_name}, {needed}"] = found  # told otherwise than the node before
            else:
                values[needed] = found
        order = sorted(values, key=lambda name: (name not in SECTIONS, [*SECTIONS, name].index(name)))
        return Effective(
            path=self.path,
            files=tuple(dict.fromkeys(self.files)),
            nodes=tuple(node.label for node in self.config.nodes),
            values={name: values[name] for name in order},
        )

    def given(self, node: NodeInstance) -> dict[str, Any]:
        """What the file tells a node."""
        told = [self.config.parameters.get(place, {}) for place in reversed(_places(node))]
        return _without_none(reduce(merged, (nested(each) for each in told), {}))

    def own(self, node: NodeInstance, given: Mapping[str, Any]) -> tuple[Value, ...]:
        """The node's own parameters."""
        by_run = self.by_run[node.full_name]
        own = {key: value for key, value in given.items() if key not in SECTIONS and key not in _OF_ROS}
        model = node_model(node.kind.name)
        params = from_mapping(model, {**own, **by_run}, source=str(self.path), section=node.full_name)
        if self.start:
            _look_for_files(params, node, self.path)
        return tuple(
            Value(declared=each, source=BY_RUN if each.key in by_run else self.origin(node, each.key))
            for each in declared(params)
        )

    def section(self, node: NodeInstance, name: str, given: Mapping[str, Any]) -> tuple[Value, ...]:
        """A section as a node has it: of the file named by ``config``, and what the node is told over it."""
        section, file = SECTIONS[name], given.get("config", "")
        source = file or str(self.path)
        below = self.sections_of(file, name) if file else {}
        over = {each: _mapping(given, each, self.path) for each in section.reads}
        sections: Sections = {each: merged(below.get(each, {}), over[each]) for each in section.reads}
        params = section.make(sections, source)
        if self.start:
            section.start(params, source)
        origin = partial(self.origin, node, config=file)
        return tuple(_sourced(name, each, origin) for each in section.shown(params, sections))

    def sections_of(self, file: str, name: str) -> dict[str, Any]:
        """Sections of a file named by ``config``."""
        if file not in self.configs:
            self.configs[file] = read_configuration(file)
            self.files += self.configs[file].files
        if name == "airborne":
            return {name: airborne_section(file)}
        sections = self.configs[file].sections()
        return {each: _mapping(sections, each, Path(file)) for each in sections if each in SECTIONS}

    def origin(self, node: NodeInstance, key: str, config: str = "") -> str:
        """Where a value came from."""
        for place in _places(node):
            for path, sections in self.layers:
                if _has(sections.get(place, {}), key):
                    return str(path)
        return _origin(self.configs[config], key) if config else DEFAULT


def _places(node: NodeInstance) -> tuple[str, ...]:
    """Sections of a ROS parameter file that a node reads, the one that counts most first."""
    return (node.full_name, f"{ALL_NODES}/{node.kind.name}", ALL_NODES)


def _has(section: Any, key: str) -> bool:
    return _at(section, key) is not ...


def _at(section: Any, key: str) -> Any:
    """Value of a dotted key; an ellipsis where there is none."""
    for each in key.split("."):
        section = section.get(each, ...) if isinstance(section, Mapping) else ...
    return section


def _without_none(section: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in section.items()
        if value is not None
    }


def _look_for_files(params: Any, node: NodeInstance, path: Path) -> None:
    for key, file in _named_files(params):
        if not Path(file).is_file():
            raise ConfigError(path, f"{key} = {file!r} is no file", node.full_name)
    bag = getattr(params, "bag", None)
    if bag is not None and not Path(bag).exists():
        raise ConfigError(path, f"bag = {bag!r} is no bag", node.full_name)


def _named_files(params: Any) -> Iterator[tuple[str, str]]:
    for key in _FILES:
        named = getattr(params, key, ())
        yield from ((key, file) for file in ((named,) if isinstance(named, str) else named) if file)
