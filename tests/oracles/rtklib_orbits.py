"""Broadcast orbits by RTKLIB (through pyrtklib), from files it reads itself: a second opinion on orbits and clocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyrtklib as rtk

from rtklib_dgnss import plain_copy

SYSTEMS = {1: "G", 8: "E"}
FNAV_DATA_SOURCE = 1 << 8


def read_rinex(path: Path, folder: Path) -> tuple[rtk.obs_t, rtk.nav_t]:
    """Observations and ephemerides of one RINEX file, as RTKLIB reads them."""
    observations, navigation, station = rtk.obs_t(), rtk.nav_t(), rtk.sta_t()
    status = rtk.readrnx(str(plain_copy(path, folder)), 1, "", observations, navigation, station)
    if status < 0:
        raise RuntimeError(f"RTKLIB cannot read {path}")
    return observations, navigation


def satellite_name(number: int) -> str | None:
    """RINEX name of a satellite number of RTKLIB; None for another system than GPS and Galileo."""
    prn = rtk.Arr1Dint(1)
    letter = SYSTEMS.get(rtk.satsys(number, prn))
    return None if letter is None else f"{letter}{prn[0]:02d}"


def ephemerides(navigation: rtk.nav_t) -> dict[tuple[str, str, int, float], rtk.eph_t]:
    """RTKLIB's ephemerides by satellite name, message (lnav, inav, fnav), issue of data and time of ephemeris [s]."""
    found = {}
    for index in range(navigation.n):
        eph = navigation.eph[index]
        name = satellite_name(eph.sat)
        if name is None:
            continue
        message = "lnav" if name[0] == "G" else ("fnav" if eph.code & FNAV_DATA_SOURCE else "inav")
        week = rtk.Arr1Dint(1)
        tow_s = rtk.time2gpst(eph.toe, week)
        found[name, message, eph.iode, week[0] * 604800.0 + tow_s] = eph
    return found


def position_and_clock(eph: rtk.eph_t, week: int, tow_s: float) -> tuple[np.ndarray, float]:
    """Position [m] and clock with relativity, without group delay [s], at a system time of transmission."""
    position, clock, variance = rtk.Arr1Ddouble(3), rtk.Arr1Ddouble(1), rtk.Arr1Ddouble(1)
    rtk.eph2pos(rtk.gpst2time(week, tow_s), eph, position, clock, variance)
    return np.array([position[0], position[1], position[2]]), clock[0]


def geometric_range(satellite_m: np.ndarray, receiver_m: np.ndarray) -> tuple[float, np.ndarray]:
    """Range with RTKLIB's first-order Sagnac term [m], and the unit vector from receiver to satellite."""
    arrays = [rtk.Arr1Ddouble(3) for _ in range(3)]
    for array, values in zip(arrays, (satellite_m, receiver_m), strict=False):
        for axis in range(3):
            array[axis] = float(values[axis])
    range_m = rtk.geodist(*arrays)
    return range_m, np.array([arrays[2][axis] for axis in range(3)])
