"""Records as tables of doubles, described by a label that travels with them.

A table has one row a satellite, or one for whatever the record says of its rows. Its columns are the epoch
(``gps_week``, ``tow_s``), the record's scalars (repeated on every row), and for records with a satellite axis ``sat``
(the ranging source identifier) and the per-satellite columns, for records of rows their columns. An epoch without any
row is one marker row in which all but the epoch and the scalars is NaN. The label names schema, version and columns::

    gbas/observations/1: gps_week,tow_s,simulated,sat,code_l1_m,...

A reader compares the label with what it knows and refuses anything else: a column is never guessed at. The columns come
from the record's own declaration (:func:`gbas_core.record.columns_of`); nothing is declared twice.
"""

from __future__ import annotations

from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import ColumnSpec, FloatArray, Record, columns_of
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID

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
        coded = [(place, spec.codes) for place, spec in enumerate(specs) if spec.codes is not None]
        self._coded = np.array([place for place, _ in coded], dtype=np.int64)
        self._sizes = np.array([max(codes) + 1 for _, codes in coded], dtype=np.int64)
        self._known = np.zeros((len(coded), int(self._sizes.max(initial=0)) + 1), dtype=bool)
        for row, (_, codes) in enumerate(coded):
            self._known[row, list(codes)] = True
        key = np.array([specs[place].key for place, _ in coded], dtype=bool)
        # A key is one number: its codes as digits, each of its own base.
        bases = np.where(key, self._sizes, 1)
        self._weights = np.where(key, np.cumprod(bases) // np.maximum(bases, 1), 0)

    def block(self, record: Record) -> FloatArray:
        """The rows of a record, ``(rows, columns)``."""
        columns = [getattr(record, name) for name in self.names]
        if any(column.ndim != 1 or column.shape != columns[0].shape for column in columns):
            shapes = ", ".join(f"{name} {column.shape}" for name, column in zip(self.names, columns, strict=True))
            raise SchemaError(f"{self._identifier}: columns of rows have shapes {shapes}, expected one length")
        return np.column_stack(columns)

    def check(self, block: FloatArray) -> None:
        """Refuse unknown codes and rows about the same."""
        values = block[:, self._coded]
        inside = (values >= 0.0) & (values < self._sizes)
        numbers = np.where(inside, values, 0.0).astype(np.int64)
        good = inside & (numbers == values) & self._known[np.arange(len(self._coded)), numbers]
        if not good.all():
            row, place = np.argwhere(~good)[0]
            name = self.names[self._coded[place]]
            raise SchemaError(f"{self._identifier}: {name} {values[row, place]:g} is not a known code")
        keys = np.sort(numbers @ self._weights) if self._weights.any() else np.arange(len(numbers))
        same = keys[1:] == keys[:-1]
        if same.any():
            row = int(np.flatnonzero(numbers @ self._weights == keys[1:][same][0])[0])
            digits = [place for place, weight in enumerate(self._weights) if weight]
            what = ", ".join(f"{self.names[self._coded[place]]} {numbers[row, place]}" for place in digits)
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
        Schema, version and columns.
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
        self.has_satellites = bool(self._arrays)
        self._n_head = len(_EPOCH_COLUMNS) + len(self._scalars)
        self._n_block = len(satellite_columns)
        if self.has_rows and self.has_satellites:
            raise SchemaError(f"{self.identifier}: has fields on the satellite axis and fields of rows")
        sat = (_SAT_COLUMN, *satellite_columns) if self.has_satellites else ()
        self.columns: tuple[str, ...] = (*_EPOCH_COLUMNS, *self._scalars, *sat, *self._rows.names)
        self.label = f"{self.identifier}: {','.join(self.columns)}"
        self._descriptions = _descriptions(specs, self.has_satellites)
        if len(set(self.columns)) != len(self.columns):
            raise SchemaError(f"{self.identifier}: a column is declared twice in {', '.join(self.columns)}")

    def __repr__(self) -> str:
        return f"TableSchema({self.label!r})"

    def describe(self) -> dict[str, Any]:
        """Schema as JSON-able data: label, and each column with its unit and meaning."""
        return {
            "schema": self.identifier,
            "label": self.label,
            "doc": (self.record_type.__doc__ or "").strip().split("\n")[0],
            "columns": [
                {"name": name, "unit": unit, "doc": doc}
                for name, (unit, doc) in zip(self.columns, self._descriptions, strict=True)
            ],
        }

    def encode(self, record: R) -> FloatArray:
        """Table of a record.

        Returns
        -------
        (rows, len(columns)) float64 array, C-contiguous
            Satellites with any value, in the order of the satellite axis, or the record's rows in their order; one
            marker row when there is none.

        Raises
        ------
        SchemaError
            For another record type, an array of the wrong shape, an impossible epoch, an infinite value, or rows with
            unknown codes or the same key.
        """
        if type(record) is not self.record_type:
            raise SchemaError(f"{self.identifier}: encodes {self.record_type.__name__}, not {type(record).__name__}")
        _check_epoch(self.identifier, float(record.gps_week), float(record.tow_s))
        head = [record.gps_week, record.tow_s, *[getattr(record, name) for name in self._scalars]]
        if self.has_satellites:
            table = self._satellite_rows(record, head)
        elif self.has_rows:
            table = self._own_rows(record, head)
        else:
            table = np.array([head], dtype=np.float64)
        _check_finite_or_nan(self.identifier, self.columns, table)
        self._check_record(record)
        return table

    def _own_rows(self, record: R, head: list[float]) -> FloatArray:
        block = self._rows.block(record)
        table = np.empty((max(len(block), 1), len(self.columns)))
        table[:, : self._n_head] = head
        table[:, self._n_head :] = block if len(block) else np.nan
        _check_finite_or_nan(self.identifier, self.columns, table)
        self._rows.check(block)
        return table

    def _check_record(self, record: R) -> None:
        try:
            record.check()
        except ValueError as error:
            raise SchemaError(f"{self.identifier}: {error}") from None

    def _satellite_rows(self, record: R, head: list[float]) -> FloatArray:
        block = np.empty((self._n_block, N_SATS))
        for name, rows, shape in self._arrays:
            values = getattr(record, name)
            if values.shape != shape:
                raise SchemaError(f"{self.identifier}: {name} has shape {values.shape}, expected {shape}")
            block[rows] = values.reshape(-1, N_SATS)
        present = np.flatnonzero(~np.isnan(block).all(axis=0))
        table = np.empty((max(present.size, 1), len(self.columns)))
        table[:, : self._n_head] = head
        if present.size:
            table[:, self._n_head] = _SOURCE_ID_F[present]
            table[:, self._n_head + 1 :] = block[:, present].T
        else:
            table[:, self._n_head :] = np.nan
        return table

    def decode(self, label: str, data: NDArray[np.float64]) -> R:
        """Record of a table.

        Parameters
        ----------
        label : str
            The label that came with the table; must equal :attr:`label`.
        data : (rows, cols) array

        Raises
        ------
        SchemaError
            For another label, a wrong size, rows of different epochs or scalars, an epoch that is not finite or out of
            range, an unknown or repeated satellite, an infinite value, rows with unknown codes or the same key.
        """
        if label != self.label:
            raise SchemaError(self._label_difference(label))
        if data.ndim != 2 or data.shape[1] != len(self.columns) or data.shape[0] < 1:
            raise SchemaError(
                f"{self.identifier}: table of shape {data.shape}, expected (1 or more, {len(self.columns)})"
            )
        head = self._checked_head(data)
        _check_finite_or_nan(self.identifier, self.columns, data)
        values: dict[str, Any] = dict(zip(self._scalars, head[2:], strict=True))
        if self.has_satellites:
            block = self._checked_block(data)
            for name, rows, shape in self._arrays:
                values[name] = block[rows].reshape(shape)
        elif self.has_rows:
            values |= self._checked_rows(data)
        record = self.record_type(gps_week=int(head[0]), tow_s=head[1], **values)
        self._check_record(record)
        return record

    def _checked_rows(self, data: FloatArray) -> dict[str, FloatArray]:
        body = data[:, self._n_head :]
        if len(body) == 1 and np.isnan(body).all():
            body = body[:0]
        self._rows.check(body)
        return {name: body[:, place].copy() for place, name in enumerate(self._rows.names)}

    def _checked_head(self, data: FloatArray) -> list[float]:
        heads = data[:, : self._n_head]
        first = heads[0]
        if data.shape[0] > 1:
            if not (self.has_satellites or self.has_rows):
                raise SchemaError(f"{self.identifier}: {data.shape[0]} rows, expected 1")
            same = (heads == first) | (np.isnan(heads) & np.isnan(first))
            if not same.all():
                column = self.columns[int(np.flatnonzero(~same.all(axis=0))[0])]
                raise SchemaError(f"{self.identifier}: rows differ in {column}, which is one value for the table")
        head: list[float] = first.tolist()
        _check_epoch(self.identifier, head[0], head[1])
        return head

    def _checked_block(self, data: FloatArray) -> FloatArray:
        block = np.full((self._n_block, N_SATS), np.nan)
        sat = data[:, self._n_head]
        body = data[:, self._n_head + 1 :]
        if data.shape[0] == 1 and np.isnan(sat[0]):
            if not np.isnan(body).all():
                raise SchemaError(f"{self.identifier}: a row without satellite has values, expected a marker of NaN")
            return block
        block[:, self._checked_satellites(sat)] = body.T
        return block

    def _checked_satellites(self, sat: FloatArray) -> NDArray[np.int64]:
        known = (sat >= 0) & (sat <= _MAX_SOURCE_ID)
        ids = np.where(known, sat, 0.0).astype(np.int64)
        index = _INDEX_OF_SOURCE[ids]
        bad = ~known | (ids != sat) | (index < 0)
        if bad.any():
            raise SchemaError(f"{self.identifier}: sat {sat[bad][0]:g} is not a ranging source the suite knows")
        if np.bincount(index).max() > 1:
            twice = int(np.argmax(np.bincount(index)))
            raise SchemaError(f"{self.identifier}: sat {RANGING_SOURCE_ID[twice]} has more than one row")
        return index

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


def _check_finite_or_nan(identifier: str, columns: tuple[str, ...], table: FloatArray) -> None:
    """Missing is NaN; an infinity is nobody's measurement."""
    infinite = np.isinf(table)
    if infinite.any():
        column = columns[int(np.flatnonzero(infinite.any(axis=0))[0])]
        raise SchemaError(f"{identifier}: {column} is infinite, expected a finite number or NaN for missing")
