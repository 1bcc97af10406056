"""What an aircraft is to its equations of motion: mass, lift and drag, thrust and fuel, limits and how fast it answers.

Lift is a straight line in the angle of attack, drag a parabola in lift (C_D = C_D0 + k C_L^2), both blended linearly
between a clean and a landing configuration. A jet's thrust falls with density and Mach number and its specific fuel
consumption grows with Mach number and temperature; a propeller turns the power of a piston engine into thrust.

Source of the forms: Mattingly, Heiser and Pratt, Aircraft Engine Design, 2nd edition (2002), 2.3.2 and 3.3.2 (jets);
Anderson, Aircraft Performance and Design (1999), chapters 2 and 3 (polar, propellers).
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.atmosphere import SEA_LEVEL_DENSITY_KGPM3, SEA_LEVEL_TEMPERATURE_K, Air


@parameters
class Polar:
    """Lift and drag of one configuration: C_D = C_D0 + k C_L^2."""

    lift_zero: Annotated[float, Parameter("lift coefficient at zero angle of attack of the fuselage", "-", -1.0, 2.0)]
    lift_slope_prad: Annotated[float, Parameter("its slope", "1/rad", 1.0, 8.0)]
    lift_max: Annotated[float, Parameter("largest lift coefficient", "-", 0.3, 5.0)]
    drag_zero: Annotated[float, Parameter("C_D0", "-", 0.005, 0.5)]
    drag_induced: Annotated[float, Parameter("k", "-", 0.005, 0.5)]

    def __post_init__(self) -> None:
        if self.lift_max <= self.lift_zero:
            raise ValueError(f"aircraft: polar: lift_max = {self.lift_max!r} is not above lift_zero")


@parameters
class Jet:
    """Turbojet or turbofan, all engines together.

    Thrust has the factor 1 + a M + b M^2 and (density ratio)^n; specific fuel consumption is (c0 + c1 M)
    sqrt(temperature ratio).
    """

    thrust_n: Annotated[float, Parameter("static thrust at sea level, without reheat", "N", 1.0, 3.0e6)]
    mach_linear: Annotated[float, Parameter("a", "-", -2.0, 2.0)] = 0.0
    mach_square: Annotated[float, Parameter("b", "-", -2.0, 2.0)] = 0.0
    density_exponent: Annotated[float, Parameter("n", "-", 0.0, 2.0)] = 1.0
    idle: Annotated[float, Parameter("share of the largest thrust that is left when idling", "-", 0.0, 0.5)] = 0.07
    consumption_kgpns: Annotated[float, Parameter("c0, static at sea level", "kg/(N s)", 0.0, 2.0e-4)]
    consumption_mach_kgpns: Annotated[float, Parameter("c1", "kg/(N s)", 0.0, 2.0e-4)] = 0.0

    def largest_thrust_n(self, airspeed_mps: FloatArray, air: Air) -> FloatArray:
        """Largest thrust (...) [N] at airspeeds (...) [m/s]."""
        mach = airspeed_mps / air.sound_mps
        at_speed = 1.0 + mach * (self.mach_linear + mach * self.mach_square)
        result: FloatArray = (
            self.thrust_n * at_speed * (air.density_kgpm3 / SEA_LEVEL_DENSITY_KGPM3) ** self.density_exponent
        )
        return result

    def consumption(self, airspeed_mps: FloatArray, air: Air) -> FloatArray:
        """Fuel flow per thrust, c of the paper's equation (7), (...) [kg/(N s)]."""
        mach = airspeed_mps / air.sound_mps
        result: FloatArray = (self.consumption_kgpns + self.consumption_mach_kgpns * mach) * np.sqrt(
            air.temperature_k / SEA_LEVEL_TEMPERATURE_K
        )
        return result


@parameters
class Propeller:
    """Piston engine and propeller."""

    power_w: Annotated[float, Parameter("shaft power at sea level; it goes with density", "W", 10.0, 1.0e7)]
    efficiency: Annotated[float, Parameter("of the propeller", "-", 0.1, 1.0)] = 0.7
    static_thrust_n: Annotated[float, Parameter("thrust standing still at sea level", "N", 1.0, 1.0e6)]
    idle: Annotated[float, Parameter("share of the largest thrust that is left when idling", "-", 0.0, 0.5)] = 0.0
    consumption_kgpj: Annotated[float, Parameter("fuel per shaft work", "kg/J", 0.0, 1.0e-6)]

    def largest_thrust_n(self, airspeed_mps: FloatArray, air: Air) -> FloatArray:
        """Largest thrust (...) [N]: power over speed, and the static thrust at none."""
        slowest_mps = self.efficiency * self.power_w / self.static_thrust_n
        ratio = air.density_kgpm3 / SEA_LEVEL_DENSITY_KGPM3
        result: FloatArray = self.efficiency * self.power_w * ratio / np.hypot(airspeed_mps, slowest_mps)
        return result

    def consumption(self, airspeed_mps: FloatArray, air: Air) -> FloatArray:
        """Fuel flow per thrust, c of the paper's equation (7), (...) [kg/(N s)]."""
        result: FloatArray = self.consumption_kgpj * airspeed_mps / self.efficiency
        return result


