"""The simulated constellations against what the systems publish of theirs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.gnss.ephemeris import EphemerisStore, NavigationMessage, is_complete
from gbas_core.gnss.frames import EARTH_RATE_RADPS
from gbas_core.gnss.gpstime import add_seconds, gps_from_calendar
from gbas_core.gnss.orbits import satellite_state
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_GPS, SAT_INDEX, satellites_of
from gbas_sim.satellites.constellation import (
    GPS_HOUR_ANGLE_DEG,
    greenwich_hour_angle_rad,
    nominal_ephemeris,
    nominal_slots,
)
from gbas_vdb.messages.ephemeris_crc import GALILEO_INAV_FIELDS, GPS_FIELDS, NavigationField, ephemeris_crcs

BOTH = satellites_of("GE")
START = (2400, 216_000.0)


@pytest.fixture(scope="module")
def ephemeris():
    return nominal_ephemeris(*START, seed=1, systems=BOTH)


def wrapped_deg(angle_rad):
    return (np.degrees(angle_rad) + 180.0) % 360.0 - 180.0


def test_sidereal_time_is_the_published_hour_angle():
    # 18 h 36 min 14.4 s at 1993-07-01 00:00 (GPS SPS Performance Standard, table 3-1), printed to 0.1 s; the sidereal
    # time of that date is 13.27 s by the 1982 definition: 1.1 s, or 17 arc seconds, apart.
    days = (np.datetime64("1993-07-01T00:00") - np.datetime64("2000-01-01T12:00")) / np.timedelta64(1, "D")
    assert math.degrees(greenwich_hour_angle_rad(float(days))) == pytest.approx(GPS_HOUR_ANGLE_DEG, abs=0.005)


def test_gps_slots_at_the_reference_epoch():
    week, tow = gps_from_calendar(1993, 7, 1)
    slots = nominal_slots(week, tow + 9.0)  # nine leap seconds between UTC and GPS time
    # GPS SPS Performance Standard (2001), table A-2-1: the same plan printed a second time, as an almanac at another
    # time. Slots E1 to F4: mean anomalies, and nodes of planes E and F. Only differences between slots can be compared.
    anomaly = np.array([11.746, -242.704, -119.234, -211.614, 53.586, 159.926, -80.094, -49.954])
    node = np.repeat([42.374, 102.374], 4)
    e1 = SAT_INDEX["G17"]
    for ours, published in ((slots.latitude_argument_rad, anomaly), (slots.node_longitude_rad, node)):
        along = ours[e1 : e1 + 8] - np.radians(published)
        np.testing.assert_allclose(wrapped_deg(along - along[0]), 0.0, atol=1e-9)
    # Slot A1 as in table 3-1, and six planes 60 degrees apart.
    assert np.degrees(slots.latitude_argument_rad[0]) == pytest.approx(268.126, abs=1e-9)
    assert wrapped_deg(slots.node_longitude_rad[0]) == pytest.approx(272.847 - 279.06, abs=1e-9)
    planes = np.sort(np.degrees(slots.node_longitude_rad[:24:4]))
    np.testing.assert_allclose(np.diff(planes), 60.0, atol=1e-9)


@pytest.mark.parametrize(
    ("sat", "node_deg", "anomaly_deg"),
    # European GNSS Service Centre, orbital and technical parameters: slots A02, A05 and C07.
    [("E02", 317.632, 225.153), ("E05", 317.632, 0.153), ("E23", 197.632, 120.153)],
)
def test_galileo_slots_at_the_reference_epoch(sat, node_deg, anomaly_deg):
    week, tow = gps_from_calendar(2016, 11, 21)
    slots = nominal_slots(week, tow + 17.0)
    place = SAT_INDEX[sat]
    assert wrapped_deg(slots.latitude_argument_rad[place] - math.radians(anomaly_deg)) == pytest.approx(0.0, abs=1e-9)
    days = (np.datetime64("2016-11-21T00:00") - np.datetime64("2000-01-01T12:00")) / np.timedelta64(1, "D")
    node = math.radians(node_deg) - greenwich_hour_angle_rad(float(days))
    assert wrapped_deg(slots.node_longitude_rad[place] - node) == pytest.approx(0.0, abs=1e-9)


def test_radius_inclination_and_period(ephemeris):
    state = satellite_state(ephemeris, *START, None)
    radius = np.linalg.norm(state.position_m, axis=0)
    # The square root of the semi-major axis is broadcast in steps of 2^-19, which is 20 mm of radius.
    np.testing.assert_allclose(radius[IS_GPS & np.isfinite(radius)], 26_559_700.0, atol=0.02)
    np.testing.assert_allclose(radius[IS_GALILEO & np.isfinite(radius)], 29_599_800.0, atol=0.02)
    inertial = state.velocity_mps.copy()
    inertial[0] -= EARTH_RATE_RADPS * state.position_m[1]
    inertial[1] += EARTH_RATE_RADPS * state.position_m[0]
    normal = np.cross(state.position_m, inertial, axis=0)
    tilt = np.degrees(np.arccos(normal[2] / np.linalg.norm(normal, axis=0)))
    # The node's drift tilts the momentary plane by up to 7.8e-9 rad/s x sin(i) / n = 0.0025 degrees.
    np.testing.assert_allclose(tilt[:24], 55.0, atol=3e-3)
    np.testing.assert_allclose(tilt[N_GPS : N_GPS + 24], 56.0, atol=3e-3)
    period_h = 2.0 * np.pi * radius / np.linalg.norm(inertial, axis=0) / 3600.0
    # Published: 11 h 58 min and 14 h 4 min 42 s; the node's drift is worth 0.1 s.
    np.testing.assert_allclose(period_h[:24], 11.0 + 58.0 / 60.0, atol=0.5 / 60.0)
    np.testing.assert_allclose(period_h[N_GPS : N_GPS + 24], 14.0 + 4.0 / 60.0 + 42.0 / 3600.0, atol=1.0 / 3600.0)


def test_gps_ground_track_repeats_after_a_sidereal_day():
    sidereal_day_s = 2.0 * np.pi / (EARTH_RATE_RADPS - np.radians(-4.4874e-7))
    first = nominal_slots(*START)
    later = nominal_slots(*add_seconds(*START, sidereal_day_s))
    for name in ("node_longitude_rad", "latitude_argument_rad"):
        # Angles of some 1e5 rad since 1993 keep 1e-11 rad.
        np.testing.assert_allclose(wrapped_deg(getattr(later, name) - getattr(first, name))[:24], 0.0, atol=1e-6)


def test_every_field_is_a_multiple_of_its_scale_factor(ephemeris):
    assert is_complete(ephemeris).sum() == 48

    def check(fields: tuple[NavigationField, ...], satellites: slice) -> None:
        for item in fields:
            values = np.asarray(getattr(ephemeris, item.name))[satellites] / item.lsb
            # An angle of 2^31 steps times pi keeps the last bits of a double: 1e-6 of a step.
            np.testing.assert_allclose(values, np.rint(values), rtol=0.0, atol=1e-6, err_msg=item.name)
            low, high = (-(2 ** (item.bits - 1)), 2 ** (item.bits - 1) - 1) if item.signed else (0, 2**item.bits - 1)
            assert (values >= low - 1e-6).all(), item.name
            assert (values <= high + 1e-6).all(), item.name

    check(GPS_FIELDS, slice(0, 24))
    check(GALILEO_INAV_FIELDS, slice(N_GPS, N_GPS + 24))
    crcs = ephemeris_crcs(ephemeris)
    assert np.isfinite(crcs).sum() == 48
    assert len(np.unique(crcs[np.isfinite(crcs)])) > 40  # 48 draws of 65536: more than a few alike would be a fault


def test_ephemerides_are_usable_from_the_start(ephemeris):
    usable = EphemerisStore().add(ephemeris).usable(*START, 120.0)
    assert np.isfinite(usable.message).sum() == 48
    assert usable.simulated == 1.0
    assert set(usable.message[IS_GPS & np.isfinite(usable.message)]) == {float(NavigationMessage.GPS_LNAV)}
    after = EphemerisStore().add(ephemeris).usable(*add_seconds(*START, 6_900.0), 120.0)
    assert np.isfinite(after.message).sum() == 48


def test_systems_and_seeds():
    gps = nominal_ephemeris(*START, seed=1, systems=satellites_of("G"))
    assert not np.isfinite(gps.message[IS_GALILEO]).any()
    other = nominal_ephemeris(*START, seed=2, systems=satellites_of("G"))
    assert (other.af0_s[:24] != gps.af0_s[:24]).all()
    np.testing.assert_array_equal(other.m0_rad, gps.m0_rad)


def test_start_at_the_end_of_a_week():
    late = nominal_ephemeris(2400, 604_799.5, seed=1, systems=BOTH)
    assert (late.toe_week[0], late.toe_tow_s[0]) == (2401.0, 0.0)
    first = satellite_state(late, 2400, 604_799.5)
    second = satellite_state(late, 2401, -0.5)
    np.testing.assert_allclose(first.position_m, second.position_m, atol=1e-6)  # the same instant, said twice
