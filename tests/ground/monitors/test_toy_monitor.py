"""A monitor of one's own: one file and one entry in the contract, and it is in everything the station says.

In a process of its own: the tables of the contract and the station's parameters are made when they are imported.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2]

TOY = """\
from __future__ import annotations

from typing import Annotated, Final

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.signals import L1
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, no_memory, verdicts
from gbas_ground.monitors.monitor_table import summarise
from gbas_ground.monitors.result import upper_limit
from gbas_msgs_py.monitors import monitor_named

ENTRY: Final = monitor_named("toy")


@parameters
class ToyParams:
    exclude: Annotated[bool, Parameter("satellites that fail are excluded")] = True
    limit_db: Annotated[float, Parameter("largest difference of C/N0 between receivers", "dB", 0.1, 40.0)] = 3.0


def _step(state: None, epoch: MonitoredEpoch) -> tuple[None, MonitorOutput]:
    inputs, params = epoch.inputs, epoch.inputs.station.params.toy
    cn0 = np.where(inputs.ready, inputs.cn0_dbhz[:, L1], np.nan)
    spread = np.where(inputs.due, np.nanmax(cn0, axis=0, initial=0.0) - np.nanmin(cn0, axis=0, initial=99.0), np.nan)
    result = upper_limit(spread, params.limit_db, inputs.due)
    test = ENTRY.test("spread")
    return state, MonitorOutput(
        summaries={ENTRY.key("spread"): summarise(result, inputs.due)},
        satellites=verdicts(params.exclude, test.cause, result, inputs.due),
    )


MONITOR: Final = SignalMonitor(entry=ENTRY, parameters=ToyParams, initial=no_memory, step=_step)
"""

RUN = """\
import json, sys
from gbas_msgs_py import monitors
from gbas_msgs_py.codes import ExclusionCause

# the one entry
monitors.MONITORS += (monitors.Monitor(
    number=99, name="toy", judges=("satellite",), doc="C/N0 that differs between receivers",
    tests=(
        monitors.MonitorTest(number=1, name="spread", cause=ExclusionCause.FURTHER_MONITOR, unit="dB", doc="spread"),
    ),
),)
monitors.TESTS.update({(99, 1): (monitors.MONITORS[-1], monitors.MONITORS[-1].tests[0])})
import gbas_ground.monitors
gbas_ground.monitors.__path__.append(sys.argv[1])  # the one file

sys.path[:0] = sys.argv[2:]
from gbas_core.parameters import ParameterError, json_schema
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import L1
from gbas_ground.params import GroundParams
from gbas_msgs_py import document, tables
from ground_runs import half_seconds, params, run
from synthetic_ranges import truth

def weak(second, observed):
    if second >= 10.0:
        observed[2].cn0_dbhz[L1, SAT_INDEX["G05"]] -= 5.0
    return observed

station = params(4, signal_power__exclude=False, expected_power__exclude=False)
out = run(truth(4), station, half_seconds(40), change=weak)
table = out.statistics[-1]
sent = tables.MONITORS.decode(tables.MONITORS.label, tables.MONITORS.encode(table))
watched = run(truth(4), params(4, toy__exclude=False), half_seconds(40), change=weak)
try:
    params(4, toy__limit_db=50.0)
    refused = ""
except ParameterError as error:
    refused = str(error)
print(json.dumps({
    "told": out.told("further_monitor"),
    "rows": [list(map(str, row)) for row in sent.select(monitor="toy", sat="G05").rows()],
    "channel": [int(out.channels[-1].state[SAT_INDEX["G05"]]), int(out.channels[-1].cause[SAT_INDEX["G05"]])],
    "watched": watched.told("further_monitor"),
    "refused": refused,
    "schema": json_schema(GroundParams)["$defs"]["ToyParams"]["properties"]["limit_db"],
    "page": document.contract_text(),
}))
"""


def test_one_file_and_one_entry_make_a_monitor(tmp_path: Path) -> None:
    (tmp_path / "toy.py").write_text(TOY, encoding="utf-8")
    places = [str(SCENES / "scenes"), str(SCENES / "oracles")]
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path), *places], capture_output=True, text=True, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)
    assert made["told"] == [[10.0, "exclusion", "G05"]]
    assert made["rows"] == [["toy", "spread", "G05", "1", "5.0", "3.0", "3"]]
    assert made["channel"] == [3, 50]  # excluded, by a further monitor
    assert made["watched"] == []
    assert made["refused"] == "toy.limit_db = 50 is not within 0.1 to 40 dB"
    assert made["schema"] == {
        "type": "number", "minimum": 0.1, "maximum": 40.0, "default": 3.0,
        "description": "largest difference of C/N0 between receivers [dB]",
    }  # fmt: skip
    assert "| `toy` | `spread` | 99, 1 |" in made["page"]
