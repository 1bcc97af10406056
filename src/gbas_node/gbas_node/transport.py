"""Settings of the middleware that every process of the suite uses (see ``fastdds.xml``)."""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path
from typing import Final

PROFILE_VARIABLE: Final = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE_FILE: Final = Path(__file__).with_name("fastdds.xml")


def use_profile(environment: MutableMapping[str, str]) -> None:
    """Name the suite's transport profile in `environment`, unless it names one already.

    Takes effect in a process that has not made a node yet, and in processes started with this environment.
    """
    if not environment.get(PROFILE_VARIABLE) and PROFILE_FILE.is_file():
        environment[PROFILE_VARIABLE] = str(PROFILE_FILE)
