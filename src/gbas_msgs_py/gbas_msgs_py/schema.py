"""Records as tables of doubles, described by a label that travels with them.

A table has one row a satellite, or one for whatever the record says of its rows. Its columns are the epoch
(``gps_week``, ``tow_s``), the record's scalars (repeated on every row), and for records with a satellite axis ``sat``
(the ranging source identifier) and the per-satellite columns, for records of rows their columns. An epoch without any
row is one marker row in which all but the epoch and the scalars is NaN. The label names schema, version and columns::

    gbas/observations/1: gps_week,tow_s,simulated,sat,code_l1_m,...

Columns that a record declares as optional come last, and a table without any value there has none of them; its label
says so.

A reader compares the label with what it knows and refuses anything else: a column is never guessed at. The columns come
from the record's own declaration (:func:`gbas_core.record.columns_of`); nothing is declared twice.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import ColumnSpec, FloatArray, Record, columns_of
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID
from gbas_msgs_py.kernels.rows import (
    Codes,
    check_codes,
    first_infinite,
    row_columns,
    row_table,
    satellite_columns,
    satellite_table,
)

R = TypeVar("R", bound=Record)

LABEL_PREFIX: Final = "gbas/"
MAX_GPS_WEEK: Final = 65535
SECONDS_PER_WEEK: Final = 604800.0
_EPOCH_COLUMNS: Final = ("gps_week", "tow_s")
_SAT_COLUMN: Final = "sat"
_SOURCE_ID_F: Final[FloatArray] = RANGING_SOURCE_ID.astype(np.float64)
_MAX_SOURCE_ID: Final = int(RANGING_SOURCE_ID.max())


def _source_index() -> NDArray[np.int64]:
    index = np.full(_MAX_SOURCE_ID + 1, -1, dtype=np.int64)
    index[RANGING_SOURCE_ID] = np.arange(N_SATS)
    return index


_INDEX_OF_SOURCE: Final = _source_index()


class SchemaError(ValueError):
    """A table, label or record that does not follow its schema; the message says what was expected and found."""


class RowLayout:
    """The columns of a record of rows, and what every row must keep to."""

    def __init__(self, identifier: str, specs: tuple[ColumnSpec, ...]) -> None:
        self._identifier = identifier
        self.names = tuple(spec.names[0] for spec in specs)
        coded = [(place, spec.codes, spec.key) for place, spec in enumerate(specs) if spec.codes is not None]
        sizes = [max(codes) + 1 for _, codes, _ in coded]
        known = np.zeros((len(coded), max(sizes, default=0)), dtype=bool)
        for row, (_, codes, _) in enumerate(coded):
            known[row, list(codes)] = True
        # A key is one number: its codes as digits, each of its own base.
        weights, n_keys = np.zeros(len(coded), dtype=np.int64), 1
        for row, (_, _, key) in enumerate(coded):
            if key:
                weights[row], n_keys = n_keys, n_keys * sizes[row]
        places = np.array([place for place, _, _ in coded], dtype=np.int64)
        self._codes = Codes(places, known, weights, n_keys, len(specs))

    def check(self, block: FloatArray) -> None:
        """Refuse unknown codes and rows about the same; `block` has the columns after one another."""
        row, coded, twice = check_codes(block, self._codes)
        if row < 0 and twice < 0:
            return
        columns = block.reshape(len(self.names), -1)
        if row >= 0:
            place = self._codes.place[coded]
            value = columns[place, row]
            raise SchemaError(f"{self._identifier}: {self.names[place]} {value:g} is not a known code")
        key = [place for place, weight in zip(self._codes.place, self._codes.weights, strict=True) if weight]
        what = ", ".join(f"{self.names[place]} {columns[place, twice]:g}" for place in key)
        raise SchemaError(f"{self._identifier}: more than one row with {what}")


class TableSchema(Generic[R]):
    """How one record type travels as a table.

    Parameters
    ----------
    name : str
        Short name, as in ``gbas/<name>/<version>``.
    version : int
        Raised whenever a column is added, removed, or changes its meaning.
    record_type : type
        A :class:`gbas_core.record.Record`; its declaration gives the columns.

    Attributes
    ----------
    label : str
        Schema, version and columns, the optional ones too.
    columns : tuple of str
    has_satellites : bool
        Whether the table has one row a satellite.
    has_rows : bool
        Whether it has rows of the record's own.
    """

    def __init__(self, name: str, version: int, record_type: type[R]) -> None:
        self.name = name
        self.version = version
        self.record_type = record_type
        self.identifier = f"{LABEL_PREFIX}{name}/{version}"
        specs = columns_of(record_type)
        self._scalars = tuple(item.name for item, spec in specs if not (spec.satellite or spec.row))
        self._rows = RowLayout(self.identifier, tuple(spec for _, spec in specs if spec.row))
        self.has_rows = bool(self._rows.names)
        self._arrays, satellite_columns = _array_layout(specs)
        self._shapes = [shape for _, _, shape in self._arrays]
        self.has_satellites = bool(self._arrays)
        self._values = _getter(self._scalars)
        self._columns = _getter(self._rows.names or tuple(name for name, _, _ in self._arrays))
        self._n_head = len(_EPOCH_COLUMNS) + len(self._scalars)
        if self.has_rows and self.has_satellites:
            raise SchemaError(f"{self.identifier}: has fields on the satellite axis and fields of rows")
        sat = (_SAT_COLUMN, *satellite_columns) if self.has_satellites else ()
        self.columns: tuple[str, ...] = (*_EPOCH_COLUMNS, *self._scalars, *sat, *self._rows.names)
        descriptions = _descriptions(specs, self.has_satellites)
        # The optional columns go to the end: where each column of a whole table is among those in declared order.
        optional = {name for _, spec in specs for name in spec.optional}
        self._n_always = len(self.columns) - len(optional)
        self._order = np.array(sorted(range(len(self.columns)), key=lambda place: self.columns[place] in optional))
        self._declared = self.columns
        self.columns = tuple(self.columns[place] for place in self._order)
        self._descriptions = [descriptions[place] for place in self._order]
        self.label = f"{self.identifier}: {','.join(self.columns)}"
        self._short_label = f"{self.identifier}: {','.join(self.columns[: self._n_always])}"
        if len(set(self.columns)) != len(self.columns):
            raise SchemaError(f"{self.identifier}: a column is declared twice in {', '.join(self.columns)}")

    def __repr__(self) -> str:
        return f"TableSchema({self.label!r})"

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that tables may have: the whole one, and that without the optional columns if there are any."""
        return (self.label,) if self._n_always == len(self.columns) else (self.label, self._short_label)

    def label_of(self, table: FloatArray) -> str:
        """Label of a table that :meth:`encode` made."""
        return self.label if table.shape[1] == len(self.columns) else self._short_label

    def describe(self) -> dict[str, Any]:
        """Schema as JSON-able data: label, and each column with its unit and meaning, and whether it is optional."""
        return {
            "schema": self.identifier,
            "label": self.label,
            "doc": (self.record_type.__doc__ or "").strip().split("\n")[0],
            "columns": [
                {"name": name, "unit": unit, "doc": doc} | ({} if place < self._n_always else {"optional": True})
                for place, (name, (unit, doc)) in enumerate(zip(self.columns, self._descriptions, strict=True))
            ],
        }

    def encode(self, record: R) -> FloatArray:
        """Table of a record.

        Returns
        -------
        (rows, len(columns)) float64 array, C-contiguous
            Satellites with any value, in the order of the satellite axis, or the record's rows in their order; one
            marker row when there is none. Without the optional columns where no row has a value in them.

        Raises
        ------
        SchemaError
            For another record type, an array of the wrong shape, an impossible epoch, an infinite value, or rows with
            unknown codes or the same key.
        """
        if type(record) is not self.record_type:
            raise SchemaError(f"{self.identifier}: encodes {self.record_type.__name__}, not {type(record).__name__}")
        _check_epoch(self.identifier, float(record.gps_week), float(record.tow_s))
        head = np.array([record.gps_week, record.tow_s, *self._values(record)], dtype=np.float64)
        if self.has_satellites:
            table, infinite = satellite_table(self._block(record), head, _SOURCE_ID_F)
        elif self.has_rows:
            table, infinite = self._own_rows(record, head)
        else:
            table = head[np.newaxis]
            infinite = first_infinite(table)
        self._refuse_infinite(infinite)
        if self._n_always < len(self.columns):
            table = self._without_optional(table)
        self._check_record(record)
        return table

    def _without_optional(self, table: FloatArray) -> FloatArray:
        """A table of declared order with the optional columns last, or without them where they are empty."""
        places = self._order
        if np.isnan(table[:, places[self._n_always :]]).all():
            places = places[: self._n_always]
        return np.ascontiguousarray(table[:, places])

    def _with_optional(self, table: FloatArray) -> FloatArray:
        """A table in declared order, missing columns NaN."""
        whole = np.full((len(table), len(self.columns)), np.nan)
        whole[:, self._order[: table.shape[1]]] = table
        return whole

    def _block(self, record: R) -> FloatArray:
        """The satellite columns after one another."""
        values = self._columns(record)
        if [each.shape for each in values] != self._shapes:
            for each, (name, _, shape) in zip(values, self._arrays, strict=True):
                if each.shape != shape:
                    raise SchemaError(f"{self.identifier}: {name} has shape {each.shape}, expected {shape}")
        return np.concatenate(values, axis=None, dtype=np.float64)

    def _own_rows(self, record: R, head: FloatArray) -> tuple[FloatArray, int]:
        values = self._columns(record)
        if any(each.ndim != 1 or each.shape != values[0].shape for each in values):
            shapes = ", ".join(f"{name} {each.shape}" for name, each in zip(self._rows.names, values, strict=True))
            raise SchemaError(f"{self.identifier}: columns of rows have shapes {shapes}, expected one length")
        block = np.concatenate(values, axis=None, dtype=np.float64)
        table, infinite = row_table(block, head, len(values))
        self._refuse_infinite(infinite)
        self._rows.check(block)
        return table, infinite

    def _check_record(self, record: R) -> None:
        try:
            record.check()
        except ValueError as error:
            raise SchemaError(f"{self.identifier}: {error}") from None

    def decode(self, label: str, data: NDArray[np.float64]) -> R:
        """Record of a table.

        Parameters
        ----------
        label : str
            The label that came with the table; must be one of :attr:`labels`.
        data : (rows, cols) array

        Raises
        ------
        SchemaError
            For another label, a wrong size, rows of different epochs or scalars, an epoch that is not finite or out of
            range, an unknown or repeated satellite, an infinite value, rows with unknown codes or the same key.
        """
        if label not in self.labels:
            raise SchemaError(self._label_difference(label))
        n_columns = len(self.columns) if label == self.label else self._n_always
        if data.ndim != 2 or data.shape[1] != n_columns or data.shape[0] < 1:
            raise SchemaError(f"{self.identifier}: table of shape {data.shape}, expected (1 or more, {n_columns})")
        if data.shape[0] > 1 and not (self.has_satellites or self.has_rows):
            raise SchemaError(f"{self.identifier}: {data.shape[0]} rows, expected 1")
        # a copy: what comes from the middleware may be read-only
        table = np.array(data, dtype=np.float64, order="C")
        if self._n_always < len(self.columns):
            table = self._with_optional(table)
        if self.has_satellites:
            arrays = self._decoded_satellites(table)
        elif self.has_rows:
            arrays = self._decoded_rows(table)
        else:
            self._check_head(table, -1, first_infinite(table))
            arrays = {}
        week, tow_s, *scalars = table[0, : self._n_head].tolist()
        values: dict[str, Any] = dict(zip(self._scalars, scalars, strict=True))
        record = self.record_type(gps_week=int(week), tow_s=tow_s, **values, **arrays)
        self._check_record(record)
        return record

    def _decoded_satellites(self, table: FloatArray) -> dict[str, FloatArray]:
        block, differing, infinite, unknown, twice = satellite_columns(table, self._n_head, _INDEX_OF_SOURCE, N_SATS)
        self._check_head(table, differing, infinite)
        if unknown >= 0:
            sat = table[unknown, self._n_head]
            if len(table) == 1 and np.isnan(sat):
                raise SchemaError(f"{self.identifier}: a row without satellite has values, expected a marker of NaN")
            raise SchemaError(f"{self.identifier}: sat {sat:g} is not a ranging source the suite knows")
        if twice >= 0:
            raise SchemaError(f"{self.identifier}: sat {RANGING_SOURCE_ID[twice]} has more than one row")
        return {name: block[rows].reshape(shape) for name, rows, shape in self._arrays}

    def _decoded_rows(self, table: FloatArray) -> dict[str, FloatArray]:
        block, differing, infinite = row_columns(table, self._n_head)
        self._check_head(table, differing, infinite)
        self._rows.check(block.ravel())
        return dict(zip(self._rows.names, block, strict=True))

    def _check_head(self, table: FloatArray, differing: int, infinite: int) -> None:
        """Refuse rows of different epochs or scalars, an impossible epoch, an infinite value."""
        if differing >= 0:
            raise SchemaError(
                f"{self.identifier}: rows differ in {self._declared[differing]}, which is one value for the table"
            )
        _check_epoch(self.identifier, float(table[0, 0]), float(table[0, 1]))
        self._refuse_infinite(infinite)

    def _refuse_infinite(self, column: int) -> None:
        """Missing is NaN; an infinity is nobody's measurement."""
        if column >= 0:
            raise SchemaError(
                f"{self.identifier}: {self._declared[column]} is infinite, expected a finite number or NaN for missing"
            )

    def _label_difference(self, label: str) -> str:
        found, _, columns = label.partition(": ")
        if found != self.identifier:
            return f"schema {found[:80]!r} is not {self.identifier!r}"
        got = columns.split(",")
        for place, expected in enumerate(self.columns):
            if place >= len(got) or got[place] != expected:
                there = repr(got[place][:40]) if place < len(got) else "the end"
                return f"{self.identifier}: column {place + 1} is {there}, expected {expected!r}"
        return f"{self.identifier}: {len(got)} columns, expected {len(self.columns)}"


