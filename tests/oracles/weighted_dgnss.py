"""Unsmoothed code DGNSS with RTKLIB's reading, orbits, clocks and ranges, and weights given by the caller.

RTKLIB's own DGNSS solution (:mod:`rtklib_dgnss`) weights satellites by its own elevation law, so it may differ from
another program by noise times the difference of the weights. With the weights given, what remains between two
programs is orbits, clocks, Earth rotation, ranges and the least squares: these must agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyrtklib as rtk

from rtklib_dgnss import plain_copy, select_galileo_message

C_MPS = 299_792_458.0


@dataclass(frozen=True)
class RangeEpoch:
    """Satellites of one receiver at one epoch: L1 code, RTKLIB's satellite position and clock."""

    code_m: dict[str, float]
    position_m: dict[str, np.ndarray]
    clock_s: dict[str, float]


def _sat_name(number: int) -> str:
    text = rtk.Arr1Dchar(8)
    rtk.satno2id(number, text)
    return str(text[0])


def read_ranges(
    observations: Path, navigation: list[Path], folder: Path, *, galileo: str = "inav"
) -> dict[int, RangeEpoch]:
    """Read a receiver's file and evaluate RTKLIB's broadcast orbits for each epoch.

    Returns
    -------
    dict
        By epoch in milliseconds of GPS time.
    """
    select_galileo_message(galileo)
    obs, nav, station = rtk.obs_t(), rtk.nav_t(), rtk.sta_t()
    for path in (observations, *navigation):
        if rtk.readrnx(str(plain_copy(path, folder)), 1, "", obs, nav, station) < 0:
            raise RuntimeError(f"RTKLIB cannot read {path}")
    rtk.sortobs(obs)
    rtk.uniqnav(nav)
    epochs: dict[int, list[int]] = {}
    week = rtk.Arr1Dint(1)
    for k in range(obs.n):
        tow = rtk.time2gpst(obs.data[k].time, week)
        epochs.setdefault(round(week[0] * 604_800_000 + tow * 1000.0), []).append(k)
    return {key: _evaluate(obs, rows, nav) for key, rows in epochs.items()}


def _evaluate(obs: rtk.obs_t, rows: list[int], nav: rtk.nav_t) -> RangeEpoch:
    count = len(rows)
    data = rtk.Arr1Dobsd_t(count)
    for place, row in enumerate(rows):
        data[place] = obs.data[row]
    state, clock = rtk.Arr1Ddouble(6 * count), rtk.Arr1Ddouble(2 * count)
    variance, health = rtk.Arr1Ddouble(count), rtk.Arr1Dint(count)
    rtk.satposs(data[0].time, data.ptr, count, nav, rtk.EPHOPT_BRDC, state, clock, variance, health)
    epoch = RangeEpoch({}, {}, {})
    for place in range(count):
        name, code = _sat_name(data[place].sat), data[place].P[0]
        position = np.array([state[6 * place + axis] for axis in range(3)])
        if code == 0.0 or not position.any() or health[place] != 0:
            continue
        epoch.code_m[name] = code
        epoch.position_m[name] = position
        epoch.clock_s[name] = clock[2 * place]
    return epoch


def _range(satellite_m: np.ndarray, receiver_m: np.ndarray) -> tuple[float, np.ndarray]:
    rs, rr, e = rtk.Arr1Ddouble(3), rtk.Arr1Ddouble(3), rtk.Arr1Ddouble(3)
    for axis in range(3):
        rs[axis], rr[axis] = satellite_m[axis], receiver_m[axis]
    return rtk.geodist(rs, rr, e), np.array([e[axis] for axis in range(3)])


def dgnss_position(
    bases: list[tuple[RangeEpoch, np.ndarray]],
    rover: RangeEpoch,
    sigma_m: dict[str, float],
    approximate_m: np.ndarray,
) -> np.ndarray:
    """Weighted code DGNSS position of one epoch.

    Parameters
    ----------
    bases : list of (RangeEpoch, (3,) array)
        Base stations with their positions; the corrections are averaged.
    sigma_m : dict
        Satellites to use, with the standard deviation that weights each.
    """
    names = sorted(sigma_m)
    correction = {}
    for name in names:
        errors = []
        for base, place in bases:
            expected = _range(base.position_m[name], place)[0] - C_MPS * base.clock_s[name]
            errors.append(base.code_m[name] - expected)
        correction[name] = float(np.mean(errors))
    systems = sorted({name[0] for name in names})
    position = approximate_m.astype(float).copy()
    for _ in range(8):
        rows, residuals = [], []
        for name in names:
            distance, line_of_sight = _range(rover.position_m[name], position)
            clock = [1.0 if name[0] == system else 0.0 for system in systems]
            rows.append(np.concatenate([-line_of_sight, clock]) / sigma_m[name])
            observed = rover.code_m[name] - correction[name] + C_MPS * rover.clock_s[name]
            residuals.append((observed - distance) / sigma_m[name])
        step, *_ = np.linalg.lstsq(np.array(rows), np.array(residuals), rcond=None)
        position = position + step[:3]
        if np.linalg.norm(step[:3]) < 1e-5:
            break
    return position
