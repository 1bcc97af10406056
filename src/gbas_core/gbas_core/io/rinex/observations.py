"""Observation files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import sidereon

from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK, calendar_text, epoch_key, from_epoch_key, gps_from_calendar
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.files import PathLike
from gbas_core.io.rinex.lines import EPOCH_LINE_2, stray_lines
from gbas_core.io.rinex.site_changes import site_changes
from gbas_core.io.rinex.text import SIMULATED_LABEL, RinexError, checked_version, parser_problem, read_text
from gbas_core.io.tracking_codes import (
    CARRIER,
    CN0,
    CODE,
    DEFAULT_SIGNALS,
    DOPPLER,
    LLI,
    FlatValues,
    SignalChoice,
    SignalTable,
    columns_of_signals,
    wanted_codes,
)
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import BAND_INDEX, WAVELENGTH_M

_SYSTEMS: Final[dict[str, Any]] = {"G": sidereon.GnssSystem.GPS, "E": sidereon.GnssSystem.GALILEO}

_GPS_SCALES: Final = ("GPST", "GST")  # Galileo time equals GPS time within tens of nanoseconds
_TAG_TOLERANCE_S: Final = 1e-6
_INTERVAL_TOLERANCE_S: Final = 0.001
_OBSERVED_FLAGS: Final = (0, 1)
_POWER_FAILURE_FLAG: Final = 1
_CYCLE_SLIP_FLAG: Final = 6
_EPOCH_LINE_3: Final = re.compile(r"^>", re.MULTILINE)
_CRINEX_LABEL: Final = "CRINEX VERS   / TYPE"
_MAX_CRINEX_LINES_PER_EPOCH: Final = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservationFile:
    """All observations of one file. Arrays are not writable; E epochs, strictly increasing.

    Attributes
    ----------
    path : Path
    marker : str
        Marker name, or the file's name where the header has none.
    approx_position_m : (3,) array or None
        Header's approximate position of the marker, ECEF [m].
    antenna_delta_hen_m : (3,) array or None
        Antenna reference point above the marker: height, east, north [m].
    interval_s : float or None
        Median spacing of the epochs; of a single epoch what the header says, or None [s].
    gps_week : (E,) int array
    tow_s : (E,) array
        Receiver's time tags in GPS time, rounded to the millisecond [s].
    code_m, carrier_m, doppler_hz, cn0_dbhz, lli : (E, N_BANDS, N_SATS) arrays
        As in :class:`~gbas_core.gnss.observations.ObservationEpoch`.
    signals : mapping from (system, band) to SignalChoice
        What the columns hold.
    simulated : bool
    notes : tuple of str
        What was left out or repaired.
    site_changes : tuple of int
        Epochs before which the file tells of another site or antenna.
    """

    path: Path
    marker: str
    approx_position_m: FloatArray | None
    antenna_delta_hen_m: FloatArray | None
    interval_s: float | None
    gps_week: IntArray
    tow_s: FloatArray
    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    cn0_dbhz: FloatArray
    lli: FloatArray
    signals: Mapping[tuple[str, str], SignalChoice]
    simulated: bool
    notes: tuple[str, ...]
    site_changes: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.tow_s)

    @property
    def first(self) -> tuple[int, float]:
        """GPS week and time of week [s] of the first epoch."""
        return int(self.gps_week[0]), float(self.tow_s[0])

    @property
    def last(self) -> tuple[int, float]:
        """GPS week and time of week [s] of the last epoch."""
        return int(self.gps_week[-1]), float(self.tow_s[-1])

    @property
    def keys(self) -> IntArray:
        """Epoch keys ``(E,)``, see :func:`gbas_core.gnss.gpstime.epoch_key`."""
        return self.gps_week * MILLISECONDS_PER_WEEK + np.rint(self.tow_s * 1000.0).astype(np.int64)

    def describe(self) -> str:
        """One line: the file, the receiver and the time it covers."""
        return f"observations {self.path} ({self.marker}) cover {_text(self.first)} to {_text(self.last)}"

    def restarted_at_site_changes(self) -> ObservationFile:
        """The same with lock lost on every channel's first carrier after a change of site or antenna."""
        if not self.site_changes:
            return self
        lli, there = self.lli.copy(), np.isfinite(self.carrier_m)
        for row in self.site_changes:
            first = row + there[row:].argmax(axis=0)
            places = (first, *np.indices(first.shape))
            lli[places] = _with_bit_0(lli[places], self.carrier_m[places])
        lli.flags.writeable = False
        return replace(self, lli=lli)

    def epoch(self, index: int) -> ObservationEpoch:
        """The observations of one epoch."""
        return ObservationEpoch(
            gps_week=int(self.gps_week[index]),
            tow_s=float(self.tow_s[index]),
            simulated=float(self.simulated),
            code_m=self.code_m[index],
            carrier_m=self.carrier_m[index],
            doppler_hz=self.doppler_hz[index],
            cn0_dbhz=self.cn0_dbhz[index],
            lli=self.lli[index],
        )


