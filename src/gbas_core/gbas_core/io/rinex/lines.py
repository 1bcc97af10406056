"""Lines of RINEX files by their places: which belong to no record, and whether a last line without an end is whole.

Source: RINEX 2.11 tables A2 and A4; RINEX 3.05 tables A3 and A6: observations are F14.3 with two flags behind, 16
columns each, navigation values are 19 columns each.
"""

from __future__ import annotations

import re
from typing import Final

_HEADER_END: Final = "END OF HEADER"
_SATELLITES_A_LINE: Final = 12
_OBSERVATIONS_A_LINE_2: Final = 5
_OBSERVED_FLAGS: Final = (0, 1, 6)
_OBSERVATION: Final = re.compile(r"[ \d-]{9}\d\.\d{3}", re.ASCII)
_NAVIGATION_VALUE: Final = re.compile(r" ?[ -]\d?\.\d{12}[DEde][+-]\d\d", re.ASCII)
# RINEX 2 has no mark at its epochs: time with seconds of seven digits, flag, number.
EPOCH_LINE_2: Final = re.compile(r"^ [ \d]\d [ \d]\d [ \d]\d [ \d]\d [ \d]\d [ \d]\d\.\d{7}  \d[ \d]{3}", re.MULTILINE)
_EVENT_LINE_2: Final = re.compile(r"^ {28}[2-5][ \d]{3}")


def stray_lines(text: str, version: float) -> int:
    """Lines between the epochs of an observation file that no record accounts for; empty ones do not count."""
    head, _, body = text.partition(_HEADER_END)
    lines = body.split("\n")[1:]
    types = 0 if version >= 3.0 else _types_2(head)
    stray, at = 0, 0
    while at < len(lines):
        followed = _lines_3(lines[at]) if version >= 3.0 else _lines_2(lines[at], types)
        if followed is None:
            stray += bool(lines[at].strip())
            followed = 0
        at += 1 + followed
    return stray


def _lines_3(line: str) -> int | None:
    """How many lines belong to the record that begins here; None if none does."""
    count = line[32:35].strip()
    return int(count) if line.startswith(">") and count.isdigit() else None


def _lines_2(line: str, types: int) -> int | None:
    if not (EPOCH_LINE_2.match(line) or _EVENT_LINE_2.match(line)):
        return None
    flag, count = int(line[28]), int(line[29:32].strip() or 0)
    if flag not in _OBSERVED_FLAGS:
        return count
    lines_each = max(1, -(-types // _OBSERVATIONS_A_LINE_2))
    return max(0, (count - 1) // _SATELLITES_A_LINE) + count * lines_each


def _types_2(head: str) -> int:
    first = next((line for line in head.split("\n") if line[60:].startswith("# / TYPES OF OBSERV")), "")
    return int(first[:6]) if first[:6].strip().isdigit() else 0


def is_whole(text: str) -> bool:
    """Whether the last line of a RINEX text is whole though nothing ends it: its last value is there to the last digit.

    An observation line is whole with the header's last type of that satellite, and with its loss-of-lock flag where
    that is a carrier; a navigation line with as many values as the same line of the record before. Of other lines one
    cannot tell, nor of a line whose last types are blank.
    """
    line = text[text.rfind("\n") + 1 :]
    if text[20:21].upper() == "O":
        types, begin = _types_of(text, line)
        return _whole_observations(line, types, begin)
    return text[20:21].upper() == "N" and _whole_navigation(text, line)


def _whole_observations(line: str, types: list[str], begin: int) -> bool:
    if not types:
        return False
    value = begin + 16 * (len(types) - 1)
    needed = 15 if types[-1].startswith("L") else 14
    return len(line) >= value + needed and _OBSERVATION.fullmatch(line[value : value + 14]) is not None


def _types_of(text: str, line: str) -> tuple[list[str], int]:
    """Types that a satellite's (last) line has, and the column of the first."""
    head = text.partition(_HEADER_END)[0].split("\n")
    if text[:9].strip().startswith("2"):
        types = [name for each in head if each[60:].startswith("# / TYPES OF OBSERV") for name in each[6:60].split()]
        return types[(len(types) - 1) // _OBSERVATIONS_A_LINE_2 * _OBSERVATIONS_A_LINE_2 :] if types else [], 0
    system, types = "", []
    for each in head:
        if each[60:].startswith("SYS / # / OBS TYPES"):
            system = each[0].strip() or system
            types += each[7:60].split() if system == line[:1] else []
    return types, 3


def _whole_navigation(text: str, line: str) -> bool:
    indent = 3 if text[:9].strip().startswith("2") else 4
    lines = text.partition(_HEADER_END)[2].split("\n")[1:]
    starts = [number for number, each in enumerate(lines) if each[: indent - 1].strip()]
    if len(starts) < 2:
        return False
    place = len(lines) - 1 - starts[-1]
    kind = lines[starts[-1]][:1] if indent == 4 else ""
    earlier = [start for start in starts[:-1] if lines[start].startswith(kind) and start + place < len(lines)]
    if not earlier:
        return False
    values = range(indent, len(lines[earlier[-1] + place].rstrip()), 19)
    return bool(values) and all(_NAVIGATION_VALUE.fullmatch(line[at : at + 19]) for at in values)
