"""Observations of an RTCM 3 stream of MSM4 or MSM5 messages, as epochs of one receiver."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import sidereon

from gbas_core.gpstime import epoch_key
from gbas_core.observations import ObservationEpoch
from gbas_core.recording import RecordedEpoch
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS

_M_PER_MS = SPEED_OF_LIGHT_MPS * 1e-3
_BANDS = {"1": L1, "2": L2, "5": L5}
_SIGNALS = ("1C", "1X", "5Q", "5X", "5I", "2W", "2L", "2X")  # the first of a band that is there counts
_ROUGH_INVALID = 255


def recorded_epochs(path: Path, *, gps_week: int) -> Iterator[RecordedEpoch]:
    """Epochs of GPS and Galileo in order; the stream has no week."""
    cells: dict[int, ObservationEpoch] = {}
    for message in sidereon.decode_rtcm_stream(path.read_bytes()).messages:
        if message.msm is None or message.msm.system not in "GE":
            continue
        tow_ms = message.msm.header.epoch_time
        if tow_ms not in cells:
            if cells:
                yield _epoch(*cells.popitem(), gps_week)
            cells[tow_ms] = _empty(gps_week, tow_ms)
        _add(cells[tow_ms], message.msm)
    if cells:
        yield _epoch(*cells.popitem(), gps_week)


def _epoch(tow_ms: int, seen: ObservationEpoch, gps_week: int) -> RecordedEpoch:
    return RecordedEpoch(key=epoch_key(gps_week, tow_ms / 1000.0), ground=(seen,), user=None)


def _empty(gps_week: int, tow_ms: int) -> ObservationEpoch:
    values = {name: np.full((N_BANDS, N_SATS), np.nan) for name in ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz")}
    return ObservationEpoch(
        gps_week=gps_week, tow_s=tow_ms / 1000.0, simulated=0.0, lli=np.zeros((N_BANDS, N_SATS)), **values
    )


def _add(epoch: ObservationEpoch, msm) -> None:
    rough = {
        each.id: each.rough_range_ms + each.rough_range_mod1 / 1024.0
        for each in msm.satellites
        if each.rough_range_ms != _ROUGH_INVALID
    }
    order = sorted(msm.signals, key=lambda cell: _rank(msm.system, cell))
    for cell in reversed(order):
        code = sidereon.rtcm_msm_signal_rinex_code(msm.system, cell.signal_id)
        place = SAT_INDEX.get(f"{msm.system}{cell.satellite_id:02d}")
        if code not in _SIGNALS or place is None or cell.satellite_id not in rough:
            continue
        band, range_ms = _BANDS[code[0]], rough[cell.satellite_id]
        if cell.fine_pseudorange != sidereon.RTCM_MSM4_FINE_PSEUDORANGE_INVALID:
            epoch.code_m[band, place] = (range_ms + cell.fine_pseudorange * 2.0**-24) * _M_PER_MS
        if cell.fine_phase_range != sidereon.RTCM_MSM4_FINE_PHASE_RANGE_INVALID:
            epoch.carrier_m[band, place] = (range_ms + cell.fine_phase_range * 2.0**-29) * _M_PER_MS
        epoch.cn0_dbhz[band, place] = np.nan if cell.cnr is None else cell.cnr


def _rank(system: str, cell) -> int:
    code = sidereon.rtcm_msm_signal_rinex_code(system, cell.signal_id)
    return _SIGNALS.index(code) if code in _SIGNALS else len(_SIGNALS)
