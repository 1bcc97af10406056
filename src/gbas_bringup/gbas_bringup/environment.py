"""What the processes of the suite need in their environment, and domains that nobody else is using."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from gbas_bringup.errors import GbasError
from gbas_msgs_py.transport import use_profile

MAX_DOMAIN: Final = 232
_FREE_DOMAINS: Final = range(20, 102)
"""Domains whose ports lie below those the system gives to programs at random (32768 and up)."""
_DISCOVERY_PORT: Final = 7400
_PORTS_A_DOMAIN: Final = 250


def process_environment(
    *, domain: int | None = None, isolated: bool = False, log_dir: Path | None = None
) -> dict[str, str]:
    """Environment of a process of the suite.

    Parameters
    ----------
    domain : int, optional
        ROS domain; that of this process when not given.
    isolated : bool
        Keep to this machine.
    log_dir : Path, optional
        Where ROS puts its log files.

    Raises
    ------
    GbasError
        For a domain out of range.
    """
    environment = dict(os.environ)
    environment["AMENT_PREFIX_PATH"] = ament_prefix_path(environment)
    environment["PYTHONUNBUFFERED"] = "1"
    environment.setdefault("RCUTILS_COLORIZED_OUTPUT", "0")
    environment.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", "{severity}: {message}")
    use_profile(environment)
    if domain is not None:
        if not 0 <= domain <= MAX_DOMAIN:
            raise GbasError(f"--domain is {domain}, expected 0 to {MAX_DOMAIN}")
        environment["ROS_DOMAIN_ID"] = str(domain)
    if isolated:
        environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if log_dir is not None:
        environment["ROS_LOG_DIR"] = str(log_dir)
    return environment


def ament_prefix_path(environment: Mapping[str, str]) -> str:
    """``AMENT_PREFIX_PATH`` with the virtual environment in it, without which no message type is found."""
    given = [part for part in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    if sys.prefix not in given and (Path(sys.prefix) / "share" / "ament_index").is_dir():
        given.append(sys.prefix)
    return os.pathsep.join(given)


def free_domain() -> int:
    """A ROS domain in which nothing runs on this machine, so that a run neither disturbs nor is disturbed."""
    count = len(_FREE_DOMAINS)
    start = os.getpid() % count
    for step in range(count):
        domain = _FREE_DOMAINS[(start + step) % count]
        if not _in_use(domain):
            return domain
    return _FREE_DOMAINS[start]


def _in_use(domain: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", _DISCOVERY_PORT + _PORTS_A_DOMAIN * domain))
        except OSError:
            return True
    return False
