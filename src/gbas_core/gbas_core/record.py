"""Records: frozen dataclasses whose fields say how they travel as a table.

A record is one epoch of something: observations, an ephemeris set, integrity, a solution. Its fields are either scalars
or arrays on the satellite axis (:mod:`gbas_core.satellites`). Each field is declared once, with its unit and meaning,
by :func:`scalar` or :func:`per_satellite`; the message codec, the documentation and the recorder all read that
declaration. Missing is NaN everywhere.
"""

from __future__ import annotations

import math
from dataclasses import Field, dataclass, field, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.satellites import missing

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
_KEY: Final = "gbas_column"


@dataclass(frozen=True)
class ColumnSpec:
    """How one field of a record travels: its column names, unit and meaning, and the axes before the satellite axis."""

    names: tuple[str, ...]
    unit: str
    doc: str
    satellite: bool
    leading: tuple[int, ...] = ()


def scalar(unit: str, doc: str) -> Any:
    """Declare a scalar field of a record; its default is NaN (missing)."""
    return field(default=float("nan"), metadata={_KEY: ((), unit, doc, False, ())})


def per_satellite(unit: str, doc: str, *, columns: tuple[str, ...] = (), leading: tuple[int, ...] = ()) -> Any:
    """Declare a field on the satellite axis; its default is all NaN (missing).

    With `columns` the array has shape ``(len(columns), N_SATS)`` and each name is one column of the table; with
    `leading` too its shape is ``(*leading, N_SATS)`` and the names are in that order, the last axis first to change.
    Without, the array has shape ``(N_SATS,)`` and the column has the field's own name.
    """
    axes = leading or ((len(columns),) if columns else ())
    if columns and math.prod(axes) != len(columns):
        raise ValueError(f"{len(columns)} columns for axes of {axes}")
    return field(default_factory=lambda: missing(*axes), metadata={_KEY: (columns, unit, doc, True, axes)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Base of all records: the epoch in GPS time.

    Attributes
    ----------
    gps_week : int
        GPS week, not modulo 1024.
    tow_s : float
        Time of week [s].
    """

    gps_week: int
    tow_s: float


def columns_of(record_type: type[Record]) -> tuple[tuple[Field[Any], ColumnSpec], ...]:
    """The declared fields of a record type (without the epoch), in order, with how each travels."""
    specs = []
    for item in fields(record_type):
        if _KEY in item.metadata:
            columns, unit, doc, satellite, leading = item.metadata[_KEY]
            specs.append((item, ColumnSpec(columns or (item.name,), unit, doc, satellite, leading)))
    return tuple(specs)
