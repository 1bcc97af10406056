"""A simulated world: satellites, reference receivers and at most one aircraft, an epoch at a time.

An epoch is a function of the parameters and its number: epochs can be made in any order, in any process, with the same
bits.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, InstanceOf

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.gnss.orbits import SatelliteState, group_delay_s
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import N_SATS, SAT_INDEX, satellites_of
from gbas_core.signal.antenna import airframe_loss_db
from gbas_core.signals import L1, L2, L5, N_BANDS
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import Ionosphere, IonosphereParams
from gbas_sim.atmosphere.paths import Delay, SignalPaths, Station
from gbas_sim.atmosphere.scintillation import Scintillation, ScintillationParams
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox
from gbas_sim.faults.kinds import (
    RECEIVERS,
    FrozenOutput,
    Listener,
    LossOfLock,
    Moment,
    OrbitFault,
    ReceiverFault,
    SatelliteFault,
    SignalEffect,
    clock_jumps_s,
    displaced,
    receiver_effect,
    signal_effect,
    source_epochs,
    with_wrong_broadcasts,
)
from gbas_sim.receivers.arcs import Breaks, Passes, arc_numbers
from gbas_sim.receivers.oscillators import ClockState
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, Arrivals, ReceiverBank, ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.receivers.site_scene import Building, SceneParams, SiteScene
from gbas_sim.satellites.broadcast import Arc, Orbits, almanac_orbits, nominal_orbits, recorded_orbits
from gbas_sim.satellites.sightlines import sightlines, sky

MAX_RECEIVERS: Final = 4
AIRCRAFT_NUMBER: Final = 100
"""Number of the aircraft's receiver: its noise does not depend on how many reference receivers there are."""
LONGEST_S: Final = 7.0 * 86_400.0
_EARTH_SURFACE_M: Final = (6.3e6, 6.5e6)
_FARTHEST_M: Final = 20_000.0
_INSTANTS_KEPT: Final = 6
_PASSES_S: Final = 300.0
"""Satellites that set for less may be found with the carrier they had."""


