"""Which suite makes the trials.

A version number stays while its code changes, and results of two states of the code do not belong together. So the
version of a campaign has a hash of all sources that a trial may run.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from importlib.metadata import requires, version
from importlib.util import find_spec
from pathlib import Path

_PACKAGE = "gbas_studies"
_LIBRARIES = ("numpy", "scipy", "numba", "sidereon")


@cache
def suite_version() -> str:
    """Version and hash of the sources of this package and those it rests on, such as ``0.1.0+5d41402abc4b``."""
    total = hashlib.sha256()
    for package in sorted(_with_those_below(_PACKAGE)):
        spec = find_spec(package)
        assert spec is not None
        assert spec.submodule_search_locations is not None
        folder = Path(next(iter(spec.submodule_search_locations)))
        for path in sorted(folder.rglob("*.py"), key=lambda each: each.relative_to(folder).as_posix()):
            name = f"{package}/{path.relative_to(folder).as_posix()}"
            total.update(f"{name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return f"{version(_PACKAGE)}+{total.hexdigest()[:12]}"


@cache
def library_versions() -> dict[str, str]:
    """Versions of the libraries that the last bits of a result hang on."""
    return {name: version(name) for name in _LIBRARIES}


def _with_those_below(package: str, seen: frozenset[str] = frozenset()) -> frozenset[str]:
    found = seen | {package}
    for requirement in requires(package) or ():
        match = re.match(r"gbas[-_]\w+", requirement)
        if match and (name := match[0].replace("-", "_")) not in found:
            found = _with_those_below(name, found)
    return found
