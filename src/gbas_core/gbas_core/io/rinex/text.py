"""The text of a RINEX file, and what is said when it is not one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from gbas_core.io.files import GnssFileError, read_bytes
from gbas_core.io.rinex.lines import is_whole

_QUOTED_LINE: Final = re.compile(r' in "(.*)', re.DOTALL)

_BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
SIMULATED_LABEL: Final = "SIMULATED DATA"


class RinexError(GnssFileError):
    """A RINEX file that cannot be used."""


def read_text(path: Path, notes: list[str]) -> str:
    """Text of a file, one character a byte (RINEX is ASCII), whole lines only.

    A last line without an end is left out unless its last number is there to the last digit: it may be cut, and would
    still look like a number.

    Raises
    ------
    RinexError
        If the file cannot be read, is empty, or is compressed in a way that is not understood.
    """
    data = read_bytes(path, notes, RinexError)
    data = data.removeprefix(_BYTE_ORDER_MARK)
    if not data.strip():
        raise RinexError(path, "is empty; expected a RINEX file")
    text = re.sub(rb"[^\x00-\x7f]", b"?", data).decode("ascii").replace("\r\n", "\n")
    if not text.endswith("\n") and is_whole(text):
        notes.append("the last line has no end; its values are all there, so it was kept")
        text += "\n"
    elif not text.endswith("\n"):
        notes.append("the last line has no end: it was taken for cut off and left out")
        text = text[: text.rfind("\n") + 1] or text
    return text


def checked_version(path: Path, text: str, letter: str, expected: str) -> float:
    """RINEX version of the first line, after checking that the file is of the expected type.

    Parameters
    ----------
    letter : str
        File type as in RINEX, "O" or "N".
    expected : str
        The same in words, for the error.

    Raises
    ------
    RinexError
        For a first line that is no RINEX header, another version than 2, 3 or 4, or another file type.
    """
    line = text.split("\n", 1)[0]
    if line[60:80].rstrip() != "RINEX VERSION / TYPE":
        raise RinexError(path, f"line 1: {line[:80]!r} is no RINEX header; expected {expected}")
    try:
        version = float(line[:20])
    except ValueError:
        raise RinexError(path, f"line 1: version {line[:20].strip()!r}; expected 2, 3 or 4") from None
    if not 2.0 <= version < 5.0:
        raise RinexError(path, f"line 1: version {version:g}; expected 2, 3 or 4")
    if line[20:21].upper() != letter:
        raise RinexError(path, f"line 1: file type {line[20:40].strip()!r}; expected {expected}")
    return version


def says_simulated(text: str) -> bool:
    """Whether a comment of the header begins with :data:`SIMULATED_LABEL`: the suite's own mark on simulated files."""
    header = text.partition("END OF HEADER")[0]
    return any(line.startswith(SIMULATED_LABEL) and line[60:].startswith("COMMENT") for line in header.splitlines())


def parser_problem(text: str, error: Exception) -> str:
    """What the parser said, with the number of the line it quotes."""
    message = str(error).removeprefix("parse error: ")
    quoted = _QUOTED_LINE.search(message)
    line = quoted.group(1).rstrip('"').split("\n")[0] if quoted else ""
    at = text.find("\n" + line) if line.strip() else -1
    return message if at < 0 else f"line {text.count(chr(10), 0, at) + 2}: {message}"