@runtime_checkable
class FlightPath(Protocol):
    """Where an aircraft is: :class:`gbas_sim.flight.straight_in.StraightIn` or
    :class:`gbas_sim.flight.dynamics.Flight`.
    """

    @property
    def duration_s(self) -> float:
        """From the start to the end [s]."""
        ...

    def state(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Position and velocity ``(..., 3)``, ECEF [m], [m/s], at times since the start ``(...)`` [s]."""
        ...

    def antenna_axis(self, since_start_s: ArrayLike) -> FloatArray | None:
        """Where the antenna points, unit vectors ``(..., 3)``, ECEF, at times; None is straight up at all of them."""
        ...

    def attitude(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Roll, pitch and true heading at times [rad]."""
        ...


def _files(value: Any) -> Any:
    """One file as a list of one; empty names left out."""
    files = [value] if isinstance(value, str) else value
    return [each for each in files if each != ""] if isinstance(files, list | tuple) else files


@parameters
class RunParams:
    """When a run is, of which satellites, and with which random numbers."""

    systems: Annotated[str, Parameter("constellations", choices=("G", "E", "GE", "EG"))] = "GE"
    start_week: Annotated[int, Parameter("GPS week of the first epoch", "weeks", 1024, 8191)] = 2400
    start_tow_s: Annotated[
        float, Parameter("time of week of the first epoch, whole milliseconds", "s", 0.0, 604_799.999)
    ] = 216_000.0
    interval_s: Annotated[float, Parameter("between epochs, whole milliseconds", "s", 0.01, 60.0)] = 0.5
    seed: Annotated[int, Parameter("of everything random", "-", 0, 2**63 - 1)] = 1
    duration_s: Annotated[
        float | None, Parameter("of the run; that of the flight unless given", "s", 0.0, LONGEST_S)
    ] = None

    def __post_init__(self) -> None:
        for key in ("start_tow_s", "interval_s"):
            value = getattr(self, key)
            if abs(value * 1000.0 - round(value * 1000.0)) > 1e-6:
                raise ValueError(f"{key} = {value!r} is not a whole number of milliseconds")


@parameters
class ConstellationParams:
    """Where orbits are from; without any file they are nominal."""

    almanac: Annotated[str, Parameter("YUMA or SEM file whose orbits are taken; empty is none")] = ""
    navigation: Annotated[
        tuple[str, ...], BeforeValidator(_files), Parameter("RINEX navigation files whose orbits are taken")
    ] = ()

    def __post_init__(self) -> None:
        if self.almanac and self.navigation:
            raise ValueError("almanac and navigation are both given; orbits have one source")


@parameters
class WorldParams(RunParams, ConstellationParams):
    """All a simulated world depends on.

    Attributes
    ----------
    receiver_ecef_m : tuple of (float, float, float)
        Antennas of 1 to 4 reference receivers, ECEF [m].
    flight : FlightPath or None
        None is a station alone.
    station_ecef_m : (float, float, float), optional
        What distances of the atmosphere are measured from [m]; the first receiver unless given.
    troposphere : Troposphere
    weather : tuple of WeatherBox
    ionosphere : IonosphereParams, optional
        None is none.
    fronts : tuple of WedgeFront or PlasmaBubble
    scintillation : ScintillationParams, optional
        None is none.
    faults : tuple of SatelliteFault or ReceiverFault
    scene : SceneParams, optional
        Ground that reflects at the reference receivers; None is none.
    buildings : tuple of Building
        Around them; on ground that reflects nothing, unless there is a scene.
    ground, airborne : ReceiverParams or ReceiverModel
    """

    receiver_ecef_m: tuple[tuple[float, float, float], ...]
    flight: InstanceOf[FlightPath] | None
    station_ecef_m: tuple[float, float, float] | None = None
    troposphere: Troposphere = Troposphere()
    weather: tuple[WeatherBox, ...] = ()
    ionosphere: IonosphereParams | None = None
    fronts: tuple[WedgeFront | PlasmaBubble, ...] = ()
    scintillation: ScintillationParams | None = None
    faults: tuple[InstanceOf[SatelliteFault] | InstanceOf[ReceiverFault], ...] = ()
    scene: SceneParams | None = None
    buildings: tuple[Building, ...] = ()
    ground: InstanceOf[ReceiverParams] | InstanceOf[ReceiverModel] = GROUND_RECEIVER
    airborne: InstanceOf[ReceiverParams] | InstanceOf[ReceiverModel] = AIRBORNE_RECEIVER

    def __post_init__(self) -> None:
        RunParams.__post_init__(self)
        ConstellationParams.__post_init__(self)
        self._check_duration()
        self._check_sites()

    def _check_duration(self) -> None:
        if self.flight is None and self.duration_s is None:
            raise ValueError("world: duration_s is missing, and there is no flight to take it from")
        if self.duration_s is not None and self.flight is not None and self.duration_s > self.flight.duration_s:
            longest = self.flight.duration_s
            raise ValueError(f"world: duration_s = {self.duration_s:g} is longer than the flight, {longest:g}")

    def _check_sites(self) -> None:
        if not 1 <= len(self.receiver_ecef_m) <= MAX_RECEIVERS:
            raise ValueError(
                f"world: receiver_ecef_m has {len(self.receiver_ecef_m)} positions, not 1 to {MAX_RECEIVERS}"
            )
        for number, position in enumerate(self.receiver_ecef_m, 1):
            if len(position) != 3 or not _EARTH_SURFACE_M[0] <= math.hypot(*position) <= _EARTH_SURFACE_M[1]:
                raise ValueError(f"world: receiver_ecef_m of receiver {number} = {position!r} is not on the Earth")
            away_m = math.dist(position, self.station.ecef_m)
            if not away_m <= _FARTHEST_M:
                raise ValueError(
                    f"world: receiver_ecef_m of receiver {number} is {away_m:.0f} m from the station, more than "
                    f"{_FARTHEST_M:.0f}"
                )

    @property
    def receiver_names(self) -> tuple[str, ...]:
        """Names of the receivers, as in :data:`gbas_sim.faults.kinds.RECEIVERS`; the aircraft's last."""
        ground = RECEIVERS[: len(self.receiver_ecef_m)]
        return ground if self.flight is None else (*ground, RECEIVERS[-1])

    @property
    def station(self) -> Station:
        """What distances are measured from."""
        return Station(ecef_m=self.station_ecef_m or self.receiver_ecef_m[0])

    @property
    def length_s(self) -> float:
        """Of the run [s]."""
        if self.duration_s is not None:
            return self.duration_s
        return self.flight.duration_s if self.flight is not None else 0.0

    @property
    def n_epochs(self) -> int:
        """Epochs of the run; a flight's last is at or before its end."""
        return int(self.length_s / self.interval_s) + 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The aircraft's antenna at the instant of its observations: the time tag less the receiver's clock error.

    Attributes
    ----------
    gps_week, tow_s
        Time tag of the epoch.
    position_m, velocity_mps : (3,) arrays
        ECEF [m], [m/s].
    roll_rad, pitch_rad, heading_rad : float
        Attitude: right wing down, nose up, true heading clockwise from north.
    """

    gps_week: int
    tow_s: float
    position_m: FloatArray
    velocity_mps: FloatArray
    roll_rad: float
    pitch_rad: float
    heading_rad: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedEpoch:
    """What all receivers observe at one time tag, and where the aircraft is.

    Attributes
    ----------
    key : int
        Epoch key of the time tag, see :func:`gbas_core.gnss.gpstime.epoch_key`.
    ground : tuple of ObservationEpoch
        One a reference receiver.
    airborne : ObservationEpoch or None
        None without an aircraft.
    truth : Truth or None
    """

    key: int
    ground: tuple[ObservationEpoch, ...]
    airborne: ObservationEpoch | None
    truth: Truth | None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Instant:
    """Where everything is at one time tag and what arrives; reference receivers first, the aircraft last.

    Signals are ``unbroken`` that are tracked, or not because of a loss of lock that says itself what comes of it.
    """

    gps_week: int
    tow_s: float
    clock: ClockState
    arc: Arc
    seen: SatelliteState
    paths: SignalPaths
    elevation_rad: FloatArray
    cn0_dbhz: FloatArray
    tracked: NDArray[np.bool_]
    unbroken: NDArray[np.bool_]
    effect: SignalEffect | None


def open_orbits(params: WorldParams) -> Orbits:
    """The satellites of a world.

    Raises
    ------
    AlmanacError, RinexError
        When a file cannot be used.
    """
    span = (params.start_week, params.start_tow_s, params.length_s)
    systems = satellites_of(params.systems)
    if params.navigation:
        return recorded_orbits([Path(each) for each in params.navigation], *span, systems=systems)
    if params.almanac:
        return almanac_orbits(params.almanac, *span, seed=params.seed, systems=systems)
    return nominal_orbits(*span, seed=params.seed, systems=systems)


class World:
    """A world with given parameters.

    Parameters
    ----------
    params : WorldParams
    orbits : Orbits, optional
        The satellites, in place of those the parameters say.

    Attributes
    ----------
    params : WorldParams
    orbits : Orbits
    ephemerides : tuple of Ephemeris
        What the satellites broadcast, in order of reception.
    """

    def __init__(self, params: WorldParams, *, orbits: Orbits | None = None) -> None:
        self.params = params
        self.orbits = open_orbits(params) if orbits is None else orbits
        self._satellite_faults = [fault for fault in params.faults if isinstance(fault, SatelliteFault)]
        self._receiver_faults = [fault for fault in params.faults if isinstance(fault, ReceiverFault)]
        self.ephemerides: tuple[Ephemeris, ...] = with_wrong_broadcasts(
            self.orbits.received, self._satellite_faults, params.start_week, params.start_tow_s
        )
        self._start_key = epoch_key(params.start_week, params.start_tow_s)
        self._interval_ms = round(params.interval_s * 1000.0)
        self._sites_m = np.array(params.receiver_ecef_m, dtype=np.float64)
        common = {"seed": params.seed, "interval_s": params.interval_s}
        numbers = tuple(range(len(self._sites_m)))
        banks = [ReceiverBank(params.ground, numbers=numbers, **common)]  # type: ignore[arg-type]
        if params.flight is not None:
            banks.append(ReceiverBank(params.airborne, numbers=(AIRCRAFT_NUMBER,), **common))  # type: ignore[arg-type]
        self._banks = tuple(banks)
        self._numbers = tuple(number for bank in banks for number in bank.numbers)
        self._rows = [slice(0, len(numbers)), slice(len(numbers), None)][: len(banks)]
        self._group_delay_s = _group_delays_s(self.orbits)
        self._ionosphere = None if params.ionosphere is None else Ionosphere(params=params.ionosphere, seed=params.seed)
        self._scintillation = (
            None if params.scintillation is None else Scintillation(params=params.scintillation, seed=params.seed)
        )
        self._scene = self._site_scene()
        self._instants: dict[int, _Instant] = {}
        kinds = (*(params.ground for _ in numbers), *(() if params.flight is None else (params.airborne,)))
        self._masks_rad = np.array([each.elevation_mask_rad for each in kinds])
        self._passes = Passes(self.above_masks, max(1, round(_PASSES_S / params.interval_s)))
        self._listeners = tuple(_listener(*each) for each in zip(params.receiver_names, kinds, strict=True))
        check_threats(self)

    def _first_break(self) -> int | None:
        """Epoch from which a signal in the sky may be lost; None is never."""
        params = self.params
        turns = params.flight is not None and params.flight.antenna_axis(0.0) is not None
        if turns or self._scene is not None or self._scintillation is not None:
            return 0
        starts_s = [max(fault.start_s, 0.0) for fault in params.faults if fault.weakens]
        return math.ceil(min(starts_s) / params.interval_s) if starts_s else None

    @functools.cached_property
    def _breaks(self) -> Breaks | None:
        first = self._first_break()
        return None if first is None else Breaks(self._unbroken, first)

    def _unbroken(self, number: int) -> NDArray[np.bool_]:
        return self._instant(number).unbroken

    def _arcs(self, number: int) -> IntArray:
        """Numbers of the carriers' arcs, (R, N_BANDS, N_SATS)."""
        breaks = None if self._breaks is None else self._breaks.at(number)
        return arc_numbers(self._passes.at(number), breaks)

    def _site_scene(self) -> SiteScene | None:
        params = self.params
        if params.scene is None and not params.buildings:
            return None
        return SiteScene(
            SceneParams(ground="") if params.scene is None else params.scene,
            params.buildings,
            station=params.station,
            receivers=len(self._sites_m),
            spacing_chips=_listener(RECEIVERS[0], params.ground).spacing_chips,
        )

    @property
    def ephemeris(self) -> Ephemeris:
        """What the satellites broadcast at the start."""
        return self.ephemerides[0]

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
        observations = self._with_frozen(number, self._observations(number))
        count = len(self._sites_m)
        return SimulatedEpoch(
            key=epoch_key(now.gps_week, now.tow_s),
            ground=observations[:count],
            airborne=observations[count] if len(observations) > count else None,
            truth=self._truth(number, now),
        )

    def _truth(self, number: int, now: _Instant) -> Truth | None:
        if self.params.flight is None:
            return None
        since_s = 0.001 * (number * self._interval_ms) - now.clock.offset_s[-1]
        roll, pitch, heading = self.params.flight.attitude(np.array(since_s))
        return Truth(
            gps_week=now.gps_week,
            tow_s=now.tow_s,
            position_m=now.paths.position_m[-1],
            velocity_mps=now.paths.velocity_mps[-1],
            roll_rad=float(roll),
            pitch_rad=float(pitch),
            heading_rad=float(heading),
        )

    def _observations(self, number: int) -> tuple[ObservationEpoch, ...]:
        """What receivers would observe that are not frozen."""
        before, now = self._instant(number - 1), self._instant(number)
        arrivals = self._arrivals(now, before.tracked, self._arcs(number))
        observations: list[ObservationEpoch] = []
        for bank, rows in zip(self._banks, self._rows, strict=True):
            observations += bank.observe(
                gps_week=now.gps_week,
                tow_s=now.tow_s,
                epoch=number,
                clock=ClockState(now.clock.offset_s[rows], now.clock.drift[rows]),
                group_delay_s=self._group_delay_s,
                seen=_of(arrivals, rows),
            )
        return tuple(observations)

    def _with_frozen(self, number: int, observations: tuple[ObservationEpoch, ...]) -> tuple[ObservationEpoch, ...]:
        """Observations with those of earlier epochs where outputs are frozen."""
        if not any(isinstance(fault, FrozenOutput) for fault in self._receiver_faults):
            return observations
        sources = source_epochs(self._receiver_faults, self._moment(number), number)
        mixed = list(observations)
        for source in sorted(set(sources[sources != number].tolist())):
            earlier = self._observations(source) if source >= 0 else None
            for row in np.flatnonzero((sources == source).any(axis=1)):
                mixed[row] = _mixed(mixed[row], None if earlier is None else earlier[row], sources[row] == source)
        return tuple(mixed)

    def elevations_rad(self, number: int) -> FloatArray:
        """Elevations ``(R, N_SATS)`` of the satellites at an epoch, the aircraft's last [rad]."""
        return self._instant(number).elevation_rad

    def paths(self, number: int) -> SignalPaths:
        """Signal paths at an epoch, the aircraft's last."""
        return self._instant(number).paths

    def above_masks(self, number: int) -> NDArray[np.bool_]:
        """Satellites above the receivers' masks at an epoch, (R, N_SATS)."""
        return np.asarray(self.elevations_rad(number) >= self._masks_rad[:, np.newaxis])

    def _instant(self, number: int) -> _Instant:
        """The last few are kept, since every epoch needs the one before; what is kept changes nothing."""
        if number not in self._instants:
            self._instants[number] = self._make_instant(number)
            if len(self._instants) > _INSTANTS_KEPT:
                del self._instants[next(iter(self._instants))]
        return self._instants[number]

    def _make_instant(self, number: int) -> _Instant:
        week, tow_s = from_epoch_key(self._start_key + number * self._interval_ms)
        since_s = 0.001 * (number * self._interval_ms)
        clocks = [bank.errors.clocks(number) for bank in self._banks]
        clock = ClockState(*(np.concatenate(parts) for parts in zip(*clocks, strict=True)))
        if self._receiver_faults:
            jump_s = clock_jumps_s(self._receiver_faults, self._moment(number))
            clock = clock._replace(offset_s=clock.offset_s + jump_s)
        arc = self._arc(week, tow_s, since_s)
        seen = sky(arc, np.array(tow_s))
        paths = self._paths(week, tow_s, since_s, clock, seen)
        elevation = np.arcsin(np.clip(paths.sin_elevation, -1.0, 1.0))
        effect = self._effect(number, paths)
        change_db, held = self._disturbed(paths, effect)
        antenna = self._antenna_elevations_rad(since_s - clock.offset_s, paths, elevation, change_db)
        cn0, tracked = [], []
        for bank, rows in zip(self._banks, self._rows, strict=True):
            strength = bank.errors.cn0_dbhz(
                elevation[rows], antenna_elevation_rad=antenna[rows], change_db=change_db[rows]
            )
            cn0.append(strength)
            tracked.append(bank.errors.tracked(elevation[rows], strength) & held[rows])
        return _Instant(
            gps_week=week,
            tow_s=tow_s,
            clock=clock,
            arc=arc,
            seen=seen,
            paths=paths,
            elevation_rad=elevation,
            cn0_dbhz=np.concatenate(cn0),
            tracked=np.concatenate(tracked),
            unbroken=np.concatenate(tracked) | self._lost_knowingly(number),
            effect=effect,
        )

    def _antenna_elevations_rad(
        self, since_s: FloatArray, paths: SignalPaths, elevation_rad: FloatArray, change_db: FloatArray
    ) -> FloatArray:
        """Elevations ``(R, N_SATS)`` above the antennas' planes; takes from `change_db` what the airframe hides."""
        flight = self.params.flight
        axis = None if flight is None else flight.antenna_axis(since_s[-1])
        if axis is None:
            return elevation_rad
        own = np.arcsin(np.clip(axis @ paths.los[-1], -1.0, 1.0))
        change_db[-1] -= airframe_loss_db(own)
        return np.concatenate([elevation_rad[:-1], own[np.newaxis]])

    def _lost_knowingly(self, number: int) -> NDArray[np.bool_]:
        """Signals that a fault takes which says what their carriers count from afterwards."""
        faults = [fault for fault in self._satellite_faults if isinstance(fault, LossOfLock)]
        if self._breaks is None or not faults:
            return np.zeros(1, dtype=bool)
        moment = self._moment(number)
        return ~signal_effect(faults, moment.since_s, moment.listeners, moment.interval_s).tracked

    def _arc(self, week: int, tow_s: float, since_s: float) -> Arc:
        """Orbits around a time, with those that have left what they broadcast."""
        arc = self.orbits.arc(week, tow_s)
        faults = [fault for fault in self._satellite_faults if isinstance(fault, OrbitFault)]
        if not faults:
            return arc

        def faulty(times_s: FloatArray) -> SatelliteState:
            state = arc(times_s)
            return displaced(state, faults, np.broadcast_to(times_s - (tow_s - since_s), state.clock_s.shape))

        return faulty

    def _moment(self, number: int) -> Moment:
        """An epoch as faults see it: by its time tag, whatever the receivers' clocks are."""
        since_s = np.full(len(self._listeners), 0.001 * (number * self._interval_ms))
        return Moment(since_s, self.params.interval_s, self._listeners)

    def _effect(self, number: int, paths: SignalPaths) -> SignalEffect | None:
        """What faults and the site's scene do to the signals; None is nothing."""
        effects = []
        if self._scene is not None:
            effects.append(self._scene.effect(paths))
        moment = self._moment(number)
        if self._satellite_faults:
            effects.append(signal_effect(self._satellite_faults, moment.since_s, moment.listeners, moment.interval_s))
        if self._receiver_faults:
            effects.append(receiver_effect(self._receiver_faults, moment, epoch=number, seed=self.params.seed))
        return functools.reduce(SignalEffect.plus, effects) if effects else None

    def _paths(self, week: int, tow_s: float, since_s: float, clock: ClockState, seen: SatelliteState) -> SignalPaths:
        """Receivers and satellites at the instant; the aircraft is where it is when its clock says so."""
        position_m, velocity_mps = self._sites_m, np.zeros_like(self._sites_m)
        if self.params.flight is not None:
            place, moving = self.params.flight.state(np.array(since_s - clock.offset_s[-1]))
            position_m = np.concatenate([position_m, place[np.newaxis]])
            velocity_mps = np.concatenate([velocity_mps, moving[np.newaxis]])
        return SignalPaths(
            gps_week=week,
            tow_s=tow_s,
            since_start_s=since_s,
            station=self.params.station,
            position_m=position_m,
            velocity_mps=velocity_mps,
            satellite_m=seen.position_m,
            satellite_mps=seen.velocity_mps,
        )

    def _disturbed(self, paths: SignalPaths, effect: SignalEffect | None) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Change of C/N0 [dB] and signals that can be held, ``(R, N_BANDS, N_SATS)`` each."""
        shape = (len(self._numbers), N_BANDS, N_SATS)
        change_db, held = np.zeros(shape), np.ones(shape, dtype=bool)
        if self._scintillation is not None:
            scintillation = self._scintillation.epoch(paths, self._numbers)
            held &= ~scintillation.lost[:, np.newaxis]
            for band in (L1, L5):
                change_db[:, band] -= scintillation.fading_db(band)
        if effect is not None:
            held &= effect.tracked
            change_db += effect.cn0_db
        return change_db, held

    def _arrivals(self, now: _Instant, tracked_before: NDArray[np.bool_], arcs: IntArray) -> Arrivals:
        paths = now.paths
        lines = sightlines(now.arc, now.tow_s, now.clock.offset_s, now.seen, paths.position_m, paths.velocity_mps)
        air = self.params.troposphere.delay(paths)
        for box in self.params.weather:
            air = air + box.delay(paths)
        nothing = np.zeros_like(air.delay_m)
        dispersive = Delay(delay_m=nothing, rate_mps=nothing)
        for effect in (*(() if self._ionosphere is None else (self._ionosphere,)), *self.params.fronts):
            dispersive = dispersive + effect.delay(paths)
        effect = now.effect
        return Arrivals(
            lines=lines.delayed(air.delay_m, air.rate_mps),
            dispersive=dispersive,
            code_m=0.0 if effect is None else effect.code_m,
            carrier_m=0.0 if effect is None else effect.carrier_m,
            rate_mps=0.0 if effect is None else effect.rate_mps,
            cn0_dbhz=now.cn0_dbhz,
            elevation_rad=now.elevation_rad,
            tracked=now.tracked,
            tracked_before=tracked_before if effect is None else tracked_before & ~effect.slipped,
            arcs=arcs,
        )


def _mixed(now: ObservationEpoch, earlier: ObservationEpoch | None, satellites: NDArray[np.bool_]) -> ObservationEpoch:
    """An epoch with the observations of some satellites from an earlier one, or without them if there is none."""
    arrays = {name: value for name, value in vars(now).items() if isinstance(value, np.ndarray)}
    values: dict[str, Any] = {
        name: np.where(satellites, np.nan if earlier is None else getattr(earlier, name), value)
        for name, value in arrays.items()
    }
    return replace(now, **values)


def _listener(name: str, kind: ReceiverParams | ReceiverModel) -> Listener:
    if isinstance(kind, ReceiverModel):
        return Listener.of(name, kind.tracking)
    return Listener(name, (kind.spacing_chips[0], kind.spacing_chips[0], kind.spacing_chips[1]))


def check_threats(world: World) -> None:
    """Refuse what concerns a receiver that is not there, or a satellite that no receiver sees while it lasts.

    Raises
    ------
    ValueError
        Naming the threat and the receiver or satellite.
    """
    params = world.params
    for fault in params.faults:
        names = (fault.receiver,) if isinstance(fault, ReceiverFault) else getattr(fault, "receivers", ())
        for name in names:
            if name not in params.receiver_names:
                there = ", ".join(params.receiver_names)
                raise ValueError(f"{fault.owner}: receiver {name!r} is not there; there are {there}")
        satellites = fault.satellites if isinstance(fault, ReceiverFault) else (fault.satellite,)
        for satellite in satellites:
            _check_up(world, fault.owner, satellite, fault.start_s, fault.end_s)
    for front in params.fronts:
        for satellite in front.satellites:
            _check_up(world, "front" if isinstance(front, WedgeFront) else "bubble", satellite, 0.0, math.inf)


def _check_up(world: World, owner: str, satellite: str, start_s: float, end_s: float) -> None:
    """Refuse a satellite that no receiver tracks at any of some forty times of a fault."""
    params, index = world.params, SAT_INDEX[satellite]
    first = math.ceil(max(start_s, 0.0) / params.interval_s)
    last = min(len(world) - 1, math.floor(min(end_s, params.length_s) / params.interval_s))
    if first > last:
        raise ValueError(f"{owner}: start_s = {start_s:g} is after the end of the run, {params.length_s:g} s")
    for number in range(first, last + 1, max(1, (last - first) // 40)):
        if bool(world.above_masks(number)[:, index].any()):
            return
    raise ValueError(f"{owner}: satellite = {satellite!r} is not up between {max(start_s, 0.0):g} and "
                     f"{min(end_s, params.length_s):g} s")  # fmt: skip


def _group_delays_s(orbits: Orbits) -> FloatArray:
    """Group delays (N_BANDS, N_SATS) of the first ephemeris each satellite has; NaN on L2, which is not simulated."""
    delays = np.full((N_BANDS, N_SATS), np.nan)
    for truth in orbits.truth:
        own = np.array([group_delay_s(truth, band) for band in range(N_BANDS)])
        delays = np.where(np.isnan(delays), own, delays)
    delays[L2] = np.nan
    return delays


def _of(arrivals: Arrivals, rows: slice) -> Arrivals:
    """The signals at some of the receivers."""
    lines = arrivals.lines.of(rows)
    delay = Delay(**{item.name: getattr(arrivals.dispersive, item.name)[rows] for item in fields(Delay)})
    parts = {name: value[rows] for name, value in arrivals._asdict().items() if isinstance(value, np.ndarray)}
    return arrivals._replace(lines=lines, dispersive=delay, **parts)
