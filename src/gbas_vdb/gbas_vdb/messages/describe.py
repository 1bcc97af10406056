"""Message blocks as JSON documents with physical values, and back; what `gbas vdb decode` and `encode` do.

A document is
``{"blocks": [{"message_type": 1, "station_id": "CMJ", "crc_ok": true, "test": false, "fields": {...}}]}``.
Field names are those of :mod:`gbas_vdb.messages.types`; angles are in degrees here (`_deg` for `_rad`); missing is
null, an unlimited distance is the text "unlimited".

Bytes are written as in the published examples: data bytes with their first bit on the air as the least significant
(a block starts with AA), the six application FEC bytes with their first bit as the most significant. The scrambled bits
of a burst are written as the standard does, the first hexadecimal digit standing for one bit, or as a row of 0 and 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, Final

import numpy as np

from gbas_vdb.coding.bits import BitArray, bits_msb_first
from gbas_vdb.coding.fec import correct_fec, encode_fec
from gbas_vdb.coding.radio import decode_burst_bits
from gbas_vdb.errors import VdbError
from gbas_vdb.messages import approach_tables, tables
from gbas_vdb.messages import types as m
from gbas_vdb.messages.block import BlockError, MessageBlock, decode_blocks, encode_block, message_type_of
from gbas_vdb.messages.fields import Choice, Count, Letter, Number, Spare, Switch, Text, Vector
from gbas_vdb.messages.layout import Entry, Group, Layout, Part

Document = dict[str, Any]

_ADDITIONAL: Final = {"adb1": tables.ADDITIONAL_BLOCK_1, **dict(tables.ADDITIONAL_BLOCKS.values())}
_UNLIMITED: Final = "unlimited"
# The finest angle on the VDB is 1.4e-7 degrees; digits behind these are only the conversion from radians.
_DEGREE_DIGITS: Final = 10
_SHORTEST_BURST_BITS: Final = 73
_LARGEST: Final = 1e15


class DecodeError(VdbError):
    """Something of what was to be decoded failed.

    Attributes
    ----------
    document : dict
        What could be decoded, and under "errors" what could not: ``{"offset": ..., "reason": ...}``.
    """

    def __init__(self, document: Document) -> None:
        super().__init__("; ".join(f"byte {error['offset']}: {error['reason']}" for error in document["errors"]))
        self.document = document


# ---- to a document ----


def decode_hex_to_json(text: str, burst: bool = False) -> Document:
    """Document of message blocks given in hexadecimal.

    Parameters
    ----------
    text : str
        White space is ignored. One message block (or several, back to back); with `burst` application data and FEC, or
        the scrambled bits from station slot identifier to application FEC as an odd number of digits (the first is one
        bit), or as a row of 0 and 1.
    burst : bool

    Returns
    -------
    dict
        For a burst with "corrected_bytes", and for scrambled bits with "station_slot_identifier" (A to H), too.

    Raises
    ------
    VdbError
        When the text is not hexadecimal, or the burst is beyond repair.
    DecodeError
        When a block is bad: a CRC, a length, a value. Its `document` holds what was good.
    """
    digits = "".join(text.split())
    document: Document = {}
    if burst:
        if len(digits) % 2 or _is_bit_row(digits):
            radio = decode_burst_bits(_scrambled_bits(digits))
            document["station_slot_identifier"] = "ABCDEFGH"[radio.ssid]
            payload = radio.payload
        else:
            payload = _bytes_of(digits)
        data, document["corrected_bytes"] = correct_fec(payload)
    else:
        data = _bytes_of(digits)
    blocks, errors = decode_blocks(data)
    document["blocks"] = [block_document(block) for block in blocks]
    if errors or not blocks:
        reasons = errors or (BlockError(offset=0, reason="there is no message block"),)
        document["errors"] = [{"offset": error.offset, "reason": error.reason} for error in reasons]
        raise DecodeError(document)
    return document


def _is_bit_row(digits: str) -> bool:
    return len(digits) >= _SHORTEST_BURST_BITS and set(digits) <= {"0", "1"}


def _bytes_of(digits: str) -> bytes:
    try:
        return bytes.fromhex(digits)
    except ValueError:
        wrong = next((character for character in digits if character not in "0123456789abcdefABCDEF"), None)
        cause = f"{wrong!r} is not a digit" if wrong else f"{len(digits)} digits are not whole bytes"
        raise VdbError(f"not hexadecimal: {cause}") from None


def _scrambled_bits(digits: str) -> BitArray:
    if _is_bit_row(digits):
        return np.frombuffer(digits.encode(), dtype=np.uint8) - np.uint8(ord("0"))
    if digits[0] not in "01":
        raise VdbError(f"scrambled bits: the first digit stands for one bit, but it is {digits[0]!r}")
    return bits_msb_first(_bytes_of("0" + digits))[7:]


def block_document(block: MessageBlock) -> Document:
    """Document of one message block."""
    document: Document = {
        "message_type": block.message_type,
        "station_id": block.station_id,
        "crc_ok": True,
        "test": block.test,
        "fields": message_document(block.message),
    }
    if block.notes:
        document["notes"] = list(block.notes)
    return document


def message_document(message: m.Message) -> Document:
    """The fields of a message, physical values."""
    if isinstance(message, m.UnknownMessage):
        return {"body_hex": _hex(message.body)}
    if isinstance(message, m.Type3):
        return {"n_fill_bytes": message.n_fill_bytes}
    if isinstance(message, m.Type4):
        return {"data_sets": [_data_set_document(data_set) for data_set in message.data_sets]}
    if isinstance(message, m.Type2):
        document = _to_plain(tables.TYPE_2, message)
        for name, layout in _ADDITIONAL.items():
            block = getattr(message, name)
            document[name] = None if block is None else _to_plain(layout, block)
        if message.unknown:
            document["unknown"] = [{"number": item.number, "data_hex": _hex(item.data)} for item in message.unknown]
        return document
    return _to_plain(tables.WHOLE_MESSAGES[message_type_of(message)], message)


def _data_set_document(data_set: m.FasDataSet | m.UnknownDataSet) -> Document:
    if isinstance(data_set, m.UnknownDataSet):
        return {"data_hex": _hex(data_set.data)}
    return _to_plain(approach_tables.FAS_DATA_SET, data_set)


def _hex(data: bytes) -> str:
    return data.hex().upper()


def _to_plain(layout: Layout, record: Any) -> Document:
    document: Document = {}
    for entry in layout.entries:
        if isinstance(entry, (Spare, Count)):
            continue
        name = _name_of(entry)
        value = getattr(record, name)
        if isinstance(entry, Group):
            document[name] = [_to_plain(entry.layout, item) for item in value]
        elif isinstance(entry, Part):
            document[name] = _to_plain(entry.layout, value)
        elif isinstance(entry, Vector):
            document[name] = [_plain(entry.item, item) for item in value]
        else:
            document[_document_name(entry)] = _plain(entry, value)
    return document


def _name_of(entry: Entry) -> str:
    assert not isinstance(entry, (Spare, Count))
    return entry.default.name if isinstance(entry, Switch) else entry.name


def _document_name(entry: Entry) -> str:
    return _name_of(entry).removesuffix("_rad") + ("_deg" if _is_angle(entry) else "")


def _is_angle(entry: Entry) -> bool:
    return isinstance(entry, Number) and entry.unit == "rad"


def _plain(entry: Entry, value: Any) -> Any:
    if value is None or value != value:
        return None
    if value == math.inf:
        return _UNLIMITED
    return round(math.degrees(value), _DEGREE_DIGITS) if _is_angle(entry) else value


# ---- from a document ----


def encode_json_to_hex(document: Mapping[str, Any], burst: bool = False) -> str:
    """Hexadecimal text of a document as :func:`decode_hex_to_json` gives it; the inverse of it.

    Parameters
    ----------
    document : mapping
        With "blocks", or one block itself.
    burst : bool
        Append the application FEC.

    Raises
    ------
    VdbError
        Naming the place in the document, the value and what is wrong with it.
    """
    blocks = document.get("blocks", [document])
    if not isinstance(blocks, Sequence) or isinstance(blocks, str):
        raise VdbError("blocks is not a list")
    data = b"".join(_encode_block_document(block, f"blocks[{place}]") for place, block in enumerate(blocks))
    return _hex(data + encode_fec(data) if burst else data)


def _encode_block_document(block: Any, path: str) -> bytes:
    _require_object(block, path)
    message_type, station_id = block.get("message_type"), block.get("station_id")
    if not isinstance(message_type, int) or isinstance(message_type, bool) or not 0 <= message_type <= 255:
        raise VdbError(f"{path}.message_type = {message_type!r} is not an integer of 0 to 255")
    if not isinstance(station_id, str):
        raise VdbError(f"{path}.station_id = {station_id!r} is not a text")
    test = block.get("test", False)
    if not isinstance(test, bool):
        raise VdbError(f"{path}.test = {test!r} is not true or false")
    message = message_of(message_type, block.get("fields"), f"{path}.fields")
    try:
        return encode_block(message, station_id, test=test)
    except VdbError as error:
        raise type(error)(f"{path}: {error}") from None


def _require_object(value: Any, path: str) -> None:
    if not isinstance(value, Mapping):
        raise VdbError(f"{path} = {value!r} is not an object")


def message_of(message_type: int, document: Any, path: str = "fields") -> m.Message:
    """The message of its fields' document; the inverse of :func:`message_document`."""
    _require_object(document, path)
    if message_type == 2:
        return _type2_of(document, path)
    if message_type == 3:
        n_fill_bytes = document.get("n_fill_bytes")
        if not isinstance(n_fill_bytes, int) or not 0 <= n_fill_bytes <= 212:
            raise VdbError(f"{path}.n_fill_bytes = {n_fill_bytes!r} is not an integer of 0 to 212")
        return m.Type3(n_fill_bytes=n_fill_bytes)
    if message_type == 4:
        return m.Type4(
            data_sets=tuple(_data_set_of(item, where) for item, where in _items(document, "data_sets", path))
        )
    if message_type not in tables.WHOLE_MESSAGES or "body_hex" in document:
        return m.UnknownMessage(message_type=message_type, body=_bytes_at(document, "body_hex", path))
    message: m.Message = _from_plain(tables.WHOLE_MESSAGES[message_type], document, path)
    return message


