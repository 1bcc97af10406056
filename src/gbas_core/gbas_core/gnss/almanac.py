"""GPS almanacs: the YUMA and SEM text formats, and satellite positions from them.

Two small fixed formats no library in use reads. Both number the week modulo 1024, which is resolved against a week the
caller names.

Source: U.S. Coast Guard Navigation Center, "YUMA almanac" and "SEM almanac" definitions; ICD-GPS-870 appendix;
IS-GPS-200N 20.3.3.5.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.gnss.orbits import SatelliteState, satellite_state
from gbas_core.record import FloatArray, Record, per_satellite
from gbas_core.satellites import IS_GPS, N_GPS, N_SATS

WEEK_CYCLE: Final = 1024
SEMICIRCLE_RAD: Final = 3.1415926535898
"""Radians in a semicircle. Source: IS-GPS-200N 20.3.3.4.3.2."""
REFERENCE_INCLINATION_RAD: Final = 0.30 * SEMICIRCLE_RAD
"""Inclination a SEM almanac's offset counts from. Source: IS-GPS-200N 20.3.3.5.2.1."""

_Field = tuple[str, Callable[[float], bool], str]
_ANY: Final = np.isfinite
# YUMA label up to the bracket or colon -> field of Almanac, what it must fulfil, the same in words.
_YUMA: Final[dict[str, _Field]] = {
    "Health": ("health", lambda v: 0 <= v <= 255, "0 to 255"),
    "Eccentricity": ("e", lambda v: 0.0 <= v < 0.5, "0 to 0.5"),
    "Time of Applicability": ("toa_tow_s", lambda v: 0.0 <= v < 604800.0, "0 to 604799"),
    "Orbital Inclination": ("i_rad", lambda v: 0.0 < v < SEMICIRCLE_RAD, "0 to pi"),
    "Rate of Right Ascen": ("omega_dot_radps", lambda v: abs(v) < 1e-6, "below 1e-6"),
    "SQRT": ("sqrt_a", lambda v: 2530.0 < v < 8192.0, "2530 to 8192"),
    "Right Ascen at Week": ("omega0_rad", _ANY, "a number"),
    "Argument of Perigee": ("omega_rad", _ANY, "a number"),
    "Mean Anom": ("m0_rad", _ANY, "a number"),
    "Af0": ("af0_s", _ANY, "a number"),
    "Af1": ("af1_sps", _ANY, "a number"),
    "week": ("toa_week", lambda v: v >= 0, "0 or more"),
}
# Field, factor and offset of the numbers in a SEM record's rows.
_SEM_ROWS: Final[tuple[tuple[tuple[str, float, float], ...], ...]] = (
    (
        ("e", 1.0, 0.0),
        ("i_rad", SEMICIRCLE_RAD, REFERENCE_INCLINATION_RAD),
        ("omega_dot_radps", SEMICIRCLE_RAD, 0.0),
    ),
    (("sqrt_a", 1.0, 0.0), ("omega0_rad", SEMICIRCLE_RAD, 0.0), ("omega_rad", SEMICIRCLE_RAD, 0.0)),
    (("m0_rad", SEMICIRCLE_RAD, 0.0), ("af0_s", 1.0, 0.0), ("af1_sps", 1.0, 0.0)),
    (("health", 1.0, 0.0),),
)
_BOUNDS: Final = {name: (check, words) for name, check, words in _YUMA.values()}


class AlmanacError(ValueError):
    """An almanac that cannot be used; the text names it, the line, the field, the value and what was expected."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Almanac(Record):
    """GPS almanac; the record's epoch is the latest time of applicability in it."""

    health: FloatArray = per_satellite("-", "health, 0 is healthy")
    toa_week: FloatArray = per_satellite("week", "GPS week of the time of applicability")
    toa_tow_s: FloatArray = per_satellite("s", "time of applicability")
    sqrt_a: FloatArray = per_satellite("m^0.5", "square root of the semi-major axis")
    e: FloatArray = per_satellite("-", "eccentricity")
    i_rad: FloatArray = per_satellite("rad", "inclination")
    omega0_rad: FloatArray = per_satellite("rad", "longitude of the ascending node at weekly epoch")
    omega_dot_radps: FloatArray = per_satellite("rad/s", "rate of right ascension")
    omega_rad: FloatArray = per_satellite("rad", "argument of perigee")
    m0_rad: FloatArray = per_satellite("rad", "mean anomaly at the time of applicability")
    af0_s: FloatArray = per_satellite("s", "clock bias")
    af1_sps: FloatArray = per_satellite("s/s", "clock drift")


