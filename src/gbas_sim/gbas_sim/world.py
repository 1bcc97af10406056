"""A simulated world: satellites, reference receivers and one aircraft, an epoch at a time.

An epoch is a function of the parameters and its number: epochs can be made in any order, in any process, with the same
bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.ephemeris import Ephemeris
from gbas_core.gpstime import epoch_key, from_epoch_key
from gbas_core.observations import ObservationEpoch
from gbas_core.orbits import SatelliteState, group_delay_s
from gbas_core.record import FloatArray
from gbas_core.satellites import satellites_of
from gbas_core.signals import L2, N_BANDS
from gbas_sim.constellation import nominal_ephemeris
from gbas_sim.flight import StraightIn
from gbas_sim.receivers import AIRBORNE_RECEIVER, GROUND_RECEIVER, ReceiverBank, ReceiverParams
from gbas_sim.sightlines import elevations_rad, sightlines, sky, verticals
from gbas_sim.troposphere import Troposphere

MAX_RECEIVERS: Final = 4
# The aircraft's noise does not depend on how many reference receivers there are.
_AIRCRAFT_NUMBER: Final = 100
_EARTH_SURFACE_M: Final = (6.3e6, 6.5e6)


@dataclass(frozen=True, kw_only=True)
class WorldParams:
    """All a simulated world depends on.

    Attributes
    ----------
    receiver_ecef_m : tuple of (float, float, float)
        Antennas of 1 to 4 reference receivers, ECEF [m].
    flight : StraightIn
    troposphere : Troposphere
    ground, airborne : ReceiverParams
    systems : str
        ``"G"``, ``"E"`` or ``"GE"``.
    start_week, start_tow_s
        First epoch; whole milliseconds.
    interval_s : float
        Between epochs; whole milliseconds.
    seed : int
        Of everything random.
    """

    receiver_ecef_m: tuple[tuple[float, float, float], ...]
    flight: StraightIn
    troposphere: Troposphere = Troposphere()
    ground: ReceiverParams = GROUND_RECEIVER
    airborne: ReceiverParams = AIRBORNE_RECEIVER
    systems: str = "GE"
    start_week: int = 2400
    start_tow_s: float = 216_000.0
    interval_s: float = 0.5
    seed: int = 1

    def __post_init__(self) -> None:
        _within("seed", self.seed, 0, 2**63 - 1)
        _within("start_week", self.start_week, 1024, 8191)
        _within("start_tow_s", self.start_tow_s, 0.0, 604_799.999)
        _within("interval_s", self.interval_s, 0.01, 60.0)
        _whole_milliseconds("start_tow_s", self.start_tow_s)
        _whole_milliseconds("interval_s", self.interval_s)
        if not self.systems or len(set(self.systems)) != len(self.systems):
            raise ValueError(f"world: systems = {self.systems!r} is not G, E or GE")
        satellites_of(self.systems)
        if not 1 <= len(self.receiver_ecef_m) <= MAX_RECEIVERS:
            raise ValueError(
                f"world: receiver_ecef_m has {len(self.receiver_ecef_m)} positions, not 1 to {MAX_RECEIVERS}"
            )
        for number, position in enumerate(self.receiver_ecef_m, 1):
            if len(position) != 3 or not _EARTH_SURFACE_M[0] <= math.hypot(*position) <= _EARTH_SURFACE_M[1]:
                raise ValueError(f"world: receiver_ecef_m of receiver {number} = {position!r} is not on the Earth")

    @property
    def n_epochs(self) -> int:
        """Epochs until the aircraft crosses the threshold."""
        return int(self.flight.duration_s / self.interval_s) + 1


def _within(key: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"world: {key} = {value!r} is not within {low:g} to {high:g}")


def _whole_milliseconds(key: str, value: float) -> None:
    if abs(value * 1000.0 - round(value * 1000.0)) > 1e-6:
        raise ValueError(f"world: {key} = {value!r} is not a whole number of milliseconds")


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The aircraft's antenna at the instant of its observations: the time tag less the receiver's clock error.

    Attributes
    ----------
    gps_week, tow_s
        Time tag of the epoch.
    position_m, velocity_mps : (3,) arrays
        ECEF [m], [m/s].
    """

    gps_week: int
    tow_s: float
    position_m: FloatArray
    velocity_mps: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedEpoch:
    """What all receivers observe at one time tag, and where the aircraft is.

    Attributes
    ----------
    key : int
        Epoch key of the time tag, see :func:`gbas_core.gpstime.epoch_key`.
    ground : tuple of ObservationEpoch
        One a reference receiver.
    airborne : ObservationEpoch
    truth : Truth
    """

    key: int
    ground: tuple[ObservationEpoch, ...]
    airborne: ObservationEpoch
    truth: Truth