def _array_layout(
    specs: tuple[tuple[Any, Any], ...],
) -> tuple[tuple[tuple[str, slice, tuple[int, ...]], ...], list[str]]:
    """Field name, rows in the block and array shape of each per-satellite field; and all column names in order."""
    layout: list[tuple[str, slice, tuple[int, ...]]] = []
    columns: list[str] = []
    for item, spec in specs:
        if spec.satellite:
            rows = slice(len(columns), len(columns) + len(spec.names))
            layout.append((item.name, rows, (*spec.leading, N_SATS)))
            columns.extend(spec.names)
    return tuple(layout), columns


def _descriptions(specs: tuple[tuple[Any, Any], ...], has_satellites: bool) -> list[tuple[str, str]]:
    """Unit and meaning of each column, in the order of the columns."""
    texts = [("week", "GPS week, not modulo 1024"), ("s", "time of week")]
    texts += [(spec.unit, spec.doc) for _, spec in specs if not (spec.satellite or spec.row)]
    texts += [(spec.unit, spec.doc) for _, spec in specs if spec.row]
    if has_satellites:
        texts.append(("-", "ranging source identifier, NaN on the marker row of an epoch without satellites"))
        texts += [(spec.unit, spec.doc) for _, spec in specs if spec.satellite for _ in spec.names]
    return texts


def _check_epoch(identifier: str, week: float, tow_s: float) -> None:
    """Refuse an epoch that is not a GPS week and a time of week; comparisons are written so that NaN fails them."""
    if not (0 <= week <= MAX_GPS_WEEK and week == int(week)):
        raise SchemaError(f"{identifier}: gps_week is {week!r}, expected a whole number from 0 to {MAX_GPS_WEEK}")
    if not 0.0 <= tow_s < SECONDS_PER_WEEK:
        raise SchemaError(f"{identifier}: tow_s is {tow_s!r}, expected 0 <= tow_s < {SECONDS_PER_WEEK:.0f}")


def _getter(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """The values of these attributes, as a tuple whatever their number."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda record: tuple(getattr(record, name) for name in names)
