"""What a person sees who gives ``gbas process`` the wrong files; nothing bad ends in a position."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from gbas_chain.process import process
from gbas_core.errors import GbasError
from gbas_core.io.recording import RecordingError
from gbas_core.io.rinex import RinexError
from recorded_sets import request

SET = "mosaic_base_rover"


def _cut(source: Path, target: Path, fraction: float) -> Path:
    text = gzip.decompress(source.read_bytes())
    target.write_bytes(text[: int(fraction * len(text))])
    return target


def test_truncated_user_file_is_processed_up_to_the_cut(data_dir: Path, tmp_path: Path) -> None:
    whole = request(SET, data_dir)
    cut = _cut(whole.user, tmp_path / "cut.obs", 0.8)
    result = process(request(SET, data_dir, user=cut))
    assert 0 < len(result.rows) < 301
    assert any("cut.obs" in note for note in result.notes)
    full = process(whole)
    assert [row.fields() for row in result.rows] == [row.fields() for row in full.rows[: len(result.rows)]]


def test_truncated_ground_file_ends_the_service(data_dir: Path, tmp_path: Path) -> None:
    whole = request(SET, data_dir)
    cut = _cut(whole.ground[0], tmp_path / "cut.obs", 0.9)
    result = process(request(SET, data_dir, ground=(cut,)))
    assert 0 < len(result.rows) < 301
    assert any("cut.obs" in note for note in result.notes)


def test_navigation_of_another_day_is_refused(data_dir: Path) -> None:
    other = data_dir / "static_pair_L1L2_1h_2010" / "brdc0770.11n.gz"
    with pytest.raises(RecordingError, match=r"brdc0770\.11n\.gz covers 2010-03-1.* but .*base\.obs\.gz .*2024-06-24"):
        process(request(SET, data_dir, navigation=(other,)))


def test_observations_of_another_day_are_refused(data_dir: Path) -> None:
    other = data_dir / "static_pair_L1L2_1h_2010" / "UPC10770.11o.gz"
    with pytest.raises(RecordingError, match=r"UPC10770|no epoch in common"):
        process(request(SET, data_dir, ground=(other,)))


def test_swapped_files_are_refused(data_dir: Path) -> None:
    item = request(SET, data_dir)
    with pytest.raises(RinexError, match=r"base\.nav\.gz: line 1: file type .* expected a RINEX observation file"):
        process(request(SET, data_dir, user=item.navigation[0]))


def test_missing_file_is_named(data_dir: Path) -> None:
    with pytest.raises(RinexError, match=r"nowhere\.obs: cannot be read: No such file"):
        process(request(SET, data_dir, user=Path("nowhere.obs")))


def test_positions_must_be_one_each(data_dir: Path) -> None:
    with pytest.raises(GbasError, match="--ground-xyz: 2 positions for 1 ground files"):
        process(request(SET, data_dir, ground_xyz_m=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))))


def test_wrong_antenna_position_gives_no_position(data_dir: Path) -> None:
    """A station told that it stands 1 km further east sees it in its ranges and broadcasts nothing."""
    x, y, z = request(SET, data_dir).ground_xyz_m[0]
    east = np.array([-y, x, 0.0]) / np.hypot(x, y)
    moved = tuple(float(value) for value in np.array([x, y, z]) + 1000.0 * east)
    result = process(request(SET, data_dir, ground_xyz_m=(moved,)))
    assert all(row.position_m is None and row.alert for row in result.rows)
    assert np.isnan([row.vpl_m for row in result.rows]).all()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ground: [1, 2", "is not YAML"),
        ("ground:\n  station: {id: TOOLONG, gcid: 1}\n", "station.id = 'TOOLONG'"),
        (
            "ground:\n  station: {id: TEST, gcid: 1, colour: red}\n",
            "station.colour is unknown; known are gcid, height_m",
        ),
        ("airborne: {}\n", "has no section 'ground'"),
    ],
)
def test_bad_station_file_is_named(data_dir: Path, tmp_path: Path, text: str, expected: str) -> None:
    station = tmp_path / "station.yaml"
    station.write_text(text, encoding="utf-8")
    with pytest.raises((GbasError, ValueError)) as caught:
        process(request(SET, data_dir, station=station))
    assert "station.yaml" in str(caught.value)
    assert expected in str(caught.value)
