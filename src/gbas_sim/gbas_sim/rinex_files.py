"""A world as files other software reads: RINEX 3.05 observations and navigation, and the truth as a table.

Every file says in its header that it is simulated.

Source: RINEX 3.05 (IGS/RTCM, 2020), tables A2, A3, A5, A6, A8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TextIO

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK, calendar_from_gps
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import IS_GPS, SAT_IDS
from gbas_core.signals import L1, L5, WAVELENGTH_M
from gbas_sim.simulated_epochs import SimulatedEpoch, Truth
from gbas_sim.world import World

VERSION: Final = "3.05"
LABEL: Final = "SIMULATED DATA - NOT FROM ANY RECEIVER OR SATELLITE"
TRUTH_COLUMNS: Final = (
    "gps_week", "tow_s", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps",
    "latitude_deg", "longitude_deg", "height_m", "roll_deg", "pitch_deg", "heading_deg", "simulated",
)  # fmt: skip
_PROGRAM: Final = "gbas sim"
# Observation codes of both systems: C/A and E1C, L5Q and E5aQ.
_BANDS: Final = ((L1, "1C"), (L5, "5Q"))
_CODES: Final = tuple(f"{quantity}{signal}" for _, signal in _BANDS for quantity in "CLDS")
_GALILEO_INAV_SOURCE: Final = 517.0  # table A8: E1-B and E5b, clock of E5b and E1
_GPS_FIT_H: Final = 4.0
# Known: GPS less UTC since 2017-01-01 (week 1930); nothing is said of earlier times.
_LEAP_S: Final = 18
_LEAP_S_SINCE_WEEK: Final = 1930


@dataclass(frozen=True, kw_only=True)
class ExportedFiles:
    """Files of one world.

    Attributes
    ----------
    observations : tuple of Path
        One a receiver, the aircraft's last.
    navigation : Path
    truth : Path or None
        None without an aircraft.
    """

    observations: tuple[Path, ...]
    navigation: Path
    truth: Path | None


def export(world: World, folder: Path, *, progress: Callable[[int, int], None] = lambda *_: None) -> ExportedFiles:
    """Write a world.

    Parameters
    ----------
    world : World
    folder : Path
        Made if need be; files in it are overwritten.
    progress : callable
        Told how many epochs are done, of how many.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = world.params.receiver_names
    files = ExportedFiles(
        observations=tuple(folder / f"{name}.obs" for name in names),
        navigation=folder / "broadcast.nav",
        truth=folder / "truth.csv" if world.params.flight is not None else None,
    )
    files.navigation.write_text("".join(navigation_lines(world)), encoding="ascii")
    first = world.epoch(0)
    with ExitStack() as stack:
        sinks = [stack.enter_context(path.open("w", encoding="ascii")) for path in files.observations]
        truth = stack.enter_context(files.truth.open("w", encoding="ascii")) if files.truth else None
        for row, (sink, name) in enumerate(zip(sinks, names, strict=True)):
            sink.writelines(observation_header(world, name, _place(world, first, row)))
        if truth:
            truth.write(f"# {LABEL}\n{','.join(TRUTH_COLUMNS)}\n")
        for number, epoch in enumerate(world):
            _write_epoch(epoch, sinks, truth)
            progress(number + 1, len(world))
    return files


def _place(world: World, first: SimulatedEpoch, row: int) -> tuple[float, float, float]:
    sites = world.params.receiver_ecef_m
    if row < len(sites) or first.truth is None:
        return sites[row]
    x, y, z = first.truth.position_m.tolist()
    return x, y, z


def _write_epoch(epoch: SimulatedEpoch, sinks: Sequence[TextIO], truth: TextIO | None) -> None:
    airborne = () if epoch.airborne is None else (epoch.airborne,)
    for sink, observations in zip(sinks, (*epoch.ground, *airborne), strict=True):
        sink.writelines(epoch_lines(observations))
    if truth is not None and epoch.truth is not None:
        truth.write(truth_line(epoch.truth))


# --- observations


def _line(content: str, label: str) -> str:
    return f"{content:<60}{label:<20}".rstrip() + "\n"


def _leading(kind: str, world: World) -> list[str]:
    params = world.params
    year, month, day, hour, minute, second = _calendar(params.start_week, params.start_tow_s)
    # The date of a file is that of its data: the same scenario gives the same file.
    date = f"{year:04d}{month:02d}{day:02d} {hour:02d}{minute:02d}{int(second):02d} GPS"
    return [
        _line(f"{VERSION:>9}{'':11}{kind:<20}M: MIXED", "RINEX VERSION / TYPE"),
        _line(f"{_PROGRAM:<20}{'simulated':<20}{date:<20}", "PGM / RUN BY / DATE"),
        _line(LABEL, "COMMENT"),
    ]


