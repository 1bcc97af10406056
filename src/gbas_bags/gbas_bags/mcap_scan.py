"""Reading an MCAP file from its first byte on, without trusting its end: for bags that may be cut off or damaged.

Every chunk stands for itself (it has a length and a CRC), so whatever is whole can be read. What cannot is reported as
:class:`Damage` with the byte it begins at and, where the file still tells, how many messages of which topic were in it.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import lz4.frame
import zstandard

from gbas_core.errors import BagError

MAGIC: Final = b"\x89MCAP0\r\n"
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = range(1, 8)
_METADATA, _DATA_END = 0x0C, 0x0F
_LAST_OPCODE: Final = 0x0F
_PRIVATE_OPCODE: Final = 0x80
_FOOTER_BYTES: Final = 29
_RECORD: Final = struct.Struct("<BQ")
_CHUNK_FIXED: Final = struct.Struct("<QQQI")
_MESSAGE_FIXED: Final = struct.Struct("<HIQQ")
_MAX_CHUNK_BYTES: Final = 1 << 30
# Where a chunk with compressed records says so; found again after damage by this text.
_COMPRESSION_MARKS: Final = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")


@dataclass(frozen=True)
class Schema:
    """A message type as the file describes it."""

    name: str
    encoding: str
    text: str


@dataclass(frozen=True)
class Channel:
    """A topic as the file describes it."""

    topic: str
    schema: Schema
    encoding: str
    metadata: dict[str, str]


@dataclass(frozen=True, slots=True)
class Message:
    """One recorded message; `index` counts the messages of its topic in this file from 0."""

    channel: Channel
    index: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass(frozen=True)
class Damage:
    """A part of a file that could not be read.

    Attributes
    ----------
    offset : int
        First byte of the part.
    what : str
        What is wrong with it.
    lost : dict of topic to count, or None
        Messages in it by topic; None where the file does not tell.
    """

    offset: int
    what: str
    lost: dict[str, int] | None = None


class _Unreadable(Exception):
    """A record that does not parse."""


def _text(view: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", view, at)
    end = at + 4 + length
    if end > len(view):
        raise _Unreadable("a text runs past its record")
    return bytes(view[at + 4 : end]).decode("utf-8"), end


def _text_map(view: bytes, at: int) -> dict[str, str]:
    (length,) = struct.unpack_from("<I", view, at)
    at, end, result = at + 4, at + 4 + length, {}
    while at < end:
        key, at = _text(view, at)
        result[key], at = _text(view, at)
    return result


@dataclass
class McapScan:
    """One pass through an MCAP file; iterate :meth:`messages`, then read what was found on the way."""

    path: Path
    profile: str = ""
    library: str = ""
    closed: bool = False
    chunks: int = 0
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _counts: dict[int, int] = field(default_factory=dict)

    def messages(self) -> Iterator[Message]:
        """The readable messages in the order of the file.

        Raises
        ------
        BagError
            When the file cannot be opened, is empty or is not MCAP at all.
        """
        try:
            with self.path.open("rb") as file:
                if file.read(len(MAGIC)) != MAGIC:
                    size = self.path.stat().st_size
                    raise BagError(self.path, "the file is empty" if size == 0 else "is not an MCAP file")
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as view:
                    yield from self._walk(view)
        except OSError as error:
            raise BagError(self.path, error.strerror or str(error)) from error

    def _declarations_of_summary(self, view: mmap.mmap) -> None:
        """Take the declarations a closed file repeats at its end, so that damage to the first ones costs nothing."""
        footer = len(view) - len(MAGIC) - _FOOTER_BYTES
        if footer < len(MAGIC) or view[len(view) - len(MAGIC) :] != MAGIC:
            return
        opcode, _, at = struct.unpack_from("<BQQ", view, footer)
        while opcode == _FOOTER and len(MAGIC) <= at < footer:
            kind, length = _RECORD.unpack_from(view, at)
            try:
                self._declaration(kind, view[at + _RECORD.size : at + _RECORD.size + length])
            except (_Unreadable, struct.error, UnicodeDecodeError):
                return
            at += _RECORD.size + length

    def _walk(self, view: mmap.mmap) -> Iterator[Message]:
        self._declarations_of_summary(view)
        at, size = len(MAGIC), len(view)
        bad_chunk: int | None = None
        while at < size:
            opcode, length = _RECORD.unpack_from(view, at) if at + _RECORD.size <= size else (0, 0)
            body = at + _RECORD.size
            known = 1 <= opcode <= _LAST_OPCODE or opcode >= _PRIVATE_OPCODE
            if not known or body + length > size:
                at = self._resume(view, at, known)
                bad_chunk = None
                continue
            record = view[body : body + length]
            if opcode == _MESSAGE_INDEX:
                if bad_chunk is not None:
                    self._count_lost(bad_chunk, record)
            else:
                bad_chunk = None
            if opcode == _DATA_END:
                tail = len(MAGIC) + _FOOTER_BYTES
                self.closed = view[size - len(MAGIC) :] == MAGIC and size - body - length >= tail
                if not self.closed:
                    self.damages.append(Damage(at, "the summary at the end is cut off", {}))
                elif not _summary_is_whole(view, body + length):
                    self.damages.append(Damage(body + length, "the CRC of the summary is wrong", {}))
                return
            try:
                yield from self._record(opcode, record)
            except (_Unreadable, struct.error, UnicodeDecodeError) as error:
                self.damages.append(Damage(at, str(error), {} if opcode == _CHUNK else None))
                bad_chunk = len(self.damages) - 1 if opcode == _CHUNK else None
            at = body + length
        if not self.damages or self.damages[-1].offset < at:
            self.damages.append(Damage(size, "the file was never closed: it has no end record", {}))

    def _resume(self, view: mmap.mmap, at: int, known: bool) -> int:
        """Note the damage at `at` and find the next whole chunk, or the end of the file."""
        found = next(_whole_chunks(view, at + 1), None)
        if found is not None:
            self.damages.append(Damage(at, f"{found - at} bytes are no MCAP records"))
            return found
        left = len(view) - at
        what = (
            f"the file is cut off in a record; its last {left} bytes are lost"
            if known or left < _RECORD.size
            else (f"the last {left} bytes are no MCAP records")
        )
        self.damages.append(Damage(at, what))
        return len(view)

    def _count_lost(self, damage_index: int, record: bytes) -> None:
        channel_id, length = struct.unpack_from("<HI", record, 0)
        damage = self.damages[damage_index]
        topic = self.channels[channel_id].topic if channel_id in self.channels else f"channel {channel_id}"
        lost = dict(damage.lost or {})
        lost[topic] = lost.get(topic, 0) + length // 16
        self.damages[damage_index] = Damage(damage.offset, damage.what, lost)

    def _record(self, opcode: int, record: bytes) -> Iterator[Message]:
        if opcode == _CHUNK:
            self.chunks += 1
            yield from self._chunk(_chunk_records(record))
        elif opcode == _MESSAGE:
            yield self._message(record)
        elif opcode == _HEADER:
            self.profile, at = _text(record, 0)
            self.library, _ = _text(record, at)
        elif opcode == _METADATA:
            name, at = _text(record, 0)
            self.metadata.append((name, _text_map(record, at)))
        else:
            self._declaration(opcode, record)

    def _chunk(self, records: bytes) -> Iterator[Message]:
        at = 0
        while at < len(records):
            opcode, length = _RECORD.unpack_from(records, at)
            at += _RECORD.size
            if at + length > len(records):
                raise _Unreadable("a record runs past its chunk")
            if opcode == _MESSAGE:
                yield self._message(records[at : at + length])
            else:
                self._declaration(opcode, records[at : at + length])
            at += length

    def _declaration(self, opcode: int, record: bytes) -> None:
        if opcode == _SCHEMA:
            (schema_id,) = struct.unpack_from("<H", record, 0)
            name, at = _text(record, 2)
            encoding, at = _text(record, at)
            text, _ = _text(record, at)
            self._schemas[schema_id] = Schema(name, encoding, text)
        elif opcode == _CHANNEL:
            channel_id, schema_id = struct.unpack_from("<HH", record, 0)
            topic, at = _text(record, 4)
            encoding, at = _text(record, at)
            schema = self._schemas.get(schema_id, Schema("", "", ""))
            self.channels[channel_id] = Channel(topic, schema, encoding, _text_map(record, at))

    def _message(self, record: bytes) -> Message:
        channel_id, sequence, log_time, publish_time = _MESSAGE_FIXED.unpack_from(record, 0)
        if channel_id not in self.channels:
            raise _Unreadable(f"a message of channel {channel_id}, whose declaration is lost")
        index = self._counts.get(channel_id, 0)
        self._counts[channel_id] = index + 1
        data = record[_MESSAGE_FIXED.size :]
        return Message(self.channels[channel_id], index, sequence, log_time, publish_time, data)


def _chunk_records(record: bytes) -> bytes:
    """Decompressed records of a chunk, their CRC checked."""
    _, _, size, crc = _CHUNK_FIXED.unpack_from(record, 0)
    compression, at = _text(record, _CHUNK_FIXED.size)
    (length,) = struct.unpack_from("<Q", record, at)
    data = record[at + 8 : at + 8 + length]
    if len(data) != length or size > _MAX_CHUNK_BYTES:
        raise _Unreadable("a chunk has an impossible size")
    try:
        if compression == "zstd":
            data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        elif compression == "lz4":
            data = lz4.frame.decompress(data)
        elif compression:
            raise _Unreadable(f"a chunk is compressed with {compression!r}, which is not known")
    except (zstandard.ZstdError, RuntimeError) as error:
        raise _Unreadable(f"a chunk does not decompress ({error})") from error
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise _Unreadable("the CRC of a chunk is wrong")
    return bytes(data)


def _summary_is_whole(view: mmap.mmap, start: int) -> bool:
    """Whether the CRC in the footer is that of the summary and the footer; 0 means that there is none."""
    end = len(view) - len(MAGIC) - 4
    (crc,) = struct.unpack_from("<I", view, end)
    return crc in (0, zlib.crc32(view[start:end]))


def _whole_chunks(view: mmap.mmap, start: int) -> Iterator[int]:
    """Offsets from `start` on at which a whole compressed chunk begins."""
    lead = _RECORD.size + _CHUNK_FIXED.size
    marks = sorted(at for mark in _COMPRESSION_MARKS for at in _occurrences(view, mark, start + lead))
    for mark_at in marks:
        at = mark_at - lead
        opcode, length = _RECORD.unpack_from(view, at)
        end = at + _RECORD.size + length
        if opcode != _CHUNK or end > len(view):
            continue
        try:
            _chunk_records(view[at + _RECORD.size : end])
        except (_Unreadable, struct.error, UnicodeDecodeError):
            continue
        yield at


def _occurrences(view: mmap.mmap, mark: bytes, start: int) -> Iterator[int]:
    at = view.find(mark, start)
    while at >= 0:
        yield at
        at = view.find(mark, at + 1)
