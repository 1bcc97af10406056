"""The studies there are.

A study is a module with ``reproduce(options: Options) -> Reproduction``. To add one, enter it in :data:`MODULES`; it is
offered as soon as its module exists.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, cast

from gbas_studies.reproduction.items import Reproduction, Section

MODULES: Final[dict[str, str]] = {
    "ccd": "gbas_studies.ccd.reproduction",
    "asigm": "gbas_studies.asigm.reproduction",
    "modes": "gbas_studies.modes.reproduction",
    "abia": "gbas_studies.abia.reproduction",
}
ALL: Final = "all"


class UnknownStudy(ValueError):
    """A name that is no study's."""


def _silent(_: str) -> None:
    """Progress nobody wants to see."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run.

    Attributes
    ----------
    data : Path or None
        Folder of recorded data; None: what needs it is left out, and says so.
    quick : bool
        Smaller campaigns: less exact, and the report says so.
    seed : int
        Of everything random; the same seed gives the same report.
    progress : callable
        Told what is being done now.
    """

    data: Path | None = None
    quick: bool = False
    seed: int = 1
    progress: Callable[[str], None] = _silent

    def made(self, steps: Mapping[str, Callable[[], Section]]) -> list[Section]:
        """Sections, one after another, with progress told by their names."""
        sections = []
        for name, make in steps.items():
            self.progress(name)
            sections.append(make())
        return sections


Study = Callable[[Options], Reproduction]


def studies() -> tuple[str, ...]:
    """Names of the studies that can be run, in the order of :data:`MODULES`."""
    return tuple(name for name, module in MODULES.items() if _exists(module))


def run(name: str, options: Options) -> list[Reproduction]:
    """Run one study, or all of them.

    Parameters
    ----------
    name : str
        One of :func:`studies`, or ``"all"``.
    options : Options

    Raises
    ------
    UnknownStudy
        For another name.
    """
    offered = studies()
    if not offered:
        raise UnknownStudy("there is no study in this installation")
    if name != ALL and name not in offered:
        raise UnknownStudy(f"study {name!r} is not one of {', '.join((*offered, ALL))}")
    return [_study(each)(options) for each in (offered if name == ALL else (name,))]


def _study(name: str) -> Study:
    return cast(Study, importlib.import_module(MODULES[name]).reproduce)


def _exists(module: str) -> bool:
    """Whether a module is there; its package need not be."""
    package = module.rpartition(".")[0]
    return importlib.util.find_spec(package) is not None and importlib.util.find_spec(module) is not None
