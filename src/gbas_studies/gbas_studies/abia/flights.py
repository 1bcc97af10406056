"""Random flights of turns under the nominal constellation, as planned and as flown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from gbas_airborne.abia.prediction.kernels.trajectories import GRAVITY_MPS2
from gbas_core.gnss.frames import ecef_from_geodetic, los_and_range, rot_enu_ecef
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, satellites_of
from gbas_sim.satellites.constellation import nominal_slots

TICK_S: Final = 0.1
"""Between the times of a flight."""
SKY_S: Final = 1.0
"""For which lines of sight are kept."""
_WEEK: Final = 2300
_LEAST_GAP_S: Final = 1.0


@parameters
class FlightParams:
    """What flights are drawn from, each value uniform within its bounds.

    Bank, roll rate and the errors of the plan are those of the acceptance; speeds and durations are a fighter's, ours.
    """

    duration_s: Annotated[float, Parameter("of a flight", "s", 60.0, 36_000.0)] = 1500.0
    speed_mps: Annotated[tuple[float, float], Parameter("through the air", "m/s", 20.0, 500.0)] = (150.0, 300.0)
    bank_rad: Annotated[tuple[float, float], Parameter("of turns, either way", "deg", 1.0, 80.0)] = (
        math.radians(20.0),
        math.radians(62.0),
    )
    roll_rate_radps: Annotated[tuple[float, float], Parameter("into turns and out of them", "deg/s", 1.0, 180.0)] = (
        math.radians(15.0),
        math.radians(60.0),
    )
    turn_s: Annotated[
        tuple[float, float], Parameter("from the start of rolling in to that of rolling out", "s", 5.0, 600.0)
    ] = (20.0, 90.0)
    straight_s: Annotated[tuple[float, float], Parameter("between turns", "s", 5.0, 600.0)] = (10.0, 40.0)
    timing_sigma_s: Annotated[float, Parameter("1 sigma of lateness, of rolling in and out each", "s", 0.0, 10.0)] = 1.0
    bank_sigma_rad: Annotated[float, Parameter("1 sigma of the error of a turn's bank", "deg", 0.0, 20.0)] = (
        math.radians(3.0)
    )
    wander_sigma_rad: Annotated[float, Parameter("1 sigma of bank about that, in turns", "deg", 0.0, 20.0)] = 0.0
    wander_s: Annotated[float, Parameter("correlation time of that", "s", 0.1, 100.0)] = 3.0
    systems: Annotated[str, Parameter("constellations", choices=("G", "E", "GE"))] = "G"
    elevation_mask_rad: Annotated[float, Parameter("satellites lower are not used", "deg", 0.0, 45.0)] = math.radians(
        5.0
    )
    antenna_horizon_rad: Annotated[
        float, Parameter("satellites lower in the antenna's frame are not seen", "deg", 0.0, 45.0)
    ] = math.radians(5.0)
    max_latitude_rad: Annotated[float, Parameter("places are within", "deg", 0.0, 90.0)] = math.radians(65.0)

    def __post_init__(self) -> None:
        for name in ("speed_mps", "bank_rad", "roll_rate_radps", "turn_s", "straight_s"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"flights: {name}: {low!r} is above {high!r}")


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Rolling in at a time and out at another, at one roll rate."""

    start_s: float
    end_s: float
    bank_rad: float
    roll_rate_radps: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FlownFlight:
    """A flight; T times, :data:`TICK_S` apart.

    Attributes
    ----------
    flown : (T, 5) array
        Bank, pitch, heading, roll rate, speed, as the prediction has them.
    plan_bank_rad : (T,) array
    los_enu : (S, 3, N) array
        Lines of sight, :data:`SKY_S` apart, of the satellites that are above the elevation mask at any time, NaN below.
    turns, flown_turns : tuples of Turn
        As planned and as flown.
    """

    flown: FloatArray
    plan_bank_rad: FloatArray
    los_enu: FloatArray
    turns: tuple[Turn, ...]
    flown_turns: tuple[Turn, ...]


def bank_profile(turns: tuple[Turn, ...], time_s: FloatArray) -> FloatArray:
    """Bank over time (T,) of turns; between rolling in and out it is held [rad]."""
    bank = np.zeros_like(time_s)
    for each in turns:
        roll_s = abs(each.bank_rad) / each.roll_rate_radps
        within = np.clip((time_s - each.start_s) / roll_s, 0.0, 1.0) - np.clip((time_s - each.end_s) / roll_s, 0.0, 1.0)
        bank += each.bank_rad * within
    return bank


