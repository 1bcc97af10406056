"""What a topic is, by its full name in whatever namespace."""

from __future__ import annotations

import re
from typing import Final

from gbas_msgs_py import topics

_OBSERVATIONS: Final = re.compile(r".*/observations$")
_TRUTH: Final = re.compile(r".*/truth/[^/]+$")
_RELATIVE: Final = tuple(spec.name for spec in topics.TOPICS if not spec.name.startswith("/"))


def split(topic: str) -> tuple[str, str]:
    """Namespace, and the name by which the contract knows a topic; an empty namespace if it does not know it."""
    for name in _RELATIVE:
        if topic.endswith(f"/{name}"):
            return topic[: -len(name) - 1], name
    return "", topic


def contract_name(topic: str) -> str:
    """The name by which the contract knows a topic; the topic itself if it does not."""
    return split(topic)[1]


def is_observation(topic: str) -> bool:
    """Whether a topic carries the observations of a receiver."""
    return _OBSERVATIONS.match(topic) is not None


def is_ephemeris(topic: str) -> bool:
    """Whether a topic carries broadcast ephemerides."""
    return topic == topics.EPHEMERIS or topic.endswith(f"/{topics.AIRBORNE_EPHEMERIS}")


def is_truth(topic: str) -> bool:
    """Whether a topic says what only a simulator knows."""
    return _TRUTH.match(topic) is not None


def is_progress(topic: str) -> bool:
    """Whether a topic says how far a node is."""
    return f"/{topics.PROGRESS_PREFIX}" in topic
