"""RINEX observation and navigation files as arrays on the satellite axis.

The only module of the suite that reads GNSS files, and the only one that knows the parser (sidereon). It reads RINEX
2, 3 and 4, plain or gzip, observations also in compact form (CRINEX). Whatever cannot be understood is refused with a
:class:`RinexError` that names the file; whatever is left out of the result is said in `notes`.

Source: RINEX 2.11, 3.05 and 4.02 (IGS/RTCM).
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import sidereon
from numpy.typing import NDArray

from gbas_core.ephemeris import FIELDS, VALIDITY_S, Ephemeris, NavigationMessage
from gbas_core.gpstime import (
    MILLISECONDS_PER_WEEK,
    SECONDS_PER_WEEK,
    calendar_text,
    epoch_key,
    from_epoch_key,
    gps_from_calendar,
)
from gbas_core.observations import ObservationEpoch
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS, SAT_INDEX
from gbas_core.signals import BAND_INDEX, BANDS, N_BANDS, WAVELENGTH_M

IntArray = NDArray[np.int64]
PathLike = str | Path
SignalTable = Mapping[tuple[str, str], Sequence[str]]

DEFAULT_SIGNALS: Final[SignalTable] = {
    ("G", "L1"): ("1C", "1W", "1P"),
    ("G", "L2"): ("2W", "2L", "2S", "2X", "2C", "2P"),
    ("G", "L5"): ("5Q", "5I", "5X"),
    ("E", "L1"): ("1C", "1B", "1X"),
    ("E", "L5"): ("5Q", "5I", "5X"),
}
"""Tracking codes (RINEX 3 band and attribute) by system and band, the preferred first."""

SETTLED_BEFORE_FIRST_EPOCH_S: Final = 120.0
"""How long before the first epoch a receiver counts as having received what was valid then."""
MAX_TRANSMISSION_OFFSET_S: Final = 4 * 3600.0
"""A transmission time further from toe than this is not believed."""
GPS_EARLIEST_TRANSMISSION_S: Final = 2 * 3600.0
"""How long before toe a GPS ephemeris is first sent (IS-GPS-200N 20.3.4.4: toe is the middle of 4 h)."""

_QUANTITIES: Final = {"C": 0, "L": 1, "D": 2, "S": 3}
_GPS_SCALES: Final = ("GPST", "GST")
_TAG_TOLERANCE_S: Final = 1e-6
# Epoch lines: RINEX 2.11 table A2 (1X,I2.2,4(1X,I2),F11.7,2X,I1,I3); RINEX 3 and 4 begin theirs with ">".
_EPOCH_LINE_2: Final = re.compile(r"^ [ \d]\d [ \d]\d [ \d]\d [ \d]\d [ \d]\d [ \d]\d\.\d{7}  \d[ \d]{3}", re.MULTILINE)
_EPOCH_LINE_3: Final = re.compile(r"^>", re.MULTILINE)
_QUOTED_LINE: Final = re.compile(r' in "(.*)', re.DOTALL)
_MAX_CRINEX_LINES_PER_EPOCH: Final = 200
_SCALED_IODC: Final = 2048  # some old archives hold the IODC shifted by 11 bits

_MESSAGES: Final = {
    "gps_lnav": NavigationMessage.GPS_LNAV,
    "galileo_inav": NavigationMessage.GALILEO_INAV,
    "galileo_fnav": NavigationMessage.GALILEO_FNAV,
}


class RinexError(ValueError):
    """A RINEX file that cannot be used; the text names the file, the place, what is there and what was expected."""

    def __init__(self, path: PathLike, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = Path(path)
        self.problem = problem


@dataclass(frozen=True, kw_only=True)
class SignalChoice:
    """The observation codes taken for one system and band; None where the file has none."""

    code: str | None
    carrier: str | None
    doppler: str | None
    cn0: str | None


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
        Header's interval, else the median spacing of the epochs, else (a single epoch) None [s].
    gps_week : (E,) int array
    tow_s : (E,) array
        Receiver's time tags in GPS time, rounded to the millisecond [s].
    code_m, carrier_m, doppler_hz, cn0_dbhz, lli : (E, N_BANDS, N_SATS) arrays
        As in :class:`~gbas_core.observations.ObservationEpoch`.
    signals : mapping from (system, band) to SignalChoice
        What the columns hold.
    simulated : bool
    notes : tuple of str
        What was left out or repaired.
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
        """Epoch keys ``(E,)``, see :func:`gbas_core.gpstime.epoch_key`."""
        return self.gps_week * MILLISECONDS_PER_WEEK + np.rint(self.tow_s * 1000.0).astype(np.int64)

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


# ---------------------------------------------------------------------------------------------------------------------
# Text of a file


def _decompressed(path: Path, data: bytes, notes: list[str]) -> bytes:
    if data[:2] == b"\x1f\x9d":
        raise RinexError(path, "compressed with Unix compress (.Z); expected plain text or gzip")
    text = bytearray()
    while data[:2] == b"\x1f\x8b":
        inflater = zlib.decompressobj(wbits=31)
        try:
            text += inflater.decompress(data) + inflater.flush()
        except zlib.error as error:
            raise RinexError(path, f"damaged gzip data ({error}) after {len(text)} characters") from error
        if not inflater.eof:
            notes.append("the gzip data end early: the file was cut off")
        data = inflater.unused_data
    return bytes(text) if text else data


def _read_text(path: Path, notes: list[str]) -> str:
    """Text of a file, one character a byte (RINEX is ASCII), whole lines only."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RinexError(path, f"cannot be read: {error.strerror}") from error
    data = _decompressed(path, data, notes)
    if not data.strip():
        raise RinexError(path, "is empty; expected a RINEX file")
    text = re.sub(rb"[^\x00-\x7f]", b"?", data).decode("ascii").replace("\r\n", "\n")
    if not text.endswith("\n"):
        notes.append("the last line is not ended: it was taken for cut off and left out")
        text = text[: text.rfind("\n") + 1]
    return text


