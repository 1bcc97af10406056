"""What a check must find, and that it names file, topic and message."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gbas_bags.check import check
from gbas_bags.problems import CheckResult
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_msgs_py import topics
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event

RR1 = topics.resolve(topics.GROUND_OBSERVATIONS[0])
AIRBORNE = topics.resolve(topics.AIRBORNE_OBSERVATIONS)
SOLUTION = topics.resolve(topics.AIRBORNE_SOLUTION)
PROTECTION = topics.resolve(topics.AIRBORNE_PROTECTION)


@pytest.fixture
def checked(fake_bag: Any, tmp_path: Path) -> Callable[..., CheckResult]:
    """Check a bag after `change` has had its way with the content."""

    def run(change: Callable[[Any], object] = lambda fake: None, **options: Any) -> CheckResult:
        fake = fake_bag(**options)
        change(fake)
        fake.write(tmp_path / "flight")
        return check(tmp_path / "flight")

    return run


def only_problem(result: CheckResult) -> tuple[str | None, int | None, str]:
    assert len(result.problems) == 1, [str(problem) for problem in result.problems]
    (problem,) = result.problems
    assert problem.file.endswith("flight_0.mcap")
    assert str(problem).startswith(problem.file)
    return problem.topic, problem.index, problem.what


def test_good_bag_has_no_problem(checked: Any) -> None:
    result = checked()
    assert result.ok, [str(problem) for problem in result.problems]
    assert result.checked["payloads decoded"] == result.messages == result.checked["messages read by rosbags"]
    # Without service, with it, and without again.
    assert result.checked["alerts traced"] == 3
    assert result.notes == []


def damaged(data: bytes, at: int, value: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def test_damaged_payload_is_named(checked: Any) -> None:
    """An infinite number in message 7 of the solution: a table has finite numbers and NaN."""

    def change(fake: Any) -> None:
        key, data = fake.content[SOLUTION][7]
        fake.content[SOLUTION][7] = (key, data[:-8] + np.array(np.inf).tobytes())

    topic, index, what = only_problem(checked(change))
    assert (topic, index) == (SOLUTION, 7)
    assert "is infinite" in what


def test_cut_payload_is_named(checked: Any) -> None:
    def change(fake: Any) -> None:
        key, data = fake.content[AIRBORNE][3]
        fake.content[AIRBORNE][3] = (key, data[:-40])

    result = checked(change)
    assert [(p.topic, p.index) for p in result.problems if p.index is not None] == [(AIRBORNE, 3)]


def test_unknown_schema_version_is_named(checked: Any) -> None:
    def change(fake: Any) -> None:
        key, data = fake.content[SOLUTION][5]
        fake.content[SOLUTION][5] = (key, data.replace(b"gbas/solution/2", b"gbas/solution/9"))

    result = checked(change)
    assert (SOLUTION, 5) in [(problem.topic, problem.index) for problem in result.problems]
    assert any("version '9'" in problem.what for problem in result.problems)


def test_tables_of_an_older_version_are_told_once_and_what_can_be_done(checked: Any) -> None:
    def change(fake: Any) -> None:
        for topic, name in ((SOLUTION, b"solution"), (PROTECTION, b"protection")):
            new, old = b"gbas/" + name + b"/2", b"gbas/" + name + b"/1"
            fake.content[topic] = [(key, data.replace(new, old)) for key, data in fake.content[topic]]

    result = checked(change)
    assert [(problem.topic, problem.what) for problem in result.problems] == [
        (SOLUTION, "40 tables are gbas/solution/1, and gbas/solution/2 is read: not checked"),
        (PROTECTION, "40 tables are gbas/protection/1, and gbas/protection/2 is read: not checked"),
    ]
    assert result.notes == [
        "written with older versions of protection/1 (read: 2), solution/1 (read: 2); its observations and ephemerides "
        "are read: gbas replay makes the rest anew"
    ]


def test_schema_of_another_topic_is_named(checked: Any) -> None:
    def change(fake: Any) -> None:
        fake.content[SOLUTION][5] = fake.content[PROTECTION][5]

    result = checked(change)
    assert any(problem.index == 5 and "expected 'gbas/solution/2'" in problem.what for problem in result.problems)


def test_wrong_crc_of_a_message_block_is_named(checked: Any, tmp_path: Path) -> None:
    def change(fake: Any) -> None:
        key, data = fake.content[topics.VDB][4]
        start = data.rindex(b"\xaa")
        fake.content[topics.VDB][4] = (key, damaged(data, start + 6, b"\xff\xff\xff\xff\xff\xff\xff\xff"))

    topic, index, what = only_problem(checked(change))
    assert (topic, index) == (topics.VDB, 4)
    assert "gbas/vdb_burst/1" in what


def test_text_that_is_no_event_is_named(checked: Any) -> None:
    def change(fake: Any) -> None:
        key, data = fake.content[topics.EVENTS][1]
        fake.content[topics.EVENTS][1] = (key, data.replace(b"alert", b"alarm"))

    result = checked(change)
    assert (topics.EVENTS, 1) in [(problem.topic, problem.index) for problem in result.problems]


def test_missing_output_is_found(checked: Any) -> None:
    topic, _, what = only_problem(checked(lambda fake: fake.content[SOLUTION].pop(20)))
    assert topic == SOLUTION
    assert "1 epochs are missing that was observed" in what
    assert "345610.000" in what


def test_missing_receiver_epoch_is_found(checked: Any) -> None:
    topic, _, what = only_problem(checked(lambda fake: fake.content[RR1].pop(20)))
    assert topic == RR1
    assert "another receiver has" in what


def test_repeated_epoch_is_found(checked: Any) -> None:
    def change(fake: Any) -> None:
        fake.content[PROTECTION].insert(12, fake.content[PROTECTION][11])

    topic, index, what = only_problem(checked(change))
    assert (topic, index) == (PROTECTION, 12)
    assert "345605.500" in what


def test_gap_of_all_receivers_is_a_note(checked: Any) -> None:
    """The receivers may have stopped; the numbering shows that the recorder lost nothing."""

    def change(fake: Any) -> None:
        for messages in fake.content.values():
            messages[:] = [item for item in messages if not fake.keys[15] <= item[0] < fake.keys[20]]

    result = checked(change)
    assert result.ok, [str(problem) for problem in result.problems]
    assert any("no receiver observed for 3 s" in note for note in result.notes)


def test_epochs_under_way_at_the_end_are_a_note(checked: Any) -> None:
    result = checked(lambda fake: fake.content[PROTECTION].pop())
    assert result.ok
    assert any(PROTECTION in note for note in result.notes)


def test_missing_burst_of_a_frame_is_found(checked: Any) -> None:
    def change(fake: Any) -> None:
        key, data = fake.content[topics.VDB][9]
        # The fifth number of the layout, bursts_in_frame, is the only 1 of four bytes behind its label.
        label = data.index(b"bursts_in_frame\x00") + len(b"bursts_in_frame\x00")
        fake.content[topics.VDB][9] = (key, damaged(data, label, b"\x02\x00\x00\x00"))

    topic, index, what = only_problem(checked(change))
    assert (topic, index) == (topics.VDB, 9)
    assert "has 1 bursts, and says 2" in what


def test_alert_without_event_is_found(checked: Any) -> None:
    topic, index, what = only_problem(checked(lambda fake: fake.content[topics.EVENTS].pop(2)))
    assert (topic, index) == (PROTECTION, 30)
    assert "the alert at" in what
    assert "has no event" in what


def test_end_of_alert_without_event_is_found(checked: Any) -> None:
    topic, index, what = only_problem(checked(lambda fake: fake.content[topics.EVENTS].pop(1)))
    assert (topic, index) == (PROTECTION, 10)
    assert "end of an alert" in what


def test_alert_whose_event_lacks_the_threshold_is_found(checked: Any) -> None:
    def change(fake: Any) -> None:
        key = fake.keys[30]
        week, tow_s = from_epoch_key(key)
        event = Event(gps_week=week, tow_s=tow_s, kind=EventKind.ALERT, subject="navigation", cause="vpl_above_val",
                      value=11.0, threshold=math.nan)  # fmt: skip
        text = event.to_json().encode()
        data = b"\x00\x01\x00\x00" + (len(text) + 1).to_bytes(4, "little") + text + b"\x00"
        fake.content[topics.EVENTS][2] = (key, data)

    topic, index, what = only_problem(checked(change))
    assert (topic, index) == (PROTECTION, 30)
    assert "lacks value or threshold" in what


def test_damaged_file_is_found(fake_bag: Any, tmp_path: Path) -> None:
    fake_bag().write(tmp_path / "flight", chunk_bytes=20_000)
    file = tmp_path / "flight" / "flight_0.mcap"
    data = bytearray(file.read_bytes())
    data[data.index(b"zstd") + 100] ^= 0x10  # within the records of the first chunk
    file.write_bytes(data)
    result = check(tmp_path / "flight")
    texts = [str(problem) for problem in result.problems]
    assert any("at byte" in text for text in texts)
    assert any("mcap cannot read it" in text for text in texts)


def test_damage_between_the_chunks_is_found(fake_bag: Any, tmp_path: Path) -> None:
    """The CRC of the data section covers what no chunk does: here a letter of the stored configuration."""
    fake_bag().write(tmp_path / "flight", metadata={"gbas.configuration": {"a.yaml": "gcid: 1"}})
    file = tmp_path / "flight" / "flight_0.mcap"
    file.write_bytes(file.read_bytes().replace(b"gcid: 1", b"gcid: 2"))
    assert any("mcap cannot read it" in str(problem) for problem in check(tmp_path / "flight").problems)


def test_unclosed_bag_is_found(fake_bag: Any, tmp_path: Path) -> None:
    writer = fake_bag().write(tmp_path / "flight", close=False)
    writer.log.flush()
    texts = [str(problem) for problem in check(tmp_path / "flight").problems]
    assert any("never closed" in text for text in texts)
    assert any("metadata.yaml is missing" in text for text in texts)


def test_random_damage_is_always_a_finding(fake_bag: Any, tmp_path: Path) -> None:
    """Every byte is under some CRC, or part of what readers need; and no damage ends in a crash."""
    fake_bag(epochs=12, served_from=3, lost_at=9).write(tmp_path / "flight", chunk_bytes=5_000)
    file = tmp_path / "flight" / "flight_0.mcap"
    original = file.read_bytes()
    numbers = random.Random(3)
    for _ in range(60):
        data = bytearray(original)
        at = numbers.randrange(8, len(data) - 8)
        data[at] ^= 1 << numbers.randrange(8)
        file.write_bytes(data)
        result = check(tmp_path / "flight")
        assert not result.ok, f"a bit of byte {at} of {len(data)}"
