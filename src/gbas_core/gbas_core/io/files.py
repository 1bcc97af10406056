"""The bytes of a receiver's file, plain or gzip, and what is said when it cannot be used."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Final

PathLike = str | Path

_GZIP_MAGIC: Final = b"\x1f\x8b"
_COMPRESS_MAGIC: Final = b"\x1f\x9d"


class GnssFileError(ValueError):
    """A file that cannot be used; the text names the file, the place, what is there and what was expected."""

    def __init__(self, path: PathLike, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = Path(path)
        self.problem = problem


def read_bytes(path: Path, notes: list[str], error_type: type[GnssFileError]) -> bytes:
    """Bytes of a file, decompressed.

    Raises
    ------
    error_type
        If the file cannot be read, or is compressed in a way that is not understood.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise error_type(path, f"cannot be read: {error.strerror}") from error
    return _decompressed(path, data, notes, error_type)


def read_start(path: Path, size: int) -> bytes:
    """The first bytes of a file, decompressed: at most `size`, none of one that cannot be read."""
    try:
        with path.open("rb") as file:
            start = file.read(size)
    except OSError:
        return b""
    if not start.startswith(_GZIP_MAGIC):
        return start
    try:
        return zlib.decompressobj(wbits=31).decompress(start, size)
    except zlib.error:
        return b""


def _decompressed(path: Path, data: bytes, notes: list[str], error_type: type[GnssFileError]) -> bytes:
    if data.startswith(_COMPRESS_MAGIC):
        raise error_type(path, "compressed with Unix compress (.Z); expected plain text or gzip")
    if not data.startswith(_GZIP_MAGIC):
        return data
    text = bytearray()
    while data.startswith(_GZIP_MAGIC):  # a gzip file may have several members
        inflater = zlib.decompressobj(wbits=31)
        try:
            text += inflater.decompress(data) + inflater.flush()
        except zlib.error as error:
            raise error_type(path, f"damaged gzip data after {len(text)} characters: {error}") from error
        if not inflater.eof:
            notes.append("the gzip data end early: the file was cut off")
        data = inflater.unused_data
    return bytes(text)
