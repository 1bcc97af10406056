"""GPS time: week and time of week, calendar dates, epoch keys and the VDB's modified Z-count.

GPS time has no leap seconds. Weeks count from 1980-01-06 and are never taken modulo 1024. A pair ``(week, tow_s)`` is
normalised when ``0 <= tow_s < 604800``; the functions here also accept pairs that are not.
"""

from __future__ import annotations

import math
from datetime import date
from typing import Final, overload

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray

SECONDS_PER_DAY: Final = 86_400
SECONDS_PER_WEEK: Final = 604_800
MILLISECONDS_PER_WEEK: Final = 1000 * SECONDS_PER_WEEK
MODIFIED_Z_COUNT_PERIOD_S: Final = 1200.0
"""Period of the modified Z-count (20 minutes). Source: ICAO Annex 10 vol. I, B.3.6.4.2.4."""

_EPOCH_ORDINAL: Final = date(1980, 1, 6).toordinal()


def gps_from_calendar(
    year: int, month: int, day: int, hour: int = 0, minute: int = 0, second: float = 0.0
) -> tuple[int, float]:
    """GPS week and time of week [s] of a calendar date in GPS time (not UTC).

    Raises
    ------
    ValueError
        If the date does not exist or lies before 1980-01-06.
    """
    days = date(year, month, day).toordinal() - _EPOCH_ORDINAL
    if days < 0:
        raise ValueError(f"date {year:04d}-{month:02d}-{day:02d} is before the start of GPS time, 1980-01-06")
    week, weekday = divmod(days, 7)
    return normalised(week, weekday * SECONDS_PER_DAY + hour * 3600 + minute * 60 + second)


def calendar_from_gps(week: int, tow_s: float) -> tuple[int, int, int, int, int, float]:
    """Year, month, day, hour, minute and second [s] in GPS time; the inverse of :func:`gps_from_calendar`."""
    week, tow_s = normalised(week, tow_s)
    weekday = int(tow_s // SECONDS_PER_DAY)
    day = date.fromordinal(_EPOCH_ORDINAL + 7 * week + weekday)
    second_of_day = tow_s - weekday * SECONDS_PER_DAY
    hour = int(second_of_day // 3600)
    minute = int((second_of_day - 3600 * hour) // 60)
    return day.year, day.month, day.day, hour, minute, second_of_day - 3600 * hour - 60 * minute


def calendar_text(week: int, tow_s: float) -> str:
    """Calendar date in GPS time to the millisecond, for messages: ``2024-06-24 08:20:00.000``."""
    year, month, day, hour, minute, second = calendar_from_gps(*from_epoch_key(epoch_key(week, tow_s)))
    return f"{year:04d}-{month:02d}-{day:02d} {hour:02d}:{minute:02d}:{second:06.3f}"


def normalised(week: int, tow_s: float) -> tuple[int, float]:
    """The same instant with ``0 <= tow_s < 604800``."""
    weeks = math.floor(tow_s / SECONDS_PER_WEEK)
    remainder = max(tow_s - weeks * SECONDS_PER_WEEK, 0.0)  # the smallest negative numbers divide to zero weeks
    if remainder >= SECONDS_PER_WEEK:  # a tiny negative time of week rounds up to a whole week
        return int(week) + weeks + 1, 0.0
    return int(week) + weeks, remainder


def add_seconds(week: int, tow_s: float, seconds: float) -> tuple[int, float]:
    """The instant `seconds` later, normalised."""
    return normalised(week, tow_s + seconds)


@overload
def seconds_between(week_a: float, tow_a_s: float, week_b: float, tow_b_s: float) -> float: ...
@overload
def seconds_between(week_a: ArrayLike, tow_a_s: ArrayLike, week_b: ArrayLike, tow_b_s: ArrayLike) -> FloatArray: ...
def seconds_between(week_a: ArrayLike, tow_a_s: ArrayLike, week_b: ArrayLike, tow_b_s: ArrayLike) -> float | FloatArray:
    """Time from `a` to `b` [s] (b less a), across weeks; numbers, or arrays that broadcast. NaN stays NaN."""
    weeks_are_numbers = isinstance(week_a, int) and isinstance(week_b, int)
    if weeks_are_numbers and isinstance(tow_a_s, float) and isinstance(tow_b_s, float):
        return float((week_b - week_a) * SECONDS_PER_WEEK + (tow_b_s - tow_a_s))
    weeks = np.subtract(week_b, week_a, dtype=np.float64)
    seconds = weeks * SECONDS_PER_WEEK + np.subtract(tow_b_s, tow_a_s, dtype=np.float64)
    return float(seconds) if np.ndim(seconds) == 0 else np.asarray(seconds)


def epoch_key(week: int, tow_s: float) -> int:
    """Integer name of an epoch: milliseconds since the start of GPS time, rounded to the nearest."""
    return int(week) * MILLISECONDS_PER_WEEK + round(tow_s * 1000.0)


def from_epoch_key(key: int) -> tuple[int, float]:
    """GPS week and time of week [s] of an epoch key."""
    week, milliseconds = divmod(int(key), MILLISECONDS_PER_WEEK)
    return week, milliseconds / 1000.0


def modified_z_count_s(tow_s: float) -> float:
    """Modified Z-count of a time of week: the time into the 20 minutes, 0 to 1199.9 s in steps of 0.1 s.

    Source: ICAO Annex 10 vol. I, B.3.6.4.2.4 (type 1 message, resolution 0.1 s, reset every 1200 s).
    """
    return (round(tow_s * 10.0) % round(MODIFIED_Z_COUNT_PERIOD_S * 10.0)) / 10.0


def resolve_modified_z_count(z_s: float, week: int, tow_s: float) -> tuple[int, float]:
    """The instant with modified Z-count `z_s` nearest to the given time (within 600 s of it).

    Raises
    ------
    ValueError
        If `z_s` is not in 0 to 1199.9 s.
    """
    if not 0.0 <= z_s < MODIFIED_Z_COUNT_PERIOD_S:
        raise ValueError(f"modified Z-count {z_s!r} s is not in 0 to 1199.9 s")
    period = round(MODIFIED_Z_COUNT_PERIOD_S * 10.0)
    tenths_of_week = round(tow_s * 10.0)
    ahead = (round(z_s * 10.0) - tenths_of_week) % period
    if ahead > period // 2:
        ahead -= period
    week_shift, tenths = divmod(tenths_of_week + ahead, 10 * SECONDS_PER_WEEK)
    return int(week) + week_shift, tenths / 10.0
