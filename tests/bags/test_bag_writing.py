"""The bags the suite writes are read by others: mcap, rosbags as a folder and as a file."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from gbas_bags.bags import BagReader
from gbas_bags.definitions import definition, qos_record
from gbas_bags.info import info
from gbas_bags.mcap_log import BagWriter, McapLog, Topic
from gbas_core.errors import BagError

METADATA = {"gbas": {"suite_version": "1.2.3", "command": "gbas test"}, "gbas.configuration": {"a.yaml": "x: 1\n"}}


@pytest.fixture
def bag(fake_bag: Any, tmp_path: Path) -> Path:
    fake_bag().write(tmp_path / "flight", metadata=METADATA, chunk_bytes=4096)
    return tmp_path / "flight"


def contents(fake: Any) -> Counter[tuple[str, bytes]]:
    return Counter((topic, data) for topic, messages in fake.content.items() for _, data in messages)


def test_mcap_reads_every_byte_back(bag: Path, fake_bag: Any) -> None:
    with (bag / "flight_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found = Counter((channel.topic, message.data) for _, channel, message in reader.iter_messages())
        stored = {record.name: record.metadata for record in reader.iter_metadata()}
    assert found == contents(fake_bag())
    assert stored["gbas"] == METADATA["gbas"]
    assert stored["gbas.configuration"] == METADATA["gbas.configuration"]


@pytest.mark.parametrize("single_file", [False, True])
def test_rosbags_reads_folder_and_file(bag: Path, fake_bag: Any, single_file: bool) -> None:
    path = bag / "flight_0.mcap" if single_file else bag
    with AnyReader([path]) as reader:
        found = Counter((connection.topic, bytes(raw)) for connection, _, raw in reader.messages())
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
    assert found == contents(fake_bag())


def test_metadata_file_is_that_of_rosbag2(bag: Path, fake_bag: Any) -> None:
    fake = fake_bag()
    document = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert document["version"] == 9
    assert document["storage_identifier"] == "mcap"
    assert document["relative_file_paths"] == ["flight_0.mcap"]
    assert document["message_count"] == sum(contents(fake).values())
    # 40 epochs 0.5 s apart last 19.5 s.
    assert document["duration"]["nanoseconds"] == 19_500_000_000
    counts = {item["topic_metadata"]["name"]: item["message_count"] for item in document["topics_with_message_count"]}
    assert counts == {topic: len(messages) for topic, messages in fake.content.items()}


def test_type_hashes_are_those_of_the_middleware() -> None:
    """The hash rosbag2 would write; this one was read from a running publisher with get_publishers_info_by_topic."""
    known = "RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f"
    assert definition("std_msgs/msg/Float64MultiArray")[1] == known


def test_qos_is_kept(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "b", flush_period_s=None)
    latched = Topic(name="/a", msgtype="std_msgs/msg/String", qos=(qos_record(depth=7, transient_local=True),))
    writer.log.add_topic(latched)
    writer.log.write("/a", b"\x00\x01\x00\x00\x01\x00\x00\x00\x00", 1, 1)
    writer.close()
    with AnyReader([tmp_path / "b"]) as reader:
        (profile,) = reader.connections[0].ext.offered_qos_profiles
    assert profile.depth == 7
    assert profile.durability.name == "TRANSIENT_LOCAL"


def test_nothing_is_overwritten(bag: Path) -> None:
    with pytest.raises(BagError, match="flight: already exists"):
        BagWriter(bag)


def test_messages_are_numbered_by_topic(bag: Path) -> None:
    numbers: dict[str, list[int]] = {}
    for message in BagReader(bag).messages():
        numbers.setdefault(message.channel.topic, []).append(message.sequence)
    assert all(found == list(range(1, len(found) + 1)) for found in numbers.values())


def test_flushed_messages_are_in_the_file_at_once(tmp_path: Path) -> None:
    log = McapLog(tmp_path / "a.mcap")
    log.add_topic(Topic(name="/a", msgtype="std_msgs/msg/Float64"))
    log.write("/a", b"\x00\x01\x00\x00" + bytes(8), 5, 5)
    assert log.flush()
    reader = BagReader(tmp_path / "a.mcap", strict=False)
    assert [message.log_time_ns for message in reader.messages()] == [5]
    assert not reader.closed
    assert not log.flush()
    log.abandon()


def test_restart_keeps_what_it_is_given_and_goes_on(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "b", metadata=METADATA, flush_period_s=None)
    writer.log.add_topic(Topic(name="/a", msgtype="std_msgs/msg/Float64"))
    writer.log.write("/a", b"\x00\x01\x00\x00" + bytes(8), 1, 1)
    writer.restart([("/a", b"\x00\x01\x00\x00" + bytes(8), 100, 1)])
    writer.log.write("/a", b"\x00\x01\x00\x00" + bytes(8), 101, 2)
    writer.close()
    assert [message.log_time_ns for message in BagReader(tmp_path / "b").messages()] == [100, 101]
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == ["b_0.mcap", "metadata.yaml"]
    assert info(tmp_path / "b").metadata["gbas"] == METADATA["gbas"]


def test_info_sums_up(bag: Path, fake_bag: Any) -> None:
    document = info(bag).as_json()
    assert document["closed"]
    assert document["origin"] == "simulated"
    assert document["suite_version"] == "1.2.3"
    assert document["command"] == "gbas test"
    assert document["configuration"] == ["a.yaml"]
    assert document["duration_s"] == 19.5
    first, last = {"gps_week": 2400, "tow_s": 345600.0}, {"gps_week": 2400, "tow_s": 345619.5}
    assert document["epochs"] == {"first": first, "last": last, "count": 40, "interval_s": 0.5}
    counts = {topic["topic"]: topic["messages"] for topic in document["topics"]}
    assert counts == {topic: len(messages) for topic, messages in fake_bag().content.items()}


def test_info_tells_recorded_from_simulated(fake_bag: Any, tmp_path: Path) -> None:
    fake_bag(simulated=0.0).write(tmp_path / "b")
    assert info(tmp_path / "b").origin == "recorded"


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda path: None, "there is no such bag"),
        (lambda path: path.mkdir(), "the folder is empty"),
        (lambda path: (path.mkdir(), (path / "notes.txt").write_text("x")), "no .mcap file in it, only notes.txt"),
        (lambda path: path.write_text("x"), "a bag is a folder or a .mcap file"),
    ],
)
def test_what_is_no_bag_is_named(make: Any, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "nothing"
    make(path)
    with pytest.raises(BagError, match=problem) as caught:
        info(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(("content", "problem"), [(b"", "the file is empty"), (b"RIFFxxxxWAVE", "is not an MCAP file")])
def test_what_is_no_mcap_is_named(content: bytes, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(BagError, match=problem):
        info(path)


def test_file_named_in_metadata_must_be_there(bag: Path) -> None:
    (bag / "flight_0.mcap").rename(bag / "other.mcap")
    with pytest.raises(BagError, match=r"metadata.yaml names flight_0.mcap, which is not there"):
        info(bag)