def read_observations(
    path: PathLike, *, signals: SignalTable = DEFAULT_SIGNALS, simulated: bool = False
) -> ObservationFile:
    """Read an observation file.

    Parameters
    ----------
    path : str or Path
        RINEX 2, 3 or 4 or CRINEX; plain or gzip.
    signals : mapping from (system, band) to tracking codes
        Preference per system ("G", "E") and band, see :data:`DEFAULT_SIGNALS`. For the whole file one tracking code is
        taken per system and band: the first that has code and carrier, and at least half as many observations as the
        best of the listed ones. If none has both, code and carrier come from the first that has each.
    simulated : bool
        Marks the observations as made by a simulator, as files do whose header says so.

    Returns
    -------
    ObservationFile

    Raises
    ------
    RinexError
        For anything but a RINEX observation file in GPS or Galileo time with at least one epoch.
    ValueError
        For an unknown system or band in `signals`.

    Notes
    -----
    Events that change the site or the antenna (flags 2 to 4) are noted, see `site_changes`; lines between the epochs
    that are no records are counted in a note. A power failure (flag 1) and cycle slip records (flag 6) set bit 0 of
    `lli` on all channels concerned. Zero means missing, as RINEX says. C/N0 is NaN where the file does not say that
    its signal strengths are in dB-Hz (RINEX 2 without SIGNAL STRENGTH UNIT: the unit is the receiver's own).
    An incomplete last epoch is left out.
    """
    path = Path(path)
    notes: list[str] = []
    version, parsed = _parsed(path, notes)
    header = parsed.header
    _check_time_scale(path, header)
    epochs = _Epochs.of(path, parsed.epochs, notes)
    chosen, arrays = columns_of_signals(_flat_values(parsed, epochs, signals), len(epochs.keys), signals)
    _set_loss_of_lock(arrays[LLI], arrays[CARRIER], epochs)
    if header.signal_strength_unit != "DBHZ" and version < 3.0 and np.isfinite(arrays[CN0]).any():
        notes.append("signal strengths are in the receiver's own unit (no SIGNAL STRENGTH UNIT DBHZ) and left out")
        arrays[CN0][:] = np.nan
    changes = _site_changes(header, parsed.epochs, epochs, notes)
    _note_early_end(path, header, epochs.keys, notes)
    week, milliseconds = np.divmod(epochs.keys, MILLISECONDS_PER_WEEK)
    tow_s = milliseconds / 1000.0
    for array in (*arrays, week, tow_s):
        array.flags.writeable = False
    approx_position_m = _vector(header.approx_position_m)
    return ObservationFile(
        path=path,
        marker=header.marker_name or path.name,
        approx_position_m=approx_position_m if approx_position_m is not None and approx_position_m.any() else None,
        antenna_delta_hen_m=_vector(header.antenna_delta_hen_m),
        interval_s=_interval_s(header, epochs.keys, notes),
        gps_week=week,
        tow_s=tow_s,
        code_m=arrays[CODE],
        carrier_m=arrays[CARRIER],
        doppler_hz=arrays[DOPPLER],
        cn0_dbhz=arrays[CN0],
        lli=arrays[LLI],
        signals=chosen,
        simulated=simulated or any(comment.startswith(SIMULATED_LABEL) for comment in header.comments),
        notes=tuple(notes),
        site_changes=changes,
    )


