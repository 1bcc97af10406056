"""Cut-off and damaged bags: everything whole is kept, the rest is counted, the original is not touched.

What must be kept is counted by the mcap library's own stream reader on the undamaged file.
"""

from __future__ import annotations

import io
import random
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.highlevel import AnyReader

from gbas_bags.bags import BagReader
from gbas_bags.info import info
from gbas_bags.recovery import recover
from gbas_core.errors import BagError

CHUNK_BYTES = 20_000
RECORD_HEAD = 9  # opcode and length


class ChunkPlace(NamedTuple):
    """A chunk in a file: where it begins and ends, and its messages."""

    start: int
    end: int
    messages: int


class Original(NamedTuple):
    """An undamaged file."""

    data: bytes
    chunks: list[ChunkPlace]
    total: int


@pytest.fixture(scope="module")
def original(fake_bag: Any, tmp_path_factory: pytest.TempPathFactory) -> Original:
    folder = tmp_path_factory.mktemp("bags") / "flight"
    metadata = {"gbas": {"suite_version": "1.2.3"}, "gbas.configuration": {"a.yaml": "x: 1"}}
    fake_bag().write(folder, metadata=metadata, chunk_bytes=CHUNK_BYTES)
    data = (folder / "flight_0.mcap").read_bytes()
    with io.BytesIO(data) as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    places = {index.chunk_start_offset: index.chunk_length for index in summary.chunk_indexes}
    records = StreamReader(io.BytesIO(data), emit_chunks=True).records
    whole = [record for record in records if isinstance(record, Chunk)]
    counts = [sum(isinstance(item, McapMessage) for item in breakup_chunk(record)) for record in whole]
    ordered = zip(sorted(places.items()), counts, strict=True)
    chunks = [ChunkPlace(start, start + length, count) for (start, length), count in ordered]
    assert len(chunks) > 5
    return Original(data, chunks, sum(counts))


def whole_before(original: Original, length: int) -> int:
    """Messages in chunks that are whole in the first `length` bytes."""
    return sum(chunk.messages for chunk in original.chunks if chunk.end <= length)


