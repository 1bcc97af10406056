"""How far sources of orbits are from each other: almanac, broadcast records, tabulated positions as SP3 files have.

Medians over satellites and times of 3-D differences. They are printed with ``pytest -s`` and stated in
docs/validation.md.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from gbas_core.gnss.almanac import Almanac, almanac_state, parse_yuma
from gbas_core.gnss.ephemeris import FIELDS, Ephemeris
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
from gbas_core.gnss.orbits import GM_M3PS2, satellite_state
from gbas_core.io.rinex import NavigationFile, read_navigation
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS, satellites_of
from gbas_sim.satellites.broadcast import nominal_orbits

RECORDED = "nav_rinex4_2026/BRD400DLR_S_20260680000_01D_MN.rnx.gz"
NOON_S = 2409 * SECONDS_PER_WEEK + 86_400.0 + 43_200.0  # Monday 2026-03-09 12:00
SYSTEMS = {"GPS": IS_GPS, "Galileo": IS_GALILEO}


@pytest.fixture(scope="module")
def recorded(data_dir: Path) -> NavigationFile:
    return read_navigation([data_dir / RECORDED])


def chosen(navigation: NavigationFile, rows: np.ndarray) -> Ephemeris:
    """Records ``(N_SATS,)`` by number, -1 for none, as an ephemeris."""
    values = np.where(rows[:, np.newaxis] >= 0, navigation.values[rows], np.nan)
    columns = dict(zip(FIELDS, values.T, strict=True))
    return Ephemeris(gps_week=2409, tow_s=0.0, simulated=0.0, **columns)


def nearest(navigation: NavigationFile, at_s: float, farthest_s: float) -> np.ndarray:
    """The healthy record of each satellite whose toe is nearest to a time, ``(N_SATS,)``; -1 for none so near."""
    rows, away_s = np.full(N_SATS, -1), np.abs(navigation.toe_s - at_s)
    healthy = navigation.values[:, FIELDS.index("health")] == 0.0
    for row in np.argsort(-away_s, kind="stable"):
        if healthy[row] and away_s[row] <= farthest_s:
            rows[navigation.satellite[row]] = row
    return rows


def position_m(ephemeris: Ephemeris, at_s: float | np.ndarray) -> np.ndarray:
    """Positions (3, N_SATS) at a time since the start of GPS time, or at one of each satellite [m]."""
    tow_s = np.broadcast_to(np.asarray(at_s) - 2409 * SECONDS_PER_WEEK, N_SATS)
    return satellite_state(ephemeris, 2409, tow_s, None).position_m


def apart_m(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.linalg.norm(first - second, axis=-2)


# --- almanac


def yuma_text(ephemeris: Ephemeris) -> str:
    """The GPS satellites of an ephemeris as a YUMA file, with the digits these files have."""
    blocks = []
    for index in np.flatnonzero(IS_GPS & np.isfinite(ephemeris.sqrt_a)):
        value = {name: float(getattr(ephemeris, name)[index]) for name in FIELDS}
        omega0, omega, m0 = (math.remainder(value[k], 2.0 * math.pi) for k in ("omega0_rad", "omega_rad", "m0_rad"))
        blocks.append(
            f"******** Week {int(value['toe_week']) % 1024} almanac for PRN-{index + 1:02d} ********\n"
            f"ID:                         {index + 1:02d}\n"
            f"Health:                     000\n"
            f"Eccentricity:               {value['e']:.10E}\n"
            f"Time of Applicability(s):  {value['toe_tow_s']:.4f}\n"
            f"Orbital Inclination(rad):   {value['i0_rad']:.10f}\n"
            f"Rate of Right Ascen(r/s):  {value['omega_dot_radps']:.10E}\n"
            f"SQRT(A)  (m 1/2):           {value['sqrt_a']:.6f}\n"
            f"Right Ascen at Week(rad):  {omega0:.10E}\n"
            f"Argument of Perigee(rad):   {omega:.9f}\n"
            f"Mean Anom(rad):             {m0:.10E}\n"
            f"Af0(s):                     {value['af0_s']:.10E}\n"
            f"Af1(s/s):                  {value['af1_sps']:.10E}\n"
            f"week:                        {int(value['toe_week']) % 1024}\n"
        )
    return "\n".join(blocks)


def abbreviated(ephemeris: Ephemeris) -> Almanac:
    """The elements an almanac has, of all satellites: YUMA files have GPS only."""
    same = ("health", "sqrt_a", "e", "omega0_rad", "omega_dot_radps", "omega_rad", "m0_rad", "af0_s", "af1_sps")
    return Almanac(
        gps_week=2409,
        tow_s=float(np.nanmax(ephemeris.toe_tow_s)),
        toa_week=ephemeris.toe_week,
        toa_tow_s=ephemeris.toe_tow_s,
        i_rad=ephemeris.i0_rad,
        **{name: getattr(ephemeris, name) for name in same},
    )


def with_motion(almanac: Almanac, ephemeris: Ephemeris) -> Almanac:
    """The almanac with an axis of which the mean motion is the ephemeris' with its delta_n, as one fitted has."""
    motion = np.sqrt(GM_M3PS2) / ephemeris.sqrt_a**3 + ephemeris.delta_n_radps
    return replace(almanac, sqrt_a=(np.sqrt(GM_M3PS2) / motion) ** (1.0 / 3.0))


