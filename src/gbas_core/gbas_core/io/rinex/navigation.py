"""Navigation files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import sidereon
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import FIELDS, VALIDITY_S, Ephemeris, NavigationMessage
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK, calendar_text, from_epoch_key
from gbas_core.io.files import PathLike
from gbas_core.io.rinex.text import RinexError, checked_version, parser_problem, read_text, says_simulated
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import IS_GPS, N_SATS, SAT_INDEX

NavigationRow = tuple[int, list[float], float]
"""Place on the satellite axis, fields of :class:`Ephemeris`, and transmission time since the start of GPS time [s]."""

SETTLED_BEFORE_FIRST_EPOCH_S: Final = 120.0
"""How long before the first epoch a receiver counts as having received what was valid then."""
MAX_TRANSMISSION_OFFSET_S: Final = 4 * 3600.0
"""A transmission time further from toe than this is not believed."""
GPS_EARLIEST_TRANSMISSION_S: Final = 2 * 3600.0
"""How long before toe a GPS ephemeris is first sent (IS-GPS-200N 20.3.4.4: toe is the middle of 4 h)."""

_SCALED_IODC: Final = 2048  # some old archives hold the IODC shifted by 11 bits
_MESSAGES: Final = {
    "gps_lnav": NavigationMessage.GPS_LNAV,
    "galileo_inav": NavigationMessage.GALILEO_INAV,
    "galileo_fnav": NavigationMessage.GALILEO_FNAV,
}
_PREFERENCES: Final = {"inav": NavigationMessage.GALILEO_INAV, "fnav": NavigationMessage.GALILEO_FNAV}
# Fields of Ephemeris that are the parser's Keplerian elements under a shorter name.
_ELEMENTS: Final = {
    "sqrt_a": "sqrt_a",
    "e": "e",
    "m0_rad": "m0",
    "delta_n_radps": "delta_n",
    "omega0_rad": "omega0",
    "i0_rad": "i0",
    "omega_rad": "omega",
    "omega_dot_radps": "omega_dot",
    "idot_radps": "idot",
    "cuc_rad": "cuc",
    "cus_rad": "cus",
    "crc_m": "crc",
    "crs_m": "crs",
    "cic_rad": "cic",
    "cis_rad": "cis",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class NavigationFile:
    """The GPS and Galileo ephemerides of one or several navigation files, R records in order of toe.

    Attributes
    ----------
    paths : tuple of Path
    satellite : (R,) int array
        Place on the satellite axis.
    values : (R, len(FIELDS)) array
        Fields of :class:`~gbas_core.gnss.ephemeris.Ephemeris` in the order of :data:`gbas_core.gnss.ephemeris.FIELDS`.
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
        Marks the ephemerides as made by a simulator, as files do whose header says so.

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
    files = tuple(Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths))
    if not files:
        raise ValueError("paths: no navigation file given")
    notes: list[str] = []
    parts = [_records_of(path, notes) for path in files]
    records = [row for rows, _ in parts for row in rows]
    if not records:
        raise RinexError(", ".join(map(str, files)), "has no GPS LNAV or Galileo record; expected at least one")
    labelled = any(labelled for _, labelled in parts)
    return navigation_of(files, records, galileo=galileo, simulated=simulated or labelled, notes=notes)


def navigation_of(
    paths: tuple[Path, ...], records: Sequence[NavigationRow], *, galileo: str, simulated: bool, notes: Sequence[str]
) -> NavigationFile:
    """The records of some files, at least one, in order and without repeats; `galileo` as in :func:`read_navigation`.

    Raises
    ------
    ValueError
        For another `galileo`.
    """
    if galileo not in _PREFERENCES:
        raise ValueError(f"galileo: {galileo!r}; expected 'inav' or 'fnav'")
    satellite = np.array([row[0] for row in records], dtype=np.int64)
    values = np.array([row[1] for row in records])
    transmitted = np.array([row[2] for row in records])
    keep = _preferred_message(satellite, values[:, FIELDS.index("message")], _PREFERENCES[galileo])
    satellite, values, transmitted = _without_repeats(satellite[keep], values[keep], transmitted[keep])
    for array in (satellite, values, transmitted):
        array.flags.writeable = False
    return NavigationFile(
        paths=paths,
        satellite=satellite,
        values=values,
        transmitted_s=transmitted,
        simulated=simulated,
        notes=tuple(notes),
    )


def _records_of(path: Path, notes: list[str]) -> tuple[list[NavigationRow], bool]:
    """Satellite, field values and transmission time of each usable record of one file; whether it is simulated."""
    own_notes: list[str] = []
    text = read_text(path, own_notes)
    version = checked_version(path, text, "N", "a RINEX navigation file")
    if version < 3.0:  # the parser wants "2.xx" where old archives have "2"
        text = f"{version:9.2f}{text[9:]}"
    try:
        parsed = sidereon.parse_rinex_nav_lenient(text)
    except sidereon.ParseError as error:
        raise RinexError(path, parser_problem(text, error)) from error
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
    return rows, says_simulated(text)


def _record_values(record: Any) -> NavigationRow:
    elements, clock, delays = record.elements, record.clock, record.group_delays
    is_gps = record.message.label == "gps_lnav"
    toc_s = record.toc_week * SECONDS_PER_WEEK + record.toc_tow_s
    toe_tow_s = record.toe_tow_s
    toe_week = round((toc_s - toe_tow_s) / SECONDS_PER_WEEK)
    accuracy = record.sv_accuracy_m
    values: dict[str, float | None] = {name: getattr(elements, short) for name, short in _ELEMENTS.items()}
    values |= {
        "message": _MESSAGES[record.message.label],
        "iod": record.issue,
        "iodc": checked_iodc(record.iodc, record.issue) if is_gps else None,
        "toe_week": toe_week,
        "toe_tow_s": toe_tow_s,
        "toc_week": record.toc_week,
        "toc_tow_s": record.toc_tow_s,
        "af0_s": clock.af0,
        "af1_sps": clock.af1,
        "af2_sps2": clock.af2,
        "group_delay_s": delays.gps_tgd_s if is_gps else delays.galileo_bgd_e5a_e1_s,
        # RINEX has a place for BGD(E1,E5b) in every Galileo record, but F/NAV does not carry it.
        "group_delay_e5b_s": delays.galileo_bgd_e5b_e1_s if record.message.label == "galileo_inav" else None,
        "health": record.sv_health,
        "accuracy_m": accuracy if accuracy is not None and accuracy > 0.0 else None,
    }
    row = [float("nan") if (value := values[name]) is None else float(value) for name in FIELDS]
    toe_s = toe_week * SECONDS_PER_WEEK + toe_tow_s
    return SAT_INDEX[record.satellite], row, _transmission_s(record.transmission_time_sow, toe_s)


def checked_iodc(iodc: float | None, iode: int | None) -> float | None:
    """The IODC, unless its low 8 bits are not the IODE."""
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
    return np.asarray((message == NavigationMessage.GPS_LNAV) | (message == preferred) | ~has_preferred)


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