def _checked_header(path: Path, text: str, letters: str, expected: str) -> float:
    """RINEX version of the first line, after checking that the file is of the expected type."""
    line = text.split("\n", 1)[0]
    if line[60:80].rstrip() != "RINEX VERSION / TYPE":
        raise RinexError(path, f"line 1: {line[:80]!r} is no RINEX header; expected {expected}")
    try:
        version = float(line[:20])
    except ValueError:
        raise RinexError(path, f"line 1: version {line[:20].strip()!r}; expected a number from 2 to 4.99") from None
    if not 2.0 <= version < 5.0:
        raise RinexError(path, f"line 1: version {version:g}; expected 2, 3 or 4")
    letter = line[20:21].upper()
    if letter not in letters:
        raise RinexError(path, f"line 1: file type {line[20:40].strip()!r}; expected {expected}")
    return version


def _parser_problem(text: str, error: Exception) -> str:
    """What the parser said, with the number of the line it quotes."""
    message = str(error).removeprefix("parse error: ")
    quoted = _QUOTED_LINE.search(message)
    line = quoted.group(1).rstrip('"').split("\n")[0] if quoted else ""
    at = text.find("\n" + line) if line.strip() else -1
    return message if at < 0 else f"line {text.count(chr(10), 0, at) + 2}: {message}"


