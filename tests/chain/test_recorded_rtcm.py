"""RTCM 3 streams through ``gbas process``: as the RINEX files they are made of, with gaps, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_chain.process import ProcessResult, process
from gbas_core.io.recording import Recording, RecordingError
from gbas_core.io.rinex import read_observations
from gbas_core.io.rtcm import RtcmError
from gbas_ground.nodes.receiver_replay import ReceiverReplayParams
from recorded_sets import request
from rtcm_writer import frames_of

SET = "mosaic_base_rover"
WEEK = 2320  # of 2024-06-24
IMU = "raw_streams/imu_rtcm.rtcm3"


def as_stream(path: Path, folder: Path, *, without: tuple[int, ...] = ()) -> Path:
    """A RINEX file as MSM7, without the messages of some epochs."""
    source = read_observations(path)
    stream = folder / f"{path.name}.bin"
    stream.write_bytes(b"".join(frames_of(source, [row for row in range(len(source)) if row not in without])))
    return stream


@pytest.fixture(scope="module")
def from_rinex(data_dir: Path) -> ProcessResult:
    return process(request(SET, data_dir))


def test_streams_give_what_their_rinex_files_give(from_rinex: ProcessResult, data_dir: Path, tmp_path: Path) -> None:
    item = request(SET, data_dir)
    ground = tuple(as_stream(path, tmp_path) for path in item.ground)
    user = as_stream(item.user, tmp_path)
    result = process(request(SET, data_dir, ground=ground, user=user, gps_week=WEEK))
    assert len(result.rows) == len(from_rinex.rows)
    solved = 0
    for ours, theirs in zip(result.rows, from_rinex.rows, strict=True):
        assert (ours.tow_s, ours.position_m is None) == (theirs.tow_s, theirs.position_m is None)
        if ours.position_m is not None and theirs.position_m is not None:
            solved += 1
            # Steps of 0.6 mm (code), 0.1 mm (carrier) and 1/16 dB, which now and then move a broadcast correction by
            # its own step of 1 cm.
            assert np.abs(np.array(ours.position_m) - theirs.position_m).max() < 0.03
            assert ours.vpl_m == pytest.approx(theirs.vpl_m, rel=0.01)
    assert solved > 30
    replay = result.run_file["/gbas/receiver_replay"]["ros__parameters"]
    assert replay["gps_week"] == WEEK
    assert ReceiverReplayParams(**{**replay, "ground_files": tuple(replay["ground_files"])}).gps_week == WEEK


def test_gaps_of_a_stream_are_survived(from_rinex: ProcessResult, data_dir: Path, tmp_path: Path) -> None:
    """A short gap of the station is bridged, a long one ends the service; no position is ever unbounded."""
    item = request(SET, data_dir)
    ground = tuple(as_stream(path, tmp_path, without=(260, 261, *range(280, 290))) for path in item.ground)
    result = process(request(SET, data_dir, ground=ground, gps_week=WEEK))
    by_time = {row.tow_s: row for row in result.rows}
    begin = from_rinex.rows[0].tow_s
    there = [row.tow_s - begin for row in result.rows if row.position_m is not None]
    assert any(250 <= second < 260 for second in there)
    assert any(265 <= second < 280 for second in there)
    assert not any(second >= 290 for second in there)  # the filters start again, and need 230 s
    for row in by_time.values():
        assert row.position_m is None or np.isfinite([row.vpl_m, row.lpl_m]).all()


def test_a_stream_with_ephemerides_is_its_own_navigation(data_dir: Path) -> None:
    path = data_dir / IMU
    recording = Recording.open([path], None, [path])
    assert len(recording.keys) == 134
    received = recording.ephemerides()
    assert received[0].toe_week[np.isfinite(received[0].toe_week)].tolist() == [2266.0] * 15
    assert Recording.open([path], None, [path], gps_week=2266).keys.tolist() == recording.keys.tolist()


def test_what_is_refused(data_dir: Path, tmp_path: Path) -> None:
    item = request(SET, data_dir)
    stream = as_stream(item.user, tmp_path)
    with pytest.raises(RtcmError, match="give the GPS week of its first epoch"):
        process(request(SET, data_dir, user=stream))
    with pytest.raises(RecordingError, match="no epoch in common|expected navigation files of that time"):
        process(request(SET, data_dir, user=stream, gps_week=WEEK + 1))
    with pytest.raises(RecordingError, match=r"imu_rtcm\.rtcm3 is RTCM 3 and the rest is not"):
        process(request(SET, data_dir, navigation=(*item.navigation, data_dir / IMU)))
    with pytest.raises(ValueError, match="gps_week"):
        ReceiverReplayParams(ground_files=("a",), nav_files=("b",), gps_week=-2)