@dataclass(frozen=True, kw_only=True, eq=False)
class _Instant:
    """Where everything is at one time tag; reference receivers first, the aircraft last."""

    gps_week: int
    tow_s: float
    clock_s: FloatArray
    position_m: FloatArray
    velocity_mps: FloatArray
    seen: SatelliteState
    delay_m: FloatArray
    delay_rate_mps: FloatArray
    elevation_rad: FloatArray
    tracked: NDArray[np.bool_]
    tracked_before: NDArray[np.bool_]


class World:
    """A world with given parameters.

    Attributes
    ----------
    params : WorldParams
    ephemeris : Ephemeris
        What the satellites broadcast during the whole run, received an hour before it. A flight is shorter than the
        ephemerides' validity.
    """

    def __init__(self, params: WorldParams) -> None:
        self.params = params
        self.ephemeris: Ephemeris = nominal_ephemeris(
            params.start_week, params.start_tow_s, seed=params.seed, systems=satellites_of(params.systems)
        )
        self._start_key = epoch_key(params.start_week, params.start_tow_s)
        self._interval_ms = round(params.interval_s * 1000.0)
        self._sites_m = np.array(params.receiver_ecef_m, dtype=np.float64)
        self._banks = (
            ReceiverBank.make(params.ground, params.seed, tuple(range(len(self._sites_m)))),
            ReceiverBank.make(params.airborne, params.seed, (_AIRCRAFT_NUMBER,)),
        )
        masks_rad = [bank.params.elevation_mask_rad for bank in self._banks for _ in bank.numbers]
        self._masks_rad = np.array(masks_rad)[:, np.newaxis]
        self._group_delay_s = np.array([group_delay_s(self.ephemeris, band) for band in range(N_BANDS)])
        self._group_delay_s[L2] = np.nan

    def __len__(self) -> int:
        return self.params.n_epochs

    def __iter__(self) -> Iterator[SimulatedEpoch]:
        return map(self.epoch, range(len(self)))

    def epoch(self, number: int) -> SimulatedEpoch:
        """One epoch.

        Raises
        ------
        IndexError
            For a number that is not from 0 to ``len(world) - 1``.
        """
        if not 0 <= number < len(self):
            raise IndexError(f"epoch {number} is not within 0 to {len(self) - 1}")
        now = self._instant(number)
        lines = sightlines(
            self.ephemeris, now.gps_week, now.tow_s, now.clock_s, now.seen, now.position_m, now.velocity_mps
        ).delayed(now.delay_m, now.delay_rate_mps)
        observations: list[ObservationEpoch] = []
        for bank in self._banks:
            rows = slice(len(observations), len(observations) + len(bank.numbers))
            observations += bank.observe(
                gps_week=now.gps_week,
                tow_s=now.tow_s,
                epoch=number,
                clock_s=now.clock_s[rows],
                lines=lines.of(rows),
                group_delay_s=self._group_delay_s,
                elevation_rad=now.elevation_rad[rows],
                tracked=now.tracked[rows],
                tracked_before=now.tracked_before[rows],
            )
        truth = Truth(
            gps_week=now.gps_week, tow_s=now.tow_s, position_m=now.position_m[-1], velocity_mps=now.velocity_mps[-1]
        )
        key = epoch_key(now.gps_week, now.tow_s)
        return SimulatedEpoch(key=key, ground=tuple(observations[:-1]), airborne=observations[-1], truth=truth)

    def _instant(self, number: int) -> _Instant:
        """Where everything is at an epoch, and what is tracked then and was tracked an epoch earlier."""
        week, tow_s = from_epoch_key(self._start_key + number * self._interval_ms)
        back_s = 0.001 * self._interval_ms * np.array([0.0, 1.0])
        since_s = 0.001 * (number * self._interval_ms) - back_s
        clock_s = np.concatenate([bank.clock_s(since_s) for bank in self._banks], axis=-1)
        position_m, velocity_mps = self._motion(since_s - clock_s[:, -1])
        seen = sky(self.ephemeris, week, tow_s - back_s)
        up, height_m = verticals(position_m)
        elevation = elevations_rad(position_m, up, seen.position_m[:, np.newaxis])
        tracked = elevation >= self._masks_rad
        delay_m = self.params.troposphere.delay_m(height_m, elevation)
        return _Instant(
            gps_week=week,
            tow_s=tow_s,
            clock_s=clock_s[0],
            position_m=position_m[0],
            velocity_mps=velocity_mps[0],
            seen=SatelliteState(**{item.name: getattr(seen, item.name)[0] for item in fields(seen)}),
            delay_m=delay_m[0],
            delay_rate_mps=(delay_m[0] - delay_m[1]) / back_s[1],
            elevation_rad=elevation[0],
            tracked=tracked[0],
            tracked_before=tracked[1],
        )

    def _motion(self, since_start_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities ``(T, R, 3)`` of all receivers with the aircraft's at given times ``(T,)``."""
        position_m = np.empty((since_start_s.size, len(self._sites_m) + 1, 3))
        velocity_mps = np.zeros_like(position_m)
        position_m[:, :-1] = self._sites_m
        position_m[:, -1], velocity_mps[:, -1] = self.params.flight.state(since_start_s)
        return position_m, velocity_mps