def _parsed(path: Path, notes: list[str]) -> tuple[float, Any]:
    """RINEX version and the parser's file; without the last epoch if that is what stops the parser."""
    text = read_text(path, notes)
    if text[60:80].rstrip() == _CRINEX_LABEL:
        text = _decoded_crinex(path, text, notes)
    version = checked_version(path, text, "O", "a RINEX observation file")
    try:
        parsed = sidereon.parse_rinex_obs(text)
    except sidereon.ParseError as error:
        starts = [match.start() for match in (EPOCH_LINE_2 if version < 3.0 else _EPOCH_LINE_3).finditer(text)]
        try:
            parsed = sidereon.parse_rinex_obs(text[: starts[-1] if starts else 0])
        except sidereon.ParseError:
            raise RinexError(path, parser_problem(text, error)) from error
        notes.append(f"the last epoch is incomplete and was left out ({parser_problem(text, error)})")
    if stray := stray_lines(text, version):
        notes.append(f"{stray} lines between the epochs are no records and were left out")
    if parsed.skipped_records:
        notes.append(f"{parsed.skipped_records} records were not understood and left out")
    return version, parsed


def _decoded_crinex(path: Path, text: str, notes: list[str]) -> str:
    """RINEX text of a CRINEX file; a cut one is decoded up to its last whole epoch."""
    try:
        return sidereon.decode_crinex(text)
    except sidereon.ParseError as error:
        first_error = error
    lines = text.splitlines(keepends=True)
    for dropped in range(1, min(_MAX_CRINEX_LINES_PER_EPOCH, len(lines))):
        try:
            decoded = sidereon.decode_crinex("".join(lines[:-dropped]))
        except sidereon.ParseError:
            continue
        notes.append("the last epoch is incomplete and was left out")
        return decoded
    raise RinexError(path, parser_problem(text, first_error)) from first_error


def _check_time_scale(path: Path, header: Any) -> None:
    first = header.time_of_first_obs
    if first is None:
        raise RinexError(path, "the header has no TIME OF FIRST OBS; expected one, since it names the time scale")
    scale = first[1].abbrev
    if scale not in _GPS_SCALES:
        raise RinexError(path, f"TIME OF FIRST OBS: time scale {scale}; expected GPS or Galileo time")


def _seconds(path: Path, calendar: Any) -> tuple[int, float]:
    t = calendar
    try:
        return gps_from_calendar(t.year, t.month, t.day, t.hour, t.minute, t.second)
    except ValueError as error:
        raise RinexError(path, f"epoch {calendar}: {error}") from error


def _text(time: tuple[int, float]) -> str:
    return calendar_text(*time)


@dataclass(frozen=True, kw_only=True)
class _Epochs:
    """The observation epochs of a file: where the parser has them, their keys, and where lock was lost."""

    indices: list[int]
    keys: IntArray
    power_failures: list[int]
    slips: list[tuple[int, int]]  # (epoch, satellite)

    @staticmethod
    def of(path: Path, parsed_epochs: Sequence[Any], notes: list[str]) -> _Epochs:
        indices: list[int] = []
        keys: list[int] = []
        power: list[int] = []
        slips: list[tuple[int, str]] = []  # (key, satellite)
        largest_rounding_s, unordered = 0.0, 0
        for index, item in enumerate(parsed_epochs):
            if item.epoch is None:
                continue
            week, tow_s = _seconds(path, item.epoch)
            key = epoch_key(week, tow_s)
            if item.flag == _CYCLE_SLIP_FLAG:
                slips += [(key, satellite) for satellite in item.cycle_slip_satellites]
            if item.flag not in _OBSERVED_FLAGS:
                continue
            if keys and key <= keys[-1]:
                unordered += 1
                continue
            largest_rounding_s = max(largest_rounding_s, abs(tow_s - from_epoch_key(key)[1]))
            if item.flag == _POWER_FAILURE_FLAG:
                power.append(len(keys))
            indices.append(index)
            keys.append(key)
        if not keys:
            raise RinexError(path, "has no observation epoch; expected at least one")
        if unordered:
            notes.append(f"{unordered} epochs are not later than the one before and were left out")
        if largest_rounding_s > _TAG_TOLERANCE_S:
            notes.append(f"time tags were rounded to the millisecond, by up to {1e6 * largest_rounding_s:.0f} us")
        return _Epochs(
            indices=indices,
            keys=np.array(keys, dtype=np.int64),
            power_failures=power,
            slips=[
                (int(np.searchsorted(keys, key)), SAT_INDEX[satellite])
                for key, satellite in slips
                if satellite in SAT_INDEX and key <= keys[-1]
            ],
        )


