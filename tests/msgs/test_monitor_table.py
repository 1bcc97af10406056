"""The monitors table in long form: rows, selections, and what a reader must refuse."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
import pytest

from gbas_core.record import FloatArray, Record, per_row, per_satellite
from gbas_core.satellites import SAT_INDEX
from gbas_ground.monitors import registry
from gbas_msgs_py import monitors
from gbas_msgs_py.codes import FIRST_LATCHED, ExclusionCause, MonitorState, Signal
from gbas_msgs_py.records import MonitorEpoch
from gbas_msgs_py.schema import SchemaError, TableSchema
from gbas_msgs_py.tables import MONITORS

NAN = np.nan


def epoch(**changes: list[float]) -> MonitorEpoch:
    """Two tests of G05, one of them also of G31."""
    values = {
        "monitor": [4.0, 4.0, 6.0], "test": [1.0, 1.0, 2.0], "sat": [5.0, 31.0, 5.0], "signal": [1.0, 1.0, 0.0],
        "statistic": [0.03, 0.001, NAN], "threshold": [0.0233, 0.0233, 0.1], "state": [3.0, 2.0, 1.0],
    } | changes  # fmt: skip
    return MonitorEpoch(gps_week=2300, tow_s=0.5, **{name: np.array(column) for name, column in values.items()})


def test_rows_in_words() -> None:
    first, second, third = epoch().rows()
    assert first == ("ccd", "rate", "G05", Signal.L1, 0.03, 0.0233, MonitorState.FAILED)
    assert second[:4] == ("ccd", "rate", "G31", Signal.L1)
    assert third[:4] == ("carrier_acceleration", "rate", "G05", Signal.NONE)


def test_rows_are_selected_by_names() -> None:
    table = epoch()
    assert len(table.select(monitor="ccd")) == 2
    assert [row.sat for row in table.select(monitor="ccd", sat="G31").rows()] == ["G31"]
    assert [row.test for row in table.select(sat="G05").rows()] == ["rate", "rate"]
    assert len(table.select(monitor="carrier_acceleration", test="step")) == 0
    assert len(table.select()) == 3
    states = table.states("ccd")
    assert states[SAT_INDEX["G05"]] == MonitorState.FAILED
    assert states[SAT_INDEX["G31"]] == MonitorState.PASSED
    assert (np.delete(states, [SAT_INDEX["G05"], SAT_INDEX["G31"]]) == MonitorState.NOT_DUE).all()
    for wrong in ({"monitor": "gradient"}, {"monitor": "ccd", "test": "slope"}, {"sat": "G99"}, {"test": "rate"}):
        with pytest.raises(KeyError):
            table.select(**wrong)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"monitor": [99.0, 4.0, 6.0]}, "monitor 99 is not a known code"),
        ({"monitor": [4.5, 4.0, 6.0]}, "monitor 4.5 is not a known code"),
        ({"monitor": [NAN, 4.0, 6.0]}, "monitor nan is not a known code"),
        ({"monitor": [-1.0, 4.0, 6.0]}, "monitor -1 is not a known code"),
        ({"monitor": [1e300, 4.0, 6.0]}, "is not a known code"),
        ({"monitor": [np.inf, 4.0, 6.0]}, "monitor is infinite"),
        ({"test": [3.0, 1.0, 2.0]}, "monitor 4 has no test 3"),
        ({"test": [9.0, 1.0, 2.0]}, "test 9 is not a known code"),
        ({"sat": [33.0, 31.0, 5.0]}, "sat 33 is not a known code"),
        ({"sat": [NAN, 31.0, 5.0]}, "sat nan is not a known code"),
        ({"sat": [-1.0, 31.0, 5.0]}, "sat -1 is not a known code"),
        ({"signal": [3.0, 1.0, 0.0]}, "signal 3 is not a known code"),
        ({"state": [0.0, 2.0, 1.0]}, "state 0 is not a known code"),
        ({"state": [4.0, 2.0, 1.0]}, "state 4 is not a known code"),
        ({"sat": [31.0, 31.0, 5.0]}, "more than one row with monitor 4, test 1, sat 31, signal 1"),
        ({"statistic": [np.inf, 0.0, 0.0]}, "statistic is infinite"),
        ({"threshold": [0.0, -np.inf, 0.0]}, "threshold is infinite"),
    ],
)
def test_bad_rows_are_refused_by_writer_and_reader(changes: dict[str, list[float]], complaint: str) -> None:
    bad, table = epoch(**changes), MONITORS.encode(epoch())
    with pytest.raises(SchemaError, match="gbas/monitors/2") as told:
        MONITORS.encode(bad)
    assert complaint in str(told.value)
    for name, column in changes.items():
        table[:, MONITORS.columns.index(name)] = column
    with pytest.raises(SchemaError, match="gbas/monitors/2") as told:
        MONITORS.decode(MONITORS.label, table)
    assert complaint in str(told.value)


def _marker_with_a_value(table: FloatArray) -> FloatArray:
    marker = np.full_like(table[:1], NAN)
    marker[0, :2], marker[0, -1] = table[0, :2], 2.0
    return marker


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: np.vstack([t, t[:1]]), "more than one row"),
        (lambda t: np.vstack([t, np.where(np.arange(t.shape[1]) < 2, t[:1], NAN)]), "nan is not a known code"),
        (_marker_with_a_value, "nan is not a known code"),
        (lambda t: t + np.where(np.arange(t.shape[1]) == 1, np.arange(len(t))[:, np.newaxis], 0.0), "differ in tow_s"),
    ],
)
def test_bad_tables_are_refused(change: Callable[[FloatArray], FloatArray], complaint: str) -> None:
    with pytest.raises(SchemaError, match=complaint):
        MONITORS.decode(MONITORS.label, change(MONITORS.encode(epoch())))


def test_columns_of_other_lengths_are_refused() -> None:
    with pytest.raises(SchemaError, match="expected one length"):
        MONITORS.encode(replace(epoch(), statistic=np.zeros(2)))
    with pytest.raises(SchemaError, match="expected one length"):
        MONITORS.encode(replace(epoch(), state=np.ones((3, 1))))


def test_an_epoch_has_room_for_every_test_of_every_satellite_in_its_order() -> None:
    table = epoch()
    again = MONITORS.decode(MONITORS.label, MONITORS.encode(table))
    assert repr(list(again.rows())) == repr(list(table.rows()))  # NaN is not equal to itself


def test_a_record_has_rows_or_satellites_not_both() -> None:
    @dataclass(frozen=True, kw_only=True, eq=False)
    class Both(Record):
        kind: FloatArray = per_row("-", "kind", key=True, codes=(1, 2))
        sigma_m: FloatArray = per_satellite("m", "sigma")

    with pytest.raises(SchemaError, match="satellite axis and fields of rows"):
        TableSchema("both", 1, Both)
    with pytest.raises(ValueError, match="a key has codes"):
        per_row("-", "kind", key=True)


# --- the monitors themselves


def test_numbers_and_names_are_unique() -> None:
    entries = monitors.MONITORS
    assert len({each.number for each in entries}) == len({each.name for each in entries}) == len(entries)
    for each in entries:
        assert [test.number for test in each.tests] == list(range(1, len(each.tests) + 1))
        assert all(test.unit and test.doc for test in each.tests)
        assert each.judges
    run = [each.entry.name for each in registry.SIGNAL_MONITORS]
    assert run == [each.name for each in entries if each.name in run]  # in the order of the contract
    for each in entries:
        assert find_spec(f"gbas_ground.monitors.{each.name}"), "a monitor has a module of its name"


def test_every_cause_of_a_monitor_belongs_to_one_monitor() -> None:
    """Those of a whole receiver are conclusions from several channels or baselines."""
    causes = [cause for each in monitors.MONITORS for cause in each.causes]
    conclusions = {ExclusionCause.RECEIVER_FAULT, ExclusionCause.RECEIVER_BASELINES, ExclusionCause.FURTHER_MONITOR}
    assert len(causes) == len(set(causes))
    assert set(causes) | conclusions == {cause for cause in ExclusionCause if cause >= FIRST_LATCHED}


TOY = """
import json
from gbas_msgs_py import monitors, products
from gbas_msgs_py.codes import ExclusionCause, Signal
test = monitors.MonitorTest(number=1, name="size", cause=ExclusionCause.CARRIER_STEP, unit="m", doc="size of the toy")
toy = monitors.Monitor(number=99, name="toy", judges=("satellite",), tests=(test,), doc="toys", traced=True)
monitors.MONITORS += (toy,)
monitors.TESTS[99, 1] = (toy, test)
products.PRODUCTS += (products.Product(name="l5_60", signal=Signal.L5, smoothing_s=60.0, message_type=12, doc="toy"),)
from gbas_msgs_py import modes
values = {"signal": Signal.L5, "smoothing_s": 60.0, "products": ("l5_60",), "doc": "toy"}
values["service"] = modes.MODES[0].service
modes.PRODUCT_INDEX["l5_60"] = 2
modes.MODES += (modes.Mode(number=99, name="l5_60", **values),)
import numpy as np
from gbas_core.satellites import N_SATS
from gbas_ground.monitors.monitor_table import monitor_epoch, summarise
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py import document, tables
result = MonitorResult(statistic=np.full(N_SATS, 2.0), threshold=np.array(1.0), failed=np.arange(N_SATS) == 3)
every = np.ones(N_SATS, dtype=bool)
table = monitor_epoch(2300, 0.5, {toy.key("size"): summarise(result, every, Signal.L5)}, every)
again = tables.MONITORS.decode(tables.MONITORS.label, tables.MONITORS.encode(table))
print(json.dumps({
    "rows": [list(map(str, row)) for row in again.select(monitor="toy", sat="G04").rows()],
    "columns": tables.INTEGRITY.columns,
    "dictionary": json.loads(tables.schema_dictionary()),
    "page": document.contract_text(),
}))
"""


def test_a_toy_monitor_product_and_mode_need_one_entry_each() -> None:
    """In a process of its own: the tables of the contract are made when they are imported."""
    done = subprocess.run([sys.executable, "-c", TOY], capture_output=True, text=True, check=True)
    made = json.loads(done.stdout)
    assert made["rows"] == [["toy", "size", "G04", "5", "2.0", "1.0", "3"]]
    for column in ("prc_l5_60_m", "rrc_l5_60_mps", "sigma_pr_gnd_l5_60_m", "b4_l5_60_m", "rr1_l5_60_used"):
        assert column in made["columns"]
    dictionary = made["dictionary"]
    assert dictionary["monitors"][-1]["tests"] == [
        {"number": 1, "name": "size", "cause": "carrier_step", "unit": "m", "doc": "size of the toy"}
    ]
    assert dictionary["products"][-1]["name"] == dictionary["modes"][-1]["products"][0] == "l5_60"
    for line in (
        "| `toy` | `size` | 99, 1 |",
        "| `l5_60` | L5 | 60 s | 12 | toy |",
        "| 99 | `l5_60` |",
        "| `prc_l5_60_m` |",
    ):
        assert line in made["page"]
    described = {each["schema"]: each["columns"] for each in dictionary["schemas"]}["gbas/integrity/3"]
    assert {"name": "prc_l5_60_m", "unit": "m", "doc": "pseudorange correction"} in described
