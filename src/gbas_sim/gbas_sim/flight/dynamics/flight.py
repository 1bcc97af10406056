"""A flight: the plan, flown.

The equations are integrated once, when a flight is first asked where it is, and kept as a table of smooth functions of
time: every later question is a look-up, a function of the parameters and the time alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from gbas_core.gnss.attitude import body_rates, euler_angles, rot_body_enu
from gbas_core.gnss.frames import ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.equations import Surroundings
from gbas_sim.flight.dynamics.motion import Flown, Model, State, fly
from gbas_sim.flight.dynamics.plan import FlightPlan
from gbas_sim.flight.dynamics.reference import Phase, Reference, lay_out
from gbas_sim.flight.dynamics.smooth import SmoothTable
from gbas_sim.flight.dynamics.trim import Trim, check, trim
from gbas_sim.flight.dynamics.wind import Wind

_FARTHEST_OFF_M: Final = 1000.0
# Columns of a flight's table: position first, then these.
_AIRSPEED, _CLIMB, _HEADING, _MASS, _BANK, _ALPHA, _PULL, _LANDING = range(3, 11)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightState:
    """The aircraft at instants (T,).

    Attributes
    ----------
    time_s : (T,) array
        Since the start of the flight [s].
    position_ecef_m, velocity_ecef_mps, acceleration_ecef_mps2 : (T, 3) arrays
        Of the centre of gravity; each the exact derivative of the one before.
    roll_rad, pitch_rad, heading_rad : (T,) arrays
        Attitude: true heading from 0 to 2 pi, pitch, roll (positive right wing down), turned in that order from north,
        east, down.
    body_rates_radps : (T, 3) array
        Roll, pitch and yaw rate about forward, right and down, relative to the local axes [rad/s].
    rot_body_enu : (T, 3, 3) array
        Rotation from east, north, up to forward, right, down.
    airspeed_mps, climb_rad, track_through_air_rad : (T,) arrays
        Motion through the air: speed, climb angle, heading (not wrapped).
    bank_rad, alpha_rad : (T,) arrays
        Bank of the lift about the motion through the air, and angle of attack.
    mass_kg : (T,) array
    pull_n : (T,) array
        Thrust less the drag of the air brakes [N].
    landing : (T,) array
        How far the landing configuration is out, 0 to 1.
    """

    time_s: FloatArray
    position_ecef_m: FloatArray
    velocity_ecef_mps: FloatArray
    acceleration_ecef_mps2: FloatArray
    roll_rad: FloatArray
    pitch_rad: FloatArray
    heading_rad: FloatArray
    body_rates_radps: FloatArray
    rot_body_enu: FloatArray
    airspeed_mps: FloatArray
    climb_rad: FloatArray
    track_through_air_rad: FloatArray
    bank_rad: FloatArray
    alpha_rad: FloatArray
    mass_kg: FloatArray
    pull_n: FloatArray
    landing: FloatArray


@dataclass(frozen=True, kw_only=True)
class Flight:
    """An aircraft flying a plan.

    Attributes
    ----------
    plan : FlightPlan
    aircraft : Aircraft
    wind : Wind
        As it is.
    planned_wind : Wind, optional
        As the plan expects it; as it is, when left out. The plan is kept in time as well as in place: wind that is not
        expected is made up for with airspeed.
    turning_earth : bool
        False leaves out the Earth's turning and curvature, as the paper's equations do.
    """

    plan: FlightPlan
    aircraft: Aircraft
    wind: Wind = Wind()
    planned_wind: Wind | None = None
    turning_earth: bool = True

    @cached_property
    def _planned(self) -> _Planned:
        return _planned(self)

    @cached_property
    def _tables(self) -> _Tables:
        return _tables(self)

    @property
    def duration_s(self) -> float:
        """From the start to the end of the plan [s], rounded to a nanosecond: durations asked for are met exactly."""
        return round(float(self._planned.reference.time_s[-1]), 9)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """Manoeuvres with their times."""
        return self._planned.reference.phases

    def check(self) -> None:
        """Lay the plan out without flying it.

        Raises
        ------
        ValueError
            When it cannot be laid out or is more than the aircraft can do, naming manoeuvre, quantity, value and bound.
        """
        self._planned  # noqa: B018  # raises

    def state(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Position and velocity.

        Parameters
        ----------
        since_start_s : (...) array
            Time since the start of the flight [s]; before the start and after the end the motion goes on in a straight
            line.

        Returns
        -------
        position_m, velocity_mps : (..., 3) arrays
            ECEF [m], [m/s]; the velocity is the exact derivative of the position.
        """
        place, velocity, _ = self._tables.position.derivatives(np.asarray(since_start_s, dtype=np.float64))
        return place + self._tables.origin_m, velocity

    def antenna_axis(self, since_start_s: ArrayLike) -> FloatArray:
        """Where an antenna on the roof points, unit vectors ``(..., 3)``, ECEF, at times since the start ``(...)``."""
        value, _, _ = self._tables.flown.derivatives(np.asarray(since_start_s, dtype=np.float64))
        latitude, longitude, _ = geodetic_from_ecef(value[..., :3] + self._tables.origin_m)
        climb, heading, bank, alpha = (value[..., column] for column in (_CLIMB, _HEADING, _BANK, _ALPHA))
        down_enu = rot_body_enu(climb, heading, bank, alpha)[..., 2, :]
        return np.asarray(-np.einsum("...ji,...j->...i", rot_enu_ecef(latitude, longitude), down_enu))

    def attitude(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Roll, pitch and true heading (0 to 2 pi) at times since the start ``(...)`` [rad]."""
        value, _, _ = self._tables.flown.derivatives(np.asarray(since_start_s, dtype=np.float64))
        return euler_angles(rot_body_enu(*(value[..., column] for column in (_CLIMB, _HEADING, _BANK, _ALPHA))))

    def flight_state(self, since_start_s: ArrayLike) -> FlightState:
        """All there is to know of the aircraft at times (T,) since the start of the flight [s]."""
        return _state(self._tables.origin_m, self._tables.flown, since_start_s)

    def planned_state(self, since_start_s: ArrayLike) -> FlightState:
        """The same as planned: what is known ahead of time."""
        return _state(self._tables.origin_m, self._tables.planned, since_start_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Planned:
    """A plan laid out, and the controls it takes."""

    reference: Reference
    trimmed: Trim


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tables:
    """What a flight looks up: positions are from the origin, so that rounding is of the distance flown."""

    origin_m: FloatArray
    position: SmoothTable
    flown: SmoothTable
    planned: SmoothTable


@lru_cache(maxsize=4)
def _planned(flight: Flight) -> _Planned:
    """Lay out and check a flight; equal flights are laid out once."""
    wind = flight.wind if flight.planned_wind is None else flight.planned_wind
    try:
        reference = lay_out(flight.plan, wind)
        trimmed = trim(reference, flight.aircraft, Surroundings(wind=wind, turning_earth=flight.turning_earth))
        check(trimmed, reference, flight.aircraft)
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None
    return _Planned(reference=reference, trimmed=trimmed)


@lru_cache(maxsize=4)
def _tables(flight: Flight) -> _Tables:
    """Fly a flight; equal flights are flown once."""
    planned = _planned(flight)
    reference, path = planned.reference, planned.reference.path
    surroundings = Surroundings(wind=flight.wind, turning_earth=flight.turning_earth)
    origin = ecef_from_geodetic(path.lat_rad[0], path.lon_rad[0], path.height_m[0])
    try:
        flown = fly(Model(aircraft=flight.aircraft, surroundings=surroundings, reference=reference), planned.trimmed)
        flown_table = _flown_table(flown, reference, origin)
        planned_table = _planned_table(reference, planned.trimmed, origin)
        _check_tracking(flown_table, planned_table, reference)
    except ValueError as error:
        raise ValueError(f"flight: {error}") from None
    position = SmoothTable(
        start=flown_table.start, spacing=flown_table.spacing, coefficients=flown_table.coefficients[..., :3].copy()
    )
    return _Tables(origin_m=origin, position=position, flown=flown_table, planned=planned_table)


def _flown_table(flown: Flown, reference: Reference, origin_m: FloatArray) -> SmoothTable:
    path, states = reference.path, flown.states
    lat, lon = path.lat_rad[0] + states[State.LATITUDE], path.lon_rad[0] + states[State.LONGITUDE]
    place, velocity = _in_ecef(lat, lon, states[State.HEIGHT], flown.ground_enu_mps)
    rows = [State.AIRSPEED, State.CLIMB, State.HEADING, State.MASS, State.BANK, State.ALPHA, State.PULL]
    values = np.concatenate([place - origin_m, states[rows].T, flown.landing[:, np.newaxis]], axis=-1)
    rates = np.concatenate([velocity, flown.rates[rows].T, flown.landing_rate[:, np.newaxis]], axis=-1)
    return SmoothTable.make(flown.time_s, values, rates)


def _planned_table(reference: Reference, trimmed: Trim, origin_m: FloatArray) -> SmoothTable:
    path, time = reference.path, reference.time_s
    place, velocity = _in_ecef(path.lat_rad, path.lon_rad, path.height_m, path.ground_enu_mps)
    motion = [trimmed.airspeed_mps, trimmed.climb_rad, trimmed.heading_rad, trimmed.mass_kg]
    columns = np.stack([*motion, trimmed.bank_rad, trimmed.alpha_rad, trimmed.pull_n, path.landing], axis=-1)
    values = np.concatenate([place - origin_m, columns], axis=-1)
    rates = np.concatenate([velocity, CubicSpline(time, columns)(time, 1)], axis=-1)
    return SmoothTable.make(time, values, rates)


def _in_ecef(
    lat_rad: FloatArray, lon_rad: FloatArray, height_m: FloatArray, enu: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """ECEF positions (n, 3) [m], and vectors (n, 3) given there in east, north and up, in ECEF axes."""
    turned = np.einsum("...ji,...j->...i", rot_enu_ecef(lat_rad, lon_rad), enu)
    return ecef_from_geodetic(lat_rad, lon_rad, height_m), turned


def _check_tracking(flown: SmoothTable, planned: SmoothTable, reference: Reference) -> None:
    """Raise ValueError when the aircraft has lost its plan."""
    off = (flown.derivatives(reference.time_s)[0] - planned.derivatives(reference.time_s)[0])[:, :3]
    distance = np.linalg.norm(off, axis=-1)
    lost = np.flatnonzero(~(distance <= _FARTHEST_OFF_M))
    if lost.size:
        seconds = float(reference.time_s[lost[0]])
        number = reference.phase_at(seconds)
        raise ValueError(
            f"segment {number + 1} ({reference.phases[number].kind}), {seconds:.0f} s after the start: the aircraft is"
            f" {distance[lost[0]]:.0f} m from its plan, more than {_FARTHEST_OFF_M:.0f} m"
        )


def _state(origin_m: FloatArray, table: SmoothTable, since_start_s: ArrayLike) -> FlightState:
    time = np.asarray(since_start_s, dtype=np.float64)
    value, rate, second = table.derivatives(time)
    climb, heading, bank, alpha = (value[..., column] for column in (_CLIMB, _HEADING, _BANK, _ALPHA))
    climbing, turning, banking, pitching = (rate[..., column] for column in (_CLIMB, _HEADING, _BANK, _ALPHA))
    rot = rot_body_enu(climb, heading, bank, alpha)
    roll, pitch, nose = euler_angles(rot)
    return FlightState(
        time_s=time,
        position_ecef_m=value[..., :3] + origin_m,
        velocity_ecef_mps=rate[..., :3],
        acceleration_ecef_mps2=second[..., :3],
        roll_rad=roll,
        pitch_rad=pitch,
        heading_rad=nose,
        body_rates_radps=body_rates((climb, bank, alpha), (climbing, turning, banking, pitching)),
        rot_body_enu=rot,
        airspeed_mps=value[..., _AIRSPEED],
        climb_rad=climb,
        track_through_air_rad=heading,
        bank_rad=bank,
        alpha_rad=alpha,
        mass_kg=value[..., _MASS],
        pull_n=value[..., _PULL],
        landing=value[..., _LANDING],
    )
