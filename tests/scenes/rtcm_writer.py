"""RTCM 3 multiple signal messages written with the library's encoder: made up ones, and those of recorded files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import sidereon

from gbas_core.io.rinex import ObservationFile
from gbas_core.satellites import SAT_IDS
from gbas_core.signals import L1, WAVELENGTH_M

LOCKED = 15
"""Lock time indicator DF402: locked for at least 524 s."""
LOCKED_EXTENDED = 704
"""Lock time indicator DF407, the largest."""
MS_M = Fraction(299_792_458, 1000)
"""Metres of a light millisecond."""


def cell(satellite: int = 5, signal: int = 2, **changes: Any) -> dict[str, Any]:
    """One satellite with one signal, in the integers of the message."""
    values = {"whole": 70, "part": 512, "code": 0, "phase": 0, "lock": LOCKED, "half": False, "cnr": 45}
    return {"satellite": satellite, "signal": signal, "rough_rate": 0, "rate": 0} | values | changes


def msm(
    tow_ms: int, cells: Sequence[dict[str, Any]], *, number: int = 1074, station: int = 7, smoothing: int = 0
) -> bytes:
    """Frame of a multiple signal message; satellites and signals in the order of the message."""
    kind, system = f"msm{number % 10}", {107: "G", 108: "R", 109: "E", 112: "C"}[number // 10]
    rates = kind in ("msm5", "msm7")
    header = sidereon.RtcmMsmHeader(station, tow_ms, False, 0, 0, 0, 0, False, smoothing)
    satellites = {
        each["satellite"]: sidereon.RtcmMsmSatellite(
            each["satellite"], each["whole"], each["part"], 0 if rates else None, each["rough_rate"] if rates else None
        )
        for each in cells
    }
    signals = [
        sidereon.RtcmMsmSignal(
            each["satellite"], each["signal"], each["code"], each["phase"], each["lock"], each["half"], each["cnr"],
            each["rate"] if rates else None,
        )
        for each in cells
    ]  # fmt: skip
    body = sidereon.RtcmMsmMessage(number, system, kind, header, list(satellites.values()), signals)
    return sidereon.RtcmMessage.from_msm(body).to_frame()


def frames_of(source: ObservationFile, rows: Iterable[int]) -> list[bytes]:
    """Frames of the L1 observations of a file as MSM7, GPS and Galileo: what a sender does.

    The carriers lose whole cycles at a satellite's first epoch, so that their fine parts have room.
    """
    there = np.isfinite(source.code_m[:, L1]) & np.isfinite(source.carrier_m[:, L1])
    start = there.argmax(axis=0)
    every = np.arange(len(SAT_IDS))
    apart_m = (source.code_m[:, L1] - source.carrier_m[:, L1])[start, every]
    whole_m = np.where(there.any(axis=0), np.rint(apart_m / WAVELENGTH_M[L1]) * WAVELENGTH_M[L1], 0.0)
    frames = []
    for row in rows:
        for letter, number in (("G", 1077), ("E", 1097)):
            cells = [
                _cell_of(source, row, satellite, whole_m[satellite])
                for satellite in np.flatnonzero(there[row])
                if SAT_IDS[satellite][0] == letter
            ]
            frames.append(msm(round(1000 * source.tow_s[row]), cells, number=number))
    return frames


def _cell_of(source: ObservationFile, row: int, satellite: int, whole_m: float) -> dict[str, Any]:
    place = (row, L1, satellite)
    code_ms = source.code_m[place] / float(MS_M)
    phase_ms = (source.carrier_m[place] + whole_m) / float(MS_M)
    rough = round(code_ms * 1024)
    rate_mps = -source.doppler_hz[place] * WAVELENGTH_M[L1]
    known, cn0_dbhz, lli = math.isfinite(rate_mps), source.cn0_dbhz[place], int(source.lli[place])
    return cell(
        int(SAT_IDS[satellite][1:]),
        whole=rough // 1024,
        part=rough % 1024,
        code=round((code_ms - rough / 1024) * 2**29),
        phase=round((phase_ms - rough / 1024) * 2**31),
        lock=0 if lli & 1 else LOCKED_EXTENDED,
        half=bool(lli & 2),
        cnr=round(cn0_dbhz * 16) if math.isfinite(cn0_dbhz) else 0,
        rough_rate=round(rate_mps) if known else None,
        rate=round((rate_mps - round(rate_mps)) * 1e4) if known else None,
    )