# ---------------------------------------------------------------------------------------------------------------------
# Observations


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
        taken per system and band: the first that has code and carrier and at least half as many observations as the
        best of the listed ones. If none has both, code and carrier come from the first that has each.
    simulated : bool
        Marks the observations as made by a simulator.

    Returns
    -------
    ObservationFile

    Raises
    ------
    RinexError
        For anything but a RINEX observation file in GPS or Galileo time with at least one epoch.

    Notes
    -----
    Event records (flags 2 to 5) are skipped. A power failure (flag 1) and cycle slip records (flag 6) set bit 0 of
    `lli` on all channels concerned. Zero means missing, as RINEX says. C/N0 is NaN where the file does not say that
    its signal strengths are in dB-Hz (RINEX 2 without SIGNAL STRENGTH UNIT: the unit is the receiver's own).
    An incomplete last epoch is left out.
    """
    path = Path(path)
    notes: list[str] = []
    text = _read_text(path, notes)
    if text[60:80].rstrip() == "CRINEX VERS   / TYPE":
        text = _decoded_crinex(path, text, notes)
    version = _checked_header(path, text, "O", "a RINEX observation file")
    parsed = _parsed_observations(path, text, version, notes)
    header = parsed.header
    _check_time_scale(path, header)
    if parsed.skipped_records:
        notes.append(f"{parsed.skipped_records} records were not understood and left out")

    epochs = _Epochs.of(path, parsed.epochs, notes)
    flat = _flat_values(parsed, epochs, signals)
    chosen, arrays = _dense(flat, len(epochs.keys), signals)
    _set_loss_of_lock(arrays[4], arrays[1], epochs)
    if header.signal_strength_unit != "DBHZ" and version < 3.0 and np.isfinite(arrays[3]).any():
        notes.append("signal strengths are in the receiver's own unit (no SIGNAL STRENGTH UNIT DBHZ) and left out")
        arrays[3][:] = np.nan
    _note_early_end(header, epochs.keys, notes)
    week, milliseconds = np.divmod(epochs.keys, MILLISECONDS_PER_WEEK)
    tow_s = milliseconds / 1000.0
    for array in (*arrays, week, tow_s):
        array.flags.writeable = False
    return ObservationFile(
        path=path,
        marker=header.marker_name or path.name,
        approx_position_m=_nonzero(header.approx_position_m),
        antenna_delta_hen_m=_vector(header.antenna_delta_hen_m),
        interval_s=header.interval_s or _median_spacing_s(epochs.keys),
        gps_week=week,
        tow_s=tow_s,
        code_m=arrays[0],
        carrier_m=arrays[1],
        doppler_hz=arrays[2],
        cn0_dbhz=arrays[3],
        lli=arrays[4],
        signals=chosen,
        simulated=simulated,
        notes=tuple(notes),
    )


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
    raise RinexError(path, f"CRINEX: {_parser_problem(text, first_error)}") from first_error


def _parsed_observations(path: Path, text: str, version: float, notes: list[str]) -> Any:
    try:
        return sidereon.parse_rinex_obs(text)
    except sidereon.ParseError as error:
        first_error = error
    starts = [match.start() for match in (_EPOCH_LINE_2 if version < 3.0 else _EPOCH_LINE_3).finditer(text)]
    if len(starts) > 1:  # perhaps only the last epoch is incomplete
        try:
            parsed = sidereon.parse_rinex_obs(text[: starts[-1]])
        except sidereon.ParseError:
            pass
        else:
            notes.append("the last epoch is incomplete and was left out")
            return parsed
    raise RinexError(path, _parser_problem(text, first_error)) from first_error


def _check_time_scale(path: Path, header: Any) -> None:
    first = header.time_of_first_obs
    if first is None:
        raise RinexError(path, "header has no TIME OF FIRST OBS; expected one that names the time scale")
    scale = first[1].abbrev
    if scale not in _GPS_SCALES:
        raise RinexError(path, f"TIME OF FIRST OBS: time scale {scale}; expected GPS or Galileo time")


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
        events: list[tuple[int, list[str]]] = []
        largest_rounding_s, unordered = 0.0, 0
        for index, item in enumerate(parsed_epochs):
            if item.flag not in (0, 1, 6) or item.epoch is None:
                continue
            t = item.epoch
            week, tow_s = gps_from_calendar(t.year, t.month, t.day, t.hour, t.minute, t.second)
            key = epoch_key(week, tow_s)
            if item.flag == 6:
                events.append((key, item.cycle_slip_satellites))
                continue
            if keys and key <= keys[-1]:
                unordered += 1
                continue
            largest_rounding_s = max(largest_rounding_s, abs(tow_s - (key % MILLISECONDS_PER_WEEK) / 1000.0))
            if item.flag == 1:
                power.append(len(keys))
            indices.append(index)
            keys.append(key)
        if not keys:
            raise RinexError(path, "has no observation epoch; expected at least one")
        if unordered:
            notes.append(f"{unordered} epochs are not later than the one before and were left out")
        if largest_rounding_s > _TAG_TOLERANCE_S:
            notes.append(f"time tags were rounded to the millisecond, by up to {1e6 * largest_rounding_s:.0f} us")
        array = np.array(keys, dtype=np.int64)
        slips = [
            (int(np.searchsorted(array, key)), SAT_INDEX[sat])
            for key, satellites in events
            for sat in satellites
            if sat in SAT_INDEX and key <= keys[-1]
        ]
        return _Epochs(indices=indices, keys=array, power_failures=power, slips=slips)


@dataclass(frozen=True, kw_only=True)
class _FlatValues:
    """Every wanted observation of a file, one row each; `code` indexes `codes`."""

    codes: list[tuple[str, str]]  # (system, observation code)
    epoch: IntArray
    satellite: IntArray
    code: IntArray
    value: FloatArray
    lli: FloatArray


def _flat_values(parsed: Any, epochs: _Epochs, signals: SignalTable) -> _FlatValues:
    wanted: dict[str, list[str]] = {"G": [], "E": []}
    for (system, band), trackings in signals.items():
        if system not in wanted or band not in BAND_INDEX:
            raise ValueError(f"signals: {(system, band)!r} is not a system (G, E) and band ({', '.join(BANDS)})")
        wanted[system] += [kind + tracking for tracking in trackings for kind in _QUANTITIES]
    codes = [(system, code) for system, names in wanted.items() for code in names]
    place = {key: index for index, key in enumerate(codes)}
    systems = {"G": sidereon.GnssSystem.GPS, "E": sidereon.GnssSystem.GALILEO}
    allowed = sidereon.ObservationFilter([(systems[letter], names) for letter, names in wanted.items() if names])
    satellites: list[int] = []
    code_indices: list[int] = []
    counts, values, llis = [], [], []
    for index in epochs.indices:
        series = parsed.observation_values(index, allowed)
        names, obs_codes = series.satellites, series.codes
        satellites += [SAT_INDEX.get(name, -1) for name in names]
        code_indices += [place.get((name[0], code), -1) for name, code in zip(names, obs_codes, strict=True)]
        counts.append(len(names))
        values.append(series.values)
        llis.append(series.lli)
    value, lli = np.concatenate(values), np.concatenate(llis)
    satellite, code = np.array(satellites, dtype=np.int64), np.array(code_indices, dtype=np.int64)
    epoch = np.repeat(np.arange(len(counts)), counts)
    keep = (satellite >= 0) & (code >= 0) & np.isfinite(value) & (value != 0.0)
    return _FlatValues(
        codes=codes, epoch=epoch[keep], satellite=satellite[keep], code=code[keep], value=value[keep], lli=lli[keep]
    )


def _choose(counts: Mapping[str, int], trackings: Sequence[str]) -> SignalChoice | None:
    """Choice for one system and band from the numbers of observations of each observation code."""
    both = [min(counts.get("C" + tracking, 0), counts.get("L" + tracking, 0)) for tracking in trackings]
    together = next((t for t, n in zip(trackings, both, strict=True) if n > 0 and 2 * n >= max(both)), None)

    def first(kind: str, preferred: str | None) -> str | None:
        order = [preferred, *trackings] if preferred else trackings
        return next((kind + tracking for tracking in order if counts.get(kind + str(tracking), 0)), None)

    code, carrier = first("C", together), first("L", together)
    if code is None and carrier is None:
        return None
    tracking = (carrier or code or "")[1:]
    return SignalChoice(code=code, carrier=carrier, doppler=first("D", tracking), cn0=first("S", tracking))


def _dense(
    flat: _FlatValues, n_epochs: int, signals: SignalTable
) -> tuple[dict[tuple[str, str], SignalChoice], list[FloatArray]]:
    """Chosen signals and the five quantities (code, carrier, doppler, C/N0, LLI), each (E, N_BANDS, N_SATS)."""
    counts = np.bincount(flat.code, minlength=len(flat.codes))
    number = {key: int(count) for key, count in zip(flat.codes, counts, strict=True)}
    place = {key: index for index, key in enumerate(flat.codes)}
    arrays = [np.full((n_epochs, N_BANDS, N_SATS), np.nan) for _ in range(5)]
    chosen: dict[tuple[str, str], SignalChoice] = {}
    for (system, band), trackings in signals.items():
        choice = _choose({code: n for (letter, code), n in number.items() if letter == system}, trackings)
        if choice is None:
            continue
        chosen[system, band] = choice
        row = BAND_INDEX[band]
        for quantity, name in enumerate((choice.code, choice.carrier, choice.doppler, choice.cn0)):
            if name is None:
                continue
            rows = flat.code == place[system, name]
            where = (flat.epoch[rows], row, flat.satellite[rows])
            scale = WAVELENGTH_M[row] if quantity == _QUANTITIES["L"] else 1.0
            arrays[quantity][where] = flat.value[rows] * scale
            if quantity == _QUANTITIES["L"]:
                arrays[4][where] = np.nan_to_num(flat.lli[rows])  # a blank indicator is 0 (RINEX)
    arrays[0][arrays[0] <= 0.0] = np.nan
    return chosen, arrays


def _set_loss_of_lock(lli: FloatArray, carrier_m: FloatArray, epochs: _Epochs) -> None:
    for row in epochs.power_failures:
        lli[row] = _with_bit_0(lli[row], carrier_m[row])
    for row, satellite in epochs.slips:
        lli[row, :, satellite] = _with_bit_0(lli[row, :, satellite], carrier_m[row, :, satellite])


def _with_bit_0(lli: FloatArray, carrier_m: FloatArray) -> FloatArray:
    set_bit = (np.nan_to_num(lli).astype(np.int64) | 1).astype(np.float64)
    return np.where(np.isfinite(carrier_m), set_bit, lli)


def _note_early_end(header: Any, keys: IntArray, notes: list[str]) -> None:
    if header.time_of_last_obs is None:
        return
    t = header.time_of_last_obs[0]
    stated = epoch_key(*gps_from_calendar(t.year, t.month, t.day, t.hour, t.minute, t.second))
    if stated > int(keys[-1]):
        here, there = calendar_text(*from_epoch_key(int(keys[-1]))), calendar_text(*from_epoch_key(stated))
        notes.append(f"ends at {here}, though its header says {there}")


def _vector(value: Any) -> FloatArray | None:
    return None if value is None else np.asarray(value, dtype=np.float64)


def _nonzero(value: Any) -> FloatArray | None:
    vector = _vector(value)
    return None if vector is None or not vector.any() else vector


def _median_spacing_s(keys: IntArray) -> float | None:
    return float(np.median(np.diff(keys))) / 1000.0 if len(keys) > 1 else None


# ---------------------------------------------------------------------------------------------------------------------
# Navigation


@dataclass(frozen=True, kw_only=True, eq=False)
class NavigationFile:
    """The GPS and Galileo ephemerides of one or several navigation files, R records in order of toe.

    Attributes
    ----------
    paths : tuple of Path
    satellite : (R,) int array
        Place on the satellite axis.
    values : (R, len(FIELDS)) array
        Fields of :class:`~gbas_core.ephemeris.Ephemeris` in the order of :data:`gbas_core.ephemeris.FIELDS`.
    transmitted_s : (R,) array
        Transmission time since the start of GPS time [s], NaN where the file has none that can be believed.
    simulated : bool
    notes : tuple of str
    """

    paths: tuple[Path, ...]
    satellite: IntArray
    values: FloatArray
    transmitted_s: FloatArray
    simulated: bool
    notes: tuple[str, ...]

    @property
    def toe_s(self) -> FloatArray:
        """Times of ephemeris ``(R,)`` since the start of GPS time [s]."""
        week, tow_s = self.values[:, FIELDS.index("toe_week")], self.values[:, FIELDS.index("toe_tow_s")]
        return np.asarray(week * SECONDS_PER_WEEK + tow_s)

    @property
    def first(self) -> tuple[int, float]:
        """GPS week and time of week [s] at which the first record becomes valid."""
        return _week_and_tow(float((self.toe_s - VALIDITY_S[self.satellite]).min()))

    @property
    def last(self) -> tuple[int, float]:
        """GPS week and time of week [s] at which the last record ceases to be valid."""
        return _week_and_tow(float((self.toe_s + VALIDITY_S[self.satellite]).max()))

    def valid_at(self, gps_week: int, tow_s: float) -> NDArray[np.bool_]:
        """Mask ``(N_SATS,)`` of the satellites with a record in its validity at a time."""
        mask = np.zeros(N_SATS, dtype=np.bool_)
        mask[self.satellite[self._valid(gps_week * SECONDS_PER_WEEK + tow_s)]] = True
        return mask

    def describe(self) -> str:
        """One line: the files and the time they cover."""
        names = ", ".join(str(path) for path in self.paths)
        return f"navigation {names} covers {calendar_text(*self.first)} to {calendar_text(*self.last)}"

    def received(self, first_week: int, first_tow_s: float) -> tuple[Ephemeris, ...]:
        """The ephemerides as a receiver would have received them that observed from a given epoch on.

        Parameters
        ----------
        first_week, first_tow_s
            First epoch of the observations.

        Returns
        -------
        tuple of Ephemeris
            In order of reception, which is each record's epoch. Satellites received at the same time share a record;
            a second ephemeris of a satellite at the same time is in a further record, in order of toe.

        Notes
        -----
        A record is received at its transmission time where the file gives one within 4 h of toe, else 2 h before toe
        (GPS) or at toe (Galileo). A satellite without a record received at least 120 s before the first epoch and
        valid at it gets the earliest received one that is valid as if received then, like from a receiver that was
        switched on before. Records that have expired at the first epoch are left out.
        """
        first_s = first_week * SECONDS_PER_WEEK + first_tow_s
        toe, valid = self.toe_s, self._valid(first_s)
        nominal = toe - np.where(IS_GPS[self.satellite], GPS_EARLIEST_TRANSMISSION_S, 0.0)
        received = np.where(np.isfinite(self.transmitted_s), self.transmitted_s, nominal)
        switched_on = first_s - SETTLED_BEFORE_FIRST_EPOCH_S
        for satellite in np.unique(self.satellite[valid]):
            rows = np.flatnonzero(valid & (self.satellite == satellite))
            if not (received[rows] <= switched_on).any():
                received[rows[np.argmin(received[rows])]] = switched_on
        keys = np.rint(received * 1000.0).astype(np.int64)
        current = np.flatnonzero(toe + VALIDITY_S[self.satellite] >= first_s)
        order = current[np.lexsort((current, toe[current], keys[current]))]
        return tuple(self._record(int(keys[rows[0]]), rows) for rows in _layers(order, keys, self.satellite))

    def _valid(self, at_s: float) -> NDArray[np.bool_]:
        return np.asarray(np.abs(at_s - self.toe_s) <= VALIDITY_S[self.satellite])

    def _record(self, key: int, rows: Sequence[int]) -> Ephemeris:
        columns = np.full((len(FIELDS), N_SATS), np.nan)
        columns[:, self.satellite[rows]] = self.values[rows].T
        columns.flags.writeable = False
        week, tow_s = from_epoch_key(key)
        fields: dict[str, Any] = {name: columns[row] for row, name in enumerate(FIELDS)}
        return Ephemeris(gps_week=week, tow_s=tow_s, simulated=float(self.simulated), **fields)


def _week_and_tow(seconds: float) -> tuple[int, float]:
    return from_epoch_key(round(seconds * 1000.0))


def _layers(order: Iterable[int], keys: IntArray, satellite: IntArray) -> list[list[int]]:
    """Rows in order, grouped by key so that no group has a satellite twice."""
    layers: dict[tuple[int, int], list[int]] = {}
    seen: dict[tuple[int, int], int] = {}
    for row in order:
        key, sat = int(keys[row]), int(satellite[row])
        layer = seen.get((key, sat), 0)
        seen[key, sat] = layer + 1
        layers.setdefault((key, layer), []).append(int(row))
    return [layers[group] for group in sorted(layers)]


def read_navigation(
    paths: PathLike | Sequence[PathLike], *, galileo: str = "inav", simulated: bool = False
) -> NavigationFile:
    """Read and merge navigation files.

    Parameters
    ----------
    paths : path or sequence of paths
        RINEX 2, 3 or 4; plain or gzip.
    galileo : {"inav", "fnav"}
        Message to take for Galileo; a satellite that has only the other gets the other.
    simulated : bool
        Marks the ephemerides as made by a simulator.

    Returns
    -------
    NavigationFile
        GPS LNAV and Galileo. A record that is in the files more than once (same satellite and data) is there once,
        with its earliest transmission time.

    Raises
    ------
    RinexError
        For anything but RINEX navigation files with at least one GPS or Galileo record among them.
    ValueError
        For another `galileo`.

    Notes
    -----
    The week of toe is the one that brings toe nearest to the (calendar) time of clock, so that week numbers modulo
    1024 do no harm. An I/NAV record's health speaks of E1 and E5b, an F/NAV record's of E5a. An accuracy that is not
    positive ("no accuracy prediction", or nothing) is NaN. A GPS IODC whose low 8 bits are not the IODE is NaN, since
    such a record mixes two data sets.
    """
    preferred = {"inav": NavigationMessage.GALILEO_INAV, "fnav": NavigationMessage.GALILEO_FNAV}
    if galileo not in preferred:
        raise ValueError(f"galileo: {galileo!r}; expected 'inav' or 'fnav'")
    files = tuple(Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths))
    if not files:
        raise ValueError("paths: no navigation file given")
    notes: list[str] = []
    records = [row for path in files for row in _records_of(path, notes)]
    if not records:
        raise RinexError(", ".join(map(str, files)), "has no GPS LNAV or Galileo record; expected at least one")
    satellite = np.array([row[0] for row in records], dtype=np.int64)
    values = np.array([row[1] for row in records])
    transmitted = np.array([row[2] for row in records])
    keep = _preferred_message(satellite, values[:, FIELDS.index("message")], preferred[galileo])
    satellite, values, transmitted = _without_repeats(satellite[keep], values[keep], transmitted[keep])
    for array in (satellite, values, transmitted):
        array.flags.writeable = False
    return NavigationFile(
        paths=files,
        satellite=satellite,
        values=values,
        transmitted_s=transmitted,
        simulated=simulated,
        notes=tuple(notes),
    )


def _records_of(path: Path, notes: list[str]) -> list[tuple[int, list[float], float]]:
    """Satellite, field values and transmission time of each usable record of one file."""
    own_notes: list[str] = []
    text = _read_text(path, own_notes)
    version = _checked_header(path, text, "N", "a RINEX navigation file")
    if version < 3.0:  # the parser wants "2.xx" where old archives have "2"
        text = f"{version:9.2f}{text[9:]}"
    try:
        parsed = sidereon.parse_rinex_nav_lenient(text)
    except sidereon.ParseError as error:
        raise RinexError(path, _parser_problem(text, error)) from error
    rows = []
    mixed = 0
    for record in parsed.records:
        if record.message.label not in _MESSAGES or record.satellite not in SAT_INDEX:
            continue
        row = _record_values(record)
        mixed += record.message.label == "gps_lnav" and bool(np.isnan(row[1][FIELDS.index("iodc")]))
        rows.append(row)
    if parsed.skipped_count:
        own_notes.append(f"{parsed.skipped_count} records were not understood and left out")
    if mixed:
        own_notes.append(f"{mixed} GPS records have an IODC that does not go with their IODE and will not be used")
    notes += [f"{path}: {note}" for note in own_notes]
    return rows


def _record_values(record: Any) -> tuple[int, list[float], float]:
    elements, clock, delays = record.elements, record.clock, record.group_delays
    is_gps = record.message.label == "gps_lnav"
    toc_s = record.toc_week * SECONDS_PER_WEEK + record.toc_tow_s
    toe_tow_s = record.toe_tow_s
    toe_week = round((toc_s - toe_tow_s) / SECONDS_PER_WEEK)
    accuracy = record.sv_accuracy_m
    e5b = delays.galileo_bgd_e5b_e1_s if record.message.label == "galileo_inav" else None
    values = {
        "message": _MESSAGES[record.message.label],
        "iod": record.issue,
        "iodc": _checked_iodc(record.iodc, record.issue) if is_gps else None,
        "toe_week": toe_week,
        "toe_tow_s": toe_tow_s,
        "toc_week": record.toc_week,
        "toc_tow_s": record.toc_tow_s,
        "sqrt_a": elements.sqrt_a,
        "e": elements.e,
        "m0_rad": elements.m0,
        "delta_n_radps": elements.delta_n,
        "omega0_rad": elements.omega0,
        "i0_rad": elements.i0,
        "omega_rad": elements.omega,
        "omega_dot_radps": elements.omega_dot,
        "idot_radps": elements.idot,
        "cuc_rad": elements.cuc,
        "cus_rad": elements.cus,
        "crc_m": elements.crc,
        "crs_m": elements.crs,
        "cic_rad": elements.cic,
        "cis_rad": elements.cis,
        "af0_s": clock.af0,
        "af1_sps": clock.af1,
        "af2_sps2": clock.af2,
        "group_delay_s": delays.gps_tgd_s if is_gps else delays.galileo_bgd_e5a_e1_s,
        "group_delay_e5b_s": e5b,
        "health": record.sv_health,
        "accuracy_m": accuracy if accuracy is not None and accuracy > 0.0 else None,
    }
    row = [float("nan") if values[name] is None else float(values[name]) for name in FIELDS]
    toe_s = toe_week * SECONDS_PER_WEEK + toe_tow_s
    return SAT_INDEX[record.satellite], row, _transmission_s(record.transmission_time_sow, toe_s)


def _checked_iodc(iodc: float | None, iode: int | None) -> float | None:
    if iodc is None or iode is None:
        return None
    if iodc >= _SCALED_IODC and iodc % _SCALED_IODC == 0:
        iodc /= _SCALED_IODC
    return iodc if 0 <= iodc < 1024 and int(iodc) % 256 == iode else None


def _transmission_s(sow: float | None, toe_s: float) -> float:
    """Transmission time since the start of GPS time [s] in the week nearest to toe; NaN unless within 4 h of it."""
    if sow is None:
        return float("nan")
    offset = (sow - toe_s + SECONDS_PER_WEEK / 2) % SECONDS_PER_WEEK - SECONDS_PER_WEEK / 2
    return toe_s + offset if abs(offset) <= MAX_TRANSMISSION_OFFSET_S else float("nan")


def _preferred_message(satellite: IntArray, message: FloatArray, preferred: NavigationMessage) -> NDArray[np.bool_]:
    has_preferred = np.isin(satellite, satellite[message == preferred])
    return (message == NavigationMessage.GPS_LNAV) | (message == preferred) | ~has_preferred


def _without_repeats(
    satellite: IntArray, values: FloatArray, transmitted: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Records in order of toe, satellite and transmission, each satellite's equal ones once."""
    week, tow = values[:, FIELDS.index("toe_week")], values[:, FIELDS.index("toe_tow_s")]
    order = np.lexsort((np.arange(len(week)), transmitted, satellite, week * SECONDS_PER_WEEK + tow))
    kept: list[int] = []
    seen: set[tuple[int, bytes]] = set()
    for row in order:
        name = (int(satellite[row]), values[row].tobytes())
        if name not in seen:
            seen.add(name)
            kept.append(int(row))
    return satellite[kept], values[kept], transmitted[kept]