def observation_header(world: World, name: str, position_m: tuple[float, float, float]) -> list[str]:
    """Header lines of one receiver's file."""
    params, airborne = world.params, name == world.params.receiver_names[-1] and world.params.flight is not None
    year, month, day, hour, minute, second = _calendar(params.start_week, params.start_tow_s)
    systems = [letter for letter in "GE" if letter in params.systems]
    types = f"{len(_CODES):>5} {' '.join(_CODES)}"
    return [
        *_leading("OBSERVATION DATA", world),
        _line(f"{name}", "MARKER NAME"),
        _line("AIRBORNE" if airborne else "GEODETIC", "MARKER TYPE"),
        _line(f"{'gbas':<20}{'simulated':<40}", "OBSERVER / AGENCY"),
        _line(f"{name:<20}{'SIMULATED':<20}{'':<20}", "REC # / TYPE / VERS"),
        _line(f"{name:<20}{'SIMULATED':<20}", "ANT # / TYPE"),
        _line("".join(f"{each:14.4f}" for each in position_m), "APPROX POSITION XYZ"),
        _line("".join(f"{0.0:14.4f}" for _ in range(3)), "ANTENNA: DELTA H/E/N"),
        *(_line(f"{letter}{types}", "SYS / # / OBS TYPES") for letter in systems),
        _line("DBHZ", "SIGNAL STRENGTH UNIT"),
        _line(f"{params.interval_s:10.3f}", "INTERVAL"),
        _line(f"{year:6d}{month:6d}{day:6d}{hour:6d}{minute:6d}{second:13.7f}{'GPS':>8}", "TIME OF FIRST OBS"),
        *(_line(f"{letter} L{signal} {0.0:8.5f}", "SYS / PHASE SHIFT") for letter in systems for _, signal in _BANDS),
        _line("", "END OF HEADER"),
    ]


def epoch_lines(observations: ObservationEpoch) -> list[str]:
    """The record of one epoch: metres, cycles, hertz, dB-Hz; the carriers' indicator of lost lock beside them."""
    seen = np.flatnonzero(np.isfinite(observations.code_m).any(axis=0)).tolist()
    year, month, day, hour, minute, second = _calendar(observations.gps_week, observations.tow_s)
    lines = [f"> {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d}{second:11.7f}  0{len(seen):3d}\n"]
    columns = []
    for band, _ in _BANDS:
        cycles = observations.carrier_m[band] / WAVELENGTH_M[band]
        lost = observations.lli[band]
        for values, flags in (
            (observations.code_m[band], None),
            (cycles, lost),
            (observations.doppler_hz[band], None),
            (observations.cn0_dbhz[band], None),
        ):
            columns.append((values.tolist(), None if flags is None else flags.tolist()))
    for satellite in seen:
        fields = [_field(values[satellite], flags and flags[satellite]) for values, flags in columns]
        lines.append(f"{SAT_IDS[satellite]}{''.join(fields)}".rstrip() + "\n")
    return lines


def _field(value: float, lost: float | None) -> str:
    if math.isnan(value):
        return " " * 16
    return f"{value:14.3f}{'1' if lost else ' '} "


def _calendar(gps_week: int, tow_s: float) -> tuple[int, int, int, int, int, float]:
    year, month, day, hour, minute, second = calendar_from_gps(gps_week, tow_s)
    return int(year), int(month), int(day), int(hour), int(minute), float(second)


# --- navigation


def navigation_lines(world: World) -> Iterator[str]:
    """Navigation file with everything that is broadcast during the run."""
    yield from _leading("N: GNSS NAV DATA", world)
    if world.params.start_week >= _LEAP_S_SINCE_WEEK:
        yield _line(f"{_LEAP_S:6d}", "LEAP SECONDS")
    yield _line("", "END OF HEADER")
    for ephemeris in world.ephemerides:
        for satellite in np.flatnonzero(np.isfinite(ephemeris.sqrt_a)).tolist():
            yield from ephemeris_lines(ephemeris, satellite)


def ephemeris_lines(ephemeris: Ephemeris, satellite: int) -> list[str]:
    """One record; its transmission time is when it was received."""

    def value(name: str) -> float:
        number = float(getattr(ephemeris, name)[satellite])
        return 0.0 if math.isnan(number) else number

    toe_week = value("toe_week")
    sent_s = (ephemeris.gps_week - toe_week) * SECONDS_PER_WEEK + ephemeris.tow_s
    gps = bool(IS_GPS[satellite])
    rows = [
        ("af0_s", "af1_sps", "af2_sps2"),
        ("iod", "crs_m", "delta_n_radps", "m0_rad"),
        ("cuc_rad", "e", "cus_rad", "sqrt_a"),
        ("toe_tow_s", "cic_rad", "omega0_rad", "cis_rad"),
        ("i0_rad", "crc_m", "omega_rad", "omega_dot_radps"),
    ]
    numbers = [[value(name) for name in row] for row in rows]
    numbers.append([value("idot_radps"), 0.0 if gps else _GALILEO_INAV_SOURCE, toe_week, 0.0])
    last = value("iodc") if gps else value("group_delay_e5b_s")
    numbers.append([value("accuracy_m"), value("health"), value("group_delay_s"), last])
    numbers.append([sent_s, _GPS_FIT_H] if gps else [sent_s])
    year, month, day, hour, minute, second = _calendar(int(value("toc_week")), value("toc_tow_s"))
    head = f"{SAT_IDS[satellite]} {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d} {int(second):02d}"
    heads = [head, *["    "] * (len(numbers) - 1)]
    return [start + "".join(f"{each:19.12E}" for each in row) + "\n" for start, row in zip(heads, numbers, strict=True)]


# --- truth


def truth_line(truth: Truth) -> str:
    """One line of the table of the truth."""
    latitude, longitude, height = (float(each) for each in geodetic_from_ecef(truth.position_m))
    numbers = [f"{each:.4f}" for each in (*truth.position_m.tolist(), *truth.velocity_mps.tolist())]
    place = [f"{math.degrees(latitude):.10f}", f"{math.degrees(longitude):.10f}", f"{height:.4f}"]
    attitude = [f"{math.degrees(each):.4f}" for each in (truth.roll_rad, truth.pitch_rad, truth.heading_rad)]
    return ",".join([str(truth.gps_week), f"{truth.tow_s:.3f}", *numbers, *place, *attitude, "1"]) + "\n"
