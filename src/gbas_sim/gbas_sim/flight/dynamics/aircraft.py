"""What an aircraft is to its equations of motion: mass, lift and drag, thrust and fuel, limits and how fast it answers.

Lift is a straight line in the angle of attack, drag a parabola in lift (C_D = C_D0 + k C_L^2), both blended linearly
between a clean and a landing configuration. A jet's thrust falls with density and Mach number and its specific fuel
consumption grows with Mach number and temperature; a propeller turns the power of a piston engine into thrust.

Source of the forms: Mattingly, Heiser and Pratt, Aircraft Engine Design, 2nd edition (2002), 2.3.2 and 3.3.2 (jets);
Anderson, Aircraft Performance and Design (1999), chapters 2 and 3 (polar, propellers).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.atmosphere import SEA_LEVEL_DENSITY_KGPM3, SEA_LEVEL_TEMPERATURE_K, Air
from gbas_sim.flight.dynamics.bounds import check_bounds


@dataclass(frozen=True, kw_only=True)
class Polar:
    """Lift and drag of one configuration.

    Attributes
    ----------
    lift_zero : float
        Lift coefficient at zero angle of attack of the fuselage.
    lift_slope_prad : float
        Its slope [1/rad].
    lift_max : float
        Largest lift coefficient.
    drag_zero, drag_induced : float
        C_D0 and k of C_D = C_D0 + k C_L^2.
    """

    lift_zero: float
    lift_slope_prad: float
    lift_max: float
    drag_zero: float
    drag_induced: float

    def __post_init__(self) -> None:
        bounds = {
            "lift_zero": (-1.0, 2.0),
            "lift_slope_prad": (1.0, 8.0),
            "lift_max": (0.3, 5.0),
            "drag_zero": (0.005, 0.5),
            "drag_induced": (0.005, 0.5),
        }
        check_bounds("aircraft: polar", self, bounds)
        if self.lift_max <= self.lift_zero:
            raise ValueError(f"aircraft: polar: lift_max = {self.lift_max!r} is not above lift_zero")


@dataclass(frozen=True, kw_only=True)
class Jet:
    """Turbojet or turbofan, all engines together.

    Attributes
    ----------
    thrust_n : float
        Static thrust at sea level, without reheat [N].
    mach_linear, mach_square : float
        a and b of the factor 1 + a M + b M^2 on thrust.
    density_exponent : float
        n of the factor (density ratio)^n on thrust.
    idle : float
        Share of the largest thrust that is left when idling.
    consumption_kgpns : float
        Specific fuel consumption c0, static at sea level [kg/(N s)].
    consumption_mach_kgpns : float
        c1 of (c0 + c1 M) sqrt(temperature ratio) [kg/(N s)].
    """

    thrust_n: float
    mach_linear: float = 0.0
    mach_square: float = 0.0
    density_exponent: float = 1.0
    idle: float = 0.07
    consumption_kgpns: float
    consumption_mach_kgpns: float = 0.0

    def __post_init__(self) -> None:
        bounds = {
            "thrust_n": (1.0, 3.0e6),
            "mach_linear": (-2.0, 2.0),
            "mach_square": (-2.0, 2.0),
            "density_exponent": (0.0, 2.0),
            "idle": (0.0, 0.5),
            "consumption_kgpns": (0.0, 2.0e-4),
            "consumption_mach_kgpns": (0.0, 2.0e-4),
        }
        check_bounds("aircraft: engine", self, bounds)

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


@dataclass(frozen=True, kw_only=True)
class Propeller:
    """Piston engine and propeller.

    Attributes
    ----------
    power_w : float
        Shaft power at sea level [W]; it goes with density.
    efficiency : float
        Of the propeller.
    static_thrust_n : float
        Thrust standing still at sea level [N].
    idle : float
        Share of the largest thrust that is left when idling.
    consumption_kgpj : float
        Fuel per shaft work [kg/J].
    """

    power_w: float
    efficiency: float = 0.7
    static_thrust_n: float
    idle: float = 0.0
    consumption_kgpj: float

    def __post_init__(self) -> None:
        bounds = {
            "power_w": (10.0, 1.0e7),
            "efficiency": (0.1, 1.0),
            "static_thrust_n": (1.0, 1.0e6),
            "idle": (0.0, 0.5),
            "consumption_kgpj": (0.0, 1.0e-6),
        }
        check_bounds("aircraft: engine", self, bounds)

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


@dataclass(frozen=True, kw_only=True)
class Response:
    """How fast the aircraft follows its guidance, and how firmly that holds it to the plan. Ours.

    Attributes
    ----------
    bank_s, roll_s : float
        Time constants of bank angle and roll rate [s].
    lift_s, thrust_s : float
        Time constants of the angle of attack and of thrust [s].
    lateral_radps, vertical_radps, along_radps : float
        Natural frequencies with which deviations across, above and along the plan decay, critically damped [rad/s].
    """

    bank_s: float
    roll_s: float
    lift_s: float
    thrust_s: float
    lateral_radps: float
    vertical_radps: float
    along_radps: float

    def __post_init__(self) -> None:
        bounds = {
            "bank_s": (0.05, 5.0),
            "roll_s": (0.02, 2.0),
            "lift_s": (0.05, 5.0),
            "thrust_s": (0.05, 10.0),
        }
        check_bounds("aircraft: response", self, bounds)
        # Critically damped control through a lag t is stable up to 2/t; a quarter of that keeps it well damped.
        lags = {
            "lateral_radps": self.bank_s + self.roll_s,
            "vertical_radps": self.lift_s,
            "along_radps": self.thrust_s,
        }
        check_bounds("aircraft: response", self, {key: (0.01, 0.5 / lag) for key, lag in lags.items()})


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the aircraft is not flown beyond.

    Attributes
    ----------
    bank_rad, roll_rate_radps : float
        Largest bank angle [rad] and roll rate [rad/s].
    load_factor_max, load_factor_min : float
        Of the lift, in units of standard gravity.
    mach : float
        Largest Mach number.
    height_m : float
        Greatest height [m].
    """

    bank_rad: float
    roll_rate_radps: float
    load_factor_max: float
    load_factor_min: float
    mach: float
    height_m: float

    def __post_init__(self) -> None:
        bounds = {
            "bank_rad": (math.radians(5.0), math.radians(85.0)),
            "roll_rate_radps": (math.radians(1.0), math.radians(400.0)),
            "load_factor_max": (1.1, 12.0),
            "load_factor_min": (-6.0, 0.9),
            "mach": (0.05, 0.95),
            "height_m": (100.0, 20_000.0),
        }
        check_bounds("aircraft: limits", self, bounds)


@dataclass(frozen=True, kw_only=True)
class Aircraft:
    """An aircraft.

    Attributes
    ----------
    name : str
    mass_kg, empty_mass_kg : float
        At the start of the flight, and without fuel [kg].
    wing_area_m2 : float
        Reference area of the coefficients [m2].
    brake_drag : float
        Largest drag coefficient of the air brakes, which are out as far as the drag wanted is more than idling gives.
    clean, landing : Polar
    engine : Jet or Propeller
    response : Response
    limits : Limits
    """

    name: str
    mass_kg: float
    empty_mass_kg: float
    wing_area_m2: float
    brake_drag: float = 0.0
    clean: Polar
    landing: Polar
    engine: Jet | Propeller
    response: Response
    limits: Limits

    def __post_init__(self) -> None:
        bounds = {"mass_kg": (0.5, 6.0e5), "empty_mass_kg": (0.1, 4.0e5), "wing_area_m2": (0.05, 1000.0)}
        bounds["brake_drag"] = (0.0, 0.5)
        check_bounds("aircraft", self, bounds)
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