def _flat_values(parsed: Any, epochs: _Epochs, signals: SignalTable) -> FlatValues:
    bands = wanted_codes(signals)
    codes = list(bands)
    unit = np.array([WAVELENGTH_M[BAND_INDEX[band]] if code[0] == "L" else 1.0 for (_, code), band in bands.items()])
    place = {key: index for index, key in enumerate(codes)}
    wanted = {letter: [code for system, code in codes if system == letter] for letter in _SYSTEMS}
    allowed = sidereon.ObservationFilter([(_SYSTEMS[letter], names) for letter, names in wanted.items() if names])
    columns: list[tuple[Any, ...]] = []
    for row, index in enumerate(epochs.indices):
        series = parsed.observation_values(index, allowed)
        names = series.satellites
        satellite = np.array([SAT_INDEX.get(name, -1) for name in names], dtype=np.int16)
        keys = [place.get((name[0], code), -1) for name, code in zip(names, series.codes, strict=True)]
        columns.append((np.full(len(names), row), satellite, np.array(keys, dtype=np.int16), series.values, series.lli))
    epoch, satellites, code, value, lli = (np.concatenate(column) for column in zip(*columns, strict=True))
    keep = (satellites >= 0) & (code >= 0) & np.isfinite(value) & (value != 0.0)
    code, value = code[keep], value[keep]
    return FlatValues(
        codes=codes, epoch=epoch[keep], satellite=satellites[keep], code=code, value=value * unit[code], lli=lli[keep]
    )


def _site_changes(header: Any, parsed_epochs: Sequence[Any], epochs: _Epochs, notes: list[str]) -> tuple[int, ...]:
    """Rows before which the site or antenna changes; each change is noted."""
    rows = []
    for change in site_changes(header, parsed_epochs):
        row = int(np.searchsorted(epochs.indices, change.after))
        if row < len(epochs.indices):
            notes.append(f"before {_text(from_epoch_key(int(epochs.keys[row])))} the file tells of: {change.what}")
            rows.append(row)
    return tuple(rows)


def _set_loss_of_lock(lli: FloatArray, carrier_m: FloatArray, epochs: _Epochs) -> None:
    for row in epochs.power_failures:
        lli[row] = _with_bit_0(lli[row], carrier_m[row])
    for row, satellite in epochs.slips:
        lli[row, :, satellite] = _with_bit_0(lli[row, :, satellite], carrier_m[row, :, satellite])


def _with_bit_0(lli: FloatArray, carrier_m: FloatArray) -> FloatArray:
    set_bit = (np.nan_to_num(lli).astype(np.int64) | 1).astype(np.float64)
    return np.where(np.isfinite(carrier_m), set_bit, lli)


def _note_early_end(path: Path, header: Any, keys: IntArray, notes: list[str]) -> None:
    """Tell of a file that was cut between two epochs: its header says when it should end."""
    if header.time_of_last_obs is None:
        return
    stated, last = epoch_key(*_seconds(path, header.time_of_last_obs[0])), int(keys[-1])
    if stated > last:
        notes.append(f"ends at {_text(from_epoch_key(last))}, its header says {_text(from_epoch_key(stated))}")


def _vector(value: Any) -> FloatArray | None:
    return None if value is None else np.asarray(value, dtype=np.float64)


def _interval_s(header: Any, keys: IntArray, notes: list[str]) -> float | None:
    if len(keys) < 2:
        return header.interval_s or None
    spacing_s = float(np.median(np.diff(keys))) / 1000.0
    if header.interval_s and abs(header.interval_s - spacing_s) > _INTERVAL_TOLERANCE_S:
        notes.append(f"epochs are {spacing_s:g} s apart, though the header says {header.interval_s:g} s")
    return spacing_s
