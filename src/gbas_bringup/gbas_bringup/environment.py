"""What the processes of the suite need in their environment, and domains that nobody else is using."""

from __future__ import annotations

import fcntl
import os
import socket
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from gbas_core.errors import GbasError
from gbas_node.transport import use_profile

MAX_DOMAIN: Final = 232
_FREE_DOMAINS: Final = range(20, 100)
"""Domains that are given out; their ports lie below those the system gives to programs at random (32768 and up)."""
_held: Final = ExitStack()
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


@contextmanager
def held_domain() -> Iterator[int]:
    """A ROS domain in which nothing runs on this machine, so that a run neither disturbs nor is disturbed.

    A lock keeps others of the suite from taking it as well while it is held.

    Raises
    ------
    GbasError
        When all are taken.
    """
    folder = Path(tempfile.gettempdir()) / f"gbas-domains-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    start = os.getpid() % len(_FREE_DOMAINS)
    for domain in (*_FREE_DOMAINS[start:], *_FREE_DOMAINS[:start]):
        with (folder / str(domain)).open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            if not _in_use(domain):
                yield domain
                return
    last = _FREE_DOMAINS[-1]
    raise GbasError(f"every ROS domain from {_FREE_DOMAINS[0]} to {last} is in use on this machine; give one: --domain")


def free_domain() -> int:
    """A domain of :func:`held_domain` that this process holds to its end."""
    return _held.enter_context(held_domain())


def _in_use(domain: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", _DISCOVERY_PORT + _PORTS_A_DOMAIN * domain))
        except OSError:
            return True
    return False
