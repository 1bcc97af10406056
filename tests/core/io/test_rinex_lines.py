"""Files as people have them: marks before the first line, last lines without an end, strays, sites that change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_core.io.recording import Recording
from gbas_core.io.rinex import read_navigation, read_observations
from gbas_core.io.rinex.lines import is_whole
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import L1

G05 = SAT_INDEX["G05"]
PLACE = "  4157177.0658   671230.4766  4774767.0311"
MOVED = "  4157178.0658   671230.4766  4774767.0311"


def header(types: str = "G    3 C1C L1C S1C") -> str:
    lines = (
        ("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE"),
        ("MARK", "MARKER NAME"),
        ("1                   ANTENNA         NONE", "ANT # / TYPE"),
        (PLACE, "APPROX POSITION XYZ"),
        ("        0.0000        0.0000        0.0000", "ANTENNA: DELTA H/E/N"),
        (types, "SYS / # / OBS TYPES"),
        ("  2024    01    01    00    00    0.0000000     GPS", "TIME OF FIRST OBS"),
        ("", "END OF HEADER"),
    )
    return "".join(f"{value:60}{label}\n" for value, label in lines)


def epoch(second: int) -> str:
    satellite = f"G05{23456789.123 + second:14.3f}  {1.2e8 + second:14.3f} 5{45.0:14.3f}\n"
    return f"> 2024 01 01 00 00 {second:10.7f}  0  1\n{satellite}"


def event(flag: int, *records: tuple[str, str]) -> str:
    return f"> {'':29}{flag}{len(records):3d}\n" + "".join(f"{value:60}{label}\n" for value, label in records)


def written(folder: Path, text: str) -> Path:
    path = folder / "a.obs"
    path.write_bytes(text.encode("utf-8"))
    return path


def test_a_byte_order_mark_is_no_part_of_the_header(tmp_path: Path) -> None:
    text = header() + epoch(0) + epoch(1)
    marked = read_observations(written(tmp_path, "\ufeff" + text))
    assert len(marked) == 2
    assert marked.notes == ()
    np.testing.assert_array_equal(marked.code_m, read_observations(written(tmp_path, text)).code_m)


def test_a_whole_last_line_needs_no_end(tmp_path: Path) -> None:
    text = (header() + epoch(0) + epoch(1)).removesuffix("\n")
    assert is_whole(text)
    kept = read_observations(written(tmp_path, text))
    assert len(kept) == 2
    assert kept.notes == ("the last line has no end; its values are all there, so it was kept",)
    for cut in range(1, 45):  # every shorter last line but one that ends where a line may
        found = read_observations(written(tmp_path, text[:-cut]))
        assert len(found) == 1, cut
        assert found.notes


def test_a_carrier_at_the_end_needs_its_flag(tmp_path: Path) -> None:
    """Without it, a cut loss-of-lock indicator would read as none lost."""
    types = "G    2 C1C L1C"
    line = f"G05{23456789.123:14.3f}  {1.2e8:14.3f}"
    start = header(types) + "> 2024 01 01 00 00  0.0000000  0  1\n"
    assert not is_whole(start + line)
    assert is_whole(start + line + "1")


@pytest.mark.parametrize("name", ["brdc0770.11n.gz"])
def test_navigation_files_need_no_end_either(name: str, data_dir: Path, tmp_path: Path) -> None:
    import gzip

    text = gzip.decompress((data_dir / "static_pair_L1L2_1h_2010" / name).read_bytes()).decode("ascii").rstrip("\n")
    path = tmp_path / "a.nav"
    whole = read_navigation([data_dir / "static_pair_L1L2_1h_2010" / name])
    path.write_text(text, encoding="ascii")
    assert read_navigation([path]).values.shape == whole.values.shape
    path.write_text(text.rstrip()[:-3], encoding="ascii")
    assert any("cut off" in note for note in read_navigation([path]).notes)


def test_strays_between_epochs_are_counted(tmp_path: Path) -> None:
    text = header() + epoch(0) + "this is no record\n\n" + epoch(1) + "nor is this\n" + epoch(2)
    found = read_observations(written(tmp_path, text))
    assert len(found) == 3
    assert found.notes == ("2 lines between the epochs are no records and were left out",)


@pytest.mark.parametrize(
    ("what", "note"),
    [
        (event(3, ("NEW", "MARKER NAME")), "a new site, MARKER NAME NEW"),
        (event(2), "the antenna begins to move"),
        (event(4, (MOVED, "APPROX POSITION XYZ")), "APPROX POSITION XYZ 4157178.0658 671230.4766 4774767.0311"),
        (
            event(4, ("        0.1000        0.0000        0.0000", "ANTENNA: DELTA H/E/N")),
            "ANTENNA: DELTA H/E/N 0.1000",
        ),
        (event(4, ("2                   ANTENNA         NONE", "ANT # / TYPE")), "ANT # / TYPE 2 ANTENNA NONE"),
    ],
)
def test_changes_of_the_site_are_told_and_restart_a_reference_receiver(tmp_path: Path, what: str, note: str) -> None:
    path = written(tmp_path, header() + epoch(0) + epoch(1) + what + epoch(2) + epoch(3))
    found = read_observations(path)
    assert len(found.notes) == 1
    assert found.notes[0].startswith("before 2024-01-01 00:00:02")
    assert note in found.notes[0]
    assert found.site_changes == (2,)
    assert not (np.nan_to_num(found.lli) > 0.0).any()
    lost = found.restarted_at_site_changes().lli[:, L1, G05]
    np.testing.assert_array_equal(lost == 1.0, [False, False, True, False])


def test_what_a_file_says_again_is_no_change(tmp_path: Path) -> None:
    """Files put together repeat their headers."""
    again = event(4, ("MARK", "MARKER NAME"), (PLACE.replace("  4157177.0658", "4157177.06580"), "APPROX POSITION XYZ"),
                  ("1                   ANTENNA         NONE", "ANT # / TYPE"))  # fmt: skip
    found = read_observations(written(tmp_path, header() + epoch(0) + again + epoch(1)))
    assert found.notes == ()
    assert found.site_changes == ()
    assert found.restarted_at_site_changes() is found


def test_a_recording_restarts_its_reference_receivers_only(data_dir: Path, tmp_path: Path) -> None:
    text = header() + epoch(0) + epoch(1) + event(3) + epoch(2)
    text = text.replace("2024 01 01 00 00", "2024 06 24 08 20")
    text = text.replace("2024    01    01    00    00", "2024    06    24    08    20")
    path = written(tmp_path, text)
    navigation = data_dir / "static_pair_L1L5_2024" / "base.nav.gz"
    recording = Recording.open([path], path, [navigation])
    last = list(recording.epochs())[-1]
    assert last.ground[0] is not None
    assert last.user is not None
    assert last.ground[0].lli[L1, G05] == 1.0
    assert last.user.lli[L1, G05] == 0.0
