"""The recorded sets of ``tests/tables/recorded_sets.yaml``: requests to process them and the truth to compare with."""

from __future__ import annotations

import csv
import gzip
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gbas_chain.process import ProcessRequest
from gbas_chain.results import Row

TABLE = Path(__file__).resolve().parents[1] / "tables" / "recorded_sets.yaml"


@lru_cache(maxsize=1)
def recorded_sets() -> dict[str, dict[str, Any]]:
    """All sets by name."""
    return yaml.safe_load(TABLE.read_text(encoding="utf-8"))


def request(name: str, data: Path, **changes: Any) -> ProcessRequest:
    """What ``gbas process`` is asked for a set."""
    item = recorded_sets()[name]
    arguments: dict[str, Any] = {
        "ground": tuple(data / path for path in item["ground"]),
        "ground_xyz_m": tuple(tuple(place) for place in item["ground_xyz_m"]),
        "user": data / item["user"],
        "navigation": tuple(data / path for path in item["navigation"]),
        "systems": item["systems"],
    }
    return ProcessRequest(**{**arguments, **changes})


def truth_ecef_m(name: str, data: Path, tow_s: np.ndarray) -> np.ndarray:
    """True antenna positions (n, 3) at times of week; NaN where the reference trajectory has no such instant."""
    item = recorded_sets()[name]
    if "user_xyz_m" in item:
        return np.broadcast_to(np.array(item["user_xyz_m"]), (len(tow_s), 3))
    with gzip.open(data / item["truth_csv"], "rt", encoding="ascii") as source:
        rows = list(csv.DictReader(source))
    places = {
        round(float(row["GpsToW [s]"]) * 1000.0): [float(row[f"Pos ECEF {axis} [m]"]) for axis in "XYZ"] for row in rows
    }
    missing = [np.nan] * 3
    return np.array([places.get(round(float(instant) * 1000.0), missing) for instant in tow_s])


def truth_of_rows(name: str, data: Path, rows: tuple[Row, ...]) -> np.ndarray:
    """True positions (len(rows), 3) of the epochs of a result."""
    return truth_ecef_m(name, data, np.array([row.tow_s for row in rows]))
