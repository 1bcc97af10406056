"""Configuration files: YAML, with what a file is based on, with or without the wrapping of ROS parameter files.

A file may say ``base: FILE`` beside its sections: it then holds only what differs from that file, which is looked for
beside it; a key without a value takes the file's away. A key that stands twice in one section is an error.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_core.parameters import ParameterError, merged, nested

BASE: Final = "base"
_MOST_BASES: Final = 8
_ROS_WRAPPING: Final = ("/**", "ros__parameters")


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """A configuration file and what it is based on.

    Attributes
    ----------
    layers : tuple of (Path, mapping)
        The file itself first, then the file it is based on, and so on; without ``base``.
    """

    layers: tuple[tuple[Path, Mapping[str, Any]], ...]

    @property
    def path(self) -> Path:
        """The file itself."""
        return self.layers[0][0]

    @property
    def files(self) -> tuple[Path, ...]:
        """All files read, itself first."""
        return tuple(path for path, _ in self.layers)

    def content(self) -> dict[str, Any]:
        """The whole of it, keys without a value taken away."""
        contents = [content for _, content in reversed(self.layers)]
        return _without_none(functools.reduce(merged, contents, {}))

    def sections(self) -> dict[str, Any]:
        """Sections of parameters: the content without the wrapping of a ROS parameter file (``/**``)."""
        return nested(unwrapped(self.content()))

    def section(self, name: str) -> dict[str, Any]:
        """One section.

        Raises
        ------
        ParameterError
            When there is none of that name, or it is not one.
        """
        found = self.sections().get(name)
        if not isinstance(found, Mapping):
            raise ParameterError(f"{self.path}: has no section '{name}'")
        return dict(found)

    def origin(self, key: str) -> Path | None:
        """File that gives a dotted key its value, such as ``ground.ccd.tau_s``; None: no file does."""
        for path, content in self.layers:
            place: Any = nested(unwrapped(content))
            for each in key.split("."):
                place = place.get(each, ...) if isinstance(place, Mapping) else ...
            if place is not ...:
                return path
        return None


def read_configuration(path: str | Path) -> Configuration:
    """A YAML file of sections with the files it is based on.

    Raises
    ------
    ParameterError
        Naming the file that cannot be read, is not YAML, holds no sections, has a key twice, or a base that is no file
        or leads back to itself.
    """
    layers: list[tuple[Path, Mapping[str, Any]]] = []
    place: Path | None = Path(path)
    while place is not None:
        own = _load(place)
        base = own.get(BASE)
        if base is not None and (not isinstance(base, str) or len(layers) >= _MOST_BASES):
            raise ParameterError(f"{place}: {BASE} = {base!r} is not a file, or files are based on each other")
        layers.append((place, {key: value for key, value in own.items() if key != BASE}))
        place = None if base is None else Path(os.path.normpath(place.parent / base))
    return Configuration(layers=tuple(layers))


def unwrapped(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Sections of a document, with or without ``/**: ros__parameters:`` around them."""
    for key in _ROS_WRAPPING:
        inner = document.get(key)
        if isinstance(inner, Mapping):
            document = inner
    return document


def _without_none(section: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in section.items()
        if value is not None
    }


class _UniqueKeys(yaml.SafeLoader):
    """Loader that refuses a key that stands twice: one of the two values would be lost in silence."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key_node.tag != "tag:yaml.org,2002:merge" and key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} stands twice in a section", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


def _load(path: Path) -> Mapping[str, Any]:
    try:
        document = yaml.load(path.read_text(encoding="utf-8"), Loader=_UniqueKeys)
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ParameterError(f"{path}: is not a text file") from None
    except yaml.YAMLError as error:
        raise ParameterError(f"{path}: is not YAML: {_one_line(error)}") from None
    if not isinstance(document, Mapping):
        raise ParameterError(f"{path}: holds no sections of parameters")
    return document


def _one_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""
    return f"{where}{getattr(error, 'problem', None) or error}".replace("\n", " ")
