"""Playing a bag: what is sent together, and that what is played is what was recorded."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from gbas_bags.bags import BagReader
from gbas_bags.compare import compare
from gbas_bags.epochs import payload
from gbas_bags.mcap_scan import Channel, Message, Schema
from gbas_bags.player import by_epoch, is_input
from gbas_bringup.environment import process_environment
from gbas_bringup.launcher import RunPlan
from gbas_bringup.node_kinds import NODE_KINDS, NodeInstance
from gbas_bringup.run_config import RunConfig
from gbas_bringup.runs import execute
from gbas_cli.replay import ReplayRequest, ReplayResult, play
from gbas_msgs_py import topics
from started_nodes import LoggedNode

PLAYER, RECORDER = (NodeInstance(kind=NODE_KINDS[name]) for name in ("player", "recorder"))


def message(topic: str, number: int) -> Message:
    return Message(Channel(topic, Schema("", "", ""), "cdr", {}), number, number, number, number, b"")


def grouped(*items: tuple[str, int | None]) -> list[tuple[int, list[str]]]:
    """Epochs made of (name, key) pairs."""
    keys = {number: key for number, (_, key) in enumerate(items)}
    messages = [message(name, number) for number, (name, _) in enumerate(items)]
    epochs = by_epoch(iter(messages), lambda each: keys[each.index])
    return [(epoch.key, [each.channel.topic for each in epoch.messages]) for epoch in epochs]


def test_messages_of_an_epoch_are_sent_together() -> None:
    found = grouped(("rr1", 10), ("rr2", 10), ("rr1", 20), ("air", 10), ("rr2", 20))
    assert found == [(10, ["rr1", "rr2", "air"]), (20, ["rr1", "rr2"])]


def test_what_has_no_epoch_goes_with_the_earliest_not_sent() -> None:
    """Ephemerides: earlier than recorded is harmless, nodes use them from their own epoch on; later is not."""
    assert grouped(("eph", None), ("rr1", 10), ("eph2", None), ("rr1", 20)) == [
        (10, ["eph", "rr1", "eph2"]),
        (20, ["rr1"]),
    ]


def test_epochs_are_sent_in_order_whatever_the_order_of_the_bag() -> None:
    assert [key for key, _ in grouped(("a", 20), ("b", 10), ("a", 30), ("b", 20))] == [10, 20, 30]


def test_epoch_that_comes_back_is_left_out() -> None:
    many = [("a", 10 * number) for number in range(100)]
    found = grouped(*many, ("late", 10))
    assert [key for key, _ in found] == [10 * number for number in range(100)]


@pytest.mark.parametrize(
    ("topic", "expected"),
    [
        ("/gbas/ground/rr1/observations", True),
        ("/gbas/airborne/observations", True),
        ("/gbas/second/airborne/observations", True),
        ("/gbas/ephemeris", True),
        ("/gbas/airborne/ephemeris", True),
        ("/gbas/truth/airborne", True),
        ("/gbas/ground/integrity", False),
        ("/gbas/vdb", False),
        ("/gbas/airborne/solution", False),
        ("/gbas/events", False),
        ("/clock", False),
    ],
)
def test_inputs_are_what_no_node_computes(topic: str, expected: bool) -> None:
    assert is_input(topic) is expected


def flip(data: bytes, at: int) -> bytes:
    """The same with one bit of byte `at` (from the end) changed."""
    changed = bytearray(data)
    changed[at] ^= 1
    return bytes(changed)


def test_comparison_finds_one_bit(fake_bag: Any, tmp_path: Path) -> None:
    """One bit of one number, one output that is gone, one that was not recorded."""
    solution, protection = (topics.resolve(name) for name in (topics.AIRBORNE_SOLUTION, topics.AIRBORNE_PROTECTION))
    recorded, replayed = fake_bag(), fake_bag()
    recorded.content[protection].pop(0)
    key, data = replayed.content[solution][5]
    at = data.index(struct.pack("<d", 3.84e6 + 5))  # x_m, as the factory sets it
    replayed.content[solution][5] = (key, flip(data, at))
    replayed.content[solution].pop(7)
    recorded.write(tmp_path / "a")
    replayed.write(tmp_path / "b")
    results = {result.topic: result for result in compare(tmp_path / "a", tmp_path / "b")}
    found = results[solution]
    assert (found.recorded, found.identical, found.different, found.missing, found.extra) == (40, 38, 1, 1, 0)
    assert found.first_difference is not None
    assert found.first_difference["column"] == "x_m"
    where = "the first difference is at 2400 345602.500, largest in x_m: 3840005.0 became "
    assert found.explanation().startswith(where)
    assert found.verdict() == "38 of 40 solutions identical bit for bit; 1 different, 1 missing"
    assert results[protection].same
    assert results[protection].extra == 1
    assert results[topics.VDB].verdict() == "40 of 40 VDB bursts identical bit for bit"


def test_tables_of_an_older_version_are_not_compared_and_said(fake_bag: Any, tmp_path: Path) -> None:
    """They neither pass nor fail; what both versions write alike still counts."""
    solution = topics.resolve(topics.AIRBORNE_SOLUTION)
    recorded, replayed = fake_bag(), fake_bag()
    old = [(key, data.replace(b"gbas/solution/2", b"gbas/solution/1")) for key, data in recorded.content[solution]]
    recorded.content[solution] = old
    recorded.write(tmp_path / "a")
    replayed.write(tmp_path / "b")
    found = compare(tmp_path / "a", tmp_path / "b")
    results = {result.topic: result for result in found}
    assert results[solution].verdict() == "40 solutions are gbas/solution/1, and gbas/solution/2 is made: not compared"
    assert not results[solution].same
    assert results[topics.VDB].verdict() == "40 of 40 VDB bursts identical bit for bit"
    outcome = ReplayResult(bag=tmp_path / "a", replayed=tmp_path / "b", topics=tuple(found))
    assert not outcome.identical
    assert not outcome.differs
    only_old = ReplayResult(bag=tmp_path / "a", replayed=tmp_path / "b", topics=(results[solution],))
    assert only_old.differs


def test_comparison_knows_padding_from_payload(fake_bag: Any, tmp_path: Path) -> None:
    """Some transports put up to three zero bytes behind a message."""
    padded = fake_bag()
    padded.content[topics.VDB] = [(key, data + bytes(3)) for key, data in padded.content[topics.VDB]]
    fake_bag().write(tmp_path / "a")
    padded.write(tmp_path / "b")
    assert all(result.same for result in compare(tmp_path / "a", tmp_path / "b"))


# --- with nodes


def play_into(bag: Path, directory: Path, domain: int, mode: str) -> Path:
    """Play a bag to a recorder; returns the new bag."""
    directory.mkdir()
    config = directory / "none.yaml"
    config.write_text("/**: {ros__parameters: {}}\n")
    plan = RunPlan(
        config=RunConfig(path=config, nodes=(PLAYER, RECORDER), parameters={}),
        directory=directory,
        speed=0.0,
        domain=domain,
        isolated=True,
        overrides={
            PLAYER.full_name: {
                "bag": str(bag),
                "mode": mode,
                "wait_for": [""],
                "wait_for_ground": ["recorder"] if mode == "inputs" else [""],
                "recorders": 0 if mode == "inputs" else 1,  # the recorder is the one reader
            }
        },
    )
    execute(plan, title="test", quiet=True)
    return plan.bag_path


def contents(bag: Path, chosen: Any) -> Counter[tuple[str, bytes]]:
    """Topics and payloads; some transports put zero bytes behind a message."""
    messages = [each for each in BagReader(bag).messages() if chosen(each.channel.topic)]
    return Counter((each.channel.topic, payload(each.channel.schema.name, each.data)) for each in messages)


@pytest.mark.ros
def test_inputs_are_played_byte_for_byte(fake_bag: Any, tmp_path: Path, domain: int) -> None:
    fake_bag(epochs=200).write(tmp_path / "a")
    played = play_into(tmp_path / "a", tmp_path / "run", domain, "inputs")
    assert contents(played, is_input) == contents(tmp_path / "a", is_input)
    assert not contents(played, lambda topic: topic in (topics.VDB, topics.resolve(topics.AIRBORNE_SOLUTION)))


@pytest.mark.ros
def test_everything_is_played_byte_for_byte(fake_bag: Any, tmp_path: Path, domain: int) -> None:
    fake = fake_bag(epochs=40)
    fake.write(tmp_path / "a")
    played = play_into(tmp_path / "a", tmp_path / "run", domain, "all")
    found = contents(played, lambda topic: topic in fake.content and topic != topics.EVENTS)
    assert found == contents(tmp_path / "a", lambda topic: topic != topics.EVENTS)


@pytest.mark.ros
def test_play_only_ends_by_itself(fake_bag: Any, tmp_path: Path, domain: int) -> None:
    fake_bag(epochs=40).write(tmp_path / "a")
    play(ReplayRequest(bag=tmp_path / "a", out=tmp_path / "out", domain=domain, quiet=True))


@pytest.mark.ros
@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ((), "bag is missing (folder of a bag, or a .mcap file)"),
        (("bag:=/nowhere",), "/nowhere: there is no such bag"),
        (("bag:=/nowhere", "mode:=some"), "mode = 'some' is not one of 'inputs', 'all'"),
    ],
)
def test_bad_parameters_end_it_with_one_line(
    domain: int, tmp_path: Path, parameters: tuple[str, ...], words: str
) -> None:
    arguments = [part for each in parameters for part in ("-p", each)]
    environment = process_environment(domain=domain, isolated=True)
    code, output = LoggedNode("gbas_bags.player", ["--ros-args", *arguments], environment, tmp_path / "log").end()
    assert code == 2
    (line,) = output.splitlines()
    assert words in line
