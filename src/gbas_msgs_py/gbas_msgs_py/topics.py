"""Topic names of the suite.

Nodes live in the namespace ``/gbas`` unless told otherwise. What belongs to one aircraft or to one station is a
relative name, so it moves with the node's namespace; what all share is absolute, so it does not::

    relative  ground/..., airborne/..., truth/..., progress/...   ->  /gbas/airborne/solution
    absolute  /gbas/vdb, /gbas/ephemeris, /gbas/events, /gbas/schemas, /clock, /diagnostics

A second aircraft is a second namespace: ``--ros-args -r __ns:=/gbas/second`` on its receiver's nodes gives
``/gbas/second/airborne/observations`` and so on, while it listens to the same ``/gbas/vdb``. A second station besides a
second namespace needs its radio remapped: ``-r /gbas/vdb:=/north/vdb``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS

DEFAULT_NAMESPACE: Final = "/gbas"

# Relative to the node's namespace.
GROUND_OBSERVATIONS: Final[tuple[str, ...]] = tuple(
    f"ground/rr{j}/observations" for j in range(1, MAX_REFERENCE_RECEIVERS + 1)
)
GROUND_INTEGRITY: Final = "ground/integrity"
GROUND_MONITORS: Final = "ground/monitors"
GROUND_MONITOR_DETAILS: Final = "ground/monitor_details"
GROUND_CHANNELS: Final = "ground/channels"
AIRBORNE_OBSERVATIONS: Final = "airborne/observations"
AIRBORNE_EPHEMERIS: Final = "airborne/ephemeris"
"""What the aircraft received where that differs from the station: remap ``/gbas/ephemeris`` of its receiver to it."""
AIRBORNE_SOLUTION: Final = "airborne/solution"
AIRBORNE_PROTECTION: Final = "airborne/protection_levels"
AIRBORNE_MODES: Final = "airborne/modes"
AIRBORNE_FIX: Final = "airborne/fix"
AIRBORNE_VPL: Final = "airborne/vpl"
AIRBORNE_LPL: Final = "airborne/lpl"
AIRBORNE_VAL: Final = "airborne/val"
AIRBORNE_LAL: Final = "airborne/lal"
AIRBORNE_SERVICE: Final = "airborne/service"
TRUTH_AIRBORNE: Final = "truth/airborne"
PROGRESS_PREFIX: Final = "progress/"

# Shared by all.
EPHEMERIS: Final = "/gbas/ephemeris"
VDB: Final = "/gbas/vdb"
EVENTS: Final = "/gbas/events"
SCHEMAS: Final = "/gbas/schemas"
CLOCK: Final = "/clock"
DIAGNOSTICS: Final = "/diagnostics"


def resolve(name: str, namespace: str = DEFAULT_NAMESPACE) -> str:
    """Full topic name of `name` for a node in `namespace`; an absolute name stays as it is."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def progress(node: str) -> str:
    """Topic on which a node says which epoch it has finished; an absolute name is taken as it is."""
    return node if node.startswith("/") else f"{PROGRESS_PREFIX}{node}"


@dataclass(frozen=True, kw_only=True)
class TopicSpec:
    """What travels on a topic.

    Attributes
    ----------
    name : str
        As above: relative or absolute.
    message_type : str
        ROS interface name.
    schema : str or None
        Schema of the payload, ``gbas/<name>/<version>``; None for a standard message that says all itself.
    latched : bool
        Transient local: a late reader gets what was published before.
    """

    name: str
    message_type: str
    schema: str | None = None
    latched: bool = False


_TABLE: Final = "std_msgs/msg/Float64MultiArray"
_FLOAT: Final = "std_msgs/msg/Float64"
_STRING: Final = "std_msgs/msg/String"

TOPICS: Final[tuple[TopicSpec, ...]] = (
    *(TopicSpec(name=n, message_type=_TABLE, schema="gbas/observations/1") for n in GROUND_OBSERVATIONS),
    TopicSpec(name=AIRBORNE_OBSERVATIONS, message_type=_TABLE, schema="gbas/observations/1"),
    TopicSpec(name=EPHEMERIS, message_type=_TABLE, schema="gbas/ephemeris/1", latched=True),
    TopicSpec(name=AIRBORNE_EPHEMERIS, message_type=_TABLE, schema="gbas/ephemeris/1", latched=True),
    TopicSpec(name=GROUND_INTEGRITY, message_type=_TABLE, schema="gbas/integrity/3"),
    TopicSpec(name=GROUND_MONITORS, message_type=_TABLE, schema="gbas/monitors/2"),
    TopicSpec(name=GROUND_MONITOR_DETAILS, message_type=_TABLE, schema="gbas/monitor_details/1"),
    TopicSpec(name=GROUND_CHANNELS, message_type=_TABLE, schema="gbas/channels/1"),
    TopicSpec(name=VDB, message_type="std_msgs/msg/UInt8MultiArray", schema="gbas/vdb_burst/1"),
    TopicSpec(name=AIRBORNE_SOLUTION, message_type=_TABLE, schema="gbas/solution/2"),
    TopicSpec(name=AIRBORNE_PROTECTION, message_type=_TABLE, schema="gbas/protection/2"),
    TopicSpec(name=AIRBORNE_MODES, message_type=_TABLE, schema="gbas/modes/1"),
    TopicSpec(name=AIRBORNE_FIX, message_type="sensor_msgs/msg/NavSatFix"),
    *(TopicSpec(name=n, message_type=_FLOAT) for n in (AIRBORNE_VPL, AIRBORNE_LPL, AIRBORNE_VAL, AIRBORNE_LAL)),
    TopicSpec(name=AIRBORNE_SERVICE, message_type="std_msgs/msg/UInt8"),
    TopicSpec(name=TRUTH_AIRBORNE, message_type=_TABLE, schema="gbas/truth/2"),
    TopicSpec(name=EVENTS, message_type=_STRING, schema="gbas/event/1"),
    TopicSpec(name=SCHEMAS, message_type=_STRING, schema="gbas/schemas/1", latched=True),
    TopicSpec(name=CLOCK, message_type="rosgraph_msgs/msg/Clock"),
    TopicSpec(name=DIAGNOSTICS, message_type="diagnostic_msgs/msg/DiagnosticArray"),
)
"""Every topic of the suite except ``progress/<node>``, which is one a node (``gbas/progress/1``)."""