def test_kepler_almanac_against_broadcast(recorded):
    """An almanac of noon's records, for the day around it, against the broadcast record nearest to each time.

    Published: a range error of 900 m (1 sigma) in normal operation, IS-GPS-200N 20.3.3.5.2.1; that is of almanacs
    fitted to days. With elements as they are in one record the almanac lacks delta_n, 4e-9 to 6e-9 rad/s: up to
    2.6e-4 rad or 7 km along track in 12 h, half of it in the median. With the mean motion in its axis, as a fitted
    almanac has it, there are left the harmonic terms (hundreds of metres) and the axis, which then is 2 delta_n / (3 n)
    of itself too small: 0.6 km.
    """
    source = chosen(recorded, nearest(recorded, NOON_S, 3600.0))
    bare, yuma = abbreviated(source), parse_yuma(yuma_text(source), near_week=2409)
    almanacs = {"as in the record": bare, "with its mean motion": with_motion(bare, source), "YUMA": yuma}
    away_m: dict[str, list[np.ndarray]] = {kind: [] for kind in almanacs}
    digits_m = []
    since_s = np.arange(-43_200.0, 43_201.0, 1800.0)
    for at_s in NOON_S + since_s:
        broadcast = position_m(chosen(recorded, nearest(recorded, at_s, 7200.0)), at_s)
        tow_s = np.full(N_SATS, at_s - 2409 * SECONDS_PER_WEEK)
        planned = {kind: almanac_state(each, 2409, tow_s).position_m for kind, each in almanacs.items()}
        digits_m.append(apart_m(planned["YUMA"], planned["as in the record"]))
        for kind, position in planned.items():
            away_m[kind].append(apart_m(position, broadcast))
    # Of YUMA's digits, those of the root of the axis matter most: 5e-7 of 5154 are 2e-8 of a motion of 6.3 rad: 1 m.
    assert 0.0 < np.nanmax(digits_m) < 2.0
    bounds_m = {"as in the record": (1000.0, 4000.0), "with its mean motion": (200.0, 2000.0)}
    for kind, (low, high) in bounds_m.items():
        for name, mask in SYSTEMS.items():
            day = np.array(away_m[kind])[:, mask]
            hours = day[np.abs(since_s) <= 7200.0]
            assert np.isfinite(day).any(axis=0).sum() >= 20
            print(f"almanac {kind} - broadcast, {name}: median {np.nanmedian(day):.0f} m over 24 h, "
                  f"{np.nanmedian(hours):.0f} m within 2 h, largest {np.nanmax(day):.0f} m")  # fmt: skip
            assert low < np.nanmedian(day) < high
            assert 100.0 < np.nanmedian(hours) < 1500.0


# --- broadcast records against each other


def hand_overs_m(navigation: NavigationFile, system: np.ndarray, apart_s: float, at_s: float) -> np.ndarray:
    """Differences of healthy records that follow one another by a time, at a time after the toe of the earlier."""
    healthy, differences = navigation.values[:, FIELDS.index("health")] == 0.0, []
    place = {(navigation.satellite[row], navigation.toe_s[row]): row for row in np.flatnonzero(healthy)}
    for slot_s in np.unique(navigation.toe_s):
        rows = np.array([[place.get((s, slot_s + later), -1) for s in range(N_SATS)] for later in (0.0, apart_s)])
        rows = np.where((rows >= 0).all(axis=0) & system, rows, -1)
        if (rows >= 0).any():
            old, new = (position_m(chosen(navigation, each), slot_s + at_s) for each in rows)
            differences.append(apart_m(old, new))
    found = np.array(differences)
    return found[np.isfinite(found)]


