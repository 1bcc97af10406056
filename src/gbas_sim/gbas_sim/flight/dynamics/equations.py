"""Equations of motion: a point with mass, flown without sideslip, over the ellipsoid.

State: airspeed V, climb angle gamma and heading psi of the motion through the air, mass m, latitude, longitude, height.
Controls: thrust, angle of attack (which makes the lift) and bank angle mu.

    m dV/dt           = T cos alpha - D - m g sin gamma                  (4)
    m V dgamma/dt     = (T sin alpha + L) cos mu - m g cos gamma         (5)
    m V dpsi/dt       = (T sin alpha + L) sin mu / cos gamma             (6)
    dm/dt             = -c(V, h) T                                       (7)
    dlat/dt           = V cos gamma cos psi / (r_M + h)                  (8)
    dlon/dt           = V cos gamma sin psi / ((r_T + h) cos lat)        (9)
    dh/dt             = V sin gamma                                     (10)

The paper prints one letter for bank angle and latitude, ``cos(cos psi)`` in (8) and no steady wind. Here (8) to (10)
have the velocity over the ground, which is that through the air plus the wind. Two accelerations are added to (4) to
(6): what a change of wind with height does to the motion through it, and, unless switched off, what the Earth's turning
and its curvature do (:func:`gbas_sim.flight.dynamics.earth.turning_acceleration`).

Source: papers/abia.txt, equations (4) to (10).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.atmosphere import Air, standard_air
from gbas_sim.flight.dynamics.earth import gravity_mps2, radii_of_curvature_m, turning_acceleration
from gbas_sim.flight.dynamics.wind import Wind

Vector = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Forces:
    """Forces on an aircraft, arrays (...) [N].

    Attributes
    ----------
    lift_n, drag_n, thrust_n, pull_n : (...) arrays
        The drag includes the air brakes'; the pull is thrust less that part of it.
    along_n, normal_n : (...) arrays
        T cos alpha - D, and T sin alpha + L.
    """

    lift_n: FloatArray
    drag_n: FloatArray
    thrust_n: FloatArray
    pull_n: FloatArray
    along_n: FloatArray
    normal_n: FloatArray


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What the aircraft moves in.

    Attributes
    ----------
    wind : Wind
    turning_earth : bool
        False leaves out the Earth's turning and curvature, as the paper does.
    """

    wind: Wind = Wind()
    turning_earth: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """What there is where the aircraft is, for given velocities through the air; arrays (...).

    Attributes
    ----------
    air : Air
    gravity_mps2 : (...) array
    radii_m : pair of (...) arrays
        In the meridian and across it.
    cos_lat : (...) array
    ground_mps : three (...) arrays
        East, north and up component of the velocity over the ground.
    turning_mps2 : three (...) arrays
        East, north and up component of what the Earth's turning does to it.
    apparent_mps2 : three (...) arrays
        The same of the velocity through the air: less the change of the wind that the aircraft meets.
    """

    air: Air
    gravity_mps2: FloatArray
    radii_m: tuple[FloatArray, FloatArray]
    cos_lat: FloatArray
    ground_mps: Vector
    turning_mps2: Vector
    apparent_mps2: Vector


def forces(
    aircraft: Aircraft,
    air: Air,
    airspeed_mps: FloatArray,
    alpha_rad: FloatArray,
    pull_n: FloatArray,
    landing: FloatArray,
) -> Forces:
    """Lift, drag and thrust.

    Parameters
    ----------
    aircraft : Aircraft
    air : Air
    airspeed_mps, alpha_rad : (...) arrays
    pull_n : (...) array
        Thrust less the air brakes' drag [N]: below the thrust of idling engines these idle and the brakes are out.
    landing : (...) array
        How far the landing configuration is out, 0 to 1.
    """
    dynamic_n = aircraft.dynamic_force_n(airspeed_mps, air)
    coefficient = aircraft.lift_coefficient(alpha_rad, landing)
    thrust_n = np.maximum(pull_n, aircraft.pull_bounds_n(airspeed_mps, air)[2])
    lift_n = dynamic_n * coefficient
    drag_n = dynamic_n * aircraft.drag_coefficient(coefficient, landing) + (thrust_n - pull_n)
    return Forces(
        lift_n=lift_n,
        drag_n=drag_n,
        thrust_n=thrust_n,
        pull_n=pull_n,
        along_n=thrust_n * np.cos(alpha_rad) - drag_n,
        normal_n=thrust_n * np.sin(alpha_rad) + lift_n,
    )


