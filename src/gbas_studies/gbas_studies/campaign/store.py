"""The file of results: JSON lines, the first one saying whose they are.

Results are added as they come, so that what is done survives whatever ends a run; when all are there the file is
written anew in the order of the trials, and does not depend on who made which.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from gbas_studies.campaign.errors import CampaignError
from gbas_studies.campaign.plan import FORMAT
from gbas_studies.campaign.work import Line


class Store:
    """Results of one campaign in a file, or in memory only.

    Attributes
    ----------
    lines : dict from a trial's number to its result as JSON
    """

    def __init__(self, file: IO[bytes] | None = None, lines: Mapping[int, str] | None = None) -> None:
        self._file = file
        self.lines: dict[int, str] = dict(lines or {})

    def add(self, lines: Iterable[Line]) -> None:
        """Keep some results."""
        for number, text in lines:
            self.lines[number] = text
            if self._file is not None:
                self._file.write(_line(number, text))
        if self._file is not None:
            self._file.flush()


@contextmanager
def open_store(path: Path | None, header: Mapping[str, Any]) -> Iterator[Store]:
    """Begin a file of results, or go on with one; at the end, if all are there, they are put in order.

    Parameters
    ----------
    path : Path or None
        None: results are kept in memory.
    header : mapping
        See :meth:`~.plan.Campaign.header`.

    Raises
    ------
    CampaignError
        When the file is something else, is damaged, belongs to another plan, seed or version, or is being written.
    """
    if path is None:
        yield Store()
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CampaignError(f"{path}: another campaign is writing it") from None
        store = Store(file, _read(path, file, header))
        yield store
        if len(store.lines) == header["trials"]:
            _write_in_order(path, header, store.lines)


def _read(path: Path, file: IO[bytes], header: Mapping[str, Any]) -> dict[int, str]:
    """Results of a file, of which a last line without an end is cut off: it was being written when a run ended."""
    file.seek(0)
    head, *rest = file.read().split(b"\n")
    if not rest and _first(header).startswith(head):
        file.truncate(0)
        file.write(_first(header))
        file.flush()
        return {}
    _check_header(path, head, header)
    lines: dict[int, str] = {}
    for place, line in enumerate(rest[:-1], start=2):
        number, text = _parsed(path, place, line)
        if number in lines or not 0 <= number < header["trials"]:
            raise CampaignError(f"{path}: line {place} has trial {number}, of which there is none or another before")
        lines[number] = text
    file.truncate(file.tell() - len(rest[-1]))
    return lines


def _check_header(path: Path, head: bytes, header: Mapping[str, Any]) -> None:
    try:
        theirs = json.loads(head)
    except ValueError:
        theirs = None
    if not isinstance(theirs, dict) or theirs.get("format") != FORMAT:
        raise CampaignError(f"{path}: not a file of a campaign's results; give another file")
    for name, ours in header.items():
        if theirs.get(name) != ours:
            raise CampaignError(
                f"{path}: its {name} is {_shown(theirs.get(name))}, and that of this campaign {_shown(ours)}; their "
                "results do not belong together: give another file, or what it was begun with"
            )


def _shown(value: Any) -> str:
    """A header's value as a person reads it; of a hash the beginning."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text[:12] if len(text) == 64 else text


def _parsed(path: Path, place: int, line: bytes) -> Line:
    try:
        document = json.loads(line)
        number = int(document["trial"])
        text = line.decode().removeprefix(f'{{"trial":{number},"result":').removesuffix("}")
        if line != _line(number, text).rstrip(b"\n"):
            raise ValueError
    except (ValueError, KeyError, TypeError):
        raise CampaignError(f"{path}: line {place} is damaged") from None
    return number, text


def _write_in_order(path: Path, header: Mapping[str, Any], lines: Mapping[int, str]) -> None:
    beside = path.with_name(path.name + ".part")
    with open(beside, "wb") as file:
        file.write(_first(header))
        file.writelines(_line(number, lines[number]) for number in sorted(lines))
        file.flush()
        os.fsync(file.fileno())
    beside.replace(path)


def _first(header: Mapping[str, Any]) -> bytes:
    return json.dumps(header, separators=(",", ":")).encode() + b"\n"


def _line(number: int, text: str) -> bytes:
    return f'{{"trial":{number},"result":{text}}}\n'.encode()
