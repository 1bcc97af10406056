"""The tables of the contract: one schema a record type, registered once."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import Record, scalar
from gbas_msgs_py.codes import enumerations
from gbas_msgs_py.modes import AIRBORNE_MONITORS, mode_dictionary
from gbas_msgs_py.monitors import monitor_dictionary
from gbas_msgs_py.products import product_dictionary
from gbas_msgs_py.records import (
    ChannelEpoch,
    IntegrityEpoch,
    ModesEpoch,
    MonitorDetailEpoch,
    MonitorEpoch,
    ProtectionEpoch,
    SolutionEpoch,
)
from gbas_msgs_py.schema import LABEL_PREFIX, SchemaError, TableSchema


@dataclass(frozen=True, kw_only=True, eq=False)
class ProgressEpoch(Record):
    """A node has finished with this epoch: what a driver of the replay counts (flow control)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TruthEpoch(Record):
    """Where the antenna truly was and how the aircraft lay; known to a simulator alone, read by neither end."""

    x_m: float = scalar("m", "ECEF position")
    y_m: float = scalar("m", "ECEF position")
    z_m: float = scalar("m", "ECEF position")
    vx_mps: float = scalar("m/s", "ECEF velocity")
    vy_mps: float = scalar("m/s", "ECEF velocity")
    vz_mps: float = scalar("m/s", "ECEF velocity")
    roll_rad: float = scalar("rad", "roll, right wing down")
    pitch_rad: float = scalar("rad", "pitch, nose up")
    heading_rad: float = scalar("rad", "true heading, clockwise from north")


OBSERVATIONS: Final = TableSchema("observations", 1, ObservationEpoch)
EPHEMERIS: Final = TableSchema("ephemeris", 1, Ephemeris)
INTEGRITY: Final = TableSchema("integrity", 3, IntegrityEpoch)
MONITORS: Final = TableSchema("monitors", 2, MonitorEpoch)
MONITOR_DETAILS: Final = TableSchema("monitor_details", 1, MonitorDetailEpoch)
CHANNELS: Final = TableSchema("channels", 1, ChannelEpoch)
SOLUTION: Final = TableSchema("solution", 2, SolutionEpoch)
PROTECTION: Final = TableSchema("protection", 2, ProtectionEpoch)
MODES: Final = TableSchema("modes", 1, ModesEpoch)
PROGRESS: Final = TableSchema("progress", 1, ProgressEpoch)
TRUTH: Final = TableSchema("truth", 2, TruthEpoch)

SCHEMAS: Final[dict[str, TableSchema[Any]]] = {
    schema.name: schema
    for schema in (
        OBSERVATIONS,
        EPHEMERIS,
        INTEGRITY,
        MONITORS,
        MONITOR_DETAILS,
        CHANNELS,
        SOLUTION,
        PROTECTION,
        MODES,
        PROGRESS,
        TRUTH,
    )
}


def schema_of(label: str) -> TableSchema[Any]:
    """The schema a label names.

    Raises
    ------
    SchemaError
        For a label of another kind, an unknown schema or another version. The columns are checked by ``decode``.
    """
    found = label.partition(":")[0]
    parts = found.split("/")
    if not found.startswith(LABEL_PREFIX) or len(parts) != 3:
        raise SchemaError(f"{label[:80]!r} is not a label of the form '{LABEL_PREFIX}<name>/<version>: <columns>'")
    schema = SCHEMAS.get(parts[1])
    if schema is None:
        raise SchemaError(f"schema {parts[1]!r} is unknown, expected one of {', '.join(SCHEMAS)}")
    if parts[2] != str(schema.version):
        raise SchemaError(f"schema {parts[1]!r} has version {parts[2][:20]!r}, expected {schema.version}")
    return schema


def decode_table(label: str, data: NDArray[np.float64]) -> Record:
    """Record of a table of any registered schema; raises SchemaError as :meth:`TableSchema.decode` does."""
    record: Record = schema_of(label).decode(label, data)
    return record


def schema_dictionary() -> str:
    """The contract as one JSON document: what is published on the schemas topic and written into bags.

    Tables with their columns, every enumeration, the products, the modes and the monitors: a bag explains itself.
    """
    return json.dumps(
        {
            "schemas": [schema.describe() for schema in SCHEMAS.values()],
            "enumerations": enumerations(),
            "products": product_dictionary(),
            "modes": mode_dictionary(),
            "airborne_monitors": AIRBORNE_MONITORS,
            "monitors": monitor_dictionary(),
        },
        ensure_ascii=True,
    )
