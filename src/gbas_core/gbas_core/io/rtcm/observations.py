"""Observations of recorded streams."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import sidereon

from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK
from gbas_core.io.files import PathLike
from gbas_core.io.rinex.observations import ObservationFile
from gbas_core.io.rtcm.stream import RtcmError, Stream, read_stream
from gbas_core.io.tracking_codes import (
    CARRIER,
    CN0,
    CODE,
    DEFAULT_SIGNALS,
    DOPPLER,
    LLI,
    QUANTITY_LETTERS,
    FlatValues,
    SignalTable,
    columns_of_signals,
    wanted_codes,
)
from gbas_core.record import FloatArray
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import BAND_INDEX, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

_METRES_PER_MILLISECOND: Final = SPEED_OF_LIGHT_MPS / 1000.0
_FINE_RATE_STEP_MPS: Final = 1e-4
_LOSS_OF_LOCK: Final = sidereon.RTCM_LLI_LOSS_OF_LOCK
_COORDINATES_AGREE_M: Final = 1e-3
# Messages with observations of GPS or Galileo that are not read: without the whole milliseconds, or of the old kind.
_NOT_READ: Final = (*range(1001, 1005), 1071, 1072, 1073, 1091, 1092, 1093)


@dataclass(frozen=True, kw_only=True)
class _Resolution:
    """Scales of one kind of MSM.

    Source: RTCM 10403.3, DF400, DF401 and DF403 (MSM4 and 5); DF405, DF406 and DF408 (MSM6 and 7).
    """

    code_ms: float
    phase_ms: float
    cn0_dbhz: float
    code_invalid: int
    phase_invalid: int


_COARSE: Final = _Resolution(
    code_ms=2.0**-24,
    phase_ms=2.0**-29,
    cn0_dbhz=1.0,
    code_invalid=sidereon.RTCM_MSM4_FINE_PSEUDORANGE_INVALID,
    phase_invalid=sidereon.RTCM_MSM4_FINE_PHASE_RANGE_INVALID,
)
_FINE: Final = _Resolution(
    code_ms=2.0**-29,
    phase_ms=2.0**-31,
    cn0_dbhz=2.0**-4,
    code_invalid=sidereon.RTCM_MSM7_FINE_PSEUDORANGE_INVALID,
    phase_invalid=sidereon.RTCM_MSM7_FINE_PHASE_RANGE_INVALID,
)
_RESOLUTIONS: Final = {"msm4": _COARSE, "msm5": _COARSE, "msm6": _FINE, "msm7": _FINE}


def read_rtcm(
    path: PathLike,
    *,
    gps_week: int | None = None,
    station: int | None = None,
    signals: SignalTable = DEFAULT_SIGNALS,
    simulated: bool = False,
) -> ObservationFile:
    """Read the observations of a recorded RTCM 3 stream.

    Parameters
    ----------
    path : str or Path
        RTCM 3 stream with MSM4, 5, 6 or 7; plain or gzip.
    gps_week : int or None
        GPS week of the first epoch; None takes it from the ephemerides of the stream. A date has its week from
        :func:`gbas_core.gnss.gpstime.gps_from_calendar`.
    station : int or None
        Reference station to take; needed only when there are several.
    signals, simulated
        As of :func:`gbas_core.io.rinex.read_observations`.

    Returns
    -------
    ObservationFile
        Its position is that of the antenna reference point (message 1005 or 1006), so that the antenna delta is zero.

    Raises
    ------
    RtcmError
        For a stream without such messages, of several stations when none is named, or of an unknown week.
    ValueError
        For an unknown system or band in `signals`.

    Notes
    -----
    A range is the satellite's rough range and the signal's fine one; one that is marked as invalid is missing, and so
    is everything a damaged frame held. Messages of the same epoch belong together; one of an earlier epoch than the
    last is left out. Bit 0 of `lli` is set where the lock time does not cover all the time since the signal was last
    seen, and where a half-cycle ambiguity has ended; a loss of lock in an epoch without a valid carrier is told at the
    next one with. Bit 1 is the half-cycle ambiguity indicator.
    """
    bands = wanted_codes(signals)
    stream = read_stream(path, gps_week=gps_week)
    chosen_station = _station(stream, station)
    notes = list(stream.notes)
    cells = _Cells(bands=bands)
    cells.collect(stream, chosen_station, notes)
    if not cells.keys:
        raise RtcmError(stream.path, "has no MSM4, 5, 6 or 7 of GPS or Galileo; expected at least one")
    chosen, arrays = columns_of_signals(cells.flat_values(), len(cells.keys), signals)
    keys = np.array(cells.keys, dtype=np.int64)
    week, milliseconds = np.divmod(keys, MILLISECONDS_PER_WEEK)
    tow_s = milliseconds / 1000.0
    for array in (*arrays, week, tow_s):
        array.flags.writeable = False
    position_m = _position_m(stream, chosen_station, notes)
    return ObservationFile(
        path=stream.path,
        marker=f"RTCM {chosen_station:04d}",
        approx_position_m=position_m,
        antenna_delta_hen_m=None if position_m is None else np.zeros(3),
        interval_s=float(np.median(np.diff(keys))) / 1000.0 if len(keys) > 1 else None,
        gps_week=week,
        tow_s=tow_s,
        code_m=arrays[CODE],
        carrier_m=arrays[CARRIER],
        doppler_hz=arrays[DOPPLER],
        cn0_dbhz=arrays[CN0],
        lli=arrays[LLI],
        signals=chosen,
        simulated=simulated,
        notes=tuple(notes),
    )


def _station(stream: Stream, station: int | None) -> int:
    found = sorted({msm.header.reference_station_id for _, msm in stream.observed()})
    names = ", ".join(map(str, found))
    if station is None and len(found) > 1:
        raise RtcmError(stream.path, f"has observations of stations {names}; say which to take")
    if station is not None and station not in found:
        raise RtcmError(stream.path, f"has no observations of station {station}; there are those of {names}")
    return found[0] if station is None else station


def _position_m(stream: Stream, station: int, notes: list[str]) -> FloatArray | None:
    """Antenna reference point as first told; None if it never is, or is the centre of the earth."""
    told = [message.station_coordinates for message in stream.messages if message.station_coordinates is not None]
    places = np.array([(each.x_m, each.y_m, each.z_m) for each in told if each.reference_station_id == station])
    if not places.size or not places[0].any():
        return None
    moved_m = float(np.abs(places - places[0]).max())
    if moved_m > _COORDINATES_AGREE_M:
        notes.append(f"the station's coordinates change by up to {moved_m:.3f} m; the first ones were taken")
    return np.asarray(places[0])


@dataclass(kw_only=True)
class _Cells:
    """The wanted cells (satellite and signal of an epoch) of a stream, gathered message by message.

    `rows` has one tuple a cell: epoch, satellite, place of its code observation in the list of codes, code [ms], phase
    [ms], rate [m/s], C/N0 [dB-Hz], and LLI.
    """

    bands: dict[tuple[str, str], str]
    keys: list[int] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    _tracker: Any = field(default_factory=sidereon.RtcmLockTimeTracker)
    _seen: set[tuple[str, int, int]] = field(default_factory=set)  # cells of the current epoch
    _owed: set[tuple[str, int, int]] = field(default_factory=set)  # cells that lost lock and had no carrier since
    _half: set[tuple[str, int, int]] = field(default_factory=set)  # cells with a half-cycle ambiguity
    _repeated: int = 0

    def collect(self, stream: Stream, station: int, notes: list[str]) -> None:
        """Gather the cells of a station."""
        late, smoothed = 0, 0
        for key, msm in stream.observed():
            if msm.header.reference_station_id != station or msm.kind not in _RESOLUTIONS:
                continue
            if self.keys and key < self.keys[-1]:
                late += 1
                continue
            if not self.keys or key > self.keys[-1]:
                self.keys.append(key)
                self._seen.clear()
            smoothed += msm.header.smoothing_interval > 0
            self._add(msm)
        if late:
            notes.append(f"{late} messages are of an epoch before the latest and were left out")
        if self._repeated:
            notes.append(f"{self._repeated} observations are in their epoch twice; the first was taken")
        if smoothed:
            notes.append(f"{smoothed} messages have codes that the receiver smoothed")
        unread = Counter(message.message_number for message in stream.messages if message.message_number in _NOT_READ)
        if unread:
            named = ", ".join(f"{count} of {number}" for number, count in sorted(unread.items()))
            notes.append(f"observations in other messages than MSM4 to MSM7 are not read: {named}")

    def _add(self, msm: Any) -> None:
        resolution = _RESOLUTIONS[msm.kind]
        places = {code: place for place, code in enumerate(self.bands)}
        satellites = {each.id: _rough(each) for each in msm.satellites}
        for signal, lock in zip(msm.signals, self._tracker.observe(msm), strict=True):
            rough_ms, rough_mps = satellites[signal.satellite_id]
            phase_ms = _sum(rough_ms, signal.fine_phase_range, resolution.phase_invalid, resolution.phase_ms)
            cell = (msm.system, signal.satellite_id, signal.signal_id)
            lli = self._lli(cell, lock.lli, bool(signal.half_cycle_ambiguity), has_carrier=math.isfinite(phase_ms))
            tracking = sidereon.rtcm_msm_signal_rinex_code(msm.system, signal.signal_id)
            place = places.get((msm.system, f"C{tracking}"))
            satellite = SAT_INDEX.get(f"{msm.system}{signal.satellite_id:02d}")
            if lli is None or place is None or satellite is None:
                continue
            code_ms = _sum(rough_ms, signal.fine_pseudorange, resolution.code_invalid, resolution.code_ms)
            rate_mps = _sum(rough_mps, signal.fine_phase_range_rate, None, _FINE_RATE_STEP_MPS)
            cn0_dbhz = signal.cnr * resolution.cn0_dbhz if signal.cnr else np.nan
            self.rows.append((len(self.keys) - 1, satellite, place, code_ms, phase_ms, rate_mps, cn0_dbhz, lli))

    def _lli(self, cell: tuple[str, int, int], lli: int, half: bool, *, has_carrier: bool) -> int | None:
        """Loss-of-lock indicator of a cell; None if the epoch has the cell already."""
        if cell in self._half and not half:
            lli |= _LOSS_OF_LOCK
        (self._half.add if half else self._half.discard)(cell)
        repeated = cell in self._seen
        self._seen.add(cell)
        if cell in self._owed:
            lli |= _LOSS_OF_LOCK
        lost = bool(lli & _LOSS_OF_LOCK)
        (self._owed.add if lost and (repeated or not has_carrier) else self._owed.discard)(cell)
        self._repeated += repeated
        return None if repeated else lli

    def flat_values(self) -> FlatValues:
        """One row an observation, as the choice of signals wants them."""
        codes = list(self.bands)
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 8)
        epoch, satellite, place = table[:, :3].astype(np.int64).T
        wavelength_m = np.array([WAVELENGTH_M[BAND_INDEX[band]] for band in self.bands.values()])[place]
        code_ms, phase_ms, rate_mps, cn0_dbhz = table[:, 3:7].T
        quantities = {
            "C": code_ms * _METRES_PER_MILLISECOND,
            "L": phase_ms * _METRES_PER_MILLISECOND,
            "D": -rate_mps / wavelength_m,
            "S": cn0_dbhz,
        }
        value = np.concatenate([quantities[letter] for letter in QUANTITY_LETTERS])
        code = np.concatenate([self._places_of(letter)[place] for letter in QUANTITY_LETTERS])
        keep = np.isfinite(value)
        repeats = len(QUANTITY_LETTERS)
        return FlatValues(
            codes=codes,
            epoch=np.tile(epoch, repeats)[keep],
            satellite=np.tile(satellite, repeats)[keep],
            code=code[keep],
            value=value[keep],
            lli=np.tile(table[:, 7], repeats)[keep],
        )

    def _places_of(self, letter: str) -> Any:
        """Place of each code's tracking for another quantity."""
        places = {code: place for place, code in enumerate(self.bands)}
        return np.array([places[system, letter + name[1:]] for system, name in self.bands])


def _rough(satellite: Any) -> tuple[float, float]:
    """Rough range [ms] and rough rate [m/s] of a satellite; NaN if invalid or not in the message.

    The parser gives ranges as they were sent, with the values that mark them as invalid, and such rates as None.
    """
    whole, rate = satellite.rough_range_ms, satellite.rough_phase_range_rate_m_s
    invalid = whole is None or whole == sidereon.RTCM_MSM_ROUGH_RANGE_INVALID
    range_ms = np.nan if invalid else whole + satellite.rough_range_mod1 / 1024.0
    return range_ms, np.nan if rate is None else float(rate)


def _sum(rough: float, fine: int | None, invalid: int | None, step: float) -> float:
    """Rough and fine part together (of ranges exactly: they are multiples of 2^-31 ms); NaN if one is invalid."""
    return np.nan if fine is None or fine == invalid else rough + fine * step