@parameters
class Response:
    """How fast the aircraft follows its guidance, and how firmly that holds it to the plan. Ours.

    Deviations from the plan decay with the natural frequencies, critically damped.
    """

    bank_s: Annotated[float, Parameter("time constant of the bank angle", "s", 0.05, 5.0)]
    roll_s: Annotated[float, Parameter("time constant of the roll rate", "s", 0.02, 2.0)]
    lift_s: Annotated[float, Parameter("time constant of the angle of attack", "s", 0.05, 5.0)]
    thrust_s: Annotated[float, Parameter("time constant of thrust", "s", 0.05, 10.0)]
    lateral_radps: Annotated[float, Parameter("natural frequency across the plan", "rad/s", 0.01)]
    vertical_radps: Annotated[float, Parameter("natural frequency above the plan", "rad/s", 0.01)]
    along_radps: Annotated[float, Parameter("natural frequency along the plan", "rad/s", 0.01)]

    def __post_init__(self) -> None:
        # Critically damped control through a lag t is stable up to 2/t; a quarter of that keeps it well damped.
        lags = {
            "lateral_radps": self.bank_s + self.roll_s,
            "vertical_radps": self.lift_s,
            "along_radps": self.thrust_s,
        }
        for key, lag in lags.items():
            if getattr(self, key) > 0.5 / lag:
                raise ValueError(
                    f"aircraft: response: {key} = {getattr(self, key)!r} is not within 0.01 to {0.5 / lag:g}"
                )


@parameters
class Limits:
    """What the aircraft is not flown beyond."""

    bank_rad: Annotated[float, Parameter("largest bank angle", "deg", 5.0, 85.0)]
    roll_rate_radps: Annotated[float, Parameter("largest roll rate", "deg/s", 1.0, 400.0)]
    load_factor_max: Annotated[float, Parameter("largest of the lift, in units of standard gravity", "g", 1.1, 12.0)]
    load_factor_min: Annotated[float, Parameter("smallest of the lift", "g", -6.0, 0.9)]
    mach: Annotated[float, Parameter("largest Mach number", "-", 0.05, 0.95)]
    height_m: Annotated[float, Parameter("greatest height", "m", 100.0, 20000.0)]


@parameters
class Aircraft:
    """An aircraft. Air brakes are out as far as the drag wanted is more than idling gives."""

    name: Annotated[str, Parameter("name of the aircraft")]
    mass_kg: Annotated[float, Parameter("at the start of the flight", "kg", 0.5, 6.0e5)]
    empty_mass_kg: Annotated[float, Parameter("without fuel", "kg", 0.1, 4.0e5)]
    wing_area_m2: Annotated[float, Parameter("reference area of the coefficients", "m^2", 0.05, 1000.0)]
    brake_drag: Annotated[float, Parameter("largest drag coefficient of the air brakes", "-", 0.0, 0.5)] = 0.0
    clean: Polar
    landing: Polar
    engine: Jet | Propeller
    response: Response
    limits: Limits

    def __post_init__(self) -> None:
        if self.mass_kg < self.empty_mass_kg:
            raise ValueError(
                f"aircraft: mass_kg = {self.mass_kg!r} is less than empty_mass_kg = {self.empty_mass_kg!r}"
            )

    def coefficient(self, name: str, landing: FloatArray) -> FloatArray:
        """A coefficient of the polar, by its attribute's name, `landing` (0 to 1) of the way from clean to landing."""
        clean: float = getattr(self.clean, name)
        result: FloatArray = clean + landing * (getattr(self.landing, name) - clean)
        return result

    def lift_coefficient(self, alpha_rad: FloatArray, landing: FloatArray) -> FloatArray:
        """Lift coefficient at angles of attack (...) [rad]."""
        slope = self.coefficient("lift_slope_prad", landing)
        result: FloatArray = self.coefficient("lift_zero", landing) + slope * alpha_rad
        return result

    def alpha_rad(self, lift_coefficient: FloatArray, landing: FloatArray) -> FloatArray:
        """Angle of attack [rad] for lift coefficients (...)."""
        slope = self.coefficient("lift_slope_prad", landing)
        result: FloatArray = (lift_coefficient - self.coefficient("lift_zero", landing)) / slope
        return result

    def drag_coefficient(self, lift_coefficient: FloatArray, landing: FloatArray) -> FloatArray:
        """Drag coefficient at lift coefficients (...)."""
        induced = self.coefficient("drag_induced", landing) * lift_coefficient**2
        result: FloatArray = self.coefficient("drag_zero", landing) + induced
        return result

    def pull_bounds_n(self, airspeed_mps: FloatArray, air: Air) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Least and largest pull, thrust less the air brakes' drag, and the thrust of idling engines, (...) [N]."""
        largest = self.engine.largest_thrust_n(airspeed_mps, air)
        idle = self.engine.idle * largest
        return idle - self.brake_drag * self.dynamic_force_n(airspeed_mps, air), largest, idle

    def dynamic_force_n(self, airspeed_mps: FloatArray, air: Air) -> FloatArray:
        """Dynamic pressure times wing area [N]: what coefficients are multiplied with."""
        result: FloatArray = 0.5 * air.density_kgpm3 * airspeed_mps**2 * self.wing_area_m2
        return result
