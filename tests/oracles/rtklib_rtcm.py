"""Recorded RTCM 3 streams decoded by RTKLIB (through pyrtklib): a second opinion on observations and ephemerides."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pyrtklib as rtk

from rtklib_orbits import satellite_name

N_FREQUENCIES = 3  # slots of an observation that this build of RTKLIB has
SNR_UNIT_DBHZ = 0.001
OBSERVATIONS_COMPLETE = 1


@dataclass(frozen=True)
class Observed:
    """One signal of one satellite; carrier in cycles."""

    code_m: float
    carrier_cycles: float
    doppler_hz: float
    cn0_dbhz: float
    lli: int


def decode(
    path: Path, week: int, tow_s: float
) -> tuple[dict[tuple[int, str, str], Observed], dict[tuple[str, int], rtk.eph_t]]:
    """Observations by (epoch [ms of GPS time], satellite, tracking code), and ephemerides by satellite and set.

    The set of an ephemeris is 0, or 1 for Galileo's F/NAV. RTKLIB needs a time within half a week of the first epoch.
    Of each band it keeps the one signal it likes best.
    """
    state = rtk.rtcm_t()
    if not rtk.init_rtcm(state):
        raise RuntimeError("RTKLIB cannot start its RTCM decoder")
    state.time = rtk.gpst2time(week, tow_s)
    observed: dict[tuple[int, str, str], Observed] = {}
    for byte in path.read_bytes():
        if rtk.input_rtcm3(state, byte) == OBSERVATIONS_COMPLETE:
            observed |= _epoch(state.obs)
    ephemerides = {}
    for index in range(2 * rtk.MAXSAT):
        eph = state.nav.eph[index]
        name = satellite_name(eph.sat) if eph.sat else None
        if name is not None:
            ephemerides[name, index // rtk.MAXSAT] = eph
    return observed, ephemerides


def _epoch(obs: rtk.obs_t) -> dict[tuple[int, str, str], Observed]:
    found = {}
    week = rtk.Arr1Dint(1)
    for row in range(obs.n):
        data = obs.data[row]
        name = satellite_name(data.sat)
        if name is None:
            continue
        tow_s = rtk.time2gpst(data.time, week)
        key = week[0] * 604_800_000 + round(tow_s * 1000.0)
        for slot in range(N_FREQUENCIES):
            if data.code[slot]:
                found[key, name, rtk.code2obs(data.code[slot])] = Observed(
                    code_m=data.P[slot],
                    carrier_cycles=data.L[slot],
                    doppler_hz=data.D[slot],
                    cn0_dbhz=data.SNR[slot] * SNR_UNIT_DBHZ,
                    lli=data.LLI[slot],
                )
    return found