def read_by_others(bag: Path) -> Counter[str]:
    """Messages by topic; mcap with all CRCs and rosbags must agree."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        for _ in StreamReader(stream, validate_crcs=True).records:
            pass
    with file.open("rb") as stream:
        by_mcap = Counter(channel.topic for _, channel, _ in make_reader(stream, validate_crcs=True).iter_messages())
    with AnyReader([bag]) as reader:
        by_rosbags = Counter(connection.topic for connection, _, _ in reader.messages())
    assert by_mcap == by_rosbags
    return by_rosbags


def lengths(original: Original) -> list[int]:
    """Every chunk boundary, one byte to either side, and 30 other places (chosen with a fixed seed)."""
    edges = {place for chunk in original.chunks for place in (chunk.start, chunk.end)}
    others = random.Random(1).sample(range(100, len(original.data)), 30)
    return sorted({edge + step for edge in edges for step in (-1, 0, 1)} | set(others))


def test_cut_anywhere_keeps_every_whole_chunk(original: Original, tmp_path: Path) -> None:
    for length in lengths(original):
        file = tmp_path / f"cut{length}.mcap"
        file.write_bytes(original.data[:length])
        result = recover(file)
        kept = sum(result.kept.values())
        assert kept == whole_before(original, length), f"cut to {length} bytes"
        assert sum(read_by_others(result.target).values()) == kept
        assert result.damages
        assert file.read_bytes() == original.data[:length]


def test_cut_into_the_summary_loses_no_message(original: Original, tmp_path: Path) -> None:
    file = tmp_path / "cut.mcap"
    file.write_bytes(original.data[:-1])
    assert sum(recover(file).kept.values()) == original.total


def test_metadata_are_kept(original: Original, tmp_path: Path) -> None:
    file = tmp_path / "cut.mcap"
    file.write_bytes(original.data[: original.chunks[2].start + 5])
    stored = info(recover(file).target).metadata
    assert stored["gbas"] == {"suite_version": "1.2.3"}
    assert stored["gbas.configuration"] == {"a.yaml": "x: 1"}
    assert stored["gbas.recovery"]["source"] == "cut.mcap"


def test_damaged_chunk_costs_its_own_messages_only(original: Original, tmp_path: Path) -> None:
    for number, chunk in enumerate(original.chunks):
        data = bytearray(original.data)
        middle = (chunk.start + chunk.end) // 2
        data[middle] ^= 0xFF
        file = tmp_path / f"hit{number}.mcap"
        file.write_bytes(data)
        result = recover(file)
        assert sum(result.kept.values()) == original.total - chunk.messages
        assert sum(result.lost.values()) == chunk.messages, "the index behind a chunk tells what was in it"
        assert result.unknown_losses == 0
        read_by_others(result.target)


def test_bytes_over_a_record_head_are_skipped_to_the_next_chunk(original: Original, tmp_path: Path) -> None:
    chunk = original.chunks[3]
    data = bytearray(original.data)
    data[chunk.start : chunk.start + RECORD_HEAD] = b"\xff" * RECORD_HEAD
    file = tmp_path / "head.mcap"
    file.write_bytes(data)
    result = recover(file)
    assert sum(result.kept.values()) == original.total - chunk.messages
    # The numbering of the messages shows what is missing, though the chunk cannot be found.
    assert sum(result.lost.values()) == chunk.messages


def test_random_damage_never_ends_in_anything_else_than_a_good_bag(original: Original, tmp_path: Path) -> None:
    random_numbers = random.Random(7)
    for trial in range(60):
        data = bytearray(original.data[: random_numbers.randrange(50, len(original.data))])
        for _ in range(random_numbers.randrange(1, 20)):
            at = random_numbers.randrange(len(data))
            data[at : at + random_numbers.randrange(1, 30)] = random_numbers.randbytes(random_numbers.randrange(0, 30))
        file = tmp_path / f"trial{trial}.mcap"
        file.write_bytes(data)
        try:
            result = recover(file)
        except BagError:
            continue  # nothing at all was left
        assert sum(read_by_others(result.target).values()) == sum(result.kept.values())


def test_kept_messages_are_the_original_ones(original: Original, tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    whole.write_bytes(original.data)
    cut.write_bytes(original.data[: original.chunks[4].end])

    def messages(path: Path) -> list[tuple[str, bytes, int, int, int]]:
        found = BagReader(path, strict=False).messages()
        return [(m.channel.topic, m.data, m.log_time_ns, m.publish_time_ns, m.sequence) for m in found]

    recovered = messages(recover(cut).target)
    assert recovered == messages(whole)[: len(recovered)]


def test_good_bag_comes_out_as_it_was(original: Original, tmp_path: Path) -> None:
    file = tmp_path / "good.mcap"
    file.write_bytes(original.data)
    result = recover(file)
    assert sum(result.kept.values()) == original.total
    assert not result.damages
    assert not result.lost


def test_target_is_never_overwritten(original: Original, tmp_path: Path) -> None:
    file = tmp_path / "cut.mcap"
    file.write_bytes(original.data[: original.chunks[4].end])
    recover(file)
    with pytest.raises(BagError, match="cut_recovered: already exists"):
        recover(file)
    with pytest.raises(BagError, match="already exists"):
        recover(file, tmp_path)


def test_folder_whose_recorder_was_killed(fake_bag: Any, tmp_path: Path) -> None:
    """No metadata.yaml, no end: what a kill leaves."""
    writer = fake_bag().write(tmp_path / "flight", close=False, chunk_bytes=CHUNK_BYTES)
    writer.log.flush()
    result = recover(tmp_path / "flight")
    assert result.target == tmp_path / "flight_recovered"
    assert sum(read_by_others(result.target).values()) == sum(writer.log.counts.values())
    assert result.lost == {}


def test_strict_reading_names_file_and_byte(original: Original, tmp_path: Path) -> None:
    file = tmp_path / "cut.mcap"
    file.write_bytes(original.data[: original.chunks[4].start + 7])
    with pytest.raises(BagError, match=rf"{file}: at byte {original.chunks[4].start}: .*gbas bag recover"):
        list(BagReader(file).messages())