def _type2_of(document: Mapping[str, Any], path: str) -> m.Type2:
    extra = {name: document.get(name) for name in _ADDITIONAL}
    unknown = [] if document.get("unknown") is None else _items(document, "unknown", path)
    rest = {name: value for name, value in document.items() if name not in (*_ADDITIONAL, "unknown")}
    station: m.Type2 = _from_plain(tables.TYPE_2, rest, path)
    found: dict[str, Any] = {item.name: getattr(station, item.name) for item in fields(m.Type2)}
    for name, block in extra.items():
        if block is not None:
            found[name] = _from_plain(_ADDITIONAL[name], block, f"{path}.{name}")
    found["unknown"] = tuple(_unknown_block_of(item, where) for item, where in unknown)
    return m.Type2(**found)


def _unknown_block_of(document: Any, path: str) -> m.UnknownAdditionalBlock:
    _require_object(document, path)
    number = document.get("number")
    if not isinstance(number, int) or not 0 <= number <= 255 or number in tables.ADDITIONAL_BLOCKS:
        raise VdbError(f"{path}.number = {number!r} is not the number of an unknown additional data block")
    return m.UnknownAdditionalBlock(number=number, data=_bytes_at(document, "data_hex", path))


def _data_set_of(document: Any, path: str) -> m.FasDataSet | m.UnknownDataSet:
    _require_object(document, path)
    if "data_hex" in document:
        return m.UnknownDataSet(data=_bytes_at(document, "data_hex", path))
    data_set: m.FasDataSet = _from_plain(approach_tables.FAS_DATA_SET, document, path)
    return data_set


