"""``gbas process --service all``: every processing mode side by side, in a table and in the summary."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from gbas_chain.mode_results import MODES_HEADER, mode_lines, mode_summary, write_modes_csv
from gbas_chain.process import ProcessRequest, _service_values, process, write_results
from gbas_core.errors import GbasError
from gbas_msgs_py.codes import ServiceCause, ServiceType
from gbas_msgs_py.modes import MODES
from gbas_msgs_py.records import ModesEpoch
from gbas_msgs_py.tables import MODES as TABLE
from recorded_sets import request, truth_ecef_m

ORDER = ["C", "D", "L5-100", "L5-30", "IF-100", "IF-30"]


def epoch(tow_s: float, vpl_m: list[float], cause: list[ServiceCause]) -> ModesEpoch:
    """The first modes of the table, with these levels and causes."""
    count = len(vpl_m)
    solved = np.where(np.isfinite(vpl_m), 1.0, np.nan)
    return ModesEpoch(
        gps_week=2300,
        tow_s=tow_s,
        mode=np.array([float(mode.number) for mode in MODES[:count]]),
        guides=np.eye(count)[0],
        service=np.array([float(ServiceType.NONE if each else ServiceType.C) for each in cause]),
        cause=np.array(cause, dtype=float),
        value=np.full(count, np.nan),
        threshold=np.full(count, np.nan),
        x_m=4e6 * solved,
        y_m=1e5 * solved,
        z_m=5e6 * solved,
        n_sats=9.0 * solved,
        vpl_m=np.array(vpl_m),
        lpl_m=np.array(vpl_m) / 2.0,
        veb_m=np.full(count, np.nan),
        leb_m=np.full(count, np.nan),
        val_m=np.full(count, np.nan),
        lal_m=np.full(count, np.nan),
        d_vert_m=0.1 * solved,
        d_lat_m=0.2 * solved,
    )


def test_the_table_and_the_summary_of_some_epochs(tmp_path: Path) -> None:
    none, missing = ServiceCause.NONE, ServiceCause.NO_CORRECTIONS
    epochs = [epoch(float(k), [2.0 + k, 3.0 + k, math.nan], [none, none, missing]) for k in range(5)]
    epochs[4] = epoch(4.0, [6.0, math.nan, math.nan], [ServiceCause.VPL_ABOVE_VAL, ServiceCause.D_VERT, missing])
    for each in epochs:
        assert TABLE.decode(TABLE.label, TABLE.encode(each)).vpl_m.tolist()[:1] == each.vpl_m.tolist()[:1]
    write_modes_csv(tmp_path / "modes.csv", epochs, "GE")
    with (tmp_path / "modes.csv").open(encoding="ascii") as source:
        rows = list(csv.reader(source))
    assert tuple(rows[0]) == MODES_HEADER
    assert rows[1] == ["2300", "0.0", "C", "GE", "4000000.0", "100000.0", "5000000.0", "9", "2.0", "1.0", "0.1", "0.2"]
    assert rows[3] == ["2300", "0.0", "L5-100", "GE", *[""] * 8]
    assert [row[2] for row in rows[-3:]] == ["C", "D", "L5-100"]
    summary = mode_summary(epochs, "GE")
    assert list(summary) == ["C", "D", "L5-100"]
    of_c, of_d, of_l5 = (summary[name]["GE"] for name in summary)
    assert (of_c["epochs"], of_c["vpl_m"]["p50"], of_c["vpl_m"]["max"]) == (5, 4.0, 6.0)  # 2, 3, 4, 5, 6
    assert of_c["no_service"] == {"vpl_above_val": 1}
    assert (of_c["service_epochs"], of_c["n_sats"]) == (4, {"min": 9, "max": 9})
    assert (of_d["epochs"], of_d["vpl_m"]["p50"], of_d["not_solved"]) == (4, 4.5, {"d_vert": 1})  # 3, 4, 5, 6
    assert of_d["d_vert_m"]["p50"] == pytest.approx(0.1)
    assert of_l5 == {"epochs": 0, "service_epochs": 0, "no_service": {}, "not_solved": {"no_corrections": 5}}
    assert any("L5-100" in line and "no_corrections 5" in line for line in mode_lines(summary))


def test_systems_are_those_of_the_mode_that_are_used(tmp_path: Path) -> None:
    write_modes_csv(tmp_path / "modes.csv", [epoch(0.0, [2.0], [ServiceCause.NONE])], "G")
    assert (tmp_path / "modes.csv").read_text(encoding="ascii").splitlines()[1].split(",")[3] == "G"


def test_services_are_named_as_the_option_is() -> None:
    assert _service_values("all") == {"service": "C", "modes": ["all"]}
    assert [mode.service.option for mode in MODES[:6]] == ORDER
    with pytest.raises(GbasError, match="'E' is not one of 'C', 'D', 'L5-100'"):
        process(ProcessRequest(ground=(), user=Path("none"), navigation=(), service="E"))


@pytest.mark.campaign
def test_a_recording_of_two_bands_in_all_modes(data_dir: Path, tmp_path: Path) -> None:
    """Real signals: 18 modes with errors within their levels, C as it is alone, and the order of noise."""
    asked = request("mosaic_base_rover", data_dir)
    result = process(request("mosaic_base_rover", data_dir, service="all"))
    summary = write_results(result, tmp_path)
    assert list(summary["modes"]) == ORDER
    assert all(list(found) == ["GE", "G", "E"] for found in summary["modes"].values())
    alone = process(asked)
    assert [row.fields()[:14] for row in alone.rows] == [row.fields()[:14] for row in result.rows]
    with (tmp_path / "modes.csv").open(encoding="ascii") as source:
        rows = [row for row in csv.DictReader(source) if row["x_m"]]
    for row in rows:
        place = np.array([float(row[name]) for name in ("x_m", "y_m", "z_m")])
        truth = truth_ecef_m("mosaic_base_rover", data_dir, np.array([float(row["tow_s"])]))[0]
        up = truth / np.linalg.norm(truth)  # 0.2 degrees from the vertical at most
        assert abs((place - truth) @ up) <= float(row["vpl_m"])
    medians = {name: summary["modes"][name]["GE"]["vpl_m"]["p50"] for name in ORDER}
    assert medians["IF-30"] > medians["IF-100"] > max(medians["C"], medians["D"], medians["L5-100"])
    assert summary["modes"]["D"]["GE"]["d_vert_m"]["p50"] < 0.6  # the paper's quiet conditions
