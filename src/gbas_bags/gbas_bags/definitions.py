"""What a bag says about its topics: message definitions, type hashes and QoS, as rosbag2 writes them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

MESSAGE_ENCODING = "cdr"
SCHEMA_ENCODING = "ros2msg"

_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """The message types of the ROS distribution the suite is built for."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=64)
def definition(msgtype: str) -> tuple[str, str]:
    """Text of a message type with all it depends on, and its RIHS01 hash.

    Raises
    ------
    KeyError
        For a message type the distribution does not have.
    """
    store = typestore()
    if msgtype not in store.fielddefs:
        raise KeyError(msgtype)
    return store.generate_msgdef(msgtype, ros_version=2)[0], store.hash_rihs01(msgtype)


def qos_record(*, depth: int, reliable: bool = True, transient_local: bool = False) -> dict[str, Any]:
    """One entry of ``offered_qos_profiles`` in the form of rosbag2 metadata version 9."""
    return {
        "history": "keep_last",
        "depth": depth,
        "reliability": "reliable" if reliable else "best_effort",
        "durability": "transient_local" if transient_local else "volatile",
        "deadline": dict(_INFINITE),
        "lifespan": dict(_INFINITE),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_INFINITE),
        "avoid_ros_namespace_conventions": False,
    }