def read_almanac(path: str | Path, *, near_week: int) -> Almanac:
    """Read a YUMA or SEM file, whichever it is; see :func:`parse_yuma`.

    Raises
    ------
    AlmanacError
        Also when the file cannot be read as text.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise AlmanacError(f"{path}: cannot be read: {error}") from error
    parse = parse_yuma if text.lstrip().startswith("*") else parse_sem
    return parse(text, near_week=near_week, name=str(path))


def resolve_week(week: int, near_week: int) -> int:
    """The GPS week that equals `week` modulo 1024 and lies nearest to `near_week`."""
    return near_week + (week - near_week + WEEK_CYCLE // 2) % WEEK_CYCLE - WEEK_CYCLE // 2


def parse_yuma(text: str, *, near_week: int, name: str = "almanac") -> Almanac:
    """Almanac from the text of a YUMA file.

    Parameters
    ----------
    text : str
    near_week : int
        GPS week the almanac's week, which is modulo 1024, is nearest to.
    name : str
        What errors call the text.

    Raises
    ------
    AlmanacError
        For a field that is missing, no number or out of bounds; a satellite that is there twice; no satellite at all.
    """
    satellites: dict[int, dict[str, float]] = {}
    fields: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        label, colon, value = line.partition(":")
        label = label.split("(")[0].strip()
        if label == "ID" and colon:
            fields = _new_satellite(satellites, value, f"{name}: line {number}")
        elif label in _YUMA and colon:
            if not satellites:
                raise AlmanacError(f"{name}: line {number}: {label} before any ID; expected a YUMA almanac")
            field = _YUMA[label][0]
            fields[field] = _number(value, field, f"{name}: line {number}: {label}")
    return _almanac(satellites, near_week, name)


def parse_sem(text: str, *, near_week: int, name: str = "almanac") -> Almanac:
    """Almanac from the text of a SEM file; arguments and errors as for :func:`parse_yuma`."""
    rows = ((n, line.split()) for n, line in enumerate(text.splitlines(), start=1) if line.strip())
    where, (count_text, *_) = _row(rows, 1, name)
    count = int(_parsed(count_text, f"{where}: number of satellites"))
    where, (week, toa_s) = _row(rows, 2, name)
    common = {
        "toa_week": _number(week, "toa_week", f"{where}: week"),
        "toa_tow_s": _number(toa_s, "toa_tow_s", f"{where}: time of applicability"),
    }
    satellites: dict[int, dict[str, float]] = {}
    for _ in range(count):
        where, (prn, *_) = _row(rows, 1, name)
        fields = _new_satellite(satellites, prn, where)
        fields |= common
        _row(rows, 1, name)  # space vehicle number
        _row(rows, 1, name)  # average URA index
        for columns in _SEM_ROWS:
            where, words = _row(rows, len(columns), name)
            for (field, scale, offset), word in zip(columns, words, strict=False):
                value = _parsed(word, f"{where}: {field}") * scale + offset
                fields[field] = _checked(value, field, f"{where}: {field}", word)
        _row(rows, 1, name)  # satellite configuration
    return _almanac(satellites, near_week, name)


def _row(rows: Iterator[tuple[int, list[str]]], n_words: int, name: str) -> tuple[str, list[str]]:
    """Where the next row is, and its first words; at least `n_words`."""
    number, words = next(rows, (0, []))
    if not number:
        raise AlmanacError(f"{name}: ends early; expected a SEM almanac with all its satellites")
    if len(words) < n_words:
        raise AlmanacError(f"{name}: line {number}: {' '.join(words)!r}; expected {n_words} numbers of a SEM almanac")
    return f"{name}: line {number}", words


def _new_satellite(satellites: dict[int, dict[str, float]], text: str, where: str) -> dict[str, float]:
    prn = _parsed(text, f"{where}: PRN")
    if not (prn.is_integer() and 1 <= prn <= N_GPS):
        raise AlmanacError(f"{where}: PRN {text.strip()!r}; expected 1 to {N_GPS}")
    if int(prn) in satellites:
        raise AlmanacError(f"{where}: PRN {int(prn)} is there twice")
    return satellites.setdefault(int(prn), {})


def _parsed(text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise AlmanacError(f"{where}: {text.strip()!r}; expected a number") from None


def _number(text: str, field: str, where: str) -> float:
    return _checked(_parsed(text, where), field, where, text)


def _checked(value: float, field: str, where: str, text: str) -> float:
    check, words = _BOUNDS[field]
    if not check(value):
        raise AlmanacError(f"{where}: {text.strip()!r}; expected {words}")
    return value


def _almanac(satellites: dict[int, dict[str, float]], near_week: int, name: str) -> Almanac:
    if not satellites:
        raise AlmanacError(f"{name}: no satellite; expected a YUMA or SEM almanac")
    columns = {field: np.full(N_SATS, np.nan) for field in _BOUNDS}
    for prn, fields in satellites.items():
        for field, column in columns.items():
            if field not in fields:
                raise AlmanacError(f"{name}: PRN {prn}: {field} is missing")
            column[prn - 1] = fields[field]
    for prn in satellites:
        columns["toa_week"][prn - 1] = resolve_week(int(columns["toa_week"][prn - 1]), near_week)
    weeks = {int(columns["toa_week"][prn - 1]) for prn in satellites}
    if max(weeks) - min(weeks) > 1:
        raise AlmanacError(f"{name}: weeks {sorted(weeks)} in one almanac; expected neighbouring ones")
    week, tow_s = max((columns["toa_week"][prn - 1], columns["toa_tow_s"][prn - 1]) for prn in satellites)
    return Almanac(gps_week=int(week), tow_s=float(tow_s), **columns)


def ephemeris_from_almanac(almanac: Almanac) -> Ephemeris:
    """An almanac as the ephemeris it abbreviates: harmonic terms and rates that an almanac lacks are zero.

    Issue of data, group delay and accuracy, which an almanac does not have either, stay missing. The result is marked
    as simulated, since no satellite sent it as an ephemeris.

    Source: IS-GPS-200N 20.3.3.5.2.1 (the almanac is used in the ephemeris' equations, other parameters zero).
    """
    zero = np.where(np.isfinite(almanac.sqrt_a), 0.0, np.nan)
    shared = ("sqrt_a", "e", "m0_rad", "omega0_rad", "omega_rad", "omega_dot_radps", "af0_s", "af1_sps", "health")
    absent = ("delta_n_radps", "idot_radps", "cuc_rad", "cus_rad", "crc_m", "crs_m", "cic_rad", "cis_rad", "af2_sps2")
    return Ephemeris(
        gps_week=almanac.gps_week,
        tow_s=almanac.tow_s,
        simulated=1.0,
        message=np.where(IS_GPS, zero + NavigationMessage.GPS_LNAV, np.nan),
        toe_week=almanac.toa_week,
        toe_tow_s=almanac.toa_tow_s,
        toc_week=almanac.toa_week,
        toc_tow_s=almanac.toa_tow_s,
        i0_rad=almanac.i_rad,
        **{name: getattr(almanac, name) for name in shared},
        **dict.fromkeys(absent, zero),
    )


def almanac_state(almanac: Almanac, gps_week: int, tow_tx_s: ArrayLike) -> SatelliteState:
    """Position, velocity and clock of an almanac's satellites, healthy or not, at times of transmission.

    Parameters
    ----------
    gps_week : int
    tow_tx_s : (..., N_SATS) array or scalar
        System time of transmission [s].

    Notes
    -----
    Good to a kilometre or so near the time of applicability; the clock has no group delay.
    """
    return satellite_state(ephemeris_from_almanac(almanac), gps_week, tow_tx_s, band=None)
