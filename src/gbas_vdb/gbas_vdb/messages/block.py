"""Message blocks: header, message, CRC; and the message bodies as tables say.

Source: Annex 10 Volume I, Appendix B, 3.6.3.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from gbas_vdb.coding.bits import BitReader, BitWriter
from gbas_vdb.coding.crc import crc32q
from gbas_vdb.errors import CrcError, FieldError, VdbError
from gbas_vdb.messages import approach_tables, tables
from gbas_vdb.messages import types as m
from gbas_vdb.messages.layout import Layout, decode, encode

HEADER_BYTES: Final = 6
CRC_BYTES: Final = 4
MAX_BLOCK_BYTES: Final = 222
MBI_NORMAL: Final = 0xAA
MBI_TEST: Final = 0xFF

_TYPE_NUMBERS: Final[dict[type, int]] = {
    m.Type1: 1,
    m.Type2: 2,
    m.Type3: 3,
    m.Type4: 4,
    m.Type5: 5,
    m.Type8: tables.PRIVATE_TYPE,
    m.Type11: 11,
}


@dataclass(frozen=True, kw_only=True, slots=True)
class MessageBlock:
    """A message block whose CRC was right.

    Attributes
    ----------
    station_id : str
        GBAS identification, without padding.
    test : bool
        The message block identifier says test: no guidance may come from it.
    message_type, length : int
        As in the header; the length in bytes with header and CRC.
    message : Message
    notes : tuple of str
        What was in the message but was skipped, and why.
    """

    station_id: str
    test: bool
    message_type: int
    length: int
    message: m.Message
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class BlockError:
    """A piece of application data that was discarded.

    Attributes
    ----------
    offset : int
        Byte of the application data where the discarded piece starts.
    reason : str
        What failed.
    """

    offset: int
    reason: str


def message_type_of(message: m.Message) -> int:
    """The message type number of a message."""
    if isinstance(message, m.UnknownMessage):
        return message.message_type
    return _TYPE_NUMBERS[type(message)]


def encode_block(message: m.Message, station_id: str, *, test: bool = False) -> bytes:
    """One message block with header and CRC.

    Parameters
    ----------
    message : Message
    station_id : str
        GBAS identification, up to four characters A-Z, 0-9, space.
    test : bool
        Mark the block as a test: receivers must not guide by it.

    Raises
    ------
    FieldError
        Naming the field, value and bound.
    """
    return wrap_body(message_type_of(message), encode_body(message), station_id, test=test)


def wrap_body(message_type: int, body: bytes, station_id: str, *, test: bool = False) -> bytes:
    """A message block of an encoded message: header before, CRC behind.

    Raises
    ------
    FieldError
        When the block is longer than a burst, or the station or type cannot be sent.
    """
    length = HEADER_BYTES + len(body) + CRC_BYTES
    if length > MAX_BLOCK_BYTES:
        raise FieldError(f"message type {message_type} of {length} bytes; at most {MAX_BLOCK_BYTES} fit")
    data = _header(message_type, length, station_id, test) + body
    return data + crc32q(data).to_bytes(CRC_BYTES, "little")


@lru_cache(maxsize=1024)
def _header(message_type: int, length: int, station_id: str, test: bool) -> bytes:
    header = BitWriter()
    header.put(MBI_TEST if test else MBI_NORMAL, 8)
    header.put(tables.STATION_ID.to_raw(station_id), tables.STATION_ID.bits)
    header.put(tables.MESSAGE_TYPE.to_raw(message_type), tables.MESSAGE_TYPE.bits)
    header.put(length, 8)
    return header.to_bytes()


def encode_body(message: m.Message) -> bytes:
    """The message without header and CRC."""
    if isinstance(message, m.Type2):
        return _encode_type2(message)
    if isinstance(message, m.Type3):
        return bytes(message.n_fill_bytes)
    if isinstance(message, m.Type4):
        return b"".join(_encode_data_set(data_set) for data_set in message.data_sets)
    if isinstance(message, m.UnknownMessage):
        return message.body
    return _encoded(tables.WHOLE_MESSAGES[message_type_of(message)], message)


def _encoded(layout: Layout, record: Any) -> bytes:
    writer = BitWriter()
    encode(layout, record, writer)
    return writer.to_bytes()


def _encode_type2(message: m.Type2) -> bytes:
    body = _encoded(tables.TYPE_2, message)
    numbered = [
        (number, _encoded(layout, getattr(message, name)))
        for number, (name, layout) in tables.ADDITIONAL_BLOCKS.items()
        if getattr(message, name) is not None
    ]
    numbered += [(block.number, block.data) for block in message.unknown]
    if message.adb1 is None:
        if numbered:
            raise FieldError("adb1 = None: additional data block 1 must be there when others are")
        return body
    body += _encoded(tables.ADDITIONAL_BLOCK_1, message.adb1)
    for number, data in numbered:
        body += bytes((len(data) + 2, number)) + data
    return body


def _encode_data_set(data_set: m.FasDataSet | m.UnknownDataSet) -> bytes:
    if isinstance(data_set, m.UnknownDataSet):
        return bytes((len(data_set.data) + 1,)) + data_set.data
    data = bytearray(_encoded(approach_tables.FAS_DATA_SET, data_set))
    end = approach_tables.FAS_BLOCK_BYTES
    data[end : end + CRC_BYTES] = crc32q(bytes(data[:end])).to_bytes(CRC_BYTES, "little")
    return bytes((approach_tables.FAS_DATA_SET_BYTES,)) + bytes(data)


def decode_block(data: bytes) -> MessageBlock:
    """The message block `data` is: header, message and CRC, nothing after.

    Raises
    ------
    CrcError
        When the message CRC fails.
    VdbError
        When the header, the length or a field is not what the standard allows.
    """
    length = _block_length(data)
    if length != len(data):
        raise VdbError(f"message length {length} in the header, but {len(data)} bytes")
    received = int.from_bytes(data[-CRC_BYTES:], "little")
    computed = crc32q(data[:-CRC_BYTES])
    if received != computed:
        raise CrcError(
            f"message CRC failed: received {received:#010x}, computed {computed:#010x} "
            f"(message type {data[4]}, {length} bytes)"
        )
    station_id = _station_id(data[1:4])
    try:
        message, notes = decode_body(data[4], data[HEADER_BYTES:-CRC_BYTES])
    except VdbError as error:
        raise type(error)(f"message type {data[4]}: {error}") from None
    return MessageBlock(
        station_id=station_id,
        test=data[0] == MBI_TEST,
        message_type=data[4],
        length=length,
        message=message,
        notes=notes,
    )


@lru_cache(maxsize=256)
def _station_id(data: bytes) -> str:
    return tables.STATION_ID.from_raw(int.from_bytes(data, "little"))


def _block_length(data: bytes) -> int:
    if len(data) < HEADER_BYTES + CRC_BYTES:
        raise VdbError(f"message block of {len(data)} bytes; the shortest has {HEADER_BYTES + CRC_BYTES}")
    if data[0] not in (MBI_NORMAL, MBI_TEST):
        raise VdbError(f"message block identifier {data[0]:#04x} is not {MBI_NORMAL:#04x} or {MBI_TEST:#04x} (test)")
    length = data[5]
    if not HEADER_BYTES + CRC_BYTES <= length <= MAX_BLOCK_BYTES:
        raise VdbError(f"message length {length} outside {HEADER_BYTES + CRC_BYTES} to {MAX_BLOCK_BYTES}")
    return length


def decode_body(message_type: int, body: bytes) -> tuple[m.Message, tuple[str, ...]]:
    """The message of a body, and notes on what was skipped.

    Raises
    ------
    VdbError
        When the body is too short, too long, or has a value the standard does not allow.
    """
    reader = BitReader(body)
    if message_type == 2:
        return _decode_type2(reader, body)
    if message_type == 3:
        return m.Type3(n_fill_bytes=len(body)), ()
    if message_type == 4:
        return _decode_type4(body)
    of_others = message_type == tables.PRIVATE_TYPE and not body.startswith(tables.PRIVATE_BEGIN)
    if message_type not in tables.WHOLE_MESSAGES or of_others:
        return m.UnknownMessage(message_type=message_type, body=body), (f"message type {message_type} is not known",)
    message: m.Message = decode(tables.WHOLE_MESSAGES[message_type], reader)
    _refuse_rest(reader)
    return message, ()


def _refuse_rest(reader: BitReader) -> None:
    if reader.remaining:
        raise VdbError(f"too long: {reader.remaining} bits after the last field")


def _decode_type2(reader: BitReader, body: bytes) -> tuple[m.Type2, tuple[str, ...]]:
    station: m.Type2 = decode(tables.TYPE_2, reader)
    found: dict[str, Any] = {}
    unknown: list[m.UnknownAdditionalBlock] = []
    if reader.remaining:
        found["adb1"] = decode(tables.ADDITIONAL_BLOCK_1, reader)
    while reader.remaining:
        number, data = _take_additional_block(reader, body)
        if number not in tables.ADDITIONAL_BLOCKS:
            unknown.append(m.UnknownAdditionalBlock(number=number, data=data))
            continue
        name, layout = tables.ADDITIONAL_BLOCKS[number]
        if name in found:
            raise VdbError(f"additional data block {number} is there twice")
        part = BitReader(data)
        try:
            found[name] = decode(layout, part)
            _refuse_rest(part)
        except VdbError as error:
            raise type(error)(f"additional data block {number}: {error}") from None
    fields = {name: getattr(station, name) for name in station.__slots__} | found | {"unknown": tuple(unknown)}
    notes = tuple(f"additional data block {block.number} is not known: {len(block.data)} bytes" for block in unknown)
    return m.Type2(**fields), notes


def _take_additional_block(reader: BitReader, body: bytes) -> tuple[int, bytes]:
    start = reader.position // 8
    left = len(body) - start
    length = body[start]
    if not 2 <= length <= left or left < 2:
        raise VdbError(f"additional data block length {length} outside 2 to {left}")
    reader.take(8 * length)
    return body[start + 1], body[start + 2 : start + length]


def _decode_type4(body: bytes) -> tuple[m.Type4, tuple[str, ...]]:
    data_sets: list[m.FasDataSet | m.UnknownDataSet] = []
    notes: list[str] = []
    start = 0
    while start < len(body):
        length = body[start]
        if not 1 <= length <= len(body) - start:
            raise VdbError(f"data set length {length} outside 1 to {len(body) - start}")
        data = body[start + 1 : start + length]
        start += length
        if length != approach_tables.FAS_DATA_SET_BYTES:
            data_sets.append(m.UnknownDataSet(data=data))
            notes.append(f"data set of {length} bytes is not a FAS")
            continue
        data_sets.append(_decode_fas(data, len(data_sets)))
    return m.Type4(data_sets=tuple(data_sets)), tuple(notes)


def _decode_fas(data: bytes, position: int) -> m.FasDataSet:
    end = approach_tables.FAS_BLOCK_BYTES
    received = int.from_bytes(data[end : end + CRC_BYTES], "little")
    computed = crc32q(data[:end])
    if received != computed:
        raise CrcError(f"FAS block CRC failed in data set {position}: {received:#010x}, computed {computed:#010x}")
    data_set: m.FasDataSet = decode(approach_tables.FAS_DATA_SET, BitReader(data))
    return data_set


def decode_blocks(application_data: bytes) -> tuple[tuple[MessageBlock, ...], tuple[BlockError, ...]]:
    """The message blocks of a burst's application data.

    A block that fails is discarded and reported; the search goes on behind it where its length allows. Zero bytes
    after the last block are padding. Never raises.

    Returns
    -------
    blocks : tuple of MessageBlock
    errors : tuple of BlockError
    """
    blocks: list[MessageBlock] = []
    errors: list[BlockError] = []
    offset = 0
    while offset < len(application_data) and any(application_data[offset:]):
        rest = application_data[offset:]
        try:
            length = _block_length(rest)
            if length > len(rest):
                raise VdbError(f"message length {length}, but {len(rest)} bytes are left")
        except VdbError as error:
            errors.append(BlockError(offset=offset, reason=str(error)))
            break
        try:
            blocks.append(decode_block(rest[:length]))
        except VdbError as error:
            errors.append(BlockError(offset=offset, reason=str(error)))
        offset += length
    return tuple(blocks), tuple(errors)
