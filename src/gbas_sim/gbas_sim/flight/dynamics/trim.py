"""What the plan asks of the aircraft: attitude, thrust and fuel along it, and whether the aircraft can do it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.atmosphere import STANDARD_GRAVITY_MPS2, standard_air
from gbas_sim.flight.dynamics.equations import Place, Surroundings, Vector, along_path, forces, place
from gbas_sim.flight.dynamics.reference import Reference

_ALPHA_ITERATIONS: Final = 12
_MASS_ITERATIONS: Final = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Trim:
    """The aircraft along its plan, arrays (n,) at the reference's times.

    Attributes
    ----------
    airspeed_mps, climb_rad, heading_rad : (n,) arrays
        Motion through the air; the heading is not wrapped.
    mass_kg, bank_rad, alpha_rad, pull_n : (n,) arrays
        The pull is thrust less the drag of the air brakes.
    force_mps2 : three (n,) arrays
        Force per mass without gravity: along the motion through the air, to the right, above.
    """

    airspeed_mps: FloatArray
    climb_rad: FloatArray
    heading_rad: FloatArray
    mass_kg: FloatArray
    bank_rad: FloatArray
    alpha_rad: FloatArray
    pull_n: FloatArray
    force_mps2: Vector


def trim(reference: Reference, aircraft: Aircraft, surroundings: Surroundings) -> Trim:
    """Controls that make an aircraft follow its plan.

    The mass is what remains after the fuel burnt so far, which depends on the thrust, which depends on the mass: a
    fixed number of substitutions settles it far below a gram.
    """
    path = reference.path
    wind_mps, _ = surroundings.wind.at(path.height_m)
    east, north = path.ground_enu_mps[:, 0] - wind_mps[:, 0], path.ground_enu_mps[:, 1] - wind_mps[:, 1]
    up = path.ground_enu_mps[:, 2]
    airspeed = np.sqrt(east**2 + north**2 + up**2)
    climb, heading = np.arcsin(up / airspeed), np.unwrap(np.arctan2(east, north))
    where = place(surroundings, path.lat_rad, path.height_m, (east, north, up))
    rate = reference.ground_rate_mps2
    force = required_force((rate[:, 0], rate[:, 1], rate[:, 2]), where, climb, heading)
    mass = np.full_like(airspeed, aircraft.mass_kg)
    for _ in range(_MASS_ITERATIONS):
        alpha, pull = controls(aircraft, where, airspeed, mass, force, path.landing)
        thrust = np.maximum(pull, aircraft.pull_bounds_n(airspeed, where.air)[2])
        burn = aircraft.engine.consumption(airspeed, where.air) * thrust
        mass = aircraft.mass_kg - CubicSpline(reference.time_s, burn).antiderivative()(reference.time_s)
    return Trim(
        airspeed_mps=airspeed,
        climb_rad=climb,
        heading_rad=heading,
        mass_kg=mass,
        bank_rad=np.arctan2(force[1], force[2]),
        alpha_rad=alpha,
        pull_n=pull,
        force_mps2=force,
    )


def required_force(ground_rate_mps2: Vector, where: Place, climb_rad: FloatArray, heading_rad: FloatArray) -> Vector:
    """Force per mass, without gravity, that gives the velocity over the ground a rate.

    Parameters
    ----------
    ground_rate_mps2 : three (...) arrays
        Rates of its east, north and up components [m/s2].
    where : Place
    climb_rad, heading_rad : (...) arrays
        Motion through the air.

    Returns
    -------
    three (...) arrays
        Along the motion through the air, to the right, above [m/s2].
    """
    east, north, up = (rate - turning for rate, turning in zip(ground_rate_mps2, where.turning_mps2, strict=True))
    return along_path((east, north, up + where.gravity_mps2), climb_rad, heading_rad)


def controls(
    aircraft: Aircraft,
    where: Place,
    airspeed_mps: FloatArray,
    mass_kg: FloatArray,
    force_mps2: Vector,
    landing: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Angle of attack [rad] and pull (thrust less air brakes) [N] that make a force per mass, with any bank."""
    dynamic = aircraft.dynamic_force_n(airspeed_mps, where.air)
    normal = mass_kg * np.hypot(force_mps2[1], force_mps2[2])
    alpha = aircraft.alpha_rad(normal / dynamic, landing)
    pull = np.zeros_like(alpha)
    for _ in range(_ALPHA_ITERATIONS):
        made = forces(aircraft, where.air, airspeed_mps, alpha, pull, landing)
        # The pull changes the force along the path by cos(alpha) of itself, or by itself when it is the brakes'.
        pull = pull + mass_kg * force_mps2[0] - made.along_n
        alpha = aircraft.alpha_rad((normal - made.thrust_n * np.sin(alpha)) / dynamic, landing)
    return alpha, pull


def check(trimmed: Trim, reference: Reference, aircraft: Aircraft) -> None:
    """Check that the aircraft can fly its plan.

    Raises
    ------
    ValueError
        Naming the first quantity that is out of bounds, its value there, the bound, the manoeuvre and the time.
    """
    for quantity, values, low, high in _demands(trimmed, reference, aircraft):
        outside = np.maximum(values - high, low - values)
        if np.all(outside <= 0.0):
            continue
        worst = int(np.argmax(outside))
        seconds = float(reference.time_s[worst])
        number = reference.phase_at(seconds)
        bounds = [float(np.broadcast_to(bound, values.shape)[worst]) for bound in (low, high)]
        raise ValueError(
            f"segment {number + 1} ({reference.phases[number].kind}), {seconds:.0f} s after the start: {quantity} ="
            f" {values[worst]:.4g} is not within {bounds[0]:.4g} to {bounds[1]:.4g} ({aircraft.name})"
        )


Demand = tuple[str, FloatArray, FloatArray, FloatArray]


def _demands(trimmed: Trim, reference: Reference, aircraft: Aircraft) -> Iterator[Demand]:
    """Name, values, least and largest of all that is limited, in the units of messages."""
    limits, path = aircraft.limits, reference.path
    air = standard_air(path.height_m)
    one = np.ones(())
    least_n, largest_n, _ = aircraft.pull_bounds_n(trimmed.airspeed_mps, air)
    lift = aircraft.lift_coefficient(trimmed.alpha_rad, path.landing)
    load = np.hypot(trimmed.force_mps2[1], trimmed.force_mps2[2]) / STANDARD_GRAVITY_MPS2
    bank_deg = np.degrees(trimmed.bank_rad)
    roll_degps = CubicSpline(reference.time_s, bank_deg)(reference.time_s, 1)
    largest_deg, largest_degps = math.degrees(limits.bank_rad), math.degrees(limits.roll_rate_radps)
    yield "height_m", path.height_m, -500.0 * one, limits.height_m * one
    yield "mach", trimmed.airspeed_mps / air.sound_mps, 0.0 * one, limits.mach * one
    yield "lift coefficient", lift, -one, aircraft.coefficient("lift_max", path.landing)
    yield "load factor", load, limits.load_factor_min * one, limits.load_factor_max * one
    yield "bank [deg]", bank_deg, -largest_deg * one, largest_deg * one
    yield "roll rate [deg/s]", roll_degps, -largest_degps * one, largest_degps * one
    yield "thrust less air brakes [N]", trimmed.pull_n, least_n, largest_n
    yield "mass_kg", trimmed.mass_kg, aircraft.empty_mass_kg * one, aircraft.mass_kg * one
