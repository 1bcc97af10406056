"""Guidance: from where the aircraft is and where the plan has it now, to bank, angle of attack and pull.

The plan's acceleration, and a share of the deviation from it in place and speed, make a wanted acceleration; gravity,
the Earth's turning and the aircraft's own drag are taken off, and what is left is thrust along the path and lift across
it. The aircraft answers late: each control leads by its lag times the rate it has in the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np
from scipy.interpolate import CubicSpline

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.aircraft import Aircraft, Response
from gbas_sim.flight.dynamics.atmosphere import STANDARD_GRAVITY_MPS2
from gbas_sim.flight.dynamics.equations import Forces, Place, Vector
from gbas_sim.flight.dynamics.reference import Reference
from gbas_sim.flight.dynamics.smooth import SmoothTable
from gbas_sim.flight.dynamics.trim import Trim, required_force

# Most that deviations may ask for: along, to the right, up [m/s2]. Ours.
_FIRMEST_MPS2: Final = (1.0, 3.0, 2.0)

# Columns of the table that guidance looks the plan up in.
_LAT, _LON, _HEIGHT, _LANDING = range(4)
_GROUND, _RATE, _LEAD = slice(4, 7), slice(7, 10), slice(10, 13)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wanted:
    """The plan at one instant, or at instants (...).

    Attributes
    ----------
    lat_rad, lon_rad, height_m : (...) arrays
        Latitude and longitude from those at the start of the flight.
    ground_mps : three (...) arrays
        Velocity over the ground, east, north, up.
    ground_rate_mps2 : three (...) arrays
        Rates of these.
    lead : three (...) arrays
        What is added to bank, angle of attack and pull because they answer late.
    landing : (...) array
        How far the landing configuration is out.
    """

    lat_rad: FloatArray
    lon_rad: FloatArray
    height_m: FloatArray
    ground_mps: Vector
    ground_rate_mps2: Vector
    lead: Vector
    landing: FloatArray

    @classmethod
    def of(cls, columns: FloatArray) -> Self:
        """From the table's columns, (n_columns, ...)."""
        return cls(
            lat_rad=columns[_LAT],
            lon_rad=columns[_LON],
            height_m=columns[_HEIGHT],
            ground_mps=_three(columns[_GROUND]),
            ground_rate_mps2=_three(columns[_RATE]),
            lead=_three(columns[_LEAD]),
            landing=columns[_LANDING],
        )


def _three(columns: FloatArray) -> Vector:
    return columns[0], columns[1], columns[2]


