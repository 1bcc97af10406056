"""The paper's flight: figures 8, 9, 12, 17 to 19, and the spacing of what is lost in the turn."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from gbas_airborne.abia.airframe.aircraft import fighter
from gbas_airborne.abia.airframe.mask_table import MaskTable, antenna_elevation_rad
from gbas_airborne.abia.multipath.airframe_echoes import ground_echo
from gbas_airborne.abia.tracking.line_of_sight import doppler_of_path
from gbas_airborne.abia.visibility.satellites_in_view import Path, Visibility, satellites_in_view
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS, SAT_IDS
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.link_budget import TransmitBudget
from gbas_core.signals import L1
from gbas_sim.flight.dynamics import FIGHTER, Flight, Start, five_phase_plan
from gbas_sim.satellites.constellation import nominal_ephemeris
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

_WEEK, _START_TOW_S = 2300, 396_000.0
_STEP_S: Final = 0.5
_TURN_S: Final = (600.0, 900.0)
_CRUISE_S: Final = (300.0, 600.0)


class _Flown(NamedTuple):
    """The flight and what is seen on it."""

    since_s: FloatArray
    path: Path
    velocity_mps: FloatArray
    ephemeris: Ephemeris
    seen: Visibility


@lru_cache(maxsize=1)
def _flown() -> _Flown:
    start = Start(latitude_rad=math.radians(41.7), longitude_rad=math.radians(12.4), height_m=300.0, heading_rad=0.6)
    flight = Flight(plan=five_phase_plan(start=start), aircraft=FIGHTER)
    since_s = np.arange(0.0, 1500.0, _STEP_S)
    state = flight.flight_state(since_s)
    path = Path(
        gps_week=_WEEK,
        tow_s=_START_TOW_S + since_s,
        position_m=state.position_ecef_m,
        roll_rad=state.roll_rad,
        pitch_rad=state.pitch_rad,
        heading_rad=state.heading_rad,
    )
    ephemeris = nominal_ephemeris(_WEEK, _START_TOW_S, seed=1, systems=np.ones(N_SATS, dtype=bool))
    aircraft = fighter()
    mask = MaskTable.of_mesh(aircraft.airframe, aircraft.antenna("upper").place_m)
    return _Flown(since_s, path, state.velocity_ecef_mps, ephemeris, satellites_in_view(ephemeris, path, mask))


def _within(bounds_s: tuple[float, float]) -> slice:
    return slice(round(bounds_s[0] / _STEP_S), round(bounds_s[1] / _STEP_S))


def flight_section() -> Section:
    """Five phases of five minutes."""
    return Section(
        title="The flight: figures 8, 9, 12, 17 to 19",
        text=(
            "Place, date, speeds and heights of the paper's flight are not published. Flown by the equations of motion "
            "of a fighter, with nominal GPS and Galileo constellations: counterparts, not the paper's curves."
        ),
        items=[*_visibility_items(), *_onset_items()],
        pictures=[_path_picture(), _count_picture(), _cn0_picture(), _ground_picture(), *_doppler_pictures()],
    )


def _visibility_items() -> list[Value | Claim]:
    flown = _flown()
    turn, cruise = _within(_TURN_S), _within(_CRUISE_S)
    both, gps = flown.seen.in_view.sum(axis=1), (flown.seen.in_view & IS_GPS).sum(axis=1)
    other = "Another place, date and constellation than the paper's."
    turning = "GPS and Galileo in view, turning descent of 300 s at one turn in 90 s"
    return [
        Value(
            name="figure 9, fewest satellites",
            ours=float(both[turn].min()),
            paper="7",
            unit="",
            definition=turning,
            comparable=False,
            why=other,
        ),
        Value(
            name="figure 9, most satellites",
            ours=float(both[turn].max()),
            paper="16",
            unit="",
            definition=turning,
            comparable=False,
            why=other,
        ),
        Claim(
            name="no system masking straight and level",
            holds=bool(gps[cruise].min() >= 4),
            paper_text="no flags in the cruise",
            ours_text=f"at least {int(gps[cruise].min())} GPS satellites in view in the cruise",
            definition="GPS alone, antenna horizon 5°",
            why="Fewer than four were in view.",
        ),
    ]


def _onset_items() -> list[Value | Claim]:
    flown = _flown()
    since_s, view = flown.since_s[_within(_TURN_S)], flown.seen.in_view[_within(_TURN_S)]
    spacings = []
    for number in range(N_SATS):
        onsets_s = since_s[1:][view[:-1, number] & ~view[1:, number]]
        steady = onsets_s[(onsets_s > 620.0) & (onsets_s < 780.0)]
        spacings += [float(onsets_s[np.argmin(np.abs(onsets_s - each - 90.0))] - each) for each in steady]
    off = np.abs(np.array(spacings) - 90.0)
    return [
        Value(
            name="spacing of what is lost in the turn",
            ours=float(np.median(spacings)),
            paper="90",
            unit="s",
            definition=f"from one onset of masking of a satellite to that a turn later, median of {len(spacings)}",
            tolerance=2.0,
            why="360° over the turn rate.",
        ),
        Claim(
            name="onsets are a turn apart",
            holds=bool(np.mean(off <= 2.0) > 0.95),
            paper_text="warnings at 674, 764 and 854 s",
            ours_text=f"{100.0 * np.mean(off <= 2.0):.0f} % within 2 s of 90 s",
            definition="onsets between 620 and 780 s against the nearest one 90 s later",
            why="Satellites near the limit are lost in some turns only, for they move.",
        ),
    ]


def _path_picture() -> Picture:
    flown = _flown()
    turn = _within(_TURN_S)
    lat, lon, height = geodetic_from_ecef(flown.path.position_m[turn])
    east = 6.378e6 * np.cos(lat[0]) * (lon - lon[0]) / 1e3
    north = 6.378e6 * (lat - lat[0]) / 1e3
    figure = new_figure(1, 2)
    plan, profile = figure.axes
    plan.plot(east, north)
    plan.set_aspect("equal")
    plan.set_xlabel("east [km]")
    plan.set_ylabel("north [km]")
    profile.plot(flown.since_s[turn], height)
    profile.set_xlabel("time [s]")
    profile.set_ylabel("height [m]")
    return Picture(
        name="fig-8",
        title="Figure 8: turning descent",
        caption="Simulated, by the equations of motion of a fighter.",
        figure=figure,
        data={"time_s": flown.since_s[turn], "east_km": east, "north_km": north, "height_m": height},
    )


def _count_picture() -> Picture:
    flown = _flown()
    counts = {
        "GPS": (flown.seen.in_view & IS_GPS).sum(axis=1),
        "Galileo": (flown.seen.in_view & ~IS_GPS).sum(axis=1),
        "both": flown.seen.in_view.sum(axis=1),
    }
    return _over_time("fig-9", "Figure 9: satellites in view", "satellites", counts)


def _cn0_picture() -> Picture:
    flown = _flown()
    up = antenna_elevation_rad(flown.seen.body_azimuth_rad, flown.seen.body_elevation_rad)
    budget = TransmitBudget().terms(flown.seen.elevation_rad, up, flown.seen.range_m)
    cn0 = np.where(flown.seen.in_view, budget.cn0_dbhz[:, L1], np.nan)
    chosen = _fading_most(cn0)
    return _over_time("fig-12", f"Figure 12: C/N0 of {SAT_IDS[chosen]}", "C/N0 [dB-Hz]", {"cn0_dbhz": cn0[:, chosen]})


def _fading_most(cn0_dbhz: FloatArray) -> int:
    """The GPS satellite always in view in the turn whose C/N0 changes most."""
    turning = cn0_dbhz[_within(_TURN_S)]
    change = np.where(np.isfinite(turning).all(axis=0) & IS_GPS, np.ptp(np.nan_to_num(turning), axis=0), -1.0)
    return int(change.argmax())


def _ground_picture() -> Picture:
    flown = _flown()
    _, _, height = geodetic_from_ecef(flown.path.position_m)
    highest = int(np.nanargmax(np.where(IS_GPS, flown.seen.elevation_rad[_within(_TURN_S)].mean(axis=0), np.nan)))
    echo = ground_echo(height, flown.seen.elevation_rad[:, highest], ANTENNAS["fighter"])
    microseconds = echo.delay_m / 299.792458
    title = f"Figure 17: delay of the ground's echo of {SAT_IDS[highest]}"
    return _over_time("fig-17", title, "delay [µs]", {"delay_us": microseconds})


def _doppler_pictures() -> list[Picture]:
    flown = _flown()
    doppler = doppler_of_path(flown.ephemeris, flown.path, flown.velocity_mps)[:, L1]
    level = np.isfinite(doppler).all(axis=0) & IS_GPS & flown.seen.in_view[_within(_CRUISE_S)].all(axis=0)
    chosen = int(np.argmax(level))
    name = f"Doppler of {SAT_IDS[chosen]} on L1"
    return [
        _over_time("fig-18", f"Figure 18: {name}, straight and level", "Hz", {"hz": doppler[:, chosen]}, _CRUISE_S),
        _over_time("fig-19", f"Figure 19: {name}, turning descent", "Hz", {"hz": doppler[:, chosen]}, _TURN_S),
    ]


def _over_time(
    name: str, title: str, label: str, curves: dict[str, FloatArray], bounds_s: tuple[float, float] = _TURN_S
) -> Picture:
    flown, chosen = _flown(), _within(bounds_s)
    figure = new_figure()
    axis = figure.axes[0]
    for curve, values in curves.items():
        axis.plot(flown.since_s[chosen], values[chosen], label=curve)
    axis.set_xlabel("time [s]")
    axis.set_ylabel(label)
    if len(curves) > 1:
        axis.legend()
    data = {"time_s": flown.since_s[chosen]} | {
        curve: np.asarray(values[chosen], dtype=np.float64) for curve, values in curves.items()
    }
    return Picture(name=name, title=title, caption="Simulated flight and constellation.", figure=figure, data=data)