def _items(document: Mapping[str, Any], name: str, path: str) -> list[tuple[Any, str]]:
    value = document.get(name)
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise VdbError(f"{path}.{name} is not a list")
    return [(item, f"{path}.{name}[{place}]") for place, item in enumerate(value)]


def _bytes_at(document: Mapping[str, Any], name: str, path: str) -> bytes:
    value = document.get(name)
    if not isinstance(value, str):
        raise VdbError(f"{path}.{name} = {value!r} is not a hexadecimal text")
    return _bytes_of(value)


def _from_plain(layout: Layout, document: Any, path: str) -> Any:
    _require_object(document, path)
    entries = {
        _document_name(entry) if not isinstance(entry, (Group, Part, Vector)) else entry.name: entry
        for entry in layout.entries
        if not isinstance(entry, (Spare, Count))
    }
    for name in document:
        if name not in entries:
            raise VdbError(f"{path}.{name} is not a field; there are {', '.join(entries)}")
    defaults = _defaults(layout)
    values = {}
    for name, entry in entries.items():
        if name not in document:
            if _name_of(entry) not in defaults:
                raise VdbError(f"{path}.{name} is missing")
            continue
        values[_name_of(entry)] = _value_of(entry, document[name], f"{path}.{name}", document, name, path)
    return layout.record(**values)


def _defaults(layout: Layout) -> frozenset[str]:
    return frozenset(item.name for item in fields(layout.record) if item.default is not MISSING)  # type: ignore[arg-type]


def _value_of(entry: Entry, value: Any, where: str, document: Mapping[str, Any], name: str, path: str) -> Any:
    if isinstance(entry, Group):
        return tuple(_from_plain(entry.layout, item, place) for item, place in _items(document, name, path))
    if isinstance(entry, Part):
        return _from_plain(entry.layout, value, where)
    if isinstance(entry, Vector):
        return tuple(_number_of(entry.item, item, place) for item, place in _items(document, name, path))
    if isinstance(entry, Switch):
        return _number_of(entry.default, value, where)
    if isinstance(entry, Number):
        return _number_of(entry, value, where)
    if isinstance(entry, (Choice, Letter, Text)):
        return value
    raise AssertionError(entry)


def _number_of(entry: Number, value: Any, where: str) -> Any:
    if value is None:
        return None if None in entry.codes.values() else entry.missing
    if value == _UNLIMITED:
        return math.inf
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise VdbError(f"{where} = {value!r} is not a number")
    if not -_LARGEST < value < _LARGEST:
        raise VdbError(f"{where} = {value!r} is not a number of the VDB")
    return math.radians(value) if entry.unit == "rad" else value