def wanted_table(reference: Reference, trimmed: Trim, response: Response) -> SmoothTable:
    """Table of :class:`Wanted` over time."""
    time, path = reference.time_s, reference.path
    lags_s = (response.bank_s + response.roll_s, response.lift_s, response.thrust_s)
    lead = [
        lag * CubicSpline(time, control)(time, 1)
        for lag, control in zip(lags_s, (trimmed.bank_rad, trimmed.alpha_rad, trimmed.pull_n), strict=True)
    ]
    columns = [path.lat_rad - path.lat_rad[0], path.lon_rad - path.lon_rad[0], path.height_m, path.landing]
    columns += [*path.ground_enu_mps.T, *reference.ground_rate_mps2.T, *lead]
    values = np.stack(columns, axis=-1)
    return SmoothTable.make(time, values, CubicSpline(time, values)(time, 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """What guidance asks for, arrays (...).

    Attributes
    ----------
    bank_rad, alpha_rad, pull_n : (...) arrays
    """

    bank_rad: FloatArray
    alpha_rad: FloatArray
    pull_n: FloatArray


def wanted_acceleration(
    wanted: Wanted, moved_rad: tuple[FloatArray, FloatArray], height_m: FloatArray, where: Place, response: Response
) -> Vector:
    """Acceleration over the ground that leads back to the plan: east, north, up [m/s2].

    Parameters
    ----------
    wanted : Wanted
    moved_rad : pair of (...) arrays
        Latitude and longitude from those at the start of the flight.
    height_m : (...) array
    where : Place
    response : Response
    """
    east, north, up = wanted.ground_mps
    level = np.hypot(east, north)
    to_east, to_north = east / level, north / level
    meridian, transverse = where.radii_m
    off_north = (wanted.lat_rad - moved_rad[0]) * (meridian + height_m)
    off_east = (wanted.lon_rad - moved_rad[1]) * (transverse + height_m) * where.cos_lat
    late_east, late_north, late_up = east - where.ground_mps[0], north - where.ground_mps[1], up - where.ground_mps[2]
    offs = (off_east * to_east + off_north * to_north, off_east * to_north - off_north * to_east)
    lates = (late_east * to_east + late_north * to_north, late_east * to_north - late_north * to_east)
    along, right, rise = (
        firmest * np.tanh((frequency**2 * off + 2.0 * frequency * late) / firmest)
        for firmest, frequency, off, late in (
            (_FIRMEST_MPS2[0], response.along_radps, offs[0], lates[0]),
            (_FIRMEST_MPS2[1], response.lateral_radps, offs[1], lates[1]),
            (_FIRMEST_MPS2[2], response.vertical_radps, wanted.height_m - height_m, late_up),
        )
    )
    rate_east, rate_north, rate_up = wanted.ground_rate_mps2
    return (
        rate_east + along * to_east + right * to_north,
        rate_north + along * to_north - right * to_east,
        rate_up + rise,
    )


class AirState(NamedTuple):
    """How the aircraft flies now, ``(...)`` arrays: motion through the air [m/s], [rad], attitude [rad], mass [kg]."""

    airspeed_mps: FloatArray
    climb_rad: FloatArray
    heading_rad: FloatArray
    bank_rad: FloatArray
    alpha_rad: FloatArray
    mass_kg: FloatArray


def command(
    aircraft: Aircraft,
    where: Place,
    made: Forces,
    acceleration_mps2: Vector,
    flown: AirState,
    wanted: Wanted,
) -> Command:
    """Controls for an acceleration over the ground, within the aircraft's limits.

    Parameters
    ----------
    aircraft : Aircraft
    where : Place
    made : Forces
        Those that act now.
    acceleration_mps2 : three (...) arrays
        Wanted, east, north, up.
    flown : AirState
    wanted : Wanted
    """
    limits, bank, alpha, mass_kg = aircraft.limits, flown.bank_rad, flown.alpha_rad, flown.mass_kg
    along, right, above = required_force(acceleration_mps2, where, flown.climb_rad, flown.heading_rad)
    # The lift is made for the bank there is: while rolling it must not push up or down.
    normal = np.minimum(
        np.maximum(above * np.cos(bank) + right * np.sin(bank), limits.load_factor_min * STANDARD_GRAVITY_MPS2),
        limits.load_factor_max * STANDARD_GRAVITY_MPS2,
    )
    dynamic = aircraft.dynamic_force_n(flown.airspeed_mps, where.air)
    lift = (mass_kg * normal - made.thrust_n * np.sin(alpha)) / dynamic
    alpha_wanted = aircraft.alpha_rad(lift, wanted.landing) + wanted.lead[1]
    alpha_most = aircraft.alpha_rad(aircraft.coefficient("lift_max", wanted.landing), wanted.landing)
    bank_wanted = np.arctan2(right, above) + wanted.lead[0]
    least, largest, _ = aircraft.pull_bounds_n(flown.airspeed_mps, where.air)
    pull = mass_kg * along + made.drag_n - made.thrust_n * np.cos(alpha) + made.pull_n + wanted.lead[2]
    return Command(
        bank_rad=np.minimum(np.maximum(bank_wanted, -limits.bank_rad), limits.bank_rad),
        alpha_rad=np.minimum(alpha_wanted, alpha_most),
        pull_n=np.minimum(np.maximum(pull, least), largest),
    )
