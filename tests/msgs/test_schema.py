"""Tables: round trips to the bit, and everything a reader must refuse."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import columns_of
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID
from gbas_msgs_py import tables
from gbas_msgs_py.cdr import TableCodec
from gbas_msgs_py.codes import Signal
from gbas_msgs_py.modes import MODES
from gbas_msgs_py.monitors import TESTS
from gbas_msgs_py.products import L5_100, PRODUCTS
from gbas_msgs_py.schema import SchemaError, TableSchema

SCHEMAS = list(tables.SCHEMAS.values())
IDS = [schema.name for schema in SCHEMAS]
COLUMNS = Path(__file__).resolve().parents[1] / "tables" / "schema_columns.yaml"

# What a field may hold: any finite double, among them both zeros and the smallest and largest, or missing.
VALUES = st.floats(allow_infinity=False, allow_nan=True)


def random_record(schema: TableSchema[Any], seed: int, satellites: list[int], odd: float = 1.5) -> Any:
    """A record with values, holes, and `odd` somewhere, for the satellites at these places of the axis."""
    rng = np.random.default_rng(seed)
    if schema is tables.MODES:
        satellites = satellites[: len(MODES)]  # there are no more rows than modes
    values: dict[str, Any] = {"gps_week": int(rng.integers(0, 65536)), "tow_s": float(rng.uniform(0, 604800))}
    rows = random_keys(schema, rng, len(satellites))
    for item, spec in columns_of(schema.record_type):
        if spec.row:
            quantity = rng.choice([rng.normal() * 1e7, np.nan, odd], size=len(satellites))
            coded = rng.choice(np.array(spec.codes or [0.0], dtype=np.float64), size=len(satellites))
            values[item.name] = rows.get(item.name, quantity if spec.codes is None else coded)
            continue
        if not spec.satellite:
            values[item.name] = float(rng.choice([rng.normal() * 1e7, np.nan, odd]))
            continue
        array = item.default_factory()
        picked = rng.normal(size=(*array.shape[:-1], len(satellites))) * 10.0 ** rng.integers(-20, 20)
        picked[rng.random(picked.shape) < 0.3] = np.nan
        picked[rng.random(picked.shape) < 0.1] = odd
        array[..., satellites] = picked
        values[item.name] = array
    return schema.record_type(**values)


def random_keys(schema: TableSchema[Any], rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """Columns that say what a row of a table is about: no two rows the same."""
    if not schema.has_rows:
        return {}
    if schema is tables.MODES:
        return {"mode": rng.permutation([float(mode.number) for mode in MODES])[:count]}
    every = [(*test, sat, signal) for test in TESTS for sat in RANGING_SOURCE_ID for signal in Signal]
    chosen = np.array(every, dtype=np.float64)[rng.permutation(len(every))[:count]].reshape(count, 4)
    return dict(zip(("monitor", "test", "sat", "signal"), chosen.T, strict=True))


def bits(record: Any) -> dict[str, bytes]:
    """Every field as bytes, so that -0.0, NaN and the last bit count."""
    return {item.name: np.asarray(getattr(record, item.name), dtype=np.float64).tobytes() for item in fields(record)}


def table_of(schema: TableSchema[Any] = tables.OBSERVATIONS) -> np.ndarray:
    return schema.encode(random_record(schema, 3, [0, 5, 40]))


@pytest.mark.parametrize("schema", SCHEMAS, ids=IDS)
@given(
    seed=st.integers(0, 2**32),
    satellites=st.lists(st.integers(0, N_SATS - 1), unique=True, max_size=N_SATS),
    odd=VALUES,
)
def test_round_trip_is_exact_to_the_bit(schema: TableSchema[Any], seed: int, satellites: list[int], odd: float) -> None:
    record = random_record(schema, seed, satellites, odd)
    table = schema.encode(record)
    assert table.flags.c_contiguous
    assert table.dtype == np.float64
    assert table.shape[1] == 1 + schema.label_of(table).count(",")
    again = schema.decode(schema.label_of(table), table)
    assert type(again) is schema.record_type
    assert isinstance(again.gps_week, int)
    assert bits(again) == bits(record)
    assert schema.encode(again).tobytes() == table.tobytes()


@pytest.mark.parametrize("schema", [s for s in SCHEMAS if s.has_satellites or s.has_rows], ids=lambda s: s.name)
def test_an_epoch_without_satellites_is_one_marker_row(schema: TableSchema[Any]) -> None:
    table = schema.encode(schema.record_type(gps_week=2300, tow_s=0.5))
    assert table.shape == (1, 1 + schema.labels[-1].count(","))
    assert table[0, :2].tolist() == [2300.0, 0.5]
    assert np.isnan(table[0, 2:]).all()
    assert bits(schema.decode(schema.label_of(table), table)) == bits(schema.record_type(gps_week=2300, tow_s=0.5))


def test_only_satellites_with_values_have_rows_and_keep_the_order_of_the_axis() -> None:
    record = ObservationEpoch(gps_week=2300, tow_s=1.0, simulated=0.0)
    record.code_m[0, 40] = 2e7
    record.lli[2, 3] = 1.0
    table = tables.OBSERVATIONS.encode(record)
    assert table[:, tables.OBSERVATIONS.columns.index("sat")].tolist() == [4.0, 70.0 + 9.0]  # PRN 4; SVID 9


def test_rows_may_come_in_any_order() -> None:
    schema, table = tables.OBSERVATIONS, table_of()
    assert bits(schema.decode(schema.label_of(table), table[::-1])) == bits(
        schema.decode(schema.label_of(table), table)
    )


def test_columns_are_those_of_the_contract() -> None:
    """A column added, removed or renamed without a new version would break every reader silently."""
    known = yaml.safe_load(COLUMNS.read_text(encoding="utf-8"))
    assert {s.identifier: list(s.columns) for s in SCHEMAS} == {
        name: [column.strip() for column in text.split(",")] for name, text in known.items()
    }


def test_optional_columns_are_last_and_only_where_they_say_something() -> None:
    """A station of one frequency publishes what it did before there were two; old tables are read as they are."""
    schema = tables.INTEGRITY
    optional = [name for name in schema.columns if "_l5_" in name]
    assert schema.columns[-len(optional) :] == tuple(optional)
    full = random_record(schema, 3, [0, 5, 40])
    without = replace(
        full,
        **{
            name: np.where(np.arange(len(PRODUCTS))[(...,) + (None,) * (value.ndim - 1)] >= L5_100, np.nan, value)
            for name, value in vars(full).items()
            if getattr(value, "ndim", 0) > 1
        },
    )
    wide, narrow = schema.encode(full), schema.encode(without)
    assert [schema.label_of(each) for each in (wide, narrow)] == list(schema.labels)
    assert narrow.shape[1] == wide.shape[1] - len(optional)
    assert narrow.tobytes() == wide[:, : narrow.shape[1]].tobytes()
    assert bits(schema.decode(schema.labels[1], narrow)) == bits(without)
    with pytest.raises(SchemaError, match="table of shape"):
        schema.decode(schema.label, narrow)
    codec = TableCodec(schema)
    for record in (full, without):
        again = codec.decode(codec.encode(record))
        assert again is not None
        assert bits(again) == bits(record)


def test_label_names_schema_version_and_columns() -> None:
    assert tables.PROGRESS.label == "gbas/progress/1: gps_week,tow_s"
    assert tables.OBSERVATIONS.label.startswith(
        "gbas/observations/1: gps_week,tow_s,simulated,sat,code_l1_m,code_l2_m,"
    )


def test_dictionary_describes_every_column_with_unit_and_meaning() -> None:
    described = json.loads(tables.schema_dictionary())["schemas"]
    assert [each["label"] for each in described] == [schema.label for schema in SCHEMAS]
    for each in described:
        assert ",".join(column["name"] for column in each["columns"]) == each["label"].partition(": ")[2]
        assert all(column["unit"] and column["doc"] for column in each["columns"])


def _with(row: int, column: str, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(table: np.ndarray) -> np.ndarray:
        table = table.copy()
        table[row, tables.OBSERVATIONS.columns.index(column)] = value
        return table

    return change


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (_with(1, "tow_s", 5.0), "rows differ in tow_s"),
        (_with(1, "gps_week", 5.0), "rows differ in gps_week"),
        (_with(1, "simulated", 7.25), "rows differ in simulated"),
        (_with(0, "sat", 33.0), "sat 33 is not"),  # between GPS and Galileo
        (_with(0, "sat", 0.0), "sat 0 is not"),
        (_with(0, "sat", -1.0), "sat -1 is not"),
        (_with(0, "sat", 107.0), "sat 107 is not"),
        (_with(0, "sat", 1e300), "is not a ranging source"),
        (_with(0, "sat", 1.5), "sat 1.5 is not"),
        (_with(0, "sat", np.nan), "sat nan is not"),
        (_with(0, "sat", 6.0), "sat 6 has more than one row"),
        (_with(2, "code_l1_m", np.inf), "code_l1_m is infinite"),
        (_with(2, "lli_l5", -np.inf), "lli_l5 is infinite"),
        (lambda t: t[:, :-1], "shape"),
        (lambda t: np.hstack([t, t[:, :1]]), "shape"),
        (lambda t: t[:0], "shape"),
        (lambda t: t[0], "shape"),
    ],
)
def test_bad_tables_are_refused(change: Callable[[np.ndarray], np.ndarray], complaint: str) -> None:
    schema = tables.OBSERVATIONS
    with pytest.raises(SchemaError, match="gbas/observations/1") as told:
        schema.decode(schema.label, change(table_of()))
    assert complaint in str(told.value)


EPOCHS = [
    ("gps_week", np.nan),
    ("gps_week", np.inf),
    ("gps_week", -1.0),
    ("gps_week", 2300.5),
    ("gps_week", 65536.0),
    ("tow_s", np.nan),
    ("tow_s", np.inf),
    ("tow_s", -0.001),
    ("tow_s", 604800.0),
]


@pytest.mark.parametrize("schema", SCHEMAS, ids=IDS)
@pytest.mark.parametrize(("column", "value"), EPOCHS)
def test_bad_epochs_are_refused(schema: TableSchema[Any], column: str, value: float) -> None:
    table = schema.encode(schema.record_type(gps_week=2300, tow_s=0.5))
    table[0, schema.columns.index(column)] = value
    with pytest.raises(SchemaError, match=column):
        schema.decode(schema.label_of(table), table)
    with pytest.raises(SchemaError, match=column):
        schema.encode(replace(schema.record_type(gps_week=2300, tow_s=0.5), **{column: value}))


def test_marker_with_values_is_refused() -> None:
    schema = tables.OBSERVATIONS
    table = schema.encode(schema.record_type(gps_week=2300, tow_s=0.5))
    table[0, -1] = 1.0
    with pytest.raises(SchemaError, match="without satellite has values"):
        schema.decode(schema.label_of(table), table)


def test_scalar_record_has_one_row() -> None:
    schema = tables.PROTECTION
    table = schema.encode(schema.record_type(gps_week=2300, tow_s=0.5))
    with pytest.raises(SchemaError, match="2 rows, expected 1"):
        schema.decode(schema.label, np.vstack([table, table]))


@pytest.mark.parametrize(
    ("label", "complaint"),
    [
        ("gbas/observations/2: gps_week,tow_s", "version '2', expected 1"),
        ("gbas/weather/1: gps_week,tow_s", "schema 'weather' is unknown"),
        ("gps_week,tow_s,sat", "is not a label"),
        ("", "is not a label"),
        ("gbas/observations/1", "column 1 is '', expected 'gps_week'"),
        ("gbas/progress/1: gps_week,tow_s,extra", "3 columns, expected 2"),
        ("gbas/progress/1: gps_week", "column 2 is the end, expected 'tow_s'"),
        ("gbas/progress/1: tow_s,gps_week", "column 1 is 'tow_s', expected 'gps_week'"),
    ],
)
def test_unknown_labels_are_refused_by_name(label: str, complaint: str) -> None:
    with pytest.raises(SchemaError) as told:
        tables.decode_table(label, np.array([[2300.0, 0.5]]))
    assert complaint in str(told.value)


def test_another_schema_is_refused_by_a_reader_that_expects_one() -> None:
    with pytest.raises(SchemaError, match="gbas/truth/2"):
        tables.PROGRESS.decode(tables.TRUTH.label, np.array([[2300.0, 0.5]]))


def test_encoding_refuses_what_no_reader_would_take() -> None:
    schema, good = tables.OBSERVATIONS, random_record(tables.OBSERVATIONS, 1, [1, 2])
    with pytest.raises(SchemaError, match="shape"):
        schema.encode(replace(good, code_m=np.zeros((1, N_SATS))))  # would broadcast silently
    with pytest.raises(SchemaError, match="infinite"):
        schema.encode(replace(good, simulated=np.inf))
    with pytest.raises(SchemaError, match="ProgressEpoch"):
        schema.encode(tables.ProgressEpoch(gps_week=1, tow_s=0.0))  # type: ignore[arg-type]


@given(rows=st.integers(0, 5), columns=st.integers(0, 25), data=st.data())
def test_random_tables_never_do_worse_than_a_schema_error(rows: int, columns: int, data: Any) -> None:
    schema = tables.OBSERVATIONS
    numbers = data.draw(st.lists(st.floats(), min_size=rows * columns, max_size=rows * columns))
    table = np.array(numbers, dtype=np.float64).reshape(rows, columns)
    try:
        record = schema.decode(schema.label_of(table), table)
    except SchemaError:
        return
    assert bits(schema.decode(schema.label, schema.encode(record))) == bits(record)


def test_every_ranging_source_travels() -> None:
    record = random_record(tables.OBSERVATIONS, 5, list(range(N_SATS)), odd=2.0)
    record = replace(record, code_m=np.ones((3, N_SATS)))
    table = tables.OBSERVATIONS.encode(record)
    assert table[:, 3].tolist() == RANGING_SOURCE_ID.tolist()
