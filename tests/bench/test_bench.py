"""The benchmark: that its figures mean what they say, not that they are good."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import serialize_message

from gbas_bags.mcap_log import BagWriter, Topic
from gbas_bench import monitors
from gbas_bench.bench import PARTS, print_changes, print_report, run_bench
from gbas_bench.figures import Figure, Part, document, environment
from gbas_bench.history import changes, mean_ratio, other_machine, read_report
from gbas_bench.live import _settled, read_arrivals
from gbas_bench.offline import SETTLE_EPOCHS, make_flight, measure_steps
from gbas_bench.peer import measure_process
from gbas_bench.world import SATELLITES_A_SYSTEM, bench_world
from gbas_core.errors import ConfigError, GbasError
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import IS_GPS
from gbas_msgs_py import ros, tables, topics
from gbas_msgs_py.records import ProtectionEpoch
from gbas_vdb.transmission.burst import Burst


def figure(**changes):
    values = {"part": "p", "name": "n", "value": 2.0, "unit": "ms", "against": "bound", "reference": 8.0}
    return Figure(**{**values, "better": "less", **changes})


def test_ratio_says_how_many_times_better():
    assert figure().ratio == 4.0  # 2 ms where 8 ms are allowed
    assert figure(better="more").ratio == 0.25  # twice real time where eight times are wanted


def test_the_world_shows_thirty_satellites_all_the_time():
    world = bench_world()
    for number in (0, SETTLE_EPOCHS, len(world) - 1):
        epoch = world.epoch(number)
        for seen in (*epoch.ground, epoch.airborne):
            tracked = np.isfinite(seen.code_m[0])
            assert tracked[IS_GPS].sum() == tracked[~IS_GPS].sum() == SATELLITES_A_SYSTEM
    assert len(world.epoch(0).ground) == 4


def test_steps_are_measured_on_positions_of_thirty_satellites():
    part = measure_steps(make_flight(SETTLE_EPOCHS + 10))
    figures = {figure.name: figure for figure in part.figures}
    both = figures["ground step, both"].value
    assert 0.0 < figures["ground step: monitor"].value < both
    assert all(math.isfinite(figure.ratio) and figure.ratio > 0.0 for figure in part.figures)
    assert set(part.details) >= {"monitor [us]", "position [us]", "vdb decode [us]", "table encode [us]"}


WEEK = 2400


def _bag(folder: Path) -> Path:
    """Two epochs of two receivers, with known times of arrival; the second epoch has no protection level."""
    observations = [topics.resolve(name) for name in (*topics.GROUND_OBSERVATIONS[:2], topics.AIRBORNE_OBSERVATIONS)]
    protection = topics.resolve(topics.AIRBORNE_PROTECTION)
    writer = BagWriter(folder, flush_period_s=None)
    for name in (*observations, protection):
        writer.log.add_topic(Topic(name=name, msgtype="std_msgs/msg/Float64MultiArray"))
    writer.log.add_topic(Topic(name=topics.VDB, msgtype="std_msgs/msg/UInt8MultiArray"))

    def write(topic, message, at_ms):
        at_ns = at_ms * 1_000_000
        writer.log.write(topic, serialize_message(message), at_ns, at_ns)

    for tow_s, start_ms in ((100.0, 1000), (100.5, 1500)):
        for topic, late_ms in zip(observations, (1, 3, 4), strict=True):
            record = ObservationEpoch(gps_week=WEEK, tow_s=tow_s)
            write(topic, ros.table_to_msg(tables.OBSERVATIONS, record), start_ms + late_ms)
        for slot, late_ms in ((0, 9), (1, 11)):
            burst = Burst(gps_week=WEEK, tow_s=tow_s, slot=slot, bursts_in_frame=2, payload=b"\0" * 20)
            write(topics.VDB, ros.burst_to_msg(burst), start_ms + late_ms)
    record = ProtectionEpoch(gps_week=WEEK, tow_s=100.0)
    write(protection, ros.table_to_msg(tables.PROTECTION, record), 1020)
    writer.close()
    return folder


def test_arrivals_come_from_the_bag(tmp_path):
    seen, lost = read_arrivals(_bag(tmp_path / "bag"))
    assert lost == 0
    assert seen.key.tolist() == [epoch_key(WEEK, 100.0)]
    times = [seen.first_ground_s, seen.last_ground_s, seen.airborne_s, seen.burst_s, seen.protection_s]
    # Half a microsecond: times are doubles of seconds.
    np.testing.assert_allclose(np.ravel(times), [1.001, 1.003, 1.004, 1.011, 1.020], atol=5e-7)
    assert seen.n_messages == 11
    assert seen.protected.tolist() == [False]


def test_a_run_without_protection_levels_is_refused(tmp_path):
    seen, _ = read_arrivals(_bag(tmp_path / "bag"))
    with pytest.raises(GbasError, match="0 of 1 epochs have protection levels"):
        _settled(seen, 0)


def test_without_recorded_data_the_part_says_why(tmp_path):
    assert "GBAS_DATA" in measure_process(None, repeats=1).skipped
    assert str(tmp_path) in measure_process(tmp_path, repeats=1).skipped


def test_an_unknown_part_is_refused(tmp_path):
    with pytest.raises(GbasError, match=r"--part speed is not one of steps"):
        run_bench(tmp_path / "out", parts=("speed",))


def test_the_report_names_machine_figures_and_what_was_left_out(capsys):
    parts = [Part(name="p", about="a", figures=(figure(),)), Part(name="q", about="a", skipped="no data")]
    report = document(environment(), parts)
    print_report(json.loads(json.dumps(report)))
    shown = capsys.readouterr().out
    assert str(report["environment"]["cores"]) in shown
    assert "2 ms" in shown
    assert "4" in shown
    assert "no data" in shown
    assert report["parts"][0]["figures"][0]["ratio"] == 4.0


def test_figures_are_set_against_those_of_an_earlier_report(tmp_path, capsys):
    def report(time_ms, speed, commit):
        figures = (figure(value=time_ms), figure(name="m", value=speed, unit="x", better="more"))
        parts = [Part(name="p", about="a", figures=figures), Part(name="q", about="a", skipped="no data")]
        return json.loads(json.dumps(document({**environment(), "commit": commit}, parts)))

    (tmp_path / "bench.json").write_text(json.dumps(report(8.0, 10.0, "abc1234")))
    before, now = read_report(tmp_path / "bench.json"), report(2.0, 10.0, "def5678")
    assert [each.ratio for each in changes(now, before)] == [4.0, 1.0]
    assert mean_ratio(changes(now, before)) == pytest.approx(2.0)
    assert other_machine(now, before) == ()
    print_changes(now, {**before, "environment": {**before["environment"], "cores": 999}})
    shown = capsys.readouterr().out
    assert "against abc1234" in shown
    assert "another machine" in shown
    assert "cores 999" in shown


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"parts": [{"part": "p", "figures": [{"value": 0}]}]}'])
def test_other_files_are_no_reports(tmp_path, text):
    (tmp_path / "other.json").write_text(text)
    with pytest.raises(ConfigError, match=r"other.json: is not a report of gbas bench"):
        read_report(tmp_path / "other.json")
    with pytest.raises(ConfigError, match="nowhere.json: cannot be read: No such file"):
        read_report(tmp_path / "nowhere.json")


@pytest.mark.campaign
@pytest.mark.ros
def test_every_part_gives_figures(tmp_path, monkeypatch, data_dir):
    monkeypatch.setenv("GBAS_DATA", str(data_dir))
    report = run_bench(tmp_path / "out", quick=True)
    assert [part["part"] for part in report["parts"]] == list(PARTS)
    for part in report["parts"]:
        assert part["figures"], part
        assert all(figure["ratio"] > 0.0 for figure in part["figures"])
    latency = next(part for part in report["parts"] if part["part"] == "latency")
    assert latency["details"]["lost"] == 0
    assert json.loads((tmp_path / "out" / "bench.json").read_text()) == report


def test_the_monitors_are_timed_by_names_the_station_has():
    assert all(callable(getattr(module, name)) for module, name in monitors._MEASURED)
