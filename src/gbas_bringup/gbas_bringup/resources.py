"""Where the package's configuration and launch files are, however it was installed."""

from __future__ import annotations

import sys
from pathlib import Path

from gbas_bringup.errors import ConfigError

PACKAGE = "gbas_bringup"


def config_path(name: str) -> Path:
    """A file of ``config/``: in the source tree, else in the share folder of a pip or colcon installation.

    Raises
    ------
    ConfigError
        When the package has no such file.
    """
    return _resource("config", name)


def _resource(folder: str, name: str) -> Path:
    roots = [Path(__file__).resolve().parents[1], Path(sys.prefix) / "share" / PACKAGE, _ament_share()]
    for root in roots:
        if root is not None and (root / folder / name).is_file():
            return root / folder / name
    raise ConfigError(name, f"is not in the {folder} folder of {PACKAGE}")


def _ament_share() -> Path | None:
    from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

    try:
        return Path(get_package_share_directory(PACKAGE))
    except (PackageNotFoundError, LookupError, OSError):  # not found, or no AMENT_PREFIX_PATH
        return None
