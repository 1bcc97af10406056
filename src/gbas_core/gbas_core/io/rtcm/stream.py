"""The messages of a recorded stream, and the time each belongs to.

Multiple signal messages carry a time of week and no week. The week of the first epoch is given by the caller or taken
from the ephemerides of the stream; from there on time is counted, across the ends of weeks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import sidereon

from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK, SECONDS_PER_WEEK
from gbas_core.io.files import GnssFileError, read_bytes, read_start
from gbas_core.io.rtcm.ephemeris_fields import LONGEST_VALIDITY_S, RawEphemeris

_PREAMBLE: Final = b"\xd3"
_LONGEST_FRAME: Final = 1029
_FRAMES_LOOKED_AT: Final = 64
_SYSTEMS: Final = ("G", "E")
_HALF_WEEK_MS: Final = MILLISECONDS_PER_WEEK // 2


class RtcmError(GnssFileError):
    """A recorded RTCM 3 stream that cannot be used."""


def is_rtcm(path: str | Path) -> bool:
    """Whether a file is a recorded RTCM 3 stream: by its content, since such files have names of all kinds.

    True when its beginning (64 of the longest frames) holds a frame with a correct checksum. A file that cannot be read
    is none.
    """
    start = read_start(Path(path), _FRAMES_LOOKED_AT * _LONGEST_FRAME)
    return _PREAMBLE in start and bool(sidereon.decode_rtcm_stream(start).messages)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stream:
    """The messages of a file in their order.

    Attributes
    ----------
    path : Path
    messages : tuple of sidereon.RtcmMessage
    keys : tuple of int
        Epoch each message belongs to [ms since the start of GPS time]: of a GPS or Galileo MSM its own, of any other
        message that of the last one before it (of the first one, if there is none before).
    notes : tuple of str
    """

    path: Path
    messages: tuple[Any, ...]
    keys: tuple[int, ...]
    notes: tuple[str, ...]

    def observed(self) -> Iterator[tuple[int, Any]]:
        """Key and content of each GPS and Galileo MSM."""
        for key, message in zip(self.keys, self.messages, strict=True):
            if _has_time(message):
                yield key, message.msm

    def ephemerides(self) -> Iterator[tuple[int, RawEphemeris]]:
        """When each ephemeris came (an epoch's key), and the ephemeris."""
        for key, message in zip(self.keys, self.messages, strict=True):
            raw = RawEphemeris.of(message)
            if raw is not None:
                yield key, raw


def read_stream(path: str | Path, *, gps_week: int | None) -> Stream:
    """Read a stream.

    Parameters
    ----------
    path : str or Path
        Plain or gzip.
    gps_week : int or None
        GPS week of the first epoch; None takes it from the ephemerides of the stream.

    Raises
    ------
    RtcmError
        For a file without a GPS or Galileo MSM, for a week that is neither given nor in the stream, and for
        ephemerides that contradict each other or the given week.

    Notes
    -----
    An epoch is taken to be after the one before it when it is less than half a week ahead, else before it: a gap of
    more than half a week cannot be seen.
    """
    path = Path(path)
    notes: list[str] = []
    decoded = sidereon.decode_rtcm_stream(read_bytes(path, notes, RtcmError))
    _note_damage(decoded.diagnostics, notes)
    messages = [message for message in decoded.messages if not _is_out_of_week(message)]
    if len(messages) < len(decoded.messages):
        notes.append(f"{len(decoded.messages) - len(messages)} messages have a time beyond the week and were left out")
    if not any(_has_time(message) for message in messages):
        found = ", ".join(str(number) for number in sorted({message.message_number for message in messages}))
        raise RtcmError(
            path, f"has no MSM of GPS or Galileo; expected at least one (messages found: {found or 'none'})"
        )
    times_ms = _times_ms(messages)
    start_ms = _first_week(path, messages, times_ms, gps_week) * MILLISECONDS_PER_WEEK
    return Stream(
        path=path, messages=tuple(messages), keys=tuple(start_ms + time_ms for time_ms in times_ms), notes=tuple(notes)
    )


def _note_damage(found: Any, notes: list[str]) -> None:
    if found.resync_bytes:
        notes.append(
            f"{found.resync_bytes} bytes are in no whole frame with a correct checksum and were left out "
            f"({found.crc_failures} wrong checksums)"
        )
    if found.skipped_frames:
        count = Counter(str(skipped.message_number) for skipped in found.skipped_frames)
        named = ", ".join(f"{each} of {number}" for number, each in sorted(count.items()))
        notes.append(f"messages with a correct checksum were not understood and left out: {named}")


def _has_time(message: Any) -> bool:
    return message.msm is not None and message.msm.system in _SYSTEMS


def _is_out_of_week(message: Any) -> bool:
    return _has_time(message) and message.msm.header.epoch_time >= MILLISECONDS_PER_WEEK


def _times_ms(messages: Sequence[Any]) -> list[int]:
    """Time of each message since the start of the first epoch's week [ms]."""
    latest = next(message.msm.header.epoch_time for message in messages if _has_time(message))
    times = []
    for message in messages:
        time_ms = latest
        if _has_time(message):
            ahead = (message.msm.header.epoch_time - latest + _HALF_WEEK_MS) % MILLISECONDS_PER_WEEK - _HALF_WEEK_MS
            time_ms = latest + ahead
        times.append(time_ms)
        latest = max(latest, time_ms)
    return times


def _first_week(path: Path, messages: Sequence[Any], times_ms: Sequence[int], gps_week: int | None) -> int:
    """GPS week of the first epoch, given or from the ephemerides."""
    said = sorted(_said_weeks(messages, times_ms), key=lambda each: -each[1])  # the largest modulus knows most
    if gps_week is None:
        if not said:
            raise RtcmError(
                path, "has times of week, and no ephemeris that says which week: give the GPS week of its first epoch"
            )
        week, _ = said[0]
        if any((other - week) % its_modulus for other, its_modulus in said):
            raise RtcmError(
                path,
                f"its ephemerides are of different weeks (first epoch in week {', '.join(_distinct(said))}); "
                "give the GPS week of its first epoch",
            )
        return week
    if gps_week < 0:
        raise RtcmError(path, f"gps_week {gps_week}: expected 0 or more")
    if said and all((gps_week - week) % modulus for week, modulus in said):
        raise RtcmError(
            path,
            f"gps_week {gps_week}: its ephemerides say that its first epoch is in week {' or '.join(_distinct(said))}",
        )
    return gps_week


def _distinct(said: Sequence[tuple[int, int]]) -> list[str]:
    return [str(week) for week in sorted({week for week, _ in said})]


def _said_weeks(messages: Sequence[Any], times_ms: Sequence[int]) -> Iterator[tuple[int, int]]:
    """GPS week of the first epoch by each ephemeris that was valid when it came, and its modulus.

    Left out are ephemerides of the first and last hours of a week: whether theirs is the week of transmission or of the
    time of ephemeris cannot be told.
    """
    for message, time_ms in zip(messages, times_ms, strict=True):
        raw = RawEphemeris.of(message)
        if raw is None:
            continue
        ahead_s = raw.toe_after_s(time_ms / 1000.0)
        toe_s = time_ms / 1000.0 + ahead_s
        inside = LONGEST_VALIDITY_S <= raw.toe_tow_s < SECONDS_PER_WEEK - LONGEST_VALIDITY_S
        if inside and abs(ahead_s) <= LONGEST_VALIDITY_S:
            yield raw.gps_week - int(toe_s // SECONDS_PER_WEEK), raw.week_modulus
