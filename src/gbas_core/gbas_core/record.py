"""Records: frozen dataclasses whose fields say how they travel as a table.

A record is one epoch of something: observations, an ephemeris set, integrity, a solution. Its fields are scalars and
arrays on the satellite axis (:mod:`gbas_core.satellites`), or scalars and columns of rows of which there are as many as
there is to say. Each field is declared once, with its unit and meaning, by :func:`scalar`, :func:`per_satellite` or
:func:`per_row`; the message codec, the documentation and the recorder all read that declaration. Missing is NaN
everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import Field, dataclass, field, fields, replace
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
    """How one field of a record travels.

    Attributes
    ----------
    names : tuple of str
        Its columns.
    unit, doc : str
    satellite, row : bool
        Whether it is on the satellite axis, or has one value a row.
    leading : tuple of int
        Axes before the satellite axis.
    key : bool
        Whether it is part of what a row is about: no two rows have the same.
    codes : tuple of int or None
        Numbers it may have; None for a quantity.
    optional : tuple of str
        Those of `names` that a table has only where one of them has a value.
    """

    names: tuple[str, ...]
    unit: str
    doc: str
    satellite: bool = False
    row: bool = False
    leading: tuple[int, ...] = ()
    key: bool = False
    codes: tuple[int, ...] | None = None
    optional: tuple[str, ...] = ()


def scalar(unit: str, doc: str) -> Any:
    """Declare a scalar field of a record; its default is NaN (missing)."""
    return field(default=float("nan"), metadata={_KEY: ColumnSpec((), unit, doc)})


def per_satellite(
    unit: str,
    doc: str,
    *,
    columns: tuple[str, ...] = (),
    leading: tuple[int, ...] = (),
    optional: tuple[str, ...] = (),
) -> Any:
    """Declare a field on the satellite axis; its default is all NaN (missing).

    With `columns` the array has shape ``(len(columns), N_SATS)`` and each name is one column of the table; with
    `leading` too its shape is ``(*leading, N_SATS)`` and the names are in that order, the last axis first to change.
    Without, the array has shape ``(N_SATS,)`` and the column has the field's own name. Tables without any value in the
    `optional` ones of the columns do not have these.
    """
    axes = leading or ((len(columns),) if columns else ())
    if columns and math.prod(axes) != len(columns):
        raise ValueError(f"{len(columns)} columns for axes of {axes}")
    spec = ColumnSpec(columns, unit, doc, satellite=True, leading=axes, optional=optional)
    return field(default_factory=lambda: missing(*axes), metadata={_KEY: spec})


def per_row(unit: str, doc: str, *, key: bool = False, codes: Iterable[int] | None = None) -> Any:
    """Declare a field with one value a row, ``(rows,)``; all fields of such a record have as many. Default: no row.

    A field with `codes` has one of these numbers in every row; any other field may be NaN (missing). No two rows agree
    in all fields that are part of the `key`.
    """
    known = None if codes is None else tuple(sorted({int(code) for code in codes}))
    if key and known is None:
        raise ValueError("a key has codes")
    spec = ColumnSpec((), unit, doc, row=True, key=key, codes=known)
    return field(default_factory=lambda: np.empty(0), metadata={_KEY: spec})


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

    def check(self) -> None:
        """Refuse what no declaration of single columns can say; called when the record is encoded and decoded.

        Raises
        ------
        ValueError
            Saying what does not belong together.
        """


def columns_of(record_type: type[Record]) -> tuple[tuple[Field[Any], ColumnSpec], ...]:
    """The declared fields of a record type (without the epoch), in order, with how each travels."""
    specs = []
    for item in fields(record_type):
        if _KEY in item.metadata:
            spec: ColumnSpec = item.metadata[_KEY]
            specs.append((item, replace(spec, names=spec.names or (item.name,))))
    return tuple(specs)