def test_broadcast_records_at_hand_over(recorded):
    """Two fits of the same orbit, where receivers pass from one to the other: below a metre.

    Published: range errors of 0.6 m (GPS) and 0.2 m (Galileo), rms of 2017: Montenbruck, Steigenberger, Hauschild,
    "Multi-GNSS signal-in-space range error assessment - methodology and results", Adv. Space Res. 61 (2018),
    3020-3038; range errors are mostly radial, and 3-D errors larger. Sets of one upload share most of their error, so
    differences may be much smaller, but not below the message's steps of a centimetre.

    GPS satellites send a set two hours ahead of its time: records meet in the middle. Galileo satellites send it
    after its time (11 min in this file): records meet at the time of the later one.
    """
    sent_s = recorded.transmitted_s - recorded.toe_s
    of_gps = IS_GPS[recorded.satellite]
    assert np.nanmedian(sent_s[of_gps]) < -3600.0 < 0.0 < np.nanmedian(sent_s[~of_gps])
    for name, apart_s, at_s in (("GPS", 7200.0, 3600.0), ("Galileo", 600.0, 600.0), ("Galileo", 3600.0, 3600.0)):
        steps_m = hand_overs_m(recorded, SYSTEMS[name], apart_s, at_s)
        print(f"broadcast - broadcast, {name}, {apart_s:.0f} s apart: median {np.median(steps_m):.3f} m, 95 % "
              f"{np.percentile(steps_m, 95.0):.3f} m, {steps_m.size} hand-overs")  # fmt: skip
        assert steps_m.size > 100
        assert 0.01 < np.median(steps_m) < 1.0


# --- tables of positions


def test_broadcast_against_a_table_of_positions():
    """A day of the simulator's sets against its orbits as an SP3 file has them: every 15 min, to the millimetre.

    Interpolation is that of users of such files: 11 points around the time (Schenewerk, "A brief review of basic GPS
    orbit interpolation strategies", GPS Solutions 6 (2003), 265-267: better than a centimetre inside of a table).
    """
    week, start_s, both = 2400, 90_000.0, satellites_of("GE")
    orbits = nominal_orbits(week, start_s, 86_400.0, seed=1, systems=both)
    (truth,) = orbits.truth

    def true_m(tow_s: float) -> np.ndarray:
        return satellite_state(truth, week, np.full(N_SATS, tow_s), None).position_m

    first_s = start_s - 6 * 900.0
    table = np.round([true_m(first_s + 900.0 * number) for number in range(110)], 3)
    table_error_m, away_m = [], []
    for since_s in np.arange(450.0, 86_400.0, 2100.0):
        at_s = start_s + since_s
        middle = round((at_s - first_s) / 900.0)
        nodes = np.arange(middle - 5, middle + 6)
        tabulated = BarycentricInterpolator(nodes, table[nodes])((at_s - first_s) / 900.0)
        age_s = [float(np.nanmax(np.abs(each.toe_tow_s - at_s))) for each in orbits.received]
        assert min(age_s) <= 3600.0
        sent = orbits.received[age_s.index(min(age_s))]
        table_error_m.append(apart_m(tabulated, true_m(at_s)))
        away_m.append(apart_m(tabulated, satellite_state(sent, week, np.full(N_SATS, at_s), None).position_m))
    print(f"table - truth: largest {np.nanmax(table_error_m):.4f} m")
    assert np.nanmax(table_error_m) < 0.01
    for name, mask in SYSTEMS.items():
        difference_m = np.array(away_m)[:, mask]
        print(f"broadcast - table, {name}: median {np.nanmedian(difference_m):.4f} m, largest "
              f"{np.nanmax(difference_m):.4f} m")  # fmt: skip
        # Steps of the message, as in test_sim_orbits, and the table's.
        assert 0.001 < np.nanmedian(difference_m) < 0.08
