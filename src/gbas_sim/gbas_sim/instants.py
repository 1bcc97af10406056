"""Where everything is at a time tag, and which signals can be received: receivers, satellites, faults, the site."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.orbits import SatelliteState
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signal.antenna import airframe_loss_db
from gbas_core.signals import L1, L5, N_BANDS
from gbas_sim.atmosphere.paths import SignalPaths
from gbas_sim.atmosphere.scintillation import Scintillation
from gbas_sim.faults.kinds import (
    RECEIVERS,
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
)
from gbas_sim.receivers.oscillators import ClockState
from gbas_sim.receivers.receiver import ReceiverBank, ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.receivers.site_scene import SceneParams, SiteScene
from gbas_sim.satellites.broadcast import Arc, Orbits
from gbas_sim.satellites.sightlines import sky
from gbas_sim.world_params import WorldParams

AIRCRAFT_NUMBER: Final = 100
"""Number of the aircraft's receiver: its noise does not depend on how many reference receivers there are."""
_KEPT: Final = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Instant:
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


class Instants:
    """The instants of a world, by the number of their epoch.

    Parameters
    ----------
    params : WorldParams
    orbits : Orbits
        The satellites.

    Attributes
    ----------
    banks : tuple of ReceiverBank
        Reference receivers, and the aircraft's if there is one.
    rows : list of slice
        Place of each bank among all receivers.
    sites_m : (R, 3) array
        Of the reference receivers, ECEF [m].
    receiver_faults : list of ReceiverFault
    """

    def __init__(self, params: WorldParams, orbits: Orbits) -> None:
        self.params = params
        self.orbits = orbits
        self._satellite_faults = [fault for fault in params.faults if isinstance(fault, SatelliteFault)]
        self.receiver_faults = [fault for fault in params.faults if isinstance(fault, ReceiverFault)]
        self._start_key = epoch_key(params.start_week, params.start_tow_s)
        self._interval_ms = round(params.interval_s * 1000.0)
        self.sites_m = np.array(params.receiver_ecef_m, dtype=np.float64)
        common = {"seed": params.seed, "interval_s": params.interval_s}
        numbers = tuple(range(len(self.sites_m)))
        banks = [ReceiverBank(params.ground, numbers=numbers, **common)]  # type: ignore[arg-type]
        if params.flight is not None:
            banks.append(ReceiverBank(params.airborne, numbers=(AIRCRAFT_NUMBER,), **common))  # type: ignore[arg-type]
        self.banks = tuple(banks)
        self.rows = [slice(0, len(numbers)), slice(len(numbers), None)][: len(banks)]
        self._numbers = tuple(number for bank in banks for number in bank.numbers)
        self._scintillation = (
            None if params.scintillation is None else Scintillation(params=params.scintillation, seed=params.seed)
        )
        self._scene = self._site_scene()
        self._kept: dict[int, Instant] = {}
        kinds = (*(params.ground for _ in numbers), *(() if params.flight is None else (params.airborne,)))
        self._masks_rad = np.array([each.elevation_mask_rad for each in kinds])
        self._listeners = tuple(_listener(*each) for each in zip(params.receiver_names, kinds, strict=True))
        self.first_break = self._first_break()

    def since_s(self, number: int) -> float:
        """Time tag of an epoch since the start [s]."""
        return 0.001 * (number * self._interval_ms)

    def at(self, number: int) -> Instant:
        """The last few are kept, since every epoch needs the one before; what is kept changes nothing."""
        if number not in self._kept:
            self._kept[number] = self._made(number)
            if len(self._kept) > _KEPT:
                del self._kept[next(iter(self._kept))]
        return self._kept[number]

    def elevations_rad(self, number: int) -> FloatArray:
        """Elevations ``(R, N_SATS)`` of the satellites at an epoch, the aircraft's last [rad]."""
        return self.at(number).elevation_rad

    def above_masks(self, number: int) -> NDArray[np.bool_]:
        """Satellites above the receivers' masks at an epoch, (R, N_SATS)."""
        return np.asarray(self.elevations_rad(number) >= self._masks_rad[:, np.newaxis])

    def moment(self, number: int) -> Moment:
        """An epoch as faults see it: by its time tag, whatever the receivers' clocks are."""
        since_s = np.full(len(self._listeners), self.since_s(number))
        return Moment(since_s, self.params.interval_s, self._listeners)

    def _first_break(self) -> int | None:
        """Epoch from which a signal in the sky may be lost; None is never."""
        params = self.params
        turns = params.flight is not None and params.flight.antenna_axis(0.0) is not None
        if turns or self._scene is not None or self._scintillation is not None:
            return 0
        starts_s = [max(fault.start_s, 0.0) for fault in params.faults if fault.weakens]
        return math.ceil(min(starts_s) / params.interval_s) if starts_s else None

    def _site_scene(self) -> SiteScene | None:
        params = self.params
        if params.scene is None and not params.buildings:
            return None
        return SiteScene(
            SceneParams(ground="") if params.scene is None else params.scene,
            params.buildings,
            station=params.station,
            receivers=len(self.sites_m),
            spacing_chips=_listener(RECEIVERS[0], params.ground).spacing_chips,
        )

    def _made(self, number: int) -> Instant:
        week, tow_s = from_epoch_key(self._start_key + number * self._interval_ms)
        since_s = self.since_s(number)
        clocks = [bank.errors.clocks(number) for bank in self.banks]
        clock = ClockState(*(np.concatenate(parts) for parts in zip(*clocks, strict=True)))
        if self.receiver_faults:
            jump_s = clock_jumps_s(self.receiver_faults, self.moment(number))
            clock = clock._replace(offset_s=clock.offset_s + jump_s)
        arc = self._arc(week, tow_s, since_s)
        seen = sky(arc, np.array(tow_s))
        paths = self._paths(week, tow_s, since_s, clock, seen)
        elevation = np.arcsin(np.clip(paths.sin_elevation, -1.0, 1.0))
        effect = self._effect(number, paths)
        change_db, held = self._disturbed(paths, effect)
        antenna = self._antenna_elevations_rad(since_s - clock.offset_s, paths, elevation, change_db)
        cn0, tracked = [], []
        for bank, rows in zip(self.banks, self.rows, strict=True):
            strength = bank.errors.cn0_dbhz(
                elevation[rows], antenna_elevation_rad=antenna[rows], change_db=change_db[rows]
            )
            cn0.append(strength)
            tracked.append(bank.errors.tracked(elevation[rows], strength) & held[rows])
        return Instant(
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

    def _paths(self, week: int, tow_s: float, since_s: float, clock: ClockState, seen: SatelliteState) -> SignalPaths:
        """Receivers and satellites at the instant; the aircraft is where it is when its clock says so."""
        position_m, velocity_mps = self.sites_m, np.zeros_like(self.sites_m)
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

    def _effect(self, number: int, paths: SignalPaths) -> SignalEffect | None:
        """What faults and the site's scene do to the signals; None is nothing."""
        effects = []
        if self._scene is not None:
            effects.append(self._scene.effect(paths))
        moment = self.moment(number)
        if self._satellite_faults:
            effects.append(signal_effect(self._satellite_faults, moment.since_s, moment.listeners, moment.interval_s))
        if self.receiver_faults:
            effects.append(receiver_effect(self.receiver_faults, moment, epoch=number, seed=self.params.seed))
        return functools.reduce(SignalEffect.plus, effects) if effects else None

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

    def _lost_knowingly(self, number: int) -> NDArray[np.bool_]:
        """Signals that a fault takes which says what their carriers count from afterwards."""
        faults = [fault for fault in self._satellite_faults if isinstance(fault, LossOfLock)]
        if self.first_break is None or not faults:
            return np.zeros(1, dtype=bool)
        moment = self.moment(number)
        return ~signal_effect(faults, moment.since_s, moment.listeners, moment.interval_s).tracked


def _listener(name: str, kind: ReceiverParams | ReceiverModel) -> Listener:
    if isinstance(kind, ReceiverModel):
        return Listener.of(name, kind.tracking)
    return Listener(name, (kind.spacing_chips[0], kind.spacing_chips[0], kind.spacing_chips[1]))
