"""Almanacs against RTKLIB's positions, the text of the files, and broadcast ephemerides."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pyrtklib as rtk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss import almanac, orbits
from gbas_core.gnss.almanac import Almanac, AlmanacError
from gbas_core.gnss.ephemeris import is_complete
from gbas_core.satellites import IS_GALILEO, IS_GPS

# File, week it is nearest to, its own week, satellites (data README), time of applicability as in the text.
FILES = (
    ("test_input_gps_almanac_week819.txt", 1850, 819 + 1024, 31, 319488.0),
    ("test_input_yuma377.txt", 1400, 377 + 1024, 30, 319488.0),
    ("test_input_sem387.txt", 1400, 387 + 1024, 30, 589824.0),
)
YUMA_LABELS = {
    "health": "Health",
    "e": "Eccentricity",
    "i_rad": r"Orbital Inclination\(rad\)",
    "omega_dot_radps": r"Rate of Right Ascen\(r/s\)",
    "sqrt_a": r"SQRT\(A\)  \(m 1/2\)",
    "omega0_rad": r"Right Ascen at Week\(rad\)",
    "omega_rad": r"Argument of Perigee\(rad\)",
    "m0_rad": r"Mean Anom\(rad\)",
    "af0_s": r"Af0\(s\)",
    "af1_sps": r"Af1\(s/s\)",
}


@pytest.fixture(scope="module", params=FILES, ids=lambda item: item[0])
def case(request: pytest.FixtureRequest, data_dir: Path) -> tuple[Almanac, tuple, str]:
    path = data_dir / "almanacs" / request.param[0]
    return almanac.read_almanac(path, near_week=request.param[1]), request.param, path.read_text()


def test_weeks_and_satellites(case: tuple[Almanac, tuple, str]) -> None:
    read, (_, _, week, n_sats, toa_s), _ = case
    assert np.isfinite(read.sqrt_a).sum() == n_sats
    assert not np.isfinite(read.sqrt_a[IS_GALILEO]).any()
    assert (read.gps_week, read.tow_s) == (week, toa_s)
    present = np.isfinite(read.sqrt_a)
    assert set(read.toa_week[present]) == {week}
    assert set(read.toa_tow_s[present]) == {toa_s}


def test_numbers_are_those_of_the_text(case: tuple[Almanac, tuple, str]) -> None:
    read, (name, *_), text = case
    if "sem" in name:
        lines = [line.split() for line in text.splitlines() if line.strip()]
        for start in range(2, len(lines), 8):
            prn = int(lines[start][0])
            e, di, omega_dot = map(float, lines[start + 3])
            sqrt_a, omega0, omega = map(float, lines[start + 4])
            m0, af0, af1 = map(float, lines[start + 5])
            semicircles = np.array([di + 0.30, omega_dot, omega0, omega, m0]) * math.pi
            ours = [
                getattr(read, field)[prn - 1]
                for field in ("i_rad", "omega_dot_radps", "omega0_rad", "omega_rad", "m0_rad")
            ]
            np.testing.assert_allclose(ours, semicircles, rtol=1e-13)  # the ICD's pi has 14 digits
            plain = [getattr(read, field)[prn - 1] for field in ("e", "sqrt_a", "af0_s", "af1_sps", "health")]
            assert plain == [e, sqrt_a, af0, af1, float(lines[start + 6][0])]
        return
    prns = [int(prn) for prn in re.findall(r"^ID:\s+(\d+)", text, re.MULTILINE)]
    for field, label in YUMA_LABELS.items():
        values = [float(value) for value in re.findall(rf"^{label}:\s+(\S+)", text, re.MULTILINE)]
        np.testing.assert_array_equal(getattr(read, field)[np.array(prns) - 1], values)


def test_positions_and_clocks_are_rtklibs(case: tuple[Almanac, tuple, str]) -> None:
    read, _, _ = case
    tow_s = read.tow_s + 4321.0
    state = almanac.almanac_state(read, read.gps_week, tow_s)
    for index in np.flatnonzero(np.isfinite(read.sqrt_a)):
        theirs = rtk.alm_t()
        theirs.toa = rtk.gpst2time(int(read.toa_week[index]), float(read.toa_tow_s[index]))
        theirs.toas = float(read.toa_tow_s[index])
        theirs.A = float(read.sqrt_a[index]) ** 2
        names = {"e": "e", "i0": "i_rad", "OMG0": "omega0_rad", "omg": "omega_rad", "M0": "m0_rad"}
        for name, field in (names | {"OMGd": "omega_dot_radps", "f0": "af0_s", "f1": "af1_sps"}).items():
            setattr(theirs, name, float(getattr(read, field)[index]))
        position, clock = rtk.Arr1Ddouble(3), rtk.Arr1Ddouble(1)
        rtk.alm2pos(rtk.gpst2time(read.gps_week, tow_s), theirs, position, clock)
        # The same equations. RTKLIB stops Kepler's iteration at 1e-13 rad (3 um) in the last step, mostly far better.
        np.testing.assert_allclose(state.position_m[:, index], [position[i] for i in range(3)], rtol=0.0, atol=1e-6)
        # RTKLIB's almanac clock is the polynomial alone.
        relativity_s = orbits.RELATIVISTIC_F[index] * read.e[index] * read.sqrt_a[index]
        assert abs(state.clock_s[index] - clock[0]) <= abs(relativity_s) * (1.0 + 1e-9)


def test_an_almanac_orbit_is_a_gps_orbit(case: tuple[Almanac, tuple, str]) -> None:
    """Half a sidereal day, 26 560 km, 55 degrees, as IS-GPS-200 has it; eccentricities are below 0.03."""
    read, _, _ = case
    present = np.isfinite(read.sqrt_a)
    state = almanac.almanac_state(read, read.gps_week, read.tow_s + np.arange(0.0, 43200.0, 900.0)[:, np.newaxis])
    radius_m = np.linalg.norm(state.position_m, axis=1)[:, present]
    assert np.abs(radius_m.mean(axis=0) - 26.5604e6).max() < 0.15e6
    assert np.abs(np.rad2deg(read.i_rad[present]) - 55.0).max() < 5.0
    sidereal_day_s = 86164.0905
    later = almanac.almanac_state(read, read.gps_week, read.tow_s + sidereal_day_s).position_m[:, present]
    now = almanac.almanac_state(read, read.gps_week, read.tow_s).position_m[:, present]
    assert np.linalg.norm(later - now, axis=0).max() < 400e3  # the ground track repeats but for drifts of some km/day


def test_an_almanac_as_ephemeris_is_marked_and_incomplete(case: tuple[Almanac, tuple, str]) -> None:
    ephemeris = almanac.ephemeris_from_almanac(case[0])
    assert ephemeris.simulated == 1.0
    assert not is_complete(ephemeris).any()  # no group delay and no issue of data: never usable as it is
    np.testing.assert_array_equal(np.isfinite(ephemeris.message), np.isfinite(case[0].sqrt_a))


@given(st.integers(min_value=0, max_value=6000), st.integers(min_value=-511, max_value=511))
def test_week_rollover(near: int, offset: int) -> None:
    assert almanac.resolve_week((near + offset) % 1024, near) == near + offset
    assert almanac.resolve_week(near + offset, near) == near + offset  # a full week number is one already


@pytest.fixture
def yuma(data_dir: Path) -> str:
    return (data_dir / "almanacs" / "test_input_yuma377.txt").read_text()


@pytest.fixture
def sem(data_dir: Path) -> str:
    return (data_dir / "almanacs" / "test_input_sem387.txt").read_text()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.6597995758E-002", "0.66", "line 4: Eccentricity: '0.66'; expected 0 to 0.5"),
        ("0.6597995758E-002", "x", "line 4: Eccentricity: 'x'; expected a number"),
        ("5153.683594", "nan", r"line 8: SQRT: 'nan'; expected 2530 to 8192"),
        ("ID:                         02", "ID:                         01", "PRN 1 is there twice"),
        ("ID:                         02", "ID:                         33", "PRN '33'; expected 1 to 32"),
        ("Mean Anom(rad):             0.4668447322E+000\n", "", "PRN 1: m0_rad is missing"),
        ("319488.0000", "-1.0", "Time of Applicability: '-1.0'; expected 0 to 604799"),
    ],
)
def test_yuma_errors_name_place_field_and_bound(yuma: str, old: str, new: str, message: str) -> None:
    assert old in yuma
    with pytest.raises(AlmanacError, match=re.escape(message) if "(" in message else message):
        almanac.parse_yuma(yuma.replace(old, new, 1), near_week=1400)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("30  CURRENT.ALM", "31  CURRENT.ALM", "ends early"),
        ("30  CURRENT.ALM", "thirty", "number of satellites: 'thirty'; expected a number"),
        (" 0.67005157470703E-0002", " 0.67005157470703E+0002", "line 7: e: .*; expected 0 to 0.5"),
        (" 0.51536845703125E+0004 -0.57885289192200E+0000", "", "expected 3 numbers"),
    ],
)
def test_sem_errors_name_place_field_and_bound(sem: str, old: str, new: str, message: str) -> None:
    assert old in sem
    with pytest.raises(AlmanacError, match=message):
        almanac.parse_sem(sem.replace(old, new, 1), near_week=1400)


@pytest.mark.parametrize("end", range(8000, 8600, 7))
def test_a_cut_file_is_refused_or_has_whole_satellites(yuma: str, sem: str, end: int) -> None:
    with pytest.raises(AlmanacError):
        almanac.parse_sem(sem[: end - 3000], near_week=1400)
    whole = almanac.parse_yuma(yuma, near_week=1400)
    try:
        cut = almanac.parse_yuma(yuma[:end], near_week=1400)
    except AlmanacError:
        return
    kept = np.isfinite(cut.sqrt_a)
    assert kept.sum() < np.isfinite(whole.sqrt_a).sum()
    for name in ("toa_week", "toa_tow_s", *YUMA_LABELS):
        np.testing.assert_array_equal(getattr(cut, name)[kept], getattr(whole, name)[kept])


@pytest.mark.parametrize("content", [b"", b"\x00\xff\x1f\x8b", b"hello\n", b"******** nothing ********\n"])
def test_other_files_are_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "some.alm"
    path.write_bytes(content)
    with pytest.raises(AlmanacError, match=r"some\.alm"):
        almanac.read_almanac(path, near_week=2300)
    with pytest.raises(AlmanacError, match=r"absent\.alm"):
        almanac.read_almanac(tmp_path / "absent.alm", near_week=2300)


def test_only_gps_places_are_used(case: tuple[Almanac, tuple, str]) -> None:
    assert not np.isfinite(almanac.ephemeris_from_almanac(case[0]).message[~IS_GPS]).any()