def drawn_flight(params: FlightParams, rng: np.random.Generator) -> FlownFlight:
    """One random flight."""
    time_s: FloatArray = TICK_S * np.arange(round(params.duration_s / TICK_S), dtype=np.float64)
    speed_mps, heading_rad = rng.uniform(*params.speed_mps), rng.uniform(0.0, 2.0 * math.pi)
    planned, flown = _turns(params, rng)
    los = sky(params, rng)
    bank = bank_profile(flown, time_s)
    if params.wander_sigma_rad > 0.0:
        bank += _wander(params, rng, time_s.size) * np.minimum(np.abs(bank) / math.radians(10.0), 1.0)
    rate = GRAVITY_MPS2 * np.tan(bank) / speed_mps  # level, without sideslip
    heading = heading_rad + np.concatenate([[0.0], np.cumsum(0.5 * TICK_S * (rate[1:] + rate[:-1]))])
    columns = bank, np.zeros_like(bank), heading, np.gradient(bank, TICK_S), np.full_like(bank, speed_mps)
    return FlownFlight(
        flown=np.stack(columns, axis=1), plan_bank_rad=bank_profile(planned, time_s), los_enu=los, turns=planned,
        flown_turns=flown,
    )  # fmt: skip


def _turns(params: FlightParams, rng: np.random.Generator) -> tuple[tuple[Turn, ...], tuple[Turn, ...]]:
    planned: list[Turn] = []
    flown: list[Turn] = []
    end_s = flown_end_s = 0.0
    while True:
        start_s = end_s + rng.uniform(*params.straight_s)
        turn_s = rng.uniform(*params.turn_s)
        bank_rad = rng.uniform(*params.bank_rad) * rng.choice([-1.0, 1.0])
        roll_rate = rng.uniform(*params.roll_rate_radps)
        late_s, later_s = rng.normal(0.0, params.timing_sigma_s, 2)
        error_rad = rng.normal(0.0, params.bank_sigma_rad)
        end_s = start_s + turn_s
        if end_s + abs(bank_rad) / roll_rate > params.duration_s:
            return tuple(planned), tuple(flown)
        planned.append(Turn(start_s=start_s, end_s=end_s, bank_rad=bank_rad, roll_rate_radps=roll_rate))
        flown_start_s = max(start_s + late_s, flown_end_s)
        flown_end_s = max(end_s + later_s, flown_start_s + _LEAST_GAP_S)
        flown.append(
            Turn(start_s=flown_start_s, end_s=flown_end_s, bank_rad=bank_rad + error_rad, roll_rate_radps=roll_rate)
        )


def _wander(params: FlightParams, rng: np.random.Generator, count: int) -> FloatArray:
    """A first-order Gauss-Markov process."""
    from scipy.signal import lfilter

    keep = math.exp(-TICK_S / params.wander_s)
    drive = rng.normal(0.0, params.wander_sigma_rad * math.sqrt(1.0 - keep**2), count)
    drive[0] = rng.normal(0.0, params.wander_sigma_rad)
    result: FloatArray = lfilter([1.0], [1.0, -keep], drive)
    return result


def sky(params: FlightParams, rng: np.random.Generator) -> FloatArray:
    """Lines of sight over a flight from a random place and time, (S, 3, N): where one flies matters less than when."""
    latitude = math.asin(rng.uniform(-1.0, 1.0) * math.sin(params.max_latitude_rad))
    place = latitude, rng.uniform(-math.pi, math.pi)
    start_s = rng.uniform(0.0, 500_000.0)
    at = ecef_from_geodetic(*place, 5000.0)
    turned = rot_enu_ecef(*place)
    chosen = satellites_of(params.systems)
    seconds = np.arange(0.0, params.duration_s, SKY_S)
    # positions at some times, straight between: 30 s of an orbit are straight to within 3e-6 rad from here
    knots = np.arange(0.0, params.duration_s + 60.0, 30.0)
    positions = np.stack([nominal_positions_m(start_s + each)[:, chosen] for each in knots])
    los = np.stack([turned @ los_and_range(at, each)[0] for each in positions])
    between = np.stack([[np.interp(seconds, knots, los[:, k, i]) for i in range(los.shape[2])] for k in range(3)])
    between /= np.linalg.norm(between, axis=0)
    between = np.where(between[2] >= math.sin(params.elevation_mask_rad), between, np.nan)
    kept = between[:, np.isfinite(between[2]).any(axis=1)]
    return np.ascontiguousarray(np.moveaxis(kept, 2, 0))


def nominal_positions_m(tow_s: float) -> FloatArray:
    """Satellites of the nominal constellations, (3, N_SATS), ECEF [m]; NaN where there is none."""
    slots = nominal_slots(_WEEK, tow_s)
    node, argument, inclination = slots.node_longitude_rad, slots.latitude_argument_rad, slots.inclination_rad
    cosine, sine = np.cos(argument), np.sin(argument)
    positions = slots.semi_major_m * np.stack(
        [
            np.cos(node) * cosine - np.sin(node) * np.cos(inclination) * sine,
            np.sin(node) * cosine + np.cos(node) * np.cos(inclination) * sine,
            np.sin(inclination) * sine,
        ]
    )
    return np.asarray(positions.reshape(3, N_SATS))