def air_velocity(airspeed_mps: FloatArray, climb_rad: FloatArray, heading_rad: FloatArray) -> Vector:
    """East, north and up component of the velocity through the air [m/s]."""
    level = airspeed_mps * np.cos(climb_rad)
    return level * np.sin(heading_rad), level * np.cos(heading_rad), airspeed_mps * np.sin(climb_rad)


def place(surroundings: Surroundings, lat_rad: FloatArray, height_m: FloatArray, through_air_mps: Vector) -> Place:
    """Air, gravity, wind and Earth at latitudes and heights (...), see :class:`Place`."""
    wind_mps, gradient_ps = surroundings.wind.at(height_m)
    east, north, up = through_air_mps
    ground = (east + wind_mps[..., 0], north + wind_mps[..., 1], up)
    still = np.zeros_like(up)
    turning: Vector = (still, still, still)
    if surroundings.turning_earth:
        turning = turning_acceleration(lat_rad, height_m, *ground)
    return Place(
        air=standard_air(height_m),
        gravity_mps2=gravity_mps2(lat_rad, height_m),
        radii_m=radii_of_curvature_m(lat_rad),
        cos_lat=np.cos(lat_rad),
        ground_mps=ground,
        turning_mps2=turning,
        apparent_mps2=(turning[0] - gradient_ps[..., 0] * up, turning[1] - gradient_ps[..., 1] * up, turning[2]),
    )


def along_path(vector: Vector, climb_rad: FloatArray, heading_rad: FloatArray) -> Vector:
    """Components of an east, north, up vector along a motion, to its right, and at right angles above it."""
    east, north, up = vector
    sin_climb, cos_climb = np.sin(climb_rad), np.cos(climb_rad)
    sin_heading, cos_heading = np.sin(heading_rad), np.cos(heading_rad)
    level = east * sin_heading + north * cos_heading
    right = east * cos_heading - north * sin_heading
    return level * cos_climb + up * sin_climb, right, up * cos_climb - level * sin_climb


def path_rates(
    airspeed_mps: FloatArray,
    climb_rad: FloatArray,
    heading_rad: FloatArray,
    force_mps2: Vector,
    where: Place,
) -> Vector:
    """Rates of airspeed [m/s2], climb angle and heading [rad/s]: equations (4) to (6).

    Parameters
    ----------
    airspeed_mps, climb_rad, heading_rad : (...) arrays
    force_mps2 : three (...) arrays
        Thrust and aerodynamic force per mass: along the motion through the air, to the right, and above.
    where : Place
    """
    along, right, above = along_path(where.apparent_mps2, climb_rad, heading_rad)
    gravity = where.gravity_mps2
    return (
        force_mps2[0] - gravity * np.sin(climb_rad) + along,
        (force_mps2[2] - gravity * np.cos(climb_rad) + above) / airspeed_mps,
        (force_mps2[1] + right) / (airspeed_mps * np.cos(climb_rad)),
    )


def position_rates(where: Place, height_m: FloatArray) -> Vector:
    """Rates of latitude and longitude [rad/s] and of height [m/s]: equations (8) to (10)."""
    east, north, up = where.ground_mps
    meridian, transverse = where.radii_m
    return north / (meridian + height_m), east / ((transverse + height_m) * where.cos_lat), up
