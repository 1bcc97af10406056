"""Where the package's configuration and launch files are, however it was installed."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from gbas_core.errors import ConfigError

PACKAGE = "gbas_bringup"


def config_path(name: str) -> Path:
    """A file of ``config/``: in the source tree, else in the share folder of a pip or colcon installation.

    Raises
    ------
    ConfigError
        When the package has no such file.
    """
    return _resource("config", name)


def named_config(name: str) -> Path:
    """A configuration file by its path, or one of :func:`configurations` by its name with or without ``.yaml``.

    Raises
    ------
    ConfigError
        When there is neither.
    """
    path = Path(name)
    if path.is_file() or len(path.parts) > 1:
        return path
    known = {each.stem: each for each in configurations()}
    if path.name.removesuffix(".yaml") in known:
        return known[path.name.removesuffix(".yaml")]
    raise ConfigError(name, f"there is no such file, and it is none of {', '.join(sorted(known))}")


def configurations() -> tuple[Path, ...]:
    """Files of ``config/`` and ``config/scenarios/``."""
    return (*resources("config", "*.yaml"), *resources("config/scenarios", "*.yaml"))


def resources(folder: str, pattern: str) -> tuple[Path, ...]:
    """Files of a folder of the package, by name."""
    for root in _roots():
        if found := sorted((root / folder).glob(pattern)):
            return tuple(found)
    return ()


def _resource(folder: str, name: str) -> Path:
    for root in _roots():
        if (root / folder / name).is_file():
            return root / folder / name
    raise ConfigError(name, f"is not in the {folder} folder of {PACKAGE}")


def _roots() -> tuple[Path, ...]:
    places = (Path(__file__).resolve().parents[1], Path(sys.prefix) / "share" / PACKAGE, _ament_share())
    return tuple(place for place in places if place is not None)


def _ament_share() -> Path | None:
    from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

    try:
        return Path(get_package_share_directory(PACKAGE))
    except (PackageNotFoundError, LookupError, OSError):  # not found, or no AMENT_PREFIX_PATH
        return None


def data_folder() -> Path | None:
    """Folder of recorded data named by ``GBAS_DATA``."""
    named = os.environ.get("GBAS_DATA")
    return Path(named) if named else None
