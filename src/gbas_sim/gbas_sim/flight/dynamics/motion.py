"""The flight integrated: the equations of motion under guidance, once, in time.

Besides the seven states of the equations there are four of the aircraft's answer to its guidance: bank angle and roll
rate, angle of attack, and pull.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp

from gbas_core.record import FloatArray
from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.equations import (
    Forces,
    Place,
    Surroundings,
    air_velocity,
    forces,
    path_rates,
    place,
    position_rates,
)
from gbas_sim.flight.dynamics.guidance import AirState, Command, Wanted, command, wanted_acceleration, wanted_table
from gbas_sim.flight.dynamics.reference import Reference
from gbas_sim.flight.dynamics.trim import Trim


class State(IntEnum):
    """Rows of the state vector."""

    AIRSPEED = 0
    CLIMB = 1
    HEADING = 2
    MASS = 3
    LATITUDE = 4  # from that at the start, so that rounding and tolerances are of the distance flown
    LONGITUDE = 5  # likewise
    HEIGHT = 6
    BANK = 7
    ROLL_RATE = 8
    ALPHA = 9
    PULL = 10


N_STATES: Final = len(State)
SPACING_S: Final = 0.05
"""Between samples of the flown states, about [s]."""
_RELATIVE: Final = 1e-8
# Speeds to 0.1 um/s, angles to 1e-9 rad, latitude and longitude to 6 um, height to 1 um, forces to 1e-9 of the weight.
_ABSOLUTE: Final = (1e-6, 1e-8, 1e-8, 1e-8, 1e-11, 1e-11, 1e-5, 1e-7, 1e-7, 1e-7, 1e-7)
_LONGEST_STEP_S: Final = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """An aircraft, what it moves in, and the plan it follows.

    Attributes
    ----------
    aircraft : Aircraft
    surroundings : Surroundings
    reference : Reference
    """

    aircraft: Aircraft
    surroundings: Surroundings
    reference: Reference

    def place(self, state: FloatArray) -> Place:
        """What there is where the aircraft is, for states (N_STATES, ...)."""
        velocity = air_velocity(state[State.AIRSPEED], state[State.CLIMB], state[State.HEADING])
        latitude = self.reference.path.lat_rad[0] + state[State.LATITUDE]
        return place(self.surroundings, latitude, state[State.HEIGHT], velocity)

    def forces(self, state: FloatArray, where: Place, landing: FloatArray) -> Forces:
        """Forces for states (N_STATES, ...)."""
        return forces(self.aircraft, where.air, state[State.AIRSPEED], state[State.ALPHA], state[State.PULL], landing)

    def command(self, state: FloatArray, where: Place, made: Forces, wanted: Wanted) -> Command:
        """What guidance asks for."""
        moved = state[State.LATITUDE], state[State.LONGITUDE]
        acceleration = wanted_acceleration(wanted, moved, state[State.HEIGHT], where, self.aircraft.response)
        flown = AirState(
            airspeed_mps=state[State.AIRSPEED],
            climb_rad=state[State.CLIMB],
            heading_rad=state[State.HEADING],
            bank_rad=state[State.BANK],
            alpha_rad=state[State.ALPHA],
            mass_kg=state[State.MASS],
        )
        return command(self.aircraft, where, made, acceleration, flown, wanted)

    def rates(self, state: FloatArray, wanted: Wanted) -> FloatArray:
        """Rates of states (N_STATES, ...) under guidance."""
        where = self.place(state)
        made = self.forces(state, where, wanted.landing)
        asked = self.command(state, where, made, wanted)
        airspeed, mass, bank = state[State.AIRSPEED], state[State.MASS], state[State.BANK]
        specific = (
            made.along_n / mass,
            made.normal_n * np.sin(bank) / mass,
            made.normal_n * np.cos(bank) / mass,
        )
        burn = self.aircraft.engine.consumption(airspeed, where.air) * made.thrust_n
        response, fastest = self.aircraft.response, self.aircraft.limits.roll_rate_radps
        roll = fastest * np.tanh((asked.bank_rad - bank) / (response.bank_s * fastest))
        return np.array(
            [
                *path_rates(airspeed, state[State.CLIMB], state[State.HEADING], specific, where),
                -burn,
                *position_rates(where, state[State.HEIGHT]),
                state[State.ROLL_RATE],
                (roll - state[State.ROLL_RATE]) / response.roll_s,
                (asked.alpha_rad - state[State.ALPHA]) / response.lift_s,
                (asked.pull_n - state[State.PULL]) / response.thrust_s,
            ]
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Flown:
    """A flight integrated, sampled evenly.

    Attributes
    ----------
    time_s : (n,) array
    states, rates : (N_STATES, n) arrays
    ground_enu_mps : (n, 3) array
        Velocity over the ground.
    landing, landing_rate : (n,) arrays
    """

    time_s: FloatArray
    states: FloatArray
    rates: FloatArray
    ground_enu_mps: FloatArray
    landing: FloatArray
    landing_rate: FloatArray


def fly(model: Model, trimmed: Trim) -> Flown:
    """Integrate a flight that begins as planned.

    Raises
    ------
    ValueError
        When the equations cannot be integrated: the aircraft has stalled or flown out of what they hold for.
    """
    table = wanted_table(model.reference, trimmed, model.aircraft.response)
    duration = float(model.reference.time_s[-1])
    scale = np.ones(N_STATES)
    scale[State.PULL] = trimmed.mass_kg[0] * 10.0
    scale[State.MASS] = trimmed.mass_kg[0]

    def rates(time_s: float, state: FloatArray) -> FloatArray:
        return model.rates(state, Wanted.of(table.value(time_s)))

    solved = solve_ivp(
        rates, (0.0, duration), begin(trimmed, model.reference), method="DOP853", dense_output=True,
        rtol=_RELATIVE, atol=np.array(_ABSOLUTE) * scale, max_step=_LONGEST_STEP_S, first_step=0.01,
    )  # fmt: skip
    if not solved.success or solved.sol is None:
        raise ValueError(f"the flight cannot be integrated beyond {solved.t[-1]:.1f} s: {solved.message}")
    times = np.linspace(0.0, duration, max(round(duration / SPACING_S), 10) + 1)
    states = solved.sol(times)
    columns, column_rates, _ = (np.moveaxis(part, -1, 0) for part in table.derivatives(times))
    wanted, changing = Wanted.of(columns), Wanted.of(column_rates)
    return Flown(
        time_s=times,
        states=states,
        rates=model.rates(states, wanted),
        ground_enu_mps=np.stack(model.place(states).ground_mps, axis=-1),
        landing=wanted.landing,
        landing_rate=changing.landing,
    )


def begin(trimmed: Trim, reference: Reference) -> FloatArray:
    """The planned state at the start, (N_STATES,)."""
    roll_rate = (trimmed.bank_rad[1] - trimmed.bank_rad[0]) / (reference.time_s[1] - reference.time_s[0])
    state = np.zeros(N_STATES)
    state[State.AIRSPEED], state[State.CLIMB] = trimmed.airspeed_mps[0], trimmed.climb_rad[0]
    state[State.HEADING], state[State.MASS] = trimmed.heading_rad[0], trimmed.mass_kg[0]
    state[State.HEIGHT], state[State.BANK] = reference.path.height_m[0], trimmed.bank_rad[0]
    state[State.ROLL_RATE], state[State.ALPHA], state[State.PULL] = roll_rate, trimmed.alpha_rad[0], trimmed.pull_n[0]
    return state
