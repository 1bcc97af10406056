"""GPS time against published dates, RTKLIB, and its own inverses."""

from __future__ import annotations

import math
from datetime import datetime, timedelta

import numpy as np
import pyrtklib as rtk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss import gpstime

WEEKS = st.integers(min_value=0, max_value=5000)
MILLISECONDS = st.integers(min_value=0, max_value=gpstime.MILLISECONDS_PER_WEEK - 1)


# Published: start of GPS time (IS-GPS-200), the two week number rollovers announced by the GPS programme (2^10 weeks),
# the first day of Galileo System Time's weeks (Galileo OS SIS ICD 5.1.2: 1999-08-22, with UTC 13 s earlier).
@pytest.mark.parametrize(
    ("calendar", "week"), [((1980, 1, 6), 0), ((1999, 8, 22), 1024), ((2019, 4, 7), 2048), ((2023, 1, 8), 2244)]
)
def test_published_first_days_of_weeks(calendar: tuple[int, int, int], week: int) -> None:
    assert gpstime.gps_from_calendar(*calendar) == (week, 0.0)


@given(st.datetimes(min_value=datetime(1980, 1, 6), max_value=datetime(2079, 12, 31)))
def test_calendar_agrees_with_rtklib(moment: datetime) -> None:
    week, tow_s = gpstime.gps_from_calendar(
        moment.year, moment.month, moment.day, moment.hour, moment.minute, moment.second + moment.microsecond * 1e-6
    )
    calendar = rtk.Arr1Ddouble(6)
    values = (
        moment.year,
        moment.month,
        moment.day,
        moment.hour,
        moment.minute,
        moment.second + moment.microsecond / 1e6,
    )
    for index, value in enumerate(values):
        calendar[index] = value
    their_week = rtk.Arr1Dint(1)
    their_tow_s = rtk.time2gpst(rtk.epoch2time(calendar), their_week)
    assert week == their_week[0]
    # Two roundings of a time of week below 604800 s: its spacing in doubles is 1.2e-10 s.
    assert tow_s == pytest.approx(their_tow_s, abs=3e-10)


@given(WEEKS, MILLISECONDS)
def test_calendar_and_back(week: int, milliseconds: int) -> None:
    tow_s = milliseconds / 1000.0
    back = gpstime.gps_from_calendar(*gpstime.calendar_from_gps(week, tow_s))
    assert gpstime.epoch_key(*back) == gpstime.epoch_key(week, tow_s)
    # And against the standard library, which has no leap seconds either.
    expected = datetime(1980, 1, 6) + timedelta(weeks=week, milliseconds=milliseconds)
    assert gpstime.calendar_text(week, tow_s) == expected.strftime("%Y-%m-%d %H:%M:%S.") + f"{milliseconds % 1000:03d}"


@given(WEEKS, MILLISECONDS)
def test_epoch_key_and_back(week: int, milliseconds: int) -> None:
    key = gpstime.epoch_key(week, milliseconds / 1000.0)
    assert gpstime.from_epoch_key(key) == (week, milliseconds / 1000.0)


def test_epoch_key_rounds_to_the_millisecond_across_the_end_of_the_week() -> None:
    assert gpstime.epoch_key(2000, 604799.9996) == gpstime.epoch_key(2001, 0.0)
    assert gpstime.from_epoch_key(gpstime.epoch_key(2000, 604799.9996)) == (2001, 0.0)


@given(WEEKS, MILLISECONDS, st.integers(min_value=-2 * 10**9, max_value=2 * 10**9))
def test_adding_seconds_moves_the_key(week: int, milliseconds: int, added: int) -> None:
    tow_s = milliseconds / 1000.0
    later = gpstime.add_seconds(week, tow_s, added / 1000.0)
    assert 0.0 <= later[1] < gpstime.SECONDS_PER_WEEK
    assert gpstime.epoch_key(*later) == gpstime.epoch_key(week, tow_s) + added
    # Doubles near 2.6e6 s are 4.7e-10 s apart; a few of them add up.
    assert gpstime.seconds_between(week, tow_s, *later) == pytest.approx(added / 1000.0, abs=2e-9)


@given(st.floats(min_value=-1e7, max_value=1e7))
def test_normalised_time_of_week_is_in_its_week(tow_s: float) -> None:
    week, inside = gpstime.normalised(2000, tow_s)
    assert 0.0 <= inside < gpstime.SECONDS_PER_WEEK
    # Spacing of doubles at 1e7 s is 1.9e-9 s.
    assert (week - 2000) * gpstime.SECONDS_PER_WEEK + inside == pytest.approx(tow_s, abs=4e-9)


def test_a_hair_before_the_week_is_the_week() -> None:
    assert gpstime.normalised(2000, -1e-20) == (2000, 0.0)


def test_seconds_between_broadcasts_and_keeps_missing_missing() -> None:
    week = np.array([2000.0, 2001.0, np.nan])
    between = gpstime.seconds_between(week, np.array([604799.0, 1.0, 0.0]), 2001, 0.0)
    np.testing.assert_array_equal(between, [1.0, -1.0, np.nan])
    assert isinstance(gpstime.seconds_between(2000, 1.0, 2000, 2.5), float)


def test_dates_that_do_not_exist_are_refused() -> None:
    with pytest.raises(ValueError, match="1979-12-31 is before the start of GPS time"):
        gpstime.gps_from_calendar(1979, 12, 31)
    with pytest.raises(ValueError, match="day"):
        gpstime.gps_from_calendar(2023, 2, 29)


# Annex 10, B.3.6.4.2.4: reset on the hour, 20 and 40 minutes past; 0.1 s steps; 0 to 1199.9 s.
@pytest.mark.parametrize(
    ("tow_s", "z_s"), [(0.0, 0.0), (1199.9, 1199.9), (1200.0, 0.0), (3600.5, 0.5), (604799.95, 0.0), (116400.5, 0.5)]
)
def test_modified_z_count(tow_s: float, z_s: float) -> None:
    assert gpstime.modified_z_count_s(tow_s) == z_s


@given(WEEKS, st.integers(min_value=0, max_value=6048000 - 1), st.floats(min_value=-599.0, max_value=599.0))
def test_modified_z_count_is_resolved_near_the_time_it_is_received(week: int, tenths: int, late_s: float) -> None:
    sent = (week, tenths / 10.0)
    received = gpstime.add_seconds(*sent, late_s)
    resolved = gpstime.resolve_modified_z_count(gpstime.modified_z_count_s(sent[1]), *received)
    assert gpstime.epoch_key(*resolved) == gpstime.epoch_key(*sent)


@pytest.mark.parametrize("z_s", [-0.1, 1200.0, math.nan])
def test_modified_z_count_out_of_range_is_refused(z_s: float) -> None:
    with pytest.raises(ValueError, match="modified Z-count"):
        gpstime.resolve_modified_z_count(z_s, 2000, 0.0)
